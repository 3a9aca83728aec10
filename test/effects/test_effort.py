# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Effort: what the drive must give, also under torque, against closed forms."""

from math import cos, sin

from hypothesis import given, strategies as st
from linkage_ros.dynamics import Friction, JointFriction
from linkage_ros.errors import FileError
from linkage_ros.kinematics import Status
from linkage_ros.stages.drives import CrankState
from linkage_ros.stages.effects import EffortEffect, MechanismState
import numpy as np
import pytest

from .four_bar_by_hand import FourBar, mp
from .loaded import context, GRAVITY, moved, SINGULAR
from ..support.messages import joint_state as serialized, read_joint_state, STORE
from ..support.scenes import linkage_of, LINKAGES, PENDULUM, pipeline_of, shipped

# Effort that the drive must exert, against closed forms and energy balances by hand.


FOUR_BAR = shipped('four_bar')
HANGING = linkage_of(PENDULUM)


def efforts(within, *crank):
    return moved(within, crank, {'effort': ()}).efforts


angles, rates = st.floats(-10.0, 10.0), st.floats(-30.0, 30.0)


@given(angles)
def test_a_crank_that_hangs_is_held_by_its_weight(angle):
    assert efforts(context(HANGING), angle, 0.0, 0.0) == pytest.approx(
        (2.0 * GRAVITY * 0.3 * cos(angle),), abs=1e-13
    )


@given(angles, rates, rates)
def test_a_crank_that_turns_takes_its_inertia_and_its_friction_too(angle, rate, acceleration):
    friction = Friction({'O': JointFriction(viscous=0.02, coulomb=0.3)})
    inertia = 0.05 + 2.0 * 0.3**2 + 0.01
    dry = 0.3 * ((rate > 0.0) - (rate < 0.0))
    expected = inertia * acceleration + 2.0 * GRAVITY * 0.3 * cos(angle) + 0.02 * rate + dry
    found = efforts(context(HANGING, friction, drive_inertia=0.01), angle, rate, acceleration)
    assert found == pytest.approx((expected,), rel=1e-13, abs=1e-12)


@pytest.mark.parametrize(
    'motion', [(0.4, 0.0, 20.0), (1.0, 9.0, 0.0), (2.5, -6.0, 30.0), (-1.2, 12.0, -80.0)]
)
def test_its_work_is_the_change_of_energy(motion):
    # τ·ω = dE/dt, the energy as worked out by hand. At rest: of both the change by time.
    by_hand = FourBar(FOUR_BAR, motion, GRAVITY)
    later = mp.mpf('1e-3')
    power = mp.diff(lambda t: by_hand.energy(t, 1e-5), later)
    rate = mp.diff(by_hand.crank, later)
    at = (float(by_hand.crank(later)), float(rate), motion[2])
    (found,) = efforts(context(FOUR_BAR, drive_inertia=1e-5), *at)
    assert found == pytest.approx(float(power / rate), rel=1e-10)


def test_friction_costs_what_it_dissipates():
    motion = (1.0, 9.0, 4.0)
    friction = {
        'O2': JointFriction(2e-3, 0.01),
        'A': JointFriction(1e-3, 0.02),
        'B': JointFriction(3e-3, 0.0),
        'O4': JointFriction(0.0, 0.03),
    }
    by_hand = FourBar(FOUR_BAR, motion, GRAVITY)
    crank, coupler, rocker = (mp.diff(lambda t, i=i: by_hand.angles(t)[i], 0) for i in range(3))
    slips = {'O2': crank, 'A': coupler - crank, 'B': rocker - coupler, 'O4': rocker}
    lost = sum(
        each.viscous * slips[pin] ** 2 + each.coulomb * abs(slips[pin])
        for pin, each in friction.items()
    )
    with_it, without = (
        efforts(context(FOUR_BAR, rubbing), *motion)[0] for rubbing in (Friction(friction), None)
    )
    assert (with_it - without) * motion[1] == pytest.approx(float(lost), rel=1e-10)


def test_a_four_bar_at_rest_is_held_against_its_weight():
    # Virtual work: the moment is the slope of the potential energy.
    for angle in (0.3, 1.7, 3.0, 5.0):
        by_hand = FourBar(FOUR_BAR, (angle, 1.0, 0.0), GRAVITY)
        slope = mp.diff(
            lambda t, of=by_hand: sum(
                body.mass * of.gravity * center.imag
                for body, center in zip(of.bodies, of.centers(t), strict=True)
            ),
            0,
        )
        assert efforts(context(FOUR_BAR), angle, 0.0, 0.0) == pytest.approx(
            (float(slope),), abs=1e-14
        )


def test_at_a_toggle_there_is_none():
    motion = moved(context(linkage_of(SINGULAR)), (0.0, 1.0, 0.0), {'effort': ()})
    assert motion.position.status is Status.TOGGLE
    assert motion.efforts == ()


def test_what_is_no_number_is_left_out():
    within = context(FOUR_BAR)
    vars(within)['mechanics'] = type('Overflowing', (), {'drive_efforts': lambda *_: (1e400,)})()
    assert moved(within, (1.0, 1.0, 1.0), {'effort': ()}).efforts == ()


def test_the_rest_of_the_motion_is_passed_on():
    within = context(FOUR_BAR)
    position = within.closure.position(1.0)
    velocity = within.closure.velocity(position, 2.0)
    acceleration = within.closure.acceleration(position, velocity, 3.0)
    crank = CrankState((1.0,), (2.0,), (3.0,), 0)
    motion = MechanismState(
        crank, position, velocity, acceleration, (), ('reactions',), (0.5, 0.5)
    )
    found = EffortEffect().stage(within)(motion)
    assert found == motion._replace(efforts=found.efforts)
    assert len(found.efforts) == 1


