# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Claimed errors are those of an own run against the truth; a need is met when it is run."""

from functools import partial
from math import remainder, tau
import os
import random

from linkage_ros.description import load_scene
from linkage_ros.messages import JointStateWriter
from linkage_ros.tools.study import (
    errors_in_use,
    measure_age_of_command,
    measure_drive_step,
    motions_of,
)
import numpy as np
import pytest

from .own_runs import (
    BEGIN,
    command_messages,
    four_bar_joints,
    FourBar,
    parabolas,
    parabolas_with_play,
    run_scene,
)

HORIZON = 4.0

FALLING = """
linkage: four_bar
rate: 500
drive: {torque: {start: 0.5, METHOD, timeout: 3600}}
loads: {gravity: [0, -9.81], drive_inertia: 0.001}
effects: {friction: {joints: {O2: {viscous: 1.0e-4}}}}
"""

RUBBING = """
linkage: four_bar
rate: 500
drive: {torque: {start: 0.5, METHOD}}
loads: {gravity: [0, -9.81], drive_inertia: 0.001}
effects:
  friction: {joints: {O2: {coulomb: 0.004}, A: {coulomb: 0.001}, O4: {coulomb: 0.001}}}
"""

CRANK = """
links:
  ground: {O: [0, 0], X: [1, 0]}
  crank: {O: [0, 0], end: [0.5, 0]}
input: {joint: drive_joint, parent: ground, child: crank LIMITS}
joints: {crank_joint: {parent: ground, child: crank}}
masses: {crank: {mass: 2, center: [0.3, 0], inertia: 0.05}}
"""
"""A crank alone, of 0.23 kg·m²."""

INERTIA = 0.23

WITH_PLAY = """
linkage: crank.yaml
rate: 500
drive: {torque: {METHOD, play: {width: 0.04, inertia: 0.1}}}
"""

WITH_STOPS = """
linkage: crank.yaml
rate: 500
drive: {torque: {METHOD, restitution: 0.6}}
"""


def scene_of(folder, text, method, limits=''):
    (folder / 'crank.yaml').write_text(CRANK.replace(' LIMITS', limits))
    (folder / 'scene.yaml').write_text(text.replace('METHOD', method))
    return load_scene(folder / 'scene.yaml')


def commands_of(motion):
    return [(0.0, 0.0), *((each.time * 1e-9, each.effort) for each in motion.commands)]


def falling(motion, times):
    return FourBar(0.001, 9.81, 1e-4).moved(0.5, [(0.0, 0.0)], times)


def rubbing(motion, times):
    return FourBar(0.001, 9.81, 0.0, (0.004, 0.001, 0.0, 0.001)).moved(
        0.5, commands_of(motion), times
    )


def with_play(motion, times):
    return parabolas_with_play(0.0, INERTIA, 0.1, 0.04, commands_of(motion), times)


def with_stops(motion, times):
    return parabolas(0.0, INERTIA, commands_of(motion), times, (-0.2, 0.3), 0.6)


EULER, COARSE = 'method: semi_implicit_euler, step: 0.002', 'method: rk4, step: 0.02'

TORQUE = [
    ('falls', FALLING, COARSE, '', None, falling),
    ('falls', FALLING, EULER, '', None, falling),
    ('rubs', RUBBING, EULER, '', 'sine', rubbing),
    ('rubs', RUBBING, 'method: rk4, step: 0.01', '', 'sine', rubbing),
    ('play', WITH_PLAY, EULER, '', 'sine', with_play),
    ('stops', WITH_STOPS, EULER, ', limits: [-0.2, 0.3]', 'sine', with_stops),
]


def joints_of(name, theta):
    if name in ('falls', 'rubs'):
        return four_bar_joints(theta)
    return {'drive_joint': theta, 'crank_joint': theta}


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ('name', 'text', 'method', 'limits', 'like', 'truth'), TORQUE, ids=lambda each: str(each)[:24]
)
def test_the_step_of_a_drive_is_as_far_off_as_a_run_is(
    tmp_path, name, text, method, limits, like, truth
):
    scene = scene_of(tmp_path, text, method, limits)
    (motion,) = motions_of(scene, like, HORIZON)
    worst, rms, claimed = compared(scene, motion, HORIZON, name, partial(truth, motion))
    assert worst > 1e-7, 'a smaller one would say nothing'
    assert worst / 1.5 <= claimed.worst <= 1.5 * worst
    assert rms / 1.5 <= claimed.rms <= 1.5 * rms


def compared(scene, motion, horizon, name, truth):
    """Return the worst and the rms error of an own run, and what is claimed of it."""
    claimed = measure_drive_step(motion, scene.rate, horizon, quick=True, seconds=0.0)[0]
    ticks = round(horizon * scene.rate) + 1
    joint = motion.scene_linkage.linkage.inputs[0].joint
    runs = [*run_scene(scene, ticks, command_messages(motion.commands, joint))]
    exact = truth([index / scene.rate for index in range(1, ticks)])
    apart = []
    for (_, joints, _), theta in zip(runs[1:], exact, strict=True):
        expected = joints_of(name, theta)
        apart.append(max(abs(remainder(joints[j] - expected[j], tau)) for j in expected))
    return max(apart), np.sqrt(np.mean(np.square(apart))), claimed.own_setting.error


SAMPLE = int(os.environ.get('LINKAGE_STATES', '3'))
"""Random scenes; a large sample by the environment."""


