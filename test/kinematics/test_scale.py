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

"""Metres, micrometres or light years, slender or stout, turned once or often: all the same."""

from __future__ import annotations

import math
from math import pi

from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.status import Status
import pytest

from .linkages import four_bar_linkage, inverted_slider_crank_linkage
from .reference import four_bar, inverted_slider_crank
from .tolerance import ANGLE, LENGTH, RATE

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


@pytest.mark.parametrize('exponent', [-900, -300, -41, -1, 1, 2, 41, 300, 900])
@pytest.mark.parametrize('crank_angle', CRANK_ANGLES)
def test_scaling_by_a_power_of_two_changes_no_bit(exponent: int, crank_angle: float) -> None:
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
def test_lengths_of_any_size_are_solved_to_the_last_digit(
    factor: float, phi: float, side: int
) -> None:
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


@pytest.mark.parametrize('name', NEEDLES)
@pytest.mark.parametrize('side', [1, -1])
def test_lengths_that_differ_by_twelve_decades_are_solved_to_the_last_digit(
    name: str, side: int
) -> None:
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
def test_a_crank_that_has_turned_often_loses_only_what_its_angle_has_lost(
    turns: int, phi: float
) -> None:
    assert check_four_bar(FOUR_BAR, phi + turns * 2 * pi, 1, RATE)


def test_a_crank_angle_of_a_million_radians_is_where_it_belongs() -> None:
    # 1e6 rad are 159154 turns and 5.927… rad, digits that a sloppy reduction loses.
    closure = Closure(four_bar_linkage(FOUR_BAR, 'left'))
    turned = 1e6 - 159154 * 2 * pi
    far, near = closure.position(1e6), closure.position(turned)
    # 2π times 159154 is off by 159154·2.4e-16.
    assert math.cos(far.poses[0].second - near.poses[0].second) == pytest.approx(1.0, abs=1e-15)
    assert far.poses[0].second - near.poses[0].second == pytest.approx(
        2 * pi * round((far.poses[0].second - near.poses[0].second) / (2 * pi)), abs=1e-9
    )


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
