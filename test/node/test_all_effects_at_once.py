# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Every drive, effect and fault of the effects page together, recorded, and replayed to the last bit.

A scene has one drive for each linkage, and some things exclude each other, so there are three:

- all effects and all faults on a crank that is measured;
- all effects on six linkages at once, each with a drive of its own, and all faults but
  `not_a_number`, which spoils messages, and most of these drives have none;
- all effects but `backlash` under `torque`, which excludes it, and all faults.

The replay runs in a process of its own too, with other hashes of texts.
"""

import hashlib
from itertools import pairwise
from math import cos, inf, sin
import os
from pathlib import Path
import subprocess
import sys

from linkage_ros.bag import BagWriter, Topic
from linkage_ros.description import load_scene
from linkage_ros.messages import JointStateWriter
from linkage_ros.replay import recorded_scene, replay_ticks
from linkage_ros.stages.drives import DRIVES
from linkage_ros.stages.effects import EFFECTS
from linkage_ros.stages.faults import FAULTS
import pytest

from .conftest import LINKAGES
from .ticked import Moment, run
from ..support.messages import wrench_stamped

MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000
TICKS = 1500
BACKLASH = '  backlash: {play: 0.01}\n'
ALL_EFFECTS = f"""effects:
  tolerance: {{standard_deviation: 2.0e-5}}
{BACKLASH}  velocity: {{}}
  acceleration: {{}}
  friction:
    joints:
      O2: {{viscous: 1.0e-4, coulomb: 0.002}}
      A: {{coulomb: 0.001, breakaway: 0.002, stribeck: 1.5}}
      B: {{viscous: 1.0e-4, coulomb: 0.001}}
      O4: {{coulomb: 0.002}}
  effort: {{}}
  pin_forces: {{}}
  compliance: {{links: {{coupler: 1.0e+6}}}}
  clearance: {{pins: {{A: 2.0e-5, B: 3.0e-5}}}}
  jitter: {{seconds: 3.0e-4, distribution: half_normal}}
  bias: {{joints: {{rocker_joint: 0.01}}, scales: {{rocker_joint: 0.001}}}}
  noise:
    joints:
      rocker_joint: {{white: 0.001, walk: 0.001, rate_white: 0.01, effort_white: 0.001}}
      coupler_joint: {{density: 1.0e-5, drift: 0.001, correlation_time: 0.1}}
  measuring_range: {{joints: {{rocker_joint: {{high: 2.2, effort: 1}}}}}}
  encoder:
    joints: {{crank_joint: {{counts: 4096}}, coupler_joint: {{counts: 4096}}}}
    cutoff: 90
  rate_limit: {{rate: 700, joints: {{coupler_joint: {{rate: 300, phase: 0.01}}}}}}
  dropout: {{probability: 0.1, burst: 3, joints: {{rocker_joint: {{probability: 0.2}}}}}}
  delay: {{seconds: 0.0025, joints: {{rocker_joint: {{seconds: 0.004, spread: 0.002}}}}}}
  markers: {{rate: 50}}
"""
LOADS = """loads:
  gravity: [0, -9.81]
  drive_inertia: 1.0e-4
  springs: {back: {from: ground.O4, to: coupler.B, stiffness: 20, free_length: 0.05, damping: 0.1}}
  joint_springs: {rocker_joint: {stiffness: 0.01, free: 1.5, damping: 1.0e-4}}
  efforts: {rocker_joint: {over_time: [[0, 0], [1, 0.02]], over_position: [[1, 0], [2, 0.01]]}}
  forces: {coupler.P: {direction: [0, -1], frame: link, over_rate: [[-9, 0.1], [9, -0.1]]}}
  wrenches: {rocker: {point: B, frame: link, max_age: 0.02}, coupler: {max_age: 0.1}}
"""
MOTOR = """\
drive:
  torque:
    start: 1.0
    timeout: 0.02
    motor: {torque_constant: 0.05, resistance: 2, inductance: 0.005, voltage: 24, ratio: 5,
            efficiency: 0.9, delay: 0.003}
    play: {width: 0.01, inertia: 1.0e-4, restitution: 0.3}
    motor_encoder: {counts: 2048}
