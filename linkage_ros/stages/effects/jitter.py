# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Jitter: the instant of measurement varies, but the stamp does not show it.

At the tick t the sensor has measured all joints at one instant, δ earlier::

    y(t) = x(t − δ)        0 ≤ δ ≤ J, drawn anew for each tick

``uniform``: δ = J·u with u uniform in [0, 1), as in a free-running sensor. ``half_normal``:
δ = min(|n|, J) with n normal with standard deviation J/3, as in a sensor that is delayed at times
(B. Wittenmark, J. Nilsson and M. Törngren, Timing problems in real-time control systems, ACC
1995); 0.3 % of the draws lie beyond J. At the rate v the error of a reading is up to v·J.

Between two ticks x is interpolated as in `history`. An instant before the first tick is replaced
by the first tick's. If J is longer than a period, an instant may come before the previous tick's
instant. The message keeps the stamp of its tick. Where the linkage has no pose, or had none at the
instant, nothing is read.

All instants are whole nanoseconds.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from random import Random

from linkage_ros.description import choice, number
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects.effect import SensorEffect
from linkage_ros.stages.effects.history import History
from linkage_ros.stages.effects.stage import restamp, SensorReading


@dataclass(frozen=True, slots=True)
class JitterEffect(SensorEffect):
    """The sensor measures earlier than the stamp says, by a varying time."""

    seconds: float = number('longest time by which it is earlier', unit='s', least=0.0, most=1.0)
    distribution: str = choice(
        'of that time, between 0 and its maximum', ('uniform', 'half_normal'), 'uniform'
    )

    needs = ('velocity',)
    suppresses_ticks = True
    is_recoverable = False
    sample = '{seconds: 1.0e-4}'

    def needs_here(self, _named: Collection[str], *, moves_by_rates: bool) -> tuple[str, ...]:
        """Return `needs` if the crank moves by its rates between two readings."""
        return self.needs if moves_by_rates else ()

    def sensor(self, context: Context) -> Jitter:
        """Build the sensor."""
        return Jitter(self, context.random('jitter'), context.moves_by_rates)


class Jitter:
    """
    Sensor stage with varying instants of measurement; ``random`` draws δ.

    With ``with_rates`` the interpolation uses the rates too.
    """

    __slots__ = ('_earlier', '_history', 'gap_begins')

    def __init__(self, use: JitterEffect, random: Random, with_rates: bool) -> None:
        most = round(use.seconds * 1e9)
        self._history = History(most, with_rates)
        self.gap_begins = False
        if use.distribution == 'uniform':
            uniform = random.random

            def draw_lead_time() -> int:
                return int((most + 1) * uniform())
        else:
            normal, deviation = random.gauss, most / 3.0

            def draw_lead_time() -> int:
                return min(round(abs(normal(0.0, deviation))), most)

        self._earlier = draw_lead_time

    def __call__(self, now: int, reading: SensorReading) -> SensorReading | None:
        """Return the reading at a time, in [ns]."""
        history = self._history
        history.add(now, reading)
        earlier = history.interpolate(max(now - self._earlier(), history.earliest_time))
        return None if earlier is None else restamp(earlier, reading.stamp)

    def gap(self, now: int) -> None:
        """Record that the linkage has no pose at a time, in [ns]; nothing is read."""
        self.gap_begins = self._history.add_gap(now)
