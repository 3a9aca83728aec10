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
``python -m campaigns.topologies``: random linkages of every topology.

Every dyad on every kind of link, chains, inputs of all kinds, class III and exact change points,
against constraint equations that share nothing with the package; and the commands on their files.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
import sys
import time

from bench.report import machine_table, say, show, Table, write_page
from campaigns.campaign import progress_lines
from campaigns.topologies.families import FAMILIES
from campaigns.topologies.judge import QUANTITIES
from campaigns.topologies.run import (
    ACCURACY,
    CHECK,
    CHECK_SPOILT,
    examine,
    FILE,
    KINEMATICS,
    made_for,
    parts,
    run,
    Tally,
)
from linkage_ros.files.linkage_text import linkage_text
import numpy as np

INTRO = """
Made by `make topologies`, and by `make accuracy`.

Each linkage is made from a pose, so that it closes there. It is solved at 16 states, one by one
and as arrays, and held against its constraint equations: pins coincide, points lie on lines,
blocks keep angles, inputs are driven; Newton's method solves them in long doubles. Which states
close, by what others miss, and the assembly come from circles and lines that meet; of class III,
from the equations followed from the pose. None of it is the package's. A single input is walked at
2,400 values, limits found by bisection: ranges and singular inputs are held against that.

An error is given in units of u·κ: u = 2⁻⁵³; κ is by how much a result changes where all numbers of
the linkage, the inputs and every term of the equations change by one part, with random signs, the
greatest of five, and the value itself. Terms of the equations stand for what a dyad hands to the
next. A joint counts as a thousandth of the one that moves most. The table has the 99th percentile
and the worst.

- *refused*: the linkage closes, but is not accepted. *missed closure*, *false closure*: a state is
  said to be open, and closes, or the other way round. *wrong assembly*: another one than the
  conventions name. *not closed*: a pose that the equations do not know. *gap*: what an open dyad
  misses by. *arrays*: not the same as one by one. *points*: places of points.
- *range*: a part of it is missing, or it is too wide. *singular*: a toggle, a change point or two
  parallel lines of a dyad that are not listed, or what is listed and is none.
- *error*: one of more than 16 u·κ. *traceback*: an exception that no user should see.
"""

OUTCOMES = ('linkages', 'states closed', 'states open')


def kinematics_table(tallies: Mapping[str, Tally]) -> Table:
    """Return for each family how many states there were, and the worst errors."""
    table = Table(
        'Kinematics, errors in u·κ',
        ('family', 'linkages', 'closed', 'open', *QUANTITIES, 'linkages with findings'),
    )
    total: Counter[str] = Counter()
    for family, tally in tallies.items():
        total += tally.counts
        found = tally.counts['linkages with findings']
        table.rows.append(
            [
                family,
                *(f'{tally.counts[name]:,}' for name in OUTCOMES),
                *(_worst(tally, name) for name in QUANTITIES),
                f'{found:,}' if found else '',
            ]
        )
    found = total['linkages with findings']
    ends = ['', '', '', f'{found:,}' if found else '']
    table.rows.append(['all', *(f'{total[name]:,}' for name in OUTCOMES), *ends])
    return table


def _worst(tally: Tally, name: str) -> str:
    errors = tally.errors.get(name)
    if not errors:
        return ''
    return f'{np.percentile(errors, 99):.2f}, {tally.worst[name][0]:.3g}'


def findings_table(tallies: Mapping[str, Mapping[str, Tally]]) -> Table:
    """Return the findings, with the number of linkages by family, and one example."""
    table = Table('Findings', ('finding', 'linkages', 'of', 'families', 'for example'))
    for what, families in tallies.items():
        names: Counter[str] = Counter()
        for tally in families.values():
            names.update(tally.found_with)
        for name, count in sorted(names.items(), key=lambda item: -item[1]):
            where = [family for family, tally in families.items() if tally.found_with[name]]
            tried = sum(tally.counts['linkages'] for tally in families.values())
            note = families[where[0]].notes[name][0]
            text = f'--show "{where[0]}" {note.linkage}'
            if what != KINEMATICS:
                text += f' --what "{what}"'
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
    """Return how the commands ended."""
    table = Table(
        'Commands', ('linkages', 'command', 'tried', 'done', 'refused in one line', 'else')
    )
    for what, families in tallies.items():
        if what == KINEMATICS:
            continue
        counts: Counter[str] = Counter()
        for tally in families.values():
            counts.update(tally.counts)
        kind = 'with one or two wrong numbers' if what == CHECK_SPOILT else 'that close'
        for command in sorted({name.partition(':')[0] for name in counts if ':' in name}):
            done, refused = counts[f'{command}: done'], counts[f'{command}: refused']
            ends = sum(n for name, n in counts.items() if name.startswith(f'{command}: '))
            table.rows.append(
                [
                    kind,
                    command,
                    f'{ends:,}',
                    f'{done:,}',
                    f'{refused:,}',
                    f'{ends - done - refused:,}',
                ]
            )
    return table


