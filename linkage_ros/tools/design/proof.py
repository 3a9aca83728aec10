# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Analysis of a design: every wanted position is solved again on both assemblies.

The course of a four-bar through its positions describes their branch, circuit, order and
transmission angle.

A four-bar has two assemblies. If the crank turns fully they never meet, and each is a circuit: the
other can be reached only by taking the linkage apart. Otherwise the crank moves between toggles,
in one range if no link turns fully, in two if one does; in a range both assemblies join at the
toggles, so that they are two branches of one circuit (T. R. Chase and J. A. Mirth, Circuits and
branches of single-degree-of-freedom planar linkages, Journal of Mechanical Design 115 (1993)
223-230). Circuits touch where a linkage can fold flat: at a change point.

The functions of the course take any number of linkages at once. A direction of the crank is that
of the vector O2→A minus the direction of O2→O4, in [rad].
"""

from __future__ import annotations

from dataclasses import replace
from math import inf, remainder, tau
from typing import NamedTuple

from linkage_ros.kinematics import PlanarClosure, Position, Status, UNIT_ROUNDOFF
from linkage_ros.tools.design.design import Assembly, COUPLER, Design, DesignRequest
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

SAME = 1e-9
"""Angles nearer than this count as equal, in [rad]; the lengths' error is far below."""

SIDES: tuple[Assembly, Assembly] = ('left', 'right')

_MARKEDLY = 2.0
"""An assembly is better if the error of the other is this many times larger. At a toggle, where
the two meet, and in an approximate design, it would otherwise be the smaller of two errors."""


class Mobility(NamedTuple):
    """The mobility of four-bars."""

    # Sum of the other two links minus the sum of the shortest and the longest; above 0 if some
    # link turns fully, 0 if the linkage can fold flat; (…).
    excess: Array
    turns: Flags  # Whether the crank turns fully; (…)


class Traversal(NamedTuple):
    """The way of four-bars through their positions."""

    turns: Flags  # Whether the crank turns fully; (…)
    one_branch: Flags  # Whether all positions are on one assembly; (…)
    one_circuit: Flags  # Whether all can be reached without taking the linkage apart; (…)
    # Whether the crank visits them in their order, going one way, for one turn at most; (…).
    in_order: Flags
    # Directions of the crank at each position, with the turns between them: the first as given,
    # and the shorter way if both ways are in order; (…, n). Meaningless if none is.
    directions: Array

    @property
    def is_usable(self) -> Flags:
        """Return whether a crank in one direction moves through all positions, in order."""
        return self.one_branch & self.one_circuit & self.in_order


def mobility(lengths: Array) -> Mobility:
    """Return the mobility of four-bars, from lengths of crank, coupler, rocker, ground, (…, 4)."""
    ordered = np.sort(lengths, -1)
    shortest = ordered[..., 0]
    excess = (ordered[..., 1] - shortest) - (ordered[..., 3] - ordered[..., 2])
    rounding = _rounding_error(lengths)
    excess = np.where(np.abs(excess) <= rounding, 0.0, excess)
    turning = np.minimum(lengths[..., 0], lengths[..., 3])
    # The crank turns fully if crank or ground is shortest. Two shortest links occur only at a
    # change point, and there either may turn.
    return Mobility(excess, (excess >= 0.0) & (turning - shortest <= rounding))


def traverse_positions(lengths: Array, directions: Array, left: Flags) -> Traversal:
    """
    Return the traversal of four-bars through their positions.

    ``lengths``: crank, coupler, rocker and ground, above 0, (…, 4). ``directions`` of the crank at
    each position are in [rad], (…, n); ``left`` marks positions on the left assembly, (…, n).
    """
    excess, turns = mobility(lengths)
    one_branch = (left == left[..., :1]).all(-1)
    # If a link other than crank or ground turns fully, the crank stays on one side of the ground
    # line.
    upper = np.sin(directions) >= 0.0
    one_side = (upper == upper[..., :1]).all(-1)
    one_circuit = np.where(turns, one_branch, one_side) | (excess <= 0.0)
    path, in_order = _lift_between(lengths, directions, turns)
    return Traversal(turns, one_branch, one_circuit, in_order, path)


