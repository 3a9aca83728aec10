# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Dyads on a crank: as exact as lengths and angle allow, at every scale."""

from fractions import Fraction
import math
from math import cos, hypot, inf, ldexp, nextafter, pi, remainder, sin, tau

from hypothesis import assume, given, settings, strategies as st
from linkage_ros.description import parse_yaml, read_linkage, scene_text_for
from linkage_ros.errors import FileError
from linkage_ros.kinematics import Closure, crank_diagonal, InputSweep, Status
import pytest

from ..linkages import (
    four_bar_linkage,
    FourBar,
    inverted_slider_crank_linkage,
    InvertedSliderCrank,
)
from ..reference import (
    ANGLE,
    four_bar,
    inverted_slider_crank,
    LENGTH,
    RATE,
    TOGGLE,
    Worst,
)
from ..samples import FOUR_BARS, four_bars, inverted_slider_cranks, SLIDER_CRANKS
from ...support.scenes import closure_of

# A four-bar is solved as well as its lengths and crank angle allow, in the right assembly.


COUNT = 1000
length = st.floats(0.1, 10.0)
crank = st.floats(-7.0, 7.0)
side = st.sampled_from((1, -1))


@pytest.mark.sample(1)
@pytest.mark.parametrize('family', FOUR_BARS)
def test_four_bar_dyad_equals_the_reference(family):
    worst = Worst()
    seen: dict[Status, int] = dict.fromkeys(Status, 0)
    for case in four_bars(family, COUNT):
        *lengths, phi, sign = case
        truth = four_bar(*case)
        dyad = FourBar(*lengths, sign)
        pose = dyad.close(phi)
        seen[pose.status] += 1
        worst.note_status(pose.status, pose.gap, float(truth.gap), sum(lengths), case)
        assert (pose.status is Status.TOGGLE) == (pose.cross == 0.0 and not pose.gap), case
        if truth.gap > 0 or pose.status is Status.OPEN:
            continue
        limit = ANGLE if pose.status is Status.CLOSED else TOGGLE
        worst.note('coupler', truth.coupler.half_turn_error_of(pose.first), limit, case)
        worst.note('rocker', truth.rocker.half_turn_error_of(pose.second), limit, case)
        if pose.status is Status.CLOSED:
            assert pose.cross * sign > 0.0, case
            coupler_rate, rocker_rate = dyad.rates(pose, 1.0)
            worst.note('ω3', truth.coupler_rate.error_of(coupler_rate), RATE, case)
            worst.note('ω4', truth.rocker_rate.error_of(rocker_rate), RATE, case)
    worst.check()
    assert seen[Status.CLOSED] >= COUNT / 10, 'a sweep that closes nothing proves nothing'
    assert seen[Status.INDETERMINATE] == 0


@settings(derandomize=True)
@given(length, length, length, length, crank, side)
def test_mirrored_four_bar_has_mirrored_motion(a, b, c, d, phi, sign):
    dyad, mirrored = FourBar(a, b, c, d, sign), FourBar(a, b, c, d, -sign)
    pose, image = dyad.close(phi), mirrored.close(-phi)
    assert (pose.status, pose.gap) == (image.status, image.gap)
    if pose.status is Status.CLOSED:
        # In a change-point linkage the half angle turns the assembly over with the mirror.
        assume(pose.cross == -image.cross)
        # At −0 the crank is at 0, and a direction of π has no mirror image but −π.
        for angle, mirrored_angle in ((pose.first, image.first), (pose.second, image.second)):
            assert angle == -mirrored_angle or (
                phi == 0.0 and abs(remainder(angle + mirrored_angle, 2.0 * pi)) < 1e-15
            )
        assert dyad.rates(pose, 1.0) == mirrored.rates(image, 1.0)


