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
RRR over arrays, on any diagonal; on two links that are pinned together see `crank_rrr`.

The rates and accelerations of a triangle take arrays as they are.
"""

from __future__ import annotations

from typing import Any

from linkage_ros.kinematics.batch.arrays import Array, CLOSED, States, TOGGLE
from linkage_ros.kinematics.diagonal import Diagonal
from linkage_ros.kinematics.dyads.rrr import RRRDyad, RRRPose
from linkage_ros.kinematics.rounding import SMALLEST
from linkage_ros.tuples import new
import numpy as np


class RRRArrays(RRRDyad):
    """Two links pinned together; the diagonal is one of arrays."""

    __slots__ = ()

    def close(self, known: States) -> RRRPose:
        """Append the directions of both links."""
        pose = close_triangles(self.diagonal.at(known), *self._sums, self._sign)
        known[0].append(pose.first)
        known[0].append(pose.second)
        return pose


def close_triangles(
    diagonal: Diagonal, more: Array | float, less: Array | float, sign: float
) -> RRRPose:
    """Return the poses over diagonals, as `close_triangle` does of one."""
    codes: Any
    _, direction, fold, stretch, gap, _, _, excess, codes = diagonal
    product = sign * fold * stretch
    tiny = (codes == CLOSED) & (np.abs(product) < SMALLEST)
    cross = np.where(tiny, 0.0, product)
    more, less = more + excess, less - excess
    first = direction + np.arctan2(cross, more)
    second = direction + np.arctan2(cross, less)
    codes = np.where(tiny, np.uint8(TOGGLE), codes)
    return new(RRRPose, (codes, gap, first, second, cross, diagonal, more, less))
