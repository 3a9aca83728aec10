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
import pytest

from .four_bar_by_hand import FourBar, mp
from .loaded import context, GRAVITY, moved
from ...support.messages import joint_state as serialized, read_joint_state
from ...support.scenes import linkage_of, LINKAGES, PENDULUM, pipeline_of, shipped

# Effort that the drive must exert, against closed forms and energy balances by hand.


FOUR_BAR = shipped('four_bar')
FOUR_BAR_FILE = (LINKAGES / 'four_bar.yaml').read_bytes()
HANGING = linkage_of(PENDULUM)


def efforts(within, *crank):
    return moved(within, crank, {'effort': ()}).efforts


angles, rates = st.floats(-10.0, 10.0), st.floats(-30.0, 30.0)


@given(angles, rates, rates)
def test_crank_effort_includes_inertia_and_friction(angle, rate, acceleration):
    friction = Friction({'O': JointFriction(viscous=0.02, coulomb=0.3)})
    inertia = 0.05 + 2.0 * 0.3**2 + 0.01
    dry = 0.3 * ((rate > 0.0) - (rate < 0.0))
    expected = inertia * acceleration + 2.0 * GRAVITY * 0.3 * cos(angle) + 0.02 * rate + dry
    found = efforts(context(HANGING, friction, drive_inertia=0.01), angle, rate, acceleration)
    assert found == pytest.approx((expected,), rel=1e-13, abs=1e-12)


@pytest.mark.parametrize(
    'motion', [(0.4, 0.0, 20.0), (1.0, 9.0, 0.0), (2.5, -6.0, 30.0), (-1.2, 12.0, -80.0)]
)
def test_effort_power_equals_the_energy_rate(motion):
    # τ·ω = dE/dt, the energy as worked out by hand. At rest: of both the change by time.
    by_hand = FourBar(FOUR_BAR, motion, GRAVITY)
    later = mp.mpf('1e-3')
    power = mp.diff(lambda t: by_hand.energy(t, 1e-5), later)
    rate = mp.diff(by_hand.crank, later)
    at = (float(by_hand.crank(later)), float(rate), motion[2])
    (found,) = efforts(context(FOUR_BAR, drive_inertia=1e-5), *at)
    assert found == pytest.approx(float(power / rate), rel=1e-10)


def test_overflowing_effort_is_omitted():
    within = context(FOUR_BAR)
    vars(within)['mechanics'] = type('Overflowing', (), {'drive_efforts': lambda *_: (1e400,)})()
    assert moved(within, (1.0, 1.0, 1.0), {'effort': ()}).efforts == ()


def test_effort_is_published_for_the_input_joint():
    pipeline = pipeline_of(
        b'drive: {sine: {mean: 1, amplitude: 0.5, frequency: 2}}\n'
        b'effects: {effort: {}}\nloads: {gravity: [0, -9.81]}',
        FOUR_BAR_FILE,
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


@pytest.mark.parametrize(
    ('linkage', 'start', 'torque', 'friction'),
    [(PENDULUM, -1.2, 9.0, RUBBING), (FOUR_BAR_FILE, 1.0, 1.0, '')],
    ids=['a crank that rubs', 'a four-bar'],
)
def test_effort_under_torque_equals_the_command(linkage, start, torque, friction):
    # Whatever weight, inertia and friction do: they are what the command works against.
    commands = {time: torque if time < 250 else 0.9 * torque for time in range(0, 600, 50)}
    found = timeline(linkage, f'{{start: {start}}}', commands, 500, friction)
    assert found[499][1] > 1.0, 'it moves'
    for time in range(1, 500):
        assert found[time][2] == pytest.approx(commands[time // 50 * 50], abs=1e-10)


def test_effort_without_a_command_is_zero():
    found = timeline(PENDULUM, '{start: 1.0}', {}, 300, RUBBING)
    assert found[299][1] < -1.0, 'it falls'
    for time in range(1, 300):
        assert found[time][2] == pytest.approx(0.0, abs=1e-10)


def test_effort_of_a_slipping_brake_equals_its_torque():
    # It turns forward, and the brake exerts −2 on it; friction of the pin is no part of that.
    torque = '{start: 0.2, rate: 6.0, on_timeout: brake, brake: 2.0}'
    found = timeline(PENDULUM, torque, {}, 60, RUBBING)
    for time in range(1, 60):
        assert found[time][1] > 0.0
        assert found[time][2] == pytest.approx(-2.0, abs=1e-10)
    back = timeline(PENDULUM, torque.replace('6.0', '-6.0'), {}, 60, RUBBING)
    assert back[59][1] < 0.0
    assert back[59][2] == pytest.approx(2.0, abs=1e-10)
