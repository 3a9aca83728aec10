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
The faults: what can be made to go wrong while a scene runs, at set times or on demand.

Each is a module, imported only where a scene names the fault, with

``PARAMETERS``
    The type of its parameters (see `linkage_ros.files.parameters`).

and with one function that builds what it does while its `Switch` is on; which, says where:

``clock(parameters, switch) -> Callable[[int], int]``
    The time by which the tick goes, of the true one, in [ns].
``message(parameters, switch) -> Callable[[bytes], bytes]``
    The crank message that is read, of the one that came.
``mechanism(parameters, switch, context) -> Callable[[Position], Position] | None``
    The linkage, once its loops are closed.
``sensor(parameters, switch, joints) -> Callable[[int, Reading], Reading | None] | None``
    What is read, behind all effects; as there.

Of several linkages each asks them all; to one that a fault does not concern, these return None.

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
"""Kind of each fault, and the module that holds it."""


@dataclass(frozen=True, slots=True)
class Fault:
    """
    A fault that a scene can inject.

    Attributes
    ----------
    kind, parameters
        What goes wrong: a key of `FAULTS`, and how.
    at
        When it is injected by itself, in [s] from the first tick.
    seconds
        How long it lasts then.

    """

    kind: str
    parameters: Any
    at: tuple[float, ...]
    seconds: float


class Switch:
    """Whether a fault is on."""

    __slots__ = ('on',)

    def __init__(self) -> None:
        self.on = False
