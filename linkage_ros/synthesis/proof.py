# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""
The proof of a design: every position that was asked for, analysed again on both assemblies.

The course of a four-bar through its positions is their branch, circuit, order and transmission
angle.

A four-bar has two assemblies. Where the crank turns fully they never meet, and each is a circuit:
what lies on the other can be reached only by taking the linkage apart. Else the crank moves
between toggles, in one range where no link turns fully, in two where one does; in a range both
assemblies join at the toggles, so that they are two branches of one circuit (T. R. Chase and J. A.
Mirth, Circuits and branches of single-degree-of-freedom planar linkages, Journal of Mechanical
Design 115 (1993) 223-230). Circuits touch where a linkage can fold flat: at a change point.

The functions of the course take any number of linkages at once. Directions of the crank are those
of the vector O2→A less that of O2→O4, in [rad].
"""

from __future__ import annotations

from dataclasses import replace
from math import inf, remainder, tau
from typing import NamedTuple

from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.results import Position
from linkage_ros.kinematics.rounding import UNIT_ROUNDOFF
from linkage_ros.kinematics.status import Status
from linkage_ros.synthesis.design import Assembly, COUPLER, Design, Wanted
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_TURN = 2.0 * np.pi

_SAME = 1e-9
"""Crank angles nearer than this are the same, in [rad]."""


class Mobility(NamedTuple):
    """
    Where four-bars can go.

    Attributes
    ----------
    excess
        How much the shortest and the longest link are together shorter than the others; above 0
        where some link turns fully, 0 where the linkage can fold flat; (…).
    turns
        Whether the crank turns fully; (…).

    """

    excess: Array
    turns: Flags


class Course(NamedTuple):
    """
    How four-bars go through their positions.

    Attributes
    ----------
    turns
        Whether the crank turns fully; (…).
    one_branch
        Whether all positions are on one assembly; (…).
    one_circuit
        Whether all can be reached without taking the linkage apart; (…).
    in_order
        Whether the crank visits them in their order, going one way, for one turn at most; (…).
    directions
        Of the crank at each position, with the turns between them: the first as given, and the
        shorter way where both ways are in order; (…, n). Of no meaning where none is.

    """

    turns: Flags
    one_branch: Flags
    one_circuit: Flags
    in_order: Flags
    directions: Array

    @property
    def usable(self) -> Flags:
        """Return whether a crank that goes one way moves through all positions, in order."""
        return self.one_branch & self.one_circuit & self.in_order


def mobility(lengths: Array) -> Mobility:
    """Return where four-bars of crank, coupler, rocker and ground can go, lengths of (…, 4)."""
    ordered = np.sort(lengths, -1)
    shortest = ordered[..., 0]
    excess = (ordered[..., 1] - shortest) - (ordered[..., 3] - ordered[..., 2])
    rounding = _rounding(lengths)
    excess = np.where(np.abs(excess) <= rounding, 0.0, excess)
    beside = np.minimum(lengths[..., 0], lengths[..., 3])
    # The crank turns against the ground where one of the two is shortest. Of two shortest links
    # only a change point is made, and there it may be either.
    return Mobility(excess, (excess >= 0.0) & (beside - shortest <= rounding))


def course(lengths: Array, directions: Array, left: Flags) -> Course:
    """
    Return how four-bars go through their positions.

    Parameters
    ----------
    lengths
        Of crank, coupler, rocker and ground, above 0; (…, 4).
    directions
        Of the crank at each position, in [rad]; (…, n).
    left
        Whether the position is met on the left assembly; (…, n).

    """
    excess, turns = mobility(lengths)
    one_branch = (left == left[..., :1]).all(-1)
    # Where a link other than crank or ground turns fully, the crank stays on one side of the
    # ground line.
    upper = np.sin(directions) >= 0.0
    one_side = (upper == upper[..., :1]).all(-1)
    one_circuit = np.where(turns, one_branch, one_side) | (excess <= 0.0)
    path, in_order = _lifted(lengths, directions, turns)
    return Course(turns, one_branch, one_circuit, in_order, path)


def lifted(lengths: Array, directions: Array) -> Array:
    """Return the directions with the turns between them, as `course` does."""
    return _lifted(lengths, directions, mobility(lengths).turns)[0]


def _lifted(lengths: Array, directions: Array, turns: Flags) -> tuple[Array, Flags]:
    """Return directions with the turns between them, and whether they are in order."""
    by = np.diff(directions, axis=-1)
    ahead, back = _ahead(by), _ahead(-by)
    length_ahead, length_back = ahead.sum(-1), back.sum(-1)
    round_steps = np.where((length_ahead <= length_back)[..., None], ahead, -back)
    in_turn = np.minimum(length_ahead, length_back) <= _TURN + _SAME

    # One range that lies about the direction in which the linkage closes, 0 or π; or two, one on
    # each side of the ground line.
    a, b, c, d = (lengths[..., i] for i in range(4))
    about_pi = np.abs(b - c) - np.abs(d - a) > _rounding(lengths)
    wrapped = directions - _TURN * np.round(directions / _TURN)
    within = np.where(about_pi[..., None], np.mod(directions, _TURN), wrapped)
    steps = np.diff(within, axis=-1)
    one_way = (steps > -_SAME).all(-1) | (steps < _SAME).all(-1)

    steps = np.where(turns[..., None], round_steps, steps)
    first = directions[..., :1]
    path = np.concatenate((first, first + np.cumsum(steps, -1)), -1)
    return path, np.where(turns, in_turn, one_way)


def _rounding(lengths: Array) -> Array:
    """Return what a sum of four lengths may be off by, as `diagonal.margin` has it."""
    total: Array = 4.0 * UNIT_ROUNDOFF * lengths.sum(-1)
    return total


def _ahead(by: Array) -> Array:
    """Return how far a crank turns ahead for differences of directions."""
    ahead = np.mod(by, _TURN)
    return np.where(ahead > _TURN - _SAME, ahead - _TURN, ahead)


def transmission(lengths: Array, direction: Array) -> Array:
    """
    Return the angle between coupler and rocker, acute, in [rad]; 0 where the loop is open.

    With s the distance from A to O4, tan²(μ/2) = (s² − (b − c)²)/((b + c)² − s²), and
    s² = (d − a)² + 4ad·sin²(δ/2) = (d + a)² − 4ad·cos²(δ/2), so that neither root loses digits
    near a toggle.

    Parameters
    ----------
    lengths
        Of crank, coupler, rocker and ground; (…, 4).
    direction
        Of the crank, in [rad]; (…).

    """
    a, b, c, d = (lengths[..., i] for i in range(4))
    half = 0.5 * direction
    swing = 4.0 * a * d
    below = ((d - a) - (b - c)) * ((d - a) + (b - c)) + swing * np.sin(half) ** 2
    above = ((b + c) - (a + d)) * ((b + c) + (a + d)) + swing * np.cos(half) ** 2
    below, above = np.maximum(below, 0.0), np.maximum(above, 0.0)
    # Of μ and its supplement the acute one, without a difference from π.
    acute: Array = 2.0 * np.arctan2(
        np.sqrt(np.minimum(below, above)), np.sqrt(np.maximum(below, above))
    )
    return acute


def least_transmission(lengths: Array, start: Array, end: Array) -> tuple[Array, Array]:
    """
    Return the least transmission angle of a travel, in [rad], and the direction where it is.

    Between two passes of the ground line, at direction 0 or π, the distance s goes one way, and
    the angle with it; so the least is at one of the ends or of these.

    Parameters
    ----------
    lengths
        Of crank, coupler, rocker and ground; (…, 4).
    start, end
        Directions of the crank, in [rad], at most a turn from each other; (…).

    """
    low, high = np.minimum(start, end), np.maximum(start, end)
    first = np.ceil(low / np.pi) * np.pi
    passes = (np.where(first + i * np.pi <= high, first + i * np.pi, start) for i in range(2))
    places = np.stack((start, end, *passes), -1)
    angles = transmission(lengths[..., None, :], places)
    least = np.argmin(angles, -1)[..., None]
    return (
        np.take_along_axis(angles, least, -1)[..., 0],
        np.take_along_axis(places, least, -1)[..., 0],
    )


SIDES: tuple[Assembly, Assembly] = ('left', 'right')

SAME = 1e-9
"""What angles may differ by and be the same, in [rad]; the lengths' own error is far below."""

