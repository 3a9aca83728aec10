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


"""
Tables, and the points of diagrams, as CSV.

Numbers keep every bit: each has the shortest text that reads back as the same number. What is not
there is an empty cell. A column of spreads becomes three.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import csv
import io
from numbers import Integral, Real

from linkage_ros.accuracy.page.numbers import Cell
from linkage_ros.accuracy.page.places import axis_title
from linkage_ros.accuracy.results import Diagram, Table
from linkage_ros.accuracy.spread import Spread

_QUARTILES = ('low', 'middle', 'high')


def table_csv(table: Table) -> str:
    """Return a table as CSV; what is no spread in a column of spreads is in its middle."""
    spreads = [
        any(isinstance(row[number], Spread) for row in table.rows)
        for number in range(len(table.columns))
    ]
    return _text(table.columns, spreads, table.rows)


def diagram_csv(diagram: Diagram) -> str:
    """Return the points of a diagram as CSV."""
    columns = ('curve', 'setting', axis_title(diagram.x), axis_title(diagram.y))
    rows = [
        (curve.name, point.setting, point.x_spread or point.x, point.y_spread or point.y)
        for curve in diagram.curves
        for point in curve.points
    ]
    spreads = [any(isinstance(row[number], Spread) for row in rows) for number in range(4)]
    return _text(columns, spreads, rows)


def _text(columns: Sequence[str], spreads: Sequence[bool], rows: Iterable[Sequence[Cell]]) -> str:
    written = io.StringIO()
    writer = csv.writer(written, lineterminator='\n')
    writer.writerow(
        name
        for column, spread in zip(columns, spreads, strict=True)
        for name in (_names(column) if spread else [column])
    )
    for row in rows:
        writer.writerow(
            value
            for cell, spread in zip(row, spreads, strict=True)
            for value in (_three(cell) if spread else [_one(cell)])
        )
    return written.getvalue()


def _names(column: str) -> list[str]:
    """Return a column's three names, the unit behind: 'time, low [µs]'."""
    name, bracket, unit = column.rpartition(' [')
    if not bracket or not unit.endswith(']'):
        return [f'{column}, {which}' for which in _QUARTILES]
    return [f'{name}, {which} [{unit}' for which in _QUARTILES]


def _three(cell: Cell) -> list[str]:
    if isinstance(cell, Spread):
        return [_one(value) for value in cell]
    return ['', _one(cell), '']


def _one(cell: Cell | Integral) -> str:
    if isinstance(cell, Integral):
        return str(int(cell))
    # Of a numpy number, repr would name its type.
    return repr(float(cell)) if isinstance(cell, Real) else str(cell or '')
