# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Measuring range: a sensor reads no value beyond the ends of its range.

The reading of a joint ends at the limits of what its sensor can measure (measuring interval: JCGM
200:2012, International vocabulary of metrology, 4.7)::

    y = min(max(x, low), high)        |ẏ| ≤ rate        |τ̂| ≤ effort

It saturates before the counts of an encoder, and behind bias and noise: the electronics of a
sensor see both. The rate of a saturated position is not changed: it comes from another sensor, or
from the driver of an `encoder`, which sees counts that stand still.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from linkage_ros.description import each_part, number
from linkage_ros.errors import DefinitionError
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects.effect import SensorEffect
from linkage_ros.stages.effects.stage import Sensor, SensorReading

_LARGEST = 1e9
"""Beyond what a sensor reads: a limit that is none."""


@dataclass(frozen=True, slots=True)
class JointRange:
    """The range of a joint's sensors."""

    low: float = number(
        'least position', -_LARGEST, unit='rad or m', least=-_LARGEST, most=_LARGEST
    )
    high: float = number(
        'greatest position', _LARGEST, unit='rad or m', least=-_LARGEST, most=_LARGEST
    )
    rate: float = number(
        'greatest rate in either direction',
        _LARGEST,
        unit='rad/s or m/s',
        least=0.0,
        most=_LARGEST,
    )
    effort: float = number(
        'greatest effort in either direction', _LARGEST, unit='N·m or N', least=0.0, most=_LARGEST
    )


@dataclass(frozen=True, slots=True)
class MeasuringRangeEffect(SensorEffect):
    """Readings end at the limits of their sensors."""

    joints: Mapping[str, JointRange] = each_part(
        "range of a joint's sensors", 'joint', JointRange, required=True
    )

    sample = '{joints: {rocker_joint: {low: 1.0, high: 2.2}}}'

    def sensor(self, context: Context) -> Sensor:
        """Build the sensor; raise `DefinitionError` if the limits of a joint cross."""
        joints = context.closure.linkage.joints
        for joint, limits in self.joints.items():
            if limits.low >= limits.high:
                unit = joints[joint].unit
                raise DefinitionError(
                    f'effects.measuring_range.joints.{joint}',
                    f'low {limits.low:g} {unit} is not below high {limits.high:g} {unit}',
                    'write the lower limit as low',
                )
        ranges = [self.joints.get(joint, JointRange()) for joint in context.joints]
        positions = tuple((bounds.low, bounds.high) for bounds in ranges)
        rates = tuple((-bounds.rate, bounds.rate) for bounds in ranges)
        efforts = tuple((-bounds.effort, bounds.effort) for bounds in ranges)

        def measuring_range(_now: int, reading: SensorReading) -> SensorReading:
            return reading._replace(
                joints=_clip_values(reading.joints, positions),
                rates=_clip_values(reading.rates, rates),
                efforts=_clip_values(reading.efforts, efforts),
            )

        return measuring_range


def _clip_values(
    values: tuple[float, ...], limits: tuple[tuple[float, float], ...]
) -> tuple[float, ...]:
    """Return values within their limits; none of none."""
    return tuple(
        [min(max(value, low), high) for value, (low, high) in zip(values, limits, strict=False)]
    )
