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


"""RPR over arrays: the inverted slider-crank. Its rates take arrays as they are."""

from __future__ import annotations

from typing import Any

from linkage_ros.kinematics.batch.arrays import States
from linkage_ros.kinematics.dyads.rpr import RPRDyad, RPRPose
from linkage_ros.tuples import new
import numpy as np


class RPRArrays(RPRDyad):
    """A rail pinned at A, a block on it pinned at D; the diagonal is one of arrays."""

    __slots__ = ()

    def close(self, known: States) -> RPRPose:
        """Append the direction of the rail, and the slide."""
        offset, sign = self._constants
        diagonal: Any = self.diagonal.at(known)
        slide = sign * diagonal.fold
        rail = diagonal.direction - np.arctan2(offset, slide)
        known[0].append(rail)
        known[0].append(slide)
        return new(RPRPose, (diagonal.status, diagonal.gap, rail, slide, diagonal))