def lift_directions(lengths: Array, directions: Array) -> Array:
    """Return the directions with the turns between them, as `traverse_positions` does."""
    return _lift_between(lengths, directions, mobility(lengths).turns)[0]


def _lift_between(lengths: Array, directions: Array, turns: Flags) -> tuple[Array, Flags]:
    """Return directions with the turns between them, and whether they are in order."""
    by = np.diff(directions, axis=-1)
    ahead, back = _forward_rotation(by), _forward_rotation(-by)
    length_ahead, length_back = ahead.sum(-1), back.sum(-1)
    round_steps = np.where((length_ahead <= length_back)[..., None], ahead, -back)
    in_turn = np.minimum(length_ahead, length_back) <= tau + SAME

    # One range around the direction in which the linkage closes, 0 or π; or two, one on each side
    # of the ground line.
    a, b, c, d = (lengths[..., i] for i in range(4))
    about_pi = np.abs(b - c) - np.abs(d - a) > _rounding_error(lengths)
    wrapped = directions - tau * np.round(directions / tau)
    within = np.where(about_pi[..., None], np.mod(directions, tau), wrapped)
    steps = np.diff(within, axis=-1)
    one_way = (steps > -SAME).all(-1) | (steps < SAME).all(-1)

    steps = np.where(turns[..., None], round_steps, steps)
    first = directions[..., :1]
    path = np.concatenate((first, first + np.cumsum(steps, -1)), -1)
    return path, np.where(turns, in_turn, one_way)


def _rounding_error(lengths: Array) -> Array:
    """Return the rounding error of a sum of four lengths, as in `arithmetic.margin`."""
    total: Array = 4.0 * UNIT_ROUNDOFF * lengths.sum(-1)
    return total


def _forward_rotation(by: Array) -> Array:
    """Return the forward rotation of a crank for differences of directions."""
    ahead = np.mod(by, tau)
    return np.where(ahead > tau - SAME, ahead - tau, ahead)


def transmission_angle(lengths: Array, direction: Array) -> Array:
    """
    Return the angle between coupler and rocker, acute, in [rad]; 0 where the loop is open.

    With s the distance from A to O4, tan²(μ/2) = (s² − (b − c)²)/((b + c)² − s²), and s² = (d −
    a)² + 4ad·sin²(δ/2) = (d + a)² − 4ad·cos²(δ/2), so that neither root loses digits near a
    toggle. The lengths, (…, 4), are crank, coupler, rocker and ground; the direction of the crank,
    (…), is in [rad].
    """
    a, b, c, d = (lengths[..., i] for i in range(4))
    half = 0.5 * direction
    swing = 4.0 * a * d
    below = ((d - a) - (b - c)) * ((d - a) + (b - c)) + swing * np.sin(half) ** 2
    above = ((b + c) - (a + d)) * ((b + c) + (a + d)) + swing * np.cos(half) ** 2
    below, above = np.maximum(below, 0.0), np.maximum(above, 0.0)
    # The acute one of μ and its supplement, without a difference from π.
    acute: Array = 2.0 * np.arctan2(
        np.sqrt(np.minimum(below, above)), np.sqrt(np.maximum(below, above))
    )
    return acute


def least_transmission(lengths: Array, start: Array, end: Array) -> tuple[Array, Array]:
    """
    Return the least transmission angle of a travel, in [rad], and its direction of the crank.

    Between two passes of the ground line, at direction 0 or π, the distance s is monotonic, and
    the angle with it; so the least is at one of the ends or of these. The lengths, (…, 4), are
    crank, coupler, rocker and ground; the travel's ends, (…), are in [rad], at most a turn apart.
    """
    low, high = np.minimum(start, end), np.maximum(start, end)
    first = np.ceil(low / np.pi) * np.pi
    passes = (np.where(first + i * np.pi <= high, first + i * np.pi, start) for i in range(2))
    places = np.stack((start, end, *passes), -1)
    angles = transmission_angle(lengths[..., None, :], places)
    least = np.argmin(angles, -1)[..., None]
    return (
        np.take_along_axis(angles, least, -1)[..., 0],
        np.take_along_axis(places, least, -1)[..., 0],
    )


