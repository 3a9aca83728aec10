# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Interface of the faults, which a scene can inject at set times or on demand.

Each fault is a module, imported only if a scene names the fault, with

``PARAMETERS``
    The type of its parameters (see `linkage_ros.files.parameters`).

and with one function, whose name gives the place and which builds the fault from its `Switch`:

``clock(parameters, switch) -> Callable[[int], int]``
    Map the true time to the time of the tick, in [ns].
``message(parameters, switch) -> Callable[[bytes], bytes]``
    Change a crank message before it is read.
``mechanism(parameters, switch, context) -> Callable[[Position], Position] | None``
    Change the position after the loops are closed.
``sensor(parameters, switch, joints) -> Callable[[int, Reading], Reading | None] | None``
    Change the reading after all effects, at a time in [ns].

Each of several linkages calls these functions; they return None if it is not concerned.

Faults are built only where a scene has a section ``faults``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

FAULTS = {
    'time_jump': 'linkage_ros.faults.time_jump',
    'not_a_number': 'linkage_ros.faults.not_a_number',
    'broken_link': 'linkage_ros.faults.broken_link',
    'stuck': 'linkage_ros.faults.stuck',
    'freeze': 'linkage_ros.faults.freeze',
    'silence': 'linkage_ros.faults.silence',
}
"""Module of each fault, by kind."""


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault that a scene can inject."""

    # Key of `FAULTS`, and the parameters.
    kind: str
    parameters: Any
    at: tuple[float, ...]  # Times at which it begins by itself, in [s] from the first tick
    seconds: float  # Its duration then, in [s]


class Switch:
    """Whether a fault is on."""

    __slots__ = ('on',)

    def __init__(self) -> None:
        self.on = False
