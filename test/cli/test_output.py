# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where the output goes: full, closed, or of few letters; and no room for temporary files."""

from pathlib import Path
import signal
import subprocess
import sys

import pytest

from ..support.commands import environment

COMMANDS = {
    'check': ['jansen_leg'],
    'gallery': [],
    'draw': ['four_bar'],
    'simulate': ['worn_press', '--seconds', '0.1', '-o', 'new'],
    'info': ['no_bag'],
}

LINKAGE = [sys.executable, '-m', 'linkage_ros']

# Output as the shell gives it to `linkage`.
PLACES = {
    'full': ('exec "$@" >/dev/full', {}),
    'full for errors, too': ('exec "$@" >/dev/full 2>/dev/full', {}),
    'closed': ('exec "$@" >&-', {}),
    'all closed': ('exec "$@" <&- >&- 2>&-', {}),
    'a reader that goes': ('"$@" | head -c 1', {}),
    'ASCII': ('exec "$@"', {'PYTHONIOENCODING': 'ascii'}),
    'Latin-1': ('exec "$@"', {'PYTHONIOENCODING': 'latin-1'}),
    'the locale C': ('exec "$@"', {'LC_ALL': 'C', 'PYTHONUTF8': '0', 'PYTHONCOERCECLOCALE': '0'}),
}


@pytest.mark.sample(3)
@pytest.mark.parametrize('place', PLACES)
@pytest.mark.parametrize('command', COMMANDS)
def test_commands_show_no_traceback_for_any_output(tmp_path, command, place) -> None:
    script, variables = PLACES[place]
    done = subprocess.run(
        ['sh', '-c', script, 'sh', *LINKAGE, command, *COMMANDS[command]],
        cwd=tmp_path,
        env=environment(tmp_path) | variables,
        capture_output=True,
        timeout=120,
        check=False,
    )
    said = done.stderr.decode('latin-1').splitlines()
    assert len(said) <= 1, said
    assert all(line.startswith(f'linkage {command}: ') for line in said)
    if command == 'info':
        assert done.returncode in ((0,) if 'reader' in place else (1, 2))
    elif place == 'full':
        assert done.returncode == 1
        assert said == [f'linkage {command}: the output: No space left on device']
    elif 'full' not in place:
        assert (done.returncode, said) == (0, [])


# No room for temporary files.
FULL = """
import errno, os, sys, tempfile
from linkage_ros.__main__ import main
def full(*_, **__):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), '/tmp/full')
tempfile.mkdtemp = full
sys.exit(main())
"""


def test_full_temporary_folder_is_reported_in_one_line(tmp_path: Path) -> None:
    words = ['simulate', 'worn_press', '--seconds', '0.1', '-o', 'x.csv']
    done = subprocess.run(
        [sys.executable, '-c', FULL, *words],
        cwd=tmp_path,
        env=environment(tmp_path),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr == 'linkage simulate: /tmp/full: No space left on device\n'
    assert not list(tmp_path.iterdir())


# A signal during an import; before `linkage` has begun, it is Python's own.
DURING = """
import signal, sys
name, number = sys.argv.pop(1), int(sys.argv.pop(1))
from linkage_ros.__main__ import main
class Finder:
    def find_spec(self, wanted, *_):
        if wanted == name:
            signal.raise_signal(number)
sys.meta_path.insert(0, Finder())
sys.modules.pop(name, None)
sys.exit(main())
"""

IMPORTED = (
    'linkage_ros.cli',
    'linkage_ros.cli.main',
    'argparse',
    'linkage_ros.errors',
    'linkage_ros.cli.terminal',
    'linkage_ros.cli.check',
    'linkage_ros.kinematics.plane.closure',
)


@pytest.mark.sample(7)
@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize('name', IMPORTED)
def test_signal_during_an_import_is_reported_in_one_line(tmp_path, name, number) -> None:
    done = subprocess.run(
        [sys.executable, '-c', DURING, name, str(int(number)), 'check', 'four_bar'],
        cwd=tmp_path,
        env=environment(tmp_path),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr in ('linkage: stopped\n', 'linkage check: stopped\n')
