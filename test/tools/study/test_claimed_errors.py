# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Claimed errors are those of an own run against the truth; a need is met when it is run."""

from functools import partial
from itertools import combinations
from math import gcd, remainder, tau
import os
import random

from linkage_ros import load
from linkage_ros.description import load_scene
from linkage_ros.kinematics import SpaceLinkage
from linkage_ros.messages import JointStateWriter
from linkage_ros.resources import shipped_path
from linkage_ros.tools.study import (
    draw_ticks,
    draw_times,
    errors_in_use,
    measure_age_of_command,
    measure_drive_step,
    motions_of,
)
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from .own_runs import (
    BEGIN,
    command_messages,
    four_bar_joints,
    FourBar,
    parabolas,
    parabolas_with_play,
    run_scene,
)
from ...dynamics.test_bodies import RSSR
from ...support.multipliers import AbsoluteMotion

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
    return [(0.0, 0.0), *((each.time * 1e-9, *each.efforts) for each in motion.commands)]


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


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ('name', 'text', 'method', 'limits', 'like', 'truth'), TORQUE, ids=lambda each: str(each)[:24]
)
def test_claimed_drive_step_error_equals_a_run(tmp_path, name, text, method, limits, like, truth):
    scene = scene_of(tmp_path, text, method, limits)
    (motion,) = motions_of(scene, like, HORIZON)
    worst, rms, claimed = compared(scene, motion, HORIZON, name, partial(truth, motion))
    assert worst > 1e-7, 'a smaller one would say nothing'
    assert worst / 1.5 <= claimed.worst <= 1.5 * worst
    assert rms / 1.5 <= claimed.rms <= 1.5 * rms


WEIGHED = f"""{RSSR}masses:
  crank: {{mass: 0.3, center: [0.02, 0, 0], inertia: [1.0e-4, 0, 0, 2.0e-4, 0, 2.0e-4]}}
  rod: {{mass: 0.1}}
  rocker: {{mass: 0.2, center: [0.12, 0.03, 0.08], inertia: [3.0e-4, 0, 0, 2.0e-4, 0, 4.0e-4]}}
"""


ANKLE_MASSES = """masses:
  bar1: {mass: 0.1, center: [0.035, 0.01, 0.148], inertia: [8.0e-6, 0, 0, 2.0e-6, 0, 8.0e-6]}
  bar2: {mass: 0.1, center: [0.04, -0.01, 0.213], inertia: [8.0e-6, 0, 0, 2.0e-6, 0, 8.0e-6]}
  rod1: {mass: 0.06}
  rod2: {mass: 0.07}
  cross: {mass: 0}
  foot: {mass: 0.8, center: [0.03, 0, -0.05], inertia: [5.0e-4, 0, 0, 2.7e-3, 0, 3.1e-3]}
"""
DELTA_MASSES = """masses:
  arm1: {mass: 0.2, center: [150, 0, -75], inertia: [1.0e-4, 0, 0, 5.0e-4, 0, 5.0e-4]}
  arm2: {mass: 0.2, center: [-75, 130, -75], inertia: [4.0e-4, 0, 0, 2.0e-4, 0, 5.0e-4]}
  arm3: {mass: 0.2, center: [-75, -130, -75], inertia: [4.0e-4, 0, 0, 2.0e-4, 0, 5.0e-4]}
  rod1: {mass: 0.05}
  rod2: {mass: 0.05}
  rod3: {mass: 0.05}
  xs: {mass: 0}
  ys: {mass: 0}
  platform: {mass: 0.3, center: [0, 0, -500], inertia: [1.0e-4, 0, 0, 1.0e-4, 0, 2.0e-4]}
"""


def shipped_text(name):
    return shipped_path(f'linkages/space/{name}.yaml').read_text()


IN_SPACE = {
    'rssr': (WEIGHED, [0.5]),
    'delta': (shipped_text('delta') + DELTA_MASSES, [0.1, -0.1, 0.2]),
    'ankle': (shipped_text('ankle') + ANKLE_MASSES, [0.1, -0.05]),
    'ankle_motors': (shipped_text('ankle_motors'), [0.1, 0.05]),
}


