# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Four-bars through three poses are those of geometry, to the last digits that poses determine."""

from cmath import phase, rect
from math import inf, nan, pi, radians, tau

from linkage_ros.errors import SynthesisError
from linkage_ros.kinematics import UNIT_ROUNDOFF
from linkage_ros.tools.design import (
    fixed_pivots,
    from_fixed_pivots,
    from_moving_pivots,
    moving_pivots,
    Pose,
    prove,
)
from linkage_ros.tools.design.motion import TRUSTED
from mpmath import mp, mpc, mpf
import numpy as np
import pytest

mp.dps = 50


def pose(x, y, degrees):
    return Pose(complex(x, y), radians(degrees))


# The independent route: perpendicular bisectors, by Cramer's rule, in 50 digits.


def places_of(places, angles, point, *, fixed):
    """Return where a point of the coupler is in the ground, or a fixed one in the coupler."""
    turns = [mp.expj(mpf(angle)) for angle in angles]
    if fixed:
        return [(mpc(point) - place) / turn for place, turn in zip(places, turns, strict=True)]
    return [place + turn * point for place, turn in zip(places, turns, strict=True)]


def crossing_of_bisectors(first, second, third):
    """Return where the bisectors of first–second and second–third cross."""
    (a, b, e), (c, d, f) = (
        (way.real, way.imag, (way * mp.conj((one + other) / 2)).real)
        for way, one, other in ((second - first, first, second), (third - second, second, third))
    )
    determinant = a * d - b * c
    return mpc(e * d - b * f, a * f - e * c) / determinant


def reference(places, angles, point, *, fixed):
    return crossing_of_bisectors(*places_of(places, angles, point, fixed=fixed))


def exact(numbers):
    return [mpc(complex(number)) for number in numbers]


# Poses of many kinds; each gives positions (n, 3), angles (n, 3) and a pivot (n,).


def anywhere(generator, count):
    return (
        complexes(generator, (count, 3)),
        generator.uniform(-pi, pi, (count, 3)),
        complexes(generator, count),
    )


def crowded(generator, count):
    """Poses near one another, down to a ten-millionth of what they are from the origin."""
    places, angles, pivot = anywhere(generator, count)
    size = 10.0 ** generator.uniform(-7.0, 0.0, (count, 1))
    return (
        places[:, :1] + size * (places - places[:, :1]),
        angles[:, :1] + size * (angles - angles[:, :1]),
        pivot,
    )


def far_away(generator, count):
    places, angles, pivot = anywhere(generator, count)
    away = 10.0 ** generator.uniform(0.0, 6.0, (count, 1)) * complexes(generator, (count, 1))
    return places + away, angles, pivot + away[:, 0] * generator.integers(0, 2, count)


def nearly_on_a_line(generator, count):
    """Poses that take a pin of the coupler nearly along a line."""
    places, angles, pivot = anywhere(generator, count)
    line = np.exp(1j * generator.uniform(0.0, pi, (count, 1)))
    along = generator.uniform(-1.0, 1.0, (count, 3)) * line
    sag = 10.0 ** generator.uniform(-9.0, 0.0, (count, 1)) * places
    return along + sag - np.exp(1j * angles) * pivot[:, None], angles, pivot


def near_a_pole(generator, count):
    places, angles, _ = anywhere(generator, count)
    first, second = places[:, 0], places[:, 1]
    pole = (second - first) / (np.exp(1j * angles[:, 0]) - np.exp(1j * angles[:, 1]))
    return places, angles, pole + 10.0 ** generator.uniform(-9.0, 0.0, count)


def complexes(generator, shape):
    return generator.uniform(-1.0, 1.0, shape) + 1j * generator.uniform(-1.0, 1.0, shape)


KINDS = [anywhere, crowded, far_away, nearly_on_a_line, near_a_pole]
ROUTES = [(fixed_pivots, False), (moving_pivots, True)]


