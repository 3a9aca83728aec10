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
Curves of any length as a bounded number of intervals that keep minima and maxima.

As long as there is room each interval is one row. When there is none left, two neighbours become
one, and from then on an interval is filled with twice as many rows: its least and its greatest
value stay, in the order in which they came. So nobody has to know beforehand how long a run is.
"""

from __future__ import annotations

from typing import NamedTuple

from linkage_ros.report.arrays import Numbers, Times
import numpy as np

_LEAST = 256
"""Intervals, below which a curve tells nothing."""


class Intervals(NamedTuple):
    """
    Curves as intervals.

    Attributes
    ----------
    rows
        How many rows an interval is made of; the last may have fewer. Of 1 all rows are there.
    begins, ends
        Time of the first and the last row of each, in [ns].
    first, second
        Of each interval and column the least and the greatest value, that which came first first;
        NaN where there is none. The same where an interval is one row.

    """

    rows: int
    begins: Times
    ends: Times
    first: Numbers
    second: Numbers


def most_columns(room: int) -> int:
    """Return how many curves may share so much room, in [bytes]."""
    return room // (16 * _LEAST) - 1


def capacity(columns: int, room: int) -> int:
    """Return into how many intervals so many curves go that share so much room, in [bytes]."""
    # Of each interval two times, and two values of each curve, of 8 bytes each.
    most = room // (16 * columns + 16)
    return 1 << (most.bit_length() - 1)


class Extremes:
    """
    Curves that grow.

    Parameters
    ----------
    columns
        How many.
    most
        How many intervals there may be, a power of two; of single rows twice as many.

    """

    def __init__(self, columns: int, most: int) -> None:
        self._most = most
        self._rows = 1
        self._count = 0
        self._begins = np.empty(2 * most, np.int64)
        self._ends = np.empty(2 * most, np.int64)
        self._first = np.empty((2 * most, columns))
        self._second = np.empty((2 * most, columns))
        # The interval that is not full: of how many rows, and their least and greatest so far.
        self._open = 0
        self._ends_of_open = [0, 0]
        self._pair = np.empty((2, columns))

    def add(self, times: Times, values: Numbers) -> None:
        """
        Add rows.

        Parameters
        ----------
        times
            In [ns], of shape (n,).
        values
            Of shape (n, columns); NaN where there is none.

        """
        at = 0
        while at < len(times):
            if self._open:
                end = at + self._rows - self._open
                self._go_on(times[at:end], values[at:end])
                at = end
                continue
            room = (2 * self._most if self._rows == 1 else self._most) - self._count
            if not room:
                self._merge()
                continue
            whole = min(room, (len(times) - at) // self._rows)
            end = at + whole * self._rows
            if whole:
                self._take(times[at:end], values[at:end], whole)
            else:
                end = len(times)
                self._go_on(times[at:end], values[at:end])
            at = end

    def intervals(self) -> Intervals:
        """Return the curves; nothing is to be added after it."""
        if self._open:
            self._close()
        n = self._count
        return Intervals(
            self._rows, self._begins[:n], self._ends[:n], self._first[:n], self._second[:n]
        )

    def _go_on(self, times: Times, values: Numbers) -> None:
        """Add rows to the open interval, or begin one; it is closed where it is full."""
        if self._open:
            values = np.concatenate([self._pair, values])
        else:
            self._ends_of_open[0] = int(times[0])
        first, second = _least_and_greatest(values[None])
        self._pair = np.concatenate([first, second])
        self._ends_of_open[1] = int(times[-1])
        self._open += len(times)
        if self._open == self._rows:
            self._close()

    def _close(self) -> None:
        n = self._count
        self._begins[n], self._ends[n] = self._ends_of_open
        self._first[n], self._second[n] = self._pair
        self._count += 1
        self._open = 0

    def _take(self, times: Times, values: Numbers, count: int) -> None:
        start, end = self._count, self._count + count
        times = times.reshape(count, -1)
        self._begins[start:end], self._ends[start:end] = times[:, 0], times[:, -1]
        if times.shape[1] == 1:
            self._first[start:end] = self._second[start:end] = values
        else:
            found = _least_and_greatest(values.reshape(count, -1, values.shape[1]))
            self._first[start:end], self._second[start:end] = found
        self._count = end

    def _merge(self) -> None:
        """Make one interval of every two."""
        n = self._count
        half = n // 2
        self._begins[:half] = self._begins[0:n:2]
        self._ends[:half] = self._ends[1:n:2]
        both = np.stack([self._first[:n], self._second[:n]], axis=1)
        found = _least_and_greatest(both.reshape(half, 4, -1))
        self._first[:half], self._second[:half] = found
        self._count = half
        self._rows *= 2


def _least_and_greatest(values: Numbers) -> tuple[Numbers, Numbers]:
    """
    Return of groups of rows the least and the greatest value, that which came first first.

    Parameters
    ----------
    values
        Of shape (groups, rows, columns).

    """
    none = np.isnan(values)
    low = np.where(none, np.inf, values).argmin(axis=1)[:, None]
    high = np.where(none, -np.inf, values).argmax(axis=1)[:, None]
    # Among NaN and infinities alone the places found may hold a NaN beside a number.
    least = np.fmin.reduce(values, axis=1)
    greatest = np.fmax.reduce(values, axis=1)
    rising = (low <= high)[:, 0]
    first, second = greatest.copy(), least.copy()
    first[rising], second[rising] = least[rising], greatest[rising]
    return first, second