@pytest.mark.parametrize('seed', range(SAMPLE))
def test_random_scenes_are_as_far_off_as_claimed(tmp_path, seed):
    rng = random.Random(seed)
    inertia, viscous = 10.0 ** rng.uniform(-3.5, -2.5), 10.0 ** rng.uniform(-5.0, -3.0)
    dry, gravity = rng.choice([0.0, rng.uniform(0.0, 0.004)]), rng.choice([0.0, 9.81])
    start, step = rng.uniform(-3.0, 3.0), rng.choice([0.002, 0.005, 0.01])
    method = rng.choice(['semi_implicit_euler', 'rk4'])
    (tmp_path / 'scene.yaml').write_text(
        f'linkage: four_bar\nrate: 200\n'
        f'drive: {{torque: {{start: {start}, method: {method}, step: {step}}}}}\n'
        f'loads: {{gravity: [0, {-gravity}], drive_inertia: {inertia:.9f}}}\n'
        f'effects: {{friction: {{joints: {{O2: {{viscous: {viscous:.9f}, coulomb: {dry}}}}}}}}}\n'
    )
    scene = load_scene(tmp_path / 'scene.yaml')
    (motion,) = motions_of(scene, 'sine', 3.0)
    bar = FourBar(round(inertia, 9), gravity, round(viscous, 9), (dry, 0.0, 0.0, 0.0))
    worst, rms, claimed = compared(
        scene, motion, 3.0, 'rubs', partial(bar.moved, start, commands_of(motion))
    )
    # The own run of LSODA is itself some 1e-8 off.
    assert worst / 1.5 - 1e-7 <= claimed.worst <= 1.5 * worst + 1e-7
    assert rms / 1.5 - 1e-7 <= claimed.rms <= 1.5 * rms + 1e-7


def samples_of(motion, joint, rate, phase, horizon):
    """Return exact samples, the first a phase after the first tick."""
    write = JointStateWriter([joint]).write
    found = []
    for index in range(round(horizon * rate)):
        time = round((index + phase) * 1e9 / rate)
        values, rates = motion.path(time)
        found.append((time, write(BEGIN + time, values, rates, (0.0,))))
    return found


@pytest.mark.parametrize('carried', [True, False])
def test_the_age_of_a_command_is_that_of_samples_at_100_hz(tmp_path, carried):
    (tmp_path / 'scene.yaml').write_text(
        'linkage: four_bar\nrate: 100\ndrive: {topic: {carry_forward: '
        f'{str(carried).lower()}}}}}\n'
    )
    scene = load_scene(tmp_path / 'scene.yaml')
    (motion,) = motions_of(scene, 'sine', HORIZON)
    claimed = measure_age_of_command(motion, scene, HORIZON).own_setting.error
    apart = []
    for phase in np.random.default_rng(1).uniform(size=12):
        samples = samples_of(motion, 'crank_joint', 100.0, phase, HORIZON)
        for time, joints, _ in run_scene(scene, round(100 * HORIZON), samples):
            exact = four_bar_joints(motion.path(time)[0][0])
            apart.append(max(abs(remainder(joints[j] - exact[j], tau)) for j in joints))
    worst, rms = max(apart), np.sqrt(np.mean(np.square(apart)))
    assert worst / 1.5 <= claimed.worst <= 1.5 * worst
    assert rms / 1.5 <= claimed.rms <= 1.5 * rms


@pytest.mark.parametrize(
    ('name', 'rate'), [('four_bar', 100.0), ('jansen_leg', 500.0), ('scotch_yoke', 200.0)]
)
def test_the_age_in_use_is_that_of_a_listener(tmp_path, name, rate):
    (tmp_path / 'scene.yaml').write_text(
        f'linkage: {name}\nrate: {rate}\neffects: {{velocity: {{}}}}\n'
    )
    scene = load_scene(tmp_path / 'scene.yaml')
    motions = motions_of(scene, 'sine', HORIZON)
    (motion,) = motions
    closure, linkage = motion.closure, motion.closure.linkage
    sizes = [1.0 if turns else 1.0 / _size(linkage) for turns in closure.turning]
    ((held, carried),) = errors_in_use(motions, [rate], HORIZON)
    # At each tick comes the exact crank, so that nothing but the age of the state is off.
    samples = samples_of(motion, linkage.inputs[0].joint, rate, 0.0, HORIZON)
    apart = {'held': [], 'carried': []}
    rng = random.Random(2)
    for time, joints, rates in run_scene(scene, len(samples), samples):
        age = rng.random() / rate
        exact = closure.position(*motion.path(time + round(age * 1e9))[0]).joints
        for use, ahead in (('held', 0.0), ('carried', age)):
            off = []
            for joint, value, turns, size in zip(
                linkage.joints, exact, closure.turning, sizes, strict=True
            ):
                difference = joints[joint] + rates[joint] * ahead - value
                off.append(abs(remainder(difference, tau) if turns else difference * size))
            apart[use].append(max(off))
    for use, claimed in (('held', held), ('carried', carried)):
        worst, rms = max(apart[use]), np.sqrt(np.mean(np.square(apart[use])))
        assert worst / 1.5 <= claimed.worst <= 1.5 * worst, use
        assert rms / 1.5 <= claimed.rms <= 1.5 * rms, use


def _size(linkage):
    apart = 0.0
    for points in linkage.links.values():
        places = [complex(*place) for place in points.values()]
        apart = max([apart, *(abs(one - other) for one in places for other in places)])
    return apart
