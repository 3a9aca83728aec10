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
``python -m campaigns.accuracy``: how far the kinematics are off, in millions of cases.

Random linkages of all dyads and of chains of three, and the hard cases that are known, against a
reference of more than fifty digits; errors in units of what rounding the inputs may cause.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from datetime import datetime
from importlib import metadata
from pathlib import Path
import sys
import time
from typing import Any

from bench.report import machine_table, say, show, Table, write_page
from campaigns.accuracy.adversarial import ADVERSARIAL
from campaigns.accuracy.judge import AT_TOGGLE, BINS, edges, FAULTS, OCTAVE, QUANTITIES, Tally
from campaigns.accuracy.random_families import RANDOM
from campaigns.accuracy.run import parts, run, show_case
from campaigns.campaign import progress_lines
import numpy as np

INTRO = """
Made by `make accuracy`.

![Errors of all cases](campaign.svg)

An error is given in units of u·κ: u = 2⁻⁵³, κ = Σ|xᵢ ∂y/∂xᵢ| + |y| over all coordinates, lengths
and directions xᵢ, the input angle (within (-π, π]), its rate (1 rad/s) and its acceleration
(normally distributed, 1 rad/s²). A published angle counts as π at least, and as it was published
where that is more; of a joint between two moving links both count. What a dyad hands on to the
next one is rounded, and counts as an xᵢ, with its own κ: angles, slides and pins, with their rates
and accelerations (`reference.py` has the theorem). Lengths that make a change point change
together, so that it stays one; their rates then count as the crank's at least. What does not move
at all counts as 1. The limit is 4.

- *closed*: compared; *open*: both say so; *at limit*: within 16 u of all lengths, or of the
  condition of what a dyad may reach farther, of a toggle: any status is right there. Positions
  reported at a toggle that are so near to it have a row of their own (limit 32).
- *wrong*: another assembly. *missed*: said to be open, but closes. *false*: said to close, but is
  open. *refused*: regular, but said to be a toggle or indeterminate. *crashed*: an exception.
"""


def accuracy_table(tallies: Mapping[str, Tally]) -> Table:
    """Return worst and 99.99th percentile per family and quantity."""
    table = Table(
        'Errors, in u·κ',
        ('family', *(f'{name}, {part}' for name in QUANTITIES for part in ('99.99 %', 'worst'))),
    )
    for family, tally in tallies.items():
        row = [family]
        for name in QUANTITIES:
            found = tally.quantities.get(name)
            row += (
                [f'{found.percentile(0.9999):.2f}', f'{found.greatest():.3g}']
                if found
                else ['', '']
            )
        table.rows.append(row)
    return table


def status_table(tallies: Mapping[str, Tally]) -> Table:
    """Return what was said of how many cases."""
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
        found = tally.quantities.get(AT_TOGGLE)
        if found:
            table.rows.append(
                [
                    family,
                    f'{found.count():,}',
                    f'{found.percentile(0.9999):.2f}',
                    f'{found.greatest():.3g}',
                ]
            )
    return table


def worst_table(tallies: Mapping[str, Tally], over: float) -> Table:
    """Return the cases that were off by more than so much, and those with a fault."""
    table = Table('To look at (--show FAMILY LINKAGE:CASE)', ('family', 'linkage:case', 'what'))
    for family, tally in tallies.items():
        for name, found in tally.quantities.items():
            for worst in found.worst:
                if not -worst.minus_error <= over:
                    what = f'{name} of joint {worst.joint}: {-worst.minus_error:.3g} u·κ'
                    table.rows.append([family, f'{worst.linkage}:{worst.case}', what])
        for note in tally.notes:
            table.rows.append([family, f'{note.linkage}:{note.case}', note.text])
    return table


def families_table() -> Table:
    """Return the description of each family."""
    table = Table('Families', ('family', 'what it is'))
    for family in RANDOM:
        what = f'one random {family} dyad on a crank' if len(family) == 3 else 'three random dyads'
        table.rows.append([family, what])
    for family, hard in ADVERSARIAL.items():
        table.rows.append([family, hard.why])
    return table


