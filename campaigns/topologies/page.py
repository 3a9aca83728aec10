# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Random linkages of every topology.

They have every dyad on every kind of link, chains, inputs of all kinds, class III and exact change
points. They are compared with constraint equations that share nothing with the package, and the
commands are run on their files.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from bench.report import Table
from campaigns.campaign import Findings, Page, progress_lines
from campaigns.topologies.families import FAMILIES
from campaigns.topologies.judge import QUANTITIES
from campaigns.topologies.run import (
    ACCURACY,
    CHECK,
    CHECK_ALTERED,
    examine,
    FILE,
    KINEMATICS,
    made_for,
    parts,
    run as run_parts,
    Tally,
    TESTS,
)
from linkage_ros.description import linkage_text
import numpy as np

PAGE = Page(
    Path('docs/accuracy/topologies.md'),
    'Linkages of every topology',
    """
Made by `make topologies`, and by `make accuracy`.

Each linkage is made from a pose, so that it closes there. It is solved at 16 states, one by one
and as arrays, and compared with its constraint equations: pins coincide, points lie on lines,
blocks keep angles, inputs are driven. Newton's method solves these equations in long doubles.
Intersections of circles and lines give the states that close, the closure error of the others, and
the assembly; for class III, the equations are followed from the pose. None of this code is the
package's. A single input is sampled at 2,400 values, and its limits are found by bisection; the
ranges and singular inputs of the package are compared with the result.

An error is given in units of u·κ, with u = 2⁻⁵³. For κ, all numbers of the linkage, the inputs and
every term of the equations are changed by the same relative amount with random signs. κ is the
greatest of five relative changes of a result, plus the value of the result. The terms of the
equations stand for the results that a dyad passes to the next one. The κ of a joint is at least a
thousandth of the greatest κ of the linkage. The table has the 99th percentile and the worst error.

- *refused*: the linkage closes, but is not accepted. *missed closure*: the state closes, but is
  reported as open. *false closure*: the state is open, but is reported as closed. *wrong
  assembly*: not the assembly of the file. *not closed*: the pose does not satisfy the equations.
  *gap*: a wrong closure error of an open dyad. *arrays*: arrays differ from single states.
  *points*: wrong positions of points.
- *range*: a part of the range is missing, or the range is too wide. *singular*: a toggle, a change
  point or a pair of parallel lines is not listed, or a regular input is listed.
- *error*: an error of more than 16 u·κ. *traceback*: an exception that a user would see.
""",
)

OUTCOMES = ('linkages', 'states closed', 'states open')


def kinematics_table(tallies: Mapping[str, Tally]) -> Table:
    """Return for each family the number of states, and the worst errors."""
    table = Table(
        'Kinematics, errors in u·κ',
        ('family', 'linkages', 'closed', 'open', *QUANTITIES, 'linkages with findings'),
    )
    total: Counter[str] = Counter()
    for family, tally in tallies.items():
        total += tally.counts
        findings = tally.counts['linkages with findings']
        table.rows.append(
            [
                family,
                *(f'{tally.counts[name]:,}' for name in OUTCOMES),
                *(_worst(tally, name) for name in QUANTITIES),
                f'{findings:,}' if findings else '',
            ]
        )
    findings = total['linkages with findings']
    ends = ['', '', '', f'{findings:,}' if findings else '']
    table.rows.append(['all', *(f'{total[name]:,}' for name in OUTCOMES), *ends])
    return table


def _worst(tally: Tally, name: str) -> str:
    errors = tally.errors.get(name)
    if not errors:
        return ''
    return f'{np.percentile(errors, 99):.2f}, {tally.worst[name][0]:.3g}'