"""
ALL_FAULTS = """faults:
  stuck: {stuck: {joint: rocker_joint}, at: [0.1, 1.2], seconds: 0.05}
  frozen: {freeze: {}, at: [0.2], seconds: 0.05}
  quiet: {silence: {}, at: [0.3], seconds: 0.05}
  broken: {broken_link: {link: coupler}, at: [0.4], seconds: 0.05}
  spoilt: {not_a_number: {}, at: [0.5], seconds: 0.05}
  ahead: {time_jump: {by: 0.02}, at: [0.6], seconds: 0.1}
  behind: {time_jump: {by: -0.015}, at: [0.8], seconds: 0.1}
"""
SPOILT = next(f'{line}\n' for line in ALL_FAULTS.splitlines() if 'not_a_number' in line)
ONE = f'linkage: {LINKAGES}/four_bar.yaml\n'
MANY = {
    'measured': 'topic: {acceleration: differenced, cutoff: 30}',
    'turning': 'constant_rate: {rate: 20}',
    'stepping': 'profile: {table: [[0, 0], [0.3, 2], [0.5, 2], [0.9, 0.5]], repeat: true}',
    'swinging': 'sine: {mean: 1, amplitude: 0.5, frequency: 3}',
    'sweeping': 'chirp: {mean: 1, amplitude: 0.5, start_frequency: 1, end_frequency: 9, '
    'seconds: 1.2}',
    'recorded': 'bag: {file: samples, repeat: true}',
}
SCENES = {
    'measured': f'{ONE}publish_input: true\nseed: 7\n'
    'drive: {topic: {acceleration: differenced, cutoff: 30}}\n'
    f'{ALL_EFFECTS}{LOADS}{ALL_FAULTS}',
    'several': 'publish_input: true\nseed: 7\nlinkages:\n'
    + ''.join(
        f'- {{name: {name}, linkage: {LINKAGES}/four_bar.yaml, drive: {{{drive}}}}}\n'
        for name, drive in MANY.items()
    )
    + f'{ALL_EFFECTS}{LOADS}'
    + ALL_FAULTS.replace(SPOILT, '')
    .replace('joint: rocker', 'joint: turning_rocker')
    .replace('link: coupler', 'link: turning_coupler'),
    'pushed': f'{ONE}drive: {{torque: {{start: 1.0, timeout: 0.02}}}}\nseed: 7\n'
    f'{ALL_EFFECTS.replace(BACKLASH, "")}{LOADS}{ALL_FAULTS}',
    'driven': f'{ONE}{MOTOR}seed: 7\n{ALL_EFFECTS.replace(BACKLASH, "")}{LOADS}{ALL_FAULTS}',
}


def samples(folder):
    """Record a crank, for the drive that takes it from a bag."""
    writer = BagWriter(folder, [Topic('/crank', 'sensor_msgs/msg/JointState', '', '')])
    write = JointStateWriter(['recorded_crank_joint']).write
    for index in range(60):
        stamp = BEGIN + index * 10 * MS
        angle, rate = 1.0 + 0.5 * sin(0.2 * index), 10.0 * cos(0.2 * index)
        writer.write(0, stamp, stamp, write(stamp, [angle], [rate]))
    writer.close()


def moments(joint):
    """Yield ticks and messages of a second and a half, as a real clock has them."""
    write = JointStateWriter([joint]).write
    for index in range(TICKS):
        now = BEGIN + index * MS + index * index % 137_000
        messages = ()
        if index % 3 == 0 and not 1000 < index < 1150:
            angle, rate = 1.0 + sin(0.01 * index), 10.0 * cos(0.01 * index)
            messages = (write(now, [angle], [rate], [0.03 * cos(0.05 * index)]),)
        # Some expire, some are rejected, and they have no time in common with the samples.
        wrenches = []
        if index % 7 == 0 and not 400 < index < 450:
            wrenches.append((0, wrench_stamped(0.2, 0.1 * cos(0.03 * index), 0.001)))
        if index % 250 < 2:
            wrenches.append((1, wrench_stamped(0.1, inf if index % 2 else 0.05, -0.002)))
        yield Moment(now, messages, wrenches=tuple(wrenches))


@pytest.fixture(scope='module')
def recorded(tmp_path_factory):
    """Return a function that records a scene once and returns folder and run."""
    runs = {}

    def record(name):
        if name not in runs:
            folder = tmp_path_factory.mktemp(name)
            samples(folder / 'samples')
            (folder / 'scene.yaml').write_text(SCENES[name])
            joint = 'measured_crank_joint' if name == 'several' else 'crank_joint'
            runs[name] = folder, run(folder / 'bag', folder / 'scene.yaml', moments(joint))
        return runs[name]

    return record


def named_in(folder):
    scene = load_scene(folder / 'scene.yaml')
    effects = [set(scene_linkage.effects) for scene_linkage in scene.linkages]
    drives = {scene_linkage.drive[0] for scene_linkage in scene.linkages}
    return effects, drives, {fault.kind for fault in scene.faults.values()}


def test_full_scenes_use_every_effect_drive_and_fault(recorded):
    effects, drives, faults = named_in(recorded('measured')[0])
    assert effects == [set(EFFECTS)]
    assert (drives, faults) == ({'topic'}, set(FAULTS))
    effects, drives, faults = named_in(recorded('several')[0])
    assert effects == [set(EFFECTS)] * 6
    assert drives == set(DRIVES) - {'torque'}
    assert faults == set(FAULTS) - {'not_a_number'}
    effects, drives, faults = named_in(recorded('pushed')[0])
    assert effects == [set(EFFECTS) - {'backlash'}]
    assert (drives, faults) == ({'torque'}, set(FAULTS))


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', SCENES)
def test_runs_with_every_effect_replay_to_the_same_bytes(recorded, name):
    _, done = recorded(name)
    assert len(set(done.published)) > 500, 'it has published, and not the same again and again'
    assert set(done.loop.injection.injected.values()) >= {1}, 'every fault has been on'
    assert 0 not in done.loop.injection.injected.values()
    force, sparse, *_ = done.loop.counts.wrenches
    assert (force.received, sum(force.rejected.values())) == (208, 0)
    assert (sparse.received, sum(sparse.rejected.values())) == (12, 6)
    again = list(replay_ticks(done.bag, recorded_scene(done.bag)))
    assert [each.recorded for each in again if each.recorded] == done.published
    extras = [extra for each in again for extra in each.recorded_extras if extra]
    assert extras == done.extras
    assert len(extras) > 1000
    for each in again:
        assert each.tick.message == each.recorded
        assert each.tick.extras == each.recorded_extras


PROGRAM = """
import hashlib, sys
from linkage_ros.bag.reader import read_bag
from linkage_ros.replay.replay import recorded_scene, replay_ticks
bag = read_bag(sys.argv[1])
digest = hashlib.sha256()
for each in replay_ticks(bag, recorded_scene(bag)):
    for message in (each.tick.message, *each.tick.extras):
        digest.update(message)
