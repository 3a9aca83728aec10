# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Several inputs moved by forces: against multipliers, by energy and momentum, at stops."""

from dataclasses import replace
from math import inf

from linkage_ros.dynamics import (
    AppliedLoads,
    behind_play,
    JointLoad,
    JointSpring,
    Loads,
    Mechanics,
    METHODS,
    MotorPlay,
    SeveralDofMechanism,
    SoftStop,
)
from linkage_ros.kinematics import Limits, PlanarClosure
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from .loaded import closed, everywhere as everywhere_in_plane, loads_of
from .test_in_space import everywhere, GRAVITY, motion_of, weighed
from ..kinematics.space.test_linkages import states_of
from ..support.multipliers import AbsoluteMotion

SEVERAL = ['five_bar', 'delta', 'ankle', 'ankle_motors', 'hexapod']
FREE = -inf, inf


def several(name):
    """Return a closure of several inputs, and values of them away from toggles."""
    if name == 'five_bar':
        return closed(name), [1.2, 1.9]
    closure = weighed(name)
    return closure, [*closure.linkage.pose.inputs]


def mechanism(mechanics, stops=None, method='rk4', **given):
    count = len(mechanics.closure.input_names)
    step, stops = METHODS[method].step, stops or (FREE,) * count
    return SeveralDofMechanism(mechanics.input_equation, step, stops, laws=mechanics.laws, **given)


def loaded(closure):
    """Return mechanics with gravity, springs and loads on every joint and point."""
    if isinstance(closure, PlanarClosure):
        loads = replace(loads_of(closure.linkage, 3.0), applied=everywhere_in_plane(closure))
    else:
        loads = Loads(GRAVITY, drive_inertia=0.01, applied=everywhere(closure))
    return Mechanics(closure, loads)


@pytest.mark.parametrize('name', SEVERAL)
def test_input_equation_equals_the_drive_efforts(name):
    closure, start = several(name)
    mechanics = loaded(closure)
    random = np.random.default_rng(7)
    states = states_of(closure, 4, 0.1)
    if name == 'five_bar':
        states = [(start, random.normal(size=2).tolist(), [0.3, -2.0])]
    for inputs, rates, changes in states:
        found = mechanics.input_terms(closure.close_unlimited(*inputs), rates)
        matrix = np.zeros((len(inputs),) * 2)
        matrix[np.tril_indices(len(inputs))] = found.matrix
        matrix += np.tril(matrix, -1).T
        assert np.array(found.mobility) @ matrix == pytest.approx(np.eye(len(inputs)), abs=1e-9)
        pushed = np.zeros(len(inputs))
        for law, at in zip(mechanics.laws, found.laws, strict=True):
            segment = law.segment(at.value, at.rate, 0.7)
            pushed += law.force(segment, at.value, at.rate, 0.7) * np.array(at.levers)
        given = mechanics.applied.given_after(0.7)
        efforts = mechanics.drive_efforts(*motion_of(closure, inputs, rates, changes), given)
        expected = matrix @ changes + found.bias - pushed
        assert efforts == pytest.approx(expected, rel=1e-10, abs=1e-10)
        assert mechanics.input_equation(inputs, rates) == found


def by_multipliers(closure, start, until, efforts, loads=lambda _: ()):
    """Return values and rates at a time, [s], integrated with accelerations by multipliers."""
    count = len(efforts)

    def slope(_, state):
        q, w = state[:count], state[count:]
        columns = []
        for change in np.vstack([np.zeros(count), np.eye(count)]):
            motion = AbsoluteMotion(closure, q, w, change)
            columns.append(motion.efforts(GRAVITY, loads(motion)))
        bare = columns[0]
        matrix = np.array(columns[1:]) - bare
        return np.concatenate([w, np.linalg.solve(matrix.T, np.array(efforts) - bare)])

    return solve_ivp(slope, (0.0, until), start, method='DOP853', rtol=1e-8, atol=1e-10).y[:, -1]


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ('name', 'efforts'),
    [
        ('delta', [-1.0, 0.3, 0.5]),
        ('ankle', [0.03, -0.02]),
        ('ankle_motors', [0.06, -0.05]),
    ],
)
def test_several_inputs_move_as_in_absolute_coordinates(name, efforts):
    closure, start = several(name)
    joint = closure.joint_names[0]
    applied = AppliedLoads({joint: JointSpring(0.2, 0.1, 0.02)}, {}, {})
    mechanics = Mechanics(closure, Loads(GRAVITY, applied=applied))

    def loads(motion):
        position = motion.closure.close_unlimited(*motion.inputs)
        value = position.joints[closure.joint_names.index(joint)]
        return list(
            motion.joint_loads(joint, -0.2 * (value - 0.1) - 0.02 * motion.joint_rate(joint))
        )

    moved = mechanism(mechanics)
    state = moved.state_at(start, [0.5] * len(start))
    for _ in range(40):
        state = moved.advance(state, 1e-3, efforts)
    begin = [*start, *[0.5] * len(start)]
    expected = by_multipliers(closure, begin, 0.04, efforts, loads)
    assert np.abs(expected[: len(start)] - start).max() > 0.02, 'it moves'
    assert (*state.value, *state.rate) == pytest.approx(tuple(expected), rel=1e-6, abs=1e-8)