_MARKEDLY = 2.0
"""An assembly is better where the other's error is this many times its own: at a toggle, where
the two meet, and in a design that only comes near, it is the smaller of two errors otherwise."""


class Met(NamedTuple):
    """
    How a position is met.

    Attributes
    ----------
    side
        The assembly that meets it: the side of A→O4 on which B lies.
    angle
        What the rocker, or the coupler, has over the angle that was asked for, in [rad]; 0 where
        none was. Of both, the one that is farther off.
    distance
        How far the traced point is from its place, in [m]; 0 where none was asked for.
    status
        Whether the loop closes there; where it does not, nothing is met.
    gap
        What the links miss each other by where it does not, in [m].

    """

    side: Assembly
    angle: float
    distance: float
    status: Status
    gap: float = 0.0

    @property
    def closed(self) -> bool:
        """Whether the position exists at all."""
        return self.status.has_pose


def prove(design: Design) -> tuple[Met, ...]:
    """
    Return for each position on which assembly it is met, and with what errors.

    The linkage is closed as a node closes it. A position that both assemblies meet as well is met
    on the design's own.
    """
    own = design.four_bar.side
    found = []
    for left, right in zip(*proofs(design), strict=True):
        better = _better(left, right, sum(design.four_bar.lengths)) or own
        found.append(left if better == 'left' else right)
    return tuple(found)


