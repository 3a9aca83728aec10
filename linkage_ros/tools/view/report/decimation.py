# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Bounded memory for runs of any length, and the size limits of a page.

A curve becomes a bounded number of intervals that keep minima and maxima. At first each interval
is one row. When the intervals are full, neighbours are merged in pairs, and from then on an
interval takes twice as many rows; its minimum and maximum stay, in the order in which they came.
So the length of a run need not be known in advance. Rows at equal steps are decimated in the same
way, and durations are counted in bins.

Numbers are written to a page as base64, which takes 4 bytes for 3.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Times = NDArray[np.int64]
"""In [ns]."""

Numbers = NDArray[np.float64]
Flags = NDArray[np.bool_]

PAGE_BYTES = 20_000_000
"""Size limit of a page, in [bytes]; a quarter of it is the plotting library."""

STATE_BYTES, SAMPLE_BYTES, FORCE_BYTES = 3_000_000, 1_400_000, 600_000
DURATION_BYTES, FRAME_BYTES = 500_000, 2_500_000
"""
Size limits of the numbers, in [bytes], before encoding.

One each for the curves of joints, of the crank and of pin forces, of lateness and of age, and for
the instants of the animation with the poses of the links.
"""

MOST_FRAMES = 20_000

SHAPE_BYTES = 500_000
"""Size limit of the shapes of the linkages, in [bytes]."""

TABLE_BYTES = 600_000
"""Size limit of the tables, in [bytes]."""

_FEWEST_INTERVALS = 256
"""Minimum number of intervals of a useful curve."""

_PER_DECADE = 10
_FIRST, _LAST = 2, 12
"""Powers of ten, in [ns], of the first and last bin edge."""

EDGES = [10 ** (_FIRST + i / _PER_DECADE) for i in range(_PER_DECADE * (_LAST - _FIRST) + 1)]
"""Edges of the bins, in [ns]; one more bin lies below the first and one above the last."""


class Intervals(NamedTuple):
    """Curves as intervals."""

    rows: int  # Rows of an interval; the last may have fewer. If it is 1, all rows are kept.
    # Time of the first and the last row of each, in [ns].
    begins: Times
    ends: Times
    # Minimum and maximum of each interval and column, in the order in which they came; NaN if
    # there is none. Equal if an interval is one row.
    first: Numbers
    second: Numbers


def most_columns(space: int) -> int:
    """Return the maximum number of curves for a size limit, in [bytes]."""
    return space // (16 * _FEWEST_INTERVALS) - 1


def interval_capacity(columns: int, space: int) -> int:
    """Return the number of intervals of each curve for a size limit, in [bytes]."""
    # Per interval two times, and per curve two values, of 8 bytes each.
    most = space // (16 * columns + 16)
    return 1 << (most.bit_length() - 1)


