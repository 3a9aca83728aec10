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

"""Four-bars that are hard, each in its own way."""

from __future__ import annotations

from math import acos, cos, hypot, pi, radians, sin
import random

from campaigns.accuracy.loops import A, B, C, D, four_bar
from campaigns.accuracy.mechanism import Mechanism
from campaigns.accuracy.random_families import Case
import numpy as np

ANGLES = 10


def side(rng: random.Random) -> int:
    return rng.choice((1, -1))


def length(rng: random.Random, spread: float = 0.7) -> float:
    return float(10.0 ** rng.uniform(-spread, spread))


def tiny(rng: random.Random, least: float = -12.0, greatest: float = -3.0) -> float:
    """Return a small number of either sign."""
    return side(rng) * float(10.0 ** rng.uniform(least, greatest))


def textbook_divisor(rng: random.Random) -> Case:
    d = length(rng)
    a = d * (1.05 + length(rng))
    phi = side(rng) * acos(d / a)
    b, c = _reaching(rng, a, d, phi)
    off = [0.0, 1e-9, -1e-9, *(tiny(rng) for _ in range(ANGLES - 3))]
    return four_bar((a, b, c, d), side(rng)), [phi + small for small in off]


def parallelogram(rng: random.Random) -> Case:
    a, d = length(rng), length(rng)
    ties = ({A: a, C: a}, {B: d, D: d})
    loop = four_bar((a, d, a, d), side(rng), fold=True, stretch=True, ties=ties)
    return loop, [rng.choice((0.0, pi, -pi)) + tiny(rng) for _ in range(ANGLES)]


def folded_kite(rng: random.Random) -> Case:
    a, d = length(rng), length(rng)
    ties = ({A: a, B: a}, {C: d, D: d})
    loop = four_bar((a, a, d, d), side(rng), fold=True, stretch=True, ties=ties)
    return loop, [rng.choice((0.0, pi, -pi)) + tiny(rng) for _ in range(ANGLES)]


def kite_through_its_pivot(rng: random.Random) -> Case:
    a = length(rng)
    b = a * (0.1 + length(rng))
    ties = ({A: a, D: a}, {B: b, C: b})
    loop = four_bar((a, b, b, a), side(rng), fold=True, ties=ties)
    return loop, [tiny(rng) for _ in range(ANGLES)]


def single_change_point(rng: random.Random) -> Case:
    """Return lengths whose sums are exact, so that they make a change point exactly."""
    a, b, d = (rng.randrange(2**16, 2**20) / 2**18 for _ in range(3))
    if a == d or a + d - b <= 0 or b in (a, d):
        return single_change_point(rng)
    if rng.random() < 0.5:
        c, about = a + d - b, pi
        ties = ({A: a, C: a}, {B: b, C: -b}, {D: d, C: d})
        loop = four_bar((a, b, c, d), side(rng), stretch=True, ties=ties)
    else:
        sign = side(rng)
        c, about = b + sign * (a - d), 0.0
        if c <= 0:
            return single_change_point(rng)
        ties = ({A: a, C: sign * a}, {B: b, C: b}, {D: d, C: -sign * d})
        loop = four_bar((a, b, c, d), side(rng), fold=True, ties=ties)
    return loop, [about + tiny(rng) for _ in range(ANGLES)]


def almost_a_change_point(rng: random.Random) -> Case:
    a, b, d = (length(rng) for _ in range(3))
    about = rng.choice((0.0, pi))
    c = abs(a + d - b) if about else b + side(rng) * (a - d)
    if c < 0.01:
        return almost_a_change_point(rng)
    loop = four_bar((a, b, c * (1 + tiny(rng)), d), side(rng))
    return loop, [about + tiny(rng) for _ in range(ANGLES)]


def toggle(rng: random.Random) -> Case:
    a, d, phi = length(rng), length(rng), rng.uniform(-pi, pi)
    return _at_toggle(rng, a, d, phi, 1.5), [phi, *(phi + tiny(rng, -15) for _ in range(4))]


def needle(rng: random.Random) -> Case:
    a, d, phi = length(rng, 3), length(rng, 3), rng.uniform(-pi, pi)
    if rng.random() < 0.3:
        loop = _at_toggle(rng, a, d, phi, 6.0)
    else:
        s = hypot(d - a * cos(phi), a * sin(phi))
        b = s * length(rng, 6)
        c = abs(s - b) + 2 * min(s, b) * rng.random()
        loop = four_bar((a, b, c, d), side(rng))
    return loop, [phi, *(phi + tiny(rng, -9, 0) for _ in range(ANGLES - 1))]


def freudenstein(rng: random.Random) -> Case:
    """Return a four-bar by synthesis, for the source's three pairs of angles or near them."""
    pairs = ((25, 30), (35, 40), (50, 60))
    wander = rng.choice((0.0, 0.1, 3.0))
    cranks, rockers = (
        [radians(pair[i] + rng.uniform(-wander, wander)) for pair in pairs] for i in (0, 1)
    )
    rows = [[cos(r), -cos(c), 1.0] for c, r in zip(cranks, rockers, strict=True)]
    right = [cos(c - r) for c, r in zip(cranks, rockers, strict=True)]
    k1, k2, k3 = np.linalg.solve(rows, right).tolist()
    a, c = 1 / k1, 1 / k2
    square = a * a + c * c + 1 - 2 * a * c * k3
    if a <= 0 or c <= 0 or square <= 0:
        return freudenstein(rng)
    loop = four_bar((a, square**0.5, c, 1.0), side(rng))
    return loop, [*cranks, *(rng.uniform(min(cranks), max(cranks)) for _ in range(ANGLES - 3))]


def pins_meet(rng: random.Random) -> Case:
    a = length(rng)
    b = a * length(rng)
    loop = four_bar((a, b, b * (1 + tiny(rng)), a * (1 + tiny(rng))), side(rng))
    return loop, [tiny(rng) for _ in range(ANGLES)]


def _reaching(rng: random.Random, a: float, d: float, phi: float) -> tuple[float, float]:
    s = hypot(d - a * cos(phi), a * sin(phi))
    b = s * length(rng)
    return b, abs(s - b) + 2 * min(s, b) * rng.uniform(0.01, 0.99)


def _at_toggle(rng: random.Random, a: float, d: float, phi: float, spread: float) -> Mechanism:
    s = hypot(d - a * cos(phi), a * sin(phi))
    b = s * length(rng, spread)
    off = tiny(rng, -15)
    c = (s + b) * (1 + off) if b > s or rng.random() < 0.5 else (s - b) * (1 + off)
    return four_bar((a, b, c, d), side(rng))
