# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Published joints are child less parent and slides in metres, whatever the links' frames."""

from __future__ import annotations

from math import cos, pi, remainder, sin
import random

from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Input, Linkage, RevoluteJoint, SlideJoint, Slider
from linkage_ros.kinematics.status import Status
import pytest

from .linkages import four_bar_linkage, Frame, inverted_slider_crank_linkage
from .reference import four_bar, inverted_slider_crank, UNIT_ROUNDOFF

CRANK_ANGLES = [-3.0, -1.2, 0.1, 0.9, 2.2, 3.1]
FOUR_BAR = (0.04, 0.12, 0.08, 0.1)
SLIDER_CRANK = (0.15, 0.27, -0.02)


def odd_frames(seed: int, links: tuple[str, ...]) -> dict[str, Frame]:
    """Return frames that are nowhere near a link's pins, nor along it."""
    rng = random.Random(seed)
    return {
        link: (rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), rng.uniform(-pi, pi))
        for link in links
    }


@pytest.mark.parametrize('crank_angle', CRANK_ANGLES)
@pytest.mark.parametrize(('side', 'sign'), [('left', 1), ('right', -1)])
def test_a_four_bar_publishes_child_less_parent(crank_angle: float, side: str, sign: int) -> None:
    closure = Closure(four_bar_linkage(FOUR_BAR, side))
    position = closure.position(crank_angle)
    truth = four_bar(*FOUR_BAR, crank_angle, sign)
    coupler, rocker = position.joints
    assert remainder(
        coupler - (float(truth.coupler.value) - crank_angle), 2 * pi
    ) == pytest.approx(0.0, abs=4e-15)
    assert remainder(rocker - float(truth.rocker.value), 2 * pi) == pytest.approx(0.0, abs=4e-15)
    assert closure.velocity(position, 3.0).joints == pytest.approx(
        (3.0 * float(truth.coupler_rate.value) - 3.0, 3.0 * float(truth.rocker_rate.value)),
        rel=1e-14,
    )


@pytest.mark.parametrize('crank_angle', CRANK_ANGLES)
@pytest.mark.parametrize('side', ['left', 'right'])
@pytest.mark.parametrize('seed', range(5))
def test_turning_link_frames_shifts_a_four_bar_s_joints_by_the_turns(
    crank_angle: float, side: str, seed: int
) -> None:
    frames = odd_frames(seed, ('ground', 'crank', 'coupler', 'rocker'))
    turned = {link: angle for link, (_, _, angle) in frames.items()}
    plain, odd = (Closure(four_bar_linkage(FOUR_BAR, side, f)) for f in (None, frames))
    # A link drawn at +angle in its frame has its frame at -angle.
    one = plain.position(crank_angle)
    other = odd.position(crank_angle - turned['crank'] + turned['ground'])
    shifts = (turned['crank'] - turned['coupler'], turned['ground'] - turned['rocker'])
    assert other.status is one.status is Status.CLOSED
    for value, before, shift in zip(other.joints, one.joints, shifts, strict=True):
        assert remainder(value - before - shift, 2 * pi) == pytest.approx(0.0, abs=2e-14)
    expected = plain.velocity(one, 2.0).joints
    assert odd.velocity(other, 2.0).joints == pytest.approx(expected, rel=1e-12)
    assert odd.residual(other) < 4e-16


@pytest.mark.parametrize('crank_angle', CRANK_ANGLES)
@pytest.mark.parametrize(('side', 'sign'), [('ahead', 1), ('behind', -1)])
@pytest.mark.parametrize('along', [0.0, 0.11, -0.2])
def test_a_slide_is_measured_from_the_point_it_runs_through(
    crank_angle: float, side: str, sign: int, along: float
) -> None:
    closure = Closure(inverted_slider_crank_linkage(SLIDER_CRANK, side, along=along))
    truth = inverted_slider_crank(*SLIDER_CRANK, crank_angle, sign)
    position = closure.position(crank_angle)
    rod, slide = position.joints
    assert remainder(rod - (float(truth.rod.value) - crank_angle), 2 * pi) == pytest.approx(
        0.0, abs=4e-15
    )
    assert slide == pytest.approx(float(truth.slide.value) - along, abs=4e-16)
    assert closure.velocity(position, 3.0).joints == pytest.approx(
        (3.0 * float(truth.rod_rate.value) - 3.0, 3.0 * float(truth.slide_rate.value)), rel=1e-14
    )
    assert closure.turning == (True, False)