def multiplier_motion(closure, start, times):
    """Return inputs at times by Lagrange multipliers in absolute coordinates, by DOP853."""
    count = len(start)

    def slope(_, state):
        q, w = state[:count], state[count:]
        bare, *columns = (
            AbsoluteMotion(closure, q, w, changes).efforts((0.0, 0.0, -9.81))
            for changes in np.vstack([np.zeros(count), np.eye(count)])
        )
        return [*w, *np.linalg.solve((np.array(columns) - bare).T, -bare)]

    begin = [*start, *[0.0] * count]
    return solve_ivp(slope, (0.0, times[-1]), begin, 'DOP853', times, rtol=1e-6, atol=1e-8).y


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', IN_SPACE)
def test_claimed_spatial_step_error_equals_lagrange_multipliers(tmp_path, name):
    """The truth is of Lagrange multipliers in absolute coordinates, by DOP853."""
    text, start = IN_SPACE[name]
    (tmp_path / 'linkage.yaml').write_text(text)
    closure = load(tmp_path / 'linkage.yaml')
    begins = dict(zip(closure.input_names, start, strict=True))
    inputs = ', '.join(f'{joint}: {{start: {value}}}' for joint, value in begins.items())
    (tmp_path / 'scene.yaml').write_text(
        'linkage: linkage.yaml\nrate: 100\nloads: {gravity: [0, 0, -9.81]}\ndrive: {torque: '
        f'{{method: semi_implicit_euler, step: 0.002, inputs: {{{inputs}}}}}}}\n'
    )
    scene, horizon = load_scene(tmp_path / 'scene.yaml'), 0.04
    (motion,) = motions_of(scene, None, horizon)
    closure = motion.closure  # It publishes the inputs, too.
    true = multiplier_motion(closure, start, np.arange(5) / 100.0)
    claimed = measure_drive_step(motion, 100.0, horizon, quick=True, seconds=0.0)[0]
    worst, size = 0.0, _size(closure.linkage)
    for (_, joints, _), values in zip(run_scene(scene, 5), true.T, strict=True):
        exact = closure.position(*values[: len(start)]).joints
        for joint, value, turns in zip(closure.joint_names, exact, closure.turning, strict=True):
            off = joints[joint] - value
            worst = max(worst, abs(remainder(off, tau)) if turns else abs(off) / size)
    assert worst > 1e-6
    assert worst / 1.5 <= claimed.own_setting.error.worst <= 1.5 * worst


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
def test_random_scene_errors_equal_the_claimed_ones(tmp_path, seed):
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


def samples_of(motion, joints, rate, phase, horizon):
    """Return exact samples, the first a phase after the first tick."""
    write = JointStateWriter(joints).write
    found = []
    for index in range(round(horizon * rate)):
        time = round((index + phase) * 1e9 / rate)
        values, rates = motion.path(time)
        found.append((time, write(BEGIN + time, values, rates, (0.0,) * len(joints))))
    return found


@pytest.mark.sample(1)
@pytest.mark.parametrize('carried', [True, False])
def test_claimed_command_age_error_equals_sampled_runs(tmp_path, carried):
    (tmp_path / 'scene.yaml').write_text(
        'linkage: four_bar\nrate: 100\ndrive: {topic: {carry_forward: '
        f'{str(carried).lower()}}}}}\n'
    )
    scene = load_scene(tmp_path / 'scene.yaml')
    (motion,) = motions_of(scene, 'sine', HORIZON)
    claimed = measure_age_of_command(motion, scene, HORIZON).own_setting.error
    apart = []
    for phase in np.random.default_rng(1).uniform(size=12):
        samples = samples_of(motion, ['crank_joint'], 100.0, phase, HORIZON)
        for time, joints, _ in run_scene(scene, round(100 * HORIZON), samples):
            exact = four_bar_joints(motion.path(time)[0][0])
            apart.append(max(abs(remainder(joints[j] - exact[j], tau)) for j in joints))
    worst, rms = max(apart), np.sqrt(np.mean(np.square(apart)))
    assert worst / 1.5 <= claimed.worst <= 1.5 * worst
    assert rms / 1.5 <= claimed.rms <= 1.5 * rms


@pytest.mark.sample(4)
@pytest.mark.parametrize(
    ('name', 'rate'),
    [
        ('four_bar', 100.0), ('jansen_leg', 500.0), ('scotch_yoke', 200.0), ('five_bar', 200.0),
        ('rssr', 100.0), ('delta', 200.0), ('ankle_motors', 200.0), ('wishbone', 100.0),
    ],
)  # fmt: skip
def test_claimed_age_in_use_error_equals_a_listener(tmp_path, name, rate):
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
    samples = samples_of(motion, closure.input_names, rate, 0.0, HORIZON)
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


# Round speeds of motors, in turns a minute: ticks at round rates meet few phases of the crank.
SPEEDS = (60, 100, 120, 300, 600, 900, 1200, 1500, 1800, 3000, 3600, 6000)
QUICK = 100
"""Periods of a quick measurement."""