def findings_table(tallies: Mapping[str, Mapping[str, Tally]]) -> Table:
    """Return each finding with its number of linkages and families, and one example."""
    table = Table('Findings', ('finding', 'linkages', 'of', 'families', 'example'))
    for test, families in tallies.items():
        names: Counter[str] = Counter()
        for tally in families.values():
            names.update(tally.found_with)
        for name, count in sorted(names.items(), key=lambda item: -item[1]):
            where = [family for family, tally in families.items() if tally.found_with[name]]
            tried = sum(tally.counts['linkages'] for tally in families.values())
            note = families[where[0]].notes[name][0]
            text = f'--show "{where[0]}" {note.linkage}'
            if test != KINEMATICS:
                text += f' --test "{test}"'
            table.rows.append(
                [name, f'{count:,}', f'{tried:,}', f'{len(where)}', f'{text}: {_cell(note.text)}']
            )
    if not table.rows:
        table.rows.append(['none', '', '', '', ''])
    return table


def _cell(text: str) -> str:
    line = text.replace('|', '∣')
    return line if len(line) < 140 else line[:137] + '…'


def commands_table(tallies: Mapping[str, Mapping[str, Tally]]) -> Table:
    """Return the results of the commands."""
    table = Table(
        'Commands', ('linkages', 'command', 'tried', 'done', 'refused in one line', 'other')
    )
    for test, families in tallies.items():
        if test == KINEMATICS:
            continue
        counts: Counter[str] = Counter()
        for tally in families.values():
            counts.update(tally.counts)
        kind = 'with one or two wrong numbers' if test == CHECK_ALTERED else 'that close'
        for command in sorted({name.partition(':')[0] for name in counts if ':' in name}):
            done, refused = counts[f'{command}: done'], counts[f'{command}: refused']
            ends = sum(n for name, n in counts.items() if name.startswith(f'{command}: '))
            numbers = ends, done, refused, ends - done - refused
            table.rows.append([kind, command, *(f'{number:,}' for number in numbers)])
    return table


def families_table(names: Sequence[str]) -> Table:
    """Return the description of each family."""
    return Table(
        'Families', ('family', 'description'), [(n, FAMILIES[n].description) for n in names]
    )


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this campaign."""
    parser.add_argument('--linkages', type=int, default=40, help='of each family')
    parser.add_argument('--checks', type=int, default=500, help='linkages for `check`')
    parser.add_argument(
        '--altered', type=int, default=500, help='linkages for `check`, with wrong numbers'
    )
    parser.add_argument('--files', type=int, default=90, help='linkages to draw and to export')
    parser.add_argument('--accuracy', type=int, default=3, help='`accuracy --quick`, 15 s each')
    parser.add_argument('--test', choices=TESTS, default=KINEMATICS, help='the test for --show')


def run(options: argparse.Namespace) -> Findings:
    """Compare the package with the equations, and run the commands."""
    wanted = {
        KINEMATICS: options.linkages,
        CHECK: options.checks,
        CHECK_ALTERED: options.altered,
        FILE: options.files,
        ACCURACY: options.accuracy,
    }
    work = parts(options.seed, wanted, options.only)
    tried = sum(part.size for part in work)
    tallies = run_parts(work, options.jobs, progress_lines(tried, 'linkages'))
    found = findings_table(tallies)
    tables = [found, commands_table(tallies), kinematics_table(tallies.get(KINEMATICS, {}))]
    notes = any(tally.notes for families in tallies.values() for tally in families.values())
    faults = [' '.join(row) for row in found.rows] if notes else []
    facts = [('linkages', f'{tried:,}')]
    return Findings([*tables, families_table(options.only)], faults, facts)


def show(options: argparse.Namespace) -> None:
    """Print the file of a linkage and its findings."""
    seed, family, index, test = options.seed, options.show[0], int(options.show[1]), options.test
    print(linkage_text(made_for(test, seed, family, index), [f'{family} {index}, seed {seed}']))
    findings = examine(seed, family, index, test)
    print(dict(findings.counts))
    for name, note in findings.notes:
        print(f'{name}: {note}')
    for quantity, errors in findings.errors.items():
        print(f'worst {quantity}: {max(errors):.3g} u·κ')
