# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A test that failed once is named at the end of `make test`; only one with nodes is forgiven."""

import os
from pathlib import Path
import subprocess
import sys

import pytest

RUN_AGAIN = Path(__file__).parents[1] / 'run_again.py'
TESTS = """
from pathlib import Path

def test_good(): pass

def test_by_chance():
    been = Path('been')
    first = not been.exists()
    been.touch()
    assert not first

def test_bad(): assert not Path('bad').exists()
"""


def run(folder: Path, *typed: str) -> 'subprocess.CompletedProcess[str]':
    return subprocess.run(
        [sys.executable, *typed],
        cwd=folder,
        env=os.environ | {'PYTEST_DISABLE_PLUGIN_AUTOLOAD': '1'},  # half of the time goes there
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize(('part', 'bad'), [('nodes', False), ('nodes', True), ('rest', False)])
def test_tests_that_failed_once_are_listed(tmp_path: Path, part: str, bad: bool) -> None:
    (tmp_path / 'test_it.py').write_text(TESTS)
    (tmp_path / 'pytest.ini').write_text('[pytest]\n')
    if bad:
        (tmp_path / 'bad').touch()
    cache = f'build/pytest_{part}'
    assert run(tmp_path, '-m', 'pytest', '-q', '-o', f'cache_dir={cache}').returncode == 1
    answer = run(tmp_path, str(RUN_AGAIN), cache)
    told = answer.stdout.partition('make: tests that failed once:\n')[2].splitlines()
    assert told == [
        '  test_it.py::test_by_chance: passes alone',
        *['  test_it.py::test_bad: failed again'] * bad,
    ]
    assert answer.returncode == int(bad or part == 'rest')


def test_run_again_without_failures_prints_nothing(tmp_path: Path) -> None:
    (tmp_path / 'test_it.py').write_text('def test_good(): pass\n')
    run(tmp_path, '-m', 'pytest', '-q', '-o', 'cache_dir=build/pytest_rest')
    answer = run(tmp_path, str(RUN_AGAIN), 'build/pytest_rest', 'build/pytest_none')
    assert (answer.returncode, answer.stdout) == (0, '')