@settings(derandomize=True)
@given(length, length, length, length, crank, side, st.integers(-40, 40))
def test_four_bar_rates_are_proportional_to_the_crank_rate(a, b, c, d, phi, sign, power):
    dyad = FourBar(a, b, c, d, sign)
    pose = dyad.close(phi)
    assume(pose.status is Status.CLOSED)
    # Of a crank rate that is a power of two to the last digit, since that rounds nothing.
    for rate, per_unit in zip(
        dyad.rates(pose, ldexp(1.0, power)), dyad.rates(pose, 1.0), strict=True
    ):
        assert rate == ldexp(per_unit, power)


# An inverted slider-crank is solved as well as its lengths and crank angle allow.


offset = st.one_of(st.just(0.0), st.floats(-8.0, 8.0).filter(lambda h: h == 0.0 or abs(h) > 0.01))


@pytest.mark.sample(1)
@pytest.mark.parametrize('family', SLIDER_CRANKS)
def test_slider_crank_dyad_equals_the_reference(family):
    worst = Worst()
    closed = 0
    for case in inverted_slider_cranks(family, COUNT):
        a, d, h, phi, sign = case
        truth = inverted_slider_crank(*case)
        dyad = InvertedSliderCrank(a, d, h, sign)
        pose = dyad.close(phi)
        worst.note_status(pose.status, pose.gap, float(truth.gap), a + d + abs(h), case)
        if pose.status is not Status.CLOSED:
            continue
        closed += 1
        assert pose.slide * sign > 0.0, case
        worst.note('rod', truth.rod.half_turn_error_of(pose.rail), ANGLE, case)
        worst.note('slide', truth.slide.error_of(pose.slide), LENGTH, case)
        rod_rate, slide_rate = dyad.rates(pose, 1.0)
        worst.note('ω3', truth.rod_rate.error_of(rod_rate), RATE, case)
        worst.note('slide rate', truth.slide_rate.error_of(slide_rate), RATE, case)
    worst.check()
    assert closed >= COUNT / 2, 'a sweep that closes nothing proves nothing'


@settings(derandomize=True)
@given(length, length, offset, crank, side)
def test_mirrored_slider_crank_has_mirrored_motion(a, d, h, phi, sign):
    assume(abs(a - d) != abs(h))
    dyad, mirrored = InvertedSliderCrank(a, d, h, sign), InvertedSliderCrank(a, d, -h, sign)
    pose, image = dyad.close(phi), mirrored.close(-phi)
    assert (pose.status, pose.gap, pose.slide) == (image.status, image.gap, image.slide)
    if pose.status is Status.CLOSED:
        rod_rate, slide_rate = dyad.rates(pose, 1.0)
        assert mirrored.rates(image, 1.0) == (rod_rate, -slide_rate)
        # A rod along the ground points at π from either side of the mirror.
        assume(sin(pose.rail) != 0.0 and phi != 0.0)
        assert cos(pose.rail) == pytest.approx(cos(image.rail), rel=1e-14, abs=1e-15)
        assert sin(pose.rail) == pytest.approx(-sin(image.rail), rel=1e-14, abs=1e-15)


@settings(derandomize=True)
@given(length, length, crank)
def test_straight_rod_assemblies_differ_by_half_a_turn(a, d, phi):
    assume(a != d)
    ahead, behind = InvertedSliderCrank(a, d, 0.0, 1), InvertedSliderCrank(a, d, 0.0, -1)
    one, other = ahead.close(phi), behind.close(phi)
    assert other.slide == -one.slide
    assert cos(other.rail - one.rail) == pytest.approx(-1.0)
    rate, slide_rate = ahead.rates(one, 1.0)
    assert behind.rates(other, 1.0) == (rate, -slide_rate)


@pytest.mark.parametrize(('a', 'd', 'h'), [(1.0, 2.0, 1.0), (2.0, 1.0, -1.0), (0.75, 2.0, 1.25)])
def test_bent_rod_that_just_reaches_is_at_change_point(a, d, h):
    # At φ = 0 the pin is |d − a| = |h| from the swivel: the rod stands across the ground.
    pose = InvertedSliderCrank(a, d, h, 1).close(0.0)
    assert (pose.status, pose.gap, pose.slide) == (Status.CHANGE_POINT, 0.0, 0.0)
    across = a * 1.0 - h * sin(pose.rail) - d
    assert across == pytest.approx(0.0, abs=1e-15)


