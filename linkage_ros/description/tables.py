# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Write tables of numbers to CSV and Parquet files, block by block.

Numbers keep every bit: CSV has the shortest text that reads as the same number. A missing value is
an empty cell, or null. A file appears as a whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
import csv
from importlib import import_module
import io
from math import isfinite
import os
from pathlib import Path
from typing import Any, BinaryIO

from linkage_ros.description.file_access import check_output_name, read_regular, replace_file
from linkage_ros.errors import FileError, LinkageError, quote
from linkage_ros.names import csv_text

Row = Sequence[float | int | None]
Write = Callable[[Sequence[Row]], None]
"""Writes a block of rows."""

_CELLS = 2**20  # a block of this size takes about 40 MB

_MOST = 1000  # rows that `numbers_of` reads
_LARGEST_FILE = 10_000_000  # bytes that it reads


@contextmanager
def table_file(file: Path, heads: Sequence[str], whole: Sequence[str]) -> Iterator[Write]:
    """
    Yield a function that writes blocks of a table; the file appears complete at the end, or not.

    Its suffix selects the format, see `KINDS`; an existing file is replaced. ``whole`` names the
    columns of integers. A LinkageError says that it cannot be written.
    """
    # A link is followed: its target is replaced, not the link.
    target = Path(os.path.realpath(file))
    try:
        if target.exists() and not target.is_file():
            raise LinkageError(str(file), 'exists and is not a file', 'name another file')
        kind = TABLE_KINDS[file.suffix.lower()]
        with replace_file(target) as stream, kind(stream, heads, whole) as write:
            yield write
    except OSError as error:
        raise LinkageError(
            str(file), f'cannot be written: {error.strerror or error}', 'name another file'
        ) from None


def check_kind(file: Path) -> None:
    """Check the suffix of a file for a table, and that the library for it can be imported."""
    check_output_name(file, TABLE_KINDS)
    if file.suffix.lower() == '.parquet':
        _check_pyarrow()


def _check_pyarrow() -> None:
    """Check that pyarrow can be imported: it is an extra, and from 26 on refuses numpy 1.x."""
    try:
        import_module('pyarrow')
    except ImportError as error:
        missing = isinstance(error, ModuleNotFoundError) and error.name == 'pyarrow'
        raise LinkageError(
            'pyarrow',
            'is not installed' if missing else f'cannot be loaded: {error}',
            "pip install 'linkage_ros[export]', or name a file that ends in .csv",
        ) from None


def block_rows(columns: int) -> int:
    """Return the number of rows for a block."""
    return max(1, _CELLS // columns)


@contextmanager
def _open_csv(stream: BinaryIO, heads: Sequence[str], _whole: Sequence[str]) -> Iterator[Write]:
    text = io.TextIOWrapper(stream, encoding='utf-8', newline='', write_through=True)
    writer = csv.writer(text, lineterminator='\n')  # writes floats with repr
    try:
        writer.writerow(map(csv_text, heads))
        yield writer.writerows
    finally:
        text.detach()  # else it would close the stream when it is garbage-collected


@contextmanager
def _open_parquet(stream: BinaryIO, heads: Sequence[str], whole: Sequence[str]) -> Iterator[Write]:
    import pyarrow as pa  # local import: an extra, and slow to load
    from pyarrow import parquet

    schema = pa.schema([(head, pa.int64() if head in whole else pa.float64()) for head in heads])

    def write_rows(rows: Sequence[Row]) -> None:
        try:
            columns: list[Any] = [
                pa.array(column, field.type)
                for column, field in zip(zip(*rows, strict=True), schema, strict=True)
            ]
        except (OverflowError, pa.ArrowInvalid):
            raise LinkageError(
                'a time in the bag', 'is beyond 63 bits of [ns]', 'write a .csv file'
            ) from None
        writer.write_table(pa.Table.from_arrays(columns, schema=schema))

    # Numbers hardly ever repeat exactly: a dictionary of them would be useless.
    with parquet.ParquetWriter(stream, schema, compression='zstd', use_dictionary=False) as writer:
        yield write_rows


TABLE_KINDS: dict[
    str, Callable[[BinaryIO, Sequence[str], Sequence[str]], AbstractContextManager[Write]]
] = {'.csv': _open_csv, '.parquet': _open_parquet}
"""Writer for each suffix of a file."""


def numbers_of(file: Path, columns: Sequence[int]) -> list[tuple[float, ...]]:
    """
    Read rows of numbers from a CSV file with commas or semicolons.

    Empty lines, lines that begin with ``#``, and a heading are skipped. All rows have the same
    number of columns, one of ``columns``. A FileError names the wrong line.
    """
    try:
        data = read_regular(file, _LARGEST_FILE)
        text = data[:_LARGEST_FILE].decode('utf-8-sig')
    except (OSError, ValueError) as error:  # ValueError: not UTF-8, or a NUL in the name
        reason = getattr(error, 'strerror', None) or 'not UTF-8 text'
        raise FileError(file, '', f'cannot be read ({reason})', 'name a CSV file') from None
    if len(data) > _LARGEST_FILE:
        raise FileError(file, '', f'is larger than {_LARGEST_FILE} bytes', 'write fewer rows')
    delimiter = ';' if ';' in text else ','
    rows: list[tuple[float, ...]] = []
    for number, cells in _split_lines(file, text, delimiter):
        if not ''.join(cells).strip() or cells[0].lstrip().startswith('#'):
            continue
        row = _parse_row(cells)
        if row is None and not rows:
            continue  # the heading
        allowed = (len(rows[0]),) if rows else columns
        if row is None or len(row) not in allowed:
            wanted = ' or '.join(map(str, allowed))
            raise FileError(
                file,
                '',
                f'line {number}: {quote(delimiter.join(cells))} is not a row of {wanted} numbers',
                'write numbers with commas between them',
            )
        rows.append(row)
        if len(rows) > _MOST:
            raise FileError(file, '', f'has more than {_MOST} rows', 'write fewer rows')
    if not rows:
        raise FileError(file, '', 'holds no numbers', 'write rows of numbers with commas')
    return rows


def _split_lines(file: Path, text: str, delimiter: str) -> Iterator[tuple[int, list[str]]]:
    reader = csv.reader(text.splitlines(), delimiter=delimiter)
    try:
        yield from enumerate(reader, 1)
    except csv.Error as error:  # an unterminated cell
        raise FileError(
            file, '', f'line {reader.line_num}: {error}', 'write rows of numbers with commas'
        ) from None


def _parse_row(cells: Sequence[str]) -> tuple[float, ...] | None:
    try:
        row = tuple(float(cell) for cell in cells)
    except ValueError:
        return None
    return row if all(map(isfinite, row)) else None
