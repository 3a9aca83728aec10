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

"""PRP over arrays, on two links that are pinned together."""

from __future__ import annotations

from typing import Any

from linkage_ros.kinematics.batch.arrays import codes_of, States, turned
from linkage_ros.kinematics.dyads.crank_prp import CrankPRPDyad, CrankPRPPose
from linkage_ros.kinematics.rounding import ROUNDING
from linkage_ros.tuples import new
import numpy as np


class CrankPRPArrays(CrankPRPDyad):
    """A pin on two lines of links that are pinned together."""

    __slots__ = ()

    def close(self, known: States) -> CrankPRPPose:
        """Append both ways along the lines."""
        x = known[0]
        (i, j), (one, other) = self.arms, self._offsets
        across: Any = turned(x[j] - x[i]) * self._across
        sine, cosine = across.imag, across.real
        parallel = np.abs(sine) <= ROUNDING
        apart = np.abs(one * cosine - other)
        gap = np.where(parallel & (apart > ROUNDING * self._size), apart, 0.0)
        first, second = (one * cosine - other) / sine, (one - other * cosine) / sine
        x += (first, second)
        return new(CrankPRPPose, (codes_of(gap, parallel, False), gap, first, second, across))
