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


"""Memory, open files and threads of a process, whether they stay flat, and counts of a bag."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import combinations
import json
from pathlib import Path
import re
from statistics import median
from typing import NamedTuple

from linkage_ros.bag.reader import read_bag
from linkage_ros.bag.recording_stats import STATS_RECORD
from linkage_ros.errors import BagError
from mcap.reader import make_reader

Account = dict[str, dict[str, int]]


def account_of(folder: Path) -> Account:
    """Return what the bag's last file says of each topic: received, recorded, dropped, let go."""
    with read_bag(folder).files[-1].open('rb') as stream:
        said = {record.name: record.metadata for record in make_reader(stream).iter_metadata()}
    return {word: json.loads(text) for word, text in said.get(STATS_RECORD, {}).items()}


def shortcomings(folder: Path) -> list[str]:
    """Return the inconsistencies and missing parts of a bag."""
    try:
        bag = read_bag(folder)
        counts = Counter(message.topic for message in bag.messages())
        account = account_of(folder)
    except BagError as error:
        return [str(error)]
    if not account:
        return ['the bag has no account']
    found = []
    for topic, received in account['received'].items():
        kept = account['recorded'][topic]
        if kept != counts[topic]:
            found.append(f'{topic}: {kept} recorded by the account, {counts[topic]} in the bag')
        if received != kept + account['dropped'][topic] + account['let_go'][topic]:
            found.append(f'{topic}: the account does not close')
        if account['dropped'][topic]:
            found.append(f'{topic}: {account["dropped"][topic]} dropped')
    return found


WARM_UP = 0.25
"""The part of a run that is not judged: buffers, caches and pools fill."""

MOST_GROWTH = 1024
"""How much more a run may hold in the end than after its warm-up [kB]."""


class Usage(NamedTuple):
    """
    Memory, open files and threads of a process at one time.

    Attributes
    ----------
    time
        Since the beginning [s].
    resident
        Memory that is in use: ``VmRSS`` [kB].
    files, threads
        How many are open, and run.

    """

    time: float
    resident: int
    files: int
    threads: int


def usage(time: float, pid: int | str = 'self') -> Usage:
    """Return what a process holds now, which is this time since the beginning [s]."""
    status = Path(f'/proc/{pid}/status').read_text()
    numbers = dict(re.findall(r'^(\w+):\s+(\d+)', status, re.MULTILINE))
    files = sum(1 for _ in Path(f'/proc/{pid}/fd').iterdir())
    return Usage(time, int(numbers['VmRSS']), files, int(numbers['Threads']))


class Flatness(NamedTuple):
    """
    How what was held after the warm-up grew.

    Attributes
    ----------
    slope
        Of the memory: the median of the slopes between any two samples (Theil 1950, Sen 1968),
        which no single peak moves [kB/s].
    growth
        That slope times the time [kB].
    peak
        The most, less what was held by the middle of the time just after the warm-up [kB].
    files, threads
        How many more there were at the end than then; of each, the lower quartile, since one
        file more is open for moments whenever metadata is written (for long ones where the disk
        is slow), and one fewer whenever a bag goes on in another file.

    """

    slope: float
    growth: float
    peak: float
    files: int
    threads: int

    @property
    def flat(self) -> bool:
        """Say whether it holds no more than it did."""
        return self.growth <= MOST_GROWTH and self.files <= 0 and self.threads <= 0


def flatness(samples: Sequence[Usage]) -> Flatness:
    """Judge samples, in the order of time, of which at least eight are after the warm-up."""
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
