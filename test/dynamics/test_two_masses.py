# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Motor and crank with play between them: two wheels in closed form, a four-bar by scipy's events.

Without other forces the momentum J·φ̇ + I·q̇ is the impulse of the drive, whatever the meetings.
"""

from dataclasses import replace
from math import exp, sqrt, tau

from linkage_ros.dynamics import Loads, Mechanics, METHODS, SingleDofMechanism, Terms, TwoMasses
from linkage_ros.errors import FileError
from linkage_ros.kinematics import Closure
from linkage_ros.messages import EffortCommand
import pytest
from scipy.integrate import solve_ivp

from .loaded import BEGIN, shipped
from ..support.messages import read_joint_state
from ..support.scenes import PENDULUM, pipeline_of

CRANK, MOTOR, PLAY, TORQUE = 0.23, 0.1, 0.02, 0.4
EXACT = ('rk4', 'gauss_legendre')


def wheels(restitution=0.0, method='rk4', friction=0.0, slope=0.0):
    crank = SingleDofMechanism(
        lambda _: Terms(CRANK, 0.0, slope, 0.0, friction), METHODS[method].step
    )
    return TwoMasses.from_motor(crank, MOTOR, PLAY, restitution)


def run(mechanism, seconds, force, *, step=1e-3, rate=0.0, brake=0.0, motion=None):
    """Return the state after some seconds, and the states at each step before."""
    motion = motion or mechanism.state_at(0.0, rate)
    states = [motion]
    for _ in range(round(seconds / step)):
        states.append(mechanism.advance(states[-1], step, force, brake))
    return states


@pytest.mark.parametrize('method', EXACT)
def test_motor_crosses_the_play_and_drives_the_crank(method):
    # The motor alone over half the play, p/2 = τ·t²/(2·J); then both as one.
    meets = sqrt(PLAY * MOTOR / TORQUE)
    rate = TORQUE / MOTOR * meets * MOTOR / (CRANK + MOTOR)
    for index, state in enumerate(run(wheels(method=method), 0.2, TORQUE)):
        t = 1e-3 * index
        if t < meets:
            assert state.crank.value == state.crank.rate == 0.0
            assert state.motor.value == pytest.approx(0.5 * TORQUE / MOTOR * t * t, abs=1e-15)
        else:
            since = t - meets
            expected = rate * since + 0.5 * TORQUE / (CRANK + MOTOR) * since**2
            assert state.crank.value == pytest.approx(expected, abs=1e-12)
            assert state.motor.value - state.crank.value == pytest.approx(PLAY / 2.0, abs=1e-15)


@pytest.mark.parametrize('restitution', [0.3, 0.7])
def test_motor_bounces_on_the_crank_by_restitution(restitution):
    # The distance to the crank falls with a = τ/J. It bounces with e·r, e²·r, …: after
    # t₀·(1 + 2·e/(1 − e)) they stay together, with the momentum of the whole impulse.
    first = sqrt(PLAY * MOTOR / TORQUE)
    ends = first * (1.0 + 2.0 * restitution / (1.0 - restitution))
    states = run(wheels(restitution), 0.5, TORQUE)
    for index, state in enumerate(states):
        t = 1e-3 * index
        momentum = MOTOR * state.motor.rate + CRANK * state.crank.rate
        assert momentum == pytest.approx(TORQUE * t, abs=1e-12)
        assert abs(state.motor.value - state.crank.value) <= PLAY / 2.0 + 1e-12
        if t > ends + 2e-3:
            assert state.side == 1
            assert state.crank.rate == pytest.approx(TORQUE * t / (CRANK + MOTOR), rel=1e-9)
    # Just before the second meeting the gap is that of the first flight back.
    closing = TORQUE / MOTOR * first
    t = round(first + restitution * closing / (TORQUE / MOTOR), 3)
    since = t - first
    gap = restitution * closing * since - 0.5 * TORQUE / MOTOR * since**2
    state = states[round(1e3 * t)]
    assert PLAY / 2.0 - (state.motor.value - state.crank.value) == pytest.approx(gap, abs=1e-9)


def test_play_impact_loses_the_relative_kinetic_energy():
    mechanism = wheels(0.6)
    begin = mechanism.state_at(0.0, 0.0)
    begin = begin._replace(motor=begin.motor._replace(rate=3.0))
    end = mechanism.advance(begin, 0.005, 0.0)  # p/2 = 10 mrad at 3 rad/s: after 3.3 ms
    energy = 0.5 * (MOTOR * end.motor.rate**2 + CRANK * end.crank.rate**2)
    lost = 0.5 * CRANK * MOTOR / (CRANK + MOTOR) * (1.0 - 0.6**2) * 3.0**2
    assert energy == pytest.approx(0.5 * MOTOR * 3.0**2 - lost, rel=1e-12)
    assert end.motor.rate - end.crank.rate == pytest.approx(-0.6 * 3.0, rel=1e-12)


def test_reversed_torque_moves_the_motor_across_the_play():
    mechanism = wheels()
    driven = run(mechanism, 0.2, TORQUE)[-1]
    assert driven.side == 1
    rate, value = driven.crank.rate, driven.crank.value
    crosses = sqrt(2.0 * PLAY * MOTOR / TORQUE)
    free = run(mechanism, 0.09, -TORQUE, motion=driven)
    for index, state in enumerate(free[: int(1e3 * crosses)]):
        t = 1e-3 * index
        assert state.crank.rate == rate
        expected = value + PLAY / 2.0 + rate * t - 0.5 * TORQUE / MOTOR * t * t
        assert state.motor.value == pytest.approx(expected, abs=1e-13)
    last = run(mechanism, 0.12, -TORQUE, motion=driven)[-1]
    assert last.side == -1
    momentum = (CRANK + MOTOR) * rate - TORQUE * 0.12
    assert last.crank.rate == pytest.approx(momentum / (CRANK + MOTOR), rel=1e-12)


def test_weighted_crank_hangs_on_a_braked_motor():
    # A weight of 0.5 N·m draws it backward; the motor's brake holds 2 N·m.
    states = run(wheels(slope=0.5), 0.3, 0.0, brake=2.0)
    falls = sqrt(PLAY * CRANK / 0.5)
    for index, state in enumerate(states):
        t = 1e-3 * index
        if t < falls:
            assert state.crank.value == pytest.approx(-0.25 / CRANK * t * t, abs=1e-14)
            assert state.motor.value == state.motor.rate == 0.0
    assert states[-1].crank.rate == 0.0
    assert states[-1].side == 1  # the motor bears the crank from below
    assert states[-1].motor.value - states[-1].crank.value == pytest.approx(PLAY / 2.0)


def test_friction_holds_the_crank_until_the_motor_meets():
    states = run(wheels(friction=0.3), 0.2, TORQUE)
    assert states[40].crank.value == 0.0
    meets = sqrt(PLAY * MOTOR / TORQUE)
    rate = TORQUE * meets / (CRANK + MOTOR)
    since = 0.2 - meets
    expected = rate * since + 0.5 * (TORQUE - 0.3) / (CRANK + MOTOR) * since**2
    assert states[-1].crank.value == pytest.approx(expected, rel=1e-10)


def test_infinite_play_bounces_keep_the_momentum():
    for restitution in (0.9, 0.99, 1.0):
        states = run(wheels(restitution), 3.0, TORQUE, step=0.01)
        momentum = MOTOR * states[-1].motor.rate + CRANK * states[-1].crank.rate
        assert momentum == pytest.approx(TORQUE * 3.0, rel=1e-9)
        assert abs(states[-1].motor.value - states[-1].crank.value) <= PLAY / 2.0 + 1e-12


# A crank that turns at 1 rad/s with its motor, at one end of the play, comes to its stop at 1 rad
# after a second. (restitution of the stop, of the play, side of the motor) and in turn: (seconds,
# rates of crank and motor). Of the motor's momentum 0.1 and the crank's -0.115, if it bounces, a
# meeting without a bounce leaves -0.015/0.33 = -1/22; a stop that bears the crank is a wall.
AT_A_STOP = {
    'the motor pushes, and both rest': (0.0, 0.0, 1, [(0.99, 1.0, 1.0), (1.01, 0.0, 0.0)]),
    'the motor pushes, and bounces back over the play': (
        0.0, 0.5, 1, [(1.01, 0.0, -0.5), (1.03, 0.0, -0.5), (1.05, -5 / 22, 1 / 44)],
    ),
    'the motor is drawn, and goes on over the play': (
        0.0, 0.0, -1, [(0.99, 1.0, 1.0), (1.01, 0.0, 1.0), (1.019, 0.0, 1.0), (1.03, 0.0, 0.0)],
    ),
    'the motor is drawn, goes on and bounces back': (
        0.0, 0.5, -1, [(1.01, 0.0, 1.0), (1.03, 0.0, -0.5), (1.07, -5 / 22, 1 / 44)],
    ),
    'the crank bounces against the motor that pushes': (
        0.5, 0.0, 1, [(0.99, 1.0, 1.0), (1.01, -1 / 22, -1 / 22)],
    ),
    'the crank bounces, and meets the motor that it drew': (
        0.5, 0.0, -1, [(1.005, -0.5, 1.0), (1.013, -0.5, 1.0), (1.02, -1 / 22, -1 / 22)],
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', AT_A_STOP)
@pytest.mark.parametrize('end', [1.0, -1.0])
def test_stop_holds_the_crank_but_not_the_motor(name, end):
    of_stop, of_play, side, timeline = AT_A_STOP[name]
    mechanism = wheels(of_play)
    stopped = {'stops': (-1.0, 1.0), 'restitution': of_stop}
    crank = replace(mechanism.crank, **stopped)
    mechanism = TwoMasses.from_motor(crank, MOTOR, PLAY, of_play)
    begin = mechanism.state_at(0.0, end)
    begin = begin._replace(
        motor=begin.motor._replace(value=end * side * PLAY / 2.0), side=round(end * side)
    )
    states = run(mechanism, 1.2, 0.0, motion=begin)
    for seconds, *rates in timeline:
        state = states[round(1e3 * seconds)]
        found = end * state.crank.rate, end * state.motor.rate
        assert found == pytest.approx(tuple(rates), abs=1e-9), seconds


def test_motor_bounces_on_a_crank_at_its_stop():
    crank = SingleDofMechanism(
        lambda _: Terms(CRANK, 0.0, -5.0, 0.0, 0.0), METHODS['rk4'].step, (-1.0, 0.0)
    )
    mechanism = TwoMasses.from_motor(crank, MOTOR, PLAY, 0.5)
    begin = mechanism.state_at(0.0, 0.0)
    begin = begin._replace(motor=begin.motor._replace(rate=1.0))
    states = run(mechanism, 0.03, 0.0, motion=begin)
    assert [(state.crank.rate, state.motor.rate) for state in states[::15]] == [
        (0.0, 1.0), (0.0, -0.5), (0.0, -0.5),
    ]  # fmt: skip


# A four-bar under its weight, whose motor goes to and fro: scipy integrates each flight and each
# contact, with an event at its end.


def by_scipy(mechanics, restitution, times, force):
    position, terms = mechanics.closure.position, mechanics.motion_terms

    def alone(q, w):
        at = terms(position(q))
        return -(at.potential_slope + at.half_slope * w * w) / at.inertia

    def together(t, q, w):
        at = terms(position(q))
        return (force(t) - at.potential_slope - at.half_slope * w * w) / (at.inertia + MOTOR)

    t, state, side = 0.0, [1.0, 0.0, 1.0, 0.0], 0
    found = []
    while True:
        if side:
            slopes = lambda t, y: [y[1], together(t, *y[:2])] * 2  # noqa: E731
            event = lambda t, y, s=side: s * (force(t) / MOTOR - alone(*y[:2]))  # noqa: E731
            event.direction = -1
            events = [event]
        else:
            slopes = lambda t, y: [y[1], alone(*y[:2]), y[3], force(t) / MOTOR]  # noqa: E731
            upper = lambda _, y: y[2] - y[0] - PLAY / 2.0  # noqa: E731
            lower = lambda _, y: y[2] - y[0] + PLAY / 2.0  # noqa: E731
            upper.direction, lower.direction = 1, -1
            events = [upper, lower]
        for each in events:
            each.terminal = True
        done = solve_ivp(
            slopes, (t, times[-1]), state, 'DOP853', events=events, rtol=1e-11, atol=1e-12,
            max_step=0.01, t_eval=[at for at in times if at > t],
        )  # fmt: skip
        found += [tuple(column) for column in done.y.T]
        hit = [(when[0], index) for index, when in enumerate(done.t_events) if len(when)]
        if not hit:
            return found
        t, number = hit[0]
        q, w, phi, omega = done.y_events[number][0]
        if side:
            state, side = [q, w, phi, omega], 0
            state[2] -= 1e-15 * (1 if phi > q else -1)
            continue
        inertia = terms(position(q)).inertia
        side = 1 if number == 0 else -1
        r, common = omega - w, (MOTOR * omega + inertia * w) / (MOTOR + inertia)
        back = restitution * r / (MOTOR + inertia)
        state = [q, common + MOTOR * back, phi, common - inertia * back]
        if restitution:
            side = 0


@pytest.mark.parametrize(
    ('restitution', 'method'), [(0.0, 'rk4'), (0.0, 'gauss_legendre'), (0.5, 'rk4')]
)
def test_four_bar_behind_play_follows_scipy(restitution, method):
    closure = Closure(shipped('four_bar'))
    mechanics = Mechanics(closure, Loads((0.0, -9.81), drive_inertia=0.02))
    crank = SingleDofMechanism(mechanics.motion_equation, METHODS[method].step)
    mechanism = TwoMasses.from_motor(crank, MOTOR, PLAY, restitution)

    def force(t):
        return 0.3 if t < 0.3 else -0.45

    times = [0.05 * n for n in range(1, 13)]
    if restitution:
        times = [0.02, 0.05, 0.08]
    expected = by_scipy(mechanics, restitution, times, force)
    motion, now, found = mechanism.state_at(1.0, 0.0), 0, []
    while now < round(times[-1] * 1000):
        motion = mechanism.advance(motion, 1e-3, force(1e-3 * now), 0.0, 1e-3 * now)
        now += 1
        if any(abs(1e-3 * now - t) < 1e-9 for t in times):
            found.append((*motion.crank[:2], *motion.motor[:2]))
    assert len(found) == len(expected) == len(times)
    for one, other in zip(found, expected, strict=True):
        assert one == pytest.approx(other, abs=2e-8)


SCENE = """
rate: 500
drive: {torque: {DRIVE}}
loads: {LOADS}
effects: {velocity: {}, effort: {}}
"""


def read(drive, commands=(), ticks=200, loads=''):
    """Return motor and crank, their values and rates, at each tick of a pendulum's scene."""
    (linkage,) = pipeline_of(
        SCENE.replace('DRIVE', drive).replace('LOADS', loads), PENDULUM
    ).linkages
    found = []
    for index in range(ticks):
        now = BEGIN + 2_000_000 * index
        for tick, effort in commands:
            if tick == index:
                assert linkage.drive.offer(EffortCommand(0, (effort,)), now) is None
        reading = linkage.interpret(now).reading
        found.append((*linkage.drive.motor[:2], reading.joints[0], reading.rates[0]))
    return found


