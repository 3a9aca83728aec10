# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Friction that grows with the force in its joint: against closed forms and its own definition."""

from cmath import rect
from dataclasses import replace
from math import copysign, cos, hypot, inf, pi, sin, sqrt

from hypothesis import given, strategies as st
from linkage_ros.dynamics import (
    AppliedLoads,
    Friction,
    JointFriction,
    JointLoad,
    Loads,
    Mechanics,
    METHODS,
    PointLoad,
    Reactions,
    SeveralDofMechanism,
    SingleDofMechanism,
    WrenchLoad,
)
from linkage_ros.errors import FileError
from linkage_ros.kinematics import Closure, cross_product, GROUND, Mass
from linkage_ros.messages import EffortCommand
from linkage_ros.stages.drives import Context, TorqueDrive
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from .loaded import BEGIN, closed, loads_of, STATES, swing
from .test_in_space import weighed
from ..support.messages import read_joint_state
from ..support.scenes import closure_of, PENDULUM, pipeline_of

RUBBING = JointFriction(coefficient=0.3, radius=0.01)
RADIUS = 0.3 * 0.01
"""Of the friction circle, in [m]."""


def moved(closure, value, rate=1.0, pull=0.0):
    position = closure.position(value)
    velocity = closure.velocity(position, rate)
    return position, velocity, closure.acceleration(position, velocity, pull)


@given(st.floats(-3.0, 3.0), st.floats(-9.0, 9.0), st.floats(-9.0, 9.0))
def test_crank_friction_equals_its_pin_force_closed_form(angle, rate, pull):
    friction = Friction({'O': replace(RUBBING, coulomb=0.1)})
    reactions = Reactions(Mechanics(closure_of(PENDULUM), Loads((0.0, -9.81)), friction))
    motion = moved(closure_of(PENDULUM), angle, rate, pull)
    inward, across = 0.3 * rate**2 - 9.81 * sin(angle), 0.3 * pull + 9.81 * cos(angle)
    against = (rate > 0.0) - (rate < 0.0)
    rubbed = against * (0.1 + RADIUS * 2.0 * hypot(inward, across))
    expected = (0.05 + 2.0 * 0.3**2) * pull + 2.0 * 9.81 * 0.3 * cos(angle) + rubbed
    assert reactions.drive_efforts(*motion) == pytest.approx((expected,), rel=1e-12, abs=1e-12)
    assert reactions.solve(*motion)[0].moment == pytest.approx(-rubbed, rel=1e-12)


@pytest.mark.parametrize('rate', [1.0, -1.0])
@pytest.mark.parametrize('load', [2.0, -2.0])
@pytest.mark.parametrize('angle', [0.3, 1.1, 1.9, -2.0])
def test_coupler_force_is_tangent_to_both_friction_circles(angle, load, rate):
    # Links without weight: the coupler carries one force F on one line, at the distance µρ from
    # both of its pins (Norton, ch. 11), and the rocker bears the load.
    linkage = closed('four_bar').linkage
    weightless = {link: Mass(1e-15, (0.0, 0.0), 0.0) for link in linkage.links if link != GROUND}
    closure = Closure(replace(linkage, masses=weightless))
    loads = Loads(applied=AppliedLoads(efforts={'rocker_joint': JointLoad(load)}))
    friction = Friction(dict.fromkeys(('O2', 'A', 'B', 'O4'), RUBBING))
    reactions = Reactions(Mechanics(closure, loads, friction))
    position, velocity, acceleration = moved(closure, angle, rate)

    before, after = (closure.link_angles(closure.position(angle + h)) for h in (-1e-4, 1e-4))
    turn = {link: rate * (after[link] - before[link]) for link in after}
    at_a = copysign(1.0, turn['coupler'] - turn['crank'])
    at_b = copysign(1.0, turn['coupler'] - turn['rocker'])
    at_o2, at_o4 = copysign(1.0, turn['crank']), copysign(1.0, turn['rocker'])
    points = closure.points(position)
    a, b, o4 = points['coupler', 'A'], points['coupler', 'B'], points['rocker', 'O4']
    found = []
    for pushes in (1.0, -1.0):
        sine = -(at_a + at_b) * RADIUS / abs(b - a) * pushes
        along = (b - a) / abs(b - a) * complex(sqrt(1.0 - sine * sine), sine)
        lever = cross_product(b - o4, along) + pushes * RADIUS * (at_b - at_o4)
        force = -load / lever
        if force * pushes > 0.0:
            rubbed = RADIUS * abs(force) * (at_o2 - at_a)
            found.append((abs(force), force * cross_product(a, along) + rubbed))
    ((force, effort),) = found
    assert reactions.drive_efforts(position, velocity, acceleration) == pytest.approx((effort,))
    for reaction in reactions.solve(position, velocity, acceleration):
        assert hypot(reaction.fx, reaction.fy) == pytest.approx(force)


