# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What the torque drive exerts on an input at rest: its command, whatever bears the load.

The states are drawn in a table. Each effort is compared with a free body by hand: the load, less
what the drive exerts, is borne by friction, brake or stop, each within what it can bear.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, inf, pi

import pytest

from ...support.messages import joint_state as serialized, read_joint_state
from ...support.scenes import LINKAGES, PENDULUM, pipeline_of

MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000
WEIGHT = 2.0 * 9.81 * 0.3
"""Largest moment of the crank's weight, in [N·m]."""
LIMITED = PENDULUM.replace('child: crank}', 'child: crank, limits: [0.5, 1.5]}', 1)
TOP = 0.5 * pi - 0.1
RUBS = 'friction: {joints: {O: {coulomb: 1.5}}}'
HOLDS = 'friction: {holds: true, joints: {O: {coulomb: 1.5}}}'
CURVED = 'friction: {joints: {O: {coulomb: 1.0, breakaway: 1.5, stribeck: 0.1}}}'
PRESSED = 'friction: {joints: {O: {coefficient: 0.3, radius: 0.25}}}'


@dataclass(frozen=True)
class Rest:
    """A state at rest."""

    at: float  # Where it is, in [rad]
    torque: str = ''  # Of the drive, beside its start
    effects: str = ''
    linkage: str = PENDULUM
    loads: str = ''
    # What bears, beside the drive, in [N·m]: least and greatest on the crank.
    borne: tuple[float, float] = (0.0, 0.0)
    commands: tuple[float, ...] = ()
    # What the drive exerts by a command, by hand: its least and its greatest; the command itself
    # if it has no range.
    exerted: Callable[[float], tuple[float, float]] = lambda command: (command, command)


GEAR = 'torque_constant: 0.1, resistance: 2, ratio: 10, efficiency: 0.8, back_efficiency: 0.7'


def geared(torque):
    """Return the range of a torque before the gear: driving, and driven."""
    return tuple(sorted((10.0 * torque * 0.8, 10.0 * torque / 0.7)))


def by_voltage(volt):
    """Return that of a stalled motor, of 5 A at most."""
    return geared(0.1 * max(-5.0, min(5.0, max(-12.0, min(12.0, volt)) / 2.0)))


