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

"""Files that were made to break a command: each is answered, in full or in one line."""

from __future__ import annotations

from pathlib import Path
import re

from linkage_ros.errors import LinkageError
import pytest

from .conftest import Run
from ..support.scenes import closure_of

ATTACKS = Path(__file__).parent / 'attacks'

TINY = 'four_bar: {a: 5e-324, b: 0.12, c: 0.08, d: 0.1}\n'
LONG = 'x' * 300_000
ANSWERED = [
    # file, its content, and what is typed before it
    *[(f'{ATTACKS}/never.yaml', '', command) for command in ('check', 'mjcf', 'scene')],
    *[(f'{ATTACKS}/no_loop.yaml', '', command) for command in ('check', 'mjcf', 'scene')],
    (f'{ATTACKS}/two_inputs_closed_nowhere.yaml', '', 'urdf'),
    (f'{ATTACKS}/range_of_rounding.yaml', '', 'scene'),
    *[(f'{ATTACKS}/bad_16917_mjcf.yaml', '', command) for command in ('check', 'mjcf', 'urdf')],
    *[('tiny.yaml', TINY, command) for command in ('check', 'solve', 'urdf', 'mjcf', 'scene')],
]
LINKS = ', '.join(f'l{i}: {{A: [0, 0]}}' for i in range(401))
POINTS = ', '.join(f'P{i}: [0, {i}]' for i in range(10_001))
REFUSED = [
    # content, what is typed before the file, what the answer names
    ('1,2\n3,' + '4' * 131_073 + '\n5,6\n', 'synthesize --pairs', 'line 2'),
    ('1,2\n3,"' + '4,\n' * 100_000, 'synthesize --pairs', 'line '),
    ('1e308,1\n-1e308,2\n0,3\n', 'synthesize --pairs', 'pair 1: 1e+308'),
    ('1,1\n2,-1e308\n0,3\n4,1e308\n', 'synthesize --pairs', 'pair 2: '),
    ('1,2\n' * 1001, 'synthesize --path', 'more than 1000 rows'),
    (f'links: {{{LINKS}}}\n', 'check', 'links: there are 401; write at most 400'),
    (f'links: {{ground: {{{POINTS}}}}}\n', 'check', 'links: have 10001 points'),
    (f'four_bar: {{a: {LONG}, b: 1, c: 1, d: 1}}\n', 'check', 'is not a number'),
    (f'links: {LONG}\n', 'check', 'is not a mapping'),
    (f'{LONG}: 1\n', 'scene', 'is not valid YAML'),
    (f'linkage: {LONG}\n', 'scene', 'is not a file'),
    (f'{LONG}\n', 'check', 'holds'),
    ((ATTACKS / 'pins_in_one_place.yaml').read_text(), 'check', 'has two pins in one place'),
]


@pytest.mark.parametrize(('file', 'content', 'command'), ANSWERED)
def test_a_linkage_at_an_end_of_what_there_is_is_answered(
    linkage: Run, tmp_path: Path, file: str, content: str, command: str
) -> None:
    if content:
        (tmp_path / file).write_text(content)
    answer = linkage(command, file)
    assert (answer.returncode, answer.stderr) == (0, '')
    assert 'nan' not in answer.stdout


@pytest.mark.parametrize(('content', 'typed', 'named'), REFUSED)
def test_a_file_without_measure_is_refused_in_a_line(
    linkage: Run, tmp_path: Path, content: str, typed: str, named: str
) -> None:
    (tmp_path / 'x').write_text(content)
    answer = linkage(*typed.split(), 'x')
    assert answer.returncode == 2
    (line,) = answer.stderr.splitlines()
    assert named in line
    assert len(line) < 1000
    assert answer.stdout == ''


BESIDE = re.compile(r'(\w+: \[[^]]*\]), (\w+): \[[^]]*\]')
"""Two points of a link."""

LINKAGES = [
    file
    for file in sorted((Path(__file__).parents[2] / 'config' / 'linkages').glob('*.yaml'))
    if BESIDE.search(file.read_text())
]


@pytest.mark.parametrize('file', LINKAGES, ids=lambda file: file.stem)
def test_points_that_are_hardly_apart_are_refused_in_a_line_or_solved(file: Path) -> None:
    """A point of a link is put next to another one, by the least that a number can be."""
    text = file.read_text()
    answers = []
    for found in BESIDE.finditer(text):
        one, name = found.groups()
        x, y = one.partition('[')[2].rstrip(']').split(', ')
        beside = f'{one}, {name}: [{x if float(x) else "5e-324"}, {y}]'
        changed = text.replace(found[0], beside)
        try:
            closure_of(changed)
            answers.append('')
        except LinkageError as error:
            answers.append(str(error))
    assert answers
    assert not any('\n' in answer for answer in answers)
