# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Delay: the reading arrives later, by a transport time that is exact to the nanosecond.

With the delay d in whole nanoseconds, at the tick t::

    y(t) = x(t − d)

``between`` defines x between two ticks: ``interpolated``, as in `history`; or ``sampled``, the
newest reading that is at least d old, as in a line with one reading per tick (the delays of
dm_control's observables: S. Tunyasuvunakool et al., dm_control: Software and tasks for continuous
control, Software Impacts 6, 2020; in a control loop: B. Wittenmark, J. Nilsson and M. Törngren,
Timing problems in real-time control systems, ACC 1995). The default is ``sampled`` after an
encoder, whose readings stay whole counts, and ``interpolated`` otherwise.

Nothing is published before there is a reading of that age, and nothing is extrapolated. Where the
linkage had no pose, or no crank state, there is a gap: it arrives d later. The last reading before
it arrives unchanged, at the first tick that is d later; nothing is interpolated across the gap.

After a sensor that is silent at times (a slow one, a lossy one) the line carries messages instead
of a signal. The first silence also arrives d later: from the last reading before it on, each
reading arrives once, unchanged, at the first tick that is d later; if several are due between two
ticks, one at each tick.

With ``stamp: arrival`` the message has the stamp of its tick, as from a driver that does not know
the delay; with ``measured`` the time of measurement, t − d, or the stamp of the reading.

The line holds the readings of the last d: 1000 for a second at 1 kHz.

With ``spread``, v, the latency of each reading is random: d + v·u, with u uniform in [0, 1], or
with the mean 1 if ``distribution`` is exponential (cut off at 20). Then readings are messages from
the beginning. With ``reorder`` a message may overtake others, as over several paths or by UDP;
else it arrives with the one before it at the earliest, as over TCP. With the probability
``duplicates`` a message arrives a second time, after its own latency. Of several that arrive
between two ticks the last one is published. (On latencies in networked control: J. Nilsson,
Real-Time Control Systems with Delays, 1998.)

A joint under ``joints`` has its own line, with its own latency: see `own_sensors`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from random import Random

from linkage_ros.description import choice, flag, number, own_parameters
from linkage_ros.errors import DefinitionError
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects.effect import Effect, SensorEffect
from linkage_ros.stages.effects.history import History
from linkage_ros.stages.effects.stage import restamp, Sensor, SensorReading

_AUTOMATIC = 'automatic'

_LONGEST = 20.0
"""Largest exponential latency, in its mean: one of 5e8 is longer."""


@dataclass(frozen=True, slots=True)
class JointDelay:
    """Transport delay of a joint's own sensor."""

    seconds: float = number('delay, rounded to nanoseconds', unit='s', least=0.0, most=10.0)
    between: str = choice(
        'between two ticks: the value at exactly that time, or the newest that is old enough; '
        'automatic: sampled after an encoder, else interpolated',
        ('interpolated', 'sampled', _AUTOMATIC),
        _AUTOMATIC,
    )
    spread: float = number(
        'random part of the latency: its most, or its mean', 0.0, unit='s', least=0.0, most=10.0
    )
    distribution: str = choice(
        'distribution of the random part', ('uniform', 'exponential'), 'uniform'
    )
    reorder: bool = flag('a message may overtake others', False)
    duplicates: float = number(
        'probability that a message arrives twice', 0.0, least=0.0, most=1.0
    )

    @property
    def is_random(self) -> bool:
        """Whether the line carries messages with random latencies."""
        return bool(self.spread or self.duplicates)


@dataclass(frozen=True, slots=True)
class DelayEffect(JointDelay, SensorEffect):
    """Transport delay: readings arrive later."""

    stamp: str = choice(
        'stamp of the message: time of its arrival, or of the measurement',
        ('arrival', 'measured'),
        'arrival',
    )
    joints: Mapping[str, JointDelay] | None = own_parameters('own line of a joint', JointDelay)

    needs = ('velocity',)
    suppresses_ticks = True
    sample = '{seconds: 0.002}'

    @property
    def delay_lines(self) -> tuple[JointDelay, ...]:
        """Return the line of the joints without their own one, and these."""
        return self, *(self.joints or {}).values()

    @property
    def is_recoverable(self) -> bool:
        """Return whether no line has random latencies."""
        return not any(line.is_random for line in self.delay_lines)

    def needs_here(self, named: Collection[str], *, moves_by_rates: bool) -> tuple[str, ...]:
        """Return `needs` if a line interpolates, and the crank moves by its rates."""
        return self.needs if moves_by_rates and self.interpolates_readings(named) else ()

    def refusal_beside(self, beside: Sequence[Effect | None]) -> DefinitionError | None:
        """Return an error for measurement stamps that cannot share one message of linkages."""
        if self.stamp != 'measured' or all(effect == self for effect in beside):
            return None
        return DefinitionError(
            'effects.delay.stamp',
            'measured gives a linkage its own stamp, and all linkages share one message',
            'give all linkages the same delay, or write arrival',
        )

    def interpolates_readings(self, named: Collection[str]) -> bool:
        """Return whether a line interpolates readings, given the effects of the scene."""
        between = {line.between for line in self.delay_lines if not line.is_random}
        return 'interpolated' in between or (_AUTOMATIC in between and 'encoder' not in named)

    def sensor(self, context: Context) -> Sensor:
        """
        Build the sensor.

        Raise `DefinitionError` if readings of random latency are to be interpolated, or to
        overtake without a spread, or if joints that were measured at several times are to have one
        stamp.
        """
        if self.joints is not None:
            from linkage_ros.stages.effects.own_sensors import (
                own_sensors,  # local import: only for joints
            )

            if self.stamp == 'measured':
                raise DefinitionError(
                    'effects.delay.stamp',
                    'measured is one time, and joints with their own lines have several',
                    'write arrival, or leave joints out',
                )
            return own_sensors('delay', self, context)
        if self.is_random and self.between == 'interpolated':
            raise DefinitionError(
                'effects.delay.between',
                'interpolated takes one latency for all readings',
                'leave it out, or spread and duplicates',
            )
        if self.reorder and not self.spread:
            raise DefinitionError(
                'effects.delay.reorder', 'nothing overtakes without a spread', 'write spread too'
            )
        if self.is_random:
            return RandomDelay(self, context.random('delay'))
        return Delay(self, self.interpolates_readings(context.effects), context.moves_by_rates)


