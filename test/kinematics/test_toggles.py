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

"""Near a limit position: closed to the last digit inside, a toggle on it, an open gap outside."""

from __future__ import annotations

from math import pi, remainder

from linkage_ros.kinematics.status import Status
from mpmath import mp, mpf
import pytest

from .on_crank import FourBar, InvertedSliderCrank
from .reference import four_bar, inverted_slider_crank, UNIT_ROUNDOFF
from .tolerance import ANGLE, LENGTH, RATE, TOGGLE

DISTANCES = [10.0**-exponent for exponent in range(3, 16)]

# Lengths a, b, c, d and whether it is by stretching or folding that the dyad limits the crank.
LIMITS = {
    'stretched': ((4.0, 5.0, 3.0, 6.5), 'stretch'),
    'folded, long coupler': ((4.0, 5.0, 3.0, 2.5), 'fold'),
    'folded, long rocker': ((4.0, 2.0, 4.5, 5.0), 'fold'),
    'stretched, short pair': ((40.0, 3.0, 2.5, 41.0), 'stretch'),
    'folded, short pair': ((40.0, 3.0, 1.5, 41.0), 'fold'),
    'stretched needle': ((1e6, 1e6, 1.0, 10.0), 'stretch'),
}


def limit_angle(name: str) -> mpf:
    """Return the crank's limit angle between 0 and π."""
    (a, b, c, d), kind = LIMITS[name]
    span = mpf(b) + c if kind == 'stretch' else abs(mpf(b) - c)
    return mp.acos((mpf(a) ** 2 + mpf(d) ** 2 - span**2) / (2 * mpf(a) * d))


def inward(name: str) -> int:
    """Return the sign in which the crank turns away from the limit angle into its range."""
    return -1 if LIMITS[name][1] == 'stretch' else 1


@pytest.mark.parametrize('name', LIMITS)
@pytest.mark.parametrize('distance', DISTANCES)
@pytest.mark.parametrize('side', [1, -1])
def test_inside_the_limit_the_loop_closes_to_the_last_digit(
    name: str, distance: float, side: int
) -> None:
    lengths, _ = LIMITS[name]
    with mp.workdps(60):
        phi = float(limit_angle(name) + inward(name) * distance)
    dyad = FourBar(*lengths, side)
    pose, truth = dyad.close(phi), four_bar(*lengths, phi, side)
    assert pose.status in (Status.CLOSED, Status.TOGGLE)
    assert (pose.status is Status.TOGGLE) == (pose.cross == 0.0)
    limit = ANGLE if pose.status is Status.CLOSED else TOGGLE
    if truth.gap <= 0:
        assert truth.coupler.half_turn_error_of(pose.first) < limit
        assert truth.rocker.half_turn_error_of(pose.second) < limit
    if distance > 1e-13:
        assert pose.status is Status.CLOSED
    if pose.status is Status.CLOSED:
        coupler_rate, rocker_rate = dyad.rates(pose, 1.0)
        assert truth.coupler_rate.error_of(coupler_rate) < RATE
        assert truth.rocker_rate.error_of(rocker_rate) < RATE


@pytest.mark.parametrize('name', LIMITS)
@pytest.mark.parametrize('distance', DISTANCES)
@pytest.mark.parametrize('turn', [1, -1])
def test_outside_the_limit_the_loop_is_open_by_the_gap(
    name: str, distance: float, turn: int
) -> None:
    lengths, _ = LIMITS[name]
    with mp.workdps(60):
        phi = turn * float(limit_angle(name) - inward(name) * distance)
    pose, truth = FourBar(*lengths, 1).close(phi), four_bar(*lengths, phi, 1)
    rounding = UNIT_ROUNDOFF * sum(lengths)
    if truth.gap > 32 * rounding:
        assert pose.status is Status.OPEN
    assert pose.status in (Status.OPEN, Status.TOGGLE)
    assert abs(pose.gap - float(truth.gap)) < LENGTH * rounding


