# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Errors of the kinematics, in millions of cases.

Random linkages of all dyads and of chains of three, and known hard cases, are compared with a
reference of more than fifty digits. Errors are given in units of the error that rounding the
inputs may cause.

Each linkage has a random generator of its own, seeded by the campaign's seed, its family and its
number. So the result does not depend on how the work is shared, and any linkage can be made again.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from importlib import metadata
from math import ceil
from pathlib import Path
import random
from typing import Any

from bench.report import Table
from campaigns.accuracy.adversarial import ADVERSARIAL
from campaigns.accuracy.dyads import is_nearly_paired
from campaigns.accuracy.judge import answer_of, AT_TOGGLE, FAULTS, judge
from campaigns.accuracy.mechanism import Mechanism
from campaigns.accuracy.random_families import ANGLES, RANDOM
from campaigns.accuracy.reference import condition_numbers, margins, Reference
from campaigns.campaign import Findings, Page, Part, parts_of, show_results, tallies_of
from campaigns.series import FACTORIALS, UNIT_ROUNDOFF
from campaigns.tally import edges, Judgement, OCTAVE, QUANTITIES, Tally
from linkage_ros.description import linkage_text
from linkage_ros.kinematics import Closure, SlideJoint
import numpy as np

PAGE = Page(
    Path('docs/accuracy/campaign.md'),
    'Accuracy campaign',
    """
Made by `make accuracy`.

![Errors of all cases](campaign.svg)

An error is given in units of u·κ. Here u = 2⁻⁵³ and κ = Σ|xᵢ ∂y/∂xᵢ| + |y|; the sum goes over all
coordinates, lengths and directions xᵢ, the input angle (within (-π, π]), its rate (1 rad/s) and
its acceleration (normally distributed, 1 rad/s²). A published angle counts as at least π, or as
its published value if that is larger; for a joint between two moving links, the angles of both
count. Each dyad rounds the angles, slides and pins that it passes to the next one, with their
rates and accelerations; each of these counts as an xᵢ with its own κ (`reference.py` has the
theorem). Lengths that make a change point are varied together, so that the change point remains;
the κ of a rate is then at least that of the crank. For a joint that does not move, κ is 1. The
limit is 4.

- *closed*: the states that are compared. *open*: the package and the reference agree that the loop
  is open. *at limit*: the distance to a toggle is less than 16 u times all lengths, or times the
  condition number of that distance; any status is right there. Positions of such cases that the
  package reports as a toggle have a table of their own (limit 32).
- *wrong*: another assembly. *missed*: reported as open, but closed. *false*: reported as closed,
  but open. *refused*: regular, but reported as a toggle or indeterminate. *crashed*: an exception.
""",
)


LIMIT, TOGGLE = 4.0, 32.0
"""Greatest errors in u·κ; the latter of positions at a toggle."""

FAMILIES = {
    **{
        family: f'one random {family} dyad on a crank'
        if len(family) == 3
        else 'three random dyads'
        for family in RANDOM
    },
    **{family: hard.difficulty for family, hard in ADVERSARIAL.items()},
}
"""The description of each family."""

_PART = 20
"""Number of linkages in a part: about a tenth of a second's work."""


def make(seed: int, family: str, index: int) -> tuple[Mechanism, list[float], list[float]]:
    """
    Return a linkage of a family with its input angles and accelerations.

    A four-bar that is nearly a parallelogram or a kite passes the change points of that linkage,
    not those of its lengths (docs/conventions.md). The reference knows only lengths, so another
    linkage is drawn; about one in a thousand.
    """
    rng = random.Random(f'{seed}/{family}/{index}')
    generate = RANDOM[family][1] if family in RANDOM else ADVERSARIAL[family].make
    mechanism, phi = generate(rng)
    while is_nearly_paired(mechanism):
        mechanism, phi = generate(rng)
    return mechanism, phi, [rng.gauss(0.0, 1.0) for _ in phi]


def parts(cases: int, adversarial: int, seed: int) -> list[Part]:
    """Return the work for at least so many random and so many adversarial cases."""
    shares = sum(share for share, _ in RANDOM.values())
    wanted = {
        family: ceil(cases * share / shares / ANGLES) for family, (share, _) in RANDOM.items()
    }
    for family in ADVERSARIAL:
        # All linkages of a family have as many angles as its first one.
        angles = len(make(seed, family, 0)[1])
        wanted[family] = ceil(adversarial / len(ADVERSARIAL) / angles)
    return parts_of(seed, wanted, _PART)


