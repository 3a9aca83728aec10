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
Semi-implicit Euler: first the rate, then the value with the new rate.

One evaluation a step, and of order 1 only. If the inertia is constant and no force depends on the
rate it is symplectic, so that its energy errs but does not drift (E. Hairer, C. Lubich,
G. Wanner, Geometric Numerical Integration, 2nd ed., 2006, I.1.2).
"""

from __future__ import annotations

from linkage_ros.dynamics.integrators.method import Field

ORDER = 1


def step(
    _field: Field, value: float, rate: float, acceleration: float, length: float
) -> tuple[float, float]:
    """Advance a state by a length of time, as `Step` specifies."""
    rate += length * acceleration
    return value + length * rate, rate
