# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Forces in pins and sliders: statics of the textbook, and Newton's law for the linkage as a whole.

Pins of a four-bar and a six-bar are held against another engine in `test_against_mujoco`.
"""

from dataclasses import replace
from math import asin, cos, sin, tan

from linkage_ros.dynamics import Friction, JointFriction, Loads, Mechanics, Reactions, Spring
from linkage_ros.kinematics import (
    Closure,
    Input,
    Linkage,
    Mass,
    RevoluteJoint,
    Slider,
    Status,
)
import numpy as np
import pytest

from .loaded import (
    closed,
    everywhere,
    four_bar,
    loads_of,
    scotch_yoke,
    shipped,
    STATES,
)

WEIGHTLESS = 0.0
"""In [kg]."""


def at_rest(mechanics, *inputs):
    """Return the reactions by name, and the effort of the first drive, of what stands still."""
    closure, still = mechanics.closure, [0.0] * len(inputs)
    position = closure.position(*inputs)
    velocity = closure.velocity(position, *still)
    return moving(mechanics, position, velocity, closure.acceleration(position, velocity, *still))


def moving(mechanics, position, velocity, acceleration):
    reactions = Reactions(mechanics)
    found = reactions.solve(position, velocity, acceleration)
    effort = Reactions(mechanics).drive_efforts(position, velocity, acceleration)[0]
    return dict(zip(reactions.names, found, strict=True)), effort


@pytest.mark.parametrize('angle', [0.5, 1.2, 2.2])
def test_two_bar_reactions_equal_the_method_of_joints(angle):
    # Coupler and rocker are two bars that meet at B, where all the weight hangs; A is held by the
    # crank. Method of joints: each bar is in line with its force, and both carry the weight.
    none = Mass(WEIGHTLESS, (0.0, 0.0), 0.0)
    masses = {'crank': none, 'coupler': Mass(3.0, (0.3, 0.0), 0.0), 'rocker': none}
    closure = four_bar(masses, 0.1, 0.3, 0.25, 0.35, side='right')
    found, effort = at_rest(Mechanics(closure, Loads((0.0, -10.0))), angle)
    points = closure.points(closure.position(angle))
    a, b, d = (points[key] for key in (('crank', 'A'), ('rocker', 'B'), ('ground', 'O4')))
    one, other = (b - a) / abs(b - a), (b - d) / abs(b - d)
    # n1·one + n2·other = weight, by Cramer's rule; n is a tension.
    across = one.real * other.imag - one.imag * other.real
    n1, n2 = 30.0 * other.real / across, -30.0 * one.real / across
    # At A the crank pulls the coupler back with n1, at D the ground the rocker with n2.
    assert found['A'][:2] == pytest.approx((-n1 * one.real, -n1 * one.imag))
    assert found['O4'][:2] == pytest.approx((-n2 * other.real, -n2 * other.imag))
    assert found['B'][:2] == pytest.approx((n2 * other.real, n2 * other.imag))
    assert effort == pytest.approx(-n1 * (a.real * one.imag - a.imag * one.real))
    assert all(reaction.moment == 0.0 for reaction in found.values())


@pytest.mark.parametrize('angle', [0.4, 1.5, 2.7, -1.0])
def test_slider_crank_side_force_equals_the_textbook(angle):
    # A spring far behind pushes on the piston along its line: N = F·tan φ, and the crank takes
    # M = F·r·sin(θ + φ)/cos φ (R. L. Norton, Design of Machinery, ch. 13).
    r, rod, force = 0.04, 0.14, 50.0
    linkage = Linkage(
        {
            'ground': {'O': (0.0, 0.0), 'S': (10.0, 0.0)},
            'crank': {'O': (0.0, 0.0), 'A': (r, 0.0)},
            'rod': {'A': (0.0, 0.0), 'B': (rod, 0.0)},
        },
        (Input('turn', 'ground', 'crank'),),
        {'cylinder': 'ahead'},
        {'rod': RevoluteJoint('crank', 'rod')},
        {'cylinder': Slider('B', 'ground', 'O', (1.0, 0.0))},
        masses={name: Mass(WEIGHTLESS, (0.0, 0.0), 0.0) for name in ('crank', 'rod')},
    )
    closure = Closure(linkage)
    phi = asin(r / rod * sin(angle))
    length = 10.0 - r * cos(angle) - rod * cos(phi)
    spring = Spring('ground', 'S', 'rod', 'B', 100.0, length + force / 100.0)
    found, effort = at_rest(Mechanics(closure, Loads(springs=(spring,))), angle)
    assert effort == pytest.approx(-force * r * sin(angle + phi) / cos(phi))
    assert found['cylinder'] == pytest.approx((0.0, force * tan(phi), 0.0), abs=1e-9)
    assert found['A'][:2] == pytest.approx((force, -force * tan(phi)))
    # The rod pushes the block, which has no mass, as hard against the cylinder.
    assert found['B'] == pytest.approx((0.0, -force * tan(phi), 0.0), abs=1e-9)


@pytest.mark.parametrize('angle', [0.3, 1.2, 2.8, -0.7])
def test_scotch_yoke_reactions_equal_the_closed_form(angle):
    # x = a·cos θ: the slot pushes the yoke with m·ẍ at the height a·sin θ of the crank pin, and
    # rubs along the slot; the guide bears the rest of the weight and both moments about Y.
    a, m, rate, pull = 0.05, 1.5, 3.0, 7.0
    closure = scotch_yoke(Mass(WEIGHTLESS, (0.0, 0.0), 0.0), Mass(m, (0.3, 0.2), 5.0))
    friction = Friction({'guide': JointFriction(2.0, 0.4), 'slot': JointFriction(0.0, 0.6)})
    mechanics = Mechanics(closure, Loads((0.0, -10.0)), friction)
    position = closure.position(angle)
    velocity = closure.velocity(position, rate)
    acceleration = closure.acceleration(position, velocity, pull)
    found, effort = moving(mechanics, position, velocity, acceleration)
    sine, cosine = sin(angle), cos(angle)
    speed, bend = -a * sine * rate, -a * (cosine * rate**2 + sine * pull)
    rubbing = -(2.0 * speed + (0.4 if speed > 0 else -0.4))
    dragged = -0.6 if cosine * rate > 0 else 0.6  # what the yoke does to the block in the slot
    pushed = m * bend - rubbing
    lift = 10.0 * m + dragged
    # About the yoke's centre, which is 0.3 to the right of Y and 0.2 above it:
    # moment + (Y − c) × guide + (pin − c) × slot = 0.
    moment = -(-0.3 * lift + 0.2 * rubbing) - (-0.3 * -dragged - (a * sine - 0.2) * pushed)
    assert found['slot'] == pytest.approx((-pushed, dragged, 0.0), abs=1e-12)
    assert found['guide'] == pytest.approx((rubbing, lift, moment), rel=1e-12)
    assert effort == pytest.approx(a * (-sine * pushed - cosine * dragged))


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', STATES)
def test_reaction_effort_equals_the_energy_effort(name):
    closure = closed(name)
    friction = Friction(
        {joint.name: JointFriction(0.1, 0.3) for joint in closure.structure.joints}
    )
    loads = replace(loads_of(closure.linkage, damping=15.0), applied=everywhere(closure))
    mechanics = Mechanics(closure, loads, friction)
    for q in STATES[name]:
        rates, pulls = [1.3, -0.8][: len(q)], [-2.0, 3.5][: len(q)]
        position = closure.position(*q)
        velocity = closure.velocity(position, *rates)
        acceleration = closure.acceleration(position, velocity, *pulls)
        assert Reactions(mechanics).drive_efforts(
            position, velocity, acceleration
        ) == pytest.approx(mechanics.drive_efforts(position, velocity, acceleration), rel=1e-10)


def test_pin_moments_equal_the_friction_moments():
    closure = Closure(shipped('four_bar'))
    mechanics = Mechanics(closure, Loads(), Friction({'B': JointFriction(0.5, 0.25)}))
    position = closure.position(1.0)
    velocity = closure.velocity(position, 2.0)
    found, _ = moving(mechanics, position, velocity, closure.acceleration(position, velocity, 0.0))
    coupler, rocker = velocity.joints
    rate = rocker - (coupler + 2.0)  # of the rocker, which is the joint's link, to the coupler
    sign = 1.0 if rate > 0 else -1.0
    assert found['B'].moment == pytest.approx(-0.5 * rate - sign * 0.25)
    assert [found[name].moment for name in ('O2', 'O4', 'A')] == [0.0, 0.0, 0.0]


NAMES = {
    'four_bar': ('O2', 'O4', 'A', 'B'),
    'slider_crank': ('O2', 'A', 'B', 'cylinder'),
    # Three links share the pin C.
    'excavator_bucket': ('J', 'I', 'K', 'C/rocker', 'C/bucket_link', 'E', 'bore'),
}


@pytest.mark.parametrize('name', NAMES)
def test_reactions_list_the_pin_and_slider_names(name):
    assert Reactions(Mechanics(Closure(shipped(name)))).names == NAMES[name]


def test_slider_named_as_its_pin_gets_a_suffix():
    linkage = shipped('slider_crank')
    cylinder = linkage.sliders['cylinder']
    renamed = replace(
        linkage,
        sliders={'B': cylinder},
        assembly={'B': 'ahead'},
        joints={'rod_joint': RevoluteJoint('crank', 'connecting_rod')},
    )
    names = Reactions(Mechanics(Closure(renamed))).names
    assert names == ('O2', 'A', 'B', 'B/ground')


@pytest.mark.parametrize('angle', [0.5, 1.2, 2.2])
@pytest.mark.parametrize('far', [1.0, 1e4, 1e6])
def test_distant_centre_of_mass_keeps_reactions_exact(far, angle):
    # The coupler is a bar without weight: its tension holds the rocker about O4.
    none = Mass(WEIGHTLESS, (0.0, 0.0), 0.0)
    masses = {'crank': none, 'coupler': none, 'rocker': Mass(3.0, (far, 0.3 * far), 0.0)}
    closure = four_bar(masses, 0.1, 0.3, 0.25, 0.35, side='right')
    position = closure.position(angle)
    points, turned = closure.points(position), closure.link_angles(position)['rocker']
    a, b, d = (points[key] for key in (('crank', 'A'), ('rocker', 'B'), ('ground', 'O4')))
    along = (b - a) / abs(b - a)
    pull = 30.0 * far * (cos(turned) - 0.3 * sin(turned)) / ((b - d).conjugate() * along).imag
    found, _ = at_rest(Mechanics(closure, Loads((0.0, -10.0))), angle)
    assert abs(complex(*found['B'][:2]) - pull * along) < 1e-15 * abs(pull)
    assert abs(complex(*found['O4'][:2]) - 30j + pull * along) < 1e-15 * abs(pull)


def test_reactions_are_solved_without_numpy(monkeypatch):
    # Its last digits differ from machine to machine.
    closure = Closure(shipped('excavator_bucket'))
    reactions = Reactions(Mechanics(closure, loads_of(closure.linkage)))
    monkeypatch.setattr(np.linalg, 'solve', None)
    position = closure.position(*STATES['excavator_bucket'][0])
    velocity = closure.velocity(position, 0.1)
    assert reactions.solve(position, velocity, closure.acceleration(position, velocity, 0.0))
    assert reactions.joint_deflections(position, [1e-4j] * len(reactions.joints))


def test_toggled_and_open_states_have_no_reactions():
    masses = {name: Mass(1.0, (0.0, 0.0), 1.0) for name in ('crank', 'coupler', 'rocker')}
    closure = four_bar(masses, 1.0, 1.0, 1.0, 3.0)
    reactions = Reactions(Mechanics(closure))
    for angle, status in ((0.0, Status.TOGGLE), (1.0, Status.OPEN)):
        position = closure.position(angle)
        assert position.status is status
        assert reactions.joint_deflections(position, [0j] * 4) is None
        # There is no velocity to give.
        assert reactions.solve(position, None, None) is None
