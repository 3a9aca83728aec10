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
Jitter: the instant at which the sensor looks wanders; its stamp does not know.

At the tick t the sensor has looked δ earlier, and all joints at one instant::

    y(t) = x(t − δ)        0 ≤ δ ≤ J, drawn anew for each tick

``uniform``: δ = J·u with u uniform in [0, 1), as of a sensor that runs freely. ``half_normal``:
δ = min(|n|, J) with n normal and of the standard deviation J/3, as of one that is held up now and
then (B. Wittenmark, J. Nilsson and M. Törngren, Timing problems in real-time control systems, ACC
1995); 0.3 % of the draws lie beyond J. A mechanism at the rate v is misread by up to v·J.

Between two ticks x is interpolated, as `history` has it. A sensor cannot look before the first
tick: an instant before it is the first tick's. Where J is more than a period, an instant may lie
before that of the tick before. The message keeps the stamp of its tick. Where the linkage has no
pose, or had none at the instant, nothing is read.

All instants are whole nanoseconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from random import Random

from linkage_ros.drives.drive import Context
from linkage_ros.effects.history import History
from linkage_ros.effects.stage import restamped, SensorReading
from linkage_ros.files.parameters import choice, number


@dataclass(frozen=True, slots=True)
class JitterParameters:
    """The sensor looks earlier than its stamp says, by a time that wanders."""

    seconds: float = number('earlier at most', unit='s', least=0.0, most=1.0)
    distribution: str = choice(
        'of the time, between 0 and that', ('uniform', 'half_normal'), 'uniform'
    )


PARAMETERS = JitterParameters


def sensor(parameters: JitterParameters, context: Context) -> Jitter:
    """Build the sensor."""
    return Jitter(parameters, context.random('jitter'), context.moves_by_rates)


class Jitter:
    """
    A sensor whose instants wander.

    Parameters
    ----------
    use
        What it does.
    random
        What draws how much earlier it looks.
    with_rates
        Whether readings are mixed by their rates, too.

    Attributes
    ----------
    gap_begins
        Whether the last gap that it was told of began there.

    """

    __slots__ = ('_earlier', '_history', 'gap_begins')

    def __init__(self, use: JitterParameters, random: Random, with_rates: bool) -> None:
        most = round(use.seconds * 1e9)
        self._history = History(most, with_rates)
        self.gap_begins = False
        if use.distribution == 'uniform':
            uniform = random.random

            def earlier() -> int:
                return int((most + 1) * uniform())
        else:
            normal, deviation = random.gauss, most / 3.0

            def earlier() -> int:
                return min(round(abs(normal(0.0, deviation))), most)

        self._earlier = earlier

    def __call__(self, now: int, reading: SensorReading) -> SensorReading | None:
        """Return what is read at a time, in [ns]."""
        history = self._history
        history.add(now, reading)
        found = history.between(max(now - self._earlier(), history.begin))
        return None if found is None else restamped(found, reading.stamp)

    def gap(self, now: int) -> None:
        """Take note that the linkage has no pose at a time, in [ns]; nothing is read."""
        self.gap_begins = self._history.add_gap(now)
