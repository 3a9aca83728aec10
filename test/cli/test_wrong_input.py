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


"""Wrong input to ``linkage``: one line that names it, exit code 2, no traceback."""

from __future__ import annotations

from pathlib import Path

import pytest

from .conftest import Run

BAD = [
    # what is typed, what the answer names
    ([], 'COMMAND'),
    (['runn'], 'runn'),
    (['run'], 'scene'),
    (['run', 'missing.yaml'], 'missing.yaml: cannot be read'),
    (['run', '.'], '.: cannot be read'),
    (['run', 'bad.yaml'], "bad.yaml:1: lnkage: unknown key; did you mean 'linkage'?"),
    (['run', 'x.yaml', '--seconds', '-1'], '-1'),
    (['run', 'x.yaml', '--seconds', 'soon'], 'soon'),
    (['run', 'x.yaml', '--seconds', 'nan'], 'nan'),
    (['run', 'x.yaml', '--ros-args', '-p', 'autostart:=7'], 'autostart'),
    (['run', 'x.yaml', '--ros-args', '-p'], '-p'),
    (['plot'], 'bag'),
    (['plot', 'nothing'], 'nothing: does not exist'),
    (['plot', 'text.mcap'], 'text.mcap: starts with'),
    (['demo', '--seconds', '0'], '0'),
]


@pytest.mark.parametrize(('typed', 'named'), BAD, ids=[' '.join(row[0]) or '-' for row in BAD])
def test_wrong_input_is_answered_in_a_line(
    linkage: Run, tmp_path: Path, typed: list[str], named: str
) -> None:
    (tmp_path / 'four.yaml').write_text('four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n')
    (tmp_path / 'x.yaml').write_text('linkage: four.yaml\n')
    (tmp_path / 'bad.yaml').write_text('lnkage: four.yaml\nlinkage: four.yaml\n')
    (tmp_path / 'text.mcap').write_text('no bag at all')
    answer = linkage(*typed)
    assert answer.returncode == 2
    assert named in answer.stderr
    assert 'Traceback' not in answer.stderr
    assert answer.stdout == ''


def test_help_names_every_command(linkage: Run) -> None:
    answer = linkage('--help')
    assert answer.returncode == 0
    assert all(command in answer.stdout for command in ('run', 'demo', 'plot'))


@pytest.mark.parametrize('command', ['run', 'demo', 'plot'])
def test_every_command_explains_itself(linkage: Run, command: str) -> None:
    answer = linkage(command, '--help')
    assert answer.returncode == 0
    assert answer.stdout.startswith(f'usage: linkage {command}')
