# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Freeze: the last reading is published again and again, with new stamps.

This models sensor electronics that hang while their driver continues to poll, whether or not the
linkage has a pose. Without an earlier reading nothing is published.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from linkage_ros.effects.stage import restamped, SensorReading
from linkage_ros.faults.fault import Switch


@dataclass(frozen=True, slots=True)
class FreezeParameters:
    """The last reading is published again and again, with new stamps."""


PARAMETERS = FreezeParameters


def sensor(_parameters: FreezeParameters, switch: Switch, _joints: Sequence[str]) -> Freeze:
    """Build the sensor stage."""
    return Freeze(switch)


class Freeze:
    """Sensor stage that holds the last reading; a gap does not change its state."""

    __slots__ = ('_last', '_switch')

    gap_begins = False

    def __init__(self, switch: Switch) -> None:
        self._switch = switch
        self._last: SensorReading | None = None

    def __call__(self, _now: int, reading: SensorReading) -> SensorReading | None:
        """Return the reading, or while frozen the last one before."""
        if not self._switch.on:
            self._last = reading
            return reading
        return None if self._last is None else restamped(self._last, reading.stamp)

    def gap(self, now: int) -> SensorReading | None:
        """Return the last reading before the freeze, stamped now, in [ns]; None otherwise."""
        if not self._switch.on or self._last is None:
            return None
        return restamped(self._last, now)
