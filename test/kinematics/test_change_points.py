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

"""
Where all links lie along the ground, a linkage may go on as either of two; it goes on as it was.

The half-angle form decides that in closed form. κ grows beyond all bounds near a change point, so
that the references here are motions known exactly: a parallelogram, whose coupler does not turn,
and kites.
"""

from __future__ import annotations

from itertools import pairwise
from math import copysign, cos, nextafter, pi, remainder, sin

from linkage_ros.kinematics.status import Status
import pytest

from .on_crank import FourBar
from .reference import four_bar
from .tolerance import ANGLE, RATE

# a = c and b = d; the last as decimals, which do not cancel exactly.
PARALLELOGRAMS = {
    'longer ground': (1.0, 2.0, 1.0, 2.0),
    'longer crank': (2.0, 1.0, 2.0, 1.0),
    'needle': (1.0, 2.0**-30, 1.0, 2.0**-30),
    'decimal': (0.04, 0.12, 0.04, 0.12),
}

# From as far as the eye sees to next to where rates are no normal numbers any more.
NEAR = [1e-3, 1e-6, 1e-9, 1e-12, 1e-100, 1e-290]


def off(angle: float, expected: float) -> float:
    """Return how far an angle is from another, modulo 2π."""
    return abs(remainder(angle - expected, 2 * pi))


@pytest.mark.parametrize('name', PARALLELOGRAMS)
@pytest.mark.parametrize('near', NEAR)
@pytest.mark.parametrize('sign', [1, -1])
def test_a_parallelogram_passes_zero_as_a_parallelogram(name: str, near: float, sign: int) -> None:
    dyad, phi = FourBar(*PARALLELOGRAMS[name], 1), sign * near
    pose = dyad.close(phi)
    assert pose.status is (Status.CLOSED if near > 1e-14 else Status.CHANGE_POINT)
    a, _, _, d = PARALLELOGRAMS[name]
    if d > a:
        # Small angles, to their own last digits.
        assert abs(pose.first) < 8e-16 * near
        assert pose.second == pytest.approx(phi, rel=1e-15, abs=0.0)
    assert off(pose.first, 0.0) < 1e-15
    assert off(pose.second, phi) < 1e-15
    assert dyad.rates(pose, 1.0) == pytest.approx((0.0, 1.0), rel=8e-16, abs=8e-16)


@pytest.mark.parametrize('name', PARALLELOGRAMS)
@pytest.mark.parametrize('near', [1e-3, 1e-6, 1e-9, 1e-12, 2.0**-50])
@pytest.mark.parametrize('sign', [1, -1])
def test_a_parallelogram_passes_half_a_turn_as_a_parallelogram(
    name: str, near: float, sign: int
) -> None:
    dyad, phi = FourBar(*PARALLELOGRAMS[name], 1), pi + sign * near
    pose = dyad.close(phi)
    assert pose.status is (Status.CLOSED if near > 1e-14 else Status.CHANGE_POINT)
    assert off(pose.first, 0.0) < 2e-15
    assert off(pose.second, phi) < 2e-15
    assert dyad.rates(pose, 1.0) == pytest.approx((0.0, 1.0), rel=8e-16, abs=8e-16)


@pytest.mark.parametrize('name', PARALLELOGRAMS)
@pytest.mark.parametrize('zero', [0.0, -0.0, 5e-324, -1e-310])
def test_at_the_change_point_position_and_rates_are_those_of_the_motion_through_it(
    name: str, zero: float
) -> None:
    dyad = FourBar(*PARALLELOGRAMS[name], 1)
    pose = dyad.close(zero)
    assert pose.status is Status.CHANGE_POINT
    assert pose.cross == pytest.approx(0.0, abs=1e-300)
    assert off(pose.first, 0.0) < 1e-15
    assert off(pose.second, 0.0) < 1e-15
    assert dyad.rates(pose, 1.0) == pytest.approx((0.0, 1.0), rel=8e-16, abs=8e-16)
    assert dyad.accelerations(pose, 1.0, 0.5) == pytest.approx((0.0, 0.5), rel=8e-16, abs=8e-16)


