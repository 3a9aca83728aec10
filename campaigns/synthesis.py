# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Four-bars designed back from their own pairs of angles.

Three crank angles of a random linkage and its rocker angles there go into Freudenstein's equation;
the lengths that it gives are compared with the lengths of the linkage. The rocker angles and
condition numbers are computed in balls of more than fifty digits. Errors are given in units of
the error that rounding the angles may cause.

Each linkage has a random generator of its own, seeded by the campaign's seed, its family and its
number. So the result does not depend on how the work is shared, and any linkage can be made again.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import metadata
from math import acos, cos, hypot, pi, sin
from random import Random
from typing import Any, NamedTuple

from bench.report import say, show as show_table, Table
from campaigns.campaign import Findings, Part, parts_of, tallies_of
from campaigns.tally import Judgement, Quantity, Tally
from flint import arb, arb_mat, ctx
from linkage_ros.tools.design import three_pairs
from linkage_ros.tools.design.pairs.freudenstein import TRUSTED
import numpy as np

PRECISION = 384
"""In bits. A cluster of 1e-9 rad costs digits twice; more than fifty are left."""


class Truth(NamedTuple):
    """Three pairs of one linkage."""

    rocker: tuple[float, ...]  # Its three angles, rounded to doubles, in [rad]
    # Σ|x ∂L/∂x| + ``abs(L)`` of crank, coupler and rocker over the six angles.
    sensitivity: tuple[float, ...]


def truth(lengths: Sequence[float], crank: Sequence[float], sides: Sequence[int]) -> Truth | None:
    """
    Return the rocker angles and the sensitivity of the lengths; None where the loop is open.

    The lengths are those of crank, coupler and rocker, the first and the last signed, for a ground
    of 1. At each of three crank angles the side is 1 if the pin B lies left of A→O4, −1 if right.
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
    """Return cos φ and sin φ from the triangle of A, B and O4; None where it is open."""
    x, y = 1 - a * cosine, -a * sine
    square = x * x + y * y
    along = (c * c - b * b + square) / 2
    height = c * c * square - along * along
    if not height > 0:
        return None
    # The foot of B lies at ``along`` from O4 towards A.
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
    """F = 0 in the three pairs: ∂L/∂x = −J⁻¹·∂F/∂x."""
    inverse = arb_mat([row[:3] for row in rows]).inv()
    changes = [
        abs(by_crank * crank) + abs(by_rocker * rocker)
        for (*_, by_crank, by_rocker), crank, rocker in zip(
            rows, angles[:3], angles[3:], strict=True
        )
    ]
    return tuple(
        float(sum(abs(inverse[j, i]) * changes[i] for i in range(3)) + abs(length))
        for j, length in enumerate(lengths)
    )


Lengths = tuple[float, float, float]
"""Crank, coupler and rocker for a ground of 1; crank and rocker have a sign."""

Angles = tuple[float, ...]


class Case(NamedTuple):
    """A linkage, three crank angles, the side of A→O4 on which B lies at each, and the truth."""

    lengths: Lengths
    crank: Angles
    sides: tuple[int, ...]
    truth: Truth


class Family(NamedTuple):
    """
    Random linkages with a common difficulty; three crank angles may leave them open.

    If ``mixed``, each angle has its own assembly.
    """

    description: str
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
    """Return the smallest and the largest |crank angle| at which the linkage closes."""
    a, b, c = lengths
    ends = [(1 + a * a - reach * reach) / (2 * a) for reach in (b + c, b - c)]
    if min(ends) > 1 or max(ends) < -1:
        return None
    return acos(min(max(ends), 1.0)), acos(max(min(ends), -1.0))


def _anywhere(rng: Random, lengths: Lengths) -> Angles:
    """Draw uniformly from the range of the crank."""
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
    """Return a function that draws each angle near one of some places."""

    def angles(rng: Random, lengths: Lengths) -> Angles:
        del lengths
        return tuple(rng.choice(places) + _sign(rng) * _power(rng, -8, 0) for _ in range(3))

    return angles


def _at_limits(rng: Random, lengths: Lengths) -> Angles:
    """Draw angles near toggles of coupler and rocker, if the linkage has toggles."""
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


def make(seed: int, family: str, index: int) -> Case:
    """Return a linkage of a family."""
    return draw(FAMILIES[family], Random(f'{seed}/{family}/{index}'))


# Errors of a length, in units of roundoff times sensitivity, by the sensitivity that the result
# gives, lengths dominated by second derivatives left out; by that of the true linkage; and
# relative to the loss that the result gives. Then the ratio of the two sensitivities, inverted
# too.
WORST, TRUE, LOST, ABOVE, BELOW = ERRORS = ('worst', 'true', 'lost', 'above', 'below')


def judge_part(part: Part) -> Iterator[tuple[int, Judgement]]:
    """
    Synthesise all linkages of a part from their pairs at once, and compare.

    A linkage is flagged if the result trusts no digit of some length; the errors are those of the
    others. ``millidigits`` are the trusted digits of their least trusted lengths, in thousandths.
    """
    cases = [make(part.seed, part.family, number) for number in part.numbers]
    result = three_pairs([case.crank for case in cases], [case.truth.rocker for case in cases])
    off = np.abs(result.lengths - [case.lengths for case in cases])
    kappa = np.array([case.truth.sensitivity for case in cases])
    trusted = np.flatnonzero((result.reliable_digits > 0.0).all(1))
    judged = Judgement(Counter(cases=len(cases), flagged=len(cases) - len(trusted)))
    if len(trusted):
        off, kappa = off[trusted], kappa[trusted]
        sensitivity = result.sensitivity[trusted]
        lost = result.lost_digits[trusted] * np.abs(result.lengths[trusted])
        linear = lost < 2.0 * TRUSTED * _ROUNDOFF * sensitivity
        digits = result.reliable_digits[trusted].min(1).sum()
        judged.counts['millidigits'] = round(1e3 * float(digits))
        for name, errors in zip(
            ERRORS,
            (
                np.where(linear, off / sensitivity, 0.0) / _ROUNDOFF,
                np.where(linear, off / kappa, 0.0) / _ROUNDOFF,
                off / lost,
                sensitivity / kappa,
                kappa / sensitivity,
            ),
            strict=True,
        ):
            # A length that is not a number is as wrong as can be.
            worst = np.nan_to_num(errors, nan=np.inf).max(1)
            pairs = zip(trusted.tolist(), worst.tolist(), strict=True)
            judged.errors[name] = [(case, 0, error) for case, error in pairs]
    yield part.first, judged


def parts(cases: int, seed: int, families: list[str]) -> list[Part]:
    """Return the work for a number of linkages of each family."""
    return parts_of(seed, dict.fromkeys(families, cases), _PART)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this campaign."""
    parser.add_argument('--cases', type=int, default=100_000, help='linkages of each family')


