# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The result of a command in files: the same cells as CSV, as sheets and as Parquet."""

from __future__ import annotations

import csv
import json
from math import degrees, pi
from pathlib import Path
import xml.etree.ElementTree as ET
from zipfile import ZipFile

from linkage_ros.cli import Column, DEGREES, Table
from linkage_ros.description import FileTable, write_tables
import pytest

from .conftest import Run

MAIN = '{http://schemas.openxmlformats.org/spreadsheetml/2006/main}'
ROWS = [
    ('one', 1, 0.1, None),
    ('=cmd|1', 2**60, 5e-324, 1.0),
    ('<&>"\x1b\u202e', -3, 1.7976931348623157e308, 0.1 + 0.2),
    (None, 0, float('nan'), -0.0),
]
TABLE = FileTable('all/of:it', ['text', 'whole', 'number', '=gap'], ROWS)


def sheets_of(file: Path) -> dict[str, list[list[str | None]]]:
    """Return the cells of each sheet, as the parts of the file say by themselves."""
    with ZipFile(file) as parts:
        assert parts.testzip() is None
        book = ET.fromstring(parts.read('xl/workbook.xml'))
        found = {}
        for index, sheet in enumerate(book.iter(f'{MAIN}sheet'), 1):
            rows = ET.fromstring(parts.read(f'xl/worksheets/sheet{index}.xml'))
            found[sheet.attrib['name']] = [
                [''.join(cell.itertext()) if len(cell) else None for cell in row]
                for row in rows.iter(f'{MAIN}row')
            ]
        return found


def test_spreadsheet_keeps_every_bit_and_holds_no_formula(tmp_path: Path) -> None:
    write_tables(tmp_path / 'x.xlsx', [TABLE, TABLE])
    sheets = sheets_of(tmp_path / 'x.xlsx')
    assert list(sheets) == ['all_of_it', 'all_of_it 2']
    heads, *rows = sheets['all_of_it']
    assert heads == list(TABLE.heads)
    for row, wanted in zip(rows, ROWS, strict=True):
        assert row[1] == str(wanted[1])
        assert [cell and repr(float(cell)) for cell in row[2:]] == [
            None if value is None else repr(value) for value in wanted[2:]
        ]
    assert [row[0] for row in rows] == ['one', '=cmd|1', '<&>"\\x1b\\u202e', None]
    assert b'<f>' not in ZipFile(tmp_path / 'x.xlsx').read('xl/worksheets/sheet1.xml')
    again = tmp_path / 'again.xlsx'
    write_tables(again, [TABLE, TABLE])
    assert again.read_bytes() == (tmp_path / 'x.xlsx').read_bytes()


def test_parquet_and_csv_hold_texts_and_numbers(tmp_path: Path) -> None:
    parquet = pytest.importorskip('pyarrow.parquet')
    write_tables(tmp_path / 'x.parquet', [TABLE])
    columns = parquet.read_table(tmp_path / 'x.parquet').to_pydict()
    for head, wanted in zip(TABLE.heads, zip(*ROWS, strict=True), strict=True):
        assert list(map(repr, columns[head])) == list(map(repr, wanted))
    write_tables(tmp_path / 'x.csv', [TABLE])
    with (tmp_path / 'x.csv').open(newline='') as stream:
        heads, *rows = csv.reader(stream)
    assert heads[3] == "'=gap"
    assert rows[1] == ["'=cmd|1", str(2**60), '5e-324', '1.0']


def test_cell_is_converted_and_zero_has_no_sign() -> None:
    column = Column('>slide', 'slide', 'rad/s', '.3f')
    table = Table('', ['name', column], [('a', -1e-9), ('b', 1.0), ('c', None)])
    assert table.as_texts(DEGREES).rows == [['a', '0.000'], ['b', '57.296'], ['c', '']]
    assert table.as_texts(DEGREES).heads == ['name', '>slide [°/s]']
    assert column.file_head(DEGREES) == 'slide [rad/s]'


@pytest.mark.parametrize(
    ('typed', 'sheets'),
    [
        (['check', 'class_3', '--branches'], {'groups', 'branches', 'conditioning', 'facts'}),
        (['solve', 'jansen_leg', '--points', '--rate', '1'], {'states'}),
        (['scene', 'fault_drill'], {'stages', 'faults', 'topics'}),
        (['scene', '--list'], {'topic', 'encoder'}),
        (['gallery'], {'linkages', 'scenes'}),
        (['synthesize', '--swing', '60', '--time-ratio', '1.2'], {'links', 'positions'}),
    ],
    ids=lambda value: ' '.join(value[:2]) if isinstance(value, list) else '',
)
def test_tables_of_a_command_become_sheets_of_one_file(
    linkage: Run, tmp_path: Path, typed: list[str], sheets: set[str]
) -> None:
    answer = linkage(*typed, '-o', 'x.xlsx')
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout == 'x.xlsx\n'
    found = sheets_of(tmp_path / 'x.xlsx')
    assert sheets <= set(found) | {name.split(' ')[0] for name in found}
    for rows in found.values():
        assert all(len(row) == len(rows[0]) for row in rows)


def test_sheet_values_are_numbers_in_units_of_the_file(linkage: Run, tmp_path: Path) -> None:
    """As the JSON of the same file has them, in SI."""
    (tmp_path / 'l.yaml').write_text(
        'units: mm\nangles: degrees\nlinks: {ground: {O2: [0, 0], O4: [100, 0]},\n'
        ' crank: {O2: [0, 0], A: [40, 0]}, rocker: {O4: [0, 0], B: [80, 0]},\n'
        ' coupler: {A: [0, 0], B: [120, 0], P: [60, 30]}}\nassembly: {B: left}\n'
        'input: {joint: crank_joint, parent: ground, child: crank}\ntraced: [P]\n'
        'joints: {rocker_joint: {parent: ground, child: rocker}}\n'
    )
    account = json.loads(linkage('check', 'l.yaml', '--branches', '--json').stdout)
    answer = linkage('check', 'l.yaml', '--branches', '-o', 'x.xlsx')
    assert answer.returncode == 0, answer.stderr
    sheets = sheets_of(tmp_path / 'x.xlsx')
    in_file = {'rad': ('deg', 180.0 / pi), 'm': ('mm', 1e3)}
    heads, *rows = sheets['branches']
    for row, branch in zip(rows, account['branches'], strict=True):
        found = dict(zip(heads, row, strict=True))
        unit, factor = in_file[branch['unit']]
        assert found['unit'] == unit
        for end in ('low', 'high'):
            assert float(found[end]) == pytest.approx(branch[end] * factor, rel=1e-14)
    assert {row['unit'] for row in account['branches']} == {'rad', 'm'}
    heads, (*_, least, at, _, _) = sheets['transmission_angles']
    assert heads[2:4] == ['least.angle [deg]', 'least.inputs [deg]']
    (told,) = account['transmission_angles']
    assert float(least) == pytest.approx(degrees(told['least']['angle_rad']), rel=1e-14)
    assert float(at) == pytest.approx(degrees(told['least']['inputs'][0]), abs=1e-12)
