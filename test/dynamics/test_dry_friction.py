# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Dry friction with several inputs: what sticks, what slides, and what it costs."""

from dataclasses import replace
from math import sin

from linkage_ros.dynamics import (
    Friction,
    JointFriction,
    Loads,
    Mechanics,
    METHODS,
    settle_forces,
    SeveralDofMechanism,
    SingleDofMechanism,
)
from linkage_ros.kinematics import Limits
import numpy as np
import pytest
from scipy.optimize import lsq_linear

from .loaded import closed
from .test_several_freedoms import FREE, GRAVITY, several


def test_friction_forces_at_rest_equal_a_scipy_solution():
    """The least acceleration in the metric of inertia, by scipy, and the law joint by joint."""
    random = np.random.default_rng(4)
    kinds = {'sticks': 0, 'slides': 0}
    for _ in range(200):
        inputs, joints = random.integers(1, 4), random.integers(1, 7)
        root = random.normal(size=(inputs, inputs))
        inertia = root @ root.T + 0.1 * np.eye(inputs)
        levers, limits = random.normal(size=(joints, inputs)), random.uniform(0.0, 1.0, joints)
        push = random.normal(size=inputs) * random.choice([0.1, 1.0, 5.0])
        mobility = np.linalg.inv(inertia)
        forces, slips = settle_forces(
            (levers @ mobility @ levers.T).tolist(),
            (levers @ mobility @ push).tolist(),
            [(-limit, limit) for limit in limits],
        )
        lower = np.linalg.inv(np.linalg.cholesky(inertia))
        least = lsq_linear(
            lower @ levers.T, -lower @ push, (-limits - 1e-300, limits), method='bvls', tol=1e-15
        ).x
        change, right = (mobility @ (push + levers.T @ each) for each in (forces, least))
        assert change == pytest.approx(right, rel=1e-8, abs=1e-9)
        for force, limit, slip, lever in zip(forces, limits, slips, levers, strict=True):
            assert abs(force) <= limit
            if slip:
                assert force == -np.copysign(limit, slip)
                assert slip == pytest.approx(lever @ change, rel=1e-6, abs=1e-9)
            else:
                assert abs(lever @ change) < 1e-7
            kinds['slides' if slip else 'sticks'] += 1
    assert min(kinds.values()) > 100


def mechanism(mechanics, stops=None, **given):
    count = len(mechanics.closure.input_names)
    return SeveralDofMechanism(
        mechanics.input_equation, METHODS['rk4'].step, stops or (FREE,) * count,
        frictions=mechanics.dry_frictions, joint_stops=mechanics.joint_stops, **given,
    )  # fmt: skip


RUBBING = {
    'O2': JointFriction(coulomb=0.004, breakaway=0.006),
    'B': JointFriction(coulomb=0.003, breakaway=0.005, stribeck=0.5),
    'O4': JointFriction(coulomb=0.005, viscous=0.001),
}


@pytest.mark.parametrize(
    ('start', 'rate', 'push'), [(0.3, 4.0, 0.0), (1.0, 0.0, 0.07), (2.0, 0.0, 0.05)]
)
def test_single_input_friction_equals_its_own_equation(start, rate, push):
    """Slips that turn, sticking and breaking away: the other equation is of one input alone."""
    mechanics = Mechanics(closed('four_bar'), Loads((0.0, -0.05)), Friction(RUBBING))
    several = mechanism(mechanics)
    alone = SingleDofMechanism(mechanics.motion_equation, METHODS['rk4'].step, laws=mechanics.laws)
    one, other = several.state_at([start], [rate]), alone.state_at(start, rate)
    rested = 0
    for count in range(600):
        force = push * sin(0.02 * count)
        one = several.advance(one, 1e-3, [force])
        other = alone.advance(other, 1e-3, force)
        assert (*one.value, *one.rate) == pytest.approx((other.value, other.rate), abs=1e-8)
        change = alone.acceleration(other, force)
        assert several.acceleration(one, [force]) == pytest.approx((change,), abs=1e-5)
        rested += one.rate == (0.0,)
    assert rested or rate, 'it sticks'


def test_friction_loss_equals_moment_times_joint_travel():
    closure, start = several('five_bar')
    names = [joint.name for joint in closure.structure.joints]
    moments = {name: 2e-4 * (1 + number) for number, name in enumerate(names)}
    frictions = Friction({name: JointFriction(coulomb=size) for name, size in moments.items()})
    mechanics = Mechanics(closure, Loads(GRAVITY[:2]), frictions)
    moved = mechanism(mechanics)
    state = moved.state_at(start, [-3.0, 2.0])

    def angles(state):
        found = closure.link_angles(closure.close_unlimited(*state.value))
        return np.array(
            [found[joint.link] - found.get(joint.to, 0.0) for joint in closure.structure.joints]
        )

    def energy(state):
        return mechanics.total_energy(closure.close_unlimited(*state.value), *state.rate)

    begin, lost, before = energy(state), 0.0, angles(state)
    for _ in range(250):
        state = moved.advance(state, 4e-4, [0.0, 0.0])
        now = angles(state)
        turned = np.abs(np.angle(np.exp(1j * (now - before))))
        lost, before = lost + turned @ [*moments.values()], now
    assert lost > 5e-4
    assert begin - energy(state) == pytest.approx(lost, rel=1e-4)


