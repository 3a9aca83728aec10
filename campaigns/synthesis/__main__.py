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
``python -m campaigns.synthesis``: linkages designed back from their own pairs, by the 100,000.

Three crank angles of a random linkage and the rocker's angles there, rounded to doubles from more
than fifty digits, go into Freudenstein's equation; the lengths that come out are compared with
those that it was. Errors in units of what rounding the angles may cause.
"""

from __future__ import annotations

import argparse
from datetime import datetime
from importlib import metadata
import sys
import time

from bench.report import machine_table, say, show, Table
from campaigns.campaign import progress_lines
from campaigns.synthesis.run import FAMILIES, make, parts, run, Tally
from linkage_ros.synthesis.pairs.freudenstein import links, three_pairs, TRUSTED
import numpy as np


def main() -> int:
    """Measure what the command line asks for; 1 where an error is beyond what is promised."""
    parser = argparse.ArgumentParser('python -m campaigns.synthesis', description=__doc__)
    parser.add_argument('--cases', type=int, default=100_000, help='linkages of each family')
    parser.add_argument('--jobs', type=int, default=2, help='processes')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--only', nargs='+', metavar='FAMILY', help='only these families')
    parser.add_argument('--show', nargs=2, metavar=('FAMILY', 'LINKAGE'), help='one case again')
    arguments = parser.parse_args()
    for family in [*(arguments.only or []), *(arguments.show or [])[:1]]:
        if family not in FAMILIES:
            parser.error(f'no family {family!r}; there are: {", ".join(FAMILIES)}')
    if arguments.show:
        _show_case(arguments.seed, arguments.show[0], int(arguments.show[1]))
        return 0
    started, begin = time.monotonic(), datetime.now().astimezone()
    work = parts(arguments.cases, arguments.seed, arguments.only or [*FAMILIES])
    try:
        progress = progress_lines(sum(part.size for part in work), 'linkages')
        tallies = run(work, arguments.jobs, progress)
    except KeyboardInterrupt:
        say('stopped')
        return 130
    seconds = time.monotonic() - started
    show(_errors(tallies))
    show(Table('Families', ('family', 'what it is'), [(n, f.why) for n, f in FAMILIES.items()]))
    show(_speed())
    cases = sum(tally.cases for tally in tallies.values())
    machine = machine_table(
        begin,
        ('python-flint', metadata.version('python-flint')),
        ('seed', str(arguments.seed)),
        ('cases', f'{cases:,} in {seconds:.0f} s, {arguments.jobs} processes'),
    )
    show(machine)
    return int(any(t.worst.error > TRUSTED or t.worst_lost.error > 1.0 for t in tallies.values()))


def _errors(tallies: dict[str, Tally]) -> Table:
    table = Table(
        'Errors of lengths, in 2⁻⁵³·sensitivity',
        (
            'family',
            'linkages',
            'flagged',
            'mean digits',
            'worst',
            'linkage',
            'by true',
            'ratio',
            'of lost',
        ),
    )
    for family, tally in tallies.items():
        told = tally.cases - tally.flagged
        table.rows.append(
            [
                family,
                f'{tally.cases:,}',
                f'{tally.flagged:,}',
                f'{tally.digits / told:.1f}' if told else '',
                f'{tally.worst.error:.3g}',
                str(tally.worst.linkage),
                f'{tally.worst_true.error:.3g}',
                f'{tally.kappa[0]:.2f}–{tally.kappa[1]:.2f}',
                f'{tally.worst_lost.error:.2f}',
            ]
        )
    return table


def _speed() -> Table:
    """Measure one core, on threes of pairs as a search has them."""
    angles = np.random.default_rng(1).uniform(-np.pi, np.pi, (2, 262_144, 3))
    table = Table('Threes of pairs on one core', ('', 'million/s'))
    for name, solve in (('lengths', links), ('with condition and sensitivity', three_pairs)):
        best = np.inf
        for _ in range(3):
            start = time.perf_counter()
            solve(*angles)
            best = min(best, time.perf_counter() - start)
        table.rows.append([name, f'{angles.shape[1] / best / 1e6:.2f}'])
    return table


def _show_case(seed: int, family: str, index: int) -> None:
    case = make(seed, family, index)
    found = three_pairs(case.crank, case.truth.rocker)
    table = Table(f'{family} {index}', ('', 'crank', 'coupler', 'rocker'))
    for name, numbers in (
        ('true length', case.lengths),
        ('synthesised', found.lengths),
        ('sensitivity', found.sensitivity),
        ('of the true', case.truth.sensitivity),
        ('digits', found.digits),
    ):
        table.rows.append([name, *(f'{float(number):.17g}' for number in numbers)])
    show(table)
    say(f'crank {case.crank}')
    say(f'rocker {case.truth.rocker}')
    say(f'assemblies {case.sides}; condition {found.condition:.3g}, doubt {found.doubt}')


if __name__ == '__main__':
    sys.exit(main())
