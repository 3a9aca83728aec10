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
The classical Runge-Kutta method: four evaluations a step, of order 4.

W. Kutta, Beitrag zur näherungsweisen Integration totaler Differentialgleichungen, Zeitschrift für
Mathematik und Physik 46, 1901. Each stage starts from the slopes of the previous one only.
"""

from __future__ import annotations

from linkage_ros.dynamics.integrators.method import Field

ORDER = 4

NODES = (0.5, 0.5, 1.0)
"""Nodes of the second and the following stages, as fractions of the step."""

WEIGHTS = (1 / 6, 1 / 3, 1 / 3, 1 / 6)


def step(
    field: Field, value: float, rate: float, acceleration: float, length: float
) -> tuple[float, float] | None:
    """Advance a state by a length of time, as `Step` specifies."""
    slope, change = rate, acceleration
    first, *others = WEIGHTS
    mean_slope, mean_change = first * slope, first * change
    for node, weight in zip(NODES, others, strict=True):
        ahead = node * length
        slope, at = rate + ahead * change, value + ahead * slope
        stage = field(at, slope)
        if stage is None:
            return None
        change = stage
        mean_slope += weight * slope
        mean_change += weight * change
    return value + length * mean_slope, rate + length * mean_change
