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

"""An inverted slider-crank is solved as well as its lengths and crank angle allow."""

from __future__ import annotations

from math import cos, sin

from hypothesis import assume, given, settings
from hypothesis import strategies as st
from linkage_ros.kinematics.status import Status
import pytest

from .on_crank import InvertedSliderCrank
from .reference import inverted_slider_crank, UNIT_ROUNDOFF
from .samples import inverted_slider_cranks, SLIDER_CRANKS
from .tolerance import ANGLE, LENGTH, RATE, Worst

COUNT = 2000

length = st.floats(0.1, 10.0)
offset = st.one_of(st.just(0.0), st.floats(-8.0, 8.0).filter(lambda h: h == 0.0 or abs(h) > 0.01))
crank = st.floats(-7.0, 7.0)
side = st.sampled_from((1, -1))


@pytest.mark.parametrize('family', SLIDER_CRANKS)
def test_positions_rates_and_status_are_right_in_every_family(family: str) -> None:
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


def test_the_sweep_holds_open_loops_too() -> None:
    found = {
        InvertedSliderCrank(a, d, h, sign).close(phi).status
        for family in SLIDER_CRANKS
        for a, d, h, phi, sign in inverted_slider_cranks(family, COUNT)
    }
    assert {Status.CLOSED, Status.OPEN} <= found


@settings(derandomize=True, deadline=None, max_examples=300)
@given(length, length, offset, crank, side)
def test_walking_the_loop_ends_where_it_began(
    a: float, d: float, h: float, phi: float, sign: int
) -> None:
    pose = InvertedSliderCrank(a, d, h, sign).close(phi)
    assume(pose.status is Status.CLOSED)
    x = a * cos(phi) + pose.slide * cos(pose.rail) - h * sin(pose.rail) - d
    y = a * sin(phi) + pose.slide * sin(pose.rail) + h * cos(pose.rail)
    # What three angles of up to 2π, each rounded a few times, can move the links by.
    reached = 32.0 * UNIT_ROUNDOFF * (a + d + abs(h) + abs(pose.slide))
    assert abs(x) < reached
    assert abs(y) < reached


@settings(derandomize=True, deadline=None, max_examples=300)
@given(length, length, offset, crank, side)
def test_a_mirrored_linkage_moves_in_the_mirror(
    a: float, d: float, h: float, phi: float, sign: int
) -> None:
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


@settings(derandomize=True, deadline=None, max_examples=200)
@given(length, length, crank)
def test_a_straight_rod_behind_is_the_one_ahead_turned_round(
    a: float, d: float, phi: float
) -> None:
    assume(a != d)
    ahead, behind = InvertedSliderCrank(a, d, 0.0, 1), InvertedSliderCrank(a, d, 0.0, -1)
    one, other = ahead.close(phi), behind.close(phi)
    assert other.slide == -one.slide
    assert cos(other.rail - one.rail) == pytest.approx(-1.0)
    rate, slide_rate = ahead.rates(one, 1.0)
    assert behind.rates(other, 1.0) == (rate, -slide_rate)


@pytest.mark.parametrize(('a', 'd', 'h'), [(1.0, 2.0, 1.0), (2.0, 1.0, -1.0), (0.75, 2.0, 1.25)])
def test_a_bent_rod_that_just_reaches_its_swivel_is_at_a_change_point(
    a: float, d: float, h: float
) -> None:
    # At φ = 0 the pin is |d − a| = |h| from the swivel: the rod stands across the ground.
    pose = InvertedSliderCrank(a, d, h, 1).close(0.0)
    assert (pose.status, pose.gap, pose.slide) == (Status.CHANGE_POINT, 0.0, 0.0)
    across = a * 1.0 - h * sin(pose.rail) - d
    assert across == pytest.approx(0.0, abs=1e-15)
