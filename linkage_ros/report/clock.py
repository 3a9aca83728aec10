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
The time of a run as a reader sees it pass: it begins at 0 and never goes back.

Where the clock by which messages were recorded jumps back, no time passes, and it goes on from
there. What was recorded on several topics may stand a little out of order in a bag that others
have written; that is no jump.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from linkage_ros.report.arrays import Times
import numpy as np

_LATEST = 2**62
"""In [ns]: what is said to be later is so by damage."""


def times_of(logged: Sequence[int]) -> Times:
    """Return log times as an array; they may be anything that fits into 64 bits."""
    return np.minimum(np.array(logged, np.uint64), np.uint64(_LATEST)).astype(np.int64)


class RunClock:
    """
    Makes of log times the time of a run.

    Parameters
    ----------
    disorder
        By how much a message may stand too late, in [ns], and the clock not have jumped.

    Attributes
    ----------
    begin
        The log time at which the run begins, in [ns]; nothing before there is a message.
    end
        The time of the run at the last message, by whatever hand, in [ns].

    """

    def __init__(self, disorder: int = 0) -> None:
        self.begin: int | None = None
        self.end = 0
        self._disorder = disorder
        self._last = self._added = self._now = 0
        self._jumps: list[tuple[int, int]] = []
        # The log times that were looked at last and the times of the run, and what was before.
        self._logged = self._times = np.zeros(1, np.int64)

    def start(self, logged: int) -> None:
        """Begin the run, unless it has begun, at a log time in [ns]."""
        if self.begin is None:
            self.begin = self._last = logged

    def passed(self, logged: Times) -> Times:
        """Return the times of the run at messages in their order, by their log times, in [ns]."""
        before = self._last, self._now
        times = logged
        if len(logged):
            self.start(int(logged[0]))
            before = self._last, self._now
            back = -np.diff(logged, prepend=self._last)
            jumps = np.where(back > self._disorder, back, 0)
            added = self._added + np.cumsum(jumps)
            since = logged - (self.begin or 0) + added
            times = np.maximum.accumulate(np.maximum(since, self._now))
            self._jumps += [(int(times[i]), int(jumps[i])) for i in np.flatnonzero(jumps)]
            self._last, self._added, self._now = int(logged[-1]), int(added[-1]), int(times[-1])
            self.end = max(self.end, self._now)
        self._logged = np.concatenate([[before[0]], logged])
        self._times = np.concatenate([[before[1]], times])
        return times

    def beside(self, logged: Times, behind: Times) -> Times:
        """
        Return the times of the run at messages that another hand has recorded, in [ns].

        Parameters
        ----------
        logged
            Their log times, in [ns]; they may deviate a little from those of the others.
        behind
            How many of the messages that `passed` was given last stand before each.

        """
        since = np.maximum(logged - self._logged[behind], 0)
        next_ones = np.append(self._times[1:], _LATEST)
        times: Times = np.minimum(self._times[behind] + since, next_ones[behind])
        self.end = max(self.end, int(times.max(initial=0)))
        return times

    def jumps(self) -> Iterator[tuple[int, int]]:
        """Yield when the clock has jumped since this was asked last, and by how much, in [ns]."""
        found, self._jumps = self._jumps, []
        yield from found
