# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The equation of motion: closed forms of plain linkages, slopes by differences, and the work done.

The efforts are held against Lagrange's equations, differentiated numerically from the energy; the
energy itself against closed forms here and against another engine in `test_against_mujoco`.
"""

from dataclasses import replace
from math import cos, hypot, sin

from hypothesis import given, strategies as st
from linkage_ros.dynamics import Friction, JointFriction, Loads, Mechanics, Spring, Terms
from linkage_ros.kinematics import Closure, Input, Linkage, Mass, RevoluteJoint, Status
import numpy as np
import pytest

from .loaded import closed, four_bar, loads_of, scotch_yoke, slope, STATES

ONE_INPUT = [name for name, states in STATES.items() if len(states[0]) == 1]
GRAVITY = 9.81


def arm(mass: Mass) -> Closure:
    """Return a crank that carries nothing: a physical pendulum."""
    return Closure(
        Linkage(
            {'ground': {'O': (0.0, 0.0), 'S': (0.0, 0.5)}, 'arm': {'O': (0.0, 0.0), 'P': (1, 0)}},
            (Input('turn', 'ground', 'arm'),),
            {},
            {'arm': RevoluteJoint('ground', 'arm')},
            {},
            masses={'arm': mass},
        )
    )


def assert_terms(found, expected, tolerance=0.0):
    """Hold an equation of motion, and the slips of its joints, to what is expected."""
    assert found[:5] == pytest.approx(expected[:5], rel=1e-13, abs=tolerance)
    assert sorted(map(abs, found.slips)) == pytest.approx(sorted(expected.slips), rel=1e-13)


@pytest.mark.parametrize('angle', [0.0, 0.4, 2.0, -1.5])
def test_pendulum_terms_equal_the_closed_form(angle):
    mechanics = Mechanics(arm(Mass(2.0, (0.3, 0.4), 0.1)), Loads((0.0, -GRAVITY), (), 0.07))
    # The centre is 0.5 m from O, at atan2(0.4, 0.3) from the arm's axis.
    height = 0.3 * sin(angle) + 0.4 * cos(angle)
    assert_terms(
        mechanics.motion_terms(mechanics.closure.position(angle)),
        Terms(
            inertia=0.07 + 0.1 + 2.0 * 0.25,
            half_slope=0.0,
            potential_slope=2.0 * GRAVITY * (0.3 * cos(angle) - 0.4 * sin(angle)),
            viscous=0.0,
            coulomb=0.0,
        ),
        tolerance=1e-14,
    )
    position = mechanics.closure.position(angle)
    assert mechanics.potential_energy(position) == pytest.approx(2.0 * GRAVITY * height)
    energy = 0.5 * (0.07 + 0.1 + 0.5) * 9.0 + 2.0 * GRAVITY * height
    assert mechanics.total_energy(position, 3.0) == pytest.approx(energy)


@pytest.mark.parametrize('angle', [0.3, 1.2, 2.8, -0.7])
def test_scotch_yoke_terms_equal_the_closed_form(angle):
    a, m, k, free, c = 0.05, 1.5, 400.0, 0.1, 8.0
    spring = Spring('ground', 'W', 'yoke', 'Y', k, free, c)
    friction = Friction(
        {
            'guide': JointFriction(3.0, 0.7),  # the yoke on the ground, at ẋ = −a·sin θ
            'slot': JointFriction(2.0, 0.5),  # the crank pin in the slot, at a·cos θ
            'O': JointFriction(0.01, 0.02),  # both pins turn as the crank does
            'A': JointFriction(0.03, 0.04),
        }
    )
    closure = scotch_yoke(Mass(0.4, (0.01, 0.0), 2e-4), Mass(m, (0.3, 0.2), 5.0))
    terms = Mechanics(closure, Loads(springs=(spring,)), friction).motion_terms(
        closure.position(angle)
    )
    sine, cosine = a * sin(angle), a * cos(angle)
    assert_terms(
        terms,
        Terms(
            inertia=2e-4 + 0.4 * 1e-4 + m * sine**2,
            half_slope=m * sine * cosine,
            potential_slope=-k * (0.2 + cosine - free) * sine,
            viscous=0.04 + (3.0 + c) * sine**2 + 2.0 * cosine**2,
            coulomb=0.06 + 0.7 * abs(sine) + 0.5 * abs(cosine),
            slips=(0.02, 0.04, 0.7 * abs(sine), 0.5 * abs(cosine)),
        ),
    )


def test_parallelogram_inertia_is_constant():
    # Crank and rocker swing alike, and the coupler goes round with them without turning.
    masses = {
        'crank': Mass(0.2, (0.03, 0.04), 1e-3),
        'coupler': Mass(0.7, (0.1, 0.2), 9.0),
        'rocker': Mass(0.2, (0.03, 0.04), 1e-3),
    }
    mechanics = Mechanics(four_bar(masses, 0.1, 0.3, 0.1, 0.3))
    for angle in (0.5, 2.0, -1.0):
        terms = mechanics.motion_terms(mechanics.closure.position(angle))
        assert terms.inertia == pytest.approx(2 * (1e-3 + 0.2 * 0.0025) + 0.7 * 0.01, rel=1e-14)
        assert terms.half_slope == pytest.approx(0.0, abs=1e-16)


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', ONE_INPUT)
def test_term_slopes_equal_numerical_derivatives(name):
    closure = closed(name)
    mechanics = Mechanics(closure, loads_of(closure.linkage))
    for (q,) in STATES[name]:
        terms = mechanics.motion_terms(closure.position(q))
        by_half = slope(lambda x: 0.5 * mechanics.motion_terms(closure.position(x)).inertia, q)
        by_height = slope(lambda x: mechanics.potential_energy(closure.position(x)), q)
        assert terms.half_slope == pytest.approx(by_half, rel=1e-8, abs=1e-9)
        assert terms.potential_slope == pytest.approx(by_height, rel=1e-8, abs=1e-9)


def lagrange(mechanics, q, rates, pulls):
    """Return M·q̈ + Σₖ q̇ₖ·(∂M/∂qₖ)·q̇ − ½·(q̇ᵀ·(∂M/∂qᵢ)·q̇)ᵢ + ∂V/∂q, by differences alone."""
    size, closure = len(q), mechanics.closure
    units = np.eye(size)

    def potential(x):
        return mechanics.potential_energy(closure.position(*x))

    def kinetic(x, v):
        position = closure.position(*x)
        return mechanics.kinetic_energy(position, closure.velocity(position, *v))

    def matrix(x):
        found = np.diag([2.0 * kinetic(x, unit) for unit in units])
        for i in range(size):
            for j in range(i):
                both = kinetic(x, units[i] + units[j])
                found[i, j] = found[j, i] = both - 0.5 * (found[i, i] + found[j, j])
        return found

    q, rates = np.array(q), np.array(rates)
    slopes = [slope(lambda x, u=unit: matrix(q + x * u), 0.0) for unit in units]
    weights = [slope(lambda x, u=unit: potential(q + x * u), 0.0) for unit in units]
    changed = sum(rate * by for rate, by in zip(rates, slopes, strict=True))
    bent = np.array([0.5 * rates @ by @ rates for by in slopes])
    return matrix(q) @ np.array(pulls) + changed @ rates - bent + np.array(weights)


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', STATES)
def test_drive_efforts_equal_lagranges_equations(name):
    closure = closed(name)
    mechanics = Mechanics(closure, loads_of(closure.linkage))
    for q in STATES[name]:
        rates, pulls = [1.3, -0.8][: len(q)], [-2.0, 3.5][: len(q)]
        position = closure.position(*q)
        velocity = closure.velocity(position, *rates)
        acceleration = closure.acceleration(position, velocity, *pulls)
        efforts = mechanics.drive_efforts(position, velocity, acceleration)
        assert efforts == pytest.approx(lagrange(mechanics, q, rates, pulls), rel=1e-7, abs=1e-8)


@pytest.mark.sample(5)
@pytest.mark.parametrize('name', STATES)
def test_drive_power_equals_energy_rate_plus_losses(name):
    # Power balance, with the rates in pins, sliders and dampers by differences of the position.
    closure = closed(name)
    linkage = closure.linkage
    loads = loads_of(linkage, damping=15.0)
    joints = {
        joint.name: JointFriction(0.1 + 0.02 * i, 0.2 + 0.05 * i)
        for i, joint in enumerate(closure.structure.joints)
    }
    mechanics = Mechanics(closure, loads, Friction(joints))
    for q in STATES[name]:
        rates, pulls = [1.3, -0.8][: len(q)], [-2.0, 3.5][: len(q)]
        position = closure.position(*q)
        velocity = closure.velocity(position, *rates)
        efforts = mechanics.drive_efforts(
            position, velocity, closure.acceleration(position, velocity, *pulls)
        )

        def at(t, q=q, rates=rates, pulls=pulls):
            moved = [x + v * t + 0.5 * a * t * t for x, v, a in zip(q, rates, pulls, strict=True)]
            return closure.position(*moved)

        def energy(t, at=at, rates=rates, pulls=pulls):
            return mechanics.total_energy(
                at(t), *(v + a * t for v, a in zip(rates, pulls, strict=True))
            )

        lost = 0.0
        for joint in closure.structure.joints:

            def value(t, joint=joint, at=at):
                if joint.kind == 'P':
                    return closure.slide_values(at(t))[joint.name]
                angles = closure.link_angles(at(t))
                return angles[joint.link] - angles[joint.to]

            rate, friction = slope(value, 0.0), joints[joint.name]
            lost += friction.viscous * rate**2 + friction.coulomb * abs(rate)
        for spring in loads.springs:

            def length(t, spring=spring, at=at):
                points = closure.points(at(t))
                one, other = (points[end] for end in spring.ends)
                return abs(other - one)

            lost += spring.damping * slope(length, 0.0) ** 2
        put_in = sum(tau * rate for tau, rate in zip(efforts, rates, strict=True))
        assert lost > 0.0
        assert put_in == pytest.approx(slope(energy, 0.0) + lost, rel=1e-7, abs=1e-8)


@given(st.floats(-3.0, 3.0), st.floats(-20.0, 20.0), st.floats(-100.0, 100.0))
@pytest.mark.parametrize('name', ['four_bar', 'slider_crank', 'watt_1'])
def test_drive_effort_equals_the_equation_of_motion(name, q, rate, pull):
    closure = CLOSED[name]
    friction = Friction({'A': JointFriction(0.2, 0.3), 'B': JointFriction(0.1, 0.0)})
    mechanics = Mechanics(closure, loads_of(closure.linkage, damping=2.0), friction)
    position = closure.position(q)
    velocity = closure.velocity(position, rate)
    acceleration = closure.acceleration(position, velocity, pull)
    (effort,) = mechanics.drive_efforts(position, velocity, acceleration)
    terms = mechanics.motion_terms(position)
    parts = [terms.inertia * pull, terms.half_slope * rate**2]
    parts += [terms.potential_slope, terms.viscous * rate]
    if rate:
        parts.append(terms.coulomb if rate > 0.0 else -terms.coulomb)
    assert effort == pytest.approx(sum(parts), abs=1e-12 * max(1.0, *map(abs, parts)))


CLOSED = {name: closed(name) for name in ('four_bar', 'slider_crank', 'watt_1')}


def test_toggled_and_open_states_have_no_motion_terms():
    masses = {name: Mass(1.0, (0.0, 0.0), 1.0) for name in ('crank', 'coupler', 'rocker')}
    closure = four_bar(masses, 1.0, 1.0, 1.0, 3.0)
    mechanics = Mechanics(closure, Loads((0.0, -GRAVITY)))
    stretched, beyond = closure.position(0.0), closure.position(1.0)
    assert (stretched.status, beyond.status) == (Status.TOGGLE, Status.OPEN)
    assert mechanics.motion_terms(stretched) is None
    assert mechanics.motion_terms(beyond) is None
    # At the toggle the links still lie somewhere.
    assert mechanics.potential_energy(stretched) == pytest.approx(0.0, abs=1e-12)


def test_overflowing_masses_give_no_motion_terms():
    linkage = CLOSED['four_bar'].linkage
    masses = {**linkage.masses, 'rocker': Mass(1e308, (1e3, 0.0), 1.0)}
    mechanics = Mechanics(Closure(replace(linkage, masses=masses)))
    assert mechanics.motion_terms(mechanics.closure.position(1.0)) is None


def test_spring_with_coincident_ends_exerts_no_force():
    spring = Spring('ground', 'O', 'arm', 'O', 100.0, 0.1, 5.0)
    mechanics = Mechanics(arm(Mass(2.0, (0.3, 0.4), 0.1)), Loads(springs=(spring,)))
    position = mechanics.closure.position(1.0)
    assert_terms(mechanics.motion_terms(position), Terms(0.6, 0.0, 0.0, 0.0, 0.0), tolerance=1e-15)
    assert mechanics.potential_energy(position) == pytest.approx(0.5 * 100.0 * 0.01)


def test_sliding_input_terms_equal_the_ladder_closed_form():
    # A ladder of length ℓ on X = (x, 0), Y = (0, y): its centre at (x, y)/2, its angle from x/ℓ.
    closure = closed('elliptic_trammel')
    linkage = replace(closure.linkage, masses={'bar': Mass(2.0, (0.06, 0.0), 3e-3)})
    mechanics = Mechanics(Closure(linkage), Loads((0.0, -GRAVITY), (), 0.5))
    for x in (0.05, -0.03):
        y = (0.12**2 - x * x) ** 0.5
        # ẏ = −x/y·ẋ, and θ̇ = ẋ/y.
        speed, turn = hypot(0.5, 0.5 * x / y), 1.0 / y
        terms = mechanics.motion_terms(mechanics.closure.position(x))
        assert terms.inertia == pytest.approx(0.5 + 2.0 * speed**2 + 3e-3 * turn**2, rel=1e-13)
        assert terms.potential_slope == pytest.approx(-2.0 * GRAVITY * 0.5 * x / y, rel=1e-13)
