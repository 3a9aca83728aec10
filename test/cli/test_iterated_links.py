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

"""What `linkage check` and `solve` say of links that are iterated: branch, range, assemblies."""

from __future__ import annotations

from pathlib import Path
import re

import pytest
import yaml

from .conftest import Run

DEFECTS = Path(__file__).parents[1] / 'kinematics' / 'defects'


def test_each_assembly_that_check_lists_is_a_pose_to_paste(linkage: Run, tmp_path: Path) -> None:
    text = (DEFECTS / 'class3_beyond_range.yaml').read_text('utf-8')
    answer = linkage('check', str(DEFECTS / 'class3_beyond_range.yaml'))
    assert (
        'Other assemblies of group 2 at the inputs of the pose: 3 found from 400' in answer.stdout
    )
    listed = re.findall(r'^\{inputs: .*\}\}', answer.stdout, re.MULTILINE)
    assert len(listed) == 3
    joints = []
    for number, pose in enumerate(['', *listed]):
        file = tmp_path / f'{number}.yaml'
        # The line `pose: …` of the file in the place of that which it has.
        changed = re.sub('^pose: .*$', f'pose: {pose}', text, flags=re.MULTILINE)
        file.write_text(changed if pose else text, 'utf-8')
        (at,) = yaml.safe_load(file.read_text('utf-8'))['pose']['inputs']
        solved = linkage('solve', str(file), '--radians', f'--at={at!r}')
        cells = solved.stdout.splitlines()[1].split()
        assert cells[1] == 'closed', solved.stdout
        joints.append(tuple(cells[3:]))
    assert len(set(joints)) == 4


@pytest.mark.parametrize(
    ('name', 'said'),
    [
        ('class3_over_a_turn', '(-2.23619 rad) to 302.163° (5.27374 rad); each turn has poses'),
        ('class3_beyond_range', '(-6.25934 rad) to 27.105° (0.473075 rad); each turn has poses'),
        ('ref_11', '(1.8941 rad) to 108.619° (1.89576 rad)\n'),
    ],
)
def test_check_names_the_range_of_the_branch(linkage: Run, name: str, said: str) -> None:
    """The ends are those of a walk in small steps over other equations: `test_branches.py`."""
    answer = linkage('check', str(DEFECTS / f'{name}.yaml'))
    assert answer.returncode == 0, answer.stderr
    assert said in answer.stdout


def test_solve_goes_from_toggle_to_toggle_of_more_than_a_turn(linkage: Run) -> None:
    file = str(DEFECTS / 'class3_over_a_turn.yaml')
    answer = linkage('solve', file, '--radians', '--steps', '60')
    rows = [line.split() for line in answer.stdout.splitlines()[1:]]
    assert [row[1] for row in rows] == ['toggle', *['closed'] * 59, 'toggle']
    assert float(rows[-1][0]) - float(rows[0][0]) > 7.5


def test_solve_is_open_beyond_the_range_that_check_names(linkage: Run) -> None:
    file = str(DEFECTS / 'class3_beyond_range.yaml')
    answer = linkage(
        'solve', file, '--radians', '--at', '6.75324', '--at', '0.47', '--at', '0.4731'
    )
    rows = [line.split() for line in answer.stdout.splitlines()[1:]]
    assert [row[1] for row in rows] == ['open', 'closed', 'open']
