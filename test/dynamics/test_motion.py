# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
How one freedom moves, sticks and stops, against motions in closed form.

The mechanisms are made by hand: a mass of 1 on a line, under a constant force or a spring.
"""

from itertools import pairwise
from math import cos, exp, inf, isfinite, pi, sin, sqrt

from hypothesis import example, given, strategies as st
from linkage_ros.dynamics import (
    LARGEST,
    LawTerm,
    METHODS,
    SeveralDofMechanism,
    SingleDofMechanism,
    Terms,
    TorqueTable,
)
from linkage_ros.dynamics.equation import InputLawTerm, InputTerms
import numpy as np
import pytest

STEP = {name: method.step for name, method in METHODS.items()}
EXACT = ['rk4', 'gauss_legendre']
"""Methods that have no error where the force is constant."""

MS = 1e-3


def sliding(slope=0.0, friction=0.0, viscous=0.0):
    """Return the terms of a mass of 1 on a line, on a slope that pulls it down by a force."""
    return lambda _value: Terms(1.0, 0.0, slope, viscous, friction)


def on_spring(stiffness, friction):
    return lambda value: Terms(1.0, 0.0, stiffness * value, 0.0, friction)


def run(mass, motion, steps, force=0.0, brake=0.0, step=MS):
    """Return the states from the given one on."""
    motions = [motion]
    for _ in range(steps):
        motion = mass.advance(motion, step, force, brake)
        motions.append(motion)
    return motions


@pytest.mark.parametrize('method', EXACT)
@pytest.mark.parametrize(('friction', 'brake'), [(2.0, 0.0), (0.0, 2.0), (0.5, 1.5)])
@pytest.mark.parametrize('rate', [3.0, -3.0])
def test_sliding_mass_stops_after_its_kinetic_energy(method, friction, brake, rate):
    mass = SingleDofMechanism(sliding(friction=friction), STEP[method])
    last = run(mass, mass.state_at(0.1, rate), 1600, brake=brake)[-1]
    assert last.rate == 0.0
    assert last.value == pytest.approx(0.1 + rate * abs(rate) / (2 * 2.0), abs=1e-12)
    assert mass.acceleration(last, 0.0, brake) == 0.0


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize(
    ('force', 'moves'),
    [(1.5, 0), (-1.0, 0), (1.5 + 0.3, 0), (-1.5 + 0.3, 0), (1.81, 1), (-1.21, -1)],
)
def test_mass_sticks_up_to_the_friction_limit(method, force, moves):
    mass = SingleDofMechanism(sliding(slope=0.3, friction=1.5), STEP[method])
    last = run(mass, mass.state_at(0.0, 0.0), 100, force)[-1]
    net = force - 0.3 - moves * 1.5
    assert last.rate == pytest.approx(moves * abs(net) * 0.1, abs=1e-12)
    assert mass.acceleration(mass.state_at(0.0, 0.0), force) == pytest.approx(moves * abs(net))
    assert (last.value == 0.0) is (moves == 0)


@pytest.mark.parametrize('method', METHODS)
def test_brake_holds_and_releases_a_mass(method):
    mass = SingleDofMechanism(sliding(slope=2.0), STEP[method])
    held = run(mass, mass.state_at(0.0, 0.0), 50, brake=2.5)[-1]
    assert (held.value, held.rate) == (0.0, 0.0)
    assert mass.acceleration(held, 0.0, 2.5) == 0.0
    assert mass.acceleration(held, 0.0, 1.5) == pytest.approx(-0.5)
    assert run(mass, held, 50, brake=1.5)[-1].rate == pytest.approx(-0.5 * 50 * MS)


@pytest.mark.parametrize('method', EXACT)
def test_viscous_friction_slows_a_mass_exponentially(method):
    mass = SingleDofMechanism(sliding(viscous=4.0), STEP[method])
    for k, motion in enumerate(run(mass, mass.state_at(0.0, 2.0), 500)):
        lasting = exp(-4.0 * k * MS)
        assert motion.rate == pytest.approx(2.0 * lasting, rel=1e-10)
        assert motion.value == pytest.approx(0.5 * (1.0 - lasting), abs=1e-10)
        assert mass.acceleration(motion, 0.0) == pytest.approx(-8.0 * lasting, rel=1e-10)


@pytest.mark.parametrize('method', METHODS)
def test_frictionless_reversal_takes_one_plain_step(method):
    mass = SingleDofMechanism(on_spring(100.0, 0.0), STEP[method])
    motion = mass.advance(mass.state_at(0.2, 0.01), 5 * MS, 0.0)
    assert motion.rate < 0.0
    assert motion[:2] == STEP[method](lambda q, _w, _t: -100.0 * q, 0.2, 0.01, -20.0, 5 * MS)


@pytest.mark.parametrize('method', EXACT)
def test_mass_slides_up_and_down_a_slope(method):
    # Up it is held back by weight and friction, down it is drawn by their difference.
    up, down, rate = 5.0 + 1.0, 5.0 - 1.0, 3.0
    mass = SingleDofMechanism(sliding(slope=5.0, friction=1.0), STEP[method])
    turn = rate / up
    for k, motion in enumerate(run(mass, mass.state_at(0.0, rate), 1000)):
        t = k * MS
        if t < turn:
            expected = (rate * t - 0.5 * up * t * t, rate - up * t)
        else:
            since = t - turn
            expected = (rate * rate / (2 * up) - 0.5 * down * since * since, -down * since)
        assert (motion.value, motion.rate) == pytest.approx(expected, abs=1e-12)


def test_spring_swings_shorten_equally_under_dry_friction():
    # Each half swing is a cosine about ±F/k, shorter by 2·F/k, and it rests within F/k.
    stiffness, friction = 100.0, 3.0
    centre, omega = friction / stiffness, sqrt(stiffness)
    mass = SingleDofMechanism(on_spring(stiffness, friction), STEP['gauss_legendre'])
    motions = run(mass, mass.state_at(0.2, 0.0), 1500)
    for k, motion in enumerate(motions):
        t, amplitude, side = k * MS, 0.2, 1.0
        while t > pi / omega and amplitude > centre:
            t, amplitude, side = t - pi / omega, amplitude - 2 * centre, -side
        swing = amplitude - centre
        expected = (side * amplitude, 0.0)
        if amplitude > centre:
            expected = (
                side * (centre + swing * cos(omega * t)),
                -side * swing * omega * sin(omega * t),
            )
        assert (motion.value, motion.rate) == pytest.approx(expected, abs=1e-11)
    assert motions[-1].rate == 0.0
    assert abs(motions[-1].value) == pytest.approx(0.02, abs=1e-12)


@pytest.mark.parametrize('method', EXACT)
@pytest.mark.parametrize('restitution', [0.5, 0.8, 1.0])
@pytest.mark.parametrize('upwards', [False, True])
def test_bounce_height_falls_with_the_restitution_squared(method, restitution, upwards):
    side = -1.0 if upwards else 1.0
    stops = (-inf, 0.0) if upwards else (0.0, inf)
    weight, height = 10.0, 0.8
    ball = SingleDofMechanism(sliding(slope=side * weight), STEP[method], stops, restitution)
    t = sqrt(2 * height / weight)
    impact = weight * t
    motion = ball.advance(ball.state_at(side * height, 0.0), t + 1e-12, 0.0)
    for _ in range(3):
        impact *= restitution
        # Half way through the flight it is as high as it comes, and stands.
        motion = ball.advance(motion, impact / weight, 0.0)
        assert side * motion.value == pytest.approx(impact * impact / (2 * weight), abs=1e-9)
        assert motion.rate == pytest.approx(0.0, abs=1e-9)
        motion = ball.advance(motion, impact / weight + 2e-12, 0.0)


def test_bounces_do_not_depend_on_the_step():
    ball = SingleDofMechanism(sliding(slope=10.0), STEP['rk4'], (0.0, inf), 0.7)
    fine = run(ball, ball.state_at(0.8, 0.0), 2000, step=MS)[-1]
    coarse = run(ball, ball.state_at(0.8, 0.0), 50, step=40 * MS)[-1]
    assert fine.value == pytest.approx(coarse.value, abs=1e-10)
    assert fine.rate == pytest.approx(coarse.rate, abs=1e-10)


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize('restitution', [0.0, 0.5, 0.9])
def test_bouncing_mass_finally_rests_at_the_stop(method, restitution):
    ball = SingleDofMechanism(sliding(slope=10.0), STEP[method], (0.25, inf), restitution)
    bounce = sqrt(2 * 0.01 / 10.0)  # all flights together last (1 + e)/(1 − e) as long
    lasts = bounce * (1 + restitution) / (1 - restitution)
    rest = run(ball, ball.state_at(0.26, 0.0), round(lasts / MS) + 20)[-1]
    assert (rest.value, rest.rate) == (0.25, 0.0)
    assert ball.acceleration(rest, 0.0) == 0.0
    assert ball.acceleration(rest, 9.0) == 0.0
    assert ball.acceleration(rest, 11.0) == pytest.approx(1.0)
    assert run(ball, rest, 100, force=11.0)[-1].rate == pytest.approx(0.1)


def test_zero_restitution_stops_the_mass_at_once():
    ball = SingleDofMechanism(sliding(), STEP['rk4'], (-1.0, 1.0))
    motions = run(ball, ball.state_at(0.0, 50.0), 40)
    assert (motions[19].value, motions[19].rate) == pytest.approx((0.95, 50.0))
    assert {(m.value, m.rate) for m in motions[21:]} == {(1.0, 0.0)}


def test_stop_precedes_a_later_reversal_within_one_step():
    # Friction alone would let it turn at 2.25 m, after 1.5 s.
    mass = SingleDofMechanism(sliding(slope=1.0, friction=1.0), STEP['rk4'], (-inf, 2.0), 0.5)
    motion = mass.advance(mass.state_at(0.0, 3.0), 1.0 + 1e-9, 0.0)
    assert (motion.value, motion.rate) == pytest.approx((2.0, -0.5), abs=1e-8)
    motion = mass.advance(mass.state_at(0.0, 3.0), 2.0, 0.0)
    assert motion.value == pytest.approx(2.0 - 0.5 * 1.0)
    assert motion.rate == pytest.approx(-0.5)


@pytest.mark.parametrize('method', METHODS)
def test_infinite_bounces_within_a_step_end_at_rest(method):
    # All flights together last 1.9 ms, or without loss for ever.
    for restitution in (0.9, 1.0):
        ball = SingleDofMechanism(sliding(slope=10.0), STEP[method], (0.0, inf), restitution)
        motion = ball.advance(ball.state_at(0.0, -5e-4), 0.5, 0.0)
        assert (motion.value, motion.rate) == (0.0, 0.0)


@pytest.mark.parametrize('method', METHODS)
def test_integrator_asks_no_terms_beyond_the_largest_value(method):
    def terms(value):
        assert abs(value) <= LARGEST
        return Terms(1e-90, 1.0, 0.0, 0.0, 0.0)

    mass = SingleDofMechanism(terms, STEP[method])
    for motion in run(mass, mass.state_at(0.0, LARGEST), 5, force=LARGEST, step=10.0):
        assert abs(motion.rate) <= LARGEST
        assert isfinite(mass.acceleration(motion, LARGEST))


def ends_at_1(value):
    """Return the terms of what ends at 1, as at a toggle, with nothing that stops it there."""
    return Terms(1.0, 0.0, 0.0, 0.0, 0.0) if value < 1.0 else None


def weighs_nothing_at_1(value):
    return Terms(1.0 if value < 1.0 else 0.0, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize('terms', [ends_at_1, weighs_nothing_at_1])
@pytest.mark.parametrize('method', METHODS)
def test_mass_is_held_at_the_end_of_motion(method, terms):
    mass = SingleDofMechanism(terms, STEP[method])
    motions = run(mass, mass.state_at(0.5, 10.0), 80, force=3.0)
    assert all(motion.value < 1.0 for motion in motions)
    assert motions[-1].value == pytest.approx(1.0, abs=1e-6)
    assert motions[-1].rate == 0.0
    assert run(mass, motions[-1], 100, force=-3.0)[-1].rate == pytest.approx(-0.3)


def test_massless_or_out_of_range_states_are_none():
    for inertia in (0.0, 1e-101):
        massless = SingleDofMechanism(lambda _value, i=inertia: Terms(i, 0, 0, 0, 0), STEP['rk4'])
        assert massless.state_at(0.0, 0.0) is None
    assert SingleDofMechanism(ends_at_1, STEP['rk4']).state_at(1.0, 0.0) is None
    assert SingleDofMechanism(sliding(), STEP['rk4'], (0.0, 1.0)).state_at(1.5, 0.0) is None
    assert SingleDofMechanism(sliding(), STEP['rk4']).state_at(0.0, 2 * LARGEST) is None


def test_step_without_convergence_is_subdivided():
    omega = 1e3
    mass = SingleDofMechanism(on_spring(omega * omega, 0.0), STEP['gauss_legendre'])
    seconds = 8 * MS
    motion = mass.advance(mass.state_at(1.0, 0.0), seconds, 0.0)
    assert motion.value == pytest.approx(cos(omega * seconds), abs=5e-3)


@given(
    method=st.sampled_from(list(METHODS)),
    forces=st.lists(st.floats(-LARGEST, LARGEST) | st.floats(-50.0, 50.0), max_size=8),
    friction=st.floats(0.0, 20.0),
    brake=st.just(0.0) | st.floats(0.0, 1e3),
    restitution=st.floats(0.0, 1.0),
)
def test_mass_stays_between_its_stops_under_any_force(
    method, forces, friction, brake, restitution
):
    mass = SingleDofMechanism(on_spring(30.0, friction), STEP[method], (-0.5, 0.75), restitution)
    motion = mass.state_at(0.0, 1.0)
    for force in forces:
        for _ in range(3):
            motion = mass.advance(motion, MS, force, brake)
            assert -0.5 <= motion.value <= 0.75
            assert isfinite(motion.rate)
            assert isfinite(mass.acceleration(motion, force, brake))


# Forces over time: a mass of 1 on a line, under the table of a force.


def pushed(rows, friction=0.0, slope=0.0, calls=None):
    """Return the terms of a mass of 1 on a line under a force over time; ``calls`` counts."""

    def terms(value):
        if calls is not None:
            calls.append(value)
        return Terms(1.0, 0.0, slope, 0.0, friction, laws=(LawTerm(1.0, value, 1.0),))

    return terms, (TorqueTable('time', tuple(rows)),)


@pytest.mark.parametrize('steps', [1, 3, 150])
@pytest.mark.parametrize('slope', [0.0, 3.0])
@pytest.mark.parametrize('friction', [0.0, 2.0])
@pytest.mark.parametrize('side', [1.0, -1.0], ids=['upper stop', 'lower stop'])
def test_load_over_time_pulls_a_mass_off_its_stop(side, friction, slope, steps):
    # 5 N into the stop until 0.05 s, then 100 N/s away from it, beside a weight.
    rows = [(0.05, slope + 5.0 * side), (0.15, slope - 5.0 * side)]
    terms, laws = pushed(rows, friction, slope)
    stops = (-inf, 0.0) if side > 0.0 else (0.0, inf)
    mass = SingleDofMechanism(terms, STEP['rk4'], stops, laws=laws)
    motion, seconds = mass.state_at(0.0, 0.0), 0.15 / steps
    for step in range(steps):
        motion = mass.advance(motion, seconds, 0.0, time=step * seconds)
    after = 0.15 - (0.05 + (5.0 + friction) / 100.0)
    assert motion.rate == pytest.approx(-side * 50.0 * after**2, rel=1e-9)
    assert motion.value == pytest.approx(-side * 50.0 / 3.0 * after**3, rel=1e-9)


@pytest.mark.parametrize('start', [0.0, 7.0])
@pytest.mark.parametrize('kink', [0.01, 0.05, 0.09])
def test_step_across_a_table_row_is_exact(kink, start):
    # 0 N until the kink, then 40 N/s: rk4 is exact on both sides of it.
    terms, laws = pushed([(start + kink, 0.0), (start + 1.0, 40.0 * (1.0 - kink))])
    mass = SingleDofMechanism(terms, STEP['rk4'], laws=laws)
    motion = mass.advance(mass.state_at(0.0, 1.0), 0.1, 0.0, time=start)
    after = 0.1 - kink
    assert motion.rate == pytest.approx(1.0 + 20.0 * after**2, rel=1e-12)
    assert motion.value == pytest.approx(0.1 + 20.0 / 3.0 * after**3, rel=1e-12)


def rising(rows, end):
    """Return impulse and way of a unit mass under a force with these rows, from 0 to an end."""
    marks = sorted({0.0, end, *(time for time, _ in rows if 0.0 < time < end)})
    times, forces = zip(*rows, strict=True)
    rate = way = 0.0
    for begin, stop in pairwise(marks):
        one, other = (float(np.interp(time, times, forces)) for time in (begin, stop))
        length = stop - begin
        way += rate * length + (2.0 * one + other) * length * length / 6.0
        rate += 0.5 * (one + other) * length
    return rate, way


@given(
    st.lists(
        st.tuples(
            st.floats(-2.0, 2.0),
            st.lists(st.tuples(st.floats(0.0, 0.12), st.floats(-40.0, 40.0)), min_size=1,
                     max_size=4, unique_by=lambda row: round(row[0], 3)),
        ),
        min_size=2,
        max_size=3,
    )
)  # fmt: skip
@example([(1.0, [(0.0, 0.0), (0.1, 20.0)]), (1.0, [(0.05, 0.0), (0.15, 40.0)])])
@example([(1.0, [(0.05, 0.0), (0.15, 40.0)]), (1.0, [(0.0, 0.0), (1.0, 0.0)])])
def test_step_across_rows_of_several_tables_is_exact(loads):
    # The force is linear between the rows of all tables: rk4 is exact from one to the next.
    tables = [TorqueTable('time', tuple(sorted(rows))) for _, rows in loads]
    given_by = tuple(LawTerm(lever, 0.0, 0.0) for lever, _ in loads)
    mass = SingleDofMechanism(
        lambda _value: Terms(1.0, 0.0, 0.0, 0.0, 0.0, laws=given_by), STEP['rk4'],
        laws=tuple(tables),
    )  # fmt: skip
    motion = mass.advance(mass.state_at(0.0, 0.0), 0.1, 0.0)
    each = [(lever, *rising(sorted(rows), 0.1)) for lever, rows in loads]
    rate, way = (sum(x * part[n] for x, *part in each) for n in range(2))
    assert motion.rate == pytest.approx(rate, abs=1e-11)
    assert motion.value == pytest.approx(way, abs=1e-12)
    # Two inputs alike, which the loads move in opposite directions.
    terms = InputTerms(
        (1.0, 0.0, 1.0), ((1.0, 0.0), (0.0, 1.0)), (0.0, 0.0),
        tuple(InputLawTerm((lever, -2.0 * lever), 0.0, 0.0) for lever, _ in loads),
    )  # fmt: skip
    free = ((-inf, inf),) * 2
    masses = SeveralDofMechanism(lambda *_: terms, STEP['rk4'], free, laws=tuple(tables))
    moved = masses.advance(masses.state_at((0.0, 0.0), (0.0, 0.0)), 0.1, (0.0, 0.0))
    assert moved.rate == pytest.approx((rate, -2.0 * rate), abs=1e-11)
    assert moved.value == pytest.approx((way, -2.0 * way), abs=1e-12)


def test_step_across_many_table_rows_has_bounded_cost():
    costs = []
    for count in (1000, 2000):
        # A force of 10 N all the time, in many rows.
        calls = []
        rows = [(0.1 * row / count, 10.0) for row in range(count + 1)]
        terms, laws = pushed(rows, calls=calls)
        mass = SingleDofMechanism(terms, STEP['rk4'], laws=laws)
        motion = mass.advance(mass.state_at(0.0, 0.0), 0.1, 0.0)
        assert motion.rate == pytest.approx(1.0, rel=1e-9)
        costs.append(len(calls))
    assert costs[1] < 1.5 * costs[0]