def rubbing_everywhere(name):
    """Return a linkage and the friction of all its joints."""
    closure = closed(name)
    return closure, {
        joint.name: JointFriction(
            0.01, 0.02, coefficient=0.1, radius=0.0 if joint.kind == 'P' else 0.005
        )
        for joint in closure.structure.joints
    }


@pytest.mark.sample(4)
@pytest.mark.parametrize('name', STATES)
def test_load_dependent_friction_equals_constant_friction_of_that_size(name):
    # With each friction written as a constant, the forces, and the work, are the same.
    closure, joints = rubbing_everywhere(name)
    loads = loads_of(closure.linkage)
    reactions = Reactions(Mechanics(closure, loads, Friction(joints)))
    for inputs in STATES[name]:
        position = closure.position(*inputs)
        velocity = closure.velocity(position, *(1.5 for _ in inputs))
        motion = (
            position,
            velocity,
            closure.acceleration(position, velocity, *(-4.0,) * len(inputs)),
        )
        forces = reactions.solve(*motion)
        if len(set(joints)) < len(forces):  # a pin of three links has one entry for two joints
            continue
        constant = {}
        for joint, force in zip(closure.structure.joints, forces, strict=True):
            pressed = complex(force.fx, force.fy)
            if joint.kind == 'P':
                slider = closure.linkage.sliders[joint.name]
                line = complex(*slider.direction)
                line *= rect(1.0 / abs(line), closure.link_angles(position)[slider.along])
                pressed = cross_product(line, pressed)
            rubbing = joints[joint.name]
            by_force = 0.1 * (rubbing.radius or 1.0) * abs(pressed)
            constant[joint.name] = JointFriction(0.01, 0.02 + by_force)
        mechanics = Mechanics(closure, loads, Friction(constant))
        for one, other in zip(Reactions(mechanics).solve(*motion), forces, strict=True):
            assert tuple(one) == pytest.approx(tuple(other), rel=1e-9, abs=1e-9)
        assert reactions.drive_efforts(*motion) == pytest.approx(
            mechanics.drive_efforts(*motion), rel=1e-9
        )


def test_jammed_slider_crank_has_no_forces():
    # The piston is pushed out against 100 N by a rod at φ = asin((0.04·sin(0.9) − 0.01)/0.14) =
    # 0.153. It moves while µ·tan(φ) < 1, up to µ = 6.5; and it can always be let in.
    closure = closed('slider_crank')
    loads = Loads(applied=AppliedLoads(efforts={'piston_slide': JointLoad(-100.0)}))
    for coefficient, rate, moves in ((6.4, -0.1, True), (6.6, -0.1, False), (6.6, 0.1, True)):
        friction = Friction({'cylinder': JointFriction(coefficient=coefficient)})
        reactions = Reactions(Mechanics(closure, loads, friction))
        motion = moved(closure, 0.9, rate)
        assert (reactions.solve(*motion) is not None) == moves
        assert bool(reactions.drive_efforts(*motion)) == moves


SCENE = """
drive: {DRIVE}
effects:
  effort: {}
  friction: {holds: HOLDS, joints: {O: {coefficient: 0.3, radius: 0.01}}}
loads: {gravity: [0, -9.81]}
"""


def test_joint_state_effort_includes_load_dependent_friction():
    scene = SCENE.replace('DRIVE', 'constant_rate: {rate: -2, start: 0.4}')
    pipeline = pipeline_of(scene.replace('HOLDS', 'false'), PENDULUM)
    published = read_joint_state(pipeline.tick(1_000_000_000).message)
    weight, inward = 2.0 * 9.81 * cos(0.4), 2.0 * (0.3 * 4.0 - 9.81 * sin(0.4))
    expected = weight * 0.3 - RADIUS * hypot(weight, inward)
    assert published.effort[0] == pytest.approx(expected, rel=1e-12)


def test_holding_friction_by_an_indeterminate_force_is_refused():
    scene = SCENE.replace('DRIVE', 'constant_rate: {rate: 1}').replace('HOLDS', 'true')
    with pytest.raises(FileError, match="holds: at rest the force in 'O' has no certain"):
        pipeline_of(scene, PENDULUM)


# Under the torque drive.


