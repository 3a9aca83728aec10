# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The chapters of docs/synthesis.md on rounding: a textbook example, and random designs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from itertools import pairwise
from math import ceil, log10, radians
from typing import NamedTuple

from linkage_ros.tools.design import assess, Design, exact_four_bar, three_pairs, ThreePairs
from mpmath import mp, mpf
import numpy as np

from .digits import (
    by_package,
    COUPLER,
    LARGEST_RATIO,
    links,
    MIDDLE,
    PRECISION,
    random_tasks,
    Rounded,
    SEED,
    SPAN,
    square_of_coupler,
    Task,
)
from .markdown import power, prose, row, table

COUNT = 3000
"""Number of random designs."""

COSINES = (3, 4, 5, 6, 8, 10, 12, 14, 16)
ANGLES = (0, 1, 2, 3, 4, 6)
SPANS = (20, 40, 70, 120)

CRANK, ROCKER = (25, 35, 50), (30, 40, 60)
LINKS = ('crank a', 'coupler b', 'rocker c')

PRINTED = ('5.598', '0.176', '4.88')
PRINTED_K = ('0.1786', '-0.2048', '1.0272')
PRINTED_DECIMALS = 4
"""The numbers printed in the textbook."""

PAIRS = ', '.join(f'{t}° → {p}°' for t, p in zip(CRANK, ROCKER, strict=True))

_NONE = 'does not close'


class Study(NamedTuple):
    """The effect of rounding on random designs."""

    # The designs by decimals of the cosines, and of the angles in degrees.
    cosines: Mapping[int, list[Rounded]]
    angles: Mapping[int, list[Rounded]]
    condition: np.ndarray  # The condition number of each
    span: np.ndarray  # The smaller of the two spans of each design, in degrees
    package: float  # The largest relative error of the package's lengths


@cache
def example() -> Task:
    """Return the exact design of the textbook example."""
    return Task(CRANK, ROCKER)


def printed() -> Rounded:
    """Return the errors of the printed lengths."""
    a, b, c = map(mpf, PRINTED)
    return example().judged((a, b, c))


def designed() -> tuple[Design, ThreePairs]:
    """Return the design by the package."""
    return exact_four_bar([radians(x) for x in CRANK], [radians(x) for x in ROCKER], 1.0)


def study() -> Study:
    """Round the random designs in all ways."""
    tasks = list(random_tasks(COUNT))
    condition, errors = by_package(tasks)
    span = [
        min(float(max(each) - min(each)) for each in (task.crank, task.rocker)) for task in tasks
    ]
    return Study(
        {n: [task.by_cosines(n) for task in tasks] for n in COSINES},
        {n: [task.by_angles(n) for task in tasks] for n in ANGLES},
        condition,
        np.array(span),
        float(errors.max()),
    )


def spread(found: Sequence[Rounded]) -> tuple[float, float, float]:
    """Return median, 95th percentile and greatest of the couplers' relative errors."""
    off = np.array([float(each.off[COUPLER]) for each in found])
    # The error of an impossible linkage is infinite, so percentiles are not interpolated.
    median, most = (float(np.quantile(off, part, method='higher')) for part in (0.5, 0.95))
    return median, most, float(off.max())


def introduction() -> Iterator[str]:
    """Yield the introduction and its example."""
    task = example()
    yield from prose(f"""
        # What accuracy costs in design work

        This page is made by `make synthesis`, which works out every number in it; do not edit it.

        The example is a bad design, which shows rounding at its worst. For a sound one begin with
        [Design by synthesis](how_to/design.md), or with
        [the four-bars below](#four-bars-by-kind-of-task).

        A textbook designs a four-bar whose crank and rocker pass three pairs of angles,
        {PAIRS}, on a ground of length 1. Freudenstein's equation,
    """)
    yield from (
        '```text',
        'k1·cos φ + k2·cos θ + k3 = cos(θ − φ)',
        'k1 = d/a,  k2 = −d/c,  k3 = (a² − b² + c² + d²)/(2ac)',
        '```',
        '',
    )
    yield from prose(f"""
        is linear in k1, k2 and k3, so three pairs give three equations. The text takes its
        cosines with {PRINTED_DECIMALS} decimals, calculates by hand, and prints a linkage. The
        table compares it with the exact one:
    """)
    yield from table('', '>in print', '>exact', '>in print off by')
    for name, text, value in zip(('k1', 'k2', 'k3'), PRINTED_K, task.k, strict=True):
        yield row(name, _signed(text), _digits(value), _percent(abs(mpf(text) / value - 1)))
    for name, text, value, off in zip(LINKS, PRINTED, task.lengths, printed().off, strict=True):
        yield row(name, text, _digits(value), _percent(off))
    yield ''
    yield from prose(f"""
        The exact column is computed with {PRECISION} digits; `linkage synthesize {_command()}`
        gives as many of them as a double holds.
    """)


