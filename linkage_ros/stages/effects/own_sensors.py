# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Own sensors: joints that have their own sensors, apart from the sensor of the other joints.

A joint under ``joints`` of `rate_limit`, `dropout` or `delay` has its own sensor, with
its own parameters (those that it leaves out have their defaults) and its own random generator. So
one more such joint changes nothing for the others.

A message has all joints. It is published at each tick at which at least one sensor has a reading;
a sensor without one repeats its last: values, rates, accelerations and efforts. So ``hold:
silent`` publishes nothing where no sensor has a reading. Nothing is published before each sensor
has had its first. Where a reading has no rates, as at a toggle, the message has none while it is
repeated; likewise for accelerations and efforts.

For the own sensors behind these, a joint is silent where its sensor has no reading: `dropout`
loses its samples, and not their repetitions.

The stamp is the stamp of the newest reading.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from typing import Any, TYPE_CHECKING

from linkage_ros.errors import DefinitionError
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects.stage import SensorReading

if TYPE_CHECKING:
    from linkage_ros.stages.effects.encoder import Encoder

_Values = tuple[float, ...]


def own_sensors(effect: str, parameters: Any, context: Context) -> OwnSensors:
    """
    Build one sensor of an effect for each joint under ``joints``, and one for all other joints.

    Raise `DefinitionError` if no joint is named, or if parameters do not fit together.
    """
    if not parameters.joints:
        raise DefinitionError(
            f'effects.{effect}.joints', 'names no joint', 'write {JOINT: {…}}, or leave it out'
        )
    others: list[int] = []
    groups = [(others, replace(parameters, joints=None).sensor(context))]
    for place, joint in enumerate(context.joints):
        if joint not in parameters.joints:
            others.append(place)
            continue
        own = replace(parameters, **asdict(parameters.joints[joint]), joints=None)
        try:
            built = own.sensor(replace(context, seed=f'{context.seed}/joints/{joint}'))
        except DefinitionError as error:
            key = error.where.removeprefix(f'effects.{effect}.')
            where = f'effects.{effect}.joints.{joint}.{key}'
            raise DefinitionError(where, error.reason, error.remedy) from None
        groups.append(([place], built))
    return OwnSensors(groups if others else groups[1:])


class PartlyNew(SensorReading):
    """A reading in which some joints repeat their last one."""

    new: frozenset[int] | None = None  # Indices of the other joints; None for all


class OwnSensors:
    """
    Sensors side by side, each with the indices of its joints.

    ``gap_begins`` is True if the last reported gap began there, or if one of the sensors had a
    reading that was not published: a replay needs these ticks. ``gap`` and ``silence`` are the
    sensors' own; None if they have none.
    """

    __slots__ = ('_groups', '_held', '_order', 'gap', 'gap_begins', 'silence')

    gap: Callable[[int], SensorReading | None] | None
    silence: Callable[[int, bool], SensorReading | None] | None

    def __init__(self, groups: Sequence[tuple[Sequence[int], Any]]) -> None:
        self._groups = groups
        self._held: list[SensorReading | None] = [None] * len(groups)
        together = [place for places, _ in groups for place in places]
        self._order = [together.index(place) for place in sorted(together)]
        """Where each joint is among the joints of all sensors, one after the other."""
        hears = all(hasattr(sensor, 'gap') for _, sensor in groups)
        self.gap, self.silence = (self._read_gap, self._read_silence) if hears else (None, None)
        self.gap_begins = False

    def read_by(self, encoder: Encoder) -> None:
        """Make the counts of an encoder before them be read with each sample of their joints."""
        encoder.read_at_ticks = False
        for places, sensor in self._groups:
            sensor.read_by(encoder.select_joints(places))

    def __call__(self, now: int, reading: SensorReading) -> SensorReading | None:
        """Return the newest readings of all; None if none is new."""
        new = reading.new if isinstance(reading, PartlyNew) else None
        readings = []
        for places, sensor in self._groups:
            if new is None or not new.isdisjoint(places):
                readings.append(sensor(now, _select_joints(reading, places)))
            else:
                readings.append(sensor.silence(now, False) if self.silence is not None else None)
        return self._newest_reading(readings)

    def _read_gap(self, now: int) -> SensorReading | None:
        gaps = [sensor.gap(now) for _, sensor in self._groups]
        newest = self._newest_reading(gaps)
        unseen = newest is None and any(part is not None for part in gaps)
        self.gap_begins = unseen or any(sensor.gap_begins for _, sensor in self._groups)
        return newest

    def _read_silence(self, now: int, gap: bool) -> SensorReading | None:
        if gap:
            return self._read_gap(now)
        return self._newest_reading([sensor.silence(now, False) for _, sensor in self._groups])

    def _newest_reading(self, readings: Sequence[SensorReading | None]) -> SensorReading | None:
        """Return what is held of all joints; None if no reading is new, or one is missing."""
        stamp = None
        for index, part in enumerate(readings):
            if part is not None:
                self._held[index], stamp = part, part.stamp
        held = [part for part in self._held if part is not None]
        if stamp is None or len(held) < len(readings):
            return None
        _, *values = zip(*held, strict=True)
        reading = PartlyNew(stamp, *map(self._join_values, values))
        if None in readings:
            reading.new = frozenset(
                place
                for (places, _), part in zip(self._groups, readings, strict=True)
                if part is not None
                for place in places
            )
        return reading

    def _join_values(self, parts: Sequence[_Values]) -> _Values:
        """Return the values of all joints in their order; none if a sensor has none."""
        values, order = [value for part in parts for value in part], self._order
        return tuple([values[at] for at in order]) if len(values) == len(order) else ()


def _select_joints(reading: SensorReading, places: Sequence[int]) -> SensorReading:
    """Return a reading of some joints."""
    stamp, *values = reading
    return SensorReading(
        stamp, *[tuple([of[place] for place in places]) if of else () for of in values]
    )
