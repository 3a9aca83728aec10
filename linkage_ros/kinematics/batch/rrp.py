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


"""RRP over arrays: the slider-crank. Its rates take arrays as they are."""

from __future__ import annotations

from typing import Any

from linkage_ros.kinematics.batch.arrays import CLOSED, States, TOGGLE
from linkage_ros.kinematics.dyads.rrp import RRPDyad, RRPPose
from linkage_ros.kinematics.rounding import SMALLEST
from linkage_ros.tuples import new
import numpy as np


class RRPArrays(RRPDyad):
    """A link pinned at A, and a pin of it on a line; the rail is one of arrays."""

    __slots__ = ()

    def close(self, known: States) -> RRPPose:
        """Append the direction of the link, as the rail's link has it, and the slide."""
        sight: Any = self.rail.at(known)
        place, below, above, gap, base, _, _, codes = sight
        along = self._sign * below * above
        tiny = (codes == CLOSED) & (np.abs(along) < SMALLEST)
        along = np.where(tiny, 0.0, along)
        link = base + np.arctan2(-place.imag, along)
        slide = place.real + along
        known[0].append(link)
        known[0].append(slide)
        codes = np.where(tiny, np.uint8(TOGGLE), codes)
        return new(RRPPose, (codes, gap, link, slide, along, sight))