class AchievedPosition(NamedTuple):
    """
    A position of a design, compared with the wanted one.

    Attributes
    ----------
    side
        The assembly: the side of A→O4 on which B lies.
    angle
        Error of the angle of rocker or coupler, in [rad]; 0 if none was wanted. If both were
        wanted, the larger error.
    distance
        Distance of the traced point from its wanted place, in [m]; 0 if none was wanted.
    status
        Whether the loop closes there; if not, the position is not met.
    gap
        Distance by which the links miss each other if it does not close, in [m].

    """

    side: Assembly
    angle: float
    distance: float
    status: Status
    gap: float = 0.0

    @property
    def is_closed(self) -> bool:
        """Whether the position exists."""
        return self.status.has_pose


def prove(design: Design) -> tuple[AchievedPosition, ...]:
    """
    Return for each position the assembly that meets it, with its errors.

    The linkage is closed as in a node. If both assemblies meet a position equally well, that of
    the design is returned.
    """
    side = design.four_bar.side
    results = []
    for left, right in zip(*prove_both_sides(design), strict=True):
        better = _better_side(left, right, sum(design.four_bar.lengths)) or side
        results.append(left if better == 'left' else right)
    return tuple(results)


def assemble(design: Design) -> Design:
    """Return a design on the assembly that meets most positions; on a tie, the first one's."""
    size = sum(design.four_bar.lengths)
    left, right = prove_both_sides(design)
    better = [
        _better_side(to_left, to_right, size)
        for to_left, to_right in zip(left, right, strict=True)
    ]
    votes = [side for side in better if side]

    def assembly_rank(side: Assembly) -> tuple[int, bool, float]:
        error = sum(_length_error(met, size) for met in (left if side == 'left' else right))
        return votes.count(side), side in votes[:1], -error

    return design._replace(four_bar=replace(design.four_bar, side=max(SIDES, key=assembly_rank)))


def prove_both_sides(
    design: Design,
) -> tuple[tuple[AchievedPosition, ...], tuple[AchievedPosition, ...]]:
    """Return the result of every position on the left, and on the right assembly."""
    left, right = (
        tuple(_meet_position(closure, side, wanted) for wanted in design.wanted)
        for side, closure in ((side, closure_of(design, side)) for side in SIDES)
    )
    return left, right


def closure_of(design: Design, side: Assembly) -> PlanarClosure:
    """Return the closure of a design on one assembly."""
    return PlanarClosure(replace(design.four_bar, side=side).linkage())


def _meet_position(
    closure: PlanarClosure, side: Assembly, wanted: DesignRequest
) -> AchievedPosition:
    position = closed_position(closure, wanted.crank)
    if not position.joints:
        return AchievedPosition(side, 0.0, 0.0, position.status, position.gap)
    coupler, rocker = position.joints
    errors = [0.0]
    if wanted.rocker is not None:
        errors.append(remainder(rocker - wanted.rocker, tau))
    if wanted.coupler is not None:
        errors.append(remainder(coupler + wanted.crank - wanted.coupler, tau))
    distance = 0.0
    if wanted.place is not None:
        distance = abs(closure.points(position)[COUPLER, 'P'] - wanted.place)
    return AchievedPosition(side, max(errors, key=abs), distance, position.status)


def closed_position(closure: PlanarClosure, crank: float) -> Position:
    """
    Close the loop; a crank beyond an end of the range only by rounding is set to that end.

    A design may be wanted at a toggle, where the last digit of its lengths decides.
    """
    position = closure.position(crank)
    if position.status is Status.OPEN:
        for interval in closure.input_ranges:
            for end in (interval.lowest, interval.highest):
                if abs(remainder(crank - end, tau)) < SAME:
                    return closure.position(end)
    return position


def _better_side(left: AchievedPosition, right: AchievedPosition, size: float) -> Assembly | None:
    """Return the assembly that meets a position markedly better, or None."""
    left_error, right_error = _length_error(left, size), _length_error(right, size)
    if right_error > _MARKEDLY * left_error + SAME * size:
        return 'left'
    return 'right' if left_error > _MARKEDLY * right_error + SAME * size else None


def _length_error(met: AchievedPosition, size: float) -> float:
    """Return the error as a length, for links of a total length."""
    return abs(met.angle) * size + met.distance if met.is_closed else inf