_SHOWN = (2.0**-12, 2.0**7)


def draw(tallies: Mapping[str, Tally], file: Path, limit: float) -> None:
    """
    Draw a row per family: how many of its errors lie where, and its worst.

    Parameters
    ----------
    tallies
        What was found.
    file
        Where to.
    limit
        Shown as a line, in u·κ.

    """
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
            found = tallies[family].quantities.get(quantity)
            if found is None:
                continue
            inner = found.histogram[1 : BINS - 1]
            coarse = inner[: len(inner) // step * step].reshape(-1, step).sum(axis=1)
            coarse = coarse[: rows.shape[1]].astype(float)
            coarse[np.searchsorted(borders, _SHOWN[0])] += found.histogram[0]
            rows[i, : len(coarse)] = coarse / found.count()
            if found.greatest() > _SHOWN[1]:
                axes.plot(_SHOWN[1] / 1.15, i, 'r>', markersize=5)
            else:
                axes.plot(max(found.greatest(), _SHOWN[0]), i, 'k|', markersize=8, mew=1.5)
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
    figure.colorbar(image, ax=panels, label='part of the errors', fraction=0.02)
    figure.suptitle(
        f'Errors of all cases; | the worst of a family (red: outside), red line: {limit:g} u·κ'
    )
    file.parent.mkdir(parents=True, exist_ok=True)
    metadata = {'Date': None} if file.suffix == '.svg' else None
    figure.savefig(file, dpi=110, metadata=metadata)


LIMIT = 4.0


def main() -> int:
    """Measure what the command line asks for and return the exit code."""
    parser = argparse.ArgumentParser('python -m campaigns.accuracy', description=__doc__)
    parser.add_argument('--cases', type=int, default=10_000_000, help='random cases')
    parser.add_argument('--adversarial', type=int, default=1_000_000, help='hard cases')
    parser.add_argument('--jobs', type=int, default=2, help='processes')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--only', nargs='+', metavar='FAMILY', help='only these families')
    parser.add_argument('--out', type=Path, default=Path('docs/accuracy'), help='folder')
    parser.add_argument(
        '--show', nargs=2, metavar=('FAMILY', 'LINKAGE[:CASE]'), help='make one case again'
    )
    arguments = parser.parse_args()
    families = [*RANDOM, *ADVERSARIAL]
    for family in [*(arguments.only or []), *(arguments.show or [])[:1]]:
        if family not in families:
            parser.error(f'no family {family!r}; there are: {", ".join(families)}')
    if arguments.show:
        show_case(arguments.seed, *arguments.show)
        return 0
    started, begin = time.monotonic(), datetime.now().astimezone()
    work = parts(arguments.cases, arguments.adversarial, arguments.seed)
    work = [part for part in work if not arguments.only or part.family in arguments.only]
    try:
        progress = progress_lines(sum(part.size for part in work), 'linkages')
        tallies = run(work, arguments.jobs, progress)
    except KeyboardInterrupt:
        say('stopped')
        return 130
    seconds = time.monotonic() - started
    cases = sum(tally.counts['cases'] for tally in tallies.values())
    machine = machine_table(
        begin,
        ('python-flint', metadata.version('python-flint')),
        ('seed', str(arguments.seed)),
        ('cases', f'{cases:,} in {seconds:.0f} s, {arguments.jobs} processes'),
    )
    tables = [
        accuracy_table(tallies),
        status_table(tallies),
        toggle_table(tallies),
        worst_table(tallies, LIMIT),
        machine,
    ]
    for table in tables:
        show(table)
    arguments.out.mkdir(parents=True, exist_ok=True)
    draw(tallies, arguments.out / 'campaign.svg', LIMIT)
    write_page(
        arguments.out / 'campaign.md', 'Accuracy campaign', INTRO, [*tables, families_table()]
    )
    return 0


if __name__ == '__main__':
    sys.exit(main())
