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

"""Where the crank can turn: the ends of its range are where the loop stops closing."""

from __future__ import annotations

from cmath import rect
from math import pi, remainder
import random

from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import Input, Linkage, RevoluteJoint
from linkage_ros.kinematics.ranges import describe
from linkage_ros.kinematics.status import Status
from mpmath import mp, mpf
import pytest

from .linkages import four_bar_linkage, inverted_slider_crank_linkage
from .reference import four_bar, inverted_slider_crank, UNIT_ROUNDOFF

# Lengths a, b, c, d and what limits the crank: (folds, stretches).
FOUR_BARS = {
    'crank-rocker': ((2.0, 7.0, 9.0, 6.0), False, False),
    'double crank': ((5.0, 4.0, 6.0, 2.0), False, False),
    'parallelogram': ((1.0, 2.0, 1.0, 2.0), False, False),
    'stretches': ((6.0, 4.0, 5.0, 4.5), False, True),
    'folds': ((4.0, 8.0, 3.0, 6.0), True, False),
    'both': ((4.0, 5.5, 2.5, 5.0), True, True),
    'hardly opens': ((4.0, 1.0, 1.0 + 2**-20, 6.0 - 2**-22), False, True),
    'hardly does not stretch': ((4.0, 6.0, 3.0, 5.0 - 2**-40), True, False),
}
ERROR = 8.0
"""Limit for a range's ends, in u·κ."""


def end_of_range(a: float, b: float, c: float, d: float, span: str) -> tuple[mpf, mpf]:
    """Return the crank angle at which the diagonal is b + c, or |b - c| long, and its κ."""
    with mp.workdps(60):
        a, b, c, d = map(mpf, (a, b, c, d))
        limit = b + c if span == 'stretch' else abs(b - c)
        angle = mp.acos((a * a + d * d - limit * limit) / (2 * a * d))
        # Of a² + d² − 2ad·cos φ = limit², by each length:
        slope = a * d * mp.sin(angle)
        condition = (
            angle
            + (
                abs(a * (a - d * mp.cos(angle)))
                + abs(d * (d - a * mp.cos(angle)))
                + limit * (b + c)
            )
            / slope
        )
        return angle, condition


def test_the_table_says_what_limits_each_crank() -> None:
    for lengths, folds, stretches in FOUR_BARS.values():
        a, b, c, d = lengths
        assert folds == (abs(d - a) < abs(b - c))
        assert stretches == (a + d > b + c)


@pytest.mark.parametrize('name', FOUR_BARS)
def test_a_four_bar_s_range_ends_where_it_folds_and_stretches(name: str) -> None:
    lengths, folds, stretches = FOUR_BARS[name]
    check_ranges(lengths, folds, stretches)


def test_ranges_of_random_four_bars_end_where_they_fold_and_stretch() -> None:
    rng = random.Random(4)
    kinds = set()
    while len(kinds) < 4 or rng.random() > 1e-3:
        a, b, c, d = (10.0 ** rng.uniform(-1, 1) for _ in range(4))
        if 2 * max(a, b, c, d) < a + b + c + d:
            kinds.add((abs(d - a) < abs(b - c), a + d > b + c))
            check_ranges((a, b, c, d), abs(d - a) < abs(b - c), a + d > b + c)


def check_ranges(lengths: tuple[float, float, float, float], folds: bool, stretches: bool) -> None:
    """Compare the ranges with the reference's limit angles."""
    ranges = Closure(four_bar_linkage(lengths, 'left')).input_ranges
    for low, high, *_ in ranges:
        if not folds and not stretches:
            assert (low, high) == (-pi, pi)
    ends = [abs(end) for low, high, *_ in ranges for end in (low, high)]
    if folds:
        angle, condition = end_of_range(*lengths, 'fold')
        # Behind the far side of the ground a range goes on, up to the same angle beyond.
        near = [end if end <= pi else 2 * pi - end for end in ends]
        met = min(near, key=lambda end: abs(end - float(angle)))
        # The far end is written as 2π less the near one, and rounded at that size.
        assert abs(met - angle) < ERROR * UNIT_ROUNDOFF * (condition + 2 * mp.pi), lengths
    if stretches:
        angle, condition = end_of_range(*lengths, 'stretch')
        met = min(ends, key=lambda end: abs(end - float(angle)))
        assert abs(met - angle) < ERROR * UNIT_ROUNDOFF * condition, lengths
    assert len(ranges) == (2 if folds and stretches else 1)


@pytest.mark.parametrize('name', FOUR_BARS)
def test_a_loop_closes_inside_its_ranges_and_nowhere_else(name: str) -> None:
    lengths, _, _ = FOUR_BARS[name]
    closure = Closure(four_bar_linkage(lengths, 'right'))
    for i in range(1, 400):
        phi = -pi + i * pi / 200 + 1e-4
        inside = any(low <= phi + turn <= high for low, high, *_ in closure.input_ranges
                     for turn in (0.0, 2 * pi))  # fmt: skip
        status = closure.position(phi).status
        assert (status is not Status.OPEN) == inside
        assert inside == (four_bar(*lengths, phi, 1).gap <= 0)


