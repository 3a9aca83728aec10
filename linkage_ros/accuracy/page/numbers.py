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
Numbers as text: rounded for tables and plots, and with every bit as CSV.

In CSV each number has the shortest text that reads back as the same number. A missing value is an
empty cell. A column of spreads becomes three columns.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import csv
from decimal import Decimal
import io
from math import ceil, floor, inf, isfinite, log10
from numbers import Integral, Real

from linkage_ros.accuracy.results import Cell, Diagram, Table
from linkage_ros.measuring import Spread
from linkage_ros.names import csv_text

_SMALL, _LARGE = 1e-3, 1e6
"""Smaller and larger numbers are written with an exponent."""

_DIGITS = 3
_MOST_DIGITS = 4
"""Maximum number of digits, even if the quartiles are closer."""


def cell_text(cell: Cell) -> str:
    """Return the text of a cell: '' for None, '0.70 (0.68–0.75)' for a spread."""
    if cell is None:
        return ''
    if isinstance(cell, str):
        return cell
    if isinstance(cell, Spread):
        return spread_text(cell)
    return number_text(cell)


def number_text(value: float | Integral) -> str:
    """Return a number with three significant digits; an integer with all."""
    if isinstance(value, Integral):
        return str(int(value))
    value = float(value)
    if not value:
        return '0'
    if not isfinite(value):
        return {inf: '∞', -inf: '-∞'}.get(value, 'nan')
    if not _SMALL <= abs(value) < _LARGE:
        mantissa, _, exponent = f'{value:.{_DIGITS - 1}e}'.partition('e')
        return f'{_short(mantissa)}e{int(exponent)}'
    return _short(f'{value:.{max(0, _DIGITS - 1 - _power(value))}f}')


def spread_text(spread: Spread) -> str:
    """
    Return median and quartiles, with as many digits as distinguish the quartiles.

    If all three are equal, as for a single measurement, return that number alone.
    """
    if spread.low == spread.middle == spread.high:
        return number_text(spread.middle)
    if not all(map(isfinite, spread)) or spread.high <= spread.low:
        low, middle, high = map(number_text, spread)
        return f'{middle} ({_range(low, high)})'
    exponent = 0
    largest = max(map(abs, spread))
    if not _SMALL <= largest < _LARGE:
        near = abs(spread.middle) > _SMALL * largest
        exponent = _power(spread.middle if near else largest)
    # As decimals: the smallest double cannot be divided by its power of ten.
    scaled = [float(Decimal(value).scaleb(-exponent)) for value in spread]
    decimals = _decimals(*scaled)
    # Rounding makes a negative zero of a small negative number.
    low, middle, high = (f'{round(value, decimals) + 0.0:.{decimals}f}' for value in scaled)
    text = f'{middle} ({_range(low, high)})'
    return f'{text}e{exponent}' if exponent else text


def numeric_columns(table: Table) -> list[bool]:
    """Return which columns hold numbers, if only in some rows; they are aligned to the right."""
    return [
        any(isinstance(row[place], Real | Spread) for row in table.rows)
        for place in range(len(table.columns))
    ]


def _range(low: str, high: str) -> str:
    return f'{low} to {high}' if low.startswith('-') else f'{low}–{high}'


def _decimals(low: float, middle: float, high: float) -> int:
    """Return the number of decimals that distinguish the quartiles, and the median from 0."""
    power = _power(middle or high or low)
    apart = ceil(-log10(high - low))
    wanted = min(max(1 - power, apart), apart + 1, _MOST_DIGITS - 1 - power)
    return max(0, wanted)


def _power(value: float) -> int:
    return floor(log10(abs(value)))


def _short(digits: str) -> str:
    return digits.rstrip('0').rstrip('.') if '.' in digits else digits


_QUARTILES = ('low', 'middle', 'high')


def table_csv(table: Table) -> str:
    """Return a table as CSV; a number in a column of spreads stands in the middle one."""
    spreads = [
        any(isinstance(row[number], Spread) for row in table.rows)
        for number in range(len(table.columns))
    ]
    return _text(table.columns, spreads, table.rows)


def diagram_csv(diagram: Diagram) -> str:
    """Return the points of a diagram as CSV."""
    columns = ('curve', 'setting', diagram.x.title, diagram.y.title)
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
        for name in (_names(column) if spread else [csv_text(column)])
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
    return repr(float(cell)) if isinstance(cell, Real) else csv_text(str(cell or ''))
