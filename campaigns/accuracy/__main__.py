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
from datetime import datetime
from importlib import metadata
from pathlib import Path
import sys
import time

from bench.report import say, show, Table
from campaigns.accuracy import report
from campaigns.accuracy.adversarial import ADVERSARIAL
from campaigns.accuracy.picture import draw
from campaigns.accuracy.random_families import RANDOM
from campaigns.accuracy.run import Part, parts, run
from campaigns.accuracy.show import show_case
from campaigns.accuracy.tally import Tally
from linkage_ros.measuring import describe_machine

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
        tallies = _run_with_progress(work, arguments.jobs)
    except KeyboardInterrupt:
        say('stopped')
        return 130
    seconds = time.monotonic() - started
    cases = sum(tally.counts['cases'] for tally in tallies.values())
    machine = Table('Machine', ('', ''), [*describe_machine()])
    machine.rows.append(('python-flint', metadata.version('python-flint')))
    machine.rows.append(('seed', str(arguments.seed)))
    machine.rows.append(('cases', f'{cases:,} in {seconds:.0f} s, {arguments.jobs} processes'))
    machine.rows.append(('begun', f'{begin:%F %T}'))
    tables = [
        report.accuracy_table(tallies),
        report.status_table(tallies),
        report.toggle_table(tallies),
        report.worst_table(tallies, LIMIT),
        machine,
    ]
    for table in tables:
        show(table)
    arguments.out.mkdir(parents=True, exist_ok=True)
    draw(tallies, arguments.out / 'campaign.svg', LIMIT)
    page = report.markdown(
        'Accuracy campaign',
        ['Made by `make accuracy`.', '', '![Errors of all cases](campaign.svg)'],
        [*tables, report.families_table()],
    )
    (arguments.out / 'campaign.md').write_text(page, encoding='utf-8')
    say(f'{seconds:.0f} s; kept in {arguments.out / "campaign.md"}')
    return 0


def _run_with_progress(work: list[Part], jobs: int) -> dict[str, Tally]:
    try:
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            TextColumn,
            TimeRemainingColumn,
        )
    except ImportError:
        return run(work, jobs)
    bar = Progress(
        TextColumn('{task.description}'), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    )
    with bar:
        task = bar.add_task('linkages', total=sum(part.size for part in work))
        return run(work, jobs, lambda p: bar.update(task, advance=p.size, description=p.family))


if __name__ == '__main__':
    sys.exit(main())
