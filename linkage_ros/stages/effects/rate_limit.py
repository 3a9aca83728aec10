# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Rate limit: the sensor is slower than the ticks, and samples at its own rate.

Counted from the first tick t₀, its k-th sample is due at::

    t_k = t₀ + p + ⌊k·10⁹/f + ½⌋ ns

in integers, where f is the exact fraction of the doubles ``rate``·(1 + ``ppm``/10⁶): nothing
drifts, however long it runs. p, ``phase``, is when its first sample is due, and ``ppm`` the error
of its clock; before the first sample nothing is published. A sample is the reading at the first
tick at or after t_k. It is not interpolated to t_k, so that the counts of an encoder stay whole.
It is held until the next one (a zero-order hold; K. J. Åström and B. Wittenmark,
Computer-Controlled Systems, 3rd ed., 1997).

After an `encoder`, the driver reads the counts with each sample: differenced rates cover the time
between two samples.

``hold: repeat`` publishes the held sample at every tick, with rates, accelerations and efforts,
and with the stamp of the tick, as a driver that polls its sensor. ``silent`` publishes a sample
once.

A joint under ``joints`` has its own sensor, with its own rate, phase and clock error: see
`own_sensors`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

from linkage_ros.description import choice, number, own_parameters
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects.effect import SensorEffect
from linkage_ros.stages.effects.stage import restamp, Sensor, SensorReading

if TYPE_CHECKING:
    from linkage_ros.stages.effects.encoder import Encoder


@dataclass(frozen=True, slots=True)
class JointRateLimit:
    """The rate of a joint's own sensor."""

    rate: float = number('samples a second', unit='Hz', least=0.001, most=20_000.0)
    phase: float = number(
        'time of the first sample, from the first tick on', 0.0, unit='s', least=0.0, most=3600.0
    )
    ppm: float = number(
        "by which the sensor's clock runs fast, in millionths", 0.0, least=-1e5, most=1e5
    )


@dataclass(frozen=True, slots=True)
class RateLimitEffect(JointRateLimit, SensorEffect):
    """The sensor's own, slower rate: sample and hold."""

    hold: str = choice(
        'between two samples: repeat the last one at every tick, or publish nothing',
        ('repeat', 'silent'),
        'repeat',
    )
    joints: Mapping[str, JointRateLimit] | None = own_parameters(
        'own sensor of a joint', JointRateLimit
    )

    suppresses_ticks = True
    is_recoverable = False
    reads = 'encoder'
    sample = '{rate: 500}'

    def sensor(self, context: Context) -> Sensor:
        """Build the sensor."""
        if self.joints is None:
            return RateLimit(self)
        from linkage_ros.stages.effects.own_sensors import (
            own_sensors,  # local import: only for joints
        )

        return own_sensors('rate_limit', self, context)


class RateLimit:
    """Sample and hold."""

    __slots__ = ('_begin', '_due', '_encoder', '_held', '_per', '_phase', '_repeat', '_unit')

    def __init__(self, use: RateLimitEffect) -> None:
        # f = numerator/denominator, and the k-th sample is due after ⌊(k·per + unit)/(2·unit)⌋ ns.
        rate = Fraction(use.rate) * (1 + Fraction(use.ppm) / 1_000_000)
        self._unit = rate.numerator
        self._per = 2_000_000_000 * rate.denominator
        self._phase = round(use.phase * 1e9)
        self._repeat = use.hold == 'repeat'
        self._held: SensorReading | None = None
        self._begin = self._due = -1
        self._encoder: Encoder | None = None

    def read_by(self, encoder: Encoder) -> None:
        """Make an encoder before it be read with each sample, not at every tick."""
        self._encoder = encoder
        encoder.read_at_ticks = False

    def __call__(self, now: int, reading: SensorReading) -> SensorReading | None:
        """Return the held sample; None if it is not repeated."""
        held = self._held
        if self._begin < 0:
            self._begin = self._due = now + self._phase
        if now < self._due:
            if held is None or not self._repeat:
                return None
            return restamp(held, reading.stamp)
        unit, per = self._unit, self._per
        elapsed = now - self._begin
        following = ((2 * elapsed + 1) * unit - 1) // per + 1
        self._due = self._begin + (following * per + unit) // (2 * unit)
        if self._encoder is not None:
            reading = self._encoder.difference_rates(now, reading)
        self._held = reading
        return reading
