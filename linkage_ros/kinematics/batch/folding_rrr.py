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

"""RRR over arrays, on two links that are pinned together, with a change point where they fold."""

from __future__ import annotations

from linkage_ros.kinematics.batch.arrays import States
from linkage_ros.kinematics.batch.rrr import close_triangles
from linkage_ros.kinematics.dyads.folding_rrr import FoldingRRRDyad
from linkage_ros.kinematics.dyads.rrr import RRRPose
import numpy as np


class FoldingRRRArrays(FoldingRRRDyad):
    """Two links pinned together; the diagonal is one of arrays."""

    __slots__ = ()

    _side_of = staticmethod(np.copysign)

    def close(self, known: States) -> RRRPose:
        """Append the directions of both links."""
        pose = close_triangles(self.diagonal.at(known), *self._sums, self._sign)
        known[0].append(pose.first)
        known[0].append(pose.second)
        return pose