def test_sticking_input_stays_while_the_others_move():
    closure, start = several('delta')
    names = closure.input_names
    frictions = Friction({names[0]: JointFriction(coulomb=3.0, breakaway=5.0)})
    mechanics = Mechanics(closure, Loads(GRAVITY), frictions)
    moved = mechanism(mechanics)
    state = moved.state_at(start, [0.0] * 3)
    for _ in range(50):
        state = moved.advance(state, 1e-3, [0.2, -1.0, -1.5])
    assert (state.value[0], state.rate[0]) == pytest.approx((start[0], 0.0), abs=1e-14)
    assert abs(state.rate[1]) > 0.1, 'the others move'
    change = moved.acceleration(state, [0.2, -1.0, -1.5])
    rows = [[state.terms.inertia(i, j) for j in (1, 2)] for i in (1, 2)]
    expected = np.linalg.solve(rows, np.array([-1.0, -1.5]) - state.terms.bias[1:])
    assert change == pytest.approx((0.0, *expected), rel=1e-11, abs=1e-12)
    # Beyond what it holds it breaks away, and is resisted by less.
    change = moved.acceleration(state, [40.0, -1.0, -1.5])
    pushed = np.array([40.0 - 3.0, -1.0, -1.5]) - state.terms.bias
    assert change == pytest.approx(tuple(np.array(state.terms.mobility) @ pushed), rel=1e-11)


def test_step_length_does_not_change_slip_and_stick_instants():
    closure, start = several('five_bar')
    names = [joint.name for joint in closure.structure.joints]
    frictions = Friction({name: JointFriction(coulomb=2e-3) for name in names})
    ends = []
    for count in (40, 320):
        moved = mechanism(Mechanics(closure, Loads(), frictions))
        state = moved.state_at(start, [-1.5, 1.0])
        for _ in range(count):
            state = moved.advance(state, 0.08 / count, [0.0, 0.0])
        ends.append((*state.value, *state.rate))
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)


def test_brakes_hold_each_input_up_to_their_torque():
    closure, start = several('ankle')
    mechanics = Mechanics(closure, Loads(GRAVITY))
    moved = mechanism(mechanics)
    state = moved.state_at(start, [0.0, 0.0])
    held = moved.advance(state, 1e-2, [0.0, 0.0], [50.0, 50.0])
    assert (held.value, held.rate) == (state.value, (0.0, 0.0))
    one = moved.state_at(start, [0.0, 0.0])
    for _ in range(20):
        one = moved.advance(one, 1e-3, [0.0, 0.0], [50.0, 0.0])
    assert one.value[0] == pytest.approx(start[0], abs=1e-15)
    assert abs(one.rate[1]) > 1e-3
    # A brake that is too weak resists with all that it has.
    change = moved.acceleration(state, [0.0, 0.0], [1e-3, 0.0])
    free = np.array(moved.acceleration(state, [0.0, 0.0]))
    by_brake = -1e-3 * np.sign(free[0]) * np.array(state.terms.mobility[0])
    assert change == pytest.approx(tuple(free + by_brake), rel=1e-9)


def test_five_bar_with_friction_rests_at_a_toggle():
    closure, start = several('five_bar')
    names = [joint.name for joint in closure.structure.joints]
    frictions = Friction({name: JointFriction(coulomb=0.02, breakaway=0.03) for name in names})
    moved = mechanism(Mechanics(closure, Loads((0.0, -9.81)), frictions))
    state = moved.state_at(start, [0.5, -0.3])
    moved = replace(moved, most_inertia=1e3 * state.terms.total_inertia)
    for _ in range(600):
        state = moved.advance(state, 1e-3, [0.0, 0.0])
    assert state.rate == (0.0, 0.0)