# Cylinders: of two ranges that are mirror images, the one of positive length is reported.
#
# Each family has a rod in a tube, each on a pin of its own, with varied positions of the pins on
# the line; and similar linkages whose negative slides are poses of their own.


TEXT = """
links:
  ground: {{I: [0, 0], K: {K}{more}}}
  tube: {{K: [0, 0], through: {through}}}
  rod: {{C: [0, 0], eye: {eye}}}
  rocker: {{I: [0, 0], C: [{c}, 0]}}
sliders: {{bore: {{point: eye, {block}along: tube, through: through, direction: {direction}}}}}
input: {{joint: cylinder, slider: bore{limits}}}
assembly: {{C: left}}
joints:
  tube_joint: {{parent: ground, child: tube}}
  rocker_joint: {{parent: ground, child: rocker}}
{pose}
"""


def cylinder(
    foot=(1.0, 0.3), c=0.4, start=0.0, end=0.1, facing=0.0, beside=0.0, angle=0.0, **said
):
    """
    Return a rocker on a cylinder.

    The line of the tube goes past its pin K at a distance ``beside``, in a direction ``facing``,
    and is measured from ``start`` along it. The rod's pin C lies ``end`` behind the point on the
    line; the rod is turned by ``angle``.
    """
    u = complex(cos(facing), sin(facing))
    through = u * complex(start, beside)
    eye = u * end * complex(cos(angle), -sin(angle))
    return Closure(
        read_linkage(
            parse_yaml(
                TEXT.format(
                    K=[*foot],
                    c=c,
                    through=[through.real, through.imag],
                    eye=[eye.real, eye.imag],
                    direction=[u.real, u.imag],
                    block=f'block: rod, angle: {angle!r}, ',
                    limits=said.get('limits', ''),
                    pose=said.get('pose', ''),
                    more=said.get('more', ''),
                ).encode(),
                'c.yaml',
            )
        )
    )


PLACES = st.floats(-0.5, 0.5).map(lambda x: round(x, 3))


@given(
    foot=st.tuples(st.floats(0.6, 2.0), st.floats(-1.0, 1.0)),
    c=st.floats(0.1, 0.5),
    start=PLACES,
    end=PLACES,
    facing=st.floats(-pi, pi),
    angle=st.sampled_from([0.0, 0.5 * pi, 1.0]),
)
def test_cylinder_range_keeps_a_positive_length(foot, c, start, end, facing, angle):
    assume(hypot(*foot) > c + 0.05 and end)
    try:
        closure = cylinder(foot, c, start, end, facing, angle=angle)
    except FileError:
        assume(False)
    (one,) = closure.input_ranges
    (usual,) = InputSweep(closure).ranges
    assert usual == one
    # The pins' distance goes from |foot| − c to |foot| + c; the slide is it less start and end.
    shift = end - start
    assert one.lowest - shift == pytest.approx(hypot(*foot) - c, abs=1e-6)
    assert one.highest - shift == pytest.approx(hypot(*foot) + c, abs=1e-6)
    # What is left out is the same pose of all but tube and rod, with these turned about.
    value = 0.7 * one.lowest + 0.3 * one.highest
    here, there = closure.position(value), closure.position(2.0 * shift - value)
    assert there.status.has_pose
    tube, rocker = (p - q for p, q in zip(here.joints, there.joints, strict=True))
    assert abs(remainder(rocker, tau)) < 1e-9
    assert abs(remainder(tube - pi, tau)) < 1e-9


@pytest.mark.parametrize('beside', [0.05, -0.1])
def test_offset_cylinder_has_separate_positive_and_negative_ranges(beside):
    low, high = cylinder(beside=beside).input_ranges
    assert low.highest < 0.0 < high.lowest


