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


"""Steps that place a point of a link whose angle is known, over arrays."""

from __future__ import annotations

from linkage_ros.kinematics.batch.arrays import joined, States, turned
from linkage_ros.kinematics.places import PointOnLink, PointOnRail
from linkage_ros.kinematics.step import PLACED, Pose


class PointOnLinkArrays(PointOnLink):
    """A point at a constant distance from a pin of the same link."""

    __slots__ = ()

    def close(self, known: States) -> Pose:
        """Append the point."""
        x, pins = known
        pins.append(pins[self._pin] + turned(x[self._arm]) * self._vector)
        return PLACED

    def rates(self, _pose: Pose, known: States, speeds: States) -> None:
        """Append its velocity."""
        pins, (v, velocities) = known[1], speeds
        arm = pins[self._point] - pins[self._pin]
        velocities.append(velocities[self._pin] + joined(0.0, v[self._arm]) * arm)

    def accelerations(
        self, _pose: Pose, _rates: None, known: States, speeds: States, changes: States
    ) -> None:
        """Append its acceleration."""
        pins, turn, (a, pulls) = known[1], speeds[0][self._arm], changes
        arm = pins[self._point] - pins[self._pin]
        pulls.append(pulls[self._pin] + joined(-turn * turn, a[self._arm]) * arm)


class PointOnRailArrays(PointOnRail):
    """A point that travels along a line of a link."""

    __slots__ = ()

    def close(self, known: States) -> Pose:
        """Append the point."""
        x, pins = known
        unit = turned(x[self._arm]) * self._unit
        pins.append(pins[self._pin] + x[self._slide] * unit)
        return PLACED

    def rates(self, _pose: Pose, known: States, speeds: States) -> None:
        """Append its velocity."""
        x, (v, velocities) = known[0], speeds
        unit = turned(x[self._arm]) * self._unit
        moved = joined(v[self._slide], v[self._arm] * x[self._slide])
        velocities.append(velocities[self._pin] + moved * unit)

    def accelerations(
        self, _pose: Pose, _rates: None, known: States, speeds: States, changes: States
    ) -> None:
        """Append its acceleration."""
        x, v, (a, pulls) = known[0], speeds[0], changes
        unit = turned(x[self._arm]) * self._unit
        slide, turn = x[self._slide], v[self._arm]
        moved = joined(
            a[self._slide] - turn * turn * slide,
            a[self._arm] * slide + 2.0 * turn * v[self._slide],
        )
        pulls.append(pulls[self._pin] + moved * unit)
