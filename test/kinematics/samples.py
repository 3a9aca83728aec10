# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Random loops, by family: each is hard in one way, and hard cases are as frequent as easy ones.

Every generator is seeded, so that a run repeats to the last bit. Linkages that are change points
but for the rounding of their lengths are left out: the package takes them for change points on
purpose (`test_change_points`).
"""

from collections.abc import Iterator
from fractions import Fraction
from math import cos, hypot, pi, sin
import random

FourBarCase = tuple[float, float, float, float, float, int]
"""a, b, c, d, φ and the side of A→D on which B lies."""

SliderCrankCase = tuple[float, float, float, float, int]
"""a, d, offset, φ and whether the swivel lies ahead (+1) or behind (-1)."""

ROUNDED = Fraction(1, 2**50)
"""What is closer to a change point than this, as a part of all lengths, may be taken for one."""

FOUR_BARS = {
    'any lengths': 'most do not close: no false closure, and the gap',
    'fold and stretch': 'a third lie within 1e-15 to 1 of a toggle',
    'needles': 'lengths that differ by up to 1e12 cancel in every sum',
    'short pair': 'coupler and rocker are short beside crank and ground, which cancel',
    'crank along ground': 'within 1e-15 to 1 rad of 0 and π the diagonal hardly turns',
    'wound crank': 'after 160,000 turns the angle itself has lost ten digits',
}

SLIDER_CRANKS = {
    'any lengths': 'most close',
    'swivel passed closely': 'crank as long as the ground, but for 1e-15 to 0.1 of it',
    'needles': 'lengths that differ by up to 1e12',
    'crank along ground': 'within 1e-15 to 1 rad of 0 and π, the rod turns fastest or slides',
    'wound crank': 'after 160,000 turns the angle itself has lost ten digits',
}


def four_bars(family: str, count: int) -> Iterator[FourBarCase]:
    """Yield four-bars of a family."""
    rng = random.Random(f'four-bar, {family}')
    for _ in range(count):
        a, d = 10.0 ** rng.uniform(-1, 1), 10.0 ** rng.uniform(-1, 1)
        b, c = 10.0 ** rng.uniform(-1, 1), 10.0 ** rng.uniform(-1, 1)
        spread = 6.0 if family == 'needles' else 1.0
        d *= 10.0 ** rng.uniform(1 - spread, spread - 1)
        phi = _crank(rng, family)
        if family == 'short pair':
            d, phi = a * (1 + _tiny(rng)), 10 * _tiny(rng)
        if family != 'any lengths':
            b, c = _two_links(rng, hypot(d - a * cos(phi), a * sin(phi)), spread)
        side = rng.choice((1, -1))
        if min(_sums(a, b, c, d)) > ROUNDED:
            yield a, b, c, d, phi, side


def inverted_slider_cranks(family: str, count: int) -> Iterator[SliderCrankCase]:
    """Yield inverted slider-cranks of a family; two in five have a straight rod."""
    rng = random.Random(f'inverted slider-crank, {family}')
    for _ in range(count):
        a, d = 10.0 ** rng.uniform(-1, 1), 10.0 ** rng.uniform(-1, 1)
        spread = 12.0 if family == 'needles' else 1.0
        d *= 10.0 ** rng.uniform(1 - spread, spread - 1)
        if family == 'swivel passed closely':
            d = a * (1 + rng.choice((1, -1)) * _tiny(rng))
        offset = rng.choice((1, -1)) * max(a, d) * 10.0 ** rng.uniform(-spread, 0)
        offset *= rng.random() < 0.6
        phi, side = _crank(rng, family), rng.choice((1, -1))
        if min(_sums(a, abs(offset), 0.0, d)) > ROUNDED:
            yield a, d, offset, phi, side


def _sums(a: float, b: float, c: float, d: float) -> list[Fraction]:
    """Return what the lengths miss a change point by, for each kind, as a part of their sum."""
    exact_a, exact_b, exact_c, exact_d = map(Fraction, (a, b, c, d))
    fold = abs(exact_a - exact_d) - abs(exact_b - exact_c)
    stretch = exact_a + exact_d - exact_b - exact_c
    return [abs(margin) / (exact_a + exact_b + exact_c + exact_d) for margin in (fold, stretch)]


def _two_links(rng: random.Random, s: float, spread: float) -> tuple[float, float]:
    """Return lengths of two links that span s: at random, nearly folded or nearly stretched."""
    b = s * 10.0 ** rng.uniform(-spread / 2, spread / 2)
    kind = rng.randrange(3)
    if kind == 0:
        return b, max(abs(s - b), s * 1e-12) * (1 + _tiny(rng))
    if kind == 1:
        return b, (s + b) * (1 - _tiny(rng) / 2)
    return b, abs(s - b) + 2 * min(s, b) * rng.random()


def _crank(rng: random.Random, family: str) -> float:
    if family == 'crank along ground':
        return rng.choice((0.0, pi, -pi)) + rng.choice((1, -1)) * 10 * _tiny(rng)
    return rng.uniform(-2 * pi, 2 * pi) * (160_000 if family == 'wound crank' else 1)


def _tiny(rng: random.Random) -> float:
    return 10.0 ** rng.uniform(-15, -1)
