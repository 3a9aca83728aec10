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


CRASH = """
import os
from pathlib import Path
import pytest

@pytest.mark.parametrize('number', range(4))
def test_it(number):
    been = Path('been')
    with been.open('a') as file:
        file.write(f'{number}')
    if been.read_text() == '01':
        os.abort()
"""


def test_file_whose_worker_crashed_runs_again_as_a_whole(tmp_path: Path) -> None:
    """The two tests after the crash have not run before; a new worker would wait for ever."""
    pytest.importorskip('xdist')
    (tmp_path / 'test_crash.py').write_text(CRASH)
    (tmp_path / 'test_good.py').write_text('def test_good(): pass\n')
    (tmp_path / 'pytest.ini').write_text('[pytest]\n')
    hook = Path(__file__).parents[1] / 'support' / 'crashed_workers.py'
    (tmp_path / 'conftest.py').write_text(hook.read_text('utf-8'))
    cache = 'build/pytest_nodes'
    by_file = ('-p', 'xdist', '-n', '2', '--dist', 'loadfile', '--max-worker-restart', '0')
    first = run(tmp_path, '-m', 'pytest', '-o', f'cache_dir={cache}', *by_file)
    assert (first.returncode, (tmp_path / 'been').read_text()) == (1, '01')
    answer = run(tmp_path, str(RUN_AGAIN), cache)
    assert answer.stdout.endswith('  test_crash.py::test_it[1]: passes alone\n')
    assert (answer.returncode, (tmp_path / 'been').read_text()) == (0, '010123')


def test_run_again_without_failures_prints_nothing(tmp_path: Path) -> None:
    (tmp_path / 'test_it.py').write_text('def test_good(): pass\n')
    run(tmp_path, '-m', 'pytest', '-q', '-o', 'cache_dir=build/pytest_rest')
    answer = run(tmp_path, str(RUN_AGAIN), 'build/pytest_rest', 'build/pytest_none')
    assert (answer.returncode, answer.stdout) == (0, '')
