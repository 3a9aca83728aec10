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
Delay: what is read arrives later, by a transport time that is exact to the nanosecond.

With the delay d in whole nanoseconds, at the tick t::

    y(t) = x(t − d)

``between`` says what x is between two ticks: ``interpolated``, as `history` has it; or
``sampled``, the newest reading that is at least d old, as of a line that carries one reading for
each tick (the delays of dm_control's observables: S. Tunyasuvunakool et al., dm_control: Software
and tasks for continuous control, Software Impacts 6, 2020; in a control loop: B. Wittenmark, J.
Nilsson and M. Törngren, Timing problems in real-time control systems, ACC 1995). A reading of an
encoder keeps its whole counts only where it is sampled.

Nothing is published before there is a reading that old, and nothing is extrapolated. Behind a
sensor that is silent at times (a slow one, a lossy one) the line carries messages and no signal:
from the first silence on, each reading arrives once, as it is, with the first tick that is d
later; of several that come due between two ticks, one with each tick.

``stamp: arrival`` leaves the message the stamp of its tick, as a driver does that knows of no
delay; ``measured`` is the time at which the sensor saw it, t − d, or that of the reading.

The line holds the readings of the last d: at 1 kHz a thousand for a second.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from linkage_ros.drives.drive import Context
from linkage_ros.effects.history import History
from linkage_ros.effects.stage import Reading, restamped
from linkage_ros.parameters import choice, number


@dataclass(frozen=True, slots=True)
class DelayParameters:
    """Transport delay: what is read arrives later."""

    seconds: float = number(
        'how much later, rounded to nanoseconds', unit='s', least=0.0, most=10.0
    )
    between: str = choice(
        'between two ticks: the value at exactly that time, or the newest that is old enough',
        ('interpolated', 'sampled'),
        'interpolated',
    )
    stamp: str = choice(
        'stamp of the message: time of its arrival, or of the measurement',
        ('arrival', 'measured'),
        'arrival',
    )


PARAMETERS = DelayParameters


def sensor(parameters: DelayParameters, _context: Context) -> Delay:
    """Build the sensor."""
    return Delay(parameters)


class Delay:
    """
    A delay line.

    Parameters
    ----------
    use
        What it does.

    """

    __slots__ = ('_arrived', '_delay', '_history', '_look', '_measured', '_on_the_way')

    def __init__(self, use: DelayParameters) -> None:
        self._delay = round(use.seconds * 1e9)
        self._history = History(self._delay)
        sampled = use.between == 'sampled'
        self._look = self._history.newest if sampled else self._history.between
        self._measured = use.stamp == 'measured'
        self._arrived = -1
        """Time up to which readings have arrived while there was no silence, in [ns]."""
        self._on_the_way: deque[tuple[int, Reading]] | None = None
        """Readings that have not arrived; nothing before the first silence."""

    def __call__(self, now: int, reading: Reading | None) -> Reading | None:
        """Return what arrives; None in the place of a reading is silence."""
        due = now - self._delay
        if reading is None and self._on_the_way is None:
            self._on_the_way = deque(self._history.after(self._arrived))
        if self._on_the_way is None:
            assert reading is not None
            self._history.add(now, reading)
            self._arrived = due
            found = self._look(due)
        else:
            found = self._next(self._on_the_way, now, reading, due)
        return found if found is None or self._measured else restamped(found, now)

    @staticmethod
    def _next(
        on_the_way: deque[tuple[int, Reading]], now: int, reading: Reading | None, due: int
    ) -> Reading | None:
        """Send a reading on its way, and return the first that is due."""
        if reading is not None:
            on_the_way.append((now, reading))
        if on_the_way and on_the_way[0][0] <= due:
            return on_the_way.popleft()[1]
        return None