def of_all_phases(closure, speed, age):
    """Return worst and rms of states of a steady crank, held and carried, over phases and ages."""
    sizes = [1.0 if turns else 1.0 / _size(closure.linkage) for turns in closure.turning]
    phases, ages = 1500, 20
    angles = tau * np.arange(phases) / phases
    begun = closure.solve(angles, derivatives=0).positions
    tiny = 1e-6  # a difference stands for the rate
    ahead, behind = (closure.solve(angles + d, derivatives=0).positions for d in (tiny, -tiny))
    turning = np.array(closure.turning)[:, None]

    def difference(one, other):
        apart = one - other
        return np.where(turning, apart - tau * np.round(apart / tau), apart)

    rates = difference(ahead, behind) / (2.0 * tiny) * speed
    found = {'held': [], 'carried': []}
    # The midpoints of equal parts for the mean, and the end for the worst.
    for old in [*((k + 0.5) * age / ages for k in range(ages)), age]:
        now = closure.solve(angles + speed * old, derivatives=0).positions
        for use, moved in (('held', 0.0), ('carried', rates * old)):
            off = np.abs(difference(begun + moved, now)) * np.array(sizes)[:, None]
            found[use].append(off.max(axis=0))
    return {
        use: (float(np.max(each)), float(np.sqrt(np.mean(np.square(each[:-1])))))
        for use, each in found.items()
    }


@pytest.mark.sample(6)
@pytest.mark.parametrize('rpm', SPEEDS)
@pytest.mark.parametrize('name', ['four_bar', 'whitworth_quick_return', 'slider_crank'])
@pytest.mark.parametrize('periods', [QUICK, 300])
def test_age_in_use_error_covers_all_crank_phases(tmp_path, name, rpm, periods):
    speed, rates = rpm * tau / 60.0, [100.0, 1000.0, 2000.0]
    (tmp_path / 'scene.yaml').write_text(
        f'linkage: {name}\ndrive: {{constant_rate: {{rate: {speed}, start: 2.0}}}}\n'
    )
    motions = motions_of(load_scene(tmp_path / 'scene.yaml'), None, 10.0)
    for rate, pair in zip(rates, errors_in_use(motions, rates, 10.0, periods), strict=True):
        true = of_all_phases(motions[0].closure, speed, 1.0 / rate)
        for use, claimed in zip(('held', 'carried'), pair, strict=True):
            worst, rms = true[use]
            # Random phases leave gaps, so the worst is met only nearly.
            assert 0.75 * worst <= claimed.worst <= 1.001 * worst, (rate, use)
            assert rms / 1.35 <= claimed.rms <= 1.35 * rms, (rate, use)


@pytest.mark.sample(3)
@pytest.mark.parametrize('rpm', SPEEDS)
@pytest.mark.parametrize('carried', [True, False])
def test_command_age_error_covers_all_crank_phases(tmp_path, rpm, carried):
    speed, rate = rpm * tau / 60.0, 500.0
    (tmp_path / 'scene.yaml').write_text(
        'linkage: four_bar\nrate: 1000\n'
        f'drive: {{topic: {{carry_forward: {str(carried).lower()}}}}}\n'
    )
    scene = load_scene(tmp_path / 'scene.yaml')
    (motion,) = motions_of(scene, 'sine', 10.0)
    turning = motion._replace(
        path=lambda time: ((speed * time * 1e-9,), (speed,)), sample_rate=rate
    )
    claimed = measure_age_of_command(turning, scene, 10.0, quick=True).own_setting.error
    if carried:
        # A steady crank is carried forward without an error.
        assert claimed.worst < 1e-9
        return
    # A crank that is late by an age moves the joints as a state held for it.
    worst, rms = of_all_phases(motion.closure, speed, 1.0 / rate)['held']
    assert 0.75 * worst <= claimed.worst <= 1.001 * worst
    assert rms / 1.35 <= claimed.rms <= 1.35 * rms


@pytest.mark.parametrize('most', [48, 500])
def test_sampled_times_cover_all_phases_evenly(most):
    # Of solving (48 times) and of the drive's step (500 ticks), over 10 s.
    for hertz in (*range(1, 41), 50, 60, 75, 100, 125):
        of_ticks = gcd(1000, hertz) / 1000  # distance of the phases that ticks have at all
        for times, apart in (
            (draw_times(10.0, most), 0.0),
            (draw_ticks(1000.0, 10.0, most), of_ticks),
        ):
            phases = np.sort([time * 1e-9 * hertz % 1.0 for time in times])
            # Kolmogorov's distance from phases that are all as likely: over 2.5/√n by chance once
            # in 100,000 times.
            uneven = np.abs(phases - (np.arange(len(phases)) + 0.5) / len(phases)).max()
            assert uneven < 2.5 / len(phases) ** 0.5 + apart, (hertz, most)
            assert times[-1] == 10_000_000_000


def _size(linkage):
    apart = 0.0
    if isinstance(linkage, SpaceLinkage):
        places = [*linkage.points.values(), *(hinge.at for hinge in linkage.hinges.values())]
        return max(float(np.linalg.norm(np.subtract(*pair))) for pair in combinations(places, 2))
    for points in linkage.links.values():
        places = [complex(*place) for place in points.values()]
        apart = max([apart, *(abs(one - other) for one in places for other in places)])
    return apart
