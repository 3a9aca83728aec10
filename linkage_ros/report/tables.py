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

"""The tables of a page: of its bag, and of the run; whatever is in the bag, they have a bound."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape
from typing import NamedTuple

from linkage_ros.page.parts import table_html
from linkage_ros.report.data import lanes
from linkage_ros.report.room import TABLES
from linkage_ros.report.run import Curves, Run
from linkage_ros.report.words import LANES, seconds_text, short
import numpy as np

_LONGEST = 200
"""Letters of a cell."""

_BESIDE_CELL, _BESIDE_ROW, _BESIDE_TABLE = 25, 10, 250
"""What a page writes about each, or more, in [bytes]."""


class TableOf(NamedTuple):
    """
    A table.

    Attributes
    ----------
    title
        What stands above it.
    columns
        Headings; a leading ``>`` is for numbers.
    rows
        The cells.
    folded
        Whether it is only shown to who asks for it.

    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    folded: bool = False


def tables_html(tables: Sequence[TableOf]) -> Iterator[str]:
    """Yield tables as HTML, as far as there is room for them; and how much there is not."""
    room = TABLES
    for number, table in enumerate(tables):
        if not table.rows:
            continue
        room -= _BESIDE_TABLE + _size([short(table.title), *table.columns])
        if room < 0:
            yield f'<p class="note">No room for {len(tables) - number} more tables.</p>'
            return
        rows = []
        for row in table.rows:
            cells = [short(cell, _LONGEST) for cell in row]
            room -= _size(cells)
            if room < 0:
                break
            rows.append(cells)
        yield from _table(table._replace(title=short(table.title), rows=rows))
        if len(rows) < len(table.rows):
            yield f'<p class="note">No room for {len(table.rows) - len(rows)} more rows.</p>'


def _size(cells: Sequence[str]) -> int:
    written = (escape(cell).encode('utf-8', 'backslashreplace') for cell in cells)
    return _BESIDE_ROW + sum(_BESIDE_CELL + len(each) for each in written)


def _table(table: TableOf) -> Iterator[str]:
    columns = [column.lstrip('>') for column in table.columns]
    numbers = [column.startswith('>') for column in table.columns]
    if table.folded:
        yield f'<details><summary>{escape(table.title)}</summary>'
        yield from table_html('', columns, table.rows, numbers)
        yield '</figure></details>'
    else:
        yield from table_html(table.title, columns, table.rows, numbers)
        yield '</figure>'


def run_tables(run: Run) -> Iterator[TableOf]:
    """Yield what there is to tell of a run in numbers."""
    yield TableOf(
        'Curves',
        ('joint', 'quantity', '>least', '>greatest', 'unit', 'on'),
        [row for curves in run.curves for row in _ranges(curves)],
    )
    yield TableOf(
        'Events',
        ('kind', '>count', '>first at [s]', 'what it is'),
        [
            (
                LANES[key][0],
                f'{lane.count:,}',
                seconds_text(lane.in_order[0].begin),
                LANES[key][1],
            )
            for key, lane in lanes(run).items()
        ],
    )
    yield TableOf(
        'Samples rejected',
        ('reason', '>count'),
        [(reason, f'{count:,}') for reason, count in run.rejected.items()],
    )
    yield TableOf(
        'Left out of the curves',
        ('of', 'reason', '>count'),
        [(of, reason, f'{count:,}') for (of, reason), count in run.left_out.items()],
    )
    yield TableOf(
        'What the diagnostics said last',
        ('of', 'key', 'value'),
        [(task, key, value) for (task, key), value in run.said.items()],
        folded=True,
    )


def _ranges(curves: Curves) -> Iterator[tuple[str, ...]]:
    found = curves.intervals
    for number, (name, quantity, unit) in enumerate(curves.columns):
        least = np.nanmin(np.fmin(found.first[:, number], found.second[:, number]))
        greatest = np.nanmax(np.fmax(found.first[:, number], found.second[:, number]))
        yield name, quantity, f'{least:.9g}', f'{greatest:.9g}', unit, curves.title
