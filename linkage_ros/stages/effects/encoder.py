# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Encoder: a joint is read in whole counts.

With n ``counts`` per turn (per metre for a slide), θ₀ the ``offset`` at which count 0 begins, and
q = 2π/n the resolution (1/n for a slide)::

    k = ⌊(θ − θ₀)/q⌋        y = θ₀ + k·q

so that y ≤ θ < y + q: on average a reading is half a count low, and it deviates from that by up to
half a count (P. R. Bélanger, Estimation of angular velocity and acceleration from shaft encoder
measurements, ICRA 1992). k is an integer of any size and k·q is computed anew each time: no error
accumulates over turns.

``incremental``: the encoder counts from the position at power-on, at the first tick, and reads
y = (k − k₀)·q, until it passes its index mark, which lies where count 0 begins, on every turn.
From then on it knows k. A mark is passed if it lies between the counts of two ticks; a mark passed
back and forth between two ticks is not seen. A slide has one mark, at θ₀. Without ``index`` k
stays unknown.

``absolute`` encoders know the angle within one turn: k is counted from −n/2 to n/2, so that y lies
within half a turn of θ₀; ``multi_turn: true`` also counts turns, as encoders with a battery or
gears do. A slide has no turns.

``rates: differenced`` are the rates that a driver computes from the counts, (k − k_last)·q/Δt,
with Δt the time since its last reading: at the last tick, or at the last sample of `rate_limit`.
They are 0 at its first reading, and unchanged if no time has passed. They are whole multiples of
q/Δt (R. H. Brown, S. C. Schneider and M. G. Mulligan, Analysis of algorithms for velocity
estimation from discrete position versus time data, IEEE Transactions on Industrial Electronics 39,
1992), unless a driver smooths them by a low-pass of order one with the frequency ``cutoff``::

    v ← v + (1 − e^(−2π·cutoff·Δt))·(d − v)

which is exact for a difference d that is held over Δt. Turns and the step of y at the index mark
are not a motion, and not part of the differences. ``exact`` leaves the rates unchanged. A reading
without rates gets none. Accelerations, efforts, and joints without an encoder are unchanged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import expm1, floor, tau

from linkage_ros.description import choice, each_part, flag, number, whole_number
from linkage_ros.errors import DefinitionError
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects.effect import SensorEffect
from linkage_ros.stages.effects.stage import Sensor, SensorReading


@dataclass(frozen=True, slots=True)
class JointEncoder:
    """The encoder of a joint."""

    counts: int = whole_number(
        'counts in a turn, or in a metre of a slide', unit='1/turn or 1/m', least=1, most=2**32
    )
    offset: float = number('where count 0 begins', 0.0, unit='rad or m', least=-1e6, most=1e6)
    incremental: bool = flag(
        'counts from the position at power-on, until it passes its index mark', False
    )
    index: bool = flag('has an index mark, where count 0 begins', True)
    multi_turn: bool = flag('an absolute encoder that also counts turns', False)


@dataclass(frozen=True, slots=True)
class EncoderEffect(SensorEffect):
    """Joints are read in whole counts."""

    joints: Mapping[str, JointEncoder] = each_part(
        'encoder of a joint', 'joint', JointEncoder, required=True
    )
    rates: str = choice(
        'rates of these joints: differences of their counts over the time between two readings of '
        'the driver, or exact',
        ('differenced', 'exact'),
        'differenced',
    )
    cutoff: float = number(
        'of a low-pass of order one behind the differences; 0: none',
        0.0,
        unit='Hz',
        least=0.0,
        most=1e6,
    )

    sample = '{joints: {rocker_joint: {counts: 4096}}}'

    @property
    def is_recoverable(self) -> bool:
        """Return whether it neither counts from power-on nor has a low-pass."""
        return not self.cutoff and not any(encoder.incremental for encoder in self.joints.values())

    def sensor(self, context: Context) -> Sensor:
        """
        Build the sensor.

        Raise `DefinitionError` if an absolute encoder has ``index: false``, or if a low-pass has
        no differences to smooth.
        """
        if self.cutoff and self.rates == 'exact':
            raise DefinitionError(
                'effects.encoder.cutoff', 'smooths differences', 'leave it or rates: exact out'
            )
        counters = []
        for place, (joint, turns) in enumerate(
            zip(context.joints, context.closure.turning, strict=True)
        ):
            encoder = self.joints.get(joint)
            if encoder is None:
                continue
            if not (encoder.index or encoder.incremental):
                raise DefinitionError(
                    f'effects.encoder.joints.{joint}.index',
                    'an absolute encoder needs no mark',
                    'leave it out, or write incremental: true',
                )
            if encoder.multi_turn and (encoder.incremental or not turns):
                raise DefinitionError(
                    f'effects.encoder.joints.{joint}.multi_turn',
                    'an incremental encoder counts on and on'
                    if encoder.incremental
                    else f'{joint} is a slide and has no turns',
                    'leave it out',
                )
            counters.append((place, Counter(encoder, turns, self.cutoff)))
        return Encoder(tuple(counters), self.rates == 'differenced')


