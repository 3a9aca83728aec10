# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The balls hold the truth: by power series of dyads, and by their own differences."""

from dataclasses import fields
from functools import cache
from math import pi
from typing import Any

from campaigns.accuracy.adversarial import ADVERSARIAL, four_bar, inverted_slider_crank
from campaigns.accuracy.random_families import RANDOM
from campaigns.accuracy.reference import Outcome, Reference as Elsewhere
from campaigns.accuracy.run import make
from flint import ctx
from linkage_ros import load
from linkage_ros.kinematics import (
    Closure,
    Input,
    Linkage,
    RevoluteJoint,
    SlideJoint,
    Slider,
    Status,
    usual_inputs,
)
from linkage_ros.tools.study import prove, SingularError, solve
from mpmath import mp, mpf
import pytest

from ...kinematics import reference
from ...kinematics.samples import (
    FOUR_BARS,
    four_bars,
    inverted_slider_cranks,
    SLIDER_CRANKS,
)

IN_SPACE = ['rssr', 'spatial_slider_crank', 'delta', 'ankle', 'ankle_motors', 'wishbone']


@cache
def closure_of(name: str) -> Closure:
    return load(name)


def number_of(ball: Any) -> mpf:
    """Return the middle of a ball to 90 digits."""
    before, ctx.prec = ctx.prec, 512
    try:
        return mpf(ball.mid().str(90, radius=False))
    finally:
        ctx.prec = before


def apart(ball: Any, value: Any, turning: bool, unit: float = 1.0) -> mpf:
    """Return how far a value is from a narrow ball, to 90 digits; of angles, modulo 2π."""
    with mp.workdps(90):
        assert float(ball.rad()) <= 1e-40 * max(unit, abs(float(value)))
        difference = number_of(ball) - mp.mpf(value)
        if turning:
            difference -= 2 * mp.pi * mp.nint(difference / (2 * mp.pi))
        return abs(difference)


def coefficient(truth: Any, joint: int, order: int, unit: float) -> mpf:
    """Return a joint's derivative from its power series, whose lengths are in a unit."""
    with mp.workdps(90):
        value = mpf(truth.joints[joint][order].mid().str(90, radius=False))
        return value * (1, 1, 2)[order] * unit


@pytest.mark.sample(10)
@pytest.mark.parametrize('family', [*RANDOM, *ADVERSARIAL])
def test_interval_enclosures_contain_the_power_series_solutions(family):
    """By dyads and power series, and by the constraints: they share the linkage alone."""
    compared = 0
    for index in range(20):
        mechanism, angles, accelerations = make(7, family, index)
        closure, elsewhere = Closure(mechanism.linkage()), Elsewhere(mechanism)
        for phi, alpha in [*zip(angles, accelerations, strict=True)][::5]:
            expected = elsewhere.solve(phi, alpha)
            if expected.outcome is not Outcome.CLOSED or not closure.position(phi).joints:
                continue
            found = prove(closure, [phi], [1.0], [alpha])
            for joint, turning in enumerate(closure.turning):
                unit = 1.0 if turning else 2.0**expected.motion.exponent
                for order in range(3):
                    value = coefficient(expected, joint, order, unit)
                    ball = found[order][joint]
                    off = apart(ball, value, turning and not order, unit)
                    # The series is a ball too; a difference of 90 digits is rounded.
                    held = float(ball.rad()) + 2.0 * unit * float(
                        expected.joints[joint][order].rad()
                    )
                    held += 1e-60 * max(unit, abs(value))
                    assert off <= held, (index, phi, joint, order)
                    compared += 1
        if compared > 30:
            return
    assert compared


LOOPS = {
    **{
        f'four-bar, {family}': (four_bar, 4, reference.four_bar, four_bars) for family in FOUR_BARS
    },
    **{
        f'swivel, {family}': (
            inverted_slider_crank, 3, reference.inverted_slider_crank, inverted_slider_cranks
        )
        for family in SLIDER_CRANKS
    },
}  # fmt: skip


