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


"""Each step over arrays: which one it is made over into."""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from typing import Any

from linkage_ros.kinematics.batch.arrays import ArrayStep, Block, remade
from linkage_ros.kinematics.batch.crank_prp import CrankPRPArrays
from linkage_ros.kinematics.batch.crank_rrr import CrankRRRArrays
from linkage_ros.kinematics.batch.diagonal import (
    CrankDiagonalArrays,
    FreeDiagonalArrays,
    UnsignedDiagonalArrays,
)
from linkage_ros.kinematics.batch.driven_rrr import DrivenRRRArrays, SideArrays
from linkage_ros.kinematics.batch.folding_rrr import FoldingRRRArrays
from linkage_ros.kinematics.batch.one_by_one import OneByOne
from linkage_ros.kinematics.batch.places import PointOnLinkArrays, PointOnRailArrays
from linkage_ros.kinematics.batch.prp import PRPArrays
from linkage_ros.kinematics.batch.rail import CrankRailArrays, FreeRailArrays, UnsignedRailArrays
from linkage_ros.kinematics.batch.rpr import RPRArrays
from linkage_ros.kinematics.batch.rrp import RRPArrays
from linkage_ros.kinematics.batch.rrr import RRRArrays
from linkage_ros.kinematics.crank_diagonal import CrankDiagonal, UnsignedDiagonal
from linkage_ros.kinematics.dyads.crank_prp import CrankPRPDyad
from linkage_ros.kinematics.dyads.crank_rrr import CrankRRRDyad
from linkage_ros.kinematics.dyads.driven_rrr import DrivenRRRDyad
from linkage_ros.kinematics.dyads.folding_rrr import FoldingRRRDyad
from linkage_ros.kinematics.dyads.prp import PRPDyad
from linkage_ros.kinematics.dyads.rpp import RPPDyad
from linkage_ros.kinematics.dyads.rpr import RPRDyad
from linkage_ros.kinematics.dyads.rrp import RRPDyad
from linkage_ros.kinematics.dyads.rrr import RRRDyad
from linkage_ros.kinematics.free_diagonal import FreeDiagonal
from linkage_ros.kinematics.iteration import Iteration
from linkage_ros.kinematics.places import FixedPoint, PointOnLink, PointOnRail, Turned
from linkage_ros.kinematics.rail import CrankRail, FreeRail, UnsignedRail
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import Step


class _Walked:
    """A step whose three methods take arrays."""

    __slots__ = ('_step',)

    def __init__(self, step: Step) -> None:
        self._step = step

    def solve(self, block: Block) -> None:
        """Append to what is known, to its rates and its accelerations, and note the status."""
        known, speeds, changes = block[:3]
        pose = self._step.close(known)
        if pose[0] is not Status.CLOSED:
            block.note(pose[0])
        if speeds is not None:
            rates = self._step.rates(pose, known, speeds)
            if changes is not None:
                self._step.accelerations(pose, rates, known, speeds, changes)


def over_arrays(step: Step) -> ArrayStep:
    """Return what solves a step over arrays."""
    return _KINDS[type(step)](step)


def _iteration(step: Iteration) -> ArrayStep:
    bodies = step.equation_count // 3
    return OneByOne(step, bodies + len(attrgetter('_slides')(step)), bodies)


def _walked(kind: type[Any]) -> Callable[[Any], ArrayStep]:
    return lambda step: _Walked(remade(kind, step))


def _rrr(dyad: RRRDyad) -> ArrayStep:
    if CrankRRRArrays.fits(dyad):
        return CrankRRRArrays(dyad)
    kind = FoldingRRRArrays if isinstance(dyad, FoldingRRRDyad) else RRRArrays
    return _Walked(remade(kind, dyad, diagonal=_part(dyad.diagonal)))


def _rpr(dyad: RPRDyad) -> ArrayStep:
    return _Walked(remade(RPRArrays, dyad, diagonal=_part(dyad.diagonal)))


def _on_rail(kind: type[Any]) -> Callable[[Any], ArrayStep]:
    return lambda dyad: _Walked(remade(kind, dyad, rail=_part(dyad.rail)))


def _driven_rrr(dyad: DrivenRRRDyad) -> ArrayStep:
    sides = tuple(remade(SideArrays, side) for side in attrgetter('_sides')(dyad))
    return _Walked(remade(DrivenRRRArrays, dyad, _sides=sides))


def _part(part: Any) -> Any:
    """Return a diagonal or a rail over arrays."""
    return remade(_PARTS[type(part)], part)


_PARTS: dict[type[Any], type[Any]] = {
    CrankDiagonal: CrankDiagonalArrays,
    UnsignedDiagonal: UnsignedDiagonalArrays,
    FreeDiagonal: FreeDiagonalArrays,
    CrankRail: CrankRailArrays,
    UnsignedRail: UnsignedRailArrays,
    FreeRail: FreeRailArrays,
}

_KINDS: dict[type[Any], Callable[[Any], ArrayStep]] = {
    FixedPoint: _Walked,
    Turned: _Walked,
    PointOnLink: _walked(PointOnLinkArrays),
    PointOnRail: _walked(PointOnRailArrays),
    CrankRRRDyad: _rrr,
    FoldingRRRDyad: _rrr,
    RRRDyad: _rrr,
    RPRDyad: _rpr,
    RRPDyad: _on_rail(RRPArrays),
    RPPDyad: _on_rail(RPPDyad),
    PRPDyad: _walked(PRPArrays),
    CrankPRPDyad: _walked(CrankPRPArrays),
    DrivenRRRDyad: _driven_rrr,
    Iteration: _iteration,
}
