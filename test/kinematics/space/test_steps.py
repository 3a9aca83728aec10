# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Each step in space is as exact as its numbers allow, far from toggles and next to them."""

from math import atan2, cos, dist, hypot, pi, sin, sqrt
from random import Random

from linkage_ros.kinematics import Status
from linkage_ros.kinematics.space.joints import HingePair, SlidePair
from linkage_ros.kinematics.space.steps import (
    ClosedHinge,
    ClosedSlide,
    GROUND_FRAME,
    LinkState,
    Rod,
    STILL,
    ThreeDistances,
)
import pytest

from .reference import hinge_angle, motion_of, moved, slide_length, three_spheres
from ..reference import Quantity, Worst

LIMIT = 4.0
"""In u·κ; 2.2 was measured over many more."""

COUNT = 40


def _point(random):
    return [random.uniform(-1.0, 1.0) for _ in range(3)]


def _distances(random, near):
    """Yield distances from a toggle: of angles, or of a length relative to it."""
    for _ in range(COUNT):
        yield 10.0 ** random.uniform(-9.0, -3.0) if near else random.uniform(0.05, pi - 0.05)


def _run(step, ends, velocities, changes):
    """Return pose, and the three states after a step that starts from points."""
    solved = LinkState([0.0], [GROUND_FRAME, *map(tuple, ends)])
    rates = LinkState([0.0], [STILL, *map(tuple, velocities)])
    accelerations = LinkState([0.0], [STILL, *map(tuple, changes)])
    pose = step.close(solved)
    if pose.status.has_rates:
        step.accelerations(pose, step.rates(pose, solved, rates), solved, rates, accelerations)
    return pose, (solved, rates, accelerations)


def _compare(worst, name, truth, found, case, angle=False):
    for order, (quantity, value) in enumerate(zip(truth, found, strict=True)):
        error = quantity.angle_error_of if angle and not order else quantity.error_of
        worst.note(f'{name}, order {order}', error(value), LIMIT, case)


@pytest.mark.parametrize('near', [False, True])
@pytest.mark.parametrize('sign', [1, -1])
def test_a_hinge_closed_by_a_rod_is_as_exact_as_its_numbers(near, sign):
    random, worst = Random(f'hinge {near} {sign}'), Worst()
    for apart in _distances(random, near):
        place, to, velocity, change = (_point(random) for _ in range(4))
        r, d, height = hypot(*place[:2]), hypot(*to[:2]), to[2] - place[2]
        if near:
            low, high = hypot(height, d - r), hypot(height, d + r)
            rod = random.choice((low * (1.0 + apart), high * (1.0 - apart)))
        else:
            rod = sqrt(d * d + r * r - 2.0 * r * d * cos(apart) + height * height)
        step = ClosedHinge(
            HingePair(0, GROUND_FRAME), tuple(place), 1, Rod(rod), float(sign), 2, r,
            atan2(place[1], place[0]),
        )  # fmt: skip
        case = (place, to, rod)
        pose, states = _run(step, [to], [velocity], [change])
        assert pose.status is Status.CLOSED, case
        assert pose.lever * sign > 0.0, case
        truth = motion_of(
            lambda n, t: hinge_angle(n[:3], moved(n[3:6], n[7:10], n[10:], t), n[6], sign),
            [*place, *to, rod, *velocity, *change],
        )
        _compare(worst, 'hinge', truth, [s.coordinates[1] for s in states], case, angle=True)
    worst.check()


@pytest.mark.parametrize('near', [False, True])
@pytest.mark.parametrize('sign', [1, -1])
def test_a_slide_closed_by_a_rod_is_as_exact_as_its_numbers(near, sign):
    random, worst = Random(f'slide {near} {sign}'), Worst()
    for apart in _distances(random, near):
        place, to, velocity, change = (_point(random) for _ in range(4))
        distance = hypot(to[0] - place[0], to[1] - place[1])
        rod = distance * (1.0 + apart)
        step = ClosedSlide(SlidePair(0, GROUND_FRAME), tuple(place), 1, Rod(rod), float(sign), 2)
        case = (place, to, rod)
        pose, states = _run(step, [to], [velocity], [change])
        assert pose.status is Status.CLOSED, case
        truth = motion_of(
            lambda n, t: slide_length(n[:3], moved(n[3:6], n[7:10], n[10:], t), n[6], sign),
            [*place, *to, rod, *velocity, *change],
        )
        _compare(worst, 'slide', truth, [s.coordinates[1] for s in states], case)
    worst.check()


