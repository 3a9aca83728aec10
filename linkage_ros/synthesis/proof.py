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


"""The proof of a design: every position that was asked for, analysed again on both assemblies."""

from __future__ import annotations

from dataclasses import replace
from math import inf, remainder, tau
from typing import NamedTuple

from linkage_ros.kinematics.closure import Closure, Position
from linkage_ros.kinematics.status import Status
from linkage_ros.synthesis.design import Assembly, COUPLER, Design, Wanted

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
