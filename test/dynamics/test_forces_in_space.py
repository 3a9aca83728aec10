# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Forces in the joints of spatial linkages: Lagrange's multipliers, and formulas of books."""

from dataclasses import replace
from math import cos, radians, sin
from random import Random

from linkage_ros.dynamics import (
    Friction,
    JointFriction,
    Loads,
    Mechanics,
    METHODS,
    Reactions,
    SingleDofMechanism,
)
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import SpaceClosure, SpaceLinkage, SpatialJoint, SpatialMass
from linkage_ros.kinematics.compiling import Compiled
from mpmath import mp, mpf
import numpy as np
import pytest

from .test_in_space import (
    applied_by_hand,
    everywhere,
    GRAVITY,
    motion_of,
    spring_forces,
    spring_of,
    weighed,
)
from ..kinematics.space.test_linkages import NAMES, states_of
from ..support.multipliers import AbsoluteMotion

UNCERTAIN = {'bennett'}


def check_forces(reactions, closure, state, given, wrenches):
    """Check each certain force and moment against what two links exert on each other."""
    position = closure.position(*state[0])
    found = reactions.solve(*motion_of(closure, *state), given)
    frames = AbsoluteMotion(closure, *state)
    size = max(np.abs(both).max() for both in wrenches.values())
    checked = 0
    for joint, parts, reaction in zip(reactions.joints, reactions.parts, found, strict=True):
        pairs = [one for one in reactions.joints if one.forces and {*one[1:3]} == {*joint[1:3]}]
        if len(pairs) > 1 or not joint.forces:
            continue
        key = (joint.link, joint.to) if (joint.link, joint.to) in wrenches else joint[2:0:-1]
        sign = 1.0 if key[0] == joint.link else -1.0
        force, moment = sign * wrenches[key]
        moment = moment - np.cross(frames.place(*joint.point), force)
        pair = closure.linkage.pair_joints.get(joint.name)
        axis = np.zeros(3)
        if pair is not None:
            axis = frames.turned(pair.parent, pair.axis) / np.linalg.norm(pair.axis)
        both = zip(parts, (force, moment), (reaction[:3], reaction[3:]), strict=True)
        for part, expected, numbers in both:
            along = axis * (axis @ expected)
            kept = {'whole': expected, 'across': expected - along, 'along': along}
            certain = kept.get(part, np.zeros(3))
            assert numbers == pytest.approx(certain, abs=1e-9 * (1 + size))
            checked += part != ''
    assert position.status.has_rates
    return checked


