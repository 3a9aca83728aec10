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
The methods of integration, for one freedom: q' = w, w' = a(q, w).

Each is a module, imported only if a scene names the method, with

``ORDER``
    The error of a motion falls with this power of the step.
``step``
    A `Step`.

All use the value q and its rate w, not the momentum, so their state is what is published. The step
is fixed: with an adaptive step the cost of a tick, and so whether it meets its deadline, would
depend on the motion.
"""

from __future__ import annotations

from collections.abc import Callable

METHODS = {
    'semi_implicit_euler': 'linkage_ros.dynamics.integrators.semi_implicit_euler',
    'rk4': 'linkage_ros.dynamics.integrators.rk4',
    'gauss_legendre': 'linkage_ros.dynamics.integrators.gauss_legendre',
}
"""Name of each method, and the module that holds it."""

Field = Callable[[float, float], float | None]
"""a(q, w), in [rad/s²] or [m/s²]; None if there is no such motion."""

Step = Callable[[Field, float, float, float, float], tuple[float, float] | None]
"""
Takes a(q, w), q, w, the acceleration there, and the step in [s]; returns q and w at its end.

Returns None if a stage lies where there is no motion, or does not converge.
"""
