# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What loads act on in space: points of links along directions, and links about axes.

A rod that may spin has no axes of its own, and a torque along it would spin it: a load that turns
with it, and a torque on it, are refused.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from linkage_ros.dynamics.joint_forms import LinkTurn
from linkage_ros.dynamics.loads import AppliedLoads
from linkage_ros.dynamics.spatial_bodies import SPACE
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import dot, GROUND_FRAME, Position, SpaceClosure, Vector


class SpatialParts:
    """What loads act on in space."""

    vectors = SPACE
    wrench_numbers: tuple[int, ...] = (0, 1, 2, 3, 4, 5)

    def __init__(self, closure: SpaceClosure, applied: AppliedLoads) -> None:
        self._closure = closure
        for name, force in applied.forces.items():
            if name.rpartition('.')[0] in closure.idle and force.frame == 'link':
                raise DefinitionError(
                    f'loads.forces.{name}.frame',
                    'the rod may spin about itself, and has no axes that turn with it',
                    'write frame: ground',
                )
        for link in applied.wrenches:
            if link in closure.idle:
                raise DefinitionError(
                    f'loads.wrenches.{link}',
                    'the rod may spin about itself, and nothing bears a torque along it',
                    'name the link that holds it',
                )

    def place(self, link: str, point: str) -> Vector:
        if point:
            return self._closure.linkage.points[point]
        pose = self._closure.close_unlimited(*self._closure.linkage.pose.inputs)
        return self._closure.frames(pose)[link][0]

    def direction(self, link: str, vector: Vector, frame: str) -> Callable[[Position], Vector]:
        if frame == 'ground':
            return lambda _: vector
        return self._closure.carried_vector(link, vector)

    def axes(self, link: str, frame: str) -> list[Callable[[Position], Vector]]:
        return [self.direction(link, axis, frame) for axis in GROUND_FRAME[:3]]

    def turns(self, link: str, frame: str) -> Sequence[LinkTurn]:
        spin = self._closure.spin_of(link)

        def turn(axis: Callable[[Position], Vector]) -> LinkTurn:
            return LinkTurn(link, lambda v, position: dot(spin(v), axis(position)), axis)

        return [turn(axis) for axis in self.axes(link, frame)]