def test_scene_with_play_delays_the_crank():
    # 0.4 N·m on the motor for a tick of 2 ms, then none: it drifts, and takes the crank along.
    drive = f'play: {{width: {PLAY}, inertia: {MOTOR}}}, timeout: 0.002'
    found = read(drive, [(0, TORQUE)])
    impulse = TORQUE * 0.002
    assert found[1][1] == pytest.approx(impulse / MOTOR, rel=1e-12)
    meets = 0.001 + PLAY / 2.0 * MOTOR / impulse
    for number, (motor, _, crank, rate) in enumerate(found[1:], 1):
        t = 0.002 * number
        if t < meets:
            assert crank == rate == 0.0
        else:
            assert rate == pytest.approx(impulse / (MOTOR + CRANK), rel=1e-9)
            assert motor - crank == pytest.approx(PLAY / 2.0, rel=1e-9)


def test_motor_within_its_play_accelerates_without_the_crank():
    # k = 0.1, R = 1: alone its time constant is J·R/(k·N)² = 25 ms, and it ends at V/(k·N).
    motor = 'motor: {torque_constant: 0.1, resistance: 1, ratio: 2, command: voltage}'
    drive = f'{motor}, play: {{width: 10, inertia: 0.001}}, timeout: 10'
    found = read(drive, [(0, 6.0)], 60)
    for index, (angle, rate, crank, _) in enumerate(found):
        t = 0.002 * index
        assert crank == 0.0
        assert rate == pytest.approx(60.0 * (1.0 - exp(-t / 0.025)), abs=1e-6)
        assert angle == pytest.approx(60.0 * (t - 0.025 * (1.0 - exp(-t / 0.025))), abs=1e-6)