def by_hand() -> Iterator[str]:
    """Yield the reason for the error of the coupler."""
    task = example()
    a, _, c = task.lengths
    square = square_of_coupler(task.k)
    parts = a**2 + c**2 + 1
    half = mpf(10) ** -PRINTED_DECIMALS / 2
    change = 2 * a * c * half
    from_printed_k = links(list(map(mpf, PRINTED_K)))
    assert from_printed_k is not None, 'its coupler is real'
    long, _, short = map(mpf, PRINTED)
    from_printed_links = mp.sqrt(square_of_coupler((1 / long, -1 / short, mpf(PRINTED_K[2]))))
    condition = float(three_pairs(*map(np.radians, (CRANK, ROCKER))).condition)
    yield from prose(f"""
        ## Why the coupler suffers

        Crank and rocker are long and the coupler is short. Its length comes from b² = a² + c² +
        d² − 2ac·k3, a small difference of large numbers: {_short(parts, 4)} less
        {_short(parts - square, 4)} leaves {_short(square, 3)}. Half a unit in decimal
        {PRINTED_DECIMALS} of k3 moves b² by {_short(change, 2)}, which is
        {_percent(change / square)} of it. So {PRINTED_DECIMALS} decimals do not fix b: the text's
        own k1, k2 and k3 give {_short(from_printed_k[COUPLER], 3)}, its own a, c and k3 give
        {_short(from_printed_links, 3)}, and it prints {PRINTED[COUPLER]}.

        The system of equations loses digits too. Its condition number is {condition:.0f}: about
        {log10(condition):.1f} digits are lost in it before the coupler is computed.
    """)


def decimals() -> Iterator[str]:
    """Yield the tables of the example: decimals against error."""
    task = example()
    yield from prose(f"""
        ## Decimals against error

        Now one step is rounded, and all others are done with {PRECISION} digits. *Cosines*: all
        nine are rounded to a number of decimals, as in the text. *k*: the cosines are exact, and
        k1, k2 and k3 are rounded before the lengths are computed from them. In practice the error
        of the rocker matters: the linkage with these lengths is analysed again, and the column
        gives the greatest error of its rocker at the three crank angles.
    """)
    yield (
        '![Decimals of the cosines against the relative errors of the lengths, and against the '
        'error of the rocker at the three pairs, both on log axes](synthesis/digits.svg)'
    )
    yield ''
    yield from table(
        '>decimals', '>cosines: a off by', '>b off by', '>c off by', '>rocker off by',
        '>k: b off by', '>rocker off by',
    )  # fmt: skip
    for n in range(3, 17):
        cosines, coefficients = task.by_cosines(n), task.by_coefficients(n)
        yield row(
            n, *map(_error, cosines.off), _angle(cosines.missed),
            _error(coefficients.off[COUPLER]), _angle(coefficients.missed),
        )  # fmt: skip
    four, by_print = task.by_cosines(PRINTED_DECIMALS), printed()
    assert four.lengths is not None, 'it is a linkage'
    a, b, c = (_short(x, 5) for x in four.lengths)
    assert not four.reached[0], 'the text below says so'
    yield ''
    yield from prose(f"""
        Cosines of {PRINTED_DECIMALS} decimals, and no other rounding, make a linkage of a =
        {a}, b = {b} and c = {c}, which cannot be assembled with its crank at {CRANK[0]}°: this
        lies next to the end of its range, as will be seen. The linkage in print misses the pairs
        by {_angle(by_print.missed)} at most, although the error of its coupler is
        {float(by_print.off[COUPLER] / four.off[COUPLER]):.1f} times as large: it happens to close
        there.

        The angles themselves are known to a number of decimals of a degree, from a drawing, a dial
        or an encoder. If each of the six has an error of half a unit of the last decimal, up or
        down, these are the greatest errors of the result:
    """)
    yield from table(
        '>decimals of a degree', '>a off by', '>b off by', '>c off by', '>rocker off by'
    )
    for n in ANGLES:
        worst = task.by_worst_angles(n)
        yield row(n, *map(_error, worst.off), _angle(worst.missed))
    yield ''
    yield from prose("""
        No arithmetic can reduce these errors. They also show how exactly the links need to be
        made: no better than the angles are known.
    """)