def test_cylinder_drawn_behind_its_pin_has_negative_range():
    said = cylinder(pose='pose: {inputs: [-1.0]}')
    (one,) = said.input_ranges
    assert one.highest < 0.0
    assert 'mean: -' in scene_text_for(said, 'c.yaml')


def test_cylinder_limits_choose_the_sign_of_its_range():
    (one,) = cylinder(limits=', limits: [-1.2, -0.8]').input_ranges
    assert one[:2] == (-1.2, -0.8)
    (one,) = cylinder(limits=', limits: [-1.2, 0.9]').input_ranges
    assert 0.0 < one.lowest < one.highest == 0.9


SLOT = """
links:
  ground: {O: [0, 0]}
  crank: {O: [0, 0], A: [0.1, 0]}
  rod: {A: [0, 0], B: [0.3, 0]}
sliders: {guide: {point: B, along: ground, through: O, direction: [1, 0]}}
input: {joint: drive, slider: guide}
assembly: {A: left}
joints: {crank_joint: {parent: ground, child: crank}}
"""


def test_slide_on_the_ground_keeps_both_ranges():
    """A slider-crank that is driven by its slider goes to either side of its crank's pivot."""
    closure = closure_of(SLOT)
    low, high = closure.input_ranges
    assert low.highest < 0.0 < high.lowest


# The scale does not matter: metres, micrometres or light years, slender or stout, any turn.


FOUR_BAR = (0.04, 0.12, 0.08, 0.1)
SLIDER_CRANK = (0.15, 0.27, 0.02)
CRANK_ANGLES = [-3.0, -0.4, 1e-7, 0.9, 2.2, 3.14159]

# Each makes another sum of lengths cancel; all but the last two are drawn by what they move.
NEEDLES = {
    'tiny crank': (1e-12, 1.0, 0.9, 1.1),
    'tiny coupler': (1.0, 1e-12, 1.7, 0.7 + 1e-13),
    'tiny ground': (1.0, 0.7, 0.9, 1e-12),
    'tiny crank and ground': (1e-12, 1.0, 1.0 + 1e-13, 1.5e-12),
    'long coupler and rocker': (1.0, 1e12, 1e12 + 0.25, 0.5),
    'long crank and ground': (1e12, 1.0, 1.25, 1e12 + 0.5),
}


@pytest.mark.parametrize('exponent', [-500, -300, -41, -1, 1, 2, 41, 300, 900])
@pytest.mark.parametrize('crank_angle', CRANK_ANGLES)
def test_power_of_two_scaling_keeps_all_bits(exponent, crank_angle):
    factor = 2.0**exponent
    for build, lengths, side in (
        (four_bar_linkage, FOUR_BAR, 'left'),
        (inverted_slider_crank_linkage, SLIDER_CRANK, 'ahead'),
    ):
        closure = Closure(build(lengths, side))
        scaled = Closure(build(tuple(factor * x for x in lengths), side))
        units = [1.0 if turns else factor for turns in closure.turning]
        one, other = closure.position(crank_angle), scaled.position(crank_angle)
        assert other.status is one.status is Status.CLOSED
        assert other.joints == tuple(x * u for x, u in zip(one.joints, units, strict=True))
        assert scaled.velocity(other, 0.7).joints == tuple(
            x * u for x, u in zip(closure.velocity(one, 0.7).joints, units, strict=True)
        )


@pytest.mark.parametrize('factor', [1e-150, 1e-9, 1e9, 1e150])
@pytest.mark.parametrize('phi', CRANK_ANGLES)
@pytest.mark.parametrize('side', [1, -1])
def test_dyads_stay_exact_for_lengths_of_any_size(factor, phi, side):
    lengths = tuple(factor * x for x in FOUR_BAR)
    check_four_bar(lengths, phi, side, RATE)
    a, d, h = (factor * x for x in SLIDER_CRANK)
    closure = Closure(inverted_slider_crank_linkage((a, d, h), 'ahead' if side > 0 else 'behind'))
    truth = inverted_slider_crank(a, d, h, phi, side)
    position = closure.position(phi)
    assert truth.rod.half_turn_error_of(position.poses[0].rail) < ANGLE
    assert truth.slide.error_of(position.joints[1]) < LENGTH
    rod_rate, slide_rate = closure.velocity(position, 1.0).joints
    # The published rate is that of the rod less the crank's.
    assert truth.rod_rate.error_of(rod_rate + 1.0) < RATE
    assert truth.slide_rate.error_of(slide_rate) < RATE


