# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Stuck: the sensor of one joint stands still, the others work.

Its position stays as it was when the fault began; its rate and acceleration are 0. Without an
earlier reading nothing is published.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from linkage_ros.effects.stage import Sensor, SensorReading
from linkage_ros.faults.fault import Switch
from linkage_ros.files.parameters import name


@dataclass(frozen=True, slots=True)
class StuckParameters:
    """The sensor of one joint stands still."""

    joint: str = name('the joint of the sensor', 'joint')


PARAMETERS = StuckParameters


def sensor(parameters: StuckParameters, switch: Switch, joints: Sequence[str]) -> Sensor | None:
    """Build a function that holds the joint; None if it is not among these."""
    if parameters.joint not in joints:
        return None
    held: float | None = None
    place = joints.index(parameters.joint)
    after = place + 1

    def with_one(values: tuple[float, ...], value: float) -> tuple[float, ...]:
        return (*values[:place], value, *values[after:]) if values else ()

    def stuck(_now: int, reading: SensorReading) -> SensorReading | None:
        nonlocal held
        if not switch.on:
            held = reading.joints[place]
            return reading
        if held is None:
            return None
        return reading._replace(
            joints=with_one(reading.joints, held),
            rates=with_one(reading.rates, 0.0),
            accelerations=with_one(reading.accelerations, 0.0),
        )

    return stuck
