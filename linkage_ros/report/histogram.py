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


"""Durations counted in bins that grow with them, a tenth of a power of ten each."""

from __future__ import annotations

from linkage_ros.report.arrays import Times
import numpy as np

_PER_DECADE = 10
_FIRST, _LAST = 2, 12
"""Powers of ten, in [ns], from which and up to which bins go."""

EDGES = [10 ** (_FIRST + i / _PER_DECADE) for i in range(_PER_DECADE * (_LAST - _FIRST) + 1)]
"""Of the bins, in [ns]; below the first and above the last there is one more bin each."""


class Histogram:
    """Durations, counted."""

    def __init__(self) -> None:
        self.counts = np.zeros(len(EDGES) + 1, np.int64)
        self.least = self.greatest = 0

    @property
    def count(self) -> int:
        """Return how many there are."""
        return int(self.counts.sum())

    def add(self, durations: Times) -> None:
        """Count durations, in [ns]."""
        if not len(durations):
            return
        least, greatest = int(durations.min()), int(durations.max())
        first = not self.count
        self.least = least if first else min(self.least, least)
        self.greatest = greatest if first else max(self.greatest, greatest)
        places = np.searchsorted(EDGES, durations, side='right')
        self.counts += np.bincount(places, minlength=len(self.counts))

    def percentile(self, percent: float) -> float:
        """Return what so many per cent do not exceed, to the upper edge of its bin, in [ns]."""
        if not self.count:
            return 0.0
        place = int(np.searchsorted(np.cumsum(self.counts), self.count * percent / 100.0))
        edge = EDGES[place] if place < len(EDGES) else self.greatest
        return float(min(edge, self.greatest))
