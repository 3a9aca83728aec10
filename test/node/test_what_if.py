# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""
``linkage replay --set`` runs at the ticks of the run, so what differs is of the changed keys.

The runs are of a busy machine: ticks are lost, the next one takes all the messages that have come,
and each message is taken a little later. The reference offers the bag's messages to a pipeline of
its own, in their order, and ticks where the bag has a message of a tick.
"""

from collections.abc import Iterator
import json
from math import sin
from pathlib import Path
from random import Random
from typing import Any

from linkage_ros.bag import Bag, read_bag, Storage
from linkage_ros.cli import replay
from linkage_ros.description import load_scene, Scene
from linkage_ros.messages import JointStateWriter
from linkage_ros.tick import Pipeline
import pytest

from .conftest import LINKAGES
from .ticked import Moment, run
from ..cli.recorded import answer, rewritten
from ..support.messages import joint_state

MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000
TAKING = 4_000
"""Time from one message taken to the next, in [ns]."""

NOISE = 'noise: {joints: {coupler_joint: {white: 1.0e-3, walk: 1.0e-2}}}'
TORQUE = (
    'drive: {torque: {start: 0.5, step: 0.001, timeout: 0.05}}\n'
    'loads: {gravity: [0, -9.81]}\neffects: {velocity: {}, friction: {joints: {O2: %s}}}\n'
)
# The scene, and what --set changes of it.
SCENES = {
    'nothing remembers': ('effects: {velocity: {}}\n', 'max_lead=0.2'),
    'noise': (f'effects: {{{NOISE}}}\n', 'effects.noise.joints.coupler_joint.white=0.002'),
    'lost readings': ('effects: {dropout: {probability: 0.4}}\n', 'seed=5'),
    'a delay': ('effects: {delay: {seconds: 0.012, spread: 0.005}}\n', 'seed=5'),
    'play': ('effects: {backlash: {play: 0.3}}\n', 'effects.backlash.play=0.2'),
    'torque': (TORQUE % '{viscous: 0.001}', 'effects.friction.joints.O2.viscous=0.002'),
}
OPEN = 'double_rocker'  # closes from 0.64 to 1.77 rad: the motion below leaves it and comes back


def busy_moments(random: Random, joint: str, *, commands: bool) -> Iterator[Moment]:
    """Yield the ticks that a busy machine makes of 400, with the messages that each takes."""
    waiting: list[bytes] = []
    lost_until, silent_until = 0, 0
    write = JointStateWriter([joint]).write
    for index in range(400):
        now = BEGIN + index * MS + random.randrange(MS // 4)
        if index >= silent_until and random.random() < 0.9:
            angle = 1.2 + 0.7 * sin(0.03 * index)
            waiting.append(
                joint_state({joint: 0.2 * sin(0.05 * index)}, efforts=[0.2 * sin(0.05 * index)])
                if commands
                else write(now - MS // 7, [angle], [21.0])
            )
        if random.random() < 0.02:
            lost_until = index + random.choice([2, 7, 30])
        if random.random() < 0.01:
            silent_until = index + random.choice([20, 60])
        if index >= lost_until:
            yield Moment(now, tuple(waiting))
            waiting = []


def busy_run(folder: Path, text: str, linkage: str, seed: int) -> Bag:
    """Run a scene on a busy machine."""
    scene = folder / 'scene.yaml'
    scene.write_text(f'linkage: {LINKAGES}/{linkage}.yaml\nrate: 1000\nseed: 7\n{text}')
    (joint,) = load_scene(scene).linkages[0].input_names
    moments = busy_moments(Random(seed), joint, commands='torque' in text)
    return run(folder / 'bag', scene, moments, TAKING).bag


def what_if(capsys: pytest.CaptureFixture[str], bag: Bag, *settings: str) -> dict[str, Any]:
    capsys.readouterr()
    words = [word for setting in settings for word in ('--set', setting)]
    assert answer(replay, bag.path, *words, '--json') == 0
    account: dict[str, Any] = json.loads(capsys.readouterr().out)
    return account


def short(text: str) -> str:
    """Return a scene whose samples are soon too old."""
    return text if 'drive' in text else f'drive: {{topic: {{max_age: 0.02}}}}\n{text}'


CASES = [(name, linkage) for name in SCENES for linkage in ('four_bar', OPEN)
         if 'torque' not in name or linkage != OPEN]  # fmt: skip


@pytest.mark.sample(6)
@pytest.mark.parametrize(('name', 'linkage'), CASES)
@pytest.mark.parametrize('seed', range(2))
def test_set_to_the_recorded_value_replays_to_same_bytes(tmp_path, capsys, name, linkage, seed):
    bag = busy_run(tmp_path, short(SCENES[name][0]), linkage, seed)
    account = what_if(capsys, bag, 'seed=7')
    for topic in account['topics']:
        assert topic['recorded'] == topic['same'] > 30
        assert (topic['not_made_now'], topic['not_recorded']) == (0, 0)
    assert account['unchanged']['different_ticks'] == 0


def reference(bag: Bag, scene: Scene) -> list[bytes]:
    """Return the joint states of a scene on the messages of a bag, at the ticks that it holds."""
    pipeline, made, last = Pipeline(scene), [], 0
    for topic, log_time, time, data in bag.messages():
        if topic == '/crank':
            pipeline.offer(data, log_time)
        elif topic in ('/joint_states', '/withheld') and time != last:
            last = time
            made.append(pipeline.tick(time).message)
    return [message for message in made if message]


@pytest.mark.parametrize('name', ['noise', 'torque'])
@pytest.mark.parametrize('seed', range(3))
def test_changed_key_replays_as_its_own_pipeline(tmp_path, capsys, name, seed):
    text, setting = SCENES[name]
    bag = busy_run(tmp_path, text, 'four_bar', seed)
    what_if_bag = tmp_path / 'new'
    assert answer(replay, bag.path, '--set', setting, '-o', what_if_bag) == 0
    made = [m.data for m in read_bag(what_if_bag).messages() if m.topic == '/joint_states']
    expected = reference(bag, load_scene(tmp_path / 'scene.yaml', [setting]))
    assert made == expected
    assert made != [m.data for m in bag.messages() if m.topic == '/joint_states']


def test_replay_at_another_rate_prints_the_baseline_difference(tmp_path, capsys):
    bag = busy_run(tmp_path, SCENES['noise'][0], 'four_bar', 0)
    account = what_if(capsys, bag, 'rate=500')
    unchanged = account['unchanged']
    assert unchanged['different_ticks'] == unchanged['compared_ticks'] - 1 > 100
    greatest = unchanged['greatest'][0]['difference']
    assert greatest > 1e-3
    assert answer(replay, bag.path, '--set', 'rate=500') == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert first.endswith(f'ticks, by up to {greatest:.3g} rad (500 Hz instead of 1000 Hz)')


def test_replay_of_a_ring_reports_the_baseline_difference(tmp_path, capsys):
    bag = busy_run(tmp_path, SCENES['noise'][0], 'four_bar', 0)
    ring = rewritten(bag.path, 'ring', storage=Storage(split_seconds=0.1, keep_files=2))
    unchanged = what_if(capsys, read_bag(ring), 'seed=7')['unchanged']
    assert unchanged['different_ticks'] == unchanged['compared_ticks'] > 50
    assert 'messages were removed for newer ones' in unchanged['why']