@pytest.mark.parametrize('name', ['five_bar', 'ankle', 'delta'])
def test_holding_friction_leaves_the_least_acceleration_to_drives(name):
    """By scipy's bounded least squares, in the metric of the kinetic energy."""
    closure, start = several(name)
    if name == 'five_bar':
        named = [joint.name for joint in closure.structure.joints]
    else:
        named = [*closure.input_names, *closure.joint_names]
        named = [joint for joint in named if joint in closure.linkage.hinges]
    gravity = GRAVITY if name != 'five_bar' else (0.0, -9.81)
    start = [value + 0.1 * (1 + k) for k, value in enumerate(start)]
    bare = Mechanics(closure, Loads(gravity))
    position = closure.close_unlimited(*start)
    velocity = closure.velocity(position, *[0.0] * len(start))
    at_rest = position, velocity, closure.acceleration(position, velocity, *[0.0] * len(start))
    needed = np.array(bare.drive_efforts(*at_rest))
    left = set()
    for size in (0.01, 0.1, 0.3, 3.0):
        limits = [size * max(abs(needed)) * (1 + k) / 3 for k in range(len(named))]
        joints = {
            joint: JointFriction(coulomb=0.5 * limit, breakaway=limit)
            for joint, limit in zip(named, limits, strict=True)
        }
        mechanics = Mechanics(closure, Loads(gravity), Friction(joints, holds=True))
        efforts = np.array(mechanics.drive_efforts(*at_rest))
        terms = mechanics.input_terms(position, [0.0] * len(start))
        root = np.linalg.cholesky(np.array(terms.mobility)).T
        levers = np.array([slip.levers for slip in terms.slips]).T
        found = [joints[joint.name].breakaway for joint in mechanics.dry_joints]
        solved = lsq_linear(root @ levers, root @ needed, (-np.array(found), found), tol=1e-15)
        assert efforts == pytest.approx(needed - levers @ solved.x, abs=1e-6 * max(abs(needed)))
        left.add(bool(np.abs(efforts).max() > 1e-6 * max(abs(needed))))
    assert left == {False, True}


def stopped_foot(restitution):
    """Return an ankle whose roll, no input, has a stop beside the pose, and its mechanism."""
    closure, start = several('ankle_motors')
    hinges = dict(closure.linkage.hinges)
    hinges['roll'] = replace(hinges['roll'], limits=Limits(-0.02, 0.3))
    closure = type(closure)(replace(closure.linkage, hinges=hinges), closure.name)
    mechanics = Mechanics(closure, Loads())
    return closure, start, mechanism(mechanics, restitution=restitution)


def roll_of(closure, state):
    position = closure.close_unlimited(*state.value)
    joint = closure.joint_names.index('roll')
    return position.joints[joint], closure.velocity(position, *state.rate).joints[joint]


def roll_levers(closure, values):
    position, joint = closure.close_unlimited(*values), closure.joint_names.index('roll')
    units = (1.0, 0.0), (0.0, 1.0)
    return np.array([closure.velocity(position, *unit).joints[joint] for unit in units])


@pytest.mark.sample(1)
@pytest.mark.parametrize('restitution', [1.0, 0.5, 0.0])
def test_dependent_joint_bounces_at_its_hard_stop(restitution):
    closure, start, moved = stopped_foot(restitution)
    ways = roll_levers(closure, start)
    state = moved.state_at(start, (-0.5 * ways / (ways @ ways)).tolist())
    rates, energies, lowest = [], [], 0.0
    for _ in range(100):
        state = moved.advance(state, 1e-3, [0.0, 0.0])
        value, rate = roll_of(closure, state)
        lowest = min(lowest, value)
        rates.append(rate)
        inertia = [[state.terms.inertia(i, j) for j in range(2)] for i in range(2)]
        energies.append(0.5 * np.dot(state.rate, np.dot(inertia, state.rate)))
    assert lowest == pytest.approx(-0.02, abs=1e-3)
    assert lowest >= -0.02 - 1e-12
    impact = int(np.argmax(np.diff(rates)))
    assert rates[impact + 1] == pytest.approx(
        -restitution * rates[impact], abs=0.05 * abs(rates[impact])
    )
    if restitution == 1.0:
        assert energies[-1] == pytest.approx(energies[0], rel=1e-9)
    else:
        assert energies[-1] < 0.99 * energies[0]


def test_pushed_dependent_joint_rests_at_its_stop():
    closure, start, moved = stopped_foot(0.0)
    joint = closure.joint_names.index('roll')
    push = (-0.1 * roll_levers(closure, start)).tolist()
    state = moved.state_at(start, [0.0, 0.0])
    for _ in range(150):
        state = moved.advance(state, 1e-3, push)
    assert roll_of(closure, state) == pytest.approx((-0.02, 0.0), abs=1e-9)
    # The other freedom has the acceleration of what is held there.
    change = moved.acceleration(state, push)
    position = closure.close_unlimited(*state.value)
    velocity = closure.velocity(position, *state.rate)
    assert abs(closure.acceleration(position, velocity, *change).joints[joint]) < 1e-9
    for _ in range(100):
        state = moved.advance(state, 1e-3, [-part for part in push])
    value, rate = roll_of(closure, state)
    assert value > -0.01 or rate > 0.01, 'it leaves'