@pytest.mark.sample(5)
@pytest.mark.parametrize('loop', LOOPS)
def test_interval_enclosures_contain_the_reference_loops(loop):
    make_mechanism, count, solve_loop, cases = LOOPS[loop]
    compared = 0
    for *lengths, phi, side in cases(loop.split(', ')[1], 60):
        truth = solve_loop(*lengths, phi, side, digits=120)
        _, *expected = (getattr(truth, field.name) for field in fields(truth))
        closure = Closure(make_mechanism(tuple(lengths[:count]), side).linkage())
        if expected[-1] is None or not closure.position(phi).joints:
            continue
        try:
            found = prove(closure, [phi])
        except SingularError:
            # Within some 1e-12 of a toggle a double does not tell its two assemblies apart.
            assert max(condition for _, condition in expected) > 1e6
            continue
        for k, (value, condition) in enumerate(expected):
            ball, turning = found[k // 2][k % 2], closure.turning[k % 2] and k < 2
            assert apart(ball, value, turning, condition) <= 1e-45 * max(1, condition)
        compared += 1
    assert compared > 5


def test_interval_enclosure_equals_the_worked_slider_crank():
    # AB 15, A to D 25, D to C 10, crank at 60 degrees: r3 and θ3, as the sources' README has them.
    linkage = Linkage(
        links={
            'ground': {'A': (0.0, 0.0), 'C': (25.0, 10.0)},
            'crank': {'A': (0.0, 0.0), 'B': (15.0, 0.0)},
            'rod': {'B': (0.0, 0.0)},
        },
        inputs=(Input('crank_joint', 'ground', 'crank'),),
        assembly={'swivel': 'ahead'},
        joints={'rod_joint': RevoluteJoint('ground', 'rod'), 'slide': SlideJoint('swivel')},
        sliders={'swivel': Slider('C', 'rod', 'B', (1.0, 0.0))},
    )
    # A double is not quite 60 degrees: the rates there make up for the rest.
    angle = pi / 3
    found = prove(Closure(linkage), [angle])
    with mp.workdps(60):
        rest = mp.pi / 3 - mpf(angle)
        rod, slide = (
            number_of(joint) + rest * number_of(rate)
            for joint, rate in zip(found.joints, found.rates, strict=True)
        )
        assert abs(slide - mpf('17.753658182601928364')) < 1e-18
        assert abs(rod * 180 / mp.pi + mpf('9.6969819871210262071')) < 1e-18


@pytest.mark.parametrize('distance', [1e-3, -1e-3, 1e-6, 1e-9, -1e-9, 1e-12])
def test_interval_enclosure_follows_a_parallelogram_near_change_points(distance):
    found = prove(closure_of('parallelogram'), [distance], [1.0], [0.5])
    for order, value in enumerate((distance, 1.0, 0.5)):
        rod, follower = found[order]
        assert apart(rod, -value, turning=False) < 1e-40
        assert apart(follower, value, turning=False) < 1e-40


@pytest.mark.sample(4)
@pytest.mark.parametrize(
    'name',
    ['class_3', 'five_bar', 'excavator_bucket', 'whitworth_quick_return', *IN_SPACE],
)
def test_interval_derivatives_equal_numerical_ones(name):
    closure = closure_of(name)
    inputs = usual_inputs(closure)
    rates = [0.7 - 1.1 * k for k in range(len(inputs))]
    accelerations = [0.3 + k for k in range(len(inputs))]
    found = prove(closure, inputs, rates, accelerations)
    h = 2.0**-20

    def at(time: float) -> Any:
        moved = [
            x + v * time + a * time**2 / 2
            for x, v, a in zip(inputs, rates, accelerations, strict=True)
        ]
        return prove(
            closure,
            moved,
            [v + a * time for v, a in zip(rates, accelerations, strict=True)],
            accelerations,
        )

    before, after = at(-h), at(h)
    with mp.workdps(90):
        for k, joint in enumerate(found.joints):
            ahead, behind = (
                (number_of(end.joints[k]) - number_of(joint) + mp.pi) % (2 * mp.pi) - mp.pi
                for end in (after, before)
            )
            # What is left is of the third derivative, and of the roundings of the inputs.
            assert abs((ahead - behind) / (2 * h) - number_of(found.rates[k])) < 1e-8
            swept = (number_of(after.rates[k]) - number_of(before.rates[k])) / (2 * h)
            assert abs(swept - number_of(found.accelerations[k])) < 1e-7


@pytest.mark.parametrize('name', ['four_bar', 'jansen_leg', 'scotch_yoke', 'class_3', *IN_SPACE])
def test_thirty_digit_solver_equals_the_interval_enclosure(name):
    closure = closure_of(name)
    inputs = usual_inputs(closure)
    for found, ball in zip(
        solve(closure, inputs, 104), prove(closure, inputs).joints, strict=True
    ):
        assert abs(float((found - ball).mid())) < 1e-28


def test_interval_proof_refuses_a_change_point():
    with pytest.raises(SingularError, match='nothing is proved'):
        prove(closure_of('parallelogram'), [0.0])


def test_interval_proof_refuses_an_open_loop():
    with pytest.raises(ValueError, match='open'):
        prove(closure_of('double_rocker'), [3.0])


@pytest.mark.parametrize('name', IN_SPACE)
def test_spatial_enclosures_hold_the_closed_form_within_rounding(name):
    """The two share the linkage alone: places and turns of links here, angles of joints there."""
    closure = closure_of(name)
    for part in (-0.7, 0.0, 0.4):
        inputs = [value + 0.03 * part * (k + 1) for k, value in enumerate(usual_inputs(closure))]
        if closure.position(*inputs).status is not Status.CLOSED:
            inputs = usual_inputs(closure)
        position = closure.position(*inputs)
        rates, changes = [0.5] * len(inputs), [-0.2] * len(inputs)
        velocity = closure.velocity(position, *rates)
        acceleration = closure.acceleration(position, velocity, *changes)
        found = prove(closure, inputs, rates, changes)
        for order, values in enumerate((position.joints, velocity.joints, acceleration.joints)):
            for k, value in enumerate(values):
                unit = 1.0 if closure.turning[k] else closure.scale
                turning = closure.turning[k] and not order
                assert apart(found[order][k], value, turning, unit) < 1e-12 * 10.0**order * unit


@pytest.mark.parametrize('name', ['bennett', 'hooke_joint', 'spherical_four_bar'])
def test_over_constrained_linkages_have_no_exact_joints(name):
    closure = closure_of(name)
    with pytest.raises(SingularError, match='3 constraints more than unknowns'):
        prove(closure, usual_inputs(closure))