def judge_part(part: Part) -> Iterator[tuple[int, Judgement]]:
    """Judge the linkages of a part."""
    for number in part.numbers:
        yield number, judge(*make(part.seed, part.family, number))


def accuracy_table(tallies: Mapping[str, Tally]) -> Table:
    """Return the 99.99th percentile and the worst error for each family and quantity."""
    heads = [f'{name}, {part}' for name in QUANTITIES for part in ('99.99 %', 'worst')]
    table = Table('Errors, in u·κ', ('family', *heads))
    for family, tally in tallies.items():
        errors = [tally.quantities.get(name) for name in QUANTITIES]
        texts = [each.texts(0.9999) if each else ('', '') for each in errors]
        table.rows.append([family, *(text for pair in texts for text in pair)])
    return table


def status_table(tallies: Mapping[str, Tally]) -> Table:
    """Return the number of cases by status."""
    table = Table('Statuses, in cases', ('family', 'cases', 'closed', 'open', 'at limit', *FAULTS))
    total = Tally()
    for tally in tallies.values():
        total.counts += tally.counts
    for family, tally in [*tallies.items(), ('all', total)]:
        table.rows.append([family, *(f'{tally.counts[name]:,}' for name in table.head[1:])])
    return table


def toggle_table(tallies: Mapping[str, Tally]) -> Table:
    """Return the errors of positions that are reported at a toggle."""
    table = Table('Positions at a toggle, in u·κ', ('family', 'positions', '99.99 %', 'worst'))
    for family, tally in tallies.items():
        if errors := tally.quantities.get(AT_TOGGLE):
            table.rows.append([family, f'{errors.count():,}', *errors.texts(0.9999)])
    return table


def worst_table(tallies: Mapping[str, Tally], over: float) -> Table:
    """Return the cases whose error is above a limit, and those with a fault."""
    table = Table(
        'Cases above the limit (--show FAMILY LINKAGE:CASE)', ('family', 'linkage:case', 'finding')
    )
    for family, tally in tallies.items():
        for quantity, errors in tally.quantities.items():
            for worst in errors.worst:
                if not -worst.minus_error <= over:
                    text = f'{quantity} of joint {worst.joint}: {-worst.minus_error:.3g} u·κ'
                    table.rows.append([family, f'{worst.linkage}:{worst.case}', text])
        for name, note in tally.findings():
            table.rows.append([family, f'{note.linkage}:{note.case}', f'{name} {note.text}'])
    return table


_SHOWN = (2.0**-12, 2.0**7)


