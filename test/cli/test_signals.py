# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Signals end every command at any moment."""

from __future__ import annotations

from contextlib import suppress
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
import signal
import subprocess
import sys
import time

from mcap.writer import CompressionType, Writer
import pytest

from ..support.commands import environment

# SIGINT, SIGTERM and SIGHUP end every command at any moment: exit code 1, one line.


SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP

# Arguments and input of each command. Where a command computes, it closes loops.
PARSE = 'linkage_ros.description.yaml_file:parse_yaml'

READS = {
    'check': (['four.yaml'], PARSE),
    'solve': (['four.yaml', '-o', 'x.csv'], PARSE),
    'view': (['four.yaml', '-o', 'x.html'], PARSE),
    'draw': (['four.yaml', '-o', 'x.png'], PARSE),
    'animate': (['four.yaml', '-o', 'x.gif'], PARSE),
    'compile': (['four.yaml', '-o', 'x.c'], PARSE),
    'urdf': (['four.yaml', '-o', 'x.urdf'], PARSE),
    'mjcf': (['four.yaml', '-o', 'x.xml'], PARSE),
    'fmu': (['four.yaml', '-o', 'x.fmu'], PARSE),
    'scene': (['four.yaml'], PARSE),
    'simulate': (['four.yaml', '-o', 'x.csv'], PARSE),
    'accuracy': (['four.yaml', '-o', 'page.html'], PARSE),
    'demo': ([], PARSE),
    'import': (
        ['robot.urdf', '-o', 'x.yaml'],
        'linkage_ros.description.robot_file:read_urdf',
    ),
    'synthesize': (['--pairs', 'pairs.csv'], 'csv:reader'),
}

COMPUTE = (
    'check',
    'solve',
    'view',
    'draw',
    'animate',
    'compile',
    'urdf',
    'mjcf',
    'scene',
    'accuracy',
)

CLOSES = 'linkage_ros.kinematics.closure:Closure.position'

WRITES = 'os:fsync'

# The command, with a step that takes for ever and reports when it begins.
PROGRAM = """
import os, pkgutil, sys, time
from linkage_ros.cli.main import main
place, name = sys.argv.pop(1).rsplit(sys.argv.pop(1), 1)
owner = pkgutil.resolve_name(place)
def stuck(*_, **__):
    os.write(1, b'stuck')
    while True:
        time.sleep(0.01)
setattr(owner, name, stuck)
sys.exit(main())
"""

# An exception in a finalizer is lost: Python only prints it.
FINALIZER = """
import os, sys, time
from linkage_ros.cli.main import main
from linkage_ros.description import yaml_file
class Lost:
    def __del__(self):
        os.write(1, b'stuck')
        time.sleep(600.0)
def parse(*_):
    Lost()
    while True:
        time.sleep(0.01)
yaml_file.parse_yaml = parse
sys.exit(main())
"""

# A library takes whatever its import raises for an error of its own.
CONVERTED = """
import os, sys, time
from linkage_ros.cli import main
def load(*_):
    os.write(1, b'stuck')
    try:
        while True:
            time.sleep(0.01)
    except BaseException as error:
        raise RuntimeError('cannot load the library') from error
main.import_module = load
sys.exit(main.main())
"""