@pytest.mark.parametrize('crank_angle', CRANK_ANGLES)
@pytest.mark.parametrize('side', ['ahead', 'behind'])
@pytest.mark.parametrize('seed', range(5))
def test_turning_link_frames_shifts_the_rod_s_joint_and_leaves_the_slide(
    crank_angle: float, side: str, seed: int
) -> None:
    frames = odd_frames(seed, ('ground', 'crank', 'rod'))
    turned = {link: angle for link, (_, _, angle) in frames.items()}
    plain, odd = (
        Closure(inverted_slider_crank_linkage(SLIDER_CRANK, side, f, along=0.07))
        for f in (None, frames)
    )
    one = plain.position(crank_angle)
    other = odd.position(crank_angle - turned['crank'] + turned['ground'])
    shift = turned['crank'] - turned['rod']
    assert remainder(other.joints[0] - one.joints[0] - shift, 2 * pi) == pytest.approx(
        0, abs=2e-14
    )
    assert other.joints[1] == pytest.approx(one.joints[1], abs=2e-15)
    expected = plain.velocity(one, 2.0).joints
    assert odd.velocity(other, 2.0).joints == pytest.approx(expected, rel=1e-12, abs=1e-13)
    assert odd.residual(other) < 4e-16


def test_the_links_of_a_file_meet_where_the_joints_put_them() -> None:
    # Frames that no formula of the package prefers, walked by hand from joint to joint.
    ground = {'O': (0.3, -0.1), 'D': (0.2, 0.35)}
    crank = {'O': (0.01, 0.02), 'A': (-0.05, 0.11)}
    coupler = {'A': (0.5, 0.5), 'B': (0.2, 0.8)}
    rocker = {'B': (-0.1, 0.0), 'D': (0.25, 0.1)}
    linkage = Linkage(
        links={'rocker': rocker, 'coupler': coupler, 'crank': crank, 'ground': ground},
        inputs=(Input('crank_joint', 'ground', 'crank'),),
        assembly={'B': 'right'},
        joints={
            'elbow': RevoluteJoint('coupler', 'rocker'),
            'wrist': RevoluteJoint('crank', 'coupler'),
        },
        sliders={},
    )
    closure = Closure(linkage)
    for crank_angle in (0.4, 2.0, -2.5):
        position = closure.position(crank_angle)
        elbow, wrist = position.joints
        pin = ground['O']
        angle = 0.0
        for points, start, end, turn in (
            (crank, 'O', 'A', crank_angle),
            (coupler, 'A', 'B', wrist),
            (rocker, 'B', 'D', elbow),
        ):
            angle += turn
            x, y = (points[end][i] - points[start][i] for i in (0, 1))
            pin = (
                pin[0] + x * cos(angle) - y * sin(angle),
                pin[1] + x * sin(angle) + y * cos(angle),
            )
        assert pin == pytest.approx(ground['D'], abs=1e-15)


@pytest.mark.parametrize('build', [four_bar_linkage, inverted_slider_crank_linkage])
def test_the_residual_is_rounding(build) -> None:
    lengths, side = (FOUR_BAR, 'left') if build is four_bar_linkage else (SLIDER_CRANK, 'behind')
    closure = Closure(build(lengths, side))
    size = sum(map(abs, lengths))
    for i in range(2000):
        position = closure.position(-7.0 + 0.007 * i)
        assert position.status is Status.CLOSED
        assert closure.residual(position) < 16 * UNIT_ROUNDOFF * size


def test_the_residual_sees_a_loop_that_is_open_by_a_hair() -> None:
    closure = Closure(four_bar_linkage(FOUR_BAR, 'left'))
    position = closure.position(1.0)
    position.state.coordinates[3] += 1e-9
    assert closure.residual(position) == pytest.approx(FOUR_BAR[2] * 1e-9, rel=1e-5)


def test_an_open_loop_has_a_gap_in_metres_and_no_joints() -> None:
    closure = Closure(four_bar_linkage((0.04, 0.02, 0.03, 0.05), 'left'))
    position = closure.position(pi)
    assert (position.status, position.joints) == (Status.OPEN, ())
    assert position.gap == pytest.approx(0.04, rel=1e-15)


@pytest.mark.parametrize(
    ('lengths', 'side', 'build'),
    [
        ((0.04, 0.02, 0.03, 0.10), 'left', four_bar_linkage),
        ((0.04, 0.12, 0.03, 0.04), 'right', four_bar_linkage),
        ((0.04, 0.05, 0.10), 'ahead', inverted_slider_crank_linkage),
    ],
)
def test_a_linkage_that_closes_nowhere_has_no_range(lengths, side, build) -> None:
    closure = Closure(build(lengths, side))
    assert closure.input_ranges == ()
    assert closure.position(1.0).status is Status.OPEN


def test_a_slide_line_may_be_given_in_any_length_and_from_any_of_its_points() -> None:
    plain = inverted_slider_crank_linkage(SLIDER_CRANK, 'ahead', along=0.05)
    slider = plain.sliders['swivel']
    for factor in (1e-8, 1.0, 1e8):
        direction = (factor * slider.direction[0], factor * slider.direction[1])
        linkage = Linkage(
            plain.links,
            plain.inputs,
            plain.assembly,
            {'slide': SlideJoint('swivel')},
            {'swivel': Slider('C', 'rod', 'T', direction)},
        )
        expected = Closure(plain).position(1.0).joints[1]
        assert Closure(linkage).position(1.0).joints == pytest.approx((expected,), rel=1e-15)