@pytest.mark.parametrize('name', PARALLELOGRAMS)
@pytest.mark.parametrize('step', [0.001, 0.1, 2.9])
@pytest.mark.parametrize('sign', [1, -1])
@pytest.mark.parametrize('start', [0.0005, 1.7])
def test_a_parallelogram_stays_one_at_any_step_in_either_direction(
    name: str, step: float, sign: int, start: float
) -> None:
    dyad = FourBar(*PARALLELOGRAMS[name], 1)
    for i in range(round(max(2, 4 * pi / step))):
        phi = sign * (start + i * step)
        pose = dyad.close(phi)
        assert pose.status is Status.CLOSED
        assert off(pose.first, 0.0) < 2e-15
        # The angle itself is rounded at its size.
        assert off(pose.second, phi) < 2e-15 + 2.0**-53 * abs(phi)
        assert dyad.rates(pose, 1.0) == pytest.approx((0.0, 1.0), rel=4e-15, abs=4e-15)


@pytest.mark.parametrize('near', [1e-3, 1e-6, 1e-9, 1e-12, 1e-300, 0.5, 3.0])
@pytest.mark.parametrize('sign', [1, -1])
def test_a_folded_kite_turns_as_one_link_about_the_crank_pivot(near: float, sign: int) -> None:
    # a = b and c = d, B on the crank's pivot: the crank carries the coupler, the rocker stands.
    dyad, phi = FourBar(1.0, 1.0, 2.0, 2.0, -1), sign * near
    pose = dyad.close(phi)
    assert pose.status is (Status.CLOSED if near > 1e-14 else Status.CHANGE_POINT)
    assert off(pose.first, phi + pi) < 2e-15
    assert off(pose.second, pi) < 2e-15
    assert dyad.rates(pose, 1.0) == pytest.approx((1.0, 0.0), rel=2e-15, abs=2e-15)


@pytest.mark.parametrize('near', [1e-3, 1e-6, 1e-9, 1e-12, 1e-100, 0.5, 3.0])
@pytest.mark.parametrize('sign', [1, -1])
def test_a_kite_whose_pins_meet_goes_through_with_its_links_in_line(
    near: float, sign: int
) -> None:
    # a = d and b = c: A passes D. The diagonal turns at half the crank's rate, and with its
    # length goes the height of the triangle; closed form: B lies at √(b² − s²/4) from its middle.
    a, b = 2.0, 3.0
    dyad, phi = FourBar(a, b, b, a, 1), sign * near
    pose = dyad.close(phi)
    truth = four_bar(a, b, b, a, phi, sign, digits=700)
    assert pose.status is Status.CLOSED
    assert truth.coupler.angle_error_of(pose.first) < ANGLE
    assert truth.rocker.angle_error_of(pose.second) < ANGLE
    rates = dyad.rates(pose, 1.0)
    assert truth.coupler_rate.error_of(rates[0]) < RATE
    assert truth.rocker_rate.error_of(rates[1]) < RATE


@pytest.mark.parametrize('zero', [0.0, -0.0])
def test_a_kite_with_a_pin_on_the_ground_pivot_has_no_pose_that_could_be_told(zero: float) -> None:
    assert FourBar(2.0, 3.0, 3.0, 2.0, 1).close(zero).status is Status.INDETERMINATE


# One change point only: a turn of the crank ends in the other assembly, two turns in the same.
SINGLE = {
    'a + b = c + d': ((3.0, 2.0, 4.0, 1.0), lambda phi: sin(phi / 2)),
    'a + c = b + d': ((3.0, 4.0, 2.0, 1.0), lambda phi: sin(phi / 2)),
    'a + d = b + c': ((1.0, 2.0, 3.0, 4.0), lambda phi: cos(phi / 2)),
    'decimal a + b = c + d': ((0.4, 0.2, 0.5, 0.1), lambda phi: sin(phi / 2)),
    'decimal a + d = b + c': ((0.1, 0.3, 0.4, 0.6), lambda phi: cos(phi / 2)),
}


