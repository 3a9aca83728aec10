# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Tables and progress on a terminal: drawn by rich if it is installed, else plain text."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from io import TextIOWrapper
from itertools import zip_longest
import os
from shutil import get_terminal_size
import sys
from textwrap import fill
from time import monotonic
from typing import Any, TextIO

from linkage_ros.cli.table import Table
from linkage_ros.errors import escape_unprintable, shorten
from linkage_ros.progress import progress_told_to

_LONGEST_CELL = 4000

_NARROWEST = 16
"""Width below which no column is wrapped: a narrower one is hard to read."""

_BORDER = 3
"""Characters that the frame of a table adds to each column."""

ProgressCallback = Callable[[int, int], None]
"""Takes the amount done and the total."""

FIRST_LINE, _EVERY = 2.0, 30.0
"""Seconds until the first line, and between two."""


def print_tables(*tables: Table) -> None:
    """
    Print tables of texts, with an empty line between two.

    On a terminal they are folded to its width. Output into a file or a pipe has no frames, and a
    row is one line however long it is: ``grep`` and ``awk`` find whole rows.
    """
    width = get_terminal_size().columns if sys.stdout.isatty() else 0
    shown = [
        part
        for table in map(_clean_table, tables)
        for part in (fold_table(table, width) if width else [table])
    ]
    for index, table in enumerate(shown):
        if index:
            print()
        _print_table(table, width)


def _clean_table(table: Table) -> Table:
    rows = [
        [shorten(escape_unprintable(cell), _LONGEST_CELL) for cell in row] for row in table.rows
    ]
    return Table(escape_unprintable(table.title), list(map(escape_unprintable, table.heads)), rows)


def _print_table(table: Table, width: int) -> None:
    # A word that is wider than the terminal is not broken; a frame would break it.
    if find_spec('rich') is not None and _framed_width(_column_widths(table)) <= width:
        from rich.console import Console

        Console(file=sys.__stdout__, width=width).print(_rich_table(table))
    else:
        print(table_text(table))


def fold_table(table: Table, width: int) -> list[Table]:
    """
    Return a table as tables that are at most ``width`` characters wide with their frames.

    Long cells and headings are wrapped at spaces. If that is not enough, the columns are divided
    among several tables, each of which begins with the first column. No word is broken.
    """
    if _framed_width(_column_widths(table)) <= width:
        return [table]
    columns = list(zip(_column_heads(table), *table.rows, strict=True))
    narrow = [_column_width(cells, _NARROWEST) for cells in columns]
    blocks: list[list[int]] = [[0]]
    for index in range(1, len(columns)):
        block = blocks[-1]
        if len(block) > 1 and _framed_width([narrow[i] for i in [*block, index]]) > width:
            block = [0]
            blocks.append(block)
        block.append(index)
    tables: list[Table] = []
    for block in blocks:
        most = max(_column_width(columns[i]) for i in block)
        while (
            most > _NARROWEST
            and _framed_width([_column_width(columns[i], most) for i in block]) > width
        ):
            most -= 1
        wrapped = [[_wrap_cell(cell, most) for cell in columns[i]] for i in block]
        heads, *rows = zip(*wrapped, strict=True)
        marks = ('>' * table.heads[i].startswith('>') for i in block)
        tables.append(
            Table(
                '' if tables else _wrap_cell(table.title, width),
                [mark + head for mark, head in zip(marks, heads, strict=True)],
                rows,
            )
        )
    return tables


def _wrap_cell(cell: str, most: int) -> str:
    """Return a cell with line breaks at spaces, if it is wider than ``most``."""
    if len(cell) <= most:
        return cell
    return fill(cell, most, break_long_words=False, break_on_hyphens=False)


def _column_width(cells: Sequence[str], most: int = sys.maxsize) -> int:
    """Return the width of a column whose cells are wrapped to ``most``; a word may be wider."""
    width = max(len(line) for cell in cells for line in cell.split('\n'))
    if width <= most:
        return width
    return max(most, *(len(word) for cell in cells for word in cell.split()))


def _column_widths(table: Table) -> list[int]:
    return [_column_width(cells) for cells in zip(_column_heads(table), *table.rows, strict=True)]