@pytest.mark.sample(2)
@pytest.mark.parametrize(('method', 'within'), [('rk4', 1e-7), ('gauss_legendre', 1e-11)])
@pytest.mark.parametrize('name', ['five_bar', 'delta', 'ankle'])
def test_undamped_linkage_of_several_inputs_keeps_energy(name, method, within):
    closure, start = several(name)
    inputs = zip(closure.input_names, start, strict=True)
    springs = {joint: JointSpring(3.0, value) for joint, value in inputs}
    gravity = GRAVITY if name != 'five_bar' else GRAVITY[:2]
    mechanics = Mechanics(closure, Loads(gravity, applied=AppliedLoads(springs)))
    moved = mechanism(mechanics, method=method)
    state = moved.state_at(start, [0.1] * len(start))
    energies, values = [], []
    for _ in range(1000):
        state = moved.advance(state, 1e-3, [0.0] * len(start))
        position = closure.close_unlimited(*state.value)
        energies.append(mechanics.total_energy(position, *state.rate))
        values.append(state.value)
    assert np.ptp(values, axis=0).max() > 0.1, 'it moves'
    assert np.ptp(energies) < within


@pytest.mark.parametrize('restitution', [1.0, 0.4, 0.0])
def test_stop_impact_changes_only_the_stopped_input_momentum(restitution):
    closure, start = several('delta')
    mechanics = Mechanics(closure, Loads())
    end = start[0] + 0.02
    moved = mechanism(mechanics, ((-inf, end), FREE, FREE), restitution=restitution)
    before = moved.state_at(start, [2.0, -1.0, 0.5])
    free = mechanism(mechanics)
    fractions = np.linspace(0.0, 0.02, 200)
    touching = next(t for t in fractions if free.advance(before, t, [0.0] * 3).value[0] >= end)
    # Next to the impact: momenta M·q̇ just before and just after it.
    at, after = touching - 2e-4, touching + 2e-4
    one, other = free.advance(before, at, [0.0] * 3), moved.advance(before, after, [0.0] * 3)
    momenta = [
        np.array([sum(s.terms.inertia(i, j) * s.rate[j] for j in range(3)) for i in range(3)])
        for s in (one, other)
    ]
    assert one.rate[0] > 0.0
    assert other.rate[0] == pytest.approx(-restitution * one.rate[0], abs=2e-2)
    assert momenta[0][1:] == pytest.approx(momenta[1][1:], abs=2e-4)
    energies = [0.5 * p @ s.rate for p, s in zip(momenta, (one, other), strict=True)]
    if restitution == 1.0:
        assert energies[0] == pytest.approx(energies[1], rel=1e-9)
    else:
        assert energies[1] < energies[0]


def test_pushed_input_rests_at_its_stop_until_pulled():
    closure, start = several('delta')
    mechanics = Mechanics(closure, Loads(GRAVITY))
    end = start[0] + 0.01
    moved = mechanism(mechanics, ((-inf, end), FREE, FREE))
    state = moved.state_at(start, [0.0] * 3)
    for _ in range(100):
        state = moved.advance(state, 1e-3, [6.0, -1.0, -1.0])
    assert (state.value[0], state.rate[0]) == (end, 0.0)
    assert abs(state.rate[1]) > 0.1, 'the others move'
    # The others move as if the input were held: their two equations have no other unknown.
    change = moved.acceleration(state, [6.0, -1.0, -1.0])
    terms = state.terms
    rows = [[terms.inertia(i, j) for j in (1, 2)] for i in (1, 2)]
    expected = np.linalg.solve(rows, np.array([-1.0, -1.0]) - terms.bias[1:])
    assert change == pytest.approx((0.0, *expected), rel=1e-12)
    for _ in range(30):
        state = moved.advance(state, 1e-3, [-6.0, -1.0, -1.0])
    assert state.rate[0] < -0.1, 'it leaves'


def test_stop_contact_ends_at_the_zero_of_its_force():
    # The push falls in time by a table, so that steps of any length let go at the same instant.
    closure, start = several('ankle')
    fall = JointLoad(over_time=((0.0, 0.5), (0.1, -0.5)))
    loads = Loads(applied=AppliedLoads(efforts={closure.input_names[0]: fall}))
    ends = []
    for count in (10, 80):
        moved = mechanism(Mechanics(closure, loads), ((-inf, start[0]), FREE))
        state = moved.state_at(start, [0.0, 0.0])
        for step in range(count):
            state = moved.advance(state, 0.08 / count, [0.0, 0.0], time=step * 0.08 / count)
        ends.append((*state.value, *state.rate))
    assert ends[0][0] < start[0] - 1e-4
    assert ends[0] == pytest.approx(ends[1], rel=1e-5)


