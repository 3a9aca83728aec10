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
How late ticks were, from their times alone.

With the period T, the tick with number i of those that follow each other, at the time tᵢ, is off
an even row by eᵢ = tᵢ − i·T. A tick is due on the row of the most punctual ticks shortly before it
and shortly after it, b and a; where these are rows apart, on the later one::

    lateness = eᵢ − min(b, a)   where |a − b| < T/2, else eᵢ − max(b, a)

So ticks that are made up for one after the other are late until they have caught up, and those
that were given up shift the row: what is before them keeps the old one, what is behind has the new
one. At the beginning and the end of a run there is but one side. What all ticks nearby have in
common cannot be seen. The least within a window is found in two sweeps (M. van Herk, *A fast
algorithm for local minimum and maximum filters*, 1992).
"""

from __future__ import annotations

from linkage_ros.report.arrays import Times
import numpy as np

_WINDOW = 0.25
"""In [s]: farther away the clocks have drifted, and nearer ticks may still be catching up."""

_LEAST, _MOST = 32, 4096

_NONE = 2**62
"""In [ns]: where there is nothing to be the least."""


class Lateness:
    """
    The lateness of ticks, as they come.

    Parameters
    ----------
    rate
        Ticks a second, in [Hz], more than 0.

    """

    def __init__(self, rate: float) -> None:
        self._period = 1e9 / rate
        self._window = min(max(round(_WINDOW * rate), _LEAST), _MOST)
        self._begin: int | None = None
        self._number = 0
        self._ended = False
        # The last window of those that are done, and all that are not.
        self._times = np.empty(0, np.int64)
        self._off = np.empty(0, np.int64)
        self._done = 0

    def add(self, times: Times) -> tuple[Times, Times]:
        """Take times of ticks, in [ns]; return those whose lateness is known by now, and it."""
        if not len(times):
            return self._found(0)
        if self._begin is None:
            self._begin = int(times[0])
        numbers = np.arange(self._number, self._number + len(times))
        self._number += len(times)
        # In whole numbers: of long runs, or behind a long pause, a double loses the nanoseconds.
        whole, part = divmod(self._period, 1.0)
        due = numbers * int(whole) + np.rint(numbers * part).astype(np.int64)
        self._times = np.concatenate([self._times, times])
        self._off = np.concatenate([self._off, times - self._begin - due])
        return self._found(max(0, len(self._off) - self._window - self._done))

    def end(self) -> tuple[Times, Times]:
        """Return what is left; nothing is to be added after it."""
        self._ended = True
        return self._found(len(self._off) - self._done)

    def _found(self, count: int) -> tuple[Times, Times]:
        first, end = self._done, self._done + count
        if not count:
            return np.empty(0, np.int64), np.empty(0, np.int64)
        due = self._due()
        late = self._off[first:end] - due[first:end]
        times = self._times[first:end]
        kept = max(0, end - self._window)
        self._times, self._off, self._done = self._times[kept:], self._off[kept:], end - kept
        return times, late

    def _due(self) -> Times:
        """Return the even row that each tick belongs to."""
        before, after = _least_around(self._off, self._window)
        few, n = self._window // 4, len(self._off)
        if self._number == n:
            before[:few] = -_NONE
        if self._ended:
            last = max(0, n - few)
            after[last:] = -_NONE
        due = np.maximum(before, after)
        near = np.abs(before - after) < 0.5 * self._period
        due[near] = np.minimum(before, after)[near]
        return np.where(due == -_NONE, self._off.min(), due)


def _least_around(values: Times, window: int) -> tuple[Times, Times]:
    """Return the least of each value and so many before it, and of it and so many after it."""
    size = window + 1
    n = len(values)
    padded = np.full(-(-n // size) * size + size, _NONE)
    padded[:n] = values
    blocks = padded.reshape(-1, size)
    onward = np.minimum.accumulate(blocks, axis=1).ravel()
    back = np.minimum.accumulate(blocks[:, ::-1], axis=1)[:, ::-1].ravel()
    end = window + n
    after = np.minimum(back[:n], onward[window:end])
    before = onward[:n].copy()
    before[window:] = np.minimum(before[window:], back[: max(0, n - window)])
    return before, after
