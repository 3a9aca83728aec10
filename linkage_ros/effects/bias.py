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
Bias: the zero of a sensor differs from that of the joint.

The reading of a joint is off by a constant (instrumental bias: JCGM 200:2012, International
vocabulary of metrology, 4.20)::

    y = x + b

Rates, accelerations and efforts have no bias: they are derivatives of y, or come from other
sensors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from operator import add

from linkage_ros.drives.drive import Context
from linkage_ros.effects.stage import Sensor, SensorReading
from linkage_ros.files.parameters import each, Number


@dataclass(frozen=True, slots=True)
class BiasParameters:
    """A constant error of measured joint positions."""

    joints: Mapping[str, float] = each(
        'constant error of a joint',
        'joint',
        Number('error, added to the position', 'rad or m', -1e6, 1e6),
        required=True,
    )


PARAMETERS = BiasParameters


def sensor(parameters: BiasParameters, context: Context) -> Sensor:
    """Build the sensor."""
    biases = tuple(parameters.joints.get(joint, 0.0) for joint in context.joints)

    def bias(_now: int, reading: SensorReading) -> SensorReading:
        return reading._replace(joints=tuple(map(add, reading.joints, biases)))

    return bias