@pytest.mark.sample(6)
@pytest.mark.parametrize('name', NAMES)
def test_spatial_joint_forces_equal_lagrange_multipliers(name):
    closure, spring = spring_of(weighed(name), 3.0)
    reactions = Reactions(Mechanics(closure, Loads(GRAVITY, (spring,))))
    for inputs, slow, changes in states_of(closure, 2, 0.2):
        state = inputs, [4.0 * rate for rate in slow], changes
        motion = AbsoluteMotion(closure, *state)
        loads = [*spring_forces(motion, spring)]
        wrenches = motion.wrenches(GRAVITY, loads)
        checked = check_forces(reactions, closure, state, (), wrenches)
        # Of a Bennett linkage only the moments along the axes are certain, and there are none.
        assert checked > 0 or name in UNCERTAIN
        efforts = reactions.drive_efforts(*motion_of(closure, *state))
        expected = motion.efforts(GRAVITY, loads)
        assert efforts == pytest.approx(expected, rel=1e-8, abs=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize('name', ['rssr', 'ankle_motors', 'wishbone', 'hexapod', 'four_bar'])
def test_applied_loads_enter_the_spatial_joint_forces(name):
    closure, random = weighed(name), Random(name)
    applied = everywhere(closure)
    mechanics = Mechanics(closure, Loads(GRAVITY, applied=applied))
    wrenches = {link: [random.uniform(-2.0, 2.0) for _ in range(6)] for link in applied.wrenches}
    for link, numbers in wrenches.items():
        mechanics.applied.wrenches[link].set_wrench(tuple(numbers), 0)
    reactions = Reactions(mechanics)
    for state in states_of(closure, 2, 0.2):
        motion, position = AbsoluteMotion(closure, *state), closure.position(*state[0])
        loads = applied_by_hand(motion, closure, position, applied, wrenches, 0.7)
        given = mechanics.applied.given_after(0.7)
        check_forces(reactions, closure, state, given, motion.wrenches(GRAVITY, loads))


@pytest.mark.parametrize('name', ['rssr', 'bennett', 'ankle_motors'])
def test_compiled_spatial_forces_equal_the_interpreted_ones(name):
    closure = weighed(name)
    reactions = Reactions(Mechanics(closure, Loads(GRAVITY)))

    def listed(motion):
        return [[number for reaction in reactions.solve(*motion) for number in reaction]]

    compiled = Compiled(closure, 2, listed)
    for state in states_of(closure, 4, 0.2):
        (fast,) = compiled.fast(*[number for part in state for number in part])
        (slow,) = listed(motion_of(closure, *state))
        assert [*map(float.hex, fast)] == [*map(float.hex, slow)]


def test_tilted_disc_moment_equals_eulers_equation():
    """A thin disc at an angle to its shaft (J. P. Den Hartog, Mechanics, 1948, ch. 15)."""
    tilt, mass, radius, rate = radians(12.0), 2.0, 0.1, 60.0
    across, along = 0.25 * mass * radius**2, 0.5 * mass * radius**2
    c, s = cos(tilt), sin(tilt)
    xx, zz = across * c * c + along * s * s, across * s * s + along * c * c
    xz = (along - across) * s * c
    disc = SpatialMass(mass, (0.0, 0.0, 0.0), (xx, 0.0, xz, across, 0.0, zz))
    shaft = SpatialJoint('ground', 'disc', (0.0, 0.0, 1.0), (0.0, 0.0, 0.3))
    linkage = SpaceLinkage({}, {}, {'shaft': shaft}, {}, {}, ('shaft',), (), masses={'disc': disc})
    closure = SpaceClosure(linkage)
    reactions = Reactions(Mechanics(closure, Loads((0.0, 0.0, -9.81))))
    for angle in (0.0, 0.7):
        (found,) = reactions.solve(*motion_of(closure, [angle], [rate], [0.0]))
        assert found[:3] == pytest.approx((0.0, 0.0, mass * 9.81), abs=1e-12)
        # ω × K·ω, with the products of inertia turned by the angle.
        turning = rate**2 * xz
        expected = -turning * sin(angle), turning * cos(angle)
        assert (found.mx, found.my) == pytest.approx(expected, rel=1e-12, abs=1e-12)
        assert found.mz == 0.0


def test_spatial_slider_crank_forces_equal_forty_digit_statics():
    """A slider with a mass, on a rod and a crank without: the rod bears a force along itself."""
    mass, gravity = 0.7, (0.3, -1.1, -9.81)
    closure = weighed('spatial_slider_crank')
    masses = {link: SpatialMass(0.0) for link in ('crank', 'rod')}
    masses['slider'] = SpatialMass(mass, (0.2, 0.0, 0.0), (1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4))
    closure = SpaceClosure(replace(closure.linkage, masses=masses))
    reactions = Reactions(Mechanics(closure, Loads(gravity)))
    for angle, rate, change in ((0.4, 7.0, -30.0), (2.9, -11.0, 5.0)):
        solved = reactions.solve(*motion_of(closure, [angle], [rate], [change]))
        # On the slider.
        found = {
            joint.name: [part if joint.link == 'slider' else -part for part in reaction]
            for joint, reaction in zip(reactions.joints, solved, strict=True)
        }
        with mp.workdps(40):
            (x, y, z), pull = slider_by_hand(mpf(angle), mpf(rate), mpf(change))
            along = mpf(mass) * (pull - mpf(gravity[0]))
            pushed = [along, along * y / x, along * z / x]
            pressed = [0, *(-mpf(mass) * mpf(gravity[k]) - pushed[k] for k in (1, 2))]
        for name, expected in (('C', pushed), ('slide', pressed)):
            size = max(map(abs, expected))
            for part, right in zip(found[name][:3], expected, strict=True):
                assert abs(part - right) < 2e-14 * size, name
            assert max(map(abs, found[name][3:])) < 1e-14 * float(size)


def slider_by_hand(angle, rate, change):
    """Return the way from the crank's pin to the slider, and the slider's acceleration."""

    def way(t):
        turned = angle + rate * t + change * t * t / 2
        y, z = (
            mpf('0.1') - mpf('0.08') * mp.sin(turned),
            mpf('0.12') + mpf('0.08') * mp.cos(turned),
        )
        return mp.sqrt(mpf('0.09') - y * y - z * z), -y, -z

    x, y, z = way(mpf(0))
    return (x, y, z), mp.diff(lambda t: way(t)[0], 0, 2)


def rubbing(closure, inputs, rates, changes, friction):
    """Return the efforts with friction by the force in hinges and slides, by fixed-point steps."""
    motion, found = AbsoluteMotion(closure, inputs, rates, changes), dict.fromkeys(friction, 0.0)
    for _ in range(200):
        loads = [
            load
            for name, drag in found.items()
            for load in motion.joint_loads(name, -drag * np.sign(motion.joint_rate(name)))
        ]
        wrenches = motion.wrenches(GRAVITY, loads)
        for name, joint in friction.items():
            pair = closure.linkage.pair_joints[name]
            force = wrenches[pair.child, pair.parent][0]
            axis = motion.turned(pair.parent, pair.axis) / np.linalg.norm(pair.axis)
            pressed = np.linalg.norm(force - axis * (axis @ force))
            found[name] = joint.coefficient * (joint.radius or 1.0) * pressed
    return motion.efforts(GRAVITY, loads)


RUBBING = {
    'rssr': {
        'crank_joint': JointFriction(coefficient=0.2, radius=0.004),
        'rocker_joint': JointFriction(coefficient=0.15, radius=0.006),
    },
    'spatial_slider_crank': {'slide': JointFriction(coefficient=0.2)},
    'ankle_motors': {'pitch': JointFriction(coefficient=0.3, radius=0.005)},
}


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', RUBBING)
def test_load_dependent_friction_equals_a_fixed_point_iteration(name):
    closure = weighed(name)
    mechanics = Mechanics(closure, Loads(GRAVITY), Friction(RUBBING[name]))
    reactions = Reactions(mechanics)
    for state in states_of(closure, 3, 0.2):
        found = reactions.drive_efforts(*motion_of(closure, *state))
        expected = rubbing(closure, *state, RUBBING[name])
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-10)
        rigid = Mechanics(closure, Loads(GRAVITY)).drive_efforts(*motion_of(closure, *state))
        assert np.abs(np.subtract(found, rigid)).max() > 1e-4


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', ['rssr', 'spatial_slider_crank'])
def test_torque_command_equals_the_effort_of_its_acceleration(name):
    closure = weighed(name)
    mechanics = Mechanics(closure, Loads(GRAVITY), Friction(RUBBING[name]))
    reactions = Reactions(mechanics)
    mechanism = SingleDofMechanism(
        mechanics.motion_equation, METHODS['rk4'].step, friction_effort=reactions.friction_effort
    )
    for (value,), _, _ in states_of(closure, 3, 0.2):
        for rate, force in ((1.5, 3.0), (-0.7, 0.0)):
            change = mechanism.acceleration(mechanism.state_at(value, rate), force)
            efforts = rubbing(closure, [value], [rate], [change], RUBBING[name])
            assert efforts == pytest.approx((force,), abs=1e-8)


def test_friction_by_an_indeterminate_joint_force_is_refused():
    friction = Friction({'h1': JointFriction(coefficient=0.1, radius=0.01)})
    with pytest.raises(DefinitionError) as caught:
        Reactions(Mechanics(weighed('bennett'), Loads(GRAVITY), friction))
    assert str(caught.value).startswith(
        "effects.friction.joints.h1.coefficient: the force in 'h1' is not certain: the linkage is "
        'over-constrained'
    )
