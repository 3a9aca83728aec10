# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Toggles and change points, and the sides that assemblies keep there."""

from itertools import pairwise
from math import copysign, cos, nextafter, pi, remainder, sin, tau
import random

from linkage_ros.kinematics import Closure, Status
from mpmath import mp, mpf
import pytest

from ..defects import defect
from ..flat_linkages import FLAT, Flat
from ..linkages import FourBar, InvertedSliderCrank
from ..reference import ANGLE, four_bar, inverted_slider_crank, LENGTH, RATE, TOGGLE, UNIT_ROUNDOFF

# Where all links lie along the ground, a linkage may continue in two ways; it continues in its
# assembly.
#
# The half-angle form decides that in closed form. κ grows beyond all bounds near a change point,
# so the references here are motions known exactly: a parallelogram, whose coupler does not
# turn, and kites.


# a = c and b = d; the last ones as decimals, which do not cancel exactly.
PARALLELOGRAMS = {
    'longer ground': (1.0, 2.0, 1.0, 2.0),
    'longer crank': (2.0, 1.0, 2.0, 1.0),
    'needle': (1.0, 2.0**-30, 1.0, 2.0**-30),
    'decimal': (0.04, 0.12, 0.04, 0.12),
}

# From a visible distance to just above the one at which rates become subnormal numbers.
NEAR = [1e-3, 1e-6, 1e-9, 1e-12, 1e-100, 1e-290]


def off(angle: float, expected: float) -> float:
    """Return how far an angle is from another, modulo 2π."""
    return abs(remainder(angle - expected, 2 * pi))


@pytest.mark.parametrize('name', PARALLELOGRAMS)
@pytest.mark.parametrize(
    ('turn', 'near'), [*((0.0, x) for x in NEAR), *((pi, x) for x in (*NEAR[:4], 2.0**-50))]
)
@pytest.mark.parametrize('sign', [1, -1])
def test_parallelogram_passes_its_change_points(name, turn, near, sign):
    dyad, phi = FourBar(*PARALLELOGRAMS[name], 1), turn + sign * near
    pose = dyad.close(phi)
    assert pose.status is (Status.CLOSED if near > 1e-14 else Status.CHANGE_POINT)
    a, _, _, d = PARALLELOGRAMS[name]
    if d > a and not turn:
        # Small angles, to their own last digits.
        assert abs(pose.first) < 8e-16 * near
        assert pose.second == pytest.approx(phi, rel=1e-15, abs=0.0)
    assert off(pose.first, 0.0) < (2e-15 if turn else 1e-15)
    assert off(pose.second, phi) < (2e-15 if turn else 1e-15)
    assert dyad.rates(pose, 1.0) == pytest.approx((0.0, 1.0), rel=8e-16, abs=8e-16)


@pytest.mark.parametrize('name', PARALLELOGRAMS)
@pytest.mark.parametrize('zero', [0.0, -0.0, 5e-324, -1e-310])
def test_parallelogram_has_rates_at_its_change_point(name, zero):
    dyad = FourBar(*PARALLELOGRAMS[name], 1)
    pose = dyad.close(zero)
    assert pose.status is Status.CHANGE_POINT
    assert pose.cross == pytest.approx(0.0, abs=1e-300)
    assert off(pose.first, 0.0) < 1e-15
    assert off(pose.second, 0.0) < 1e-15
    assert dyad.rates(pose, 1.0) == pytest.approx((0.0, 1.0), rel=8e-16, abs=8e-16)
    assert dyad.accelerations(pose, 1.0, 0.5) == pytest.approx((0.0, 0.5), rel=8e-16, abs=8e-16)


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', PARALLELOGRAMS)
@pytest.mark.parametrize('step', [0.001, 0.1, 2.9])
@pytest.mark.parametrize('sign', [1, -1])
@pytest.mark.parametrize('start', [0.0005, 1.7])
def test_parallelogram_keeps_its_assembly_at_any_step(name, step, sign, start):
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
def test_folded_kite_turns_about_the_crank_pivot(near, sign):
    # a = b and c = d, B on the crank's pivot: the crank carries the coupler, the rocker stands.
    dyad, phi = FourBar(1.0, 1.0, 2.0, 2.0, -1), sign * near
    pose = dyad.close(phi)
    assert pose.status is (Status.CLOSED if near > 1e-14 else Status.CHANGE_POINT)
    assert off(pose.first, phi + pi) < 2e-15
    assert off(pose.second, pi) < 2e-15
    assert dyad.rates(pose, 1.0) == pytest.approx((1.0, 0.0), rel=2e-15, abs=2e-15)


@pytest.mark.parametrize('near', [1e-3, 1e-6, 1e-9, 1e-12, 1e-100, 0.5, 3.0])
@pytest.mark.parametrize('sign', [1, -1])
def test_kite_with_meeting_pins_passes_its_change_point(near, sign):
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
def test_kite_with_coincident_pins_is_indeterminate(zero):
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
def test_four_bar_passes_a_single_change_point_without_jumps(name, side):
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
def test_single_change_point_four_bar_equals_the_reference(name, phi):
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
def test_four_bar_stays_exact_near_a_single_change_point(near, sign):
    lengths, phi = (3.0, 2.0, 4.0, 1.0), sign * near
    pose = FourBar(*lengths, 1).close(phi)
    truth = four_bar(*lengths, phi, sign, digits=300)
    # Each angle is there proportional to the crank's, up to a half-turn: absolute errors count.
    assert off(pose.first, float(truth.coupler.value)) < 2e-15
    assert off(pose.second, float(truth.rocker.value)) < 2e-15
    coupler_rate, rocker_rate = FourBar(*lengths, 1).rates(pose, 1.0)
    assert coupler_rate == pytest.approx(float(truth.coupler_rate.value), rel=4e-15)
    assert rocker_rate == pytest.approx(float(truth.rocker_rate.value), rel=4e-15)