@pytest.mark.sample(3)
@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize(('find', 'fixed'), ROUTES)
def test_pivots_stay_within_the_reported_accuracy(find, fixed, kind):
    places, angles, given = kind(np.random.default_rng(5), 400)
    found = find(places, angles, given)
    for index, point in enumerate(given):
        there = exact(places[index]), angles[index], mpc(complex(point))
        wanted = reference(*there, fixed=fixed)
        error = float(abs(mpc(complex(found.pivots[index])) - wanted))
        assert error <= UNIT_ROUNDOFF * found.sensitivity[index]
        length = float(abs(wanted - places_of(*there, fixed=fixed)[0]))
        assert error <= 1.01 * 10.0 ** -found.reliable_digits[index] * length
        assert found.lengths[index] == pytest.approx(length, rel=1e-9 + error / length)


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize(('find', 'fixed'), ROUTES)
def test_pivot_sensitivity_equals_numerical_derivatives(find, fixed, kind):
    places, angles, given = kind(np.random.default_rng(7), 20)
    found = find(places, angles, given)
    for index, point in enumerate(given):
        inputs = [
            *(number for place in places[index] for number in (place.real, place.imag)),
            *angles[index],
            point.real,
            point.imag,
        ]

        def pivot(*factors, numbers=inputs):
            x = [mpf(float(n)) * f for n, f in zip(numbers, factors, strict=True)]
            at = [mpc(x[i], x[i + 1]) for i in (0, 2, 4)]
            return reference(at, x[6:9], mpc(x[9], x[10]), fixed=fixed)

        size = mpf(10) ** -25
        here = pivot(*[1] * 11)
        moved = (pivot(*[1 + size * (i == step) for i in range(11)]) for step in range(11))
        total = abs(here) + sum(abs(there - here) / size for there in moved)
        assert found.sensitivity[index] == pytest.approx(float(total), rel=1e-6)


def test_pivot_batch_equals_single_solutions():
    places, angles, given = anywhere(np.random.default_rng(3), 10)
    for find, _ in ROUTES:
        many = find(places, angles, given)
        for index in range(10):
            one = find(places[index], angles[index], given[index])
            assert one.pivots == many.pivots[index]
            assert (one.arms == many.arms[index]).all()
            assert one.sensitivity == many.sensitivity[index]


# Round trips: a four-bar is driven, in 50 digits, and designed back from its poses.


def driven(generator):
    """Return pivots, pins in the coupler, three poses, crank angles, and the side."""
    while True:
        o2, o4, a, b = complexes(generator, 4) * 2.0
        crank, rocker = generator.uniform(0.3, 3.0, 2)
        side = generator.choice((-1, 1))
        cranks = generator.uniform(-pi, pi, 3)
        o2_exact, o4_exact, a_exact, b_exact = exact((o2, o4, a, b))
        poses = []
        for angle in cranks:
            pin = o2_exact + mpf(crank) * mp.expj(mpf(angle))
            across, bar = o4_exact - pin, abs(b_exact - a_exact)
            along = (abs(across) ** 2 + bar**2 - mpf(rocker) ** 2) / (2 * abs(across))
            if not abs(along) < 0.999 * bar:
                break
            other = pin + across / abs(across) * mpc(along, side * mp.sqrt(bar**2 - along**2))
            turn = (other - pin) / (b_exact - a_exact)
            poses.append(Pose(complex(pin - turn * a_exact), float(mp.arg(turn))))
        if len(poses) == 3:
            return (o2, o4), (a, b), poses, cranks, 'left' if side > 0 else 'right'


@pytest.mark.sample(30)
@pytest.mark.parametrize('seed', range(150))
@pytest.mark.parametrize('way', ['fixed', 'moving'])
def test_four_bar_is_recovered_from_three_poses(seed, way):
    (o2, o4), (a, b), poses, cranks, side = driven(np.random.default_rng(seed))
    if way == 'moving':
        design, links = from_moving_pivots(poses, a, b)
        found, wanted = design.four_bar.pivots, (o2, o4)
        assert design.four_bar.coupler == (a, b)
    else:
        design, links = from_fixed_pivots(poses, o2, o4)
        found, wanted = design.four_bar.coupler, (a, b)
        assert design.four_bar.pivots == (o2, o4)
    assert abs(np.subtract(found, wanted)) == pytest.approx(
        [0.0, 0.0], abs=float((TRUSTED * UNIT_ROUNDOFF * links.sensitivity).max())
    )
    assert design.four_bar.side == side
    assert design.four_bar.traced == 0j
    unsure = 100.0 * UNIT_ROUNDOFF * float((links.sensitivity / links.lengths).max())
    for crank, asked, place in zip(cranks, design.wanted, poses, strict=True):
        assert abs(rect(1.0, crank) - rect(1.0, asked.crank)) <= unsure
        assert (asked.rocker, asked.coupler, asked.place) == (None, place.angle, place.place)
    for met in prove(design):
        assert (met.side, met.is_closed) == (side, True)
        # The coupler's sensitivity to the crank comes on top, near a toggle.
        assert abs(met.angle) < 1e4 * unsure
        assert met.distance < 1e4 * unsure