def families_table(names: Sequence[str]) -> Table:
    """Return the description of each family."""
    return Table('Families', ('family', 'what it is'), [(n, FAMILIES[n].why) for n in names])


def main() -> int:
    """Measure what the command line asks for; 1 where something was found."""
    parser = argparse.ArgumentParser('python -m campaigns.topologies', description=__doc__)
    parser.add_argument('--linkages', type=int, default=40, help='of each family')
    parser.add_argument('--checks', type=int, default=500, help='linkages that `check` describes')
    parser.add_argument('--spoilt', type=int, default=500, help='of these, with wrong numbers')
    parser.add_argument('--files', type=int, default=90, help='that are drawn and modelled')
    parser.add_argument('--accuracy', type=int, default=3, help='`accuracy --quick`, 15 s each')
    parser.add_argument('--jobs', type=int, default=2, help='processes')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--only', nargs='+', metavar='FAMILY', help='only these families')
    parser.add_argument('--out', type=Path, default=Path('docs/accuracy'), help='folder')
    parser.add_argument('--show', nargs=2, metavar=('FAMILY', 'LINKAGE'), help='make one again')
    parser.add_argument(
        '--what',
        choices=(KINEMATICS, CHECK, CHECK_SPOILT, FILE, ACCURACY),
        default=KINEMATICS,
        help='what to try with the one that is shown',
    )
    arguments = parser.parse_args()
    for family in [*(arguments.only or []), *(arguments.show or [])[:1]]:
        if family not in FAMILIES:
            parser.error(f'no family {family!r}; there are: {", ".join(FAMILIES)}')
    if arguments.show:
        _show(arguments.seed, arguments.show[0], int(arguments.show[1]), arguments.what)
        return 0
    started, begin = time.monotonic(), datetime.now().astimezone()
    wanted = {
        KINEMATICS: arguments.linkages,
        CHECK: arguments.checks,
        CHECK_SPOILT: arguments.spoilt,
        FILE: arguments.files,
        ACCURACY: arguments.accuracy,
    }
    names = arguments.only or [*FAMILIES]
    work = parts(arguments.seed, wanted, names)
    tried = sum(part.size for part in work)
    try:
        tallies = run(work, arguments.jobs, progress_lines(tried, 'linkages'))
    except KeyboardInterrupt:
        say('stopped')
        return 130
    seconds = time.monotonic() - started
    machine = machine_table(
        begin,
        ('seed', str(arguments.seed)),
        ('linkages', f'{tried:,} in {seconds:.0f} s, {arguments.jobs} processes'),
    )
    tables = [
        findings_table(tallies),
        commands_table(tallies),
        kinematics_table(tallies.get(KINEMATICS, {})),
        machine,
    ]
    for table in tables:
        show(table)
    write_page(
        arguments.out / 'topologies.md',
        'Linkages of every topology',
        INTRO,
        [*tables, families_table(names)],
    )
    return int(any(t.notes for families in tallies.values() for t in families.values()))


def _show(seed: int, family: str, index: int, what: str) -> None:
    """Print a linkage's file and what is found with it."""
    print(linkage_text(made_for(what, seed, family, index), [f'{family} {index}, seed {seed}']))
    findings = examine(seed, family, index, what)
    print(dict(findings.counts))
    for name, note in findings.notes:
        print(f'{name}: {note}')
    for quantity, errors in findings.errors.items():
        print(f'worst {quantity}: {max(errors):.3g} u·κ')


if __name__ == '__main__':
    sys.exit(main())
