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

"""A four-bar is solved as well as its lengths and crank angle allow, in the right assembly."""

from __future__ import annotations

from math import cos, ldexp, pi, remainder, sin

from hypothesis import assume, given, settings
from hypothesis import strategies as st
from linkage_ros.kinematics.status import Status
import pytest

from .on_crank import FourBar
from .reference import four_bar, UNIT_ROUNDOFF
from .samples import FOUR_BARS, four_bars
from .tolerance import ANGLE, RATE, TOGGLE, Worst

COUNT = 2000

length = st.floats(0.1, 10.0)
crank = st.floats(-7.0, 7.0)
side = st.sampled_from((1, -1))


@pytest.mark.parametrize('family', FOUR_BARS)
def test_positions_rates_and_status_are_right_in_every_family(family: str) -> None:
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


def test_the_sweep_holds_open_loops_and_toggles_too() -> None:
    found = {
        FourBar(a, b, c, d, sign).close(phi).status
        for family in FOUR_BARS
        for a, b, c, d, phi, sign in four_bars(family, COUNT)
    }
    assert found == {Status.CLOSED, Status.TOGGLE, Status.OPEN}


@settings(derandomize=True, deadline=None, max_examples=300)
@given(length, length, length, length, crank, side)
def test_walking_the_loop_ends_where_it_began(
    a: float, b: float, c: float, d: float, phi: float, sign: int
) -> None:
    pose = FourBar(a, b, c, d, sign).close(phi)
    assume(pose.status is Status.CLOSED)
    x = a * cos(phi) + b * cos(pose.first) - c * cos(pose.second) - d
    y = a * sin(phi) + b * sin(pose.first) - c * sin(pose.second)
    # What four angles of up to 3π, each rounded a few times, can move the four links by.
    reached = 64.0 * UNIT_ROUNDOFF * (a + b + c + d)
    if abs(pose.cross) > 1e-3 * b * c:
        assert abs(x) < reached
        assert abs(y) < reached


@settings(derandomize=True, deadline=None, max_examples=300)
@given(length, length, length, length, crank, side)
def test_the_closing_pin_lies_on_the_side_that_the_assembly_says(
    a: float, b: float, c: float, d: float, phi: float, sign: int
) -> None:
    pose = FourBar(a, b, c, d, sign).close(phi)
    assume(pose.status is Status.CLOSED)
    # Change points turn over with the half angle, which their own tests hold.
    diagonal = FourBar(a, b, c, d, sign).diagonal
    assume(diagonal.fold_margin and diagonal.stretch_margin)
    x, y = d - a * cos(phi), -a * sin(phi)
    left = x * sin(pose.first) - y * cos(pose.first)
    assume(abs(left) > 1e-12 * (a + d))
    assert left * sign > 0.0


@settings(derandomize=True, deadline=None, max_examples=300)
@given(length, length, length, length, crank, side)
def test_a_mirrored_four_bar_moves_in_the_mirror(
    a: float, b: float, c: float, d: float, phi: float, sign: int
) -> None:
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


@settings(derandomize=True, deadline=None, max_examples=200)
@given(length, length, length, length, crank, side, st.integers(-40, 40))
def test_rates_are_proportional_to_the_crank_rate(
    a: float, b: float, c: float, d: float, phi: float, sign: int, power: int
) -> None:
    dyad = FourBar(a, b, c, d, sign)
    pose = dyad.close(phi)
    assume(pose.status is Status.CLOSED)
    # Of a crank rate that is a power of two to the last digit, since that rounds nothing.
    for rate, per_unit in zip(
        dyad.rates(pose, ldexp(1.0, power)), dyad.rates(pose, 1.0), strict=True
    ):
        assert rate == ldexp(per_unit, power)
