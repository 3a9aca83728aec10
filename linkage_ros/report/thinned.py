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


"""Rows of a run at equal steps: every one, or every second, fourth, …, as there is room."""

from __future__ import annotations

from linkage_ros.report.arrays import Numbers, Times
import numpy as np


class Thinned:
    """
    Rows at equal steps.

    Parameters
    ----------
    columns
        How many.
    most
        How many rows there may be, an even number.

    Attributes
    ----------
    step
        Of how many rows one is kept.

    """

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
            room = self._most - self._count
            rows = slice(at, at + room * self.step, self.step)
            taken = len(times[rows])
            start, end = self._count, self._count + taken
            self._times[start:end], self._values[start:end] = times[rows], values[rows]
            self._count = end
            at += taken * self.step
            if at >= len(times):
                break
            if self._count == self._most:
                self._halve()
        self._seen += len(times)

    @property
    def times(self) -> Times:
        """Return the times of the rows that are kept, in [ns]."""
        return self._times[: self._count]

    @property
    def values(self) -> Numbers:
        """Return the rows that are kept."""
        return self._values[: self._count]

    def _halve(self) -> None:
        n = self._count
        half = n // 2
        self._times[:half] = self._times[0:n:2]
        self._values[:half] = self._values[0:n:2]
        self._count = half
        self.step *= 2