def at_random(study: Study) -> Iterator[str]:
    """Yield the tables of the random designs."""
    condition = study.condition
    yield from prose(f"""
        ## {COUNT:,} other designs

        Is the example an exception? {COUNT:,} designs were drawn at random (NumPy's default
        generator, seed {SEED}): crank and rocker start at any angle and turn by {SPAN[0]:g} to
        {SPAN[1]:g}° in either direction, and the middle pair lies at {MIDDLE[0]:g} to
        {MIDDLE[1]:g} of each turn; all distributions are uniform. Pairs that need a link of more
        than {LARGEST_RATIO:g} grounds, or of less than a {LARGEST_RATIO:g}th of one, were drawn
        again. The tables give the relative error of the coupler, and the share of linkages that do
        not close at a pair:
    """)
    yield from table(
        '>cosines rounded to', '>median', '>95th percentile', '>greatest', '>do not close'
    )
    for n, each in study.cosines.items():
        yield row(f'{n} decimals', *map(_error, map(mpf, spread(each))), _share(each))
    yield ''
    yield from table(
        '>angles rounded to', '>median', '>95th percentile', '>greatest', '>do not close'
    )
    for n, each in study.angles.items():
        name = 'whole degrees' if n == 0 else f'{n} decimal{"s" if n > 1 else ""} of a degree'
        yield row(name, *map(_error, map(mpf, spread(each))), _share(each))
    yield ''
    yield from prose(f"""
        Each additional decimal reduces the error by one digit, for every design. The number of
        digits lost beforehand depends on the task, and follows from the condition number: its
        median is
        {np.median(condition):.3g}, its 95th percentile {np.quantile(condition, 0.95):.3g}, the
        greatest {condition.max():.2g}. It grows as the pairs come nearer to each other:
    """)
    yield from table(
        '>smaller of the two turns', '>designs', '>condition, median', '>95th percentile'
    )
    for low, high in pairwise(SPANS):
        part = condition[(study.span >= low) & (study.span < high)]
        yield row(
            f'{low} to {high}°', len(part), f'{np.median(part):.3g}',
            f'{np.quantile(part, 0.95):.3g}',
        )  # fmt: skip
    bound = 10.0 ** ceil(log10(study.package))
    yield ''
    yield from prose(f"""
        The package computes differences of cosines as products of sines, and determinants with
        the errors of their products. For these {COUNT:,} tasks its lengths in double precision
        have relative errors below {power(bound)}: the rounding of the answer and no more.
        `linkage synthesize` gives for each design the number of digits that can be trusted.
    """)


def on_the_bench() -> Iterator[str]:
    """Yield the chapter on the defect of the exact solution."""
    design, _ = designed()
    found = assess(design)
    sides = {side: [t for t, met in zip(CRANK, found.met, strict=True) if met.side == side]
             for side in ('left', 'right')}  # fmt: skip
    assemblies = ', '.join(
        f'{" and ".join(f"{t}°" for t in cranks)} on the {side} one'
        for side, cranks in sides.items() if cranks
    )  # fmt: skip
    assert found.defects, 'the text below says so'
    yield from prose(f"""
        ## And it does not run

        So the lengths are correct to the last digit, and the linkage is still useless. A four-bar
        has two assemblies, and its crank cannot move it from one to the other. All three pairs are
        met, but not by the same one: {assemblies}. `linkage synthesize` names the defect:
    """)
    yield from (f'> **{defect.name}**: {defect.text}' for defect in found.defects)
    yield ''
    yield (
        '![The linkage at its three positions, the third in the other assembly; beside it the '
        "rocker's angle over the crank's](synthesis/example.svg)"
    )
    yield ''
    yield from prose(f"""
        The first pair lies right beside an end of the crank's range, where a wrong digit opens
        the loop. The longest link is {found.link_ratio:.0f} times the shortest, and the
        transmission angle at the pairs is as small as {np.degrees(found.transmission):.1f}°. This
        linkage exists on paper only. Accuracy is needed to find this out, but it does not cure it.
        The cure is to leave something free, such as the zeros of crank and rocker
        (`--free-zeros`), and to state the requirements (`--usable`, `--min-transmission`).
    """)


def _command() -> str:
    return ' '.join(f'--pair {t} {p}' for t, p in zip(CRANK, ROCKER, strict=True))


def _digits(value: mpf) -> str:
    return _signed(mp.nstr(value, 20))


def _signed(text: str) -> str:
    return text.replace('-', '−')


def _short(value: mpf, digits: int) -> str:
    return _signed(mp.nstr(value, digits, strip_zeros=False))


def _percent(part: mpf) -> str:
    return f'{float(100 * part):.2g} %'


def _error(off: mpf) -> str:
    """Return a relative error with two digits, in percent where it is large."""
    if not mp.isfinite(off):
        return 'no linkage'
    percent = 100.0 * float(off)
    if percent >= 100.0:
        return f'{round(percent, 1 - int(log10(percent))):,.0f} %'
    if percent >= 0.05:
        return f'{percent:#.2g} %'.replace('. %', ' %')
    return power(float(off))


def _angle(missed: mpf) -> str:
    if not mp.isfinite(missed):
        return _NONE
    value = float(missed)
    return f'{value:.2g}°' if value >= 0.0005 else f'{power(value)}°'


def _share(found: Sequence[Rounded]) -> str:
    part = sum(not mp.isfinite(each.missed) for each in found) / len(found)
    return f'{100.0 * part:.1f} %'
