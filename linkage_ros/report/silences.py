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


"""When nothing was published of a linkage: longer than its messages are otherwise apart."""

from __future__ import annotations

from linkage_ros.report.arrays import Times
from linkage_ros.report.spans import Lane
import numpy as np

_TIMES = 5
"""How many times as far apart as is usual is silence."""

_LEAST = 2_000_000
"""In [ns]: no eye sees less."""

_MESSAGES_FOR_A_USUAL = 8


class Silences:
    """
    Looks for silences, block by block.

    Parameters
    ----------
    lane
        Where they are put.
    period
        In which messages are due, in [ns]; 0 where none is known.
    limit
        From which on there is silence, in [ns]; 0 for what is longer than usual.

    """

    def __init__(self, lane: Lane, period: int, limit: int = 0) -> None:
        self._lane, self._period, self.limit = lane, period, limit
        self._usual = 0
        self._last: int | None = None

    def add(self, times: Times) -> None:
        """Take messages, in the time of the run in [ns]."""
        if not len(times):
            return
        # The time of a run begins at 0, whether or not something is published then.
        apart = np.diff(times, prepend=self._last or 0)
        # What goes before the first message says nothing of how far they are apart.
        between = apart if self._last is not None else apart[1:]
        least = 1 if not (self._usual or self._period) else _MESSAGES_FOR_A_USUAL
        if len(between) >= least:
            self._usual = int(np.median(between))
        for i in np.flatnonzero(apart > self._longest):
            self._lane.add(int(times[i] - apart[i]), int(times[i]))
        self._last = int(times[-1])

    def end(self, time: int) -> None:
        """Take the end of the run."""
        last = 0 if self._last is None else self._last
        if self._last is None or time - last > self._longest:
            self._lane.add(last, time)

    @property
    def _longest(self) -> int:
        return self.limit or max(_TIMES * self._period, _TIMES * self._usual, _LEAST)