@pytest.mark.parametrize('name', LIMITS)
@pytest.mark.parametrize('turn', [1, -1])
@pytest.mark.parametrize('side', [1, -1])
def test_at_the_limit_the_position_is_that_of_links_in_line(
    name: str, turn: int, side: int
) -> None:
    lengths, kind = LIMITS[name]
    a, b, c, d = lengths
    with mp.workdps(60):
        exact = limit_angle(name)
        line = turn * mp.arg(d - a * mp.expj(exact))
        coupler = line + (mp.pi if kind == 'fold' and b < c else 0)
        rocker = line + (0 if kind == 'fold' and b > c else mp.pi)
    pose = FourBar(*lengths, side).close(turn * float(exact))
    assert (pose.status, pose.gap, pose.cross) == (Status.TOGGLE, 0.0, 0.0)
    # The rounded crank angle turns the diagonal by as much again as the angles' own rounding.
    sensitivity = max(1.0, a * d / (b - c) ** 2)
    assert abs(remainder(pose.first - float(coupler), 2 * pi)) < 2e-15 * sensitivity
    assert abs(remainder(pose.second - float(rocker), 2 * pi)) < 2e-15 * sensitivity


@pytest.mark.parametrize('distance', DISTANCES)
@pytest.mark.parametrize(('a', 'd', 'h'), [(1.5, 2.0, 1.0), (2.0, 1.5, -1.0), (1.0, 1.0, 1e-3)])
@pytest.mark.parametrize('side', [1, -1])
def test_a_bent_rod_reaches_its_swivel_inside_the_limit_and_misses_it_outside(
    distance: float, a: float, d: float, h: float, side: int
) -> None:
    with mp.workdps(60):
        limit = mp.acos((mpf(a) ** 2 + mpf(d) ** 2 - mpf(h) ** 2) / (2 * mpf(a) * d))
        inside, outside = float(limit + distance), float(limit - distance)
    size = UNIT_ROUNDOFF * (a + d + abs(h))

    truth = inverted_slider_crank(a, d, h, inside, side)
    dyad = InvertedSliderCrank(a, d, h, side)
    pose = dyad.close(inside)
    assert pose.status in (Status.CLOSED, Status.TOGGLE)
    assert (pose.status is Status.TOGGLE) == (pose.slide == 0.0)
    error = ANGLE if pose.status is Status.CLOSED else TOGGLE
    assert truth.rod.half_turn_error_of(pose.rail) < error
    assert truth.slide.error_of(pose.slide) < error
    if pose.status is Status.CLOSED:
        rod_rate, slide_rate = dyad.rates(pose, 1.0)
        assert truth.rod_rate.error_of(rod_rate) < RATE
        assert truth.slide_rate.error_of(slide_rate) < RATE

    missed = InvertedSliderCrank(a, d, h, side).close(outside)
    gap = float(inverted_slider_crank(a, d, h, outside, side).gap)
    assert missed.status in (Status.OPEN, Status.TOGGLE)
    if gap > 32 * size:
        assert missed.status is Status.OPEN
    assert abs(missed.gap - gap) < LENGTH * size


@pytest.mark.parametrize(
    ('lengths', 'gap'),
    [
        ((1.0, 2.0, 3.0, 10.0), 4.0),
        ((1.0, 10.0, 2.0, 3.0), 6.0),
        ((1.0, 0.25, 0.25, 1.0), 1.5),
        ((1.0, 2.0, 1.0, 1.0), 1.0),
    ],
)
def test_the_gap_is_what_the_links_miss_each_other_by(
    lengths: tuple[float, float, float, float], gap: float
) -> None:
    # Crank along the ground, where all lengths lie on one line and are added up by hand.
    phi = 0.0 if gap in (4.0, 6.0, 1.0) else pi
    pose = FourBar(*lengths, 1).close(phi)
    assert pose.status is Status.OPEN
    assert pose.gap == pytest.approx(gap, rel=1e-15)
