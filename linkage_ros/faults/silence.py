# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Silence: nothing is published, as after the sensor's cable is pulled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from linkage_ros.effects.stage import Sensor, SensorReading
from linkage_ros.faults.fault import Switch


@dataclass(frozen=True, slots=True)
class SilenceParameters:
    """Nothing is published."""


PARAMETERS = SilenceParameters


def sensor(_parameters: SilenceParameters, switch: Switch, _joints: Sequence[str]) -> Sensor:
    """Build a function that suppresses the readings."""

    def silence(_now: int, reading: SensorReading) -> SensorReading | None:
        return None if switch.on else reading

    return silence
