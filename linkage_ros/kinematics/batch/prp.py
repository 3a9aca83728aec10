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


"""PRP over arrays: a pin where two known lines cross."""

from __future__ import annotations

from typing import Any

from linkage_ros.kinematics.batch.arrays import codes_of, States, turned
from linkage_ros.kinematics.dyads.prp import PRPDyad, PRPPose, resolved
from linkage_ros.kinematics.plane import cross
from linkage_ros.kinematics.rounding import ROUNDING
from linkage_ros.tuples import new
import numpy as np


class PRPArrays(PRPDyad):
    """A pin on two lines."""

    __slots__ = ()

    def close(self, known: States) -> PRPPose:
        """Append both slides."""
        x, pins = known
        (i, j), (one, other) = self.arms, self._units
        start, end = (pins[k] for k in self._starts)
        units: Any = turned(x[i]) * one, turned(x[j]) * other
        across: Any = turned(x[j] - x[i]) * self._across
        between: Any = end - start
        parallel = np.abs(across.imag) <= ROUNDING
        apart = np.abs(cross(units[0], between))
        far = parallel & (apart > ROUNDING * (np.abs(start) + np.abs(end)))
        gap = np.where(far, apart, 0.0)
        first, second = resolved(between, units, across.imag, known)
        codes = codes_of(gap, parallel, False)
        return new(PRPPose, (codes, gap, first, second, across, units))
