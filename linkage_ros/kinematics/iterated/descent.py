# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""How near equations that do not close come, and how near a singularity they are."""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from linkage_ros.kinematics.iterated.equations import Array
import numpy as np

System = Callable[[Array], tuple[Array, Array]]
"""Returns the residuals at unknowns, and their derivatives by the unknowns."""


def descend(system: System, unknowns: Array) -> tuple[Array, float]:
    """
    Return the unknowns of the least residual near some, and the greatest of it.

    It is infinite where numbers overflow.
    """
    errors, jacobian = system(unknowns)
    for _ in range(20):
        if not (np.isfinite(errors).all() and np.isfinite(jacobian).all()):
            return unknowns, inf
        step = np.linalg.lstsq(jacobian, -errors, rcond=1e-6)[0]
        step *= min(1.0, 0.1 / max(float(np.abs(step).max()), 1e-300))
        trial, slope = system(unknowns + step)
        if np.abs(trial).max() >= np.abs(errors).max():
            break
        unknowns, errors, jacobian = unknowns + step, trial, slope
    return unknowns, float(np.abs(errors).max())


def reciprocal_condition(jacobian: Array) -> float:
    """Return the ratio of the smallest singular value to the largest; 0 if numbers overflow."""
    if not np.isfinite(jacobian).all():
        return 0.0
    values = np.linalg.svd(jacobian, compute_uv=False)
    return float(values[-1] / values[0])
