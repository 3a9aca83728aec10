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


"""Families of random linkages with three crank angles each, by what makes them hard."""

from __future__ import annotations

from collections.abc import Callable
from math import acos, cos, hypot, pi, sin
from random import Random
from typing import NamedTuple

from campaigns.synthesis.reference import Truth, truth

Lengths = tuple[float, float, float]
"""Of crank, coupler and rocker on a ground of 1; the first and the last signed."""

Angles = tuple[float, ...]


class Case(NamedTuple):
    """A linkage, three crank angles, on which side of A→O4 the pin B lies, and the truth."""

    lengths: Lengths
    crank: Angles
    sides: tuple[int, ...]
    truth: Truth


class Family(NamedTuple):
    """
    What is drawn at random, and why.

    Attributes
    ----------
    why
        What is hard about it.
    lengths
        Draws the links.
    angles
        Draws three crank angles; they need not close the linkage.
    mixed
        Whether each angle has an assembly of its own.

    """

    why: str
    lengths: Callable[[Random], Lengths]
    angles: Callable[[Random, Lengths], Angles]
    mixed: bool = False


def draw(family: Family, rng: Random) -> Case:
    """Draw until the linkage closes at all three angles."""
    while True:
        lengths = family.lengths(rng)
        if _reach(lengths) is None:
            continue
        for _ in range(4):
            sides = tuple(rng.choice((-1, 1)) for _ in range(3))
            sides = sides if family.mixed else sides[:1] * 3
            crank = family.angles(rng, lengths)
            found = truth(lengths, crank, sides)
            if found is not None:
                return Case(lengths, crank, sides, found)


def _power(rng: Random, lowest: float, highest: float) -> float:
    return float(10.0 ** rng.uniform(lowest, highest))


def _sign(rng: Random) -> int:
    return rng.choice((-1, 1))


def _even(rng: Random) -> Lengths:
    return _power(rng, -1, 1), _power(rng, -1, 1), _power(rng, -1, 1)


def _signed(rng: Random) -> Lengths:
    a, b, c = _even(rng)
    return a * _sign(rng), b, c * _sign(rng)


def _extreme(rng: Random) -> Lengths:
    return _power(rng, -4, 4), _power(rng, -4, 4), _power(rng, -4, 4)


def _long(rng: Random) -> Lengths:
    a, b = _power(rng, 1, 6), _power(rng, -1, 1)
    return a, b, a + rng.uniform(-1, 1) * (1 + b)


def _needle(rng: Random) -> Lengths:
    a, c = _power(rng, -1, 1), _power(rng, -1, 1)
    return a, abs(1 + a - c) * (1 + _power(rng, -9, -1)), c


def _change_point(rng: Random) -> Lengths:
    a, b, _ = _even(rng)
    off = 1 + _sign(rng) * _power(rng, -15, -2)
    if rng.random() < 0.3:
        return a, 1.0, a * off
    return a, b, max(abs(1 + _sign(rng) * a + _sign(rng) * b), 0.1) * off


def _short_coupler(rng: Random) -> Lengths:
    a, b, theta = _power(rng, -1, 1), _power(rng, -8, -1), rng.uniform(-pi, pi)
    return a, b, hypot(1 - a * cos(theta), a * sin(theta)) + b * rng.uniform(-1, 1)


def _parallel(rng: Random) -> Lengths:
    a = _power(rng, -1, 1)
    return a, 1 + _sign(rng) * _power(rng, -15, -1), a * (1 + _sign(rng) * _power(rng, -15, -1))


def _reach(lengths: Lengths) -> tuple[float, float] | None:
    """Return between which sizes of the crank angle it closes."""
    a, b, c = lengths
    ends = [(1 + a * a - reach * reach) / (2 * a) for reach in (b + c, b - c)]
    if min(ends) > 1 or max(ends) < -1:
        return None
    return acos(min(max(ends), 1.0)), acos(max(min(ends), -1.0))


def _anywhere(rng: Random, lengths: Lengths) -> Angles:
    """Evenly where the linkage closes."""
    low, high = _reach(lengths) or (0.0, pi)
    return tuple(_sign(rng) * rng.uniform(low, high) for _ in range(3))


def _cluster(lowest: float, highest: float) -> Callable[[Random, Lengths], Angles]:
    def angles(rng: Random, lengths: Lengths) -> Angles:
        middle, width = _anywhere(rng, lengths)[0], _power(rng, lowest, highest)
        return tuple(middle + width * rng.uniform(-1, 1) for _ in range(3))

    return angles


def _pair(rng: Random, lengths: Lengths) -> Angles:
    one, other, _ = _anywhere(rng, lengths)
    return one, one + _sign(rng) * _power(rng, -9, -1), other


def _about(*places: float) -> Callable[[Random, Lengths], Angles]:
    """Return what draws each angle near one of some places, at a distance of its own."""

    def angles(rng: Random, lengths: Lengths) -> Angles:
        del lengths
        return tuple(rng.choice(places) + _sign(rng) * _power(rng, -8, 0) for _ in range(3))

    return angles


def _at_limits(rng: Random, lengths: Lengths) -> Angles:
    """Near where coupler and rocker lie in line, which not all linkages come to."""
    limits = [end for end in _reach(lengths) or () if 0 < end < pi]
    found = list(_anywhere(rng, lengths))
    for i in range(3 if limits else 0):
        found[i] = _sign(rng) * (rng.choice(limits) + _sign(rng) * _power(rng, -12, -1))
    return tuple(found)


def _wound(rng: Random, lengths: Lengths) -> Angles:
    return tuple(t + rng.randint(-100, 100) * 2 * pi for t in _anywhere(rng, lengths))


FAMILIES = {
    'ordinary': Family('links of 0.1 to 10 grounds, angles anywhere', _even, _anywhere),
    'reversed links': Family('crank or rocker negative', _signed, _anywhere),
    'both assemblies': Family('each pair on an assembly of its own', _even, _anywhere, True),
    'clustered': Family('three crank angles within 1e-4 to 0.1 rad', _even, _cluster(-4, -1)),
    'one spot': Family('three crank angles within 1e-9 to 1e-4 rad', _even, _cluster(-9, -4)),
    'a pair': Family('two crank angles within 1e-9 to 0.1 rad', _even, _pair),
    'about nothing': Family('crank angles of 1e-8 to 1 rad', _signed, _about(0)),
    'ground line': Family('crank angles 1e-8 to 1 rad off 0 and ±π', _signed, _about(0, pi, -pi)),
    'upright': Family('crank angles as near to ±π/2', _even, _about(pi / 2, -pi / 2)),
    'wound': Family('crank angles of up to a hundred turns', _even, _wound),
    'at limits': Family('1e-12 to 0.1 rad from coupler and rocker in line', _even, _at_limits),
    'needles': Family('ground and crank flat on the others to 1e-9', _needle, _anywhere),
    'change points': Family('folding flat but for 1e-15 to 1e-2', _change_point, _anywhere),
    'parallelograms': Family('parallelograms but for 1e-15 to 0.1', _parallel, _anywhere),
    'short coupler': Family('couplers of 1e-8 to 0.1 grounds', _short_coupler, _anywhere),
    'long': Family('crank and rocker of 10 to a million grounds', _long, _anywhere),
    'extreme': Family('links of 1e-4 to 1e4 grounds', _extreme, _anywhere),
}
