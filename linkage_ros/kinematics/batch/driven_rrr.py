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

from linkage_ros.kinematics.batch.arrays import phases, States, turned
from linkage_ros.kinematics.batch.diagonal import free_diagonals
from linkage_ros.kinematics.batch.rrr import close_triangles
from linkage_ros.kinematics.dyads.driven_rrr import (
    DrivenRRRDyad,
    DrivenRRRPose,
    Side,
)
from linkage_ros.tuples import new
import numpy as np


class SideArrays(Side):
    """A vector from one point of a group of links to another."""

    __slots__ = ()

    _facing = staticmethod(turned)


class DrivenRRRArrays(DrivenRRRDyad):
    """Two groups of links pinned together; the sides are ones of arrays."""

    __slots__ = ()

    def close(self, known: States) -> DrivenRRRPose:
        """Append the angles of the first link of each group."""
        x, pins = known
        start, end = (pins[i] for i in self._ends)
        one, other = (side.at(x) for side in self._sides)
        b, c = np.abs(one), np.abs(other)
        diagonal = free_diagonals(
            end - start, np.abs(start) + np.abs(end), np.abs(b - c), b + c, 4.0 * b * c
        )
        difference = (b - c) * (b + c)
        pose = close_triangles(diagonal, difference, difference, self._sign)
        x.append(pose.first - phases(one))
        x.append(pose.second - phases(other))
        return new(DrivenRRRPose, (pose.status, pose.gap, pose, (one, other)))

    def _units(self, pose: DrivenRRRPose) -> Any:
        """Return e^{iθ} of the first link of each group."""
        triangle = pose.triangle
        return (
            turned(triangle.first - phases(pose.sides[0])),
            turned(triangle.second - phases(pose.sides[1])),
        )
