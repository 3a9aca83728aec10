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

"""Tables and progress on a terminal: drawn by rich if it is installed, else plain text."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
import sys
from time import monotonic
from typing import Any, NamedTuple, TextIO

from linkage_ros.errors import clean, shortened

_LONGEST_CELL = 4000


class Table(NamedTuple):
    """
    A table.

    Attributes
    ----------
    title
        '' for no title.
    columns
        Headings; a leading ``>`` aligns to the right. If all are empty, none is written.
    rows
        The cells, as text.

    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


def show(table: Table) -> None:
    """
    Print a table.

    Output into a file or a pipe, or wider than the terminal, has no frames: it can be searched,
    and no name is broken in two.
    """
    rows = [[shortened(clean(cell), _LONGEST_CELL) for cell in row] for row in table.rows]
    table = Table(clean(table.title), table.columns, rows)
    if sys.stdout.isatty() and find_spec('rich') is not None:
        from rich.console import Console

        console = Console(file=sys.__stdout__)
        if _width(table) <= console.width:
            console.print(_drawn(table))
            return
    print(text(table))


def text(table: Table) -> str:
    """Return a table as plain text."""
    headed = any(column.lstrip('>') for column in table.columns)
    lines = [[column.lstrip('>') for column in table.columns]] if headed else []
    lines += [list(row) for row in table.rows]
    widths = [max(map(len, cells)) for cells in zip(*lines, strict=True)]
    right = [column.startswith('>') for column in table.columns]
    written = [
        '  '.join(
            cell.rjust(width) if align else cell.ljust(width)
            for cell, width, align in zip(line, widths, right, strict=True)
        ).rstrip()
        for line in lines
    ]
    if table.title:
        written.insert(0, table.title)
    return '\n'.join(written)


def _width(table: Table) -> int:
    lines = [table.columns, *table.rows]
    return sum(max(map(len, cells)) + 3 for cells in zip(*lines, strict=True)) + 1


def _drawn(table: Table) -> object:
    from rich import box
    from rich.table import Table as Drawn
    from rich.text import Text

    headed = any(column.lstrip('>') for column in table.columns)
    # As Text: rich would read brackets, such as those of a unit, as markup.
    drawn = Drawn(
        title=Text(table.title, style='bold') if table.title else None,
        title_justify='left',
        show_header=headed,
        box=box.ROUNDED if headed else None,
    )
    for column in table.columns:
        right = column.startswith('>')
        drawn.add_column(
            Text(column.lstrip('>')), justify='right' if right else 'left', no_wrap=True
        )
    for row in table.rows:
        drawn.add_row(*(Text(cell) for cell in row))
    return drawn


# Progress of a long task: a bar drawn by rich on a terminal, else a line now and then.

ProgressCallback = Callable[[int, int], None]
"""Takes the amount done and the total."""

_EVERY = 5.0
"""Seconds between two lines."""


@contextmanager
def progress(what: str) -> Iterator[ProgressCallback]:
    """Give a function that shows progress on standard error."""
    if sys.stderr.isatty() and find_spec('rich') is not None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            TextColumn,
            TimeRemainingColumn,
        )

        columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with Progress(*columns, console=Console(file=sys.__stderr__), transient=True) as bars:
            task = bars.add_task(what, total=None)
            yield lambda done, of: bars.update(task, completed=done, total=of)
        return
    told = monotonic()

    def line(done: int, of: int) -> None:
        nonlocal told
        if monotonic() - told >= _EVERY:
            told = monotonic()
            print(f'{what}: {done} of {of}', file=sys.stderr, flush=True)

    yield line


# Output is escaped: a topic's name in a file may contain control characters of the terminal.


class Outlet:
    """
    A text stream whose lines are made printable; everything else is passed to the stream.

    Parameters
    ----------
    stream
        The stream, for example standard output.

    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text, of one line or several."""
        if not text.isprintable():
            text = '\n'.join(map(clean, text.split('\n')))
        return self._stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def clean_output() -> None:
    """Replace standard output and standard error by escaped ones; rich keeps the originals."""
    sys.stdout, sys.stderr = Outlet(sys.stdout), Outlet(sys.stderr)
