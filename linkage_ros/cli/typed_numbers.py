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


"""A CSV file of numbers, as spreadsheets write it: commas or semicolons, a heading or none."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import csv
from math import isfinite
from pathlib import Path

from linkage_ros.errors import FileError, quoted
from linkage_ros.files.regular_file import read_regular

_MOST = 1000
_LARGEST_FILE = 10_000_000


def numbers_of(file: Path, columns: Sequence[int]) -> list[tuple[float, ...]]:
    """
    Read rows of numbers.

    Parameters
    ----------
    file
        The file; lines that are empty or begin with ``#`` are passed over, and so is a heading.
    columns
        How many numbers a row may have; all rows have as many.

    Raises
    ------
    FileError
        With the line.

    """
    try:
        data = read_regular(file, _LARGEST_FILE)
        text = data[:_LARGEST_FILE].decode('utf-8-sig')
    except (OSError, ValueError) as error:  # the latter for what is no text, and a NUL in a name
        reason = getattr(error, 'strerror', None) or 'is no text'
        raise FileError(file, '', f'cannot be read ({reason})', 'name a CSV file') from None
    if len(data) > _LARGEST_FILE:
        raise FileError(file, '', f'is larger than {_LARGEST_FILE} bytes', 'thin it out')
    delimiter = ';' if ';' in text else ','
    rows: list[tuple[float, ...]] = []
    for number, cells in _lines(file, text, delimiter):
        if not ''.join(cells).strip() or cells[0].lstrip().startswith('#'):
            continue
        row = _row(cells)
        if row is None and not rows:
            continue  # the heading
        allowed = (len(rows[0]),) if rows else columns
        if row is None or len(row) not in allowed:
            wanted = ' or '.join(map(str, allowed))
            raise FileError(
                file,
                '',
                f'line {number}: {quoted(delimiter.join(cells))} is no row of {wanted} numbers',
                'write numbers with commas between them',
            )
        rows.append(row)
        if len(rows) > _MOST:
            raise FileError(file, '', f'has more than {_MOST} rows', 'thin it out')
    if not rows:
        raise FileError(file, '', 'holds no numbers', 'write rows of numbers with commas')
    return rows


def _lines(file: Path, text: str, delimiter: str) -> Iterator[tuple[int, list[str]]]:
    reader = csv.reader(text.splitlines(), delimiter=delimiter)
    try:
        yield from enumerate(reader, 1)
    except csv.Error as error:  # a cell without end
        raise FileError(
            file, '', f'line {reader.line_num}: {error}', 'write rows of numbers with commas'
        ) from None


def _row(cells: Sequence[str]) -> tuple[float, ...] | None:
    try:
        row = tuple(float(cell) for cell in cells)
    except ValueError:
        return None
    return row if all(map(isfinite, row)) else None
