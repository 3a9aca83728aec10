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
Newton's method on the loops, as a scene can have it: from the nearest knot; and from elsewhere.

Where it does not converge, next to toggles and change points, its states are those of the closed
form, which it falls back to.
"""

from __future__ import annotations

from linkage_ros.accuracy.solving.methods.closed_form import closure_method
from linkage_ros.accuracy.solving.methods.method import Method
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.solvers.newton import NewtonClosure

FROM_KNOTS, WARM, COLD = 'Newton, from knots', 'Newton, warm', 'Newton, cold'

STARTS = {FROM_KNOTS: None, WARM: True, COLD: False}
"""Where it starts: at the nearest of 256 knots a turn, at its last state, at one pose always."""


def newton(linkage: Linkage, tolerance: float, name: str) -> Method:
    """
    Return it.

    Parameters
    ----------
    linkage
        The linkage.
    tolerance
        What the last correction is below, in [rad] or [m].
    name
        Where it starts, of `STARTS`.

    """
    closure = NewtonClosure(linkage, tolerance, warm=STARTS[name])
    method = closure_method(closure, name, f'tolerance {tolerance:.0e}')
    # Arrays of states it solves one after the other.
    return method._replace(batch=None, remembers=name == WARM)
