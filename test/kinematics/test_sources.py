# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The worked examples of the source texts, to double precision, and where their formulas fail.

Numbers in full are the exact results of the texts' own problems, to twenty digits.
"""

from math import acos, cos, nextafter, pi, radians, sin

from linkage_ros.kinematics import (
    Closure,
    Input,
    Linkage,
    RevoluteJoint,
    SlideJoint,
    Slider,
    Status,
)
from mpmath import mp, mpf
import pytest

from .linkages import FourBar, InvertedSliderCrank
from .reference import ANGLE, four_bar, RATE, turned, UNIT_ROUNDOFF

# A crank that turns alone, one with its rocker, and two that meet a limit.
FOUR_BARS = {
    'crank-rocker': (2.0, 7.0, 9.0, 6.0),
    'double crank': (5.0, 4.0, 6.0, 2.0),
    'double rocker': (6.0, 2.0, 5.0, 4.5),
    'triple rocker': (4.0, 5.0, 3.0, 6.5),
}


@pytest.mark.parametrize(
    ('side', 'slide', 'degree'),
    [
        ('ahead', 0.17753658182601928364, -9.6969819871210262071),
        ('behind', -0.17753658182601928364, 170.3030180128789738),
    ],
)
def test_slider_crank_equals_the_worked_textbook_example(side, slide, degree):
    linkage = Linkage(
        links={
            'ground': {'A': (0.0, 0.0), 'C': (0.25, 0.10)},
            'crank': {'A': (0.0, 0.0), 'B': (0.15, 0.0)},
            'rod': {'B': (0.0, 0.0), 'end': (0.30, 0.0)},
        },
        inputs=(Input('crank_joint', 'ground', 'crank'),),
        assembly={'swivel': side},
        joints={'rod_joint': RevoluteJoint('ground', 'rod'), 'slide_joint': SlideJoint('swivel')},
        sliders={'swivel': Slider('C', 'rod', 'B', (1.0, 0.0))},
    )
    closure = Closure(linkage)
    position = closure.position(radians(60.0))
    rod, length = position.joints
    assert position.status is Status.CLOSED
    assert length == pytest.approx(slide, rel=4 * 2.0**-52, abs=0.0)
    assert float(turned(mpf(rod) - mp.radians(mpf(degree)))) == pytest.approx(0.0, abs=8e-16)
    assert closure.residual(position) < 2e-16


@pytest.mark.parametrize('name', FOUR_BARS)
def test_four_bar_pin_equals_the_textbook_quadratic_roots(name):
    # K1…K4 at 60 digits: what fails in them at sixteen does not matter there.
    a, b, c, d = FOUR_BARS[name]
    compared = 0
    for degree in range(1, 360, 2):
        phi = radians(degree)
        with mp.workdps(60):
            ax, ay = a * mp.cos(mpf(phi)), a * mp.sin(mpf(phi))
            k1 = (b * b - c * c - a * a + d * d) / (2 * (d - ax))
            k2 = ay / (d - ax)
            k3 = 2 * (d - k1) * k2 / (k2 * k2 + 1)
            k4 = ((d - k1) ** 2 - c * c) / (k2 * k2 + 1)
            square = k3 * k3 / 4 - k4
            pins = [(k1 + k2 * by, by) for by in (k3 / 2 + r * mp.sqrt(square) for r in (1, -1))]
        poses = [FourBar(a, b, c, d, side).close(phi) for side in (1, -1)]
        assert {pose.status for pose in poses} == {Status.OPEN if square < 0 else Status.CLOSED}
        if square < 0:
            continue
        left_first = (d - ax) * (pins[0][1] - ay) + ay * (pins[0][0] - ax) > 0
        for pose, side, (bx, by) in zip(
            poses, (1, -1), pins if left_first else pins[::-1], strict=True
        ):
            truth = four_bar(a, b, c, d, phi, side)
            assert abs(d + c * cos(pose.second) - float(bx)) < _pin_error(truth.rocker, c, d)
            assert abs(c * sin(pose.second) - float(by)) < _pin_error(truth.rocker, c, d)
            compared += 1
    assert compared > 50


def _pin_error(angle, link: float, ground: float) -> float:
    """Return what a pin may be off by: its angle's limit, and the rounding of its own sum."""
    condition = float(angle.condition) + pi
    return UNIT_ROUNDOFF * (ANGLE * condition * link + 4.0 * (link + ground))