def draw(tallies: Mapping[str, Tally], file: Path, limit: float) -> None:
    """Draw the distribution of the errors of each family, its worst error and a limit [u·κ]."""
    # Imported here: the processes that share the work import this module too.
    import matplotlib as mpl
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    mpl.rcParams['svg.hashsalt'] = 'linkage_ros'
    families = list(tallies)
    figure = Figure(figsize=(13, 1.6 + 0.24 * len(families)), layout='constrained')
    panels = figure.subplots(1, len(QUANTITIES), sharey=True)
    # Four bins per octave are as fine as the eye can distinguish.
    step = OCTAVE // 4
    borders = edges()[::step]
    image: Any = None
    for axes, quantity in zip(panels, QUANTITIES, strict=True):
        rows = np.zeros((len(families), len(borders) - 1))
        for i, family in enumerate(families):
            errors = tallies[family].quantities.get(quantity)
            if errors is None:
                continue
            inner = errors.histogram[1:-1]
            coarse = inner[: len(inner) // step * step].reshape(-1, step).sum(axis=1)
            coarse = coarse[: rows.shape[1]].astype(float)
            coarse[np.searchsorted(borders, _SHOWN[0])] += errors.histogram[0]
            rows[i, : len(coarse)] = coarse / errors.count()
            if errors.greatest() > _SHOWN[1]:
                axes.plot(_SHOWN[1] / 1.15, i, 'r>', markersize=5)
            else:
                axes.plot(max(errors.greatest(), _SHOWN[0]), i, 'k|', markersize=8, mew=1.5)
        image = axes.pcolormesh(
            borders,
            np.arange(len(families) + 1) - 0.5,
            np.where(rows > 0, rows, np.nan),
            norm=LogNorm(1e-7, 0.3),
            cmap='viridis_r',
            rasterized=True,
        )
        axes.axvline(limit, color='crimson', linewidth=1)
        axes.set(xscale='log', xlim=_SHOWN, title=quantity, xlabel='error / (u·κ)')
        axes.grid(visible=True, axis='x', alpha=0.3)
    panels[0].set_yticks(range(len(families)), families)
    panels[0].set_ylim(len(families) - 0.5, -0.5)
    figure.colorbar(image, ax=panels, label='share of the errors', fraction=0.02)
    figure.suptitle(
        f'Errors of all cases; | the worst of a family (red: off the axis), red line {limit:g} u·κ'
    )
    file.parent.mkdir(parents=True, exist_ok=True)
    metadata = {'Date': None} if file.suffix == '.svg' else None
    figure.savefig(file, dpi=110, metadata=metadata)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this campaign."""
    parser.add_argument('--cases', type=int, default=10_000_000, help='random cases')
    parser.add_argument('--adversarial', type=int, default=1_000_000, help='hard cases')


def run(options: argparse.Namespace) -> Findings:
    """Compare the package with the reference; with its page, write the picture."""
    work = parts(options.cases, options.adversarial, options.seed)
    work = [part for part in work if part.family in options.only]
    tallies = tallies_of(judge_part, work, options.jobs, 'linkages').get('', {})
    cases = sum(tally.counts['cases'] for tally in tallies.values())
    facts = ('cases', f'{cases:,}'), ('python-flint', metadata.version('python-flint'))
    tables = [accuracy_table(tallies), status_table(tallies), toggle_table(tallies)]
    families = Table('Families', ('family', 'description'), [*FAMILIES.items()])
    tables += [worst_table(tallies, LIMIT), families]
    if options.write:
        draw(tallies, PAGE.file.with_suffix('.svg'), LIMIT)
    return Findings(tables, [*_faults_of(tallies)], facts)


def _faults_of(tallies: Mapping[str, Tally]) -> Iterator[str]:
    for family, tally in tallies.items():
        for name, errors in tally.quantities.items():
            if not errors.greatest() <= (TOGGLE if name == AT_TOGGLE else LIMIT):
                yield f'{family}: {name} {errors.greatest():.3g} u·κ'
        for name, note in tally.findings():
            yield f'{family} {note.linkage}:{note.case}: {name} {note.text}'


def show(options: argparse.Namespace) -> None:
    """Print a linkage with its results and, where the place is ``linkage:case``, all of a case."""
    family, place = options.show
    index, _, case = place.partition(':')
    mechanism, phi, alpha = make(options.seed, family, int(index))
    print(linkage_text(mechanism.linkage(), [f'{family} {index}, seed {options.seed}']))
    print(*mechanism.dyads, sep='\n')
    show_results(judge(mechanism, phi, alpha))
    if case:
        _show_case(Reference(mechanism), phi[int(case)], alpha[int(case)])


def _show_case(reference: Reference, phi: float, alpha: float) -> None:
    status, answer = answer_of(Closure(reference.mechanism.linkage()), phi, alpha)
    truth = reference.solve(phi, alpha)
    print(f'\nφ = {phi!r}, α = {alpha!r}: {status.name}')
    print(f'truth: {truth.outcome.name} at {truth.precision} bits')
    for dyad, (margin, tolerance) in zip(
        reference.mechanism.dyads, margins(reference, phi), strict=False
    ):
        print(f'{type(dyad).__name__}: margin to the next toggle {margin:.3g} (± {tolerance:.1g})')
    if not truth.joints:
        return
    kappa = UNIT_ROUNDOFF * condition_numbers(truth)
    for j, (name, joint) in enumerate(reference.mechanism.joints.items()):
        size = 2.0**truth.motion.exponent if isinstance(joint, SlideJoint) else 1.0
        for k, (quantity, found) in enumerate(zip(QUANTITIES, answer, strict=False)):
            exact = float(truth.joints[j][k]) * FACTORIALS[k] * size
            ours = found[j] if found else None
            print(f'{name} {quantity}: {exact!r}, package {ours!r}, u·κ {kappa[j, k] * size:.3g}')
