# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Tolerance: points lie elsewhere, by a seed or as given, and what does not close is refused."""

from cmath import phase, pi
from itertools import pairwise
from math import erf, hypot, sqrt
from pathlib import Path
from random import Random

from linkage_ros.kinematics import Closure
from linkage_ros.stages.effects import BEFORE, ToleranceEffect
import mpmath
import pytest

from ...support.scenes import linkage_of

GALLERY = sorted((Path(__file__).parents[3] / 'config' / 'linkages').glob('*.yaml'))
FOUR_BAR = linkage_of('four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}')


def made(parameters, seed='seed', drawn=FOUR_BAR):
    return parameters.alter(drawn, Random(seed))


def deviations(altered, drawn=FOUR_BAR):
    """Return what each coordinate is off by, by link.point."""
    return {
        f'{link}.{point}': tuple(
            a - b for a, b in zip(altered.links[link][point], place, strict=True)
        )
        for link, points in drawn.links.items()
        for point, place in points.items()
    }


def test_tolerance_shifts_every_point_including_the_ground():
    assert all(dx and dy for dx, dy in deviations(made(ToleranceEffect(1e-4))).values())


def test_tolerance_changes_only_the_points():
    altered = made(ToleranceEffect(1e-4))
    for name in FOUR_BAR.__slots__:
        assert (getattr(altered, name) == getattr(FOUR_BAR, name)) is (
            name not in ('links', 'nominal')
        )


@pytest.mark.sample(7)
@pytest.mark.parametrize('file', GALLERY, ids=lambda file: file.stem)
def test_zero_tolerance_keeps_the_drawn_linkage(file):
    drawn = linkage_of(file.read_bytes())
    assert made(ToleranceEffect(), drawn=drawn) == drawn


def left_of(before):
    """Return mean square, and mean fourth power, of a normal number that is cut off at 3."""
    with mpmath.workdps(30):
        end = 3 / mpmath.mpf(before)
        whole = mpmath.quad(mpmath.npdf, [-end, 0, end])
        return [
            mpmath.quad(lambda x, k=k: (before * x) ** k * mpmath.npdf(x), [-end, 0, end]) / whole
            for k in (2, 4)
        ]


def test_truncated_normal_has_the_written_standard_deviation():
    square, _ = left_of(BEFORE)
    assert abs(square - 1) < 1e-15


def test_tolerance_deviations_are_normal_within_three_sigma():
    sigma = 1e-5
    values = sorted(
        value / sigma
        for seed in range(5000)
        for pair in deviations(made(ToleranceEffect(sigma), str(seed))).values()
        for value in pair
    )
    n = len(values)
    assert n == 80_000
    assert 2.9 < max(map(abs, values)) <= 3.0 + 1e-9
    # Kolmogorov and Smirnov: beyond 1.95/√n in one of a thousand samples.
    wide = BEFORE * sqrt(2.0)
    inside = erf(3.0 / wide)
    distance = max(
        abs(0.5 * (1.0 + erf(v / wide) / inside) - (i + 0.5) / n) for i, v in enumerate(values)
    )
    assert distance < 1.95 / sqrt(n)
    # The variance is the one that is written. Four times the standard deviation of its estimate is
    # 0.018; cut off without more it would be 0.973.
    _, fourth = left_of(BEFORE)
    error = 4.0 * sqrt((float(fourth) - 1.0) / n)
    assert error < 0.02
    assert sum(v * v for v in values) / n == pytest.approx(1.0, abs=error)


def test_link_length_deviates_by_root_two_sigma():
    sigma = 1e-5
    off = []
    for seed in range(2000):
        coupler = made(ToleranceEffect(sigma), str(seed)).links['coupler']
        off.append(hypot(*(b - a for a, b in zip(*coupler.values(), strict=True))) - 0.12)
    found = sum(value * value for value in off) / len(off) / (2.0 * sigma**2)
    # The variance of a variance is below 2/n here; four times its root.
    assert found == pytest.approx(1.0, abs=4.0 * sqrt(2.0 / len(off)))


