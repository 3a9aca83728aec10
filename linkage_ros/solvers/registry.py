# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The solvers that a scene can name; each is imported only if a scene names it.

A module has ``PARAMETERS``, the type of its parameters (see `linkage_ros.description.parameters`),
and ``build(parameters, linkage) -> Closure``.
"""

from __future__ import annotations

from dataclasses import dataclass

from linkage_ros.kinematics import Closure, Linkage

SOLVERS = {
    'closed_form': 'linkage_ros.solvers.registry',
    'newton': 'linkage_ros.solvers.newton',
    'table': 'linkage_ros.solvers.table',
}
"""Name of each solver, and the module that holds it."""


@dataclass(frozen=True, slots=True)
class ClosedFormParameters:
    """Each dyad in closed form: as accurate as doubles allow, toggles and change points too."""


PARAMETERS = ClosedFormParameters


def build(_parameters: ClosedFormParameters, linkage: Linkage) -> Closure:
    """Build the closed form, which is also used if a scene names no solver."""
    return Closure(linkage)
