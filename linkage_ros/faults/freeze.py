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
Freeze: the last reading is published again and again, with stamps that go on.

What a sensor's electronics do that hang while their driver goes on polling. Where nothing was read
before, nothing is published.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from linkage_ros.effects.stage import Reading, restamped, Sensor
from linkage_ros.faults.fault import Switch


@dataclass(frozen=True, slots=True)
class FreezeParameters:
    """The last reading is published again and again, newly stamped."""


PARAMETERS = FreezeParameters


def sensor(_parameters: FreezeParameters, switch: Switch, _joints: Sequence[str]) -> Sensor:
    """Build what holds the readings."""
    last: Reading | None = None

    def freeze(_now: int, reading: Reading) -> Reading | None:
        nonlocal last
        if not switch.on:
            last = reading
            return reading
        return None if last is None else restamped(last, reading[0])

    return freeze
