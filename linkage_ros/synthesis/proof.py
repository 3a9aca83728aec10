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

_SIDES: tuple[Assembly, Assembly] = ('left', 'right')


class Met(NamedTuple):
    """
    How a position is met, on the assembly that meets it best.

    Attributes
    ----------
    side
        That assembly: the side of A→O4 on which B lies.
    angle
        What the rocker, or the coupler, has over the angle that was asked for, in [rad]; 0 where
        none was.
    distance
        How far the traced point is from its place, in [m]; 0 where none was asked for.
    status
        Whether the loop closes there.
    gap
        What the links miss each other by where it does not, in [m].

    """

    side: Assembly
    angle: float
    distance: float
    status: Status
    gap: float

    @property
    def closed(self) -> bool:
        """Whether the position exists at all."""
        return self.status in (Status.CLOSED, Status.TOGGLE)


def prove(design: Design) -> tuple[Met, ...]:
    """Return for each position how it is met; the linkage is closed as the node closes it."""
    closures = closures_of(design)
    size = sum(design.four_bar.lengths)
    found = []
    for wanted in design.wanted:
        both = [_met(closures[side], side, wanted) for side in _SIDES]
        found.append(min(both, key=lambda met: _badness(met, size, design.four_bar.side)))
    return tuple(found)


def assembled(design: Design) -> Design:
    """Return a design on the assembly that meets most of its positions; of two, the first's."""
    sides = [met.side for met in prove(design)]
    side = max(_SIDES, key=lambda one: (sides.count(one), one == sides[0]))
    return design._replace(four_bar=replace(design.four_bar, side=side))


def closures_of(design: Design) -> dict[Assembly, Closure]:
    """Return both assemblies, ready to be solved."""
    return {side: Closure(replace(design.four_bar, side=side).linkage()) for side in _SIDES}


def _met(closure: Closure, side: Assembly, wanted: Wanted) -> Met:
    position = closure.position(wanted.crank)
    if not position.joints:
        return Met(side, 0.0, 0.0, position.status, position.gap)
    return Met(
        side, _angle(position, wanted), _distance(closure, position, wanted), position.status, 0.0
    )


def _angle(position: Position, wanted: Wanted) -> float:
    coupler, rocker = position.joints
    if wanted.rocker is not None:
        return remainder(rocker - wanted.rocker, tau)
    if wanted.coupler is not None:
        return remainder(coupler + wanted.crank - wanted.coupler, tau)
    return 0.0


def _distance(closure: Closure, position: Position, wanted: Wanted) -> float:
    if wanted.place is None:
        return 0.0
    return abs(closure.points(position)[COUPLER, 'P'] - wanted.place)


def _badness(met: Met, size: float, usual: Assembly) -> tuple[float, bool]:
    """Order by the error, in lengths; of two that are as good, the design's own side is first."""
    if not met.closed:
        return inf, met.side != usual
    return abs(met.angle) * size + met.distance, met.side != usual