print(digest.hexdigest())
"""


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', SCENES)
def test_full_runs_replay_to_same_bytes_in_another_process(recorded, name):
    folder, done = recorded(name)
    digest = hashlib.sha256()
    for each in replay_ticks(done.bag, recorded_scene(done.bag)):
        for message in (each.recorded, *each.recorded_extras):
            digest.update(message)
    again = subprocess.run(
        [sys.executable, '-c', PROGRAM, str(folder / 'bag')],
        env=os.environ | {'PYTHONPATH': str(Path(__file__).parents[2]), 'PYTHONHASHSEED': '5'},
        capture_output=True,
        text=True,
        check=False,
    )
    assert again.returncode == 0, again.stderr
    assert again.stdout.strip() == digest.hexdigest()


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', SCENES)
def test_full_runs_replay_differently_with_another_seed(recorded, name):
    # What is equal above is not so by chance.
    folder, done = recorded(name)
    other = folder / 'other.yaml'
    other.write_text(SCENES[name].replace('seed: 7', 'seed: 8'))
    again = [each.tick.message for each in replay_ticks(done.bag, load_scene(other))]
    assert len(again) > 500
    assert sum(a != b for a, b in zip(again, done.published, strict=False)) > 500
    assert any(a != b for a, b in pairwise(done.published))
