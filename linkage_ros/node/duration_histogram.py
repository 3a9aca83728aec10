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


"""A histogram of durations of constant size, fit for a hot loop and for days."""

from __future__ import annotations

_STEPS = 5
"""Bits that are kept of a duration: a bin is at most 1/32 wide of its value."""


class DurationHistogram:
    """Counts durations, in [ns], in bins that grow with the duration."""

    __slots__ = ('_bins', 'count', 'longest')

    def __init__(self) -> None:
        self._bins = [0] * (64 << _STEPS)
        self.count = 0
        self.longest = 0

    def add(self, duration: int) -> None:
        """Count a duration, in [ns]; a negative one counts as 0."""
        if duration > self.longest:
            self.longest = duration
        elif duration < 0:
            duration = 0
        shift = duration.bit_length() - _STEPS - 1
        self._bins[duration if shift <= 0 else (shift << _STEPS) + (duration >> shift)] += 1
        self.count += 1

    def percentile(self, percent: float) -> int:
        """Return the duration, in [ns], that so many per cent do not exceed; 0 of nothing."""
        wanted = self.count * percent / 100.0
        seen = 0
        for index, count in enumerate(self._bins):
            seen += count
            if count and seen >= wanted:
                return min(_upper_edge(index), self.longest)
        return 0


def _upper_edge(index: int) -> int:
    shift = (index >> _STEPS) - 1
    if shift <= 0:
        return index
    return ((index - (shift << _STEPS) + 1) << shift) - 1