@pytest.mark.sample(4)
@pytest.mark.parametrize('name', NEEDLES)
@pytest.mark.parametrize('side', [1, -1])
def test_four_bar_stays_exact_with_widely_different_lengths(name, side):
    a, b, c, d = NEEDLES[name]
    closed = 0
    for i in range(-40, 41):
        # Where crank and ground are long, the loop closes only about φ = 0.
        phi = i * (pi / 40) * (1e-12 if a == 1e12 else 1.0) + 1e-14
        closed += check_four_bar((a, b, c, d), phi, side, RATE)
    # The tiny coupler lets the rocker in only where the crank holds it.
    assert closed >= 20 or name == 'tiny coupler'


@pytest.mark.parametrize('turns', [1, 10, 159_155, -159_155, 10**9])
@pytest.mark.parametrize('phi', [0.3, 1.0, 2.5])
def test_four_bar_stays_exact_after_many_crank_turns(turns, phi):
    assert check_four_bar(FOUR_BAR, phi + turns * 2 * pi, 1, RATE)


def test_crank_angle_of_a_million_radians_is_reduced_exactly():
    # 1e6 rad are 159154 turns and 5.927… rad, digits that a sloppy reduction loses.
    closure = Closure(four_bar_linkage(FOUR_BAR, 'left'))
    turned = 1e6 - 159154 * 2 * pi
    far, near = closure.position(1e6), closure.position(turned)
    # 2π times 159154 is off by 159154·2.4e-16.
    assert math.cos(far.poses[0].second - near.poses[0].second) == pytest.approx(1.0, abs=1e-15)
    assert far.poses[0].second - near.poses[0].second == pytest.approx(
        2 * pi * round((far.poses[0].second - near.poses[0].second) / (2 * pi)), abs=1e-9
    )


@given(a=length, d=length, decades=st.integers(-9, 9))
def test_diagonal_root_is_correctly_rounded(a, d, decades):
    """2·√(ad) lies within half a unit in the last place of what it is rounded to, as fractions."""
    a *= 10.0**decades
    root = crank_diagonal(a, a + d, a + d, d).root
    below, above = ((Fraction(root) + Fraction(nextafter(root, to))) / 2 for to in (0.0, inf))
    assert below**2 <= 4 * Fraction(a) * Fraction(d) <= above**2


def check_four_bar(lengths: tuple[float, ...], phi: float, side: int, rate_limit: float) -> bool:
    """Compare a four-bar with the reference, through `Closure`; return whether it closes there."""
    a, b, c, d = lengths
    closure = Closure(four_bar_linkage((a, b, c, d), 'left' if side > 0 else 'right'))
    position, truth = closure.position(phi), four_bar(*lengths, phi, side, digits=90)
    if truth.gap > 0:
        assert position.status in (Status.OPEN, Status.TOGGLE)
        assert position.gap == pytest.approx(float(truth.gap), abs=4 * 2.0**-53 * sum(lengths))
        return False
    assert position.status is Status.CLOSED
    assert truth.coupler.half_turn_error_of(position.poses[0].first) < ANGLE
    assert truth.rocker.half_turn_error_of(position.poses[0].second) < ANGLE
    coupler_rate, rocker_rate = closure.velocity(position, 1.0).state.coordinates[2:]
    assert truth.coupler_rate.error_of(coupler_rate) < rate_limit
    assert truth.rocker_rate.error_of(rocker_rate) < rate_limit
    return True