class Counter:
    """
    The counts of one joint; ``turns`` is True if the joint is an angle.

    ``cutoff`` is the frequency of the low-pass of the rate, in [Hz]; 0 for none.
    """

    __slots__ = (
        '_begin', '_counts', '_cutoff', '_encoder', '_in_a_turn', '_last', '_read', '_span',
        '_turns', 'rate',
    )  # fmt: skip

    rate: float
    """Rate that a driver computes from the counts, in [rad/s] or [m/s]."""

    def __init__(self, encoder: JointEncoder, turns: bool, cutoff: float = 0.0) -> None:
        self._encoder = encoder
        self._cutoff = cutoff
        self._turns = turns
        self._in_a_turn = turns and not (encoder.incremental or encoder.multi_turn)
        # Counts and the range of n counts: (k*tau)/n is more exact than k times a rounded
        # resolution.
        self._counts, self._span = encoder.counts, tau if turns else 1.0
        self._last: int | None = None
        self._begin: int | None = None
        self._read: int | None = None
        self.rate = 0.0

    def count_value(self, value: float) -> float:
        """Return the reading for a value, in [rad] or [m]."""
        encoder, counts, span, last = self._encoder, self._counts, self._span, self._last
        count = floor((value - encoder.offset) * counts / span)
        if last is None:
            self._begin = count if encoder.incremental else None
        elif self._begin is not None and encoder.index and self._passes_index(last, count):
            self._begin = None
        self._last = count
        if self._begin is not None:
            return (count - self._begin) * span / counts
        if self._in_a_turn:
            count = (count + counts // 2) % counts - counts // 2
        return encoder.offset + count * span / counts

    def read_rate(self, elapsed: int) -> float:
        """Return the rate that a driver computes, a time [ns] after its last reading."""
        if self._read is not None and self._last is not None and elapsed > 0:
            moved = self._last - self._read
            rate = moved * self._span / (self._counts * elapsed * 1e-9)
            if self._cutoff:
                rate = self.rate - expm1(-tau * self._cutoff * elapsed * 1e-9) * (rate - self.rate)
            self.rate = rate
        self._read = self._last
        return self.rate

    def _passes_index(self, last: int, count: int) -> bool:
        """Return whether an index mark lies between two counts."""
        if self._turns:
            return last // self._counts != count // self._counts
        return (last < 0) != (count < 0)


class Encoder:
    """
    The encoders of a linkage: index and counter of each joint with an encoder.

    If ``differenced``, the rates are computed from the counts.
    """

    __slots__ = ('_counters', '_differenced', '_last', 'read_at_ticks')

    def __init__(self, counters: tuple[tuple[int, Counter], ...], differenced: bool) -> None:
        self._counters = counters
        self._differenced = differenced
        self._last = 0
        self.read_at_ticks = True  # If False, only `difference_rates` reads the counts

    def select_joints(self, places: Sequence[int]) -> Encoder:
        """Return a driver that reads the counts of these joints alone, at its own times."""
        counters = dict(self._counters)
        selected = [(at, counters[place]) for at, place in enumerate(places) if place in counters]
        return Encoder(tuple(selected), self._differenced)

    def __call__(self, now: int, reading: SensorReading) -> SensorReading:
        """Return the reading of the encoders."""
        values = list(reading.joints)
        for place, counter in self._counters:
            values[place] = counter.count_value(values[place])
        counted = reading._replace(joints=tuple(values))
        return self.difference_rates(now, counted) if self.read_at_ticks else counted

    def difference_rates(self, now: int, reading: SensorReading) -> SensorReading:
        """Return a reading with the rates that the driver computes, at a time in [ns]."""
        if not self._differenced:
            return reading
        elapsed = now - self._last
        self._last = now
        speeds = list(reading.rates)
        for place, counter in self._counters:
            rate = counter.read_rate(elapsed)
            if speeds:
                speeds[place] = rate
        return reading._replace(rates=tuple(speeds))
