# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The result of a command: text, JSON, CSV, sheets and Parquet are made from it here."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Mapping, Sequence
import json
from pathlib import Path
import sys
from typing import Any, NamedTuple

from linkage_ros.cli.arguments import add_output, DEGREES, DisplayUnits, RESULTS
from linkage_ros.cli.table import Quantity, Table
from linkage_ros.cli.terminal import print_tables, table_text
from linkage_ros.description import (
    atomic_write,
    csv_of,
    FileTable,
    TABLE_KINDS,
    write_tables,
)


class Result(NamedTuple):
    """The result of a command."""

    account: Mapping[str, Any]  # As JSON holds it
    parts: Sequence[Table | str]  # Tables and lines, in the order in which they are shown


def add_result(parser: argparse._ActionsContainer, *, output: bool = True) -> None:
    """Declare ``--json``, ``--csv`` and, if ``output``, ``-o`` for `show_result`."""
    shown = parser.add_mutually_exclusive_group()
    shown.add_argument('--json', action='store_true', help='print JSON, in SI units')
    shown.add_argument('--csv', action='store_true', help='print the first table as CSV')
    if output:
        add_output(parser, RESULTS, 'the result is printed')


def show_result(
    result: Result, arguments: argparse.Namespace, units: DisplayUnits = DEGREES
) -> None:
    """Print a result, or write it to the file of ``-o``."""
    file: Path | None = getattr(arguments, 'output', None)
    suffix = file.suffix.lower() if file is not None else ''
    if file is None or suffix not in RESULTS:
        if arguments.json:
            print(as_json(result))
        elif arguments.csv:
            sys.stdout.write(csv_of(_file_tables(result, units)[0]))
        else:
            show_parts(result.parts, units)
        return
    if suffix in TABLE_KINDS:
        write_tables(file, _file_tables(result, units))
    else:
        text = as_json(result) if suffix == '.json' else as_text(result, units)
        atomic_write(file, f'{text}\n'.encode('utf-8', 'backslashreplace'))
    print(file)


def tables_json(tables: Iterable[Table]) -> dict[str, Any]:
    """Return the rows of tables as JSON holds them, by the keys of tables and columns."""
    return {table.key: [*_rows_json(table)] for table in tables}


def _rows_json(table: Table) -> Iterator[dict[str, Any]]:
    for row in table.rows:
        account: dict[str, Any] = {}
        for column, value in zip(table.typed_columns, row, strict=True):
            *objects, name = column.key.split('.')
            place = account
            for key in objects:
                place = place.setdefault(key, {})
            place[name] = value.value if isinstance(value, Quantity) else value
        yield account


def as_json(result: Result) -> str:
    """Return a result as JSON: numbers in SI units."""
    return json.dumps(result.account, indent=1, allow_nan=False)


def as_text(result: Result, units: DisplayUnits) -> str:
    """Return a result as text, without frames."""
    lines: list[str] = []
    for part in result.parts:
        if isinstance(part, str):
            lines.append(part)
        else:
            lines += [''] * bool(lines) + [table_text(part.as_texts(units))]
    return '\n'.join(lines)


def show_parts(parts: Sequence[Table | str], units: DisplayUnits) -> None:
    """Print lines and tables, with an empty line before a table."""
    for index, part in enumerate(parts):
        if index and isinstance(part, Table):
            print()
        if isinstance(part, str):
            print(part)
        else:
            print_tables(part.as_texts(units))


def _file_tables(result: Result, units: DisplayUnits) -> list[FileTable]:
    """Return the tables for a file; tables of facts come last."""
    tables = [part for part in result.parts if isinstance(part, Table)]
    tables.sort(key=lambda table: not table.key)
    return [_file_table(table, units) for table in tables]


def _file_table(table: Table, units: DisplayUnits) -> FileTable:
    """Return a table for a file; several numbers in a cell take a column each."""
    heads: list[str] = []
    columns: list[list[Any]] = []
    for index, column in enumerate(table.typed_columns):
        values = [row[index] for row in table.rows]
        head = column.file_head(units)
        if column.unit and any(isinstance(value, list) for value in values):
            for place in range(max(map(len, values))):
                heads.append(f'{head} {place + 1}' if place else head)
                columns.append([column.cell(value[place], units) if len(value) > place else None
                                for value in values])  # fmt: skip
        else:
            heads.append(head)
            columns.append([column.cell(value, units) for value in values])
    return FileTable(table.key or 'facts', heads, [*zip(*columns, strict=True)])
