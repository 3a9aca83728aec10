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


"""Tables for a terminal: drawn by rich where it is there, aligned with spaces elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
import sys
from typing import NamedTuple

from linkage_ros.errors import clean, shortened

_LONGEST_CELL = 4000


class Table(NamedTuple):
    """
    A table.

    Attributes
    ----------
    title
        '' for none.
    columns
        Headings; a leading ``>`` aligns to the right. All empty: none are written.
    rows
        The cells, as text.

    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


def show(table: Table) -> None:
    """
    Print a table.

    What goes into a file or through a pipe, or is wider than the terminal, comes without frames:
    it can be searched, and no name is broken in two.
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
    """Return a table as lines of text."""
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
    # As texts: what stands in brackets, such as a unit, is no markup.
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
