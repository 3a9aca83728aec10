# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The torque drive, as timelines: commands, what they do, and what the linkage does without.

Where a motion is to be in closed form, the links weigh next to nothing, and the inertia is that of
the motor.
"""

from dataclasses import replace
from math import inf, isfinite, nan, pi
import random

from hypothesis import given, settings, strategies as st
from linkage_ros.dynamics import Friction, JointFriction, Loads
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import Closure, Mass, PlanarClosure, Status
from linkage_ros.messages import EffortCommand, Rejection
from linkage_ros.stages.drives import Context, TorqueDrive
import pytest

from .contexts import two_inputs
from ...dynamics.loaded import FOLDER, four_bar, shipped
from ...kinematics.defects import defect
from ...support.messages import joint_state as serialized
from ...support.scenes import pipeline_of

MS = 1_000_000
SECOND = 1000 * MS
BEGIN = 1_700_000_000 * SECOND
GOOD = None
GRAVITY = Loads(gravity=(0.0, -9.81))
LIGHT = Mass(1e-12, (0.0, 0.0), 0.0)
WHEEL = four_bar(dict.fromkeys(('crank', 'coupler', 'rocker'), LIGHT), 0.04, 0.12, 0.08, 0.1)
MOTOR = Loads(drive_inertia=0.5)
FOUR_BAR = Closure(shipped('four_bar'))
EXCAVATOR = Closure(shipped('excavator_bucket'))
ROD = Mass(0.2, (0.03, 0.01), 2e-5)
DOUBLE_ROCKER = four_bar(dict.fromkeys(('crank', 'coupler', 'rocker'), ROD), 0.08, 0.05, 0.06, 0.1)


def drive(closure, loads=None, friction=None, **parameters):
    context = Context(closure, 1000.0, True, 'seed', loads, friction)
    return TorqueDrive(**parameters).build(context)


def wheel(**parameters):
    return drive(WHEEL, MOTOR, **parameters)


def command(effort):
    return EffortCommand(0, (effort,))


# Inertia 0.5: an effort of 1 gives 2 rad/s². Commands hold for 100 ms.
# Name: (parameters, [(time in ms, effort commanded, or None and (angle, rate, acceleration))]).
BRAKE = {'on_timeout': 'brake', 'brake': 3.0}
TIMELINES = {
    'without a command nothing acts': ({'start': 0.3, 'rate': 2.0}, [
        (0, None, (0.3, 2.0, 0.0)), (50, None, (0.4, 2.0, 0.0)), (1000, None, (2.3, 2.0, 0.0)),
    ]),
    'a command acts from when it comes': ({}, [
        (0, None, (0.0, 0.0, 0.0)), (20, 1.0, None), (20, None, (0.0, 0.0, 2.0)),
        (120, None, (0.01, 0.2, 0.0)),
    ]),
    'a command runs out, and nothing acts': ({}, [
        (0, None, (0.0, 0.0, 0.0)), (0, 1.0, None), (99, None, (0.009801, 0.198, 2.0)),
        (100, None, (0.01, 0.2, 0.0)), (600, None, (0.11, 0.2, 0.0)),
    ]),
    'a command runs out, and the brake acts': (BRAKE, [
        (0, None, (0.0, 0.0, 0.0)),
        (0, 1.0, None),
        (100, None, (0.01, 0.2, -6.0)),
        (120, None, (0.0128, 0.08, -6.0)),
        (500, None, (0.01 + 0.2 * 0.2 / 12, 0.0, 0.0)),
    ]),
    'before the first command the brake acts too': ({'rate': 0.6, **BRAKE}, [
        (0, None, (0.0, 0.6, -6.0)), (50, None, (0.0225, 0.3, -6.0)),
        (101, None, (0.03, 0.0, 0.0)),
    ]),
    'a command lets the brake go': (BRAKE, [
        (0, None, (0.0, 0.0, 0.0)), (50, 0.5, None), (150, None, (0.005, 0.1, -6.0)),
    ]),
    'each command holds anew': ({}, [
        (0, None, (0.0, 0.0, 0.0)),
        *((time, 1.0, None) for time in range(0, 1000, 80)),
        (1000, None, (1.0, 2.0, 2.0)),
        (1060, None, (1.1236, 2.12, 0.0)),
        (1160, None, (1.3356, 2.12, 0.0)),
    ]),
    'between two steps too': ({'step': 0.01, 'method': 'gauss_legendre'}, [
        (0, None, (0.0, 0.0, 0.0)), (13, 1.0, None), (17, None, (1.6e-5, 8e-3, 2.0)),
        (18, -1.0, None), (23, None, (5e-5, 0.0, -2.0)), (24, None, (4.9e-5, -2e-3, -2.0)),
    ]),
    'one before the first tick acts from that on': ({}, [
        (0, 1.0, None), (40, None, (0.0, 0.0, 2.0)), (100, None, (0.0036, 0.12, 0.0)),
    ]),
    'one long before the first tick does not act': ({}, [
        (0, 1.0, None), (140, None, (0.0, 0.0, 0.0)), (200, None, (0.0, 0.0, 0.0)),
    ]),
    'it is not looked at for a while': ({'rate': 1.0}, [
        (0, None, (0.0, 1.0, 0.0)), (900, None, (0.9, 1.0, 0.0)),
    ]),
    'longer than can be made up for, it has stood still meanwhile': (
        {'rate': 1.0},
        [
            (0, None, (0.0, 1.0, 0.0)), (100, 1.0, None), (5000, None, (1.1, 1.0, 0.0)),
            (5100, None, (1.2, 1.0, 0.0)),
        ],
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', TIMELINES)
def test_torque_commands_move_the_wheel_on_time(name):
    parameters, steps = TIMELINES[name]
    turned = wheel(**parameters)
    for time, effort, expected in steps:
        if effort is not None:
            assert turned.offer(command(effort), BEGIN + time * MS) is GOOD
        else:
            (angle,), (rate,), (acceleration,), age = turned.state(BEGIN + time * MS)
            assert (angle, rate, acceleration) == pytest.approx(expected, abs=1e-8)
            assert age == 0


def test_repeated_command_equals_a_lasting_one():
    once = drive(FOUR_BAR, GRAVITY, start=1.0, timeout=10.0)
    again = drive(FOUR_BAR, GRAVITY, start=1.0, timeout=0.01)
    assert once.state(BEGIN) == again.state(BEGIN)
    assert once.offer(command(0.05), BEGIN + 1) is GOOD
    for time in range(BEGIN + 1, BEGIN + SECOND, 3_300_000):
        assert again.offer(command(0.05), time) is GOOD
        assert again.state(time + 7) == once.state(time + 7)


@pytest.mark.parametrize(
    ('effort', 'reason'),
    [
        (nan, Rejection.EFFORT_NOT_FINITE),
        (inf, Rejection.EFFORT_NOT_FINITE),
        (-inf, Rejection.EFFORT_NOT_FINITE),
        (1.0000001e10, Rejection.EFFORT_TOO_LARGE),
        (-1e300, Rejection.EFFORT_TOO_LARGE),
    ],
)
def test_a_refused_command_changes_nothing(effort, reason):
    refused, spared = wheel(), wheel()
    for time in range(0, 300, 7):
        now = BEGIN + time * MS
        if time == 14:
            assert refused.offer(command(1.0), now) is spared.offer(command(1.0), now) is GOOD
        if time > 14:
            assert refused.offer(command(effort), now + 1) is reason
        assert refused.state(now + 2) == spared.state(now + 2)
    assert refused.stamp == spared.stamp == BEGIN + 14 * MS, 'it does not hold the old one either'
    assert refused.state(BEGIN + SECOND).rates == pytest.approx((0.2,))


def test_torque_drive_reports_command_stamp_and_max_age():
    turned = wheel(timeout=0.25)
    assert (turned.stamp, turned.max_age) == (0, 250 * MS)
    turned.offer(EffortCommand(5, (1.0,)), BEGIN)
    assert turned.stamp == BEGIN, "not the message's, which may be 0"


def test_torque_drive_reports_the_lost_time():
    turned = wheel(rate=1.0)
    for time in (0, 900, 1900, 2901.3, 7901.3):
        turned.state(BEGIN + round(time * MS))
    assert turned.lost == 2 * MS + 4001 * MS, 'whole steps, so that they go on at the same times'
    assert turned.state(BEGIN + 7902 * MS).angles == pytest.approx((7.902 - 4.003,))


def test_slow_ticks_lose_no_simulated_time():
    context = Context(WHEEL, 0.25, True, 'seed', MOTOR, None)
    turned = TorqueDrive(rate=1.0, step=0.01).build(context)
    for second in range(0, 13, 4):
        assert turned.state(BEGIN + second * SECOND).angles == pytest.approx((second,))
    assert turned.lost == 0


def test_earlier_query_time_returns_the_last_state():
    turned = wheel(rate=1.0)
    turned.state(BEGIN)
    last = turned.state(BEGIN + 10 * MS)
    assert turned.state(BEGIN + 5 * MS) == last
    assert turned.offer(command(1.0), BEGIN + 5 * MS) is GOOD
    assert turned.state(BEGIN + 10 * MS)[:2] == last[:2]


def driven(when, method='rk4'):
    """Return the states of a loaded four-bar under commands, looked at at some times in [ns]."""
    built = drive(
        FOUR_BAR,
        GRAVITY,
        Friction({'O2': JointFriction(1e-4, 2e-3)}),
        start=1.0,
        method=method,
        restitution=0.3,
        on_timeout='brake',
        brake=0.01,
    )
    rng = random.Random(3)
    commands = [
        (BEGIN + rng.randrange(400) * 2 * MS + rng.randrange(2) * 123_457, rng.uniform(-0.1, 0.1))
        for _ in range(20)
    ]
    events = sorted([(time, 0, effort) for time, effort in commands] + [(t, 1, 0.0) for t in when])
    states = {}
    built.state(BEGIN)
    for time, looks, effort in events:
        if looks:
            states[time] = built.state(time)
        else:
            assert built.offer(command(effort), time) is GOOD
    return states


@pytest.mark.parametrize('method', ['semi_implicit_euler', 'rk4', 'gauss_legendre'])
def test_torque_motion_does_not_depend_on_query_times(method):
    slow = driven(range(BEGIN, BEGIN + SECOND, 4 * MS), method)
    fast = driven(range(BEGIN, BEGIN + SECOND, 1 * MS), method)
    odd = driven([*range(BEGIN, BEGIN + SECOND, 777_777), *slow], method)
    assert all(fast[time] == odd[time] == state for time, state in slow.items())
    assert len(set(slow.values())) > 100


def test_cylinder_work_equals_the_bucket_energy():
    # Undamped: what force times way has given is in the bucket's weight and speed.
    built = drive(EXCAVATOR, GRAVITY, start=0.9, method='gauss_legendre', timeout=10.0)
    mechanics = Context(EXCAVATOR, 0.0, True, 'seed', GRAVITY, None).mechanics

    def energy(state):
        return mechanics.total_energy(EXCAVATOR.position(*state.angles), *state.rates)

    first = built.state(BEGIN)
    force = 1.2 * mechanics.motion_terms(EXCAVATOR.position(0.9)).potential_slope
    assert built.offer(command(force), BEGIN) is GOOD
    ways = set()
    for time in range(0, 400, 25):
        state = built.state(BEGIN + time * MS)
        way = state.angles[0] - 0.9
        ways.add(way)
        assert energy(state) - energy(first) == pytest.approx(force * way, rel=1e-9, abs=1e-9)
    assert max(ways) - min(ways) > 0.05


@pytest.mark.parametrize('direction', [1, -1])
def test_cylinder_is_stopped_before_its_range_end(direction):
    low, high = EXCAVATOR.input_ranges[0][:2]
    within = 0.01 * (high - low)
    built = drive(EXCAVATOR, GRAVITY, start=0.9, timeout=10.0, stop_margin=0.01)
    built.state(BEGIN)
    built.offer(command(direction * 1e5), BEGIN)
    state = built.state(BEGIN + SECOND)
    assert state == ((high - within if direction > 0 else low + within,), (0.0,), (0.0,), 0)


efforts = st.floats(-1e6, 1e6) | st.floats(-1.0, 1.0) | st.sampled_from([1e10, -1e10, 0.0])


@settings(max_examples=40, deadline=None)
@given(
    commanded=st.lists(st.tuples(st.integers(0, 20 * MS), efforts), max_size=6),
    method=st.sampled_from(['semi_implicit_euler', 'rk4', 'gauss_legendre']),
    restitution=st.sampled_from([0.0, 0.4, 1.0]),
    rate=st.floats(-100.0, 100.0),
)
def test_torque_drive_never_leaves_its_range(commanded, method, restitution, rate):
    low, high = DOUBLE_ROCKER.input_ranges[0][:2]
    built = drive(
        DOUBLE_ROCKER,
        GRAVITY,
        start=0.3,
        rate=rate,
        method=method,
        restitution=restitution,
    )
    now = BEGIN
    built.state(now)
    for wait, effort in commanded:
        now += wait
        assert built.offer(command(effort), now) is GOOD
        for ahead in (0, MS // 3, 5 * MS):
            angles, rates, accelerations, _ = built.state(now + ahead)
            assert low < angles[0] < high
            assert DOUBLE_ROCKER.position(*angles).status is Status.CLOSED
            assert all(map(isfinite, rates + accelerations))


@pytest.mark.parametrize('turns', [-2, 0, 3])
def test_start_whole_turns_away_keeps_the_same_range(turns):
    away = turns * 6.283185307179586
    built = drive(DOUBLE_ROCKER, start=0.3 + away, rate=50.0)
    built.state(BEGIN)
    end = built.state(BEGIN + SECOND)
    low, high = DOUBLE_ROCKER.input_ranges[0][:2]
    assert end.angles[0] - away == pytest.approx(high - 1e-3 * (high - low), abs=1e-9)
    assert end.rates == (0.0,)


MASSLESS = Closure(replace(shipped('four_bar'), masses={}))

OUT_OF_REACH = (
    'drive.torque.start: {} rad is not between the stops; reachable: -1.2987 to 1.2987 rad; '
    'start there, {} of the range or more from its ends'
)
UNBUILT = {
    'several inputs': (
        two_inputs(), {'on_timeout': 'brake', 'brake': 1.0},
        "masses: link 'left' has no mass, and forces are asked for; ",
    ),
    'no masses': (MASSLESS, {}, "masses: link 'crank' has no mass, and forces are asked for; "),
    'a start out of reach': (DOUBLE_ROCKER, {'start': 1.5}, OUT_OF_REACH.format(1.5, 0.001)),
    'a start behind the stop': (
        DOUBLE_ROCKER, {'start': 1.2, 'stop_margin': 0.1}, OUT_OF_REACH.format(1.2, 0.1),
    ),
    'no start for a slide': (
        EXCAVATOR, {},
        'drive.torque.start: 0 m is not between the stops; reachable: 0.682846 to 1.32285 m; ',
    ),
    'a brake without a moment': (
        WHEEL, {'on_timeout': 'brake'},
        'drive.torque.brake: the brake is 0 and holds nothing; write its torque or force, ',
    ),
    'a brake without a use': (
        WHEEL, {'brake': 2.0},
        'drive.torque.brake: the brake is never applied; add on_timeout: brake',
    ),
}  # fmt: skip


@pytest.mark.parametrize(('context', 'parameters', 'line'), UNBUILT.values(), ids=UNBUILT)
def test_invalid_torque_drive_is_refused_in_one_line(context, parameters, line):
    if isinstance(context, PlanarClosure):
        context = Context(context, 1000.0, True, 'seed', None, None)
    with pytest.raises(DefinitionError) as raised:
        TorqueDrive(**parameters).build(context)
    assert str(raised.value).startswith(line)


def test_torque_drive_without_inertia_is_refused():
    still = Closure(
        replace(WHEEL.linkage, masses=dict.fromkeys(WHEEL.linkage.masses, Mass(5e-324, (0, 0), 0)))
    )
    with pytest.raises(DefinitionError, match='at 0 rad nothing can be moved'):
        drive(still)


def scene(drive_text, effects=''):
    text = f'drive: {{torque: {drive_text}}}\neffects: {{velocity: {{}}{effects}}}'
    return pipeline_of(text, (FOLDER / 'four_bar.yaml').read_bytes())


def test_scene_follows_effort_commands():
    pipeline = scene('{start: 0.5, rate: 0}')
    assert pipeline.topic == TorqueDrive.listens_to
    first = pipeline.tick(BEGIN).states[0].reading
    assert first.joints[0] == 0.5, 'the input is published first'
    message = serialized(['other', 'crank_joint'], efforts=[9.0, 0.02])
    assert pipeline.offer(message, BEGIN) is GOOD
    moved = pipeline.tick(BEGIN + 100 * MS).states[0].reading
    assert moved.joints[0] > 0.6
    assert moved.rates[0] > 1.0
    spoilt = serialized(['crank_joint'], efforts=[nan])
    assert pipeline.offer(spoilt, BEGIN + 100 * MS) is Rejection.EFFORT_NOT_FINITE
    assert pipeline.newest_stamp == BEGIN


def test_torque_drive_reads_inputs_by_their_prefixed_names():
    context = replace(two_inputs(), prefix='left/')
    read = TorqueDrive().reader(context)
    assert read(serialized(['left/left_crank'], efforts=[2.0])).efforts == (2.0, None)


@pytest.mark.parametrize('start', [0.0, pi])
def test_torque_drive_passes_a_parallelogram_change_point(start):
    # The rod does not turn: I = (0.01 + 1·0.1²) of crank and of follower and 1·0.3² of the rod.
    inertia = 2 * (0.01 + 0.1**2) + 0.3**2
    pushed = drive(defect('par'), start=start - 0.02 * (start > 0))
    assert pushed.state(BEGIN).rates == (0.0,)
    pushed.offer(command(0.5), BEGIN)
    for ms in (1, 50, 99):
        crank = pushed.state(BEGIN + ms * MS)
        assert crank.accelerations[0] == pytest.approx(0.5 / inertia, rel=1e-9)
        assert crank.rates[0] == pytest.approx(0.5 / inertia * ms / 1000, rel=1e-9)
