# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A stop never damages a bag: mcap's own reader finds in it what its index and metadata claim."""

from __future__ import annotations

import json
from pathlib import Path
import shutil
import subprocess
import sys

from mcap.reader import make_reader
import pytest
import yaml

from ..support.commands import environment, linkage
from ..support.sampling import sample_count

SIGNALS = 'SIGINT', 'SIGTERM', 'SIGHUP'

MOMENTS = sample_count(12, 3)
"""Writes within records at which each command is stopped, for each signal."""

INSTANTS = sample_count(6, 3)
"""Random instants at which each command is stopped."""

COMMANDS = {
    'simulate': ['simulate', 'demo.yaml', '--seconds', '{seconds}', '-o'],
    'replay': ['replay', '{source}', '--set', 'angles=wrapped', '-o'],
    'recover': ['recover', '{source}', '-o'],
}

SCENE = 'linkage: four.yaml\nrate: 1000\ndrive: {%s}\neffects: {velocity: {}}\n'

# A child for each case runs the command. At its n-th piece of a record, or after a time in [s],
# it gets the signal. It prints how many pieces there were.
DRIVER = """
import json, os, random, signal, sys, time
from mcap.data_stream import RecordBuilder
from linkage_ros.cli import main, simulate, replay, recover
import linkage_ros.stages.drives.steady_motion, linkage_ros.stages.effects.derivatives
command, cases = json.loads(sys.argv[1])
write = RecordBuilder.write
for target, name, number, delay in cases:
    inside, outside = os.pipe()
    pid = os.fork()
    if not pid:
        pieces = 0
        def piece(self, data):
            global pieces
            write(self, data)
            pieces += 1
            if pieces == number:
                signal.raise_signal(getattr(signal, name))
        RecordBuilder.write = piece
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.dup2(null, 2)
        code = main.main([*command, target])
        os.write(outside, str(pieces).encode() or b'0')
        os._exit(code)
    os.close(outside)
    if delay:
        time.sleep(delay)
        os.kill(pid, getattr(signal, name))
    _, status = os.waitpid(pid, 0)
    print(json.dumps([target, os.waitstatus_to_exitcode(status), int(os.read(inside, 9) or 0)]))
    os.close(inside)
"""


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('stopped')
    (folder / 'four.yaml').write_text('four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n')
    (folder / 'demo.yaml').write_text(SCENE % 'constant_rate: {rate: 6.0}')
    (folder / 'crank.yaml').write_text(SCENE % 'topic: {}')
    for name, seconds in (('short', 0.05), ('long', sample_count(8, 3))):
        made = linkage(
            folder, 'simulate', 'demo.yaml', '--seconds', f'{seconds}', '-o', f'{name}_run'
        )
        assert made.returncode == 0, made.stderr
        # Its joint states are the samples of a linkage that they drive.
        made = linkage(
            folder,
            *('replay', f'{name}_run', '--scene', 'crank.yaml'),
            *('--crank-topic', '/joint_states', '-o', name),
        )
        assert made.returncode == 0, made.stderr
    return folder


def stopped(
    folder: Path, command: str, size: str, cases: list[tuple[str, str, int, float]]
) -> list[tuple[str, int, int]]:
    """Run a command for each case; return its folder, exit code and pieces of records."""
    words = [
        word.format(source=size, seconds=0.05 if size == 'short' else 20.0)
        for word in COMMANDS[command]
    ]
    done = subprocess.run(  # noqa: PLW1510 (its errors are shown)
        [sys.executable, '-c', DRIVER, json.dumps([words, cases])],
        cwd=folder,
        env=environment(folder),
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return [tuple(json.loads(line)) for line in done.stdout.splitlines()]


def fault_of(bag: Path) -> str:
    """Return what is wrong with a bag, as mcap's reader finds; '' for nothing, or no bag."""
    if not bag.exists():
        return ''
    files = [*bag.glob('*.mcap')]
    if len(files) != 1:
        return f'{len(files)} files'
    try:
        with files[0].open('rb') as stream:
            reader = make_reader(stream)
            summary = reader.get_summary()
            there = sum(1 for _ in reader.iter_messages())
        claimed = summary.statistics.message_count
    except Exception as error:  # noqa: BLE001 (whatever it raises, the bag is unreadable)
        return f'unreadable: {error!r}'
    information = yaml.safe_load((bag / 'metadata.yaml').read_text())
    listed = information['rosbag2_bagfile_information']['message_count']
    return '' if claimed == there == listed else f'{there} messages, {claimed}, {listed} claimed'


def faults(folder: Path, done: list[tuple[str, int, int]]) -> list[tuple[str, str]]:
    found = [(target, fault) for target, *_ in done if (fault := fault_of(folder / target))]
    for target, *_ in done:
        shutil.rmtree(folder / target, ignore_errors=True)
    return found


@pytest.mark.sample(1)
@pytest.mark.parametrize('command', COMMANDS)
def test_stop_within_any_record_damages_no_bag(folder, command) -> None:
    ((target, code, pieces),) = stopped(folder, command, 'short', [('whole', 'SIGINT', 0, 0.0)])
    assert code == 0
    assert pieces > 5 * MOMENTS
    assert faults(folder, [(target, code, pieces)]) == []
    step = pieces / MOMENTS
    cases = [
        (f'{name}_{moment}', name, 1 + int((moment + shift / 3) * step), 0.0)
        for shift, name in enumerate(SIGNALS)
        for moment in range(MOMENTS)
    ]
    done = stopped(folder, command, 'short', cases)
    assert len(done) == len(cases)
    assert {code for _, code, _ in done} <= {0, 1}
    assert faults(folder, done) == []


@pytest.mark.sample(1)
@pytest.mark.parametrize('command', COMMANDS)
def test_stop_at_any_time_damages_no_bag(folder, command) -> None:
    cases = [
        (f'{SIGNALS[index % 3]}_{index}', SIGNALS[index % 3], 0, 0.05 + 0.15 * index)
        for index in range(INSTANTS)
    ]
    done = stopped(folder, command, 'long', cases)
    assert len(done) == len(cases)
    assert faults(folder, done) == []
