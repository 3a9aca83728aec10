# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Studies that are ended: by a kill of a process, by a stop, by runs that fail; and then go on."""

from __future__ import annotations

from functools import cache
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from linkage_ros.cli.main import main
from linkage_ros.errors import LinkageError
from linkage_ros.replay import study as study_module
import pytest

LINKAGES = Path(__file__).parents[2] / 'config' / 'linkages'
NOISY = f"""
linkage: {LINKAGES}/four_bar.yaml
rate: 1000
drive: {{constant_rate: {{rate: 2}}}}
effects: {{velocity: {{}}, noise: {{joints: {{rocker_joint: {{white: 0.001}}}}}}}}
"""
PATIENCE = 60.0
"""How long anything is waited for, in [s]."""


@pytest.fixture(autouse=True)
def _in_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path('noisy.yaml').write_text(NOISY)


def command(output, *options):
    return ['simulate', 'noisy.yaml', '--seconds', '1', '--seeds', '24', '-o', output, *options]


@cache
def uninterrupted():
    assert main(command('whole.csv', '--workers', '1')) == 0
    return Path('whole.csv').read_bytes()


def begun(*options):
    """Start a study in a process of its own; wait until three of its runs are on the disk."""
    study = started('worn.csv', *options)
    kept = Path('worn.csv.part')
    end = time.monotonic() + PATIENCE
    while not kept.exists() or kept.read_bytes().count(b'\n') < 4:
        assert study.poll() is None
        assert time.monotonic() < end
        time.sleep(0.01)
    return study, kept


def started(output, *options):
    program = 'import sys; from linkage_ros.cli.main import main; sys.exit(main(sys.argv[1:]))'
    return subprocess.Popen(
        [sys.executable, '-c', program, *command(output, *options)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def check_goes_on(kept, capsys):
    """Run the study again, and compare its table with that of one that was never ended."""
    lines = kept.read_bytes().count(b'\n') - 1
    assert 3 <= lines < 24
    assert not Path('worn.csv').exists()
    assert main(command('worn.csv', '--workers', '1')) == 0
    assert f'continues after {lines} of 24 runs, of worn.csv.part' in capsys.readouterr().err
    assert Path('worn.csv').read_bytes() == uninterrupted()
    assert not kept.exists()


@pytest.mark.skipif(sys.platform != 'linux', reason='reads the children of a process in /proc')
def test_a_killed_worker_loses_no_finished_run(capsys):
    study, kept = begun('--workers', '2')
    children = Path(f'/proc/{study.pid}/task/{study.pid}/children').read_text().split()
    os.kill(int(children[0]), signal.SIGKILL)
    _, said = study.communicate(timeout=PATIENCE)
    assert study.returncode == 2
    assert 'Traceback' not in said
    assert 'the study: one of its processes was killed; run the same command again' in said
    check_goes_on(kept, capsys)


@pytest.mark.sample(1)
@pytest.mark.parametrize('workers', ['1', '2'])
@pytest.mark.parametrize('ended_by', [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_stopped_study_continues_with_the_same_command(ended_by, workers, capsys):
    study, kept = begun('--workers', workers)
    study.send_signal(ended_by)
    _, said = study.communicate(timeout=PATIENCE)
    assert study.returncode == (-ended_by if ended_by == signal.SIGKILL else 1)
    assert 'Traceback' not in said
    if ended_by != signal.SIGKILL:
        assert 'runs are kept in worn.csv.part; the same command continues' in said
    check_goes_on(kept, capsys)


@pytest.fixture
def finished(monkeypatch):
    """Return the file of a study of three runs whose table could not be written, and its runs."""
    options = ['simulate', 'noisy.yaml', '--seconds', '0.1', '--seeds', '3', '--workers', '1']

    def fail(*_):
        raise LinkageError('the table', 'is not written', 'try again')

    with monkeypatch.context() as patched:
        patched.setattr('linkage_ros.cli.simulate._write_results', fail)
        assert main([*options, '-o', 'x.csv']) == 2
    return Path('x.csv.part'), [*options, '-o', 'x.csv']


def test_truncated_line_of_a_study_repeats_one_run(finished, capsys):
    kept, again = finished
    whole = kept.read_bytes()
    *_, last = whole.splitlines(keepends=True)
    tables = set()
    for cut in (0, 1, len(last) // 2, len(last) - 1):
        kept.write_bytes(whole[: len(whole) - len(last) + cut])
        assert main(again) == 0
        assert 'continues after 2 of 3 runs' in capsys.readouterr().err
        tables.add(Path('x.csv').read_bytes())
        Path('x.csv').unlink()
    kept.write_bytes(whole)
    assert main(again) == 0
    assert {Path('x.csv').read_bytes()} == tables


@pytest.mark.parametrize(
    'lines',
    [b'{}\n', b'[]\n', b'null\n', b'{"run": 99}\n', b'\xff\n', b'1' * 100_000, b'[' * 100_000],
)
def test_foreign_lines_in_a_study_file_are_ignored(lines, finished, capsys):
    kept, again = finished
    head = kept.read_bytes().splitlines(keepends=True)[0]
    kept.write_bytes(head + lines)
    assert main(again) == 0
    assert 'goes on' not in capsys.readouterr().err
    assert Path('x.csv').read_text().count('\n') == 4


@pytest.mark.parametrize(
    'other', ['--set=seed=3', '--seconds=0.2', '--seeds=4', '--sweep=rate=1,2']
)
def test_runs_of_another_study_are_refused(other, finished, capsys):
    kept, again = finished
    whole = kept.read_bytes()
    assert main([*again, other]) == 2
    assert 'x.csv.part: holds the runs of another study' in capsys.readouterr().err
    assert kept.read_bytes() == whole


def test_unexpected_exception_in_a_run_is_one_line(monkeypatch, capsys):
    def fail(*_):
        raise ZeroDivisionError('\x1b[2J')

    monkeypatch.setattr(study_module, '_reduce_run', fail)
    assert main(command('x.csv', '--workers', '1')) == 1
    *named, count = capsys.readouterr().err.splitlines()
    assert count == 'linkage simulate: 24 of 24 runs failed'
    assert all("unexpected ZeroDivisionError('" in line and line.isprintable() for line in named)
    assert not Path('x.csv.part').exists()


def test_study_that_fails_at_once_ends_its_processes():
    # Torn down while the interpreter ended, they wrote a traceback in one of some ten studies.
    for _ in range(6):
        study = started('x.csv', '--sweep', 'rate=-1,-2', '--seeds', '1', '--workers', '2')
        _, said = study.communicate(timeout=PATIENCE)
        assert study.returncode == 1
        # The reason, which both have, and how many failed
        assert said.count('\n') == 2, said


def test_study_does_not_write_through_a_symbolic_link(capsys):
    precious = Path('precious')
    precious.write_text('content')
    Path('worn.csv.part').symlink_to(precious)
    assert main(command('worn.csv', '--workers', '1')) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith('linkage simulate: worn.csv.part: cannot be read and written (')
    assert precious.read_text() == 'content'