class DecimatedCurves:
    """Curves that grow row by row, over a power of two of intervals, or twice as many rows."""

    def __init__(self, columns: int, most: int) -> None:
        self._most = most
        self._rows = 1
        self._count = 0
        self._begins = np.empty(2 * most, np.int64)
        self._ends = np.empty(2 * most, np.int64)
        self._first = np.empty((2 * most, columns))
        self._second = np.empty((2 * most, columns))
        # The open interval: its rows so far, and their minimum and maximum.
        self._open = 0
        self._ends_of_open = [0, 0]
        self._pair = np.empty((2, columns))

    def add(self, times: Times, values: Numbers) -> None:
        """Add rows: times in [ns], (n,), and values, (n, columns); NaN for a missing value."""
        at = 0
        while at < len(times):
            if self._open:
                end = at + self._rows - self._open
                self._extend_interval(times[at:end], values[at:end])
                at = end
                continue
            space = (2 * self._most if self._rows == 1 else self._most) - self._count
            if not space:
                self._merge_pairs()
                continue
            whole = min(space, (len(times) - at) // self._rows)
            end = at + whole * self._rows
            if whole:
                self._add_intervals(times[at:end], values[at:end], whole)
            else:
                end = len(times)
                self._extend_interval(times[at:end], values[at:end])
            at = end

    def build_intervals(self) -> Intervals:
        """Return the curves; nothing may be added after it."""
        if self._open:
            self._close_interval()
        n = self._count
        return Intervals(
            self._rows, self._begins[:n], self._ends[:n], self._first[:n], self._second[:n]
        )

    def _extend_interval(self, times: Times, values: Numbers) -> None:
        """Add rows to the open interval, or begin one; close it when it is full."""
        if self._open:
            values = np.concatenate([self._pair, values])
        else:
            self._ends_of_open[0] = int(times[0])
        first, second = _least_and_greatest(values[None])
        self._pair = np.concatenate([first, second])
        self._ends_of_open[1] = int(times[-1])
        self._open += len(times)
        if self._open == self._rows:
            self._close_interval()

    def _close_interval(self) -> None:
        n = self._count
        self._begins[n], self._ends[n] = self._ends_of_open
        self._first[n], self._second[n] = self._pair
        self._count += 1
        self._open = 0

    def _add_intervals(self, times: Times, values: Numbers, count: int) -> None:
        start, end = self._count, self._count + count
        times = times.reshape(count, -1)
        self._begins[start:end], self._ends[start:end] = times[:, 0], times[:, -1]
        if times.shape[1] == 1:
            self._first[start:end] = self._second[start:end] = values
        else:
            extremes = _least_and_greatest(values.reshape(count, -1, values.shape[1]))
            self._first[start:end], self._second[start:end] = extremes
        self._count = end

    def _merge_pairs(self) -> None:
        """Merge intervals in pairs."""
        n = self._count
        half = n // 2
        self._begins[:half] = self._begins[0:n:2]
        self._ends[:half] = self._ends[1:n:2]
        both = np.stack([self._first[:n], self._second[:n]], axis=1)
        extremes = _least_and_greatest(both.reshape(half, 4, -1))
        self._first[:half], self._second[:half] = extremes
        self._count = half
        self._rows *= 2


def _least_and_greatest(values: Numbers) -> tuple[Numbers, Numbers]:
    """Return minimum and maximum of the rows of (groups, rows, columns), as they came."""
    none = np.isnan(values)
    low = np.where(none, np.inf, values).argmin(axis=1)[:, None]
    high = np.where(none, -np.inf, values).argmax(axis=1)[:, None]
    # With only NaN and infinities, an index found may point at a NaN next to a number.
    least = np.fmin.reduce(values, axis=1)
    greatest = np.fmax.reduce(values, axis=1)
    rising = (low <= high)[:, 0]
    first, second = greatest.copy(), least.copy()
    first[rising], second[rising] = least[rising], greatest[rising]
    return first, second


class Decimation:
    """Decimated rows at equal steps: one of ``step`` is kept, an even number at most."""

    def __init__(self, columns: int, most: int) -> None:
        self.step = 1
        self._most = most
        self._seen = self._count = 0
        self._times = np.empty(most, np.int64)
        self._values = np.empty((most, columns))

    def add(self, times: Times, values: Numbers) -> None:
        """Add rows: times in [ns], of shape (n,), and values, of shape (n, columns)."""
        at = 0
        while True:
            at += -(self._seen + at) % self.step
            space = self._most - self._count
            rows = slice(at, at + space * self.step, self.step)
            taken = len(times[rows])
            start, end = self._count, self._count + taken
            self._times[start:end], self._values[start:end] = times[rows], values[rows]
            self._count = end
            at += taken * self.step
            if at >= len(times):
                break
            if self._count == self._most:
                self._halve_rows()
        self._seen += len(times)

    @property
    def times(self) -> Times:
        """Return the times of the kept rows, in [ns]."""
        return self._times[: self._count]

    @property
    def values(self) -> Numbers:
        """Return the kept rows."""
        return self._values[: self._count]

    def _halve_rows(self) -> None:
        n = self._count
        half = n // 2
        self._times[:half] = self._times[0:n:2]
        self._values[:half] = self._values[0:n:2]
        self._count = half
        self.step *= 2


class Histogram:
    """Histogram of durations."""

    def __init__(self) -> None:
        self.counts = np.zeros(len(EDGES) + 1, np.int64)
        self.least = self.greatest = 0

    @property
    def count(self) -> int:
        """Return the number of durations."""
        return int(self.counts.sum())

    def add(self, durations: Times) -> None:
        """Add durations, in [ns]."""
        if not len(durations):
            return
        least, greatest = int(durations.min()), int(durations.max())
        first = not self.count
        self.least = least if first else min(self.least, least)
        self.greatest = greatest if first else max(self.greatest, greatest)
        places = np.searchsorted(EDGES, durations, side='right')
        self.counts += np.bincount(places, minlength=len(self.counts))

    def percentile(self, percent: float) -> float:
        """Return a percentile, rounded up to the upper edge of its bin, in [ns]."""
        if not self.count:
            return 0.0
        place = int(np.searchsorted(np.cumsum(self.counts), self.count * percent / 100.0))
        edge = EDGES[place] if place < len(EDGES) else self.greatest
        return float(min(edge, self.greatest))