def test_doubled_tolerance_doubles_every_deviation():
    one, two = (deviations(made(ToleranceEffect(s))) for s in (1e-4, 2e-4))
    for point, pair in one.items():
        assert two[point] == pytest.approx([2.0 * value for value in pair], abs=1e-16)


def test_tolerance_changes_only_the_named_links():
    every = made(ToleranceEffect(1e-4))
    some = made(ToleranceEffect(1e-4, links=('rocker', 'ground')))
    for link in FOUR_BAR.links:
        deviating = link in ('rocker', 'ground')
        assert some.links[link] == (every if deviating else FOUR_BAR).links[link]


def test_given_deviation_replaces_the_drawn_one():
    every = deviations(made(ToleranceEffect(1e-4)))
    given = {'coupler.B': (1e-4, 0.0), 'ground.O4': (0.0, -2e-4)}
    some = deviations(made(ToleranceEffect(1e-4, given=given)))
    for point, pair in every.items():
        assert some[point] == pytest.approx(given.get(point, pair), abs=1e-16)


def test_given_deviations_equal_a_linkage_of_those_lengths():
    # The coupler 0.1 mm longer, the ground 0.2 mm shorter.
    altered = made(ToleranceEffect(given={'coupler.B': (1e-4, 0), 'ground.O4': (-2e-4, 0)}))
    written = linkage_of('four_bar: {a: 0.04, b: 0.1201, c: 0.08, d: 0.0998}')
    for crank in (0.0, 1.0, 2.5, 4.0):
        found, expected = (Closure(each).position(crank).joints for each in (altered, written))
        assert found == pytest.approx(expected, abs=1e-13)


def test_off_axis_pin_shifts_the_published_joint():
    # The rocker's frame stays that of the drawing: its pin lies 1 mm to the left of its axis.
    altered = made(ToleranceEffect(given={'rocker.B': (0.0, 1e-3)}))
    straight = linkage_of(f'four_bar: {{a: 0.04, b: 0.12, c: {hypot(0.08, 1e-3)!r}, d: 0.1}}')
    coupler, rocker = Closure(altered).position(1.0).joints
    expected_coupler, expected_rocker = Closure(straight).position(1.0).joints
    assert coupler == pytest.approx(expected_coupler, abs=1e-13)
    assert rocker == pytest.approx(expected_rocker - phase(0.08 + 1e-3j), abs=1e-13)


@pytest.mark.sample(7)
@pytest.mark.parametrize('file', GALLERY, ids=lambda file: file.stem)
def test_gallery_linkage_with_tolerance_closes(file):
    drawn = linkage_of(file.read_bytes())
    closure = Closure(made(ToleranceEffect(1e-6), drawn=drawn))
    if len(drawn.inputs) > 1:
        inputs = (1.5,) * len(drawn.inputs)
    else:
        widest = max(closure.input_ranges, key=lambda r: r.highest - r.lowest)
        inputs = (widest.lowest + 0.4 * (widest.highest - widest.lowest),)
    position = closure.position(*inputs)
    assert position.joints
    assert closure.residual(position) < 1e-12


def test_parallelogram_with_tolerance_no_longer_turns_fully():
    # A change point is a matter of exact lengths: the two assemblies no longer meet there.
    drawn = linkage_of('four_bar: {a: 0.3, b: 1.6, c: 0.3, d: 1.6}')
    follower = [Closure(drawn).position(pi * i / 50).joints[1] for i in range(101)]
    assert all(b > a for a, b in pairwise(follower[:50]))
    altered = Closure(made(ToleranceEffect(given={'coupler.B': (1e-3, 0.0)}), drawn=drawn))
    gaps = [altered.position(pi * i / 1000).gap for i in range(2001)]
    assert max(gaps) > 0.0
