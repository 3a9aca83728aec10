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


"""Tables of the closed form, as a scene can have them: linear, or cubic with exact derivatives."""

from __future__ import annotations

from linkage_ros.accuracy.solving.methods.closed_form import closure_method
from linkage_ros.accuracy.solving.methods.method import Method
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.solvers.table import Order, TableClosure

NAMES: dict[Order, str] = {'linear': 'table, linear', 'hermite': 'table, Hermite'}


def table(linkage: Linkage, knots: int, order: Order) -> Method:
    """Return it, with its memory and how long it took to build."""
    closure = TableClosure(linkage, knots=knots, order=order)
    return closure_method(
        closure, NAMES[order], f'{knots:,} knots', closure.memory, closure.build_time
    )