@pytest.mark.parametrize('near', [False, True])
@pytest.mark.parametrize('sign', [1, -1])
def test_a_point_at_three_distances_is_as_exact_as_its_numbers(near, sign):
    random, worst = Random(f'three {near} {sign}'), Worst()
    for apart in list(_distances(random, near))[: COUNT // 3]:
        ends, velocities, changes = ([_point(random) for _ in range(3)] for _ in range(3))
        # A point above the plane of the three, near it for a toggle.
        a, b = random.uniform(-1.0, 1.5), random.uniform(-1.0, 1.5)
        x, y = ([q - p for p, q in zip(ends[0], end, strict=True)] for end in ends[1:])
        n = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
        up = sign * (sqrt(2.0 * apart) if near else sin(apart)) / hypot(*n)
        place = [p + a * u + b * v + up * w for p, u, v, w in zip(ends[0], x, y, n, strict=True)]
        rods = [dist(place, end) for end in ends]
        step = ThreeDistances((1, 2, 3), tuple(map(Rod, rods)), float(sign), 4)
        case = (ends, rods)
        pose, states = _run(step, ends, velocities, changes)
        assert pose.status is Status.CLOSED, case
        for axis in range(3):

            def coordinate(n, t, axis=axis):
                now = [
                    moved(n[3 * k : 3 * k + 3], n[12 + 3 * k : 15 + 3 * k],
                          n[21 + 3 * k : 24 + 3 * k], t)
                    for k in range(3)
                ]  # fmt: skip
                return three_spheres(now, n[9:12], sign)[axis]

            flat = [n for rows in (ends, [rods], velocities, changes) for row in rows for n in row]
            truth = motion_of(coordinate, flat)
            found = [state.pins[4][axis] for state in states]
            _compare(worst, 'point', truth, found, case)
    worst.check()


@pytest.mark.parametrize('apart', [sign * 10.0**-k for k in range(3, 16) for sign in (-1, 1)])
def test_status_and_gap_are_right_on_both_sides_of_a_toggle(apart):
    random = Random(f'toggle {apart}')
    for _ in range(20):
        place, to = _point(random), _point(random)
        r, d, height = hypot(*place[:2]), hypot(*to[:2]), to[2] - place[2]
        low, high = hypot(height, d - r), hypot(height, d + r)
        for rod, gap in (
            (low * (1.0 + apart), -low * apart), (high * (1.0 - apart), -high * apart)
        ):  # fmt: skip
            hinge = ClosedHinge(
                HingePair(0, GROUND_FRAME), tuple(place), 1, Rod(rod), 1.0, 2, r, 0.0
            )
            pose, _ = _run(hinge, [to], [(0.0, 0.0, 0.0)], [(0.0, 0.0, 0.0)])
            _check_status(pose, gap, rod)
        distance = hypot(to[0] - place[0], to[1] - place[1])
        rod = distance * (1.0 + apart)
        slide = ClosedSlide(SlidePair(0, GROUND_FRAME), tuple(place), 1, Rod(rod), 1.0, 2)
        pose, _ = _run(slide, [to], [(0.0, 0.0, 0.0)], [(0.0, 0.0, 0.0)])
        _check_status(pose, -distance * apart, rod)


def _check_status(pose, gap, size):
    rounding = 2.0**-48 * size
    if abs(gap) > rounding:
        assert pose.status is (Status.OPEN if gap > 0.0 else Status.CLOSED)
    if pose.status is Status.OPEN:
        assert pose.gap == pytest.approx(gap, rel=1e-3, abs=rounding)
    else:
        assert pose.gap == 0.0


def test_a_wrong_formula_would_be_seen():
    quantity = Quantity(1.0, 1.0)
    assert quantity.error_of(1.0 + 1e-15) > LIMIT