def test_undamped_soft_stop_returns_the_energy():
    closure, start = several('ankle_motors')
    limits = Limits(-inf, start[0] + 0.02)
    hinges = dict(closure.linkage.hinges)
    hinges['m1'] = replace(hinges['m1'], limits=limits)
    closure = type(closure)(replace(closure.linkage, hinges=hinges), closure.name)
    stops = AppliedLoads(stops={'m1': SoftStop(50.0)})
    mechanics = Mechanics(closure, Loads(applied=stops))
    moved = mechanism(mechanics)
    state = moved.state_at(start, [1.0, 0.2])
    energy = mechanics.kinetic_energy(
        closure.close_unlimited(*start),
        closure.velocity(closure.close_unlimited(*start), *state.rate),
    )
    most = start[0]
    for _ in range(400):
        state = moved.advance(state, 5e-4, [0.0, 0.0])
        most = max(most, state.value[0])
        if state.rate[0] < 0.0 and state.value[0] < limits.high:
            break
    assert most > limits.high, 'it meets the stop'
    position = closure.close_unlimited(*state.value)
    velocity = closure.velocity(position, *state.rate)
    assert mechanics.kinetic_energy(position, velocity) == pytest.approx(energy, rel=1e-6)


@pytest.mark.parametrize('restitution', [0.0, 0.5])
def test_five_bar_is_stopped_at_its_toggle(restitution):
    # Springs pull the cranks apart until the forearms are stretched.
    closure, start = several('five_bar')
    ends = zip(closure.input_names, (2.8, 0.3), strict=True)
    apart = AppliedLoads({name: JointSpring(1.0, end, 0.05) for name, end in ends})
    moved = mechanism(Mechanics(closure, Loads(applied=apart)), restitution=restitution)
    state = moved.state_at(start, [0.0, 0.0])
    most = 1e3 * state.terms.total_inertia
    moved = replace(moved, most_inertia=most)
    inertias = []
    for _ in range(1500):
        state = moved.advance(state, 1e-3, [0.0, 0.0])
        inertias.append(state.terms.total_inertia)
    assert 0.9 * most < max(inertias) < 1.001 * most
    if not restitution:
        assert state.rate == (0.0, 0.0)


def test_motors_that_bounce_in_their_play_keep_the_energy():
    closure, start = several('five_bar')
    mechanics = Mechanics(closure, Loads())
    plays = {0: MotorPlay(0.02, 0.001, 1.0), 1: MotorPlay(0.03, 0.002, 1.0)}
    moved = behind_play(mechanism(mechanics, method='gauss_legendre'), plays)
    state = moved.state_at([*start, *start], [0.5, -0.5, 2.0, -1.5])

    def energy(state):
        motors = sum(
            0.5 * play.inertia * rate**2
            for play, rate in zip(plays.values(), state.rate[2:], strict=True)
        )
        position = closure.close_unlimited(*state.value[:2])
        return motors + mechanics.total_energy(position, *state.rate[:2])

    begin, met = energy(state), 0
    for _ in range(150):
        before, state = state, moved.advance(state, 1e-3, [0.0] * 4)
        met += abs(np.subtract(state.rate, before.rate)[2:]).max() > 0.1
        for number, play in plays.items():
            gap = state.value[2 + number] - state.value[number]
            assert abs(gap) <= 0.5 * play.width + 1e-12
    assert met > 3
    assert energy(state) == pytest.approx(begin, rel=1e-9)


@pytest.mark.parametrize('restitution', [0.0, 0.4])
def test_leaning_joint_takes_a_blow_as_a_wall(restitution):
    closure, start = several('five_bar')
    mechanics = Mechanics(closure, Loads())
    stops = (-2.0, start[0]), FREE
    bare = mechanism(mechanics, stops, restitution=0.5)
    moved = behind_play(bare, {0: MotorPlay(0.02, 0.001, restitution)})
    state = moved.state_at([*start, start[0]], [0.0, 0.0, 1.0])
    for _ in range(12):
        state = moved.advance(state, 1e-3, [1.0, 0.0, 0.0])
    assert state.value[0] == start[0]
    assert state.rate[0] == 0.0
    assert state.rate[2] == pytest.approx(-restitution, abs=1e-12)
    # The other input, which no blow meets, moves only by what it is pushed.
    alone = bare.state_at(start, [0.0, 0.0])
    for _ in range(12):
        alone = bare.advance(alone, 1e-3, [1.0, 0.0])
    assert (state.value[1], state.rate[1]) == pytest.approx(
        (alone.value[1], alone.rate[1]), rel=1e-9
    )
