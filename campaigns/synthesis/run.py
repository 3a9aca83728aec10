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
The round trips: pairs of a known linkage, as doubles, and the error of the synthesised one.

The rocker angles and condition numbers of the known linkage are computed in balls of more than
fifty digits. Each linkage has a generator of its own, seeded by the campaign's seed, its family
and its number: the result does not depend on how the work was shared, and any linkage can be made
again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import acos, cos, hypot, pi, sin
from random import Random
from typing import Any, NamedTuple

from campaigns.campaign import results_of
from flint import arb, ctx
from linkage_ros.synthesis.pairs.freudenstein import three_pairs, TRUSTED
import numpy as np
from numpy.typing import NDArray

PRECISION = 384
"""In bits: what a cluster of 1e-9 rad takes away twice still leaves more than fifty digits."""


class Truth(NamedTuple):
    """
    Three pairs of one linkage.

    Attributes
    ----------
    rocker
        Its three angles, as doubles nearest to the true ones, in [rad].
    sensitivity
        Σ|x ∂L/∂x| + ``abs(L)`` of crank, coupler and rocker over the six angles.

    """

    rocker: tuple[float, ...]
    sensitivity: tuple[float, ...]


def truth(lengths: Sequence[float], crank: Sequence[float], sides: Sequence[int]) -> Truth | None:
    """
    Return where the rocker stands, and what its angles tell of the lengths; None if it does not.

    Parameters
    ----------
    lengths
        Of crank, coupler and rocker, the first and the last signed; the ground is 1.
    crank
        Three crank angles, in [rad].
    sides
        For each the assembly: 1 where the pin B lies to the left of A→O4, −1 to the right.

    """
    ctx.prec = PRECISION
    a, b, c = map(arb, lengths)
    rocker, rows = [], []
    for theta, side in zip(crank, sides, strict=True):
        sine, cosine = arb(theta).sin_cos()
        placed = _rocker_direction(a, b, c, cosine, sine, side)
        if placed is None:
            return None
        x, y = placed
        rocker.append(arb.atan2(y, x))
        rows.append(_row(a, b, c, cosine, sine, x, y))
    angles = [arb(theta) for theta in crank] + rocker
    return Truth(tuple(map(float, rocker)), _sensitivity((a, b, c), angles, rows))


def _rocker_direction(
    a: Any, b: Any, c: Any, cosine: Any, sine: Any, side: int
) -> tuple[Any, Any] | None:
    """Return cos φ and sin φ from the triangle of A, B and O4; None where it does not close."""
    x, y = 1 - a * cosine, -a * sine
    square = x * x + y * y
    along = (c * c - b * b + square) / 2
    height = c * c * square - along * along
    if not height > 0:
        return None
    # From O4, along is laid off towards A.
    across = side * height.sqrt()
    return (-along * x - across * y) / (square * c), (across * x - along * y) / (square * c)


def _row(a: Any, b: Any, c: Any, cosine: Any, sine: Any, x: Any, y: Any) -> tuple[Any, ...]:
    """
    Return half of the gradient of F = v·v − b² by a, b, c, θ and φ.

    v = 1 + c·e^{iφ} − a·e^{iθ} is the coupler.
    """
    along, across = 1 + c * x - a * cosine, c * y - a * sine
    return (
        -(along * cosine + across * sine),
        -b,
        along * x + across * y,
        -a * (across * cosine - along * sine),
        c * (across * x - along * y),
    )


def _sensitivity(
    lengths: tuple[Any, ...], angles: list[Any], rows: list[tuple[Any, ...]]
) -> tuple[float, ...]:
    """F = 0 in the three pairs: ∂L/∂x = −J⁻¹·∂F/∂x, by cross products of the rows of J."""
    normals = []
    for i in range(3):
        (p, q, r, *_), (s, t, w, *_) = rows[(i + 1) % 3], rows[(i + 2) % 3]
        normals.append((q * w - r * t, r * s - p * w, p * t - q * s))
    determinant = sum(u * v for u, v in zip(rows[0][:3], normals[0], strict=True))
    return tuple(
        float(
            sum(
                abs(
                    normals[i][j] * (abs(rows[i][3] * angles[i]) + abs(rows[i][4] * angles[3 + i]))
                )
                for i in range(3)
            )
            / abs(determinant)
            + abs(length)
        )
        for j, length in enumerate(lengths)
    )


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
    The random quantities, and their purpose.

    Attributes
    ----------
    why
        Why it is hard.
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


