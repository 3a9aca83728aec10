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

"""The tables of a campaign, for the screen and for Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from bench.report import Table
from campaigns.accuracy.adversarial import ADVERSARIAL
from campaigns.accuracy.judge import AT_TOGGLE, QUANTITIES
from campaigns.accuracy.random_families import RANDOM
from campaigns.accuracy.tally import Tally

FAULTS = ('wrong', 'missed', 'false', 'refused', 'crashed')

LEGEND = """\
An error is given in units of u·κ: u = 2⁻⁵³, κ = Σ|xᵢ ∂y/∂xᵢ| + |y| over all coordinates, lengths
and directions xᵢ, the input angle (within (-π, π]), its rate (1 rad/s) and its acceleration
(normally distributed, 1 rad/s²). A published angle counts as π at least, and as it was published
where that is more; of a joint between two moving links both count. What a dyad hands on to the
next one is rounded, and counts as an xᵢ, with its own κ: angles, slides and pins, with their rates
and accelerations (`condition.py` has the theorem). Lengths that make a change point change
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
    """Return what each family is."""
    table = Table('Families', ('family', 'what it is'))
    for family in RANDOM:
        what = f'one random {family} dyad on a crank' if len(family) == 3 else 'three random dyads'
        table.rows.append([family, what])
    for family, hard in ADVERSARIAL.items():
        table.rows.append([family, hard.why])
    return table


def markdown(title: str, intro: Sequence[str], tables: Sequence[Table]) -> str:
    """Return the report as a Markdown page."""
    return '\n'.join([f'# {title}', '', *intro, '', LEGEND, *(t.markdown() for t in tables)])
