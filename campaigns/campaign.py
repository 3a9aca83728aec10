# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Shared by all campaigns: work in parts and processes, progress lines, tables, pages."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
import multiprocessing
from pathlib import Path
import time
from typing import Any, NamedTuple, Protocol, TypeVar

from bench.report import say, show, Table, write_page
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


class Mergeable(Protocol):
    """A tally of findings that takes in the findings of another part."""

    def merge(self, other: Any, /) -> None: ...


TallyOf = TypeVar('TallyOf', bound=Mergeable)


def tallies_of(
    do: Callable[[Part], tuple[Part, TallyOf]],
    work: Sequence[Part],
    jobs: int,
    new: Callable[[], TallyOf],
    progress: Callable[[int], None] = lambda _: None,
) -> dict[tuple[str, str], TallyOf]:
    """
    Run all parts and merge their findings.

    That is a tally of each test and family, in the order of the work. ``do`` runs one part,
    ``new`` makes an empty tally, and ``progress`` is called with the number of linkages of each
    part that is done.
    """
    tallies = {(part.test, part.family): new() for part in work}
    for part, tally in results_of(do, work, jobs):
        tallies[part.test, part.family].merge(tally)
        progress(part.size)
    return tallies


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
