# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""The torque drive in space: against Lagrange multipliers, by energy, and at stops."""

from dataclasses import replace
from math import copysign, inf

from linkage_ros.dynamics import (
    AppliedLoads,
    Friction,
    JointFriction,
    JointLoad,
    JointSpring,
    Loads,
    Mechanics,
    SoftStop,
)
from linkage_ros.kinematics import Limits, SpaceClosure
from linkage_ros.messages import EffortCommand
from linkage_ros.stages.drives import Context, TorqueDrive
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ...dynamics.test_in_space import weighed
from ...support.multipliers import AbsoluteMotion

BEGIN = 1_700_000_000_000_000_000
MS = 1_000_000
GRAVITY = (0.7, -1.1, -9.81)


def drive(closure, loads, friction=None, **parameters):
    context = Context(closure, 1000.0, True, 'seed', loads, friction)
    return TorqueDrive(**parameters).build(context)


def by_multipliers(closure, start, until, effort, loads):
    """Return value and rate at a time, [s], integrated with accelerations by multipliers."""

    def slope(_, state):
        q, w = state
        motions = [AbsoluteMotion(closure, (q,), (w,), (a,)) for a in (0.0, 1.0)]
        bare, more = (motion.efforts(GRAVITY, loads(motion, q))[0] for motion in motions)
        return w, (effort - bare) / (more - bare)

    found = solve_ivp(slope, (0.0, until), start, method='DOP853', rtol=1e-9, atol=1e-11)
    return found.y[:, -1]


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', ['rssr', 'spatial_slider_crank', 'bennett'])
def test_spatial_torque_drive_follows_lagrange_multipliers(name):
    closure = weighed(name)
    joint = closure.joint_names[0]
    spring, load = JointSpring(2.0, 0.1, 0.05), JointLoad(0.2)
    applied = AppliedLoads({joint: spring}, {}, {joint: load})
    at, effort = closure.linkage.pose.inputs[0] + 0.1, 0.4

    def loads(motion, q):
        (value, *_) = closure.position(q).joints
        pull = -spring.stiffness * (value - spring.free) - spring.damping * motion.joint_rate(
            joint
        )
        return list(motion.joint_loads(joint, load.constant + pull))

    crank = drive(closure, Loads(GRAVITY, applied=applied), start=at, rate=0.5)
    crank.offer(EffortCommand(0, (effort,)), BEGIN)
    crank.state(BEGIN)
    now = crank.state(BEGIN + 80 * MS)
    expected = by_multipliers(closure, (at, 0.5), 0.08, effort, loads)
    assert abs(expected[0] - at) > 0.02, 'it moves'
    assert (*now.angles, *now.rates) == pytest.approx(tuple(expected), rel=1e-7)


@pytest.mark.parametrize('method', ['rk4', 'gauss_legendre'])
def test_undamped_rssr_keeps_its_energy(method):
    closure = weighed('rssr')
    loads = Loads(GRAVITY, drive_inertia=0.01)
    mechanics, crank = Mechanics(closure, loads), drive(closure, loads, start=0.3, method=method)
    energies = []
    for time in range(0, 5000, 50):
        state = crank.state(BEGIN + time * MS)
        energies.append(mechanics.total_energy(closure.position(*state.angles), *state.rates))
    angles = [crank.state(BEGIN + 5000 * MS).angles[0], 0.3]
    assert max(angles) - min(angles) > 0.1, 'it moves'
    assert max(energies) - min(energies) < {'rk4': 1e-11, 'gauss_legendre': 1e-13}[method]


def limited(closure, low, high):
    hinges = dict(closure.linkage.hinges)
    (name,) = closure.input_names
    hinges[name] = replace(hinges[name], limits=Limits(low, high))
    return SpaceClosure(replace(closure.linkage, hinges=hinges), closure.name)


def test_rssr_bounces_at_a_hard_stop_and_rests():
    closure = limited(weighed('rssr'), -inf, 0.5)
    loads = Loads(GRAVITY, drive_inertia=0.01)
    crank = drive(closure, loads, start=0.3, restitution=0.5, timeout=3600.0)
    crank.offer(EffortCommand(0, (2.0,)), BEGIN)
    states = [crank.state(BEGIN + time * MS) for time in range(1500)]
    angles, rates = np.array([(*state.angles, *state.rates) for state in states]).T
    assert angles.max() == 0.5
    assert rates.min() < -0.1, 'it bounces'
    assert (angles[-1], rates[-1]) == (0.5, 0.0)


def test_rssr_rests_on_a_soft_stop():
    closure = limited(weighed('rssr'), -inf, 0.5)
    stops = AppliedLoads(stops={'crank_joint': SoftStop(500.0, 5.0)})
    crank = drive(
        closure, Loads(GRAVITY, drive_inertia=0.01, applied=stops), start=0.3, timeout=60.0
    )
    crank.offer(EffortCommand(0, (2.0,)), BEGIN)
    state = [crank.state(BEGIN + time * MS) for time in range(3000)][-1]
    mechanics = Mechanics(closure, Loads(GRAVITY))
    slope = mechanics.motion_terms(closure.close_unlimited(*state.angles)).potential_slope
    assert state.rates[0] == pytest.approx(0.0, abs=1e-9)
    # At rest spring and weight bear the command.
    assert 500.0 * (state.angles[0] - 0.5) == pytest.approx(2.0 - slope, rel=1e-9)


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', ['rssr', 'spatial_slider_crank', 'hooke_joint'])
def test_spatial_joint_friction_opposes_the_joint_rates(name):
    """Moments at hinges, a force at a slide: applied in absolute coordinates, by the signs."""
    closure = weighed(name)
    joints = dict.fromkeys((*closure.input_names, *closure.joint_names))
    friction = Friction(
        {joint: JointFriction(viscous=0.02, coulomb=0.01 * k) for k, joint in enumerate(joints, 1)}
    )
    at, effort = closure.linkage.pose.inputs[0] + 0.1, 0.4

    def loads(motion, _):
        parts = []
        for joint, rubbing in friction.joints.items():
            rate = motion.joint_rate(joint)
            pull = rubbing.viscous * rate + copysign(rubbing.coulomb, rate)
            parts += motion.joint_loads(joint, -pull)
        return parts

    crank = drive(closure, Loads(GRAVITY), friction, start=at, rate=3.0)
    crank.offer(EffortCommand(0, (effort,)), BEGIN)
    crank.state(BEGIN)
    now = crank.state(BEGIN + 40 * MS)
    expected = by_multipliers(closure, (at, 3.0), 0.04, effort, loads)
    assert expected[1] > 0.1, 'it slides all the time'
    assert (*now.angles, *now.rates) == pytest.approx(tuple(expected), rel=1e-6)


def test_coulomb_friction_holds_an_rssr_at_rest():
    closure = weighed('rssr')
    for coulomb, moves in ((5.0, False), (1e-4, True)):
        friction = Friction({'rocker_joint': JointFriction(coulomb=coulomb)})
        crank = drive(closure, Loads(GRAVITY), friction, start=0.6)
        crank.state(BEGIN)
        (angle,) = crank.state(BEGIN + 100 * MS).angles
        assert (angle != 0.6) is moves
