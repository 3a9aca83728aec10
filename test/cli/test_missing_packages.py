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

"""Where a package is missing that is needed: one line that says how to get it, exit code 2."""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys

import pytest

from .conftest import environment

COMMAND = 'from linkage_ros.cli.main import main'
NODE = 'from linkage_ros.ros.linkage_node import main'

NEED_BAGS = (
    ['run', 'x.yaml'], ['demo'], ['play', 'bag'], ['plot', 'bag'], ['info', 'bag'],
    ['report', 'bag'], ['export', 'bag', '-o', 'x.csv'], ['recover', 'bag'], ['replay', 'bag'],
    ['cost', 'x.yaml'], ['scene', 'bag.yaml'], ['accuracy', 'x.yaml', '--only', 'recording'],
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


@pytest.mark.parametrize('typed', NEED_BAGS, ids=' '.join)
def test_without_mcap_a_command_that_needs_bags_says_what_to_install(folder, typed) -> None:
    answer = without('mcap', folder, COMMAND, *typed)
    assert (answer.returncode, answer.stdout) == (2, '')
    (line,) = answer.stderr.splitlines()
    assert line.startswith(
        f'linkage {typed[0]}: mcap: is not installed; python3 -m pip install mcap '
    )


def test_without_mcap_the_node_is_not_configured_and_says_what_to_install(folder) -> None:
    answer = without('mcap', folder, NODE, '--ros-args', '-p', 'scene:=x.yaml')
    assert (answer.returncode, answer.stdout) == (2, '')
    (line,) = answer.stderr.splitlines()
    assert line.startswith('linkage_node: mcap: is not installed; python3 -m pip install mcap ')


def test_without_mcap_a_command_without_bags_works(folder) -> None:
    answer = without('mcap', folder, COMMAND, 'check', 'four.yaml')
    assert answer.returncode == 0, answer.stderr


def test_without_ros_a_run_says_how_to_get_it(folder) -> None:
    answer = without('diagnostic_msgs', folder, COMMAND, 'run', 'x.yaml')
    assert answer.returncode == 2
    (line,) = answer.stderr.splitlines()
    assert line == (
        'linkage run: diagnostic_msgs: is not installed; '
        "source the setup.bash of ROS 2, or pip install 'linkage_ros[ros]'"
    )