def assembled(design: Design) -> Design:
    """Return a design on the assembly that meets most of its positions; of two, the first's."""
    size = sum(design.four_bar.lengths)
    left, right = proofs(design)
    better = [_better(one, other, size) for one, other in zip(left, right, strict=True)]
    votes = [side for side in better if side]

    def worth(side: Assembly) -> tuple[int, bool, float]:
        error = sum(_error(met, size) for met in (left if side == 'left' else right))
        return votes.count(side), side in votes[:1], -error

    return design._replace(four_bar=replace(design.four_bar, side=max(SIDES, key=worth)))


def proofs(design: Design) -> tuple[tuple[Met, ...], tuple[Met, ...]]:
    """Return how every position is met on the left, and on the right assembly."""
    left, right = (
        tuple(_met(closure, side, wanted) for wanted in design.wanted)
        for side, closure in ((side, closure_of(design, side)) for side in SIDES)
    )
    return left, right


def closure_of(design: Design, side: Assembly) -> Closure:
    """Return a design on one assembly, ready to be solved."""
    return Closure(replace(design.four_bar, side=side).linkage())


def _met(closure: Closure, side: Assembly, wanted: Wanted) -> Met:
    position = closed_position(closure, wanted.crank)
    if not position.joints:
        return Met(side, 0.0, 0.0, position.status, position.gap)
    coupler, rocker = position.joints
    errors = [0.0]
    if wanted.rocker is not None:
        errors.append(remainder(rocker - wanted.rocker, tau))
    if wanted.coupler is not None:
        errors.append(remainder(coupler + wanted.crank - wanted.coupler, tau))
    distance = 0.0
    if wanted.place is not None:
        distance = abs(closure.points(position)[COUPLER, 'P'] - wanted.place)
    return Met(side, max(errors, key=abs), distance, position.status)


def closed_position(closure: Closure, crank: float) -> Position:
    """
    Close the loop; what is beyond an end of the range by rounding only is at that end.

    A design may be wanted right at a toggle, where the last digit of its lengths decides.
    """
    position = closure.position(crank)
    if position.status is Status.OPEN:
        for interval in closure.input_ranges:
            for end in (interval.lowest, interval.highest):
                if abs(remainder(crank - end, tau)) < SAME:
                    return closure.position(end)
    return position


def _better(left: Met, right: Met, size: float) -> Assembly | None:
    """Return the assembly that meets a position markedly better, if one does."""
    one, other = _error(left, size), _error(right, size)
    if other > _MARKEDLY * one + SAME * size:
        return 'left'
    return 'right' if one > _MARKEDLY * other + SAME * size else None


def _error(met: Met, size: float) -> float:
    """Return an error of any kind as a length, for links of a total length."""
    return abs(met.angle) * size + met.distance if met.closed else inf
