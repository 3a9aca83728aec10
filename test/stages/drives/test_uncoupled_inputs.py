# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Two four-bars in one file, each with its input: each moves as it does alone in its own file."""

from linkage_ros.messages import EffortCommand
import pytest

from ...support.messages import read_joint_state
from ...support.scenes import pipeline_of

BEGIN, MS = 1_700_000_000_000_000_000, 1_000_000

LINKS = """
  crank{n}: {{O{n}: [0, 0], A{n}: [0.040, 0]}}
  coupler{n}: {{A{n}: [0, 0], B{n}: [0.120, 0]}}
  rocker{n}: {{Q{n}: [0, 0], B{n}: [0.080, 0]}}"""
MASSES = """
  crank{n}: {{mass: 0.025, center: [0.020, 0], inertia: 4.2e-6}}
  coupler{n}: {{mass: 0.{n}00, center: [0.060, 0.005], inertia: 1.05e-4}}
  rocker{n}: {{mass: 0.050, center: [0.040, 0], inertia: 2.8e-5}}"""


def four_bars(*numbers):
    """Return a file of some four-bars, which differ in mass and place."""
    places = [f'O{n}: [0, {n}], Q{n}: [0.1, {n}]' for n in numbers]
    inputs = [f'{{joint: crank{n}_joint, parent: ground, child: crank{n}}}' for n in numbers]
    assembly = [f'B{n}: left' for n in numbers]
    joints = [f'rocker{n}_joint: {{parent: ground, child: rocker{n}}}' for n in numbers]
    return (
        f'links:\n  ground: {{{", ".join(places)}}}'
        + ''.join(LINKS.format(n=n) for n in numbers)
        + f'\ninput: [{", ".join(inputs)}]\nassembly: {{{", ".join(assembly)}}}'
        + f'\njoints: {{{", ".join(joints)}}}\nmasses:'
        + ''.join(MASSES.format(n=n) for n in numbers)
    ).encode()


PLAY = 'play: {width: 0.03, inertia: 1.0e-3}'
MOTOR = 'torque_constant: 0.05, ratio: 10, resistance: 1.5, voltage: 6'
# Name: (what the drive has, what the scene has besides).
SCENES = {
    'motor': (f'motor: {{{MOTOR}, command: voltage, quantum: 0.3}}', {}),
    'gear': (f'motor: {{{MOTOR}, command: current, efficiency: 0.7, back_efficiency: 0.4}}', {}),
    'winding': (f'motor: {{{MOTOR}, command: effort, inductance: 0.02}}', {}),
    'play': ('play: {width: 0.03, inertia: 1.0e-3, restitution: 0.3}', {}),
    'play, winding': (f'motor: {{{MOTOR}, command: effort, inductance: 0.02}}, {PLAY}', {}),
    'dry friction': (
        '',
        {
            'A1': {'coulomb': 2e-3, 'breakaway': 4e-3},
            'Q1': {'coulomb': 1e-2},
            'A2': {'coulomb': 3e-3},
            'Q2': {'coulomb': 2e-2, 'breakaway': 0.03, 'stribeck': 0.3},
        },
    ),
    'friction by force': (
        '',
        {
            'A1': {'coefficient': 0.3, 'radius': 0.01},
            'B1': {'coulomb': 1e-3},
            'A2': {'coefficient': 0.5, 'radius': 0.008, 'coulomb': 2e-3, 'breakaway': 3e-3},
            'Q2': {'coefficient': 0.3, 'radius': 0.02},
        },
    ),
    'delay': (f'motor: {{{MOTOR}, command: voltage, delay: 0.0123}}', {}),
}


