# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Write tables to CSV, Parquet and xlsx files, block by block.

Numbers keep every bit: CSV and xlsx have the shortest text that reads as the same number. A
missing value is an empty cell, or null. A file appears as a whole.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
import csv
from html import escape
from importlib import import_module
import io
from math import isfinite
import os
from pathlib import Path
import re
from typing import Any, BinaryIO, NamedTuple
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from linkage_ros.description.file_access import check_output_name, read_regular, replace_file
from linkage_ros.errors import escape_unprintable, FileError, LinkageError, quote
from linkage_ros.names import csv_text

Row = Sequence[float | int | str | None]
Write = Callable[[Sequence[Row]], None]
"""Writes a block of rows."""

_CELLS = 2**20  # a block of this size takes about 40 MB

_MOST_IN_SHEET = 2**20  # rows of a sheet, as a spreadsheet reads it
_MOST_EXACT = 2**53  # a spreadsheet rounds integers beyond

_MOST = 1000  # rows that `numbers_of` reads
_LARGEST_FILE = 10_000_000  # bytes that it reads


class FileTable(NamedTuple):
    """A table for a file."""

    name: str
    heads: Sequence[str]
    rows: Sequence[Row]

    def heads_of(self, kind: type) -> list[str]:
        """Return the heads of the columns that hold values of a kind alone."""
        return [
            head
            for head, column in zip(self.heads, zip(*self.rows, strict=True), strict=False)
            if all(isinstance(value, kind) for value in column if value is not None)
        ]


@contextmanager
def table_file(
    file: Path, heads: Sequence[str], whole: Sequence[str], texts: Sequence[str] = ()
) -> Iterator[Write]:
    """
    Yield a function that writes blocks of a table; the file appears complete at the end, or not.

    Its suffix selects the format, see `TABLE_KINDS`; an existing file is replaced. ``whole`` and
    ``texts`` name the columns of integers and of texts. A LinkageError says that it cannot be
    written.
    """
    kind = TABLE_KINDS[file.suffix.lower()]
    with _new_file(file) as stream, kind(stream, heads, whole, texts) as write:
        yield write


def write_tables(file: Path, tables: Sequence[FileTable]) -> None:
    """Write tables: all of them as sheets of an xlsx file, else the first."""
    if file.suffix.lower() == '.xlsx':
        with _new_file(file) as stream, _open_workbook(stream) as book:
            for table in tables:
                with book.open_sheet(table.name, table.heads) as write:
                    write(table.rows)
        return
    first = tables[0]
    with table_file(file, first.heads, first.heads_of(int), first.heads_of(str)) as write:
        write(first.rows)


def csv_of(table: FileTable) -> str:
    """Return a table as CSV."""
    stream = io.BytesIO()
    with _open_csv(stream, table.heads, (), ()) as write:
        write(table.rows)
    return stream.getvalue().decode()


@contextmanager
def _new_file(file: Path) -> Iterator[BinaryIO]:
    # A link is followed: its target is replaced, not the link.
    target = Path(os.path.realpath(file))
    try:
        if target.exists() and not target.is_file():
            raise LinkageError(str(file), 'exists and is not a file', 'name another file')
        with replace_file(target) as stream:
            yield stream
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
def _open_csv(
    stream: BinaryIO, heads: Sequence[str], _whole: Sequence[str], _texts: Sequence[str]
) -> Iterator[Write]:
    text = io.TextIOWrapper(stream, encoding='utf-8', newline='', write_through=True)
    writer = csv.writer(text, lineterminator='\n')  # writes floats with repr
    try:
        writer.writerow(map(csv_text, heads))
        yield lambda rows: writer.writerows(
            [csv_text(cell) if isinstance(cell, str) else cell for cell in row] for row in rows
        )
    finally:
        text.detach()  # else it would close the stream when it is garbage-collected


@contextmanager
def _open_parquet(
    stream: BinaryIO, heads: Sequence[str], whole: Sequence[str], texts: Sequence[str]
) -> Iterator[Write]:
    import pyarrow as pa  # local import: an extra, and slow to load
    from pyarrow import parquet

    kinds = dict.fromkeys(whole, pa.int64()) | dict.fromkeys(texts, pa.string())
    schema = pa.schema([(head, kinds.get(head, pa.float64())) for head in heads])

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


