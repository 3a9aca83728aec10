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


"""RRR over arrays whose links change their length."""

from __future__ import annotations

from typing import Any

from linkage_ros.kinematics.batch.arrays import joined, phases, States, turned
from linkage_ros.kinematics.batch.diagonal import free_diagonals
from linkage_ros.kinematics.batch.rrr import close_triangles
from linkage_ros.kinematics.diagonal import Growth, GrowthChange
from linkage_ros.kinematics.dyads.driven_rrr import (
    DrivenRRRDyad,
    DrivenRRRPose,
    DrivenRRRRates,
    Side,
)
from linkage_ros.kinematics.dyads.rrr import triangle_accelerations, triangle_rates
from linkage_ros.tuples import new
import numpy as np


class SideArrays(Side):
    """A vector from one point of a group of links to another."""

    __slots__ = ()

    def at(self, x: Any) -> Any:
        """Return the vectors."""
        z: Any = self._end
        for origin, inner, angle, turn, slide, sign, unit in self._carries:
            if turn >= 0:
                z = origin + turned(angle + sign * x[turn]) * (z - inner)
            else:
                z = origin + turned(angle) * (z - inner) + sign * x[slide] * unit
        return z - self._start

    def changes(self, x: Any, v: Any, a: Any = None) -> tuple[Any, Any]:
        """Return their first derivative, and the second one where accelerations are given."""
        z: Any = self._end
        rate: Any = 0j
        change: Any = 0j
        for origin, inner, angle, turn, slide, sign, unit in self._carries:
            if turn >= 0:
                facing = turned(angle + sign * x[turn])
                w = sign * v[turn]
                arm = z - inner
                if a is not None:
                    pull = joined(-w * w, sign * a[turn]) * arm
                    change = facing * (change + joined(0.0, 2.0 * w) * rate + pull)
                rate = facing * (rate + joined(0.0, w) * arm)
                z = origin + facing * arm
            else:
                held = turned(angle)
                if a is not None:
                    change = held * change + sign * a[slide] * unit
                rate = held * rate + sign * v[slide] * unit
                z = origin + held * (z - inner) + sign * x[slide] * unit
        return rate, change


class DrivenRRRArrays(DrivenRRRDyad):
    """Two groups of links pinned together; the sides are ones of arrays."""

    __slots__ = ()

    def close(self, known: States) -> DrivenRRRPose:
        """Append the angles of the first link of each group."""
        x, pins = known
        start, end = (pins[i] for i in self._ends)
        one, other = (side.at(x) for side in self._sides)
        b, c = np.abs(one), np.abs(other)
        diagonal = free_diagonals(end - start, np.abs(start) + np.abs(end), np.abs(b - c), b + c)
        difference = (b - c) * (b + c)
        pose = close_triangles(diagonal, difference, difference, self._sign)
        x.append(pose.first - phases(one))
        x.append(pose.second - phases(other))
        return new(DrivenRRRPose, (pose.status, pose.gap, pose, (one, other)))

    def rates(self, pose: DrivenRRRPose, known: States, speeds: States) -> DrivenRRRRates:
        """Append the rates of the first link of each group."""
        x, pins = known
        v, velocities = speeds
        start, end = self._ends
        one, other = (side.changes(x, v)[0] for side in self._sides)
        units = self._units(pose)
        between = velocities[end] + other * units[1] - velocities[start] - one * units[0]
        growth = Growth(between / (pins[end] - pins[start]), 1.0, 0.0)
        rates = triangle_rates(pose.triangle, growth, speeds)
        return DrivenRRRRates(rates, (one, other))

    def accelerations(
        self,
        pose: DrivenRRRPose,
        rates: DrivenRRRRates,
        known: States,
        speeds: States,
        changes: States,
    ) -> None:
        """Append the accelerations of the first link of each group."""
        x, pins = known
        v, (a, pulls) = speeds[0], changes
        start, end = self._ends
        unit, cot_beta, cot_gamma = rates.triangle.growth.unit, *rates.triangle[1:]
        turns = unit.imag + unit.real * cot_gamma, unit.imag + unit.real * cot_beta
        one, other = (
            (side.changes(x, v, a)[1] + joined(0.0, 2.0 * turn) * rate) * facing
            for side, turn, rate, facing in zip(
                self._sides, turns, rates.sides, self._units(pose), strict=True
            )
        )
        between: Any = pulls[end] + other - pulls[start] - one
        square = between / (pins[end] - pins[start]) - unit * unit
        b, c = map(abs, pose.sides)
        change = GrowthChange(square, 0.0, 0.0, None)
        triangle_accelerations(pose.triangle, (b - c) * (b + c), rates.triangle, change, changes)

    def _units(self, pose: DrivenRRRPose) -> Any:
        """Return e^{iθ} of the first link of each group."""
        triangle = pose.triangle
        return (
            turned(triangle.first - phases(pose.sides[0])),
            turned(triangle.second - phases(pose.sides[1])),
        )
