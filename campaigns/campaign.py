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


"""Shared by all campaigns: parts for several processes, progress lines, percentiles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
import multiprocessing
import time
from typing import TypeVar

from bench.report import say
from linkage_ros.measuring import percentile

Part = TypeVar('Part')
Result = TypeVar('Result')

_PERIOD = 10.0
"""Between two lines of progress, in [s]."""


def results_of(do: Callable[[Part], Result], work: Sequence[Part], jobs: int) -> Iterator[Result]:
    """Yield the results of all parts as they are done; one job runs in this process."""
    if jobs == 1:
        yield from map(do, work)
        return
    # Spawned, not forked: whoever calls may have threads.
    with multiprocessing.get_context('spawn').Pool(jobs) as pool:
        yield from pool.imap_unordered(do, work)


def tried_in_parts(
    do: Callable[[tuple[int, int, int]], tuple[Counter[str], list[str]]],
    count: int,
    seed: int,
    part: int,
    jobs: int,
) -> tuple[dict[str, int], list[str]]:
    """
    Try so many things, each known by a seed and its number.

    Parameters
    ----------
    do
        Tries the inputs of a seed in a range of numbers; returns the inputs and the findings.
    count, seed
        The number of inputs, and their seed.
    part
        Number of inputs after which a process reports.
    jobs
        Number of processes that share them.

    Returns
    -------
    tried : dict
        Number of tries, by kind.
    findings : list
        The violations, one line each.

    """
    parts = [(seed, begin, min(begin + part, count)) for begin in range(0, count, part)]
    tried: Counter[str] = Counter()
    findings: list[str] = []
    for some, found in results_of(do, parts, jobs):
        tried += some
        findings += found
    return dict(sorted(tried.items())), findings


def progress_lines(total: float, what: str) -> Callable[[float], None]:
    """Return a function that takes how many more are done; it prints a line every ten seconds."""
    begun = printed = time.monotonic()
    done = 0.0

    def advance(more: float) -> None:
        nonlocal done, printed
        done += more
        if time.monotonic() - printed > _PERIOD or done == total:
            printed = time.monotonic()
            say(f'{done:,.0f} of {total:,.0f} {what}, {printed - begun:.0f} s')

    return advance


def percentile_texts(values: Sequence[float], digits: int) -> list[str]:
    """Return median, 99th percentile and greatest as texts; '' each where there are no values."""
    if not values:
        return ['', '', '']
    return [f'{percentile(values, percent):.{digits}f}' for percent in (50.0, 99.0, 100.0)]
