# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Time jump: the clock of the node jumps, and jumps back when the fault ends.

At a backward jump, at the begin or at the end of the fault, the node builds its pipeline again, as
it does after a change of the system clock.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from linkage_ros.faults.fault import Switch
from linkage_ros.files.parameters import number
from linkage_ros.messages.single_values import TIME_END


@dataclass(frozen=True, slots=True)
class TimeJumpParameters:
    """The clock jumps, and jumps back when the fault ends."""

    by: float = number('jump; negative for backwards', unit='s', least=-1e6, most=1e6)


PARAMETERS = TimeJumpParameters


def clock(parameters: TimeJumpParameters, switch: Switch) -> Callable[[int], int]:
    """Build the clock."""
    step = round(parameters.by * 1e9)

    def jumping(now: int) -> int:
        # Stamps of messages are limited to the years 1970 to 2038.
        return max(0, min(now + step, TIME_END - 1)) if switch.on else now

    return jumping