def pendulum(angle, rate, torque, against):
    """Return the acceleration of a pendulum of which the pin rubs by the force in it."""

    def left_over(pull):
        force = 2.0 * hypot(0.3 * rate**2 - 9.81 * sin(angle), 0.3 * pull + 9.81 * cos(angle))
        weight = 2.0 * 9.81 * 0.3 * cos(angle)
        return torque - weight - against * RADIUS * force - (0.05 + 2.0 * 0.3**2) * pull

    return brentq(left_over, -1e4, 1e4, xtol=1e-13, rtol=1e-14)


@pytest.mark.parametrize(('method', 'exact'), [('rk4', 1e-9), ('gauss_legendre', 1e-11)])
def test_rubbing_pendulum_follows_scipy(method, exact):
    after = swing(friction=Friction({'O': RUBBING}), gravity=(0.0, -9.81), method=method)
    known = solve_ivp(
        lambda _, y: [y[1], pendulum(y[0], y[1], 0.0, -1.0)], (0.0, 0.4), [0.0, 0.0],
        'DOP853', rtol=1e-12, atol=1e-13, dense_output=True,
    ).sol  # fmt: skip
    for seconds in (0.1, 0.25, 0.4):
        value, rate, pull = after(seconds)
        assert (value, rate) == pytest.approx(tuple(known(seconds)), abs=exact)
        assert pull == pytest.approx(pendulum(value, rate, 0.0, -1.0), rel=1e-11)


def test_rubbing_pendulum_rests_within_its_friction_circle():
    # It stays where its weight stands within µρ of the pin: |cos(q)|·0.3 m ≤ 3 mm.
    friction = Friction({'O': JointFriction(coefficient=0.3, radius=0.01, viscous=0.3)})
    after = swing(friction=friction, gravity=(0.0, -9.81), step=0.005)
    value, *rest = [after(0.5 * n) for n in range(20)][-1]
    assert rest == [0.0, 0.0]
    assert 1e-6 < abs(0.3 * cos(value)) <= RADIUS
    assert abs(value + pi / 2.0) < 0.02


@pytest.mark.sample(4)
@pytest.mark.parametrize('name', [name for name in STATES if name != 'five_bar'])
def test_torque_command_equals_the_effort_of_its_acceleration(name):
    closure, joints = rubbing_everywhere(name)
    mechanics = Mechanics(closure, loads_of(closure.linkage), Friction(joints))
    reactions = Reactions(mechanics)
    mechanism = SingleDofMechanism(
        mechanics.motion_equation, METHODS['rk4'].step, friction_effort=reactions.friction_effort
    )
    for (value,) in STATES[name]:
        for rate, force in ((1.5, 3.0), (-0.7, 0.0)):
            motion = mechanism.state_at(value, rate)
            pull = mechanism.acceleration(motion, force)
            efforts = reactions.drive_efforts(*moved(closure, value, rate, pull))
            size = abs(mechanics.motion_terms(closure.position(value)).inertia * pull) + abs(force)
            assert efforts == pytest.approx((force,), abs=1e-10 * size)


def pressed(closure, joints, loads):
    """Return the mechanism of a linkage of several inputs, and the forces in its joints."""
    mechanics = Mechanics(closure, loads, Friction(joints))
    reactions = Reactions(mechanics)
    pressing = reactions.pressing
    mechanism = SeveralDofMechanism(
        pressing.mount_on(mechanics.input_equation),
        METHODS['rk4'].step,
        ((-inf, inf),) * len(closure.input_names),
        frictions=mechanics.dry_frictions,
        pressing=pressing,
    )
    return mechanism, reactions


def several_rubbing(name):
    """Return a linkage of several inputs, friction of its joints, its loads and a place."""
    if name == 'five_bar':
        return *rubbing_everywhere(name), Loads((0.0, -9.81)), [1.2, 1.9]
    closure = weighed(name)
    named = (*closure.input_names, *closure.joint_names)
    hinges = [joint for joint in named if joint in closure.linkage.hinges]
    joints = {joint: JointFriction(0.01, 0.02, coefficient=0.2, radius=0.005) for joint in hinges}
    return closure, joints, Loads((0.0, 0.0, -9.81)), [*closure.linkage.pose.inputs]


