# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
One rule for all tables: they have the units of the file that they tell of; JSON is in SI.

The same linkage and scene stand in metres and radians, and in millimetres and degrees. Every
number of a command about the one is that of the other, converted by its heading or by its row.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import json
from math import pi
from pathlib import Path
import re
from typing import Any

from linkage_ros.cli import COMMANDS, find_command, parser_of
import pytest

from .recorded import Recorded
from .test_result import sheets_of
from ..support.commands import linkage

LINKAGE = """
links: {{ground: {{O: [0, 0]}},
  crank: {{O: [0, 0], A: [{r}, 0]}}, rod: {{A: [0, 0], B: [{l}, 0]}}}}
sliders: {{press: {{point: B, along: ground, through: O, direction: [1, 0]}}}}
assembly: {{press: ahead}}
input: {{joint: crank_joint, parent: ground, child: crank}}
joints: {{rod_joint: {{parent: crank, child: rod}}, press_slide: {{slider: press}}}}
traced: [A]
"""
SCENE = """
linkage: l.yaml
rate: 100
seed: 3
drive: {drive}
effects: {{velocity: {{}}, noise: {{joints: {{press_slide: {{white: {noise}}}}}}}}}
"""
FILES = {
    'si': (
        '',
        {'r': 0.04, 'l': 0.125},
        {'noise': 0.0005},
        '{sine: {amplitude: 0.5, frequency: 1}}',
    ),
    'mm': (
        'units: mm\nangles: degrees\n',
        {'r': 40, 'l': 125},
        {'noise': 0.5},
        f'{{sine: {{amplitude: {0.5 * 180.0 / pi!r}, frequency: 1}}}}',
    ),
}
TABLES = {
    'check': ['l.yaml', '--branches'],
    'solve': ['l.yaml', '--at', '20', '--at', '40', '--rate', '1', '--points', '--jacobian'],
    'scene': ['sine.yaml'],
    'info': ['bag'],
    'replay': ['bag', '--set', 'seed=4'],
    'compare': ['bag', 'other'],
    'export': ['bag'],
    'simulate': ['sine.yaml', '--seconds', '0.2'],
}
OTHERS = {
    'gallery': 'no quantities',
    'recover': 'no quantities',
    'synthesize': 'about no file',
    'accuracy': 'in SI: the worst error over angles and slides',
}
NUMBERS_OF_ROW = {'low', 'high', 'rms', 'greatest', 'difference'}
TOLD_OF_THE_BAG = {'size_bytes'}
FACTOR = {'rad': ('deg', 180.0 / pi), 'm': ('mm', 1e3)}


def in_file(unit: str) -> tuple[str, float]:
    """Return the unit in the file for one in SI, and how many make one."""
    of, slash, per = unit.partition('/')
    if of in FACTOR and per in FACTOR:  # a slope
        return unit, 1.0
    name, factor = FACTOR.get(of, (of, 1.0))
    return name + slash + per, factor


def write_files(folder: Path, kind: str) -> Path:
    units, lengths, noise, sine = FILES[kind]
    (folder / 'l.yaml').write_text(units + LINKAGE.format(**lengths))
    for name, drive in (('sine', sine), ('topic', '{topic: {}}')):
        (folder / f'{name}.yaml').write_text(units + SCENE.format(drive=drive, **noise))
    for name, rate in (('bag', 6.0), ('other', 6.5)):
        Recorded(
            folder / name,
            folder / 'topic.yaml',
            lambda tick, rate=rate: {'crank_joint': (0.01 * rate * tick, rate)},
        ).run(20)
    return folder


def test_units_are_tested_for_every_command_with_tables() -> None:
    writing = set()
    for command in COMMANDS:
        parser = parser_of(command, find_command(command))
        help_text = parser.format_help()
        if '--csv' in help_text or 'OUTPUT.csv' in help_text:
            writing.add(command)
    assert writing == {*TABLES, *OTHERS}