class _Workbook:
    """A workbook in Office Open XML (ECMA-376), sheet after sheet, without styles."""

    _MAIN = 'http://schemas.openxmlformats.org/spreadsheetml/2006/main'
    _PACKAGE = 'http://schemas.openxmlformats.org/package/2006'
    _OFFICE = 'http://schemas.openxmlformats.org/officeDocument/2006/relationships'
    _TYPE = 'application/vnd.openxmlformats-officedocument.spreadsheetml'

    def __init__(self, archive: ZipFile) -> None:
        self._zip = archive
        self._names: list[str] = []

    @contextmanager
    def open_sheet(self, name: str, heads: Sequence[str]) -> Iterator[Write]:
        """Yield a function that writes rows of a new sheet."""
        # A name of 31 characters, without some of them, and used once.
        name = re.sub(r"[][:*?/\\']", '_', escape_unprintable(name))[:28] or 'table'
        self._names.append(f'{name} {len(self._names) + 1}' if name in self._names else name)
        count = 0
        sheet = _dateless(f'xl/worksheets/sheet{len(self._names)}.xml')
        with self._zip.open(sheet, 'w', force_zip64=True) as entry:

            def write_rows(rows: Sequence[Row]) -> None:
                nonlocal count
                count += len(rows)
                if count > _MOST_IN_SHEET:
                    reason = f'has more than {_MOST_IN_SHEET} rows'
                    raise LinkageError('a sheet', reason, 'write a .csv or .parquet file')
                for row in rows:
                    entry.write(f'<row>{"".join(map(_sheet_cell, row))}</row>'.encode())

            entry.write(f'<worksheet xmlns="{self._MAIN}"><sheetData>'.encode())
            write_rows([heads])
            yield write_rows
            entry.write(b'</sheetData></worksheet>')

    def write_contents(self) -> None:
        """Write what lists the sheets."""
        files = [f'worksheets/sheet{number}' for number, _ in enumerate(self._names, 1)]
        listed = ''.join(
            f'<sheet name="{escape(name)}" sheetId="{number}" r:id="r{number}"/>'
            for number, name in enumerate(self._names, 1)
        )
        types = ''.join(
            f'<Override PartName="/xl/{file}.xml" ContentType="{self._TYPE}.{kind}+xml"/>'
            for file, kind in [
                ('workbook', 'sheet.main'),
                *((file, 'worksheet') for file in files),
            ]
        )
        parts = {
            '_rels/.rels': self._relations('officeDocument', ['xl/workbook']),
            'xl/_rels/workbook.xml.rels': self._relations('worksheet', files),
            'xl/workbook.xml': f'<workbook xmlns="{self._MAIN}" xmlns:r="{self._OFFICE}">'
            f'<sheets>{listed}</sheets></workbook>',
            '[Content_Types].xml': f'<Types xmlns="{self._PACKAGE}/content-types">'
            '<Default Extension="rels" '
            'ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
            f'{types}</Types>',
        }
        for name, text in parts.items():
            self._zip.writestr(_dateless(name), text)

    def _relations(self, kind: str, files: Sequence[str]) -> str:
        listed = ''.join(
            f'<Relationship Id="r{number}" Type="{self._OFFICE}/{kind}" Target="{file}.xml"/>'
            for number, file in enumerate(files, 1)
        )
        return f'<Relationships xmlns="{self._PACKAGE}/relationships">{listed}</Relationships>'


def _dateless(name: str) -> ZipInfo:
    """Return an entry without the time of day: the same table gives the same bytes."""
    entry = ZipInfo(name)
    entry.compress_type = ZIP_DEFLATED
    return entry


@contextmanager
def _open_workbook(stream: BinaryIO) -> Iterator[_Workbook]:
    with ZipFile(stream, 'w') as archive:
        book = _Workbook(archive)
        yield book
        book.write_contents()


def _sheet_cell(value: float | str | None) -> str:
    if value is None:
        return '<c/>'
    if isinstance(value, str) or not isfinite(value) or abs(value) > _MOST_EXACT:
        text = escape(escape_unprintable(str(value)), quote=False)
        return f'<c t="inlineStr"><is><t xml:space="preserve">{text}</t></is></c>'
    return f'<c><v>{value!r}</v></c>'


@contextmanager
def _open_xlsx(
    stream: BinaryIO, heads: Sequence[str], _whole: Sequence[str], _texts: Sequence[str]
) -> Iterator[Write]:
    with _open_workbook(stream) as book, book.open_sheet('table', heads) as write:
        yield write


_OpenTable = Callable[
    [BinaryIO, Sequence[str], Sequence[str], Sequence[str]], AbstractContextManager[Write]
]
TABLE_KINDS: dict[str, _OpenTable] = {
    '.csv': _open_csv,
    '.xlsx': _open_xlsx,
    '.parquet': _open_parquet,
}
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
