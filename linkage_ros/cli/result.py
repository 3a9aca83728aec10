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
from collections.abc import Iterable, Mapping, Sequence
import json
from pathlib import Path
import sys
from typing import Any, NamedTuple

from linkage_ros.cli.arguments import add_output, DEGREES, DisplayUnits, RESULTS
from linkage_ros.cli.table import Table
from linkage_ros.cli.terminal import print_tables, table_text
from linkage_ros.description import (
    atomic_write,
    check_kind,
    csv_of,
    FileTable,
    TABLE_KINDS,
    write_tables,
)


class Result(NamedTuple):
    """The result of a command."""

    account: Mapping[str, Any]  # As JSON holds it
    parts: Sequence[Table | str]  # Tables and lines, in the order in which they are shown


def add_result(
    parser: argparse._ActionsContainer, what: str = 'the result', *, output: bool = True
) -> None:
    """Declare ``--json``, ``--csv`` and, if ``output``, ``-o`` for `show_result`."""
    shown = parser.add_mutually_exclusive_group()
    shown.add_argument('--json', action='store_true', help='print JSON, in SI units')
    shown.add_argument('--csv', action='store_true', help='print the first table as CSV')
    if output:
        add_output(parser, RESULTS, f'{what} is printed')


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
        check_kind(file)
        write_tables(file, _file_tables(result, units))
    else:
        text = as_json(result) if suffix == '.json' else as_text(result, units)
        atomic_write(file, f'{text}\n'.encode())
    print(file)


def tables_json(tables: Iterable[Table]) -> dict[str, Any]:
    """Return the rows of tables as JSON holds them, by the keys of tables and columns."""
    return {
        table.key: [
            {column.key: value for column, value in zip(table.declared, row, strict=True)}
            for row in table.rows
        ]
        for table in tables
    }


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
    return [
        FileTable(
            table.key or 'facts',
            [column.file_head(units) for column in table.declared],
            [
                [
                    column.cell(value, units)
                    for column, value in zip(table.declared, row, strict=True)
                ]
                for row in table.rows
            ],
        )
        for table in tables
    ]