@pytest.mark.parametrize(
    ('lengths', 'whole'),
    [
        ((0.15, 0.27, 0.02), True),
        ((0.27, 0.15, -0.12), True),
        ((0.15, 0.27, 0.2), False),
        ((0.2, 0.2, 0.3), False),
        ((0.2, 0.2, 0.0), True),
    ],
)
def test_a_rod_s_range_ends_where_it_cannot_reach_its_swivel(
    lengths: tuple[float, float, float], whole: bool
) -> None:
    closure = Closure(inverted_slider_crank_linkage(lengths, 'ahead'))
    ((low, high, *_),) = closure.input_ranges
    if whole:
        assert (low, high) == (-pi, pi)
        return
    a, d, h = lengths
    angle, condition = end_of_range(a, abs(h), 0.0, d, 'stretch')
    assert abs(low - angle) < ERROR * UNIT_ROUNDOFF * condition
    assert abs(high - (2 * mp.pi - angle)) < ERROR * UNIT_ROUNDOFF * (condition + 2 * mp.pi)
    for phi in (low - 1e-6, low + 1e-6, pi, high - 1e-6, high + 1e-6):
        expected = inverted_slider_crank(*lengths, phi, 1).gap <= 0
        assert (closure.position(phi).status is Status.CLOSED) == expected


@pytest.mark.parametrize('angle', [0.7, -2.0])
def test_ranges_are_of_the_input_joint_and_turn_with_its_frame(angle: float) -> None:
    lengths, _, _ = FOUR_BARS['both']
    plain = Closure(four_bar_linkage(lengths, 'left')).input_ranges
    turned = Closure(four_bar_linkage(lengths, 'left', {'crank': (0.1, 0.2, angle)})).input_ranges
    for (low, high, *_), (turned_low, turned_high, *_) in zip(plain, turned, strict=True):
        assert (turned_low, turned_high) == pytest.approx((low - angle, high - angle), abs=1e-14)


def test_ranges_are_told_in_words() -> None:
    words = {
        name: describe(Closure(four_bar_linkage(lengths, 'left')).input_ranges)
        for name, (lengths, _, _) in FOUR_BARS.items()
    }
    assert words['crank-rocker'] == 'every crank angle'
    angle, _ = end_of_range(*FOUR_BARS['stretches'][0], 'stretch')
    assert words['stretches'] == f'-{float(angle):.6g} to {float(angle):.6g} rad'
    assert words['both'].count(' to ') == 2
    assert ' or ' in words['both']


def carried(phi: float) -> complex:
    """Return where a point of the rocker of a crank-rocker lies, by two circles."""
    a, b, c, d = 2.0, 7.0, 9.0, 6.0
    pin = rect(a, phi)
    between = d - pin
    s = abs(between)
    along = (b * b - c * c + s * s) / (2.0 * s)
    joint = pin + between / s * complex(along, (b * b - along * along) ** 0.5)
    return d + (joint - d) * rect(0.6, 0.7)


def chain(one: float, other: float) -> Linkage:
    """Return that crank-rocker with a dyad of two lengths from the rocker to the ground."""
    point = rect(9.0 * 0.6, 0.7)
    return Linkage(
        links={
            'ground': {'O': (0.0, 0.0), 'D': (6.0, 0.0), 'E': (20.0, 4.0)},
            'crank': {'O': (0.0, 0.0), 'A': (2.0, 0.0)},
            'coupler': {'A': (0.0, 0.0), 'B': (7.0, 0.0)},
            'rocker': {'D': (0.0, 0.0), 'B': (9.0, 0.0), 'F': (point.real, point.imag)},
            'link': {'F': (0.0, 0.0), 'G': (one, 0.0)},
            'arm': {'E': (0.0, 0.0), 'G': (other, 0.0)},
        },
        inputs=(Input('crank_joint', 'ground', 'crank'),),
        assembly={'B': 'left', 'G': 'left'},
        joints={'arm_joint': RevoluteJoint('ground', 'arm')},
        sliders={},
    )


@pytest.mark.parametrize('narrow', [1e-4, 1e-8, 1e-10])
@pytest.mark.parametrize('gap', [False, True], ids=['a part', 'a gap'])
def test_what_is_narrower_than_the_samples_is_found(narrow: float, gap: bool) -> None:
    # The distance from the rocker's point to the ground's has one summit over the turn. A dyad
    # that reaches all but the last of it leaves a gap there; one that needs it closes only there.
    def distance(phi: float) -> float:
        return abs(20.0 + 4.0j - carried(phi))

    summit = max((2.0 * pi * i / 20_000 for i in range(20_000)), key=distance)
    for step in (1e-4, 1e-6, 1e-8):
        summit = max((summit + k * step for k in range(-100, 101)), key=distance)
    limit = distance(summit) - narrow
    lengths = (limit - 1.5, 1.5) if gap else (limit + 1.5, 1.5)
    closure = Closure(chain(*lengths))
    ends = []
    for side in (-1.0, 1.0):
        inside, outside = 0.0, 0.3
        for _ in range(60):
            middle = 0.5 * (inside + outside)
            higher = distance(summit + side * middle) > limit
            inside, outside = (middle, outside) if higher else (inside, middle)
        ends.append(summit + side * inside)
    found = [end for interval in closure.input_ranges for end in interval[:2]]
    for end in ends:
        assert min(abs(remainder(end - one, 2.0 * pi)) for one in found) < 1e-7
