# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage demo``: the whole of it, ended by its time and by Ctrl-C at any moment."""

from __future__ import annotations

from math import radians
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import time

import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores

from .conftest import on_terminal, Run
from ..support.commands import environment

pytestmark = pytest.mark.ros

PNG = b'\x89PNG\r\n\x1a\n'


def messages(folder: Path) -> dict[str, int]:
    """Return how many messages a bag has, by topic, all of them read."""
    with AnyReader([folder], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        counts = dict.fromkeys((c.topic for c in reader.connections), 0)
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
            counts[connection.topic] += 1
    return counts


def only_bag(runs: Path) -> Path:
    (bag,) = (path for path in runs.iterdir() if path.is_dir())
    return bag


def test_demo_runs_records_replays_and_draws(linkage: Run, tmp_path: Path) -> None:
    answer = linkage('demo', '--seconds', '4')
    assert answer.returncode == 0, answer.stderr
    bag = only_bag(tmp_path / 'runs')
    counts = messages(bag)
    assert counts['/joint_states'] > 100  # as soon as the crank is heard
    assert counts['/crank_states'] > 50
    assert counts['/diagnostics'] >= 3

    told = answer.stdout
    assert f'/joint_states: {counts["/joint_states"]} of {counts["/joint_states"]}' in told
    same, of = map(int, re.search(r'(\d+) of (\d+) joint states replay', told).groups())
    assert same == of == counts['/joint_states']
    residual = float(re.search(r'worst loop residual (\S+) m', told).group(1))
    assert residual < 1e-15
    for row in ('ticks', 'lateness', 'published', 'samples', 'ticks/s'):
        assert row in told
    picture = Path(f'{bag}.png')
    assert str(picture.relative_to(tmp_path)) in told
    assert picture.read_bytes().startswith(PNG)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ('name', 'beside', 'topic'),
    [
        ('demo', 'crank_source', '/crank_states'),
        ('torque_crank', 'pd_controller', '/crank_commands'),
    ],
)
def test_duration_of_a_demo_starts_at_the_first_message(
    tmp_path: Path, name: str, beside: str, topic: str
) -> None:
    # The process beside it begins late, as on a busy machine.
    (tmp_path / 'sitecustomize.py').write_text(
        'import sys, time\n'
        f"if 'linkage_ros.node.{beside}' in sys.orig_argv:\n"
        '    time.sleep(4.0)\n'
    )
    answer = subprocess.run(
        [sys.executable, '-m', 'linkage_ros', 'demo', name, '--seconds', '1', '--plain'],
        cwd=tmp_path,
        env={**environment(tmp_path), 'PYTHONPATH': str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    same, of = map(int, re.search(r'(\d+) of (\d+) joint states replay', answer.stdout).groups())
    assert same == of > 50
    assert messages(only_bag(tmp_path / 'runs'))[topic] > 50


def test_controller_moves_the_crank_of_a_torque_scene(linkage: Run, tmp_path: Path) -> None:
    answer = linkage('demo', 'torque_crank', '--seconds', '4')  # a busy machine begins late
    assert answer.returncode == 0, answer.stderr
    bag = only_bag(tmp_path / 'runs')
    counts = messages(bag)
    assert counts['/crank_commands'] > 200
    same, of = map(int, re.search(r'(\d+) of (\d+) joint states replay', answer.stdout).groups())
    assert same == of == counts['/joint_states']
    shown = re.findall(r'crank_joint (-?\d+\.\d+)°', answer.stdout)
    # Without commands it stands at 0.5; the controller swings it by 1 about 2.0.
    assert max(radians(float(angle)) for angle in shown) > 0.55
    assert Path(f'{bag}.png').read_bytes().startswith(PNG)


def test_controller_moves_both_motors_of_the_ankle(linkage: Run, tmp_path: Path) -> None:
    answer = linkage('demo', 'torque_ankle', '--seconds', '3')
    assert answer.returncode == 0, answer.stderr
    assert 'several publishers' not in answer.stderr
    bag = only_bag(tmp_path / 'runs')
    counts = messages(bag)
    same, of = map(int, re.search(r'(\d+) of (\d+) joint states replay', answer.stdout).groups())
    assert same == of == counts['/joint_states']
    assert Path(f'{bag}.png').read_bytes().startswith(PNG)

    commands, states = [], []
    with AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        for connection, _, data in reader.messages():
            if connection.topic == '/crank_commands':
                commands.append(reader.deserialize(data, connection.msgtype))
            elif connection.topic == '/joint_states' and len(commands) > 150:  # no longer sinking
                states.append(reader.deserialize(data, connection.msgtype))
    assert {tuple(command.name) for command in commands} == {('m1', 'm2')}
    assert states[0].name == ['m1', 'm2', 'pitch', 'roll']
    # Whatever 2 s of the swings these are.
    for joint, least in enumerate((0.2, 0.2, 0.05, 0.1)):
        values = [state.position[joint] for state in states]
        assert max(values) - min(values) > least, states[0].name[joint]
    for motor in (0, 1):
        assert max(abs(state.effort[motor]) for state in states) > 0.1


def test_scene_with_its_own_drive_needs_no_crank_source(linkage: Run, tmp_path: Path) -> None:
    answer = linkage('demo', 'worn_press', '--seconds', '2')
    assert answer.returncode == 0, answer.stderr
    assert 'samples' not in answer.stdout
    proof = re.search(r'(\d+) of (\d+) joint states and (\d+) of (\d+) pin_forces', answer.stdout)
    assert len(set(proof.groups())) == 1
    assert Path(f'{only_bag(tmp_path / "runs")}.png').read_bytes().startswith(PNG)


def test_scene_without_a_recorder_draws_no_picture(linkage: Run, tmp_path: Path) -> None:
    answer = linkage('demo', 'bare', '--seconds', '2')
    assert answer.returncode == 0, answer.stderr
    assert re.search(r'samples +[1-9]', answer.stdout)
    assert 'picture   none: bare records no bag to draw' in answer.stdout
    assert not (tmp_path / 'runs').exists()


def test_demo_list_names_every_shipped_scene(linkage: Run) -> None:
    answer = linkage('demo', '--list')
    assert answer.returncode == 0, answer.stderr
    heading, *rows = answer.stdout.splitlines()
    assert heading.split() == ['scene', 'drive', 'recorded']
    shipped = sorted((Path(__file__).parents[2] / 'config' / 'scenes').glob('*.yaml'))
    assert [row.split()[0] for row in rows] == [file.stem for file in shipped]
    (torque,) = (row for row in rows if row.startswith('torque_crank'))
    assert torque.split(maxsplit=3)[1:3] == ['torque', 'yes']
    assert torque.endswith('the four-bar moves under the effort that a controller commands')
    assert not any('yaml-language-server' in row for row in rows)


def test_fault_drill_lists_its_faults_and_outlasts_them(linkage: Run) -> None:
    answer = linkage('demo', 'fault_drill', '--plain')
    assert answer.returncode == 0, answer.stderr
    first, faults = answer.stdout.splitlines()[:2]
    assert first.startswith('fault_drill: 10.5 s; ')  # the last one ends at 7.5 s
    assert faults == (
        'faults    hung_driver (freeze) at 2 s for 0.5 s; worn_gear (stuck) at 3 s for 0.5 s; '
        'snapped_coupler (broken_link) at 4 s for 0.5 s; pulled_cable (silence) at 5 s for 0.5 s; '
        'bad_crank (not_a_number) at 6 s for 0.5 s; clock_set (time_jump) at 7 s for 0.5 s; '
        'loose_plug (silence) by service call'
    )


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('name', 'after'),
    [
        *(('demo', after) for after in (0.05, 0.4, 0.8, 1.2, 2.0)),
        *(('torque_crank', after) for after in (0.6, 2.0)),
    ],
)
def test_ctrl_c_leaves_no_unfinished_bag(tmp_path: Path, name: str, after: float) -> None:
    demo = subprocess.Popen(
        [sys.executable, '-m', 'linkage_ros.cli.main', 'demo', name, '--seconds', '30'],
        cwd=tmp_path,
        env=environment(tmp_path),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    begun = demo.stdout.readline()  # from here on, signals are the program's own
    assert 'ROS_DOMAIN_ID' in begun
    time.sleep(after)
    os.killpg(demo.pid, signal.SIGINT)  # as a terminal does: to the crank's process as well
    told, _ = demo.communicate(timeout=30)
    # Before there is a node to end, there is nothing to tell of it.
    stopped = told.endswith('linkage demo: stopped\n')
    assert demo.returncode == int(stopped), told
    assert 'Traceback' not in told
    if (tmp_path / 'runs').exists():
        messages(only_bag(tmp_path / 'runs'))


def test_demo_shows_a_live_display_on_a_terminal(tmp_path: Path) -> None:
    shown = on_terminal(tmp_path, 'demo', '--seconds', '3')
    text = re.sub(r'\x1b\[[0-9;?]*[A-Za-z]', '', shown)
    assert '\x1b[' in shown
    for name in ('crank_joint', 'coupler_joint', 'rocker_joint', 'input age', 'lost', 'samples'):
        assert name in text
    assert 'joint states replay to the same bytes' in text