# Tasks of a course (A. Wickenheiser, Machine Design, 2020: two scripts of "3-position coupler
# output synthesis", public on GitHub); they print no results.

LINE = [
    (-1.5 + 9.58j, 1.89 + 11.70j),
    (2.72 + 10.31j, 6.55 + 9.19j),
    (5.96 + 8.00j, 9.45 + 9.96j),
]
ENDS = (-0.04 + 9.24j, 1.84 + 8.02j)
"""Moving pivots, where they are in the ground in the first pose."""

SPECIFIED_GROUND = [
    pose(2.164, 1.26, 30.0),
    pose(2.164 - 1.236, 1.26 + 2.138, -32.5),
    pose(2.164 - 2.5, 1.26 + 2.931, -69.8),
]


def test_moving_pivots_give_a_four_bar_through_poses():
    poses = [Pose(start, phase(end - start)) for start, end in LINE]
    pins = [(point - poses[0].place) * rect(1.0, -poses[0].angle) for point in ENDS]
    design, _ = from_moving_pivots(poses, *pins)
    for found, pin in zip(design.four_bar.pivots, pins, strict=True):
        distances = [abs(at.place + rect(1.0, at.angle) * pin - found) for at in poses]
        assert distances == pytest.approx([distances[0]] * 3, rel=1e-13)
    assert all(met.distance < 1e-12 and abs(met.angle) < 1e-13 for met in prove(design))


def test_fixed_pivots_give_a_four_bar_through_poses():
    # The script searches for the moving pivots until the fixed ones are met to 0.001.
    design, links = from_fixed_pivots(SPECIFIED_GROUND, 0j, 4.354 + 0j)
    there, _ = from_moving_pivots(SPECIFIED_GROUND, *design.four_bar.coupler)
    assert abs(there.four_bar.pivots[0]) < 1e-13
    assert abs(there.four_bar.pivots[1] - 4.354) < 1e-13
    assert min(links.reliable_digits) > 14.0
    assert all(met.distance < 1e-13 and abs(met.angle) < 1e-13 for met in prove(design))


# By hand.


def test_non_rotating_coupler_gives_a_parallelogram():
    # Its origin goes around (0, 2) by quarters, and every other point with it.
    poses = [pose(1, 2, 0), pose(0, 3, 0), pose(-1, 2, 360)]
    design, _ = from_moving_pivots(poses, 0j, 3 + 0j)
    assert design.four_bar.pivots == (2j, 3 + 2j)
    assert design.four_bar.lengths == (1.0, 3.0, 1.0, 3.0)
    assert [asked.crank for asked in design.wanted] == pytest.approx([0.0, pi / 2, pi])
    assert all(met.distance < 1e-15 and met.angle == 0.0 for met in prove(design))
    same, _ = from_fixed_pivots(poses, 2j, 3 + 2j)
    assert abs(np.subtract(same.four_bar.coupler, (0j, 3 + 0j))).max() < 1e-15


def test_motion_design_uses_the_assembly_meeting_most_poses():
    # A goes around 0 through 1, i and −1; B = A + 2·e^{iθ} through (3, 0), (0, 3) and (1, 0),
    # which are √5 from (2, 2). In the second pose it has come to the other side of A→O4.
    poses = [pose(1, 0, 0), pose(0, 1, 90), pose(-1, 0, 0)]
    design, links = from_moving_pivots(poses, 0j, 2 + 0j)
    assert abs(np.subtract(design.four_bar.pivots, (0j, 2 + 2j))).max() < 1e-15
    assert links.lengths == pytest.approx([1.0, 5.0**0.5])
    assert design.four_bar.side == 'right'
    assert [met.side for met in prove(design)] == ['right', 'left', 'right']