STATES = {
    'friction holds': Rest(TOP, effects=RUBS, borne=(-1.5, 1.5), commands=(-0.4, 0.0, 0.05, 1.2)),
    'friction holds, and effort has what is left': Rest(TOP, effects=HOLDS, borne=(-1.5, 1.5),
                                                        commands=(-0.4, 0.0, 0.05, 1.2)),
    'friction of a curve holds': Rest(TOP, effects=CURVED, borne=(-1.5, 1.5),
                                      commands=(-0.4, 0.0, 0.05, 1.2)),
    'friction by the force in its pin holds': Rest(TOP, effects=PRESSED, borne=(-1.4, 1.4),
                                                   commands=(-0.4, 0.0, 0.05, 1.2)),
    'the upper stop bears': Rest(1.5, linkage=LIMITED, borne=(-inf, 0.0),
                                 commands=(0.5, 3.0, 100.0)),
    'the lower stop bears': Rest(0.5, linkage=LIMITED, borne=(0.0, inf),
                                 commands=(-100.0, -0.1, 0.0, 5.0)),
    'a stop and friction bear': Rest(1.5, effects=RUBS, linkage=LIMITED, borne=(-inf, 1.5),
                                     commands=(-0.5, 0.0, 0.5, 9.0)),
    'the brake holds': Rest(0.2, 'on_timeout: brake, brake: 20', borne=(0.0, 0.0),
                            commands=(None,), exerted=lambda _: (-20.0, 20.0)),
    'the brake holds a part, friction the rest': Rest(0.2, 'on_timeout: brake, brake: 5', RUBS,
                                                      borne=(-1.5, 1.5), commands=(None,),
                                                      exerted=lambda _: (-5.0, 5.0)),
    'friction holds what it can, and the brake the rest': Rest(
        0.2, 'on_timeout: brake, brake: 5', HOLDS, borne=(-1.5, 1.5), commands=(None,),
        exerted=lambda _: (-5.0, 5.0),
    ),
    'nothing is commanded': Rest(TOP, effects=RUBS, borne=(-1.5, 1.5), commands=(None,),
                                 exerted=lambda _: (0.0, 0.0)),
    'a motor without loss, stalled at a stop': Rest(
        1.5, 'motor: {torque_constant: 0.1, resistance: 2, ratio: 10, command: voltage}',
        linkage=LIMITED, borne=(-inf, 0.0), commands=(1.0, 12.0), exerted=lambda u: (0.5 * u,) * 2,
    ),
    'a motor by current, held by friction': Rest(
        TOP, 'motor: {torque_constant: 0.1, ratio: 10, command: current}', RUBS,
        borne=(-1.5, 1.5), commands=(-0.5, 0.0, 1.0), exerted=lambda i: (i, i),
    ),
    'a motor with a gear, stalled at a stop': Rest(
        1.5, f'motor: {{{GEAR}, command: voltage, voltage: 12, current: 5}}', linkage=LIMITED,
        borne=(-inf, 0.0), commands=(6.0, 12.0, 24.0), exerted=by_voltage,
    ),
    'its gear holds': Rest(0.5, f'motor: {{{GEAR}, command: voltage, voltage: 12, current: 5}}',
                           linkage=LIMITED, borne=(0.0, 0.0), commands=(10.0, 12.0),
                           exerted=by_voltage),
    'a motor that gives an effort, at a stop': Rest(
        1.5, f'motor: {{{GEAR}, command: effort, current: 5}}', linkage=LIMITED,
        borne=(-inf, 0.0), commands=(0.8, 3.0, 9.0),
        exerted=lambda effort: geared(min(0.5, effort / 8.0)),
    ),
    'a winding, stalled at a stop': Rest(
        1.5, f'motor: {{{GEAR}, inductance: 0.004, command: voltage, voltage: 12, current: 5}}',
        linkage=LIMITED, borne=(-inf, 0.0), commands=(6.0, 12.0, 24.0), exerted=by_voltage,
    ),
    'behind play, at a stop': Rest(1.5, 'play: {width: 1.0e-4, inertia: 1.0e-3}', linkage=LIMITED,
                                   borne=(-inf, 0.0), commands=(3.0, 9.0)),
    'behind play, held by friction': Rest(TOP, 'play: {width: 1.0e-4, inertia: 1.0e-3}', RUBS,
                                          borne=(-1.5, 1.5), commands=(0.3, 1.2)),
    'behind play, pulled off a crank that friction holds': Rest(
        TOP, 'play: {width: 1.0e-4, inertia: 1.0e-3}', RUBS, borne=(-1.5, 1.5), commands=(-0.3,),
    ),
}  # fmt: skip


def rested(state, command, ms=1000):
    """Return position, rate and effort, and the torque of the motor, after a while at rest."""
    text = f'rate: 1000\ndrive: {{torque: {{start: {state.at!r}, timeout: 30, step: 0.001'
    text += f'{state.torque and ", " + state.torque}, motor_encoder: {{}}}}}}\n'
    text += f'loads: {{gravity: [0, -9.81], drive_inertia: 0.02{state.loads}}}\n'
    text += f'effects: {{velocity: {{}}, effort: {{}}{state.effects and ", " + state.effects}}}\n'
    pipeline = pipeline_of(text, state.linkage)
    for time in range(ms):
        now = BEGIN + time * MS
        if not time and command is not None:
            assert pipeline.offer(serialized(['drive_joint'], efforts=[command]), now) is None
        tick = pipeline.tick(now)
    joints, motor = read_joint_state(tick.message), read_joint_state(tick.extras[0])
    return joints.position[0], joints.velocity[0], joints.effort[0], motor.effort


