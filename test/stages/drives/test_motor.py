# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A motor in the torque drive: motions in closed form, energy, timelines, and scipy's integrator.

Where a motion is to be in closed form, the links weigh next to nothing, and the inertia is 0.5.
The motor has k·N = 1, so a current of 1 A gives 1 N·m at the input without losses.
"""

from dataclasses import replace
from math import copysign, exp, log

from hypothesis import given, strategies as st
from linkage_ros.dynamics import AppliedLoads, JointLoad, Loads, Motor
from linkage_ros.errors import DefinitionError, FileError
from linkage_ros.kinematics import Closure
from linkage_ros.messages import EffortCommand
from linkage_ros.stages.drives import Context, MotorParameters, TorqueDrive
import pytest
from scipy.integrate import solve_ivp

from .test_torque import BEGIN, MS, scene, WHEEL
from ...dynamics.loaded import four_bar
from ...dynamics.test_kinks import ByHand, GRAVITY, LENGTHS, MASSES

INERTIA = 0.5
CONSTANT, RATIO, RESISTANCE = 0.05, 20.0, 0.8
TIME_CONSTANT = INERTIA * RESISTANCE / (CONSTANT * RATIO) ** 2
LOSSES = {'efficiency': 0.8, 'back_efficiency': 0.5}


def drive(motor, closure=WHEEL, loads=None, **parameters):
    motor = MotorParameters(
        **{
            'torque_constant': CONSTANT,
            'ratio': RATIO,
            'resistance': RESISTANCE,
            'command': 'voltage',
            **motor,
        }
    )
    parameters = {'timeout': 3600.0, 'method': 'gauss_legendre', **parameters}
    loads = loads or Loads(drive_inertia=INERTIA)
    context = Context(closure, 1000.0, True, 'seed', loads, None)
    return TorqueDrive(motor=motor, **parameters).build(context)


def under(built, command, milliseconds=2000, every=50):
    """Yield time, value, rate and acceleration under one command from the first tick on."""
    built.state(BEGIN)
    assert built.offer(EffortCommand(0, (command,)), BEGIN) is None
    for at in range(0, milliseconds + 1, every):
        state = built.state(BEGIN + at * MS)
        yield at * 1e-3, *state.angles, *state.rates, *state.accelerations


def run_up(t, voltage, start=0.0):
    """Return value and rate of a wheel under a voltage, which starts from 0 at a rate."""
    end, faded = voltage / (CONSTANT * RATIO), exp(-t / TIME_CONSTANT)
    return (
        end * t - (end - start) * TIME_CONSTANT * (1.0 - faded),
        end + (start - end) * faded,
    )


def constant_then_run_up(t, current, voltage):
    """Return value and rate under a current as long as the voltage suffices, then under this."""
    acceleration = CONSTANT * RATIO * current / INERTIA
    change = (voltage - RESISTANCE * current) / (CONSTANT * RATIO) / acceleration
    if t <= change:
        return 0.5 * acceleration * t * t, acceleration * t
    value, rate = run_up(t - change, voltage, acceleration * change)
    return 0.5 * acceleration * change**2 + value, rate


# Name: (motor, command, rate at the start, value and rate over the time).
RUN_UPS = {
    'a voltage': ({}, 12.0, 0.0, lambda t: run_up(t, 12.0)),
    'a voltage against the motion': ({}, -3.0, 5.0, lambda t: run_up(t, -3.0, 5.0)),
    'no voltage: its winding is short-circuited': ({}, 0.0, 5.0, lambda t: run_up(t, 0.0, 5.0)),
    'a voltage above that of the supply': ({'voltage': 9.0}, 12.0, 0.0, lambda t: run_up(t, 9.0)),
    'a voltage, while the current is limited': ({'current': 4.0}, 12.0, 0.0,
                                                lambda t: constant_then_run_up(t, 4.0, 12.0)),
    'a voltage, while the torque is limited': ({'torque': 4.0 * CONSTANT}, 12.0, 0.0,
                                               lambda t: constant_then_run_up(t, 4.0, 12.0)),
    'a current, until the supply gives no more': ({'command': 'current', 'voltage': 12.0}, 4.0,
                                                  0.0,
                                                  lambda t: constant_then_run_up(t, 4.0, 12.0)),
    'a current above its limit, and the supply': (
        {'command': 'current', 'voltage': 12.0, 'current': 4.0}, 40.0, 0.0,
        lambda t: constant_then_run_up(t, 4.0, 12.0),
    ),
    'an effort, until the supply gives no more': ({'command': 'effort', 'voltage': 12.0}, 4.0, 0.0,
                                                  lambda t: constant_then_run_up(t, 4.0, 12.0)),
    'an effort, with the losses of the gear': ({'command': 'effort', **LOSSES}, 1.0, 0.0,
                                               lambda t: (t * t, 2.0 * t)),
    'an effort that brakes, with more than the gear would drive': (
        {'command': 'effort', **LOSSES}, -1.0, 12.0,
        lambda t: (12.0 * t - 2.5 * t * t, 12.0 - 5.0 * t),
    ),
}  # fmt: skip


@pytest.mark.sample(4)
@pytest.mark.parametrize('name', RUN_UPS)
def test_motor_runs_up_a_wheel_in_closed_form(name):
    motor, command, rate, known = RUN_UPS[name]
    for t, *state, _ in under(drive(motor, rate=rate), command):
        assert state == pytest.approx(known(t), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    ('motor', 'command', 'known'),
    [
        ({}, 12.0, lambda rate: CONSTANT * (12.0 - CONSTANT * RATIO * rate) / RESISTANCE),
        ({'current': 4.0}, 12.0, lambda rate: CONSTANT * 4.0),
        ({'command': 'current', **LOSSES}, -3.0, lambda rate: CONSTANT * -3.0),
        ({'command': 'effort', **LOSSES}, 1.6, lambda rate: 1.6 / (RATIO * 0.8)),
    ],
)
def test_motor_torque_is_reported_before_the_gear(motor, command, known):
    built = drive(motor)
    for _, _, rate, _ in under(built, command, 200):
        *_, torque = built.motor
        assert torque == pytest.approx(known(rate), rel=1e-12)


def test_motor_has_the_stall_torque_and_no_load_speed():
    first, *_, last = under(drive({}, step=0.01), 12.0, 20_000, 1000)
    assert first[3] * INERTIA == pytest.approx(RATIO * CONSTANT * 12.0 / RESISTANCE, rel=1e-9)
    assert last[2] == pytest.approx(12.0 / (CONSTANT * RATIO), rel=1e-12)
    assert last[3] == pytest.approx(0.0, abs=1e-9)


def test_overdriven_motor_brakes_the_wheel():
    (_, _, rate, acceleration), *_ = under(
        drive({'command': 'current', 'voltage': 12.0}, rate=20.0), 0.0
    )
    current = (12.0 - CONSTANT * RATIO * rate) / RESISTANCE
    assert acceleration * INERTIA == pytest.approx(CONSTANT * RATIO * current, rel=1e-9)


def test_motor_without_a_command_exerts_no_torque():
    built = drive({}, rate=5.0, timeout=0.1)
    *_, (_, _, rate, acceleration) = under(built, 0.0, 300)
    assert rate == pytest.approx(run_up(0.1, 0.0, 5.0)[1], rel=1e-9)
    assert acceleration == 0.0


def with_effort_limit(most):
    (crank,) = WHEEL.linkage.inputs
    limited = replace(crank, limits=replace(crank.limits, effort=most))
    return Closure(replace(WHEEL.linkage, inputs=(limited,)))


@pytest.mark.parametrize(('command', 'value'), [('effort', 5.0), ('current', 9.0)])
def test_input_effort_limit_applies_behind_the_gear(command, value):
    built = drive({'command': command, **LOSSES}, with_effort_limit(2.0))
    _, (_, _, _, acceleration), *_ = under(built, value)
    assert acceleration * INERTIA == pytest.approx(2.0, rel=1e-9)
    assert built.saturated == (command == 'effort')


@pytest.mark.parametrize(
    ('current', 'rate', 'share'),
    [(3.0, 0.0, 0.8), (3.0, 2.0, 0.8), (-3.0, 20.0, 1 / 0.5), (3.0, -20.0, 1 / 0.5)],
)
def test_gear_efficiency_reduces_the_transmitted_power(current, rate, share):
    motor = {'command': 'current', **LOSSES}
    *_, (_, value, after, _) = under(drive(motor, rate=rate), current, 500)
    gained = 0.5 * INERTIA * (after**2 - rate**2)
    assert gained == pytest.approx(share * CONSTANT * current * RATIO * value, rel=1e-9)


# A motor with 1 N·m before the losses: a load that turns back the input, and its acceleration.
HELD = {-0.7: 0.2, -0.79: 0.02, -0.81: 0.0, -1.0: 0.0, -1.99: 0.0, -2.01: -0.02, -3.0: -2.0}


@pytest.mark.parametrize('load', HELD)
def test_lossy_gear_holds_a_load_at_rest(load):
    loads = Loads(
        drive_inertia=INERTIA, applied=AppliedLoads(efforts={'crank_joint': JointLoad(load)})
    )
    *_, (_, _, rate, acceleration) = under(
        drive({'command': 'current', **LOSSES}, loads=loads), 1.0, 100
    )
    assert acceleration == pytest.approx(HELD[load], rel=1e-9, abs=1e-12)
    assert rate == pytest.approx(0.1 * HELD[load], rel=1e-9, abs=1e-12)


def test_lossy_gear_stops_and_holds_against_a_load():
    loads = Loads(
        drive_inertia=INERTIA, applied=AppliedLoads(efforts={'crank_joint': JointLoad(-1.5)})
    )
    motor = {'command': 'current', **LOSSES}
    slowed = (1.5 - 0.8) / INERTIA
    *_, (_, value, rate, _) = under(drive(motor, loads=loads, rate=1.0), 1.0, 1000)
    assert rate == 0.0
    assert value == pytest.approx(0.5 / slowed, rel=1e-9)


# Name: (motor, timeout in ms, [(time in ms, current, or None and the acceleration)]): the input
# accelerates by 2 rad/s² for each ampere.
TIMELINES = {
    'a command waits': ({'delay': 0.03}, 100, [
        (0, 1.0, None), (29, None, 0.0), (30, None, 2.0), (129, None, 2.0), (130, None, 0.0),
    ]),
    'commands follow each other at their distance': ({'delay': 0.03}, 100, [
        (0, 1.0, None), (10, -2.0, None), (20, 3.0, None), (29, None, 0.0), (30, None, 2.0),
        (39, None, 2.0), (40, None, -4.0), (49, None, -4.0), (50, None, 6.0), (149, None, 6.0),
        (150, None, 0.0),
    ]),
    'they do so if nobody looks': ({'delay': 0.03}, 100, [
        (0, 1.0, None), (10, -2.0, None), (20, 3.0, None), (149, None, 6.0), (150, None, 0.0),
    ]),
    'one acts after the one before has run out': ({'delay': 0.03}, 20, [
        (0, 1.0, None), (25, 2.0, None), (30, None, 2.0), (49, None, 2.0), (50, None, 0.0),
        (54, None, 0.0), (55, None, 4.0), (75, None, 0.0),
    ]),
    'one acts as the one before runs out': ({'delay': 0.03}, 20, [
        (0, 1.0, None), (20, 2.0, None), (49, None, 2.0), (50, None, 4.0), (69, None, 4.0),
        (70, None, 0.0),
    ]),
    'of two at once the last acts': ({'delay': 0.03}, 20, [
        (0, 1.0, None), (0, 2.0, None), (30, None, 4.0), (50, None, 0.0),
    ]),
    'a command is rounded to the nearest quantum': ({'quantum': 0.25}, 100, [
        (0, 0.3, None), (1, None, 0.5), (2, 0.12, None), (3, None, 0.0), (4, -0.4, None),
        (5, None, -1.0), (6, 0.25, None), (7, None, 0.5),
    ]),
    'a command is rounded, then limited': ({'quantum': 0.5, 'current': 0.7}, 100, [
        (0, 0.9, None), (1, None, 1.4), (2, 0.6, None), (3, None, 1.0),
    ]),
}  # fmt: skip


@pytest.mark.parametrize('name', TIMELINES)
def test_motor_commands_follow_delay_and_timeout(name):
    motor, timeout, timeline = TIMELINES[name]
    built = drive({'command': 'current', **motor}, timeout=timeout * 1e-3)
    built.state(BEGIN)
    for at, current, acceleration in timeline:
        now = BEGIN + at * MS
        if acceleration is None:
            assert built.offer(EffortCommand(0, (current,)), now) is None
        else:
            found = built.state(now).accelerations[0]
            assert found == pytest.approx(acceleration, rel=1e-9, abs=1e-12), at


def test_motor_delay_is_exact_to_the_nanosecond():
    built = drive({'command': 'current', 'delay': 0.000_700_001}, timeout=0.1)
    built.state(BEGIN)
    built.offer(EffortCommand(0, (1.0,)), BEGIN)
    assert built.state(BEGIN + 700_000).accelerations == (0.0,)
    assert built.state(BEGIN + 700_001).accelerations[0] == pytest.approx(2.0)
    later = 0.1 - 0.000_700_001
    assert built.state(BEGIN + 100 * MS).rates[0] == pytest.approx(2.0 * later, rel=1e-9)


# A four-bar with weight under a voltage: limited by the current, then by the voltage; then its
# weight drives the motor, at more than 16 rad/s, and does so no longer.
HEAVY = ByHand(MASSES, {})
GEARED = {
    'torque_constant': 0.05,
    'ratio': 20.0,
    'resistance': 4.0,
    'current': 3.0,
    'efficiency': 0.85,
    'back_efficiency': 0.7,
}
VOLTAGE, ADDED, AT_FIRST, SECONDS = 16.0, 0.002, 0.3, 0.5


def crosses(rate, direction):
    def event(_, state):
        return state[1] - rate

    event.terminal, event.direction = True, direction
    return event


# In turn: the effort over the rate, the event that ends it, and what comes then.
PIECES = {
    'limited': (lambda w: 0.85 * 3.0, crosses(VOLTAGE - 4.0 * 3.0, 1), 'driving'),
    'driving': (lambda w: 0.85 * (VOLTAGE - w) / 4.0, crosses(VOLTAGE, 1), 'driven'),
    'driven': (lambda w: (VOLTAGE - w) / 4.0 / 0.7, crosses(VOLTAGE, -1), 'driving'),
}


def slope(function, q, h=1e-3):
    near, far = (function(q + n * h) - function(q - n * h) for n in (1, 2))
    return (8.0 * near - far) / (12.0 * h)


def four_bar_by_scipy():
    """Return value and rate of the crank at the end, and the number of pieces."""
    time, state, following, count = 0.0, (AT_FIRST, 0.0), 'limited', 0
    while time < SECONDS:
        effort, end, following = PIECES[following]

        def motion(_, state, effort=effort):
            q, w = map(float, state)
            push = effort(w) - slope(HEAVY.potential, q) - 0.5 * slope(HEAVY.inertia, q) * w * w
            return w, push / (ADDED + HEAVY.inertia(q))

        span = (time, SECONDS)
        piece = solve_ivp(motion, span, state, 'DOP853', rtol=1e-11, atol=1e-11, events=end)
        time, state, count = piece.t[-1], piece.y[:, -1], count + 1
    return *state, count


def four_bar_by_drive(method, step):
    built = drive(
        GEARED,
        four_bar(MASSES, *LENGTHS),
        Loads((0.0, -GRAVITY), drive_inertia=ADDED),
        start=AT_FIRST,
        method=method,
        step=step,
    )
    *_, (_, value, rate, _) = under(built, VOLTAGE, round(SECONDS * 1e3), round(SECONDS * 1e3))
    return value, rate


def test_motor_driven_four_bar_follows_scipy():
    *known, count = four_bar_by_scipy()
    assert count == 6, 'the current is limited no longer, then the power turns four times'
    assert four_bar_by_drive('gauss_legendre', 1e-3) == pytest.approx(known, rel=1e-8)
    errors = [abs(four_bar_by_drive('rk4', step)[1] - known[1]) for step in (4e-3, 2e-3)]
    assert log(errors[0] / errors[1]) / log(2.0) > 3.5


# Name: (motor, what its line says).
WRONG = {
    'more out than in': (
        'torque_constant: 1.0, efficiency: 1.1',
        r'scene\.yaml:\d+: drive\.torque\.motor\.efficiency: 1\.1 is out of bounds; ',
    ),
    'no efficiency': ('torque_constant: 1.0, back_efficiency: 0', r'motor\.back_efficiency: '),
    'a voltage without a resistance': (
        'torque_constant: 1.0, command: voltage',
        r'scene\.yaml:\d+: drive\.torque\.motor\.resistance: it is 0 Ω, and a voltage would',
    ),
    'a supply without a resistance': (
        'torque_constant: 1.0, voltage: 24.0', r'motor\.resistance: it is 0 Ω'
    ),
    'a negative ratio': ('torque_constant: 1.0, ratio: -3.0', r'motor\.ratio: .*-3'),
    'no constant': ('ratio: 3.0', r'motor.*torque_constant'),
    'a step that is too long': (
        'torque_constant: 1.0, command: voltage, resistance: 0.1',
        r'motor: it follows its voltage too fast for a step of 0\.001 s: .*/s there; ',
    ),
    'another command': ('torque_constant: 1.0, command: power', r'motor\.command: .*voltage'),
}  # fmt: skip


@pytest.mark.parametrize('name', WRONG)
def test_invalid_motor_is_refused_in_one_line(name):
    motor, line = WRONG[name]
    with pytest.raises(FileError, match=line) as raised:
        scene(f'{{motor: {{{motor}}}}}')
    assert '\n' not in str(raised.value)


@pytest.mark.parametrize(('method', 'carried'), [('rk4', 2.5), ('gauss_legendre', 1.5)])
def test_longest_step_is_a_multiple_of_the_time_constant(method, carried):
    fast = {'resistance': RESISTANCE / 10, 'back_efficiency': 0.5}
    longest = carried * TIME_CONSTANT / 10 * 0.5
    drive(fast, method=method, step=0.999 * longest)
    with pytest.raises(DefinitionError, match='too fast'):
        drive(fast, method=method, step=1.001 * longest)


def positive(least, most):
    return st.floats(log(least), log(most)).map(exp)


@given(
    command=st.sampled_from(['effort', 'current', 'voltage']),
    value=st.floats(-100.0, 100.0),
    parameters=st.tuples(
        positive(1e-3, 1.0), positive(1e-2, 10.0), positive(0.1, 300.0), positive(0.01, 1.0),
        positive(0.01, 1.0), positive(0.1, 1e3), positive(0.1, 1e3),
    ),
    rate=st.floats(-1e4, 1e4),
)  # fmt: skip
def test_motor_law_segments_equal_the_motor_equation(command, value, parameters, rate):
    k, resistance, ratio, forward, backward, most, supply = parameters
    motor = Motor(k, resistance, ratio, forward, backward, most, supply, command)
    law = motor.effort_law(value)
    emf = k * ratio * rate
    if command == 'voltage':
        current = (min(max(value, -supply), supply) - emf) / resistance
    else:
        current = value if command == 'current' else value / (k * ratio * forward)
    current = min(max(current, -most), most)
    current = min(max(current, (-supply - emf) / resistance), (supply - emf) / resistance)
    known = k * ratio * current * (forward if current * rate >= 0.0 else 1.0 / backward)
    segment = law.segment(0.0, rate, 0.0)
    assert law.margin(segment, 0.0, rate, 0.0) >= 0.0
    found = law.force(segment, 0.0, rate, 0.0)
    if rate:
        found -= copysign(law.holding, rate)
        rounding = k * ratio / backward * (supply + abs(emf)) / resistance
        assert found == pytest.approx(known, rel=1e-9, abs=1e-12 * rounding + 1e-9 * law.holding)
    else:
        assert abs(found - k * ratio * current * forward) <= law.holding * (1.0 + 1e-9) + 1e-12
