# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``linkage simulate``: a bag that replays to the bit, a table of it, and what is refused."""

from __future__ import annotations

import csv
from pathlib import Path
import subprocess
import sys

from linkage_ros.bag import read_bag
from linkage_ros.cli.main import main
from linkage_ros.description import load_scene
from linkage_ros.errors import RecordingError
from linkage_ros.messages import JointStateReader
from linkage_ros.replay import BEGIN, simulate as simulated_run, simulate_run
from linkage_ros.tick import Pipeline
import pytest

LINKAGES = Path(__file__).parents[2] / 'config' / 'linkages'


def messages_of(folder):
    return list(read_bag(folder).messages())


# A scene each for what a run records: draws, faults, ticks without a message, further topics.
SCENES = {
    'under torque, with friction': 'torque_crank',
    'with faults': """
linkage: LINKAGES/four_bar.yaml
rate: 200
drive: {sine: {amplitude: 0.7, frequency: 1.5}}
effects: {velocity: {}, noise: {joints: {rocker_joint: {white: 0.001}}}, markers: {rate: 30}}
faults:
  stuck: {freeze: {}, at: [0.2, 0.7], seconds: 0.1}
  jump: {time_jump: {by: -0.05}, at: [0.5], seconds: 0.1}
""",
    'with all of a bench together': """
linkage: limited.yaml
rate: 250
drive:
  torque:
    start: 1.0
    rate: 12
    motor: {torque_constant: 0.02, resistance: 1.5, ratio: 10, efficiency: 0.8, command: voltage,
            inductance: 0.01}
    play: {width: 0.01, inertia: 1.0e-3, restitution: 0.4}
    motor_encoder: {counts: 2048}
loads:
  gravity: [0, -9.81]
  drive_inertia: 1.0e-3
  joint_springs: {coupler_joint: {stiffness: 0.02, free: -1, damping: 1.0e-4}}
  stops: {rocker_joint: {stiffness: 40, damping: 0.02}}
  efforts: {crank_joint: {over_time: [[0, 0], [0.5, 0.2]], over_rate: [[-30, 0.1], [30, -0.1]]}}
  forces: {coupler.P: {direction: [0, -1], constant: 0.3, over_position: [[0, 0], [3, 1]]}}
effects:
  velocity: {}
  effort: {}
  pin_forces: {}
  friction:
    joints:
      A: {coefficient: 0.1, radius: 0.003}
      B: {coulomb: 0.002, breakaway: 0.004, stribeck: 2}
  noise:
    joints:
      rocker_joint: {density: 1.0e-5, drift: 0.001, correlation_time: 0.2, effort_white: 0.01}
  encoder: {joints: {crank_joint: {counts: 4096, multi_turn: true}}, cutoff: 40}
""",
    'with ticks that a delay and a dropout withhold': """
linkage: LINKAGES/four_bar.yaml
rate: 100
drive: {constant_rate: {rate: 3}}
effects: {dropout: {probability: 0.3}, delay: {seconds: 0.05}, rate_limit: {rate: 40}}
""",
}


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', SCENES)
def test_simulated_bag_replays_to_the_same_bytes(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    text = SCENES[name]
    if '\n' in text:
        Path('scene.yaml').write_text(text.replace('LINKAGES', str(LINKAGES)))
        four_bar = (LINKAGES / 'four_bar.yaml').read_text()
        free, limited = 'child: rocker}', 'child: rocker, limits: [1.1, 2.1]}'
        Path('limited.yaml').write_text(four_bar.replace(free, limited))
    scene = 'scene.yaml' if '\n' in text else text
    assert main(['simulate', scene, '--seconds', '1.2', '-o', 'bag']) == 0
    assert main(['replay', 'bag']) == 0
    assert 'identical' in capsys.readouterr().out
    assert main(['simulate', scene, '--seconds', '1.2', '-o', 'again']) == 0
    once, twice = (messages_of(Path(folder)) for folder in ('bag', 'again'))
    assert once == twice
    assert once


def test_simulated_ticks_equal_the_pipeline_at_whole_nanoseconds(tmp_path):
    scene = load_scene('torque_crank', ['rate=300'])
    simulate_run(scene, tmp_path / 'bag', 7, lambda _: True)
    pipeline = Pipeline(scene)
    expected = []
    for index in range(7):
        now = BEGIN + round(index * 1e9 / 300.0)
        expected.append((now, pipeline.tick(now).message))
    found = [
        (log_time, data)
        for topic, log_time, _, data in messages_of(tmp_path / 'bag')
        if topic == '/joint_states'
    ]
    assert found == expected


def test_simulated_table_holds_the_ticks_of_the_bag(tmp_path):
    file = tmp_path / 'run.csv'
    assert main(['simulate', 'torque_crank', '--seconds', '0.03', '-o', str(file)]) == 0
    assert (
        main(['simulate', 'torque_crank', '--seconds', '0.03', '-o', str(tmp_path / 'bag')]) == 0
    )
    reader = JointStateReader(['crank_joint'])
    states = [reader.read(data) for *_, data in messages_of(tmp_path / 'bag')]
    with file.open(newline='') as lines:
        rows = list(csv.DictReader(lines))
    assert len(rows) == 31
    assert float(rows[-1]['time [s]']) == 0.03
    for row, state in zip(rows, states, strict=True):
        assert float(row['crank_joint [rad]']) == state.angles[0]
        assert float(row['crank_joint rate [rad/s]']) == state.rates[0]


def test_simulate_does_not_import_rclpy(tmp_path):
    check = (
        'import sys; from linkage_ros.cli.main import main; '
        f'main(["simulate", "torque_crank", "--seconds", "0.1", "-o", {str(tmp_path / "b")!r}]); '
        'assert "rclpy" not in sys.modules'
    )
    subprocess.run([sys.executable, '-c', check], check=True, timeout=60, capture_output=True)


REFUSED = {
    ('demo', '-o', 'x'): 'drive: topic waits for samples',
    ('jansen_leg', '-o', 'x'): 'drive: topic waits for samples',
    ('torque_crank', '--set', 'rate=0', '-o', 'x'): 'torque has none; name a rate',
    (
        'torque_crank',
        '-o',
        'x.txt',
    ): "ends in '.txt'; name a file that ends in .csv or .xlsx",
    ('torque_crank', '-o', 'there'): 'there: exists already',
    ('torque_crank', '-o', 'x', '--seconds', '1e9'): 'more than 100,000,000',
    ('torque_crank', '-o', 'x', '--seconds', '-1'): '-1 is not between 0 and 1e+09',
    ('torque_cranc', '-o', 'x'): 'torque_crank',
    ('torque_crank', '-o', 'x.csv', '--set', 'loads.efforts.crank_joint.over_time=[[1, 1]]'): (
        'has one row'
    ),
    ('torque_crank', '--set', 'loads.wrenches.coupler={}', '-o', 'x'): (
        'loads.wrenches: wait for messages, and there are none; leave them out, or write forces'
    ),
}


@pytest.mark.parametrize('typed', REFUSED)
def test_simulate_refuses_wrong_arguments_in_one_line(tmp_path, monkeypatch, capsys, typed):
    monkeypatch.chdir(tmp_path)
    Path('there').mkdir()
    try:
        code = main(['simulate', *typed])
    except SystemExit as error:
        code = error.code
    assert code == 2
    (line,) = capsys.readouterr().err.strip().splitlines()[-1:]
    assert REFUSED[typed] in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ['there']


def test_stopped_simulation_keeps_its_ticks(tmp_path):
    scene = load_scene('torque_crank')
    asked = []
    simulate_run(
        scene, tmp_path / 'bag', 10_000, lambda number: asked.append(number) or number < 2000
    )
    kept = messages_of(tmp_path / 'bag')
    assert len(kept) == 2000
    assert asked == [*range(0, 2001, 50)]
    assert main(['replay', str(tmp_path / 'bag')]) == 0


def test_full_disk_ends_the_simulation_and_keeps_its_ticks(tmp_path, monkeypatch):
    class Full(simulated_run.BagWriter):
        def write(self, topic, log_time, publish_time, data):
            if log_time > BEGIN + 500_000_000:
                raise RecordingError(self.folder, 'the disk is full', 'make room')
            return super().write(topic, log_time, publish_time, data)

    monkeypatch.setattr(simulated_run, 'BagWriter', Full)
    assert main(['simulate', 'torque_crank', '-o', str(tmp_path / 'bag')]) != 0
    assert len(messages_of(tmp_path / 'bag')) == 501