CASES = [(name, command) for name, state in STATES.items() for command in state.commands]


@pytest.mark.sample(16)
@pytest.mark.parametrize(('name', 'command'), CASES)
def test_effort_at_rest_equals_the_command(name, command):
    state = STATES[name]
    at, rate, effort, torque = rested(state, command)
    # Behind play the motor comes with a little blow.
    assert (at, rate) == (pytest.approx(state.at, abs=1e-3 if 'play' in state.torque else 0), 0.0)
    least, most = state.exerted(command)
    load = WEIGHT * cos(at)
    assert least - 1e-9 <= effort <= most + 1e-9
    # The free body: what the drive does not bear, something else does.
    low, high = state.borne
    assert low - 1e-9 <= load - effort <= high + 1e-9
    # Of a range, it is what leaves least for all others.
    required = load
    if 'holds: true' in state.effects:
        required = max(0.0, load - 1.5)
    assert effort == pytest.approx(min(max(required, least), most), abs=1e-9)
    if 'motor:' in state.torque:
        behind_gear = geared(torque[0]) if GEAR in state.torque else (10.0 * torque[0],) * 2
        assert behind_gear == pytest.approx((least, most), abs=1e-9)


@pytest.mark.sample(2)
@pytest.mark.parametrize('command', [0.5, 5.0])
@pytest.mark.parametrize('damping', [2.0, 5.0])
def test_effort_on_a_soft_stop_equals_the_command(command, damping):
    stops = f', stops: {{drive_joint: {{stiffness: 100, damping: {damping}}}}}'
    state = Rest(1.5, linkage=LIMITED, loads=stops)
    at, rate, effort, _ = rested(state, command, 6000)
    assert rate == pytest.approx(0.0, abs=1e-6)
    assert effort == pytest.approx(command, abs=1e-6)
    assert 100.0 * (at - 1.5) == pytest.approx(command - WEIGHT * cos(at), abs=1e-5)


def test_effort_of_a_jammed_linkage_equals_the_command():
    # The piston is pushed out against 100 N, and jams from µ = 6.5 on.
    text = (
        'drive: {torque: {start: 0.9, rate: -0.1, timeout: 9}}\n'
        'loads: {efforts: {piston_slide: {constant: -100}}}\n'
        'effects: {velocity: {}, effort: {}, friction: {joints: {cylinder: {coefficient: 7}}}}\n'
    )
    pipeline = pipeline_of(text, (LINKAGES / 'slider_crank.yaml').read_bytes())
    found = []
    for time in range(50):
        command = -300.0 if time < 25 else 12.0 - 400.0
        message = serialized(['crank_joint'], efforts=[command])
        assert pipeline.offer(message, BEGIN + time * MS) is None
        state = read_joint_state(pipeline.tick(BEGIN + time * MS).message)
        found.append((state.velocity[0], state.effort[0], command))
    assert found[10][0] == found[-1][0] == 0.0
    for rate, effort, command in found[10:]:
        assert (rate, effort) == (0.0, command)


def test_effort_is_continuous_at_breakaway():
    # 1 N·m more a second, until friction of 1.5 N·m gives way.
    state = STATES['friction holds']
    text = (
        f'drive: {{torque: {{start: {state.at}}}}}\n'
        'loads: {gravity: [0, -9.81], drive_inertia: 0.02}\n'
        f'effects: {{velocity: {{}}, effort: {{}}, {RUBS}}}\n'
    )
    pipeline, moves = pipeline_of(text, PENDULUM), 0
    for time in range(3000):
        now, command = BEGIN + time * MS, 1e-3 * time
        assert pipeline.offer(serialized(['drive_joint'], efforts=[command]), now) is None
        joints = read_joint_state(pipeline.tick(now).message)
        assert joints.effort[0] == pytest.approx(command, abs=1e-9)
        moves += joints.velocity[0] > 0.0
    assert moves > 100
