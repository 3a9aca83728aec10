# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Wrong input to ``linkage``: one line that names it, exit code 2, no traceback."""

from __future__ import annotations

import os
from pathlib import Path
import re
import socket
import subprocess
import sys

from linkage_ros.errors import LinkageError
import pytest

from .conftest import Run
from ..support.commands import environment
from ..support.scenes import closure_of


def test_ros_argument_without_its_value_is_refused(linkage: Run, tmp_path: Path) -> None:
    (tmp_path / 'x.yaml').write_text('linkage: four_bar\n')
    answer = linkage('run', 'x.yaml', '--ros-args', '-p')
    assert (answer.returncode, answer.stdout) == (2, '')
    assert '-p' in answer.stderr
    assert 'Traceback' not in answer.stderr


# A path that is no regular file is refused at once, by every command, in one line.


READS = {
    'check': ['check', 'FILE'],
    'solve': ['solve', 'FILE'],
    'draw': ['draw', 'FILE'],
    'compile': ['compile', '-o', 'x.c', 'FILE'],
    'urdf': ['urdf', 'FILE'],
    'mjcf': ['mjcf', 'FILE'],
    'fmu': ['fmu', '-o', 'x.fmu', 'FILE'],
    'scene': ['scene', 'FILE'],
    'simulate': ['simulate', '-o', 'x.csv', 'FILE'],
    'accuracy': ['accuracy', 'FILE'],
    'run': ['run', 'FILE'],
    'import': ['import', 'FILE'],
    'synthesize': ['synthesize', '--pairs', 'FILE'],
    'path': ['synthesize', '--path', 'FILE'],
    'replay': ['replay', 'bag', '--scene', 'FILE'],
    'linkage of a scene': ['scene', 'scene.yaml'],
    # Of a bag the folder, and what lies in it.
    'info: metadata': ['info', 'bag'],
    'recover: metadata': ['recover', 'bag'],
    'info: file': ['info', 'bag_of_one'],
}

KINDS = {'pipe': 'a pipe', 'socket': 'a socket', 'device': 'a device'}


@pytest.mark.sample(8)
@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('read', READS)
def test_commands_refuse_files_that_are_not_regular(
    linkage: Run, tmp_path: Path, read: str, kind: str
) -> None:
    for name in ('bag', 'bag_of_one'):
        (tmp_path / name).mkdir()
    (tmp_path / 'scene.yaml').write_text('linkage: odd\n')
    for place in ('odd', 'bag/metadata.yaml', 'bag_of_one/x_0.mcap'):
        make(kind, tmp_path / place)
    answer = linkage(*(word.replace('FILE', 'odd') for word in READS[read]))
    assert answer.returncode == 2
    (line,) = answer.stderr.splitlines()
    # Files of a bag, and those that a scene names, have words of their own for it.
    assert READS[read][-1] != 'FILE' or f'is {KINDS[kind]}, not a regular file' in line


def make(kind: str, place: Path) -> None:
    if kind == 'pipe':
        os.mkfifo(place)
    elif kind == 'device':
        place.symlink_to('/dev/zero')
    else:
        with socket.socket(socket.AF_UNIX) as end:
            # The name of a socket has room for a hundred letters.
            folder = os.open(place.parent, os.O_RDONLY)
            end.bind(f'/proc/self/fd/{folder}/{place.name}')
            os.close(folder)


# A missing package: one line that says how to install it, exit code 2.


COMMAND = 'from linkage_ros.cli.main import main'


NEED_BAGS = (
    ['run', 'x.yaml'], ['demo'], ['plot', 'bag'], ['info', 'bag'],
    ['report', 'bag'], ['export', 'bag', '-o', 'x.csv'], ['recover', 'bag'], ['replay', 'bag'],
    ['scene', 'bag.yaml'], ['accuracy', 'x.yaml', '--only', 'recording'],
)  # fmt: skip


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / 'four.yaml').write_text('four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n')
    (tmp_path / 'x.yaml').write_text('linkage: four.yaml\n')
    (tmp_path / 'bag.yaml').write_text('linkage: four.yaml\ndrive: {bag: {file: bag}}\n')
    return tmp_path


def without(
    package: str, folder: Path, program: str, *arguments: str
) -> subprocess.CompletedProcess[str]:
    """Run a program as if a package were not installed."""
    return subprocess.run(
        [
            sys.executable,
            '-c',
            f'import sys; sys.modules[{package!r}] = None; {program}; sys.exit(main())',
            *arguments,
        ],
        cwd=folder,
        env=environment(folder),
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


@pytest.mark.sample(3)
@pytest.mark.parametrize('typed', NEED_BAGS, ids=' '.join)
def test_bag_commands_without_mcap_name_what_to_install(folder, typed) -> None:
    answer = without('mcap', folder, COMMAND, *typed)
    assert (answer.returncode, answer.stdout) == (2, '')
    (line,) = answer.stderr.splitlines()
    assert line.startswith(
        f'linkage {typed[0]}: mcap: is not installed; python3 -m pip install mcap '
    )


def test_check_works_without_mcap(folder) -> None:
    answer = without('mcap', folder, COMMAND, 'check', 'four.yaml')
    assert answer.returncode == 0, answer.stderr


def test_run_without_ros_names_what_to_install(folder) -> None:
    answer = without('diagnostic_msgs', folder, COMMAND, 'run', 'x.yaml')
    assert answer.returncode == 2
    (line,) = answer.stderr.splitlines()
    assert line == (
        'linkage run: diagnostic_msgs: is not installed; '
        "source the setup.bash of ROS 2, or pip install 'linkage_ros[ros]'"
    )


# Hostile files: each gives a full answer or one line.


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
    (f'{LONG}: 1\n', 'scene', 'has a misplaced colon'),
    (f'linkage: {LONG}\n', 'scene', 'is not a file'),
    (f'{LONG}\n', 'check', 'holds'),
    ((ATTACKS / 'pins_in_one_place.yaml').read_text(), 'check', "'E' lies 4.94e-324 m from 'J'"),
    *[
        (TINY, command, "'A' lies 4.94e-324 m from 'O2'")
        for command in ('check', 'solve', 'urdf', 'mjcf', 'scene')
    ],
]


@pytest.mark.sample(5)
@pytest.mark.parametrize(('file', 'content', 'command'), ANSWERED)
def test_check_mjcf_and_scene_answer_degenerate_linkages(
    linkage: Run, tmp_path: Path, file: str, content: str, command: str
) -> None:
    if content:
        (tmp_path / file).write_text(content)
    answer = linkage(command, file)
    assert answer.returncode == 0
    # Lengths that look like another unit get a note.
    assert all(': note: ' in line for line in answer.stderr.splitlines())
    assert 'nan' not in answer.stdout
    assert 'inf times' not in answer.stderr


@pytest.mark.sample(3)
@pytest.mark.parametrize(('content', 'typed', 'named'), REFUSED)
def test_oversized_or_degenerate_files_are_refused_in_one_line(
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


@pytest.mark.sample(6)
@pytest.mark.parametrize('file', LINKAGES, ids=lambda file: file.stem)
def test_nearly_coincident_points_are_solved_or_refused(file: Path) -> None:
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