@pytest.mark.sample(4)
@pytest.mark.parametrize('name', FOUR_BARS)
@pytest.mark.parametrize('side', [1, -1])
def test_four_bar_rates_equal_the_textbook_loop_equation(name, side):
    a, b, c, d = FOUR_BARS[name]
    dyad = FourBar(a, b, c, d, side)
    compared = 0
    for degree in range(0, 360, 3):
        phi, omega = radians(degree), -2.5
        pose = dyad.close(phi)
        if pose.status is not Status.CLOSED:
            continue
        truth = four_bar(a, b, c, d, phi, side)
        with mp.workdps(50):
            theta3, theta4 = truth.coupler.value, truth.rocker.value
            shared = -mpf(omega) * a / mp.sin(theta4 - theta3)
            omega3 = shared * mp.sin(theta4 - phi) / b
            omega4 = shared * mp.sin(theta3 - phi) / c
        found3, found4 = dyad.rates(pose, omega)
        assert truth.coupler_rate._replace(value=omega3 / omega).error_of(found3 / omega) < RATE
        assert truth.rocker_rate._replace(value=omega4 / omega).error_of(found4 / omega) < RATE
        compared += 1
    assert compared > 30


@pytest.mark.parametrize('side', [1, -1])
@pytest.mark.parametrize('offset', [0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize('direction', [1, -1])
def test_crank_pin_above_the_ground_pivot_closes_exactly(side, offset, direction):
    # d = Ax, by which the second text divides: near it, its roots are of the other assembly.
    lengths = (2.0, 3.0, 3.0, 1.0)
    for turn in (1, -1):
        phi = turn * (acos(0.5) + direction * offset)
        dyad = FourBar(*lengths, side)
        pose = dyad.close(phi)
        truth = four_bar(*lengths, phi, side)
        assert pose.status is Status.CLOSED
        assert truth.coupler.angle_error_of(pose.first) < ANGLE
        assert truth.rocker.angle_error_of(pose.second) < ANGLE
        coupler_rate, rocker_rate = dyad.rates(pose, 1.0)
        assert truth.coupler_rate.error_of(coupler_rate) < RATE
        assert truth.rocker_rate.error_of(rocker_rate) < RATE


@pytest.mark.parametrize(
    ('lengths', 'side', 'rocker'),
    [
        ((3.0, 5.0, 1.0, 3.0), 1, 0.0),
        ((3.0, 5.0, 1.0, 5.0), -1, pi),
    ],
)
@pytest.mark.parametrize('offset', [0.0, 1e-15, -1e-15, 1e-9, -1e-9, 1e-3, -1e-3])
def test_rocker_along_the_ground_has_exact_rates(lengths, side, rocker, offset):
    # A = (0, 3) and B = (4, 0): a triangle 3-4-5, and the third text divides by sin θ4.
    phi = pi / 2 + offset
    dyad = FourBar(*lengths, side)
    pose = dyad.close(phi)
    truth = four_bar(*lengths, phi, side)
    assert pose.status is Status.CLOSED
    assert truth.rocker.half_turn_error_of(pose.second) < ANGLE
    assert abs(turned(mpf(pose.second) - mpf(rocker))) < 10 * abs(offset) + 3e-15
    coupler_rate, rocker_rate = dyad.rates(pose, 1.0)
    assert truth.coupler_rate.error_of(coupler_rate) < RATE
    assert truth.rocker_rate.error_of(rocker_rate) < RATE


# Pins nearer than 1e-153 of the crank have no square of their distance.
@pytest.mark.parametrize('zero', [0.0, -0.0, 5e-324, 1e-310, 1e-300, -1e-160])
@pytest.mark.parametrize('side', [1, -1])
def test_crank_pin_on_the_swivel_is_indeterminate(zero, side):
    # And not the angle 0, which a formula might give out.
    assert InvertedSliderCrank(1.5, 1.5, 0.0, side).close(zero).status is Status.INDETERMINATE


@pytest.mark.parametrize('exponent', [-3, -6, -8, -9, -12, -15, -50, -150])
@pytest.mark.parametrize('direction', [1, -1])
@pytest.mark.parametrize('side', [1, -1])
def test_crank_pin_beside_the_swivel_closes_exactly(exponent, direction, side):
    # a = d: the rod turns at half the crank's rate, through the swivel and on.
    a, phi = 1.5, direction * 10.0**exponent
    dyad = InvertedSliderCrank(a, a, 0.0, side)
    pose = dyad.close(phi)
    assert pose.status is Status.CLOSED
    assert pose.slide == pytest.approx(side * 2 * a * sin(phi / 2), rel=1e-15, abs=0.0)
    assert float(turned(mpf(pose.rail) - (mpf(phi) - side * mp.pi) / 2)) == pytest.approx(
        0, abs=1e-15
    )
    rod_rate, slide_rate = dyad.rates(pose, 2.0)
    assert rod_rate == pytest.approx(1.0, rel=1e-15)
    assert slide_rate == pytest.approx(side * 2.0 * a * cos(phi / 2), rel=1e-15)


def test_vertical_rod_has_an_exact_rail_angle():
    # cos θ3 = 0: the swivel is square above the crank pin, between two neighbouring floats.
    a, d = 1.0, 0.5
    phi = acos(0.5)
    for angle in (nextafter(phi, 0.0), phi, nextafter(phi, 2.0)):
        pose = InvertedSliderCrank(a, d, 0.0, 1).close(angle)
        assert pose.rail == pytest.approx(-pi / 2, abs=1e-15)