@pytest.mark.parametrize(
    ('play', 'line'),
    [
        ('{inertia: 1}', "the key 'width' is missing"),
        ('{width: 0.01}', "the key 'inertia' is missing"),
        ('{width: 0, inertia: 1}', 'width: 0 is out of bounds'),
        ('{width: 0.01, inertia: 0}', 'inertia: 0 is out of bounds'),
        ('{width: 0.01, inertia: 1, restitution: 2}', 'restitution: 2 is out of bounds'),
    ],
)
def test_invalid_play_is_refused(play, line):
    with pytest.raises(FileError, match=line):
        read(f'play: {play}')


@pytest.mark.parametrize('counts', [0, 100])
def test_motor_joint_state_is_published_behind_play(counts):
    drive = f'play: {{width: 1, inertia: 0.1}}, rate: 2, motor_encoder: {{counts: {counts}}}'
    motor = 'motor: {torque_constant: 0.1, ratio: 50}'
    scene = SCENE.replace('DRIVE', f'{drive}, {motor}').replace('LOADS', '')
    pipeline = pipeline_of(scene, PENDULUM)
    (extra,) = pipeline.extras
    assert (extra.topic, extra.message) == ('~/motor', 'sensor_msgs/msg/JointState')
    for index in range(30):
        (message,) = pipeline.tick(BEGIN + 2_000_000 * index).extras
        state = read_joint_state(message)
        angle = 50.0 * 2.0 * 0.002 * index
        assert list(state.name) == ['drive_joint_motor']
        if not counts:
            assert state.position[0] == pytest.approx(angle, abs=1e-9)
            assert state.velocity[0] == pytest.approx(100.0)
            continue
        count = state.position[0] * counts / tau
        assert count == pytest.approx(round(count), abs=1e-9)
        assert -1e-9 < angle - state.position[0] < tau / counts
        steps = state.velocity[0] * 0.002 * counts / tau
        assert steps == pytest.approx(round(steps), abs=1e-6)
        assert abs(state.velocity[0] - 100.0) < tau / counts / 0.002 or index == 0