def test_forces_in_the_pins_are_not_computed_for_it():
    within = context(FOUR_BAR)
    efforts(within, 1.0, 2.0, 3.0)
    assert 'reactions' not in vars(within)


def test_it_is_published_as_that_of_the_input_joint():
    pipeline = pipeline_of(
        b'drive: {sine: {mean: 1, amplitude: 0.5, frequency: 2}}\n'
        b'effects: {effort: {}}\nloads: {gravity: [0, -9.81]}',
        (LINKAGES / 'four_bar.yaml').read_bytes(),
    )
    within = context(FOUR_BAR)
    for i in range(1, 20):
        tick = pipeline.tick(i * 50_000_000)
        message = read_joint_state(tick.message)
        assert message.name[0] == 'crank_joint'
        # What it starts from is computed, but published only where it is named.
        assert len(message.velocity) == 0
        assert len(message.effort) == len(message.position) == 3
        turn = 4.0 * 3.141592653589793
        t = (i - 1) * 0.05
        motion = (
            1.0 + 0.5 * sin(turn * t),
            0.5 * turn * cos(turn * t),
            -0.5 * turn**2 * sin(turn * t),
        )
        assert message.effort == pytest.approx([*efforts(within, *motion), 0.0, 0.0], abs=1e-12)


def test_under_the_torque_drive_it_is_the_torque_that_moves_the_linkage():
    pipeline = pipeline_of(
        b'drive: {torque: {start: 1}}\neffects: {effort: {}}\nloads: {gravity: [0, -9.81]}',
        (LINKAGES / 'four_bar.yaml').read_bytes(),
    )
    command = STORE.types['sensor_msgs/msg/JointState']
    header = STORE.types['std_msgs/msg/Header']
    time = STORE.types['builtin_interfaces/msg/Time']
    found = []
    for i in range(40):
        now = 10**9 + i * 5_000_000
        torque = 0.01 if i < 20 else -0.03
        message = command(
            header(time(0, 0), ''), ['crank_joint'], np.empty(0), np.empty(0), np.array([torque])
        )
        data = bytes(STORE.serialize_cdr(message, 'sensor_msgs/msg/JointState'))
        assert pipeline.offer(data, now) is None
        state = read_joint_state(pipeline.tick(now).message)
        found.append((state.effort[0], torque, state.position[0]))
    for effort_there, torque, _ in found:
        assert effort_there == pytest.approx(torque, abs=1e-12)
    assert found[-1][2] != pytest.approx(1.0, abs=1e-3)


def test_without_masses_it_is_refused_in_one_line():
    with pytest.raises(FileError, match=r"masses.*'crank' has no mass") as caught:
        pipeline_of(b'effects: {effort: {}}', b'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}')
    assert '\n' not in str(caught.value)


# The published effort under the torque drive, of a crank with a weight that moves: the free-body
# diagrams are by hand. At rest: test_effort_at_rest.py.


MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000
WEIGHT = 2.0 * 9.81 * 0.3
"""Largest moment of the crank's weight, in [N·m]."""


def timeline(linkage, torque, commands, until, friction=''):
    """Return position, rate and effort by [ms]; a command, by its [ms], holds for 100 ms."""
    text = f'drive: {{torque: {torque}}}\nloads: {{gravity: [0, -9.81], drive_inertia: 0.02}}\n'
    text += f'effects: {{velocity: {{}}, effort: {{}}{friction and ", friction: " + friction}}}\n'
    pipeline = pipeline_of(text, linkage)
    (joint,) = pipeline.linkages[0].scene_linkage.input_names
    found = {}
    for time in range(until):
        now = BEGIN + time * MS
        if time in commands:
            assert pipeline.offer(serialized([joint], efforts=[commands[time]]), now) is None
        state = read_joint_state(pipeline.tick(now).message)
        found[time] = state.position[0], state.velocity[0], state.effort[0]
    return found


RUBBING = '{joints: {O: {viscous: 0.1, coulomb: 1.5}}}'


def test_where_it_moves_freely_it_is_what_is_commanded():
    # Whatever weight, inertia and friction do: they are what the command works against.
    commands = dict.fromkeys(range(0, 600, 90), 9.0)
    found = timeline(PENDULUM, '{start: -1.2}', commands, 500, RUBBING)
    assert found[499][1] > 1.0, 'it moves'
    for time in range(1, 500):
        assert found[time][2] == pytest.approx(9.0, abs=1e-10)


def test_where_no_command_holds_it_is_none():
    found = timeline(PENDULUM, '{start: 1.0}', {}, 300, RUBBING)
    assert found[299][1] < -1.0, 'it falls'
    for time in range(1, 300):
        assert found[time][2] == pytest.approx(0.0, abs=1e-10)


def test_while_the_brake_slips_it_is_the_brakes():
    # It turns forward, and the brake exerts −2 on it; friction of the pin is no part of that.
    torque = '{start: 0.2, rate: 6.0, on_timeout: brake, brake: 2.0}'
    found = timeline(PENDULUM, torque, {}, 60, RUBBING)
    for time in range(1, 60):
        assert found[time][1] > 0.0
        assert found[time][2] == pytest.approx(-2.0, abs=1e-10)
    back = timeline(PENDULUM, torque.replace('6.0', '-6.0'), {}, 60, RUBBING)
    assert back[59][1] < 0.0
    assert back[59][2] == pytest.approx(2.0, abs=1e-10)