def test_decimal_lengths_that_cancel_make_a_change_point():
    # 0.4 - 0.1 and 0.5 - 0.2 differ as floats. As decimals, which a file holds, they do not.
    assert 0.4 - 0.1 != 0.5 - 0.2
    assert FourBar(0.4, 0.2, 0.5, 0.1, 1).diagonal.fold_margin == 0.0
    # Lengths that differ by more than rounding are what they are.
    assert FourBar(0.4, 0.2, nextafter(0.5, 1.0) + 1e-14, 0.1, 1).diagonal.fold_margin != 0.0


@pytest.mark.parametrize('b', [0.2, 1.0, 1.3, 7.0])
@pytest.mark.parametrize('phi', [1e-9, -1e-9, 1e-15, 1e-16, 1e-20, -1e-100, 1e-150])
@pytest.mark.parametrize('sign', [1, -1])
def test_four_bar_rates_stay_exact_at_coincident_pins(b, phi, sign):
    # a = d and b = c: the diagonal vanishes, and the triangle on it stands ever more upright. By
    # hand, for a = d = 1 and φ → 0: θ3' = (1 ∓ 1/b)/2 and θ4' = (1 ± 1/b)/2, σ = ±1.
    dyad = FourBar(1.0, b, b, 1.0, sign)
    rates = dyad.rates(dyad.close(phi), 1.0)
    limits = (0.5 * (1.0 - sign / b), 0.5 * (1.0 + sign / b))
    assert rates == pytest.approx(limits, rel=1e-15, abs=4e-16)


# Near a limit position: closed to the last digit inside, a toggle on it, an open gap outside.


DISTANCES = [10.0**-exponent for exponent in range(3, 16)]

# Lengths a, b, c, d, and whether the dyad limits the crank by stretching or by folding.
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


@pytest.mark.sample(40)
@pytest.mark.parametrize('name', LIMITS)
@pytest.mark.parametrize('distance', DISTANCES)
@pytest.mark.parametrize('side', [1, -1])
def test_four_bar_closes_exactly_inside_its_limit_angle(name, distance, side):
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
def test_four_bar_reports_its_gap_outside_the_limit_angle(name, distance, turn):
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
def test_four_bar_links_align_at_the_limit_angle(name, turn, side):
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
def test_bent_rod_closes_only_inside_its_limit_angle(distance, a, d, h, side):
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
def test_four_bar_gap_equals_the_missing_length(lengths, gap):
    # Crank along the ground, where all lengths lie on one line and are added up by hand.
    phi = 0.0 if gap in (4.0, 6.0, 1.0) else pi
    pose = FourBar(*lengths, 1).close(phi)
    assert pose.status is Status.OPEN
    assert pose.gap == pytest.approx(gap, rel=1e-15)


# One rule of sides for all dyads, also at change points (docs/conventions.md).
#
# When a linkage folds flat, the named side holds while the crank points to one side of the
# folding line; beyond it the linkage continues its motion. Sides are read off the positions of
# the points.


COUNT = 150
_STEP = 1e-6


def drawn(kind: str, number: int) -> Flat:
    return FLAT[kind](random.Random(f'sides/{kind}/{number}'))


@pytest.mark.parametrize('kind', FLAT)
def test_named_side_holds_up_to_the_fold(kind):
    for index in range(COUNT):
        flat = drawn(kind, index)
        closure = Closure(flat.linkage)
        (side,) = flat.linkage.assembly.values()
        named = 1.0 if side in ('left', 'ahead') else -1.0
        low, high = flat.holds
        for part in (0.02, 0.3, 0.6, 0.98):
            crank = low + part * (high - low)
            position = closure.position(flat.sign * crank)
            if position.status is Status.OPEN:
                continue
            met = flat.side(closure.points(position))
            assert named * met > 0.0, (index, crank, flat)


@pytest.mark.parametrize('kind', FLAT)
def test_flat_linkages_keep_their_motion_through_change_points(kind):
    for index in range(COUNT // 3):
        flat = drawn(kind, index)
        closure = Closure(flat.linkage)
        for at in flat.at:
            before, here, after = (
                closure.position(flat.sign * (at + off)) for off in (-_STEP, 0.0, _STEP)
            )
            assert here.status is Status.CHANGE_POINT, flat
            if Status.OPEN in (before.status, after.status):
                continue
            # A motion that turned back would be off by as much as it moves.
            rates = closure.velocity(here, 1.0).joints
            for j, turning in enumerate(closure.turning):
                x, y, z = (position.joints[j] for position in (before, here, after))
                moved = [y - x, z - y]
                if turning:
                    moved = [remainder(part, tau) for part in moved]
                for part in moved:
                    assert abs(part - flat.sign * _STEP * rates[j]) < 1e-3 * _STEP, (index, flat)


@pytest.mark.parametrize(
    ('name', 'joint', 'expected'),
    [
        # The block's pin lies 1.793 m ahead of the rail's, at a crank angle of 30 degrees.
        ('inv_ahead', 'b', 1.793151),
        # A millionth of a length off the change point it is the same assembly.
        ('inv_ahead2', 'b', 1.793153),
        # |AD| = 2 sin 15°, with the rail on the ground.
        ('straight_rev_ahead', 'r', 0.517638),
        ('straight_rev_behind', 'r', -0.517638),
    ],
)
def test_rail_on_the_ground_keeps_the_named_side(name, joint, expected):
    closure = defect(name)
    position = closure.position(pi / 6.0)
    value = position.joints[list(closure.linkage.joints).index(joint)]
    assert value == pytest.approx(expected, abs=1e-6)