def scene_of(name, numbers):
    drive, friction = SCENES[name]
    mine = {joint: of for joint, of in friction.items() if int(joint[-1]) in numbers}
    effects = {'velocity': {}, 'effort': {}, **({'friction': {'joints': mine}} if mine else {})}
    starts = ', '.join(f'crank{n}_joint: {{start: 0.{n}}}' for n in numbers)
    return f"""
drive:
  torque:
    {{inputs: {{{starts}}}, method: gauss_legendre, step: 5.0e-4, timeout: 0.05,
     motor_encoder: {{}}, {drive}}}
loads: {{gravity: [0, -9.81], drive_inertia: 2.0e-4}}
effects: {effects}
"""


def command_at(name, number, time_ms):
    """Return the command of a four-bar at a time, of which some run out and turn; or None."""
    if time_ms % (30 + 10 * number):
        return None
    most = 0.05 if SCENES[name][1] else 0.5
    return most * (-1.0) ** (time_ms // 120) / number


def run(name, numbers, milliseconds=250):
    """Return for each four-bar its values, rates, efforts and motor at each tick."""
    pipeline = pipeline_of(scene_of(name, numbers), four_bars(*numbers))
    crank = pipeline.linkages[0].drive
    found = {n: [] for n in numbers}
    for time in range(milliseconds):
        now = BEGIN + time * MS
        commands = tuple(command_at(name, n, time) for n in numbers)
        if any(command is not None for command in commands):
            assert crank.offer(EffortCommand(0, commands), now) is None
        tick = pipeline.tick(now)
        state = read_joint_state(tick.message)
        motor = read_joint_state(tick.extras[0])
        for k, n in enumerate(numbers):
            at = [*state.name].index(f'crank{n}_joint')
            assert motor.name[k] == f'crank{n}_joint_motor'
            mine = [of[at] for of in (state.position, state.velocity, state.effort)]
            mine += [of[k] for of in (motor.position, motor.velocity, motor.effort) if len(of)]
            found[n].append(mine)
    return found


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', SCENES)
def test_uncoupled_inputs_move_as_each_alone(name):
    both = run(name, (1, 2))
    for n in (1, 2):
        alone = run(name, (n,))[n]
        for one, other in zip(both[n], alone, strict=True):
            assert one == pytest.approx(other, rel=1e-6, abs=1e-6)
        assert max(abs(rate) for _, rate, *_ in alone) > 0.5, 'it moves'


HELD = """
drive: {{constant_rate: {{rate: {rate}, start: {start}, inputs: {{{inputs}}}}}}}
loads: {{gravity: [0, -9.81]}}
effects: {{effort: {{}}, friction: {{holds: true, joints: {{{joints}}}}}}}
"""
LIMITS = {
    1: 'A1: {coulomb: 2e-3}, Q1: {coulomb: 4e-3}',
    2: 'A2: {coulomb: 3e-3}, Q2: {coulomb: 5e-3}',
}


@pytest.mark.parametrize('rates', [(0.0, 0.0), (0.0, 1.5)])
def test_friction_holds_uncoupled_inputs_as_each_alone(rates):
    def pipeline_for(first, *others):
        inputs = [f'crank{n}_joint: {{rate: {rates[n - 1]}, start: 0.{n}}}' for n in others]
        joints = [LIMITS[n] for n in (first, *others)]
        scene = HELD.format(
            rate=rates[first - 1],
            start=f'0.{first}',
            inputs=', '.join(inputs),
            joints=', '.join(joints),
        )
        return pipeline_of(scene, four_bars(first, *others))

    both = pipeline_for(1, 2)
    states = [read_joint_state(both.tick(BEGIN + time * MS).message) for time in range(30)]
    assert tuple(states[-1].effort) == both.linkages[0].interpret(BEGIN + 29 * MS).reading.efforts
    for n in (1, 2):
        alone = pipeline_for(n)
        for time, state in enumerate(states):
            mine = read_joint_state(alone.tick(BEGIN + time * MS).message)
            effort = state.effort[[*state.name].index(f'crank{n}_joint')]
            assert effort == pytest.approx(mine.effort[0], rel=1e-9, abs=1e-12)
            assert abs(effort) > 1e-3
