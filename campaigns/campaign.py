# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Shared by all campaigns: work in parts and processes, progress lines, tables, pages."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
import multiprocessing
from operator import itemgetter
from pathlib import Path
import time
import traceback
from typing import NamedTuple, TypeVar

from bench.report import say, show, Table, write_page
from campaigns.tally import Judgement, Tally
from linkage_ros.tools.study import percentile

Work = TypeVar('Work')
Result = TypeVar('Result')

_PERIOD = 10.0
"""Time between two progress lines, in [s]."""


class Page(NamedTuple):
    """The Markdown page of a campaign: its file, its title and its introduction."""

    file: Path
    title: str
    introduction: str


class Findings(NamedTuple):
    """The outcome of a campaign: tables, a line for each violation, rows about the run."""

    tables: list[Table]
    faults: list[str]
    facts: Sequence[tuple[str, str]] = ()


def publish(tables: Sequence[Table], page: Page | None) -> None:
    """Print tables, and write them to a page if there is one."""
    for table in tables:
        show(table)
    if page is not None:
        write_page(page.file, page.title, page.introduction, tables)


def results_of(do: Callable[[Work], Result], work: Sequence[Work], jobs: int) -> Iterator[Result]:
    """Yield the results of all parts of the work as they are done; one job needs no process."""
    if jobs == 1:
        yield from map(do, work)
        return
    # Spawned, not forked: the calling process may have threads.
    with multiprocessing.get_context('spawn').Pool(jobs) as pool:
        yield from pool.imap_unordered(do, work)


class Part(NamedTuple):
    """Some linkages of a family, and the test to run on them."""

    seed: int
    family: str
    first: int
    size: int
    test: str = ''

    @property
    def numbers(self) -> range:
        """Return the numbers of its linkages."""
        return range(self.first, self.first + self.size)


def parts_of(seed: int, counts: Mapping[str, int], size: int, test: str = '') -> list[Part]:
    """Return parts of at most ``size`` linkages, for the wanted number of each family."""
    return [
        Part(seed, family, first, min(size, count - first), test)
        for family, count in counts.items()
        for first in range(0, count, size)
    ]


Judge = Callable[[Part], Iterable[tuple[int, Judgement]]]
"""Yields the numbers of linkages of a part, each with its results."""

Tallies = dict[str, dict[str, Tally]]
"""A tally of each test and family, in the order of the work."""


def tallies_of(judge: Judge, work: Sequence[Part], jobs: int, unit: str = '') -> Tallies:
    """Judge all parts and merge the results; with a ``unit`` of their sizes, print progress."""
    tallies: Tallies = {}
    for part in work:
        tallies.setdefault(part.test, {}).setdefault(part.family, Tally())
    advance = progress_lines(sum(part.size for part in work), unit) if unit else None
    for part, tally in results_of(partial(_tally_of, judge), work, jobs):
        tallies[part.test][part.family].merge(tally)
        if advance:
            advance(part.size)
    return tallies


def _tally_of(judge: Judge, part: Part) -> tuple[Part, Tally]:
    tally = Tally()
    try:
        for number, judged in judge(part):
            tally.add(number, judged)
    except Exception as error:
        raise RuntimeError(f'{part}: {traceback.format_exc()}') from error
    return part, tally


def show_results(judged: Judgement) -> None:
    """Print the results of a linkage."""
    print(dict(judged.counts))
    for case, name, text in judged.notes:
        print(f'case {case}: {name} {text}')
    for quantity, errors in judged.errors.items():
        case, joint, error = max(errors, key=itemgetter(2))
        print(f'worst {quantity}: {error:.3g} u·κ in case {case}, joint {joint}')


def progress_lines(total: float, unit: str) -> Callable[[float], None]:
    """Return a function that adds to the work done, and prints a line every ten seconds."""
    begun = printed = time.monotonic()
    done = 0.0

    def advance(more: float) -> None:
        nonlocal done, printed
        done += more
        if time.monotonic() - printed > _PERIOD or done == total:
            printed = time.monotonic()
            say(f'{done:,.0f} of {total:,.0f} {unit}, {printed - begun:.0f} s')

    return advance


def percentile_texts(values: Sequence[float], digits: int) -> list[str]:
    """Return median, 99th percentile and maximum as text; '' each for no values."""
    if not values:
        return ['', '', '']
    return [f'{percentile(values, percent):.{digits}f}' for percent in (50.0, 99.0, 100.0)]
