# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Memory, open files and threads of a process, their growth, and the counts of a bag."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import combinations
import json
from pathlib import Path
import re
from statistics import median
from typing import NamedTuple

from linkage_ros.bag import read_bag, STATS_RECORD
from linkage_ros.errors import BagError
from mcap.reader import make_reader

Counts = dict[str, dict[str, int]]


def counts_of(folder: Path) -> Counts:
    """Return received, recorded, dropped and discarded by topic, from the bag's last file."""
    with read_bag(folder).files[-1].open('rb') as stream:
        metadata = {each.name: each.metadata for each in make_reader(stream).iter_metadata()}
    return {kind: json.loads(text) for kind, text in metadata.get(STATS_RECORD, {}).items()}


def shortcomings(folder: Path) -> list[str]:
    """Return the inconsistencies and missing parts of a bag."""
    try:
        bag = read_bag(folder)
        messages = Counter(message.topic for message in bag.messages())
        counts = counts_of(folder)
    except BagError as error:
        return [str(error)]
    if not counts:
        return ['the bag has no counts']
    faults = []
    for topic, received in counts['received'].items():
        recorded = counts['recorded'][topic]
        if recorded != messages[topic]:
            faults.append(f'{topic}: {recorded} counted, {messages[topic]} in the bag')
        if received != recorded + counts['dropped'][topic] + counts['discarded'][topic]:
            faults.append(f'{topic}: the counts do not add up')
        if counts['dropped'][topic]:
            faults.append(f'{topic}: {counts["dropped"][topic]} dropped')
    return faults


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
