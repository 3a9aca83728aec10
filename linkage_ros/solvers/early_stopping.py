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

"""Newton's method on links that no dyad covers, stopped at a tolerance."""

from __future__ import annotations

from typing import cast

from linkage_ros.kinematics.newton_group import IteratedPose, Iteration
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import State, Step
import numpy as np

_STEPS = 8
_SINGULAR = 1e-6
"""Conditioning below which the method runs to full accuracy."""


class _EarlyStopping(Iteration):
    __slots__ = ('_tolerance',)

    def __init__(self, strict: Iteration, tolerance: float) -> None:
        for name in Iteration.__slots__:
            setattr(self, name, getattr(strict, name))
        self._tolerance = tolerance

    def close(self, known: State) -> IteratedPose:
        """Append as `Iteration.close`, which is called if the first steps do not contract."""
        end = 1 + len(self._inputs)
        inputs = known.coordinates[1:end]
        start = self._start_at(inputs) if len(inputs) == 1 else None
        if start is None or start.ends:
            return super().close(known)
        unknowns, last = start.unknowns, start.farthest
        for _ in range(_STEPS):
            errors, jacobian = self._system(known, unknowns)
            try:
                step = np.linalg.solve(jacobian, -errors)
            except np.linalg.LinAlgError:
                break
            length = float(np.abs(step).max())
            if not length < 0.7 * last:
                break
            unknowns, last = unknowns + step, length
            if length <= self._tolerance:
                pose = IteratedPose(Status.CLOSED, 0.0, unknowns.tolist(), jacobian)
                if self.conditioning(pose) <= _SINGULAR:
                    break
                angles = (unknowns + start.turned)[0::3].tolist()
                self._place(known, pose.unknowns, angles)
                return pose
        return super().close(known)


def early_stopping(step: Step, tolerance: float) -> Step:
    """
    Return an iteration that ends when the last correction is below a tolerance.

    Parameters
    ----------
    step
        An `Iteration`; both share its branch.
    tolerance
        Bound of the last correction, in [rad] and in the unit of the lengths.

    """
    return _EarlyStopping(cast('Iteration', step), tolerance)