@pytest.fixture(scope='module')
def folders(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return [write_files(tmp_path_factory.mktemp(kind), kind) for kind in FILES]


@pytest.mark.sample(3)
@pytest.mark.parametrize('command', TABLES)
def test_tables_have_the_units_of_their_file(folders: list[Path], command: str) -> None:
    found = []
    for folder in folders:
        answer = linkage(folder, command, *TABLES[command], '-o', f'{command}.xlsx')
        assert answer.returncode == 0, answer.stderr
        found.append(sheets_of(folder / f'{command}.xlsx'))
    converted = 0
    for name, (heads, *rows) in found[0].items():
        heads_in_mm, *rows_in_mm = found[1][name]
        for row, row_in_mm in zip(rows, rows_in_mm, strict=True):
            of_row = unit_of_row(heads, row)
            if of_row:
                assert in_file(of_row)[0] == unit_of_row(heads_in_mm, row_in_mm)
            for cells in zip(heads, heads_in_mm, row, row_in_mm, strict=True):
                head, head_in_mm, cell, cell_in_mm = map(str, cells)
                unit = re.search(r'\[(.*)\]', head)
                shown, factor = '', 1.0
                if unit:
                    shown, factor = in_file(unit[1])
                    assert head_in_mm == head.replace(unit[0], f'[{shown}]')
                elif head in NUMBERS_OF_ROW:
                    _, factor = in_file(of_row)
                try:
                    number = float(cell)
                except ValueError:
                    assert not re.search(r'\d (m|rad)\b', cell_in_mm), (name, cell_in_mm)
                    continue
                assert float(cell_in_mm) == pytest.approx(number * factor, rel=1e-9, abs=1e-9)
                converted += factor != 1.0 and abs(number) > 1e-9
    assert converted or command in {'scene', 'info'}  # their quantities are texts


@pytest.mark.sample(2)
@pytest.mark.parametrize('command', sorted(TABLES.keys() - {'export', 'simulate'}))
def test_json_of_commands_is_in_si_units(folders: list[Path], command: str) -> None:
    in_si, in_mm = (
        json.loads(linkage(folder, command, *TABLES[command], '--json').stdout)
        for folder in folders
    )
    assert [*leaves_of(in_si)] == pytest.approx([*leaves_of(in_mm)], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize('own', [True, False], ids=['its own', 'of its linkage'])
def test_scene_in_si_prints_units_of_its_linkage(tmp_path: Path, own: bool) -> None:
    write_files(tmp_path, 'mm')
    scene = tmp_path / 'sine.yaml'
    if not own:
        scene.write_text(scene.read_text().replace('units: mm\nangles: degrees\n', ''))
    answer = linkage(tmp_path, 'simulate', 'sine.yaml', '--seconds', '0.1', '-o', 'x.csv')
    assert answer.returncode == 0, answer.stderr
    head, *_ = (tmp_path / 'x.csv').read_text().splitlines()
    assert {'crank_joint [deg]', 'press_slide [mm]', 'press_slide rate [mm/s]'} <= {
        *head.split(',')
    }


@pytest.mark.parametrize(
    ('unit', 'one'), [('m', 1.0), ('cm', 100.0), ('mm', 1e3), ('in', 1 / 0.0254)]
)
@pytest.mark.parametrize('typed', [['plot', 'bag'], ['compare', 'bag', 'other']])
def test_pictures_of_bags_have_the_units_of_their_file(
    tmp_path: Path, typed: list[str], unit: str, one: float
) -> None:
    """A crank of 2 m: what metres show is told in metres."""
    pytest.importorskip('matplotlib')
    lengths = {'r': 2.0 * one, 'l': 5.0 * one}
    (tmp_path / 'l.yaml').write_text(f'units: {unit}\n{LINKAGE.format(**lengths)}')
    (tmp_path / 'topic.yaml').write_text(SCENE.format(drive='{topic: {}}', noise=0.0005))
    for name, rate in (('bag', 20.0), ('other', 60.0)):
        Recorded(
            tmp_path / name,
            tmp_path / 'topic.yaml',
            lambda tick, rate=rate: {'crank_joint': (0.01 * rate * tick, rate)},
        ).run(20)
    answer = linkage(tmp_path, *typed, '-o', 'x.svg')
    assert answer.returncode == 0, answer.stderr
    axes = re.findall(r'<!-- (.*slide) \[(.*)\] -->', (tmp_path / 'x.svg').read_text())
    wanted = {'rate of slide': f'{unit}/s', 'slide': unit, 'difference of slide': unit}
    assert len(axes) == (2 if typed[0] == 'plot' else 1)
    assert {(name, wanted[name]) for name, _ in axes} == {*axes}


def test_study_table_has_the_units_of_the_scene(folders: list[Path]) -> None:
    tables = []
    for folder, values in zip(
        folders, ('0.25,0.5', '14.32394487827058,28.64788975654116'), strict=True
    ):
        typed = ['--seconds', '0.1', '--sweep', f'drive.sine.amplitude={values}']
        answer = linkage(folder, 'simulate', 'sine.yaml', *typed, '-o', 'study.xlsx')
        assert answer.returncode == 0, answer.stderr
        (table,) = sheets_of(folder / 'study.xlsx').values()
        tables.append(table)
    (heads, *rows), (heads_in_mm, *rows_in_mm) = tables
    place, place_in_mm = (
        heads.index('press_slide most [m]'),
        heads_in_mm.index('press_slide most [mm]'),
    )
    for row, row_in_mm in zip(rows, rows_in_mm, strict=True):
        assert float(str(row_in_mm[place_in_mm])) == pytest.approx(1e3 * float(str(row[place])))


SLIDING = """
links: {{ground: {{O: [0, 0]}},
  crank: {{O: [0, 0], A: [{r}, 0]}}, rod: {{A: [0, 0], B: [{l}, 0]}}}}
sliders: {{press: {{point: B, along: ground, through: O, direction: [1, 0]}}}}
assembly: {{A: left}}
input: {{joint: press_slide, slider: press, limits: [{low}, {high}]}}
joints: {{crank_joint: {{parent: ground, child: crank}}}}
traced: [A]
"""


@pytest.mark.sample(3)
@pytest.mark.parametrize('unit', ['cm', 'mm', 'in'])
@pytest.mark.parametrize(
    'typed',
    [
        'draw x.yaml -o x.svg --at {far}',
        'solve x.yaml --joint A.x={far}',
        'solve x.yaml --joint crank_joint=170',
        'solve x.yaml --at {far}',
    ],
)
def test_error_messages_have_the_units_of_the_file(tmp_path: Path, typed: str, unit: str) -> None:
    """Each length in the line, whichever part of the package wrote it."""
    per_metre = {'m': 1.0, 'cm': 100.0, 'mm': 1000.0, 'in': 1.0 / 0.0254}
    lines = {}
    for name in ('m', unit):
        sizes = {'r': 0.0508, 'l': 0.127, 'low': 0.1016, 'high': 0.1524, 'far': 2.54}
        told = {key: f'{size * per_metre[name]:.10g}' for key, size in sizes.items()}
        (tmp_path / 'x.yaml').write_text(f'units: {name}\n{SLIDING.format(**told)}')
        lines[name] = linkage(tmp_path, *typed.format(**told).split(), '--force').stderr
    lengths = {
        name: [float(one) for one in re.findall(rf'(?<![\w.])(-?\d[\d.]*) (?={name}\b|to)', line)]
        + [float(one) for one in re.findall(r'[\d.]+', ''.join(re.findall(r'\[(.*?)\]', line)))]
        for name, line in lines.items()
    }
    assert lengths['m'], lines
    assert lengths[unit] == pytest.approx(
        [length * per_metre[unit] for length in lengths['m']], rel=1e-4
    )
    assert not re.search(r'\d m\b', lines[unit])


def unit_of_row(heads: Sequence[str | None], row: Sequence[str | None]) -> str:
    """Return the unit that a cell of a row names for the others; '' for none."""
    if 'unit' in heads:
        return str(row[heads.index('unit')])
    if 'quantity' in heads:
        return str(row[heads.index('quantity')]).partition('[')[2].rstrip(']')
    return ''


def leaves_of(account: Any) -> Iterator[float]:
    """Yield the numbers of a JSON account, in their order."""
    if isinstance(account, dict):
        account = [value for key, value in account.items() if key not in TOLD_OF_THE_BAG]
    if isinstance(account, list):
        for each in account:
            yield from leaves_of(each)
    elif isinstance(account, float):
        yield account