def _framed_width(widths: Sequence[int]) -> int:
    """Return the width of a table with its frame."""
    return sum(widths) + _BORDER * len(widths) + 1


def _column_heads(table: Table) -> list[str]:
    return [column.removeprefix('>') for column in table.heads]


def table_text(table: Table) -> str:
    """Return a table as plain text."""
    heads = _column_heads(table)
    widths = _column_widths(table)
    right = [column.startswith('>') for column in table.heads]
    lines = [
        '  '.join(
            cell.rjust(width) if align else cell.ljust(width)
            for cell, width, align in zip(line, widths, right, strict=True)
        ).rstrip()
        for row in ([heads] if any(heads) else []) + list(table.rows)
        for line in zip_longest(*(cell.split('\n') for cell in row), fillvalue='')
    ]
    return '\n'.join([table.title, *lines] if table.title else lines)


def _rich_table(table: Table) -> object:
    from rich import box
    from rich.table import Table as Drawn
    from rich.text import Text

    heads = _column_heads(table)
    # As Text: rich would read brackets, as in units, as markup.
    drawn = Drawn(
        title=Text(table.title, style='bold') if table.title else None,
        title_justify='left',
        show_header=any(heads),
        box=box.ROUNDED if any(heads) else None,
    )
    for head, column in zip(heads, table.heads, strict=True):
        right = column.startswith('>')
        drawn.add_column(Text(head), justify='right' if right else 'left', no_wrap=True)
    for row in table.rows:
        drawn.add_row(*(Text(cell) for cell in row))
    return drawn


# Progress of a long task: a bar drawn by rich on a terminal, else a line now and then.


@contextmanager
def show_progress(what: str) -> Iterator[ProgressCallback]:
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
        with (
            Progress(*columns, console=Console(file=sys.__stderr__), transient=True) as bars,
            progress_told_to(None),
        ):
            task = bars.add_task(what, total=None)
            yield lambda done, of: bars.update(task, completed=done, total=of)
        return
    begin = monotonic()
    due, shown = begin + FIRST_LINE, False

    def print_line(done: int, of: int) -> None:
        nonlocal due, shown
        now = monotonic()
        if now >= due and of:
            due, shown = now + _EVERY, True
            print(f'{what}: {done} of {of}', file=sys.stderr, flush=True)

    yield print_line
    if shown:
        print(f'{what}: ended after {monotonic() - begin:.1f} s', file=sys.stderr, flush=True)


@contextmanager
def tell_who_waits() -> Iterator[None]:
    """Write a line now and then on standard error on what is computed, and how far that is."""
    due = monotonic() + FIRST_LINE

    def print_line(what: str, done: int, of: int) -> None:
        nonlocal due
        now = monotonic()
        if now >= due:
            due = now + _EVERY
            print(f'{what}: {done}{f" of {of}" if of else ""}', file=sys.stderr, flush=True)

    with progress_told_to(print_line):
        yield


# Output is escaped: a topic's name in a file may contain control characters of the terminal.


class PrintableStream:
    """A text stream whose lines are made printable; everything else is passed to the stream."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text, of one line or several."""
        if not text.isprintable():
            text = '\n'.join(map(escape_unprintable, text.split('\n')))
        return self._stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def clean_output() -> None:
    """
    Replace standard output and standard error by escaped ones; rich keeps the originals.

    What the encoding of a terminal cannot show is escaped. A stream that is closed shows nothing.
    """
    for index, name in enumerate(('stdin', 'stdout', 'stderr')):
        if getattr(sys, name) is None:
            # A file that is opened later must not get the number of a standard stream.
            os.open(os.devnull, os.O_RDWR)
            opened = open(index, 'w' if index else 'r', closefd=False)  # noqa: SIM115
            setattr(sys, name, opened)
            setattr(sys, f'__{name}__', opened)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors='backslashreplace')
    sys.stdout, sys.stderr = PrintableStream(sys.stdout), PrintableStream(sys.stderr)


def give_up_output() -> None:
    """Write nothing more to standard output: what waits there could not be written."""
    with suppress(OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.__stdout__.fileno())  # type: ignore[union-attr]
        os.close(null)