@pytest.mark.parametrize('name', ['five_bar', 'ankle', 'delta'])
def test_accelerations_of_several_inputs_take_the_commanded_efforts(name):
    closure, joints, loads, start = several_rubbing(name)
    mechanism, reactions = pressed(closure, joints, loads)
    count = len(start)
    for rates, forces in (([1.5, -0.8, 0.4], [0.3, -0.2, 0.1]), ([-0.5, -0.9, 0.7], [0.0] * 3)):
        motion = mechanism.state_at(start, rates[:count])
        changes = mechanism.acceleration(motion, forces[:count])
        position = closure.close_unlimited(*start)
        velocity = closure.velocity(position, *rates[:count])
        acceleration = closure.acceleration(position, velocity, *changes)
        efforts = reactions.drive_efforts(position, velocity, acceleration)
        size = motion.terms.total_inertia * max(map(abs, changes)) + 1.0
        assert efforts == pytest.approx(forces[:count], abs=1e-10 * size)


@pytest.mark.parametrize('name', ['five_bar', 'ankle', 'delta'])
def test_friction_holds_several_inputs_up_to_its_effort(name):
    """At the start of a motion q̈ is 0, and each joint resists all that it can."""
    closure, joints, loads, start = several_rubbing(name)
    joints = {joint: replace(of, coulomb=0.0, breakaway=0.0) for joint, of in joints.items()}
    mechanism, reactions = pressed(closure, joints, loads)
    count, position = len(start), closure.close_unlimited(*start)
    motion = mechanism.state_at(start, [0.0] * count)
    for ways in ([1.0, -0.8, 0.4], [-0.5, -0.9, 0.7], [0.9, 0.1, -0.3]):
        velocity = closure.velocity(position, *(1e-9 * way for way in ways[:count]))
        still = closure.acceleration(position, velocity, *[0.0] * count)
        needed = np.array(reactions.drive_efforts(position, velocity, still))
        weight = np.array(motion.terms.bias)
        for share, moves in ((0.98, False), (1.02, True)):
            force = (weight + share * (needed - weight)).tolist()
            change = mechanism.acceleration(motion, force)
            assert any(change) == moves
            after = mechanism.advance(motion, 1e-3, force)
            assert (after.value != motion.value) == moves
        # A little beyond, it begins to move where every joint slips as it was said to.
        assert np.dot(change, ways[:count]) > 0.0


def test_jammed_slider_crank_stands_under_any_command():
    # As above: the piston, pushed out against 100 N, jams from µ = 6.5 on.
    closure = closed('slider_crank')
    loads = Loads(applied=AppliedLoads(efforts={'piston_slide': JointLoad(-100.0)}))
    for coefficient, stands in ((6.0, False), (7.0, True)):
        friction = Friction({'cylinder': JointFriction(coefficient=coefficient)})
        context = Context(closure, 1000.0, True, 'seed', loads, friction)
        drive = TorqueDrive(start=0.9, rate=-0.1).build(context)
        drive.state(BEGIN)
        drive.offer(EffortCommand(0, (-300.0,)), BEGIN)
        state = drive.state(BEGIN + 5_000_000)
        assert (state.rates == (0.0,)) == stands
        assert (state.angles[0] < 0.89) != stands


def test_time_table_loads_enter_the_friction():
    # A force on the crank's end beside its weight, which grows with the time: at rest the pin
    # carries both, and the drive sticks up to µρ of it.
    linkage = closure_of(PENDULUM).linkage
    force = PointLoad((0.0, -1.0), over_time=((0.0, 0.0), (2.0, 80.0)))
    loads = Loads((0.0, -9.81), applied=AppliedLoads(forces={'crank.end': force}))
    reactions = Reactions(Mechanics(Closure(linkage), loads, Friction({'O': RUBBING})))
    for seconds in (0.0, 0.5, 1.5, 3.0):
        load = 2.0 * 9.81 + min(40.0 * seconds, 80.0)
        for rate in (1e-200, -1e-200):
            resisted = reactions.friction_effort(0.4, rate, seconds, 0.0, 0.0)
            assert resisted == pytest.approx(RADIUS * load, rel=1e-12)


def test_wrench_loads_enter_the_friction():
    loads = Loads((0.0, -9.81), applied=AppliedLoads(wrenches={'crank': WrenchLoad('', 'end')}))
    mechanics = Mechanics(closure_of(PENDULUM), loads, Friction({'O': RUBBING}))
    held, reactions = mechanics.applied.wrenches['crank'], Reactions(mechanics)
    for count, force in enumerate((0.0, 30.0, -50.0)):
        held.set_wrench((0.0, -force, 1.0), count)
        resisted = reactions.friction_effort(0.4, 1e-200, 0.0, 0.0, 0.0)
        assert resisted == pytest.approx(RADIUS * abs(2.0 * 9.81 + force), rel=1e-12)