@pytest.mark.parametrize('turns', [-3, 1, 1000])
def test_whole_turns_do_not_change_a_pose(turns):
    turned = [Pose(at.place, at.angle + turns * tau) for at in SPECIFIED_GROUND]
    design, _ = from_fixed_pivots(turned, 0j, 4.354 + 0j)
    other, _ = from_fixed_pivots(SPECIFIED_GROUND, 0j, 4.354 + 0j)
    assert abs(np.subtract(design.four_bar.coupler, other.four_bar.coupler)).max() < 1e-11


# Tasks without a solution.

START, RAISED, OVER = pose(0, 0, 0), pose(0, 1, 20), pose(2, 1, 50)
ABOUT = [pose(0, 0, 0), pose(0, 0, 20), pose(0, 0, 50)]
ON_A_LINE = [pose(0, 1, 10), pose(1, 2, 40), pose(2, 3, -30)]
SLIDING = [pose(0, 0, 5), pose(1, 0, 5), pose(3, 0, 365)]
OFF_THE_POLE = 1e-15 + 1e-15j


@pytest.mark.parametrize(('way', 'poses', 'pivots', 'where', 'reason'), [
    ('moving', [START, RAISED], (0j, 1j), 'poses', '2 were given'),
    ('moving', [START, RAISED, pose(0, nan, 0)], (0j, 1j), 'pose 3',
     r'\(0.0, nan\), 0.0 is not a pose'),
    ('fixed', [START, pose(0, 0, inf), OVER], (0j, 1j), 'pose 2', 'inf is not a pose'),
    ('fixed', [START, RAISED, OVER], (0j, complex(inf, 0)), 'O4', r'\(inf, 0.0\) is not a place'),
    ('moving', [START, RAISED, OVER], (nan + 0j, 0j), 'A', 'is not a place'),
    ('moving', [OVER, START, OVER], (0j, 1j), 'poses 1 and 3', r'the same, \(2, 1\) m at 50°'),
    ('fixed', [pose(1, 0, 350), pose(1, 0, -10), OVER], (0j, 1j), 'poses 1 and 2', 'at 350°'),
    ('moving', [START, RAISED, OVER], (1j, 1j), 'A and B', 'are the same place'),
    ('fixed', [START, RAISED, OVER], (2 + 0j, 2 + 0j), 'O2 and O4', 'are the same place'),
    ('moving', ON_A_LINE, (1j, 0j), 'B', 'on a line at 45°.* its fixed pivot .* a slider'),
    ('moving', SLIDING, (1j, 0j), 'A', 'on a line at 0°'),
    ('fixed', SLIDING, (1j, 0j), 'O2', 'seen from the coupler.* on a line at 175°'),
    ('moving', ABOUT, (0j, 1j), 'A', 'turns about it in all three'),
    ('fixed', ABOUT, (1j, 0j), 'O4', 'turns about it in all three'),
    ('moving', ABOUT, (1j, 2 + 0j), 'A and B', 'the same fixed pivot.* the ground would have no'),
    ('fixed', ABOUT, (1j, 2 + 0j), 'O2 and O4', 'the same moving pivot.* the coupler would have'),
    ('moving', [START, OVER, ABOUT[1]], (1j, 0j), 'B', 'the pole of poses 1 and 3'),
    ('fixed', [OVER, START, ABOUT[1]], (0j, 1j), 'O2', 'the pole of poses 2 and 3'),
    ('fixed', [pose(1, 0, 0), pose(0, 1, 90), OVER], (1j, OFF_THE_POLE), 'O4',
     'the pole of poses 1 and 2'),
    ('moving', [pose(1, 0, 0), pose(0, 1, 90), OVER], (1j, -1 + 1e-14j), 'B',
     'so near a pole that its fixed pivot has no certain digit'),
])  # fmt: skip
def test_impossible_motion_task_is_refused(way, poses, pivots, where, reason):
    design = from_moving_pivots if way == 'moving' else from_fixed_pivots
    with pytest.raises(SynthesisError, match=reason) as caught:
        design(poses, *pivots)
    assert caught.value.where == where
    assert '\n' not in str(caught.value)


def test_nearly_collinear_poses_report_fewer_reliable_digits():
    nearly = [ON_A_LINE[0], ON_A_LINE[1], pose(2, 3 + 1e-7, -30)]
    _, links = from_moving_pivots(nearly, 0j, 1j)
    assert 6.0 < links.reliable_digits[0] < 9.0
    assert links.reliable_digits[1] > 13.0