# The main thread waits for the stop event again and again, while signals keep coming.
STORM = """
import signal, time
from linkage_ros.signals import stop_on_signals
stop = stop_on_signals()
signal.signal(signal.SIGALRM, signal.getsignal(signal.SIGINT))
signal.setitimer(signal.ITIMER_REAL, 1e-3, 1e-3)
end = time.monotonic() + 1.5
while time.monotonic() < end:
    stop.wait(1e-6)
signal.setitimer(signal.ITIMER_REAL, 0.0)
assert stop.is_set() and stop.wait(60.0)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / 'four.yaml').write_text('four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n')
    (tmp_path / 'robot.urdf').write_text('<robot/>')
    (tmp_path / 'pairs.csv').write_text('1,2\n3,4\n5,7\n')
    return tmp_path


def start(folder: Path, program: str, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, '-c', program, *arguments],
        cwd=folder,
        env=environment(folder),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ended_by(process: subprocess.Popen[str], *numbers: signal.Signals) -> tuple[int, str]:
    """Return exit code and standard error of a process that was ended once it was stuck."""
    try:
        assert process.stdout is not None
        assert process.stdout.read(5) == 'stuck', process.communicate()[1]
        for number in numbers:
            process.send_signal(number)
        _, said = process.communicate(timeout=60)
    finally:
        process.kill()
    return process.returncode, said


def stuck_at(folder: Path, place: str, *arguments: str) -> subprocess.Popen[str]:
    separator = '.' if '.' in place.rpartition(':')[2] else ':'
    return start(folder, PROGRAM, place, separator, *arguments)


@pytest.mark.sample(3)
@pytest.mark.parametrize('number', SIGNALS)
@pytest.mark.parametrize('command', READS)
def test_signal_ends_a_command_while_it_reads(folder, command, number) -> None:
    typed, reads = READS[command]
    before = sorted(folder.iterdir())
    found = ended_by(stuck_at(folder, reads, command, *typed), number)
    assert found == (1, f'linkage {command}: stopped\n')
    assert sorted(folder.iterdir()) == before


@pytest.mark.sample(1)
@pytest.mark.parametrize('number', SIGNALS)
@pytest.mark.parametrize('at', [PARSE, 'linkage_ros.kinematics.closure:singular_inputs'])
def test_signal_ends_a_run_before_its_first_tick(folder, at, number) -> None:
    found = ended_by(stuck_at(folder, at, 'run', 'four.yaml', '--plain'), number)
    assert found == (1, 'linkage run: stopped\n')


@pytest.mark.sample(2)
@pytest.mark.parametrize('number', SIGNALS)
@pytest.mark.parametrize('command', COMPUTE)
def test_signal_ends_a_command_while_it_computes(folder, command, number) -> None:
    before = sorted(folder.iterdir())
    found = ended_by(stuck_at(folder, CLOSES, command, *READS[command][0]), number)
    assert found == (1, f'linkage {command}: stopped\n')
    assert sorted(folder.iterdir()) == before


@pytest.mark.sample(2)
@pytest.mark.parametrize('command', ['solve', 'draw', 'compile', 'fmu', 'urdf', 'mjcf'])
def test_command_stopped_while_writing_keeps_the_old_file(folder, command) -> None:
    typed, _ = READS[command]
    old = folder / typed[-1]
    old.write_text('old')
    before = sorted(folder.iterdir())
    found = ended_by(stuck_at(folder, WRITES, command, *typed, '--force'), signal.SIGTERM)
    assert found == (1, f'linkage {command}: stopped\n')
    assert sorted(folder.iterdir()) == before
    assert old.read_text() == 'old'


def test_repeated_signals_print_one_line(folder) -> None:
    found = ended_by(stuck_at(folder, CLOSES, 'check', 'four.yaml'), *SIGNALS, *SIGNALS)
    assert found == (1, 'linkage check: stopped\n')


def test_signal_within_a_finalizer_ends_the_command(folder) -> None:
    process = start(folder, FINALIZER, 'check', 'four.yaml')
    assert ended_by(process, signal.SIGTERM) == (1, 'linkage check: stopped\n')


def test_signal_wrapped_in_a_library_error_ends_the_command(folder) -> None:
    process = start(folder, CONVERTED, 'check', 'four.yaml')
    assert ended_by(process, signal.SIGTERM) == (1, 'linkage check: stopped\n')


def test_signal_ends_a_command_whose_output_is_not_read(folder) -> None:
    process = start(
        folder,
        'import sys; from linkage_ros.cli.main import main; sys.exit(main())',
        *('solve', 'four.yaml', '--steps', '5000', '--csv'),
    )
    try:
        wait_until_it_sleeps(process)
        process.terminate()
        assert process.wait(60) == 1
        assert process.stderr is not None
        assert process.stderr.read() == 'linkage solve: stopped\n'
    finally:
        process.kill()


def wait_until_it_sleeps(process: subprocess.Popen[str]) -> None:
    """Wait until a process waits for its pipe to be read."""
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        if 'pipe_write' in Path(f'/proc/{process.pid}/wchan').read_text():
            return
        if process.stdout is not None and process.poll() is not None:
            break
        time.sleep(0.05)
    pytest.skip('the kernel does not say where a process waits')


def test_repeated_signals_during_a_wait_cause_no_deadlock(folder) -> None:
    subprocess.run([sys.executable, '-c', STORM], cwd=folder, timeout=60, check=True)


# Ctrl-C also ends the search through a bag without an end, while the bag is opened.


SIZE = 50_000_000

MESSAGES = 30_000  # in a chunk

# Arguments beside the bag, and the output of the stopped command.
COMMANDS = {
    'info': ([], 'linkage info: stopped\n'),
    'replay': ([], 'linkage replay: stopped\n'),
    'plot': ([], 'linkage plot: stopped\n'),
    'report': (['-o', 'x.html'], 'linkage report: stopped\n'),
    'export': (['-o', 'x.csv'], 'linkage export: stopped; nothing was written\n'),
}


@pytest.fixture(scope='module')
def large(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return 50 MB of a recording that was killed: 1,300 million small messages, packed."""
    stream = BytesIO()
    writer = Writer(stream, chunk_size=2**24, compression=CompressionType.ZSTD)
    writer.start(profile='ros2')
    schema = writer.register_schema('std_msgs/msg/Empty', 'ros2msg', b'')
    channel = writer.register_channel('/t', 'cdr', schema)

    def chunk() -> None:
        for index in range(MESSAGES):
            writer.add_message(channel, 1, b'\0\1\0\0', 1, index)
        writer.flush()

    chunk()
    begin = stream.getvalue()
    chunk()
    again = stream.getvalue().removeprefix(begin)
    file = tmp_path_factory.mktemp('large') / 'large.mcap'
    with file.open('wb') as out:
        out.write(begin)
        for _ in range(SIZE // len(again)):
            out.write(again)
    return file


@pytest.mark.sample(1)
@pytest.mark.parametrize('command', COMMANDS)
def test_signal_ends_the_search_of_a_large_bag(tmp_path, large, command) -> None:
    typed, said = COMMANDS[command]
    process = subprocess.Popen(
        [sys.executable, '-m', 'linkage_ros.cli.main', command, str(large), *typed],
        cwd=tmp_path,
        env=environment(tmp_path),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        wait_until_read_from(process, large)
        process.send_signal(signal.SIGINT)
        # Searched to its end it would take many minutes.
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
    assert (process.returncode, out, err) == (1, '', said)
    assert not (tmp_path / 'x.csv').exists()


def wait_until_read_from(process: subprocess.Popen[str], file: Path) -> None:
    """Wait until a process is some way into a file."""
    folder = Path(f'/proc/{process.pid}')
    while process.poll() is None:
        with suppress(OSError):  # it closes files meanwhile
            for descriptor in (folder / 'fd').iterdir():
                if descriptor.readlink() == file:
                    said = (folder / 'fdinfo' / descriptor.name).read_text()
                    if int(said.split()[1]) > 2**20:
                        return
        time.sleep(0.01)
    pytest.fail('it has ended before it was told to')


STARTS = """
import os, signal, sys
class Interrupts:
    left = int(sys.argv.pop(1))
    first = 'linkage_ros.before_imports'
    def find_spec(self, name, path=None, target=None):
        self.left -= self.first in sys.modules and name != self.first
        if self.left == 0:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupts())
import importlib
program = importlib.import_module(sys.argv.pop(1))
print('imported')
sys.exit(program.main())
"""
"""Imports a program, and is interrupted at one of its imports; what Python does before is its."""

PROGRAMS = {
    'linkage_ros.__main__': ('solve', 'four_bar', '--at', '10'),
    **{
        f'linkage_ros.node.{name}': ('--help',)
        for name in ('linkage_node', 'linkage_relay', 'crank_source', 'pd_controller')
        if find_spec('rclpy')
    },
}


@pytest.mark.sample(2)
@pytest.mark.parametrize('program', PROGRAMS)
def test_signal_during_startup_shows_no_traceback(tmp_path, program):
    for number in (1, 2, 3, 5, 8, 13, 21, 34, 55, 89):
        done = subprocess.run(
            [sys.executable, '-c', STARTS, str(number), program, *PROGRAMS[program]],
            cwd=tmp_path, env=environment(tmp_path), capture_output=True, text=True, check=False,
            timeout=60,
        )  # fmt: skip
        assert 'Traceback' not in done.stderr
        assert 'Fatal' not in done.stderr
        assert len(done.stderr.splitlines()) <= 1
        if number == 1:  # before any handler of the program
            assert done.returncode == -signal.SIGINT


HANGS = """
import ctypes, sys, time
from linkage_ros import signals
signals._LONGEST_END, signals._LONGEST_GOODBYE = 0.2, 0.2
print('said')
with signals.bounded_end(2):
    eval(sys.argv[1])
"""


@pytest.mark.parametrize(
    ('hanging', 'code'),
    [
        ('time.sleep(30)', 2),
        # It holds the interpreter's lock, as a deadlock of the middleware may.
        ('ctypes.PyDLL(None).sleep(30)', -signal.SIGALRM),
        ('None', 0),
    ],
)
def test_hanging_shutdown_ends_with_the_exit_code(hanging, code):
    done = subprocess.run(
        [sys.executable, '-c', HANGS, hanging], capture_output=True, text=True, check=False,
        timeout=20,
    )  # fmt: skip
    assert done.returncode == code
    assert done.stdout == 'said\n' or code < 0
