# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Not a number: the crank messages hold NaN for every position, rate and effort.

The node has to reject them, as it would from a real sensor.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import nan

from linkage_ros.faults.fault import Switch
from linkage_ros.messages.joint_state import with_every_number


@dataclass(frozen=True, slots=True)
class NotANumberParameters:
    """The crank's messages hold NaN."""


PARAMETERS = NotANumberParameters


def message(_parameters: NotANumberParameters, switch: Switch) -> Callable[[bytes], bytes]:
    """Build a function that corrupts the messages."""

    def spoilt(data: bytes) -> bytes:
        return with_every_number(data, nan) if switch.on else data

    return spoilt