class Delay:
    """
    A delay line.

    If it ``mixes``, it interpolates readings between ticks, with their rates if ``with_rates``;
    otherwise it carries one reading per tick.
    """

    __slots__ = (
        '_arrived', '_delay', '_history', '_look', '_measured', '_messages', '_on_the_way',
        'gap_begins',
    )  # fmt: skip

    def __init__(self, use: DelayEffect, mixes: bool, with_rates: bool = True) -> None:
        self._delay = round(use.seconds * 1e9)
        self._history = History(self._delay, with_rates)
        self._look = self._history.arriving_reading if mixes else self._history.newest_reading
        self._measured = use.stamp == 'measured'
        self._arrived = -1
        """Time up to which readings have arrived, in [ns]."""
        self._messages: int | None = None
        """Time of the last reading before the first silence, in [ns]; None before it."""
        self._on_the_way: deque[tuple[int, SensorReading]] = deque()
        """Later readings that have not arrived yet."""
        self.gap_begins = False

    def __call__(self, now: int, reading: SensorReading | None) -> SensorReading | None:
        """Return the arriving reading; None as `reading` means that the sensor is silent."""
        if self._messages is not None:
            if reading is not None:
                self._on_the_way.append((now, reading))
        elif reading is None:
            self._begin_messages()
        else:
            self._history.add(now, reading)
        return self._arriving_reading(now)

    def gap(self, now: int) -> SensorReading | None:
        """Return the arriving reading at a time, in [ns], at which the linkage has no pose."""
        self.gap_begins = self._messages is None and self._history.add_gap(now)
        return self._arriving_reading(now)

    def silence(self, now: int, gap: bool) -> SensorReading | None:
        """Return the arriving reading where a sensor before is silent, or in a gap."""
        return self.gap(now) if gap else self(now, None)

    def _begin_messages(self) -> None:
        """Make the line carry messages from the newest reading on."""
        self._messages = -1
        for newest in self._history.readings_after(self._arrived)[-1:]:
            self._messages = newest[0]
            self._on_the_way.append(newest)

    def _arriving_reading(self, now: int) -> SensorReading | None:
        due = now - self._delay
        if self._messages is not None and due >= self._messages:
            arrived = self._next_due(due)
        else:
            arrived = self._look(due, self._arrived)
        self._arrived = due
        return arrived if arrived is None or self._measured else restamp(arrived, now)

    def _next_due(self, due: int) -> SensorReading | None:
        """Return the first waiting reading, if it is due."""
        if self._on_the_way and self._on_the_way[0][0] <= due:
            return self._on_the_way.popleft()[1]
        return None


class RandomDelay:
    """A line of messages with random latencies."""

    __slots__ = ('_count', '_delay', '_draw', '_duplicates', '_latest', '_measured', '_random',
                 '_reorder', '_way', 'gap_begins')  # fmt: skip

    def __init__(self, use: DelayEffect, random: Random) -> None:
        self._delay, spread = round(use.seconds * 1e9), use.spread * 1e9
        self._random = random.random
        self._draw: Callable[[], int] = (
            (lambda: round(spread * random.random()))
            if use.distribution == 'uniform'
            else (lambda: round(spread * min(random.expovariate(1.0), _LONGEST)))
        )
        self._reorder, self._duplicates = use.reorder, use.duplicates
        self._measured = use.stamp == 'measured'
        self._way: list[tuple[int, int, SensorReading]] = []
        """Messages on the way: when each arrives, in [ns], and its number."""
        self._count = self._latest = 0
        self.gap_begins = False

    def __call__(self, now: int, reading: SensorReading | None) -> SensorReading | None:
        """Return the arriving message; None as `reading` means that the sensor is silent."""
        if reading is not None:
            self._send_reading(now, reading)
            if self._duplicates and self._random() < self._duplicates:
                self._send_reading(now, reading)
        arrived: SensorReading | None = None
        while self._way and self._way[0][0] <= now:
            _, _, arrived = heappop(self._way)
        return arrived if arrived is None or self._measured else restamp(arrived, now)

    def gap(self, now: int) -> SensorReading | None:
        """Return the arriving message at a time, in [ns], at which the linkage has no pose."""
        return self(now, None)

    def silence(self, now: int, gap: bool) -> SensorReading | None:
        """Return the arriving message where a sensor before is silent, or in a gap."""
        return self.gap(now) if gap else self(now, None)

    def _send_reading(self, now: int, reading: SensorReading) -> None:
        arrives = now + self._delay + self._draw()
        if not self._reorder:
            arrives = self._latest = max(arrives, self._latest)
        heappush(self._way, (arrives, self._count, reading))
        self._count += 1
