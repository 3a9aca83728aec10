# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
History of a sensor's readings, for delay and jitter.

Between two readings, a value x with the rate v is the cubic with the values and rates of both ends
(Hermite's; C. de Boor, A Practical Guide to Splines, 1978, ch. IV). With s from 0 to 1 over the
interval h, and Δ = x₁ − x₀::

    x(s) = x₀ + s·Δ + s·(1 − s)·((1 − s)·(h·v₀ − Δ) − s·(h·v₁ − Δ))

Its error is at most h⁴/384 times the largest fourth derivative. Without rates it is the straight
line x₀ + s·Δ, with an error of h²/8 times the largest second derivative. Rates, accelerations and
efforts are interpolated linearly too; those that one of the two readings lacks are left out.

At a tick next to a toggle a rate may be any number, and the cubic would leave the motion of the
mechanism. If the readings resolve the motion, c = h·v₀ + h·v₁ − 2Δ, which is h³/6 times the third
derivative, is small against the change of the rates or the displacement. Where
2·|c| > |h·v₁ − h·v₀| + |Δ| the rates do not fit the values, and the straight line is used.

Where the linkage has no pose there is a gap: nothing is read, and nothing is interpolated across
it.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque

from linkage_ros.stages.effects.stage import SensorReading

_Values = tuple[float, ...]


class History:
    """
    Readings and gaps of a time span, in [ns]; older ones are deleted.

    A gap begins at the first time without a reading, and lasts until the next reading. With
    ``with_rates`` the values change at the given rates; a crank that is held between its samples
    has a rate but stands still.
    """

    __slots__ = ('_readings', '_span', '_times', '_with_rates')

    def __init__(self, span: int, with_rates: bool = True) -> None:
        self._span = span
        self._with_rates = with_rates
        self._times: deque[int] = deque()
        self._readings: deque[SensorReading | None] = deque()

    def __len__(self) -> int:
        return len(self._times)

    @property
    def earliest_time(self) -> int:
        """Earliest time in memory, in [ns]."""
        return self._times[0]

    def add(self, now: int, reading: SensorReading) -> None:
        """
        Add the reading of a tick at a time, in [ns], never before the last one.

        Of readings at the same time the last one counts.
        """
        times, readings = self._times, self._readings
        if times and times[-1] == now:
            readings[-1] = reading
            return
        self._append(now, reading)

    def add_gap(self, now: int) -> bool:
        """
        Add a gap at a time, in [ns]; return whether a new gap begins.

        Within a gap, and before the first reading, no new gap begins.
        """
        if not self._times or self._readings[-1] is None:
            return False
        self._append(now, None)
        return True

    def _append(self, now: int, reading: SensorReading | None) -> None:
        times, readings = self._times, self._readings
        if times:
            # Counted back from the last time: readings that have come due since are still needed.
            oldest = times[-1] - self._span
            while len(times) > 1 and times[1] <= oldest:
                times.popleft()
                readings.popleft()
        times.append(now)
        readings.append(reading)

    def newest_reading(self, time: int, since: int) -> SensorReading | None:
        """
        Return the newest reading at a time, in [ns]; in a gap the last one before it, once.

        ``since`` is the time of the last request: in a gap only a later reading is returned.
        """
        at = bisect_right(self._times, time)
        if at and self._readings[at - 1] is not None:
            return self._readings[at - 1]
        return self._before_gap(time, since)

    def interpolate(self, time: int) -> SensorReading | None:
        """
        Return the interpolated reading at a time, in [ns], which becomes its stamp.

        After the newest reading there is no second one to interpolate with: the result is the
        newest reading, with its own stamp. Before the first reading, and in a gap, the result is
        None.
        """
        at = bisect_right(self._times, time)
        if not at:
            return None
        before, begin = self._readings[at - 1], self._times[at - 1]
        if begin == time or at == len(self._times):
            return before
        after = self._readings[at]
        if before is None or after is None:
            return None
        return _mix_readings(time, begin, before, self._times[at], after, self._with_rates)

    def arriving_reading(self, time: int, since: int) -> SensorReading | None:
        """Return as `interpolate`, and also the last reading before a gap, unchanged and once."""
        return self.interpolate(time) or self._before_gap(time, since)

    def _before_gap(self, time: int, since: int) -> SensorReading | None:
        """Return the newest reading at a time, if it came after another time."""
        at = bisect_right(self._times, time)
        while at and self._times[at - 1] > since:
            at -= 1
            if self._readings[at] is not None:
                return self._readings[at]
        return None

    def readings_after(self, time: int) -> list[tuple[int, SensorReading]]:
        """Return the readings after a time, in [ns], each with its time."""
        pairs = zip(self._times, self._readings, strict=True)
        return [(at, reading) for at, reading in pairs if at > time and reading is not None]


def _mix_readings(
    time: int, begin: int, before: SensorReading, end: int, after: SensorReading, with_rates: bool
) -> SensorReading:
    """Return the reading at a time between two readings, all times in [ns]."""
    s = (time - begin) / (end - begin)
    _, x0, v0, a0, e0 = before
    _, x1, v1, a1, e1 = after
    if with_rates and v0 and v1:
        h = (end - begin) * 1e-9
        joints = tuple(
            [
                _interpolate_cubic(s, p, q, h * v, h * w)
                for p, q, v, w in zip(x0, x1, v0, v1, strict=True)
            ]
        )
    else:
        joints = _interpolate_linear(s, x0, x1)
    return SensorReading(
        time,
        joints,
        _interpolate_linear(s, v0, v1),
        _interpolate_linear(s, a0, a1),
        _interpolate_linear(s, e0, e1),
    )


def _interpolate_cubic(s: float, x0: float, x1: float, tangent0: float, tangent1: float) -> float:
    """Return the value at s; the tangents are the rates at the ends times the interval."""
    step = x1 - x0
    more0, more1 = tangent0 - step, tangent1 - step
    line = x0 + s * step
    if 2.0 * abs(more0 + more1) > abs(tangent1 - tangent0) + abs(step):
        return line
    r = 1.0 - s
    return line + s * r * (r * more0 - s * more1)


def _interpolate_linear(s: float, first: _Values, last: _Values) -> _Values:
    if not first or not last:
        return ()
    return tuple([a + s * (b - a) for a, b in zip(first, last, strict=True)])
