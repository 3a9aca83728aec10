# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Memory, open files and threads of a process, and their growth."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import combinations
from pathlib import Path
import re
from statistics import median
from typing import NamedTuple

from bench.report import Table

WARM_UP = 0.25
"""The share of a run that is not judged: buffers, caches and pools fill."""

MOST_GROWTH = 1024
"""Maximum growth of the memory after the warm-up [kB]."""


class Usage(NamedTuple):
    """Resident memory (``VmRSS``, [kB]), open files and threads of a process, and the time [s]."""

    time: float
    resident: int
    files: int
    threads: int


def usage(time: float, pid: int | str = 'self') -> Usage:
    """Return the present usage of a process, at a time since the beginning [s]."""
    status = Path(f'/proc/{pid}/status').read_text()
    numbers = dict(re.findall(r'^(\w+):\s+(\d+)', status, re.MULTILINE))
    files = sum(1 for _ in Path(f'/proc/{pid}/fd').iterdir())
    return Usage(time, int(numbers['VmRSS']), files, int(numbers['Threads']))


class Flatness(NamedTuple):
    """The growth of the usage after the warm-up."""

    # Slope of the memory [kB/s]: the median of the slopes between any two samples (Theil 1950, Sen
    # 1968), which is robust against single peaks.
    slope: float
    growth: float  # The slope times the duration [kB]
    peak: float  # The greatest memory minus the median of the quarter after the warm-up [kB]
    # The increase from that quarter to the last one, of the lower quartiles. One file more is open
    # while metadata is written, and one fewer when a bag continues in another file.
    files: int
    threads: int

    @property
    def flat(self) -> bool:
        """Return whether memory, files and threads do not grow."""
        return self.growth <= MOST_GROWTH and self.files <= 0 and self.threads <= 0


def flatness(samples: Sequence[Usage]) -> Flatness:
    """Judge samples in the order of time, of which at least eight are after the warm-up."""
    end = samples[-1].time
    judged = [each for each in samples if each.time >= WARM_UP * end]
    first = [each for each in judged if each.time <= 2.0 * WARM_UP * end]
    last = [each for each in judged if each.time >= (1.0 - WARM_UP) * end]
    slope = median(
        (b.resident - a.resident) / (b.time - a.time) for a, b in combinations(judged, 2)
    )
    return Flatness(
        slope=slope,
        growth=slope * (end - judged[0].time),
        peak=max(each.resident for each in judged) - median(each.resident for each in first),
        files=_more([each.files for each in first], [each.files for each in last]),
        threads=_more([each.threads for each in first], [each.threads for each in last]),
    )


def _more(first: Sequence[int], last: Sequence[int]) -> int:
    """Return by how much the lower quartile of the counts is higher at the end."""
    return sorted(last)[len(last) // 4] - sorted(first)[len(first) // 4]


def verdict_table(
    title: str, runs: Mapping[str, Sequence[Usage]], exempt: Collection[str] = ()
) -> Table:
    """Return the growth of some runs by name; those that are exempt may grow."""
    table = Table(
        f'{title}, verdicts',
        ('', 'slope, kB/h', 'growth, kB', 'peak, kB', 'more files', 'more threads', 'verdict'),
    )
    for name, samples in runs.items():
        growth = flatness(samples)
        verdict = 'flat' if growth.flat else 'grows'
        table.rows.append(
            [
                name,
                f'{3600.0 * growth.slope:.1f}',
                f'{growth.growth:,.0f}',
                f'{growth.peak:,.0f}',
                str(growth.files),
                str(growth.threads),
                'one file: not judged' if name in exempt else verdict,
            ]
        )
    return table


def nearest(samples: Sequence[Usage], time: float) -> Usage:
    """Return the sample next to a time."""
    return min(samples, key=lambda sample: abs(sample.time - time))