@pytest.mark.parametrize('name', SINGLE)
@pytest.mark.parametrize('side', [1, -1])
def test_a_single_change_point_is_passed_steadily_over_two_turns(name: str, side: int) -> None:
    lengths, half = SINGLE[name]
    dyad = FourBar(*lengths, side)
    step = 4 * pi / 4000
    angles = [(i + 0.5) * step for i in range(4000)]
    poses = [dyad.close(phi) for phi in angles]
    assert {pose.status for pose in poses} == {Status.CLOSED}
    for (phi, one), (_, other) in pairwise(zip(angles, poses, strict=True)):
        rates = [max(map(abs, dyad.rates(pose, 1.0))) for pose in (one, other)]
        moved = max(off(one.first, other.first), off(one.second, other.second))
        assert moved < 1.5 * step * (max(rates) + 1e-9), phi
    for phi, pose in zip(angles, poses, strict=True):
        assert copysign(1.0, pose.cross) == copysign(1.0, side * half(phi))
    assert off(poses[0].first, poses[-1].first) < 0.02
    assert off(poses[0].first, poses[2000].first) > 1e-4


@pytest.mark.parametrize('name', [name for name in SINGLE if 'decimal' not in name])
@pytest.mark.parametrize('phi', [0.3, 2.0, 4.0, 6.0, 7.0, 9.0, 12.0, -1.0, -5.0])
def test_a_single_change_point_has_the_reference_s_poses_on_both_turns(
    name: str, phi: float
) -> None:
    lengths, half = SINGLE[name]
    dyad = FourBar(*lengths, 1)
    pose = dyad.close(phi)
    truth = four_bar(*lengths, phi, 1 if half(phi) > 0 else -1)
    assert truth.coupler.half_turn_error_of(pose.first) < ANGLE
    assert truth.rocker.half_turn_error_of(pose.second) < ANGLE
    for rate, expected in zip(
        dyad.rates(pose, 1.0), (truth.coupler_rate, truth.rocker_rate), strict=True
    ):
        assert expected.error_of(rate) < RATE


@pytest.mark.parametrize('near', [1e-3, 1e-6, 1e-9, 1e-12, 1e-100])
@pytest.mark.parametrize('sign', [1, -1])
def test_next_to_a_single_change_point_poses_keep_their_digits(near: float, sign: int) -> None:
    lengths, phi = (3.0, 2.0, 4.0, 1.0), sign * near
    pose = FourBar(*lengths, 1).close(phi)
    truth = four_bar(*lengths, phi, sign, digits=300)
    # Each angle is there proportional to the crank's, up to a half-turn: absolute errors count.
    assert off(pose.first, float(truth.coupler.value)) < 2e-15
    assert off(pose.second, float(truth.rocker.value)) < 2e-15
    coupler_rate, rocker_rate = FourBar(*lengths, 1).rates(pose, 1.0)
    assert coupler_rate == pytest.approx(float(truth.coupler_rate.value), rel=4e-15)
    assert rocker_rate == pytest.approx(float(truth.rocker_rate.value), rel=4e-15)


def test_lengths_that_cancel_but_for_their_last_digit_are_a_change_point() -> None:
    # 0.4 - 0.1 and 0.5 - 0.2 differ as floats. As decimals, which a file holds, they do not.
    assert 0.4 - 0.1 != 0.5 - 0.2
    assert FourBar(0.4, 0.2, 0.5, 0.1, 1).diagonal.fold_margin == 0.0
    # Lengths that differ by more than rounding are what they are.
    assert FourBar(0.4, 0.2, nextafter(0.5, 1.0) + 1e-14, 0.1, 1).diagonal.fold_margin != 0.0


@pytest.mark.parametrize('b', [0.2, 1.0, 1.3, 7.0])
@pytest.mark.parametrize('phi', [1e-9, -1e-9, 1e-15, 1e-16, 1e-20, -1e-100, 1e-150])
@pytest.mark.parametrize('sign', [1, -1])
def test_where_the_crank_pin_meets_the_ground_pivot_rates_stay_right(
    b: float, phi: float, sign: int
) -> None:
    # a = d and b = c: the diagonal vanishes, and the triangle on it stands ever more upright. By
    # hand, for a = d = 1 and φ → 0: θ3' = (1 ∓ 1/b)/2 and θ4' = (1 ± 1/b)/2, σ = ±1.
    dyad = FourBar(1.0, b, b, 1.0, sign)
    rates = dyad.rates(dyad.close(phi), 1.0)
    limits = (0.5 * (1.0 - sign / b), 0.5 * (1.0 + sign / b))
    assert rates == pytest.approx(limits, rel=1e-15, abs=4e-16)