_PART = 500
_ROUNDOFF = 2.0**-53


class Part(NamedTuple):
    """Some linkages of a family."""

    seed: int
    family: str
    first: int
    size: int


class Worst(NamedTuple):
    """An error in units of roundoff times sensitivity, and where it was met."""

    error: float
    linkage: int


NONE = Worst(0.0, -1)


@dataclass
class Tally:
    """
    The findings for a family.

    Attributes
    ----------
    cases
        Linkages.
    flagged
        Those of whose lengths no digit was trusted.
    digits
        The sum of the digits trusted, of the least trusted length of each that was not flagged.
    worst
        The greatest error of those not flagged, by the sensitivity that the result came with;
        lengths apart whose second derivatives count for more.
    worst_true
        The same by that of the true linkage, worked out from the loop in balls.
    worst_lost
        The greatest error of all that are not flagged, in what the result said may be lost.
    kappa
        How the first of these sensitivities was to the second, at least and at most.

    """

    cases: int = 0
    flagged: int = 0
    digits: float = 0.0
    worst: Worst = NONE
    worst_true: Worst = NONE
    worst_lost: Worst = NONE
    kappa: tuple[float, float] = (np.inf, 0.0)

    def merge(self, other: Tally) -> None:
        """Add the findings of another part of the campaign."""
        self.cases += other.cases
        self.flagged += other.flagged
        self.digits += other.digits
        self.worst = max(self.worst, other.worst)
        self.worst_true = max(self.worst_true, other.worst_true)
        self.worst_lost = max(self.worst_lost, other.worst_lost)
        self.kappa = min(self.kappa[0], other.kappa[0]), max(self.kappa[1], other.kappa[1])


def make(seed: int, family: str, index: int) -> Case:
    """Return a linkage of a family."""
    return draw(FAMILIES[family], Random(f'{seed}/{family}/{index}'))


def judge(cases: list[Case], first: int) -> Tally:
    """Synthesise linkages from their pairs, all at once, and compare."""
    found = three_pairs([case.crank for case in cases], [case.truth.rocker for case in cases])
    off = np.abs(found.lengths - [case.lengths for case in cases])
    kappa = np.array([case.truth.sensitivity for case in cases])
    told = np.flatnonzero((found.digits > 0.0).all(1))
    tally = Tally(len(cases), len(cases) - len(told))
    if len(told):
        off, kappa, said = off[told], kappa[told], found.sensitivity[told]
        lost, numbers = found.lost[told] * np.abs(found.lengths[told]), first + told
        linear = lost < 2.0 * TRUSTED * _ROUNDOFF * said
        tally.digits = float(found.digits[told].min(1).sum())
        tally.worst = _worst(np.where(linear, off / said, 0.0) / _ROUNDOFF, numbers)
        tally.worst_true = _worst(np.where(linear, off / kappa, 0.0) / _ROUNDOFF, numbers)
        tally.worst_lost = _worst(off / lost, numbers)
        tally.kappa = float((said / kappa).min()), float((said / kappa).max())
    return tally


def parts(cases: int, seed: int, families: list[str]) -> list[Part]:
    """Return the work for so many linkages of each family."""
    return [
        Part(seed, family, first, min(_PART, cases - first))
        for family in families
        for first in range(0, cases, _PART)
    ]


def do(part: Part) -> tuple[Part, Tally]:
    """Do one part."""
    numbers = range(part.first, part.first + part.size)
    return part, judge([make(part.seed, part.family, i) for i in numbers], part.first)


def run(
    work: list[Part], jobs: int, progress: Callable[[int], None] = lambda _: None
) -> dict[str, Tally]:
    """
    Run all parts and return the findings by family.

    Parameters
    ----------
    work
        The parts.
    jobs
        Number of processes; 1 runs in this one.
    progress
        Called with the number of linkages of each part that is done.

    """
    tallies: dict[str, Tally] = {part.family: Tally() for part in work}
    for part, tally in results_of(do, work, jobs):
        tallies[part.family].merge(tally)
        progress(part.size)
    return tallies


def _worst(errors: NDArray[np.float64], numbers: NDArray[np.intp]) -> Worst:
    # A length that is not a number is as wrong as can be.
    each = np.nan_to_num(errors, nan=np.inf).max(1)
    place = int(each.argmax())
    return Worst(float(each[place]), int(numbers[place]))
