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
from datetime import datetime
from pathlib import Path
import sys
import time

from bench.report import say, show, Table
from campaigns.topologies import report
from campaigns.topologies.families import FAMILIES
from campaigns.topologies.run import (
    ACCURACY,
    CHECK,
    CHECK_SPOILT,
    examine,
    FILE,
    KINEMATICS,
    made_for,
    Part,
    parts,
    run,
    Tally,
)
from linkage_ros.measuring import describe_machine
from linkage_ros.scene.linkage_text import linkage_text


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
    try:
        tallies = _run_with_progress(work, arguments.jobs)
    except KeyboardInterrupt:
        say('stopped')
        return 130
    seconds = time.monotonic() - started
    machine = Table('Machine', ('', ''), [*describe_machine()])
    machine.rows.append(('seed', str(arguments.seed)))
    tried = sum(part.size for part in work)
    machine.rows.append(('linkages', f'{tried:,} in {seconds:.0f} s, {arguments.jobs} processes'))
    machine.rows.append(('begun', f'{begin:%F %T}'))
    tables = [
        report.findings_table(tallies),
        report.commands_table(tallies),
        report.kinematics_table(tallies.get(KINEMATICS, {})),
        machine,
    ]
    for table in tables:
        show(table)
    arguments.out.mkdir(parents=True, exist_ok=True)
    page = report.markdown(
        'Linkages of every topology',
        ['Made by `make topologies`, and by `make accuracy`.'],
        [*tables, report.families_table(names)],
    )
    (arguments.out / 'topologies.md').write_text(page, encoding='utf-8')
    say(f'{seconds:.0f} s; kept in {arguments.out / "topologies.md"}')
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


def _run_with_progress(work: list[Part], jobs: int) -> dict[str, dict[str, Tally]]:
    begin, done = time.monotonic(), 0
    total = sum(part.size for part in work)

    def tell(part: Part) -> None:
        nonlocal done, begin
        done += part.size
        if time.monotonic() - begin > 10.0 or done == total:
            begin = time.monotonic()
            say(f'{done:,} of {total:,}: {part.what}, {part.family}')

    return run(work, jobs, tell)


if __name__ == '__main__':
    sys.exit(main())