def run(options: argparse.Namespace) -> Findings:
    """Design linkages back from their pairs."""
    work = parts(options.cases, options.seed, options.only)
    tallies = tallies_of(judge_part, work, options.jobs, 'linkages')['']
    cases = f'{sum(part.size for part in work):,}'
    facts = ('cases', cases), ('python-flint', metadata.version('python-flint'))
    families = [(name, family.description) for name, family in FAMILIES.items()]
    named = Table('Families', ('family', 'description'), [*families])
    faults = [
        f'{family}: {name} {errors.greatest():.3g} of linkage {linkage_of(errors)}'
        for family, tally in tallies.items()
        for name, most in ((WORST, TRUSTED), (LOST, 1.0))
        if (errors := tally.quantities.get(name, Quantity())).greatest() > most
    ]
    return Findings([_errors(tallies), named], faults, facts)


def linkage_of(errors: Quantity) -> int:
    """Return the number of the linkage with the greatest error."""
    return errors.worst[0].linkage + errors.worst[0].case


def _errors(tallies: Mapping[str, Tally]) -> Table:
    table = Table(
        'Errors of lengths, in 2⁻⁵³·sensitivity',
        ('family', 'linkages', 'flagged', 'mean digits', 'worst', 'linkage',
         'by true sensitivity', 'ratio', 'relative to loss'),
    )  # fmt: skip
    for family, tally in tallies.items():
        counts = tally.counts
        worst, true, lost, above, below = (
            tally.quantities.get(name, Quantity()) for name in ERRORS
        )
        trusted = counts['cases'] - counts['flagged']
        table.rows.append(
            [
                family,
                f'{counts["cases"]:,}',
                f'{counts["flagged"]:,}',
                f'{1e-3 * counts["millidigits"] / trusted:.1f}' if trusted else '',
                f'{worst.greatest():.3g}',
                str(linkage_of(worst)) if trusted else '',
                f'{true.greatest():.3g}',
                f'{1.0 / below.greatest():.2f}–{above.greatest():.2f}' if trusted else '',
                f'{lost.greatest():.2f}',
            ]
        )
    return table


def show(options: argparse.Namespace) -> None:
    """Print a case with its lengths and their digits."""
    family, index = options.show[0], int(options.show[1])
    case = make(options.seed, family, index)
    result = three_pairs(case.crank, case.truth.rocker)
    table = Table(f'{family} {index}', ('', 'crank', 'coupler', 'rocker'))
    for name, numbers in (
        ('true length', case.lengths),
        ('synthesised', result.lengths),
        ('sensitivity', result.sensitivity),
        ('true sensitivity', case.truth.sensitivity),
        ('digits', result.reliable_digits),
    ):
        table.rows.append([name, *(f'{float(number):.17g}' for number in numbers)])
    show_table(table)
    say(f'crank {case.crank}')
    say(f'rocker {case.truth.rocker}')
    say(
        f'assemblies {case.sides}; condition {result.condition:.3g}, doubt '
        f'{result.system_sensitivity}'
    )
