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
``python -m campaigns.damage``: bags cut at every byte, and every bit of them flipped.

Reading and recovering has to find the damage, or it does no harm: what is given are true messages
in their order, topics and attachments as they were, and what is missing is said to be. A verdict
says how much was given, and whether something was said.
"""

from __future__ import annotations

import argparse
from collections import Counter
from datetime import datetime
from pathlib import Path
import sys
import time

from bench.report import machine_table, say, show, Table, write_page
from campaigns.campaign import progress_lines
from campaigns.damage.run import FAULT, JUDGES, KINDS, parts, run, Tally

PAGE = Path('docs/recordings/damage.md')

INTRO = """
Made by `make damage`: a bag of ours of about 100 kB is cut at every byte, and every bit of it is
flipped, each time from the whole bag; one that was killed, and bags by other writers, packed and
not, are cut and flipped at random places. Each is read as a bag that has to be whole, read as far
as it goes, and looked through for what can be recovered. What is given has to be true messages in
their order, with topics and attachments as they were, and where something is missing, that has to
be said.

A row is a verdict, how much was given and whether something was said; the numbers are damages.
*all messages* are all of them without all of the attachments. A verdict that must not be begins
with FAULT: a false message, topic or attachment, a loss that is not said, an error of Python.
"""


def main() -> int:
    """Damage and judge; 1 where a verdict is a fault."""
    parser = argparse.ArgumentParser('python -m campaigns.damage', description=__doc__)
    parser.add_argument('--size', type=int, default=100_000, help='of the file, about [bytes]')
    parser.add_argument('--sample', type=int, help='cuts and flips at random, instead of all')
    parser.add_argument(
        '--others', type=int, default=20_000, help='cuts and flips of each bag by other writers'
    )
    parser.add_argument('--jobs', type=int, default=2, help='processes')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--write', action='store_true', help=f'keep the outcome in {PAGE}')
    arguments = parser.parse_args()
    started, begin = time.monotonic(), datetime.now().astimezone()
    work = parts(['own'], arguments.seed, arguments.size, arguments.sample)
    others = [kind for kind in KINDS if kind != 'own']
    work += (
        parts(others, arguments.seed, arguments.size, arguments.others) if arguments.others else []
    )
    tally = Tally()
    total = sum(len(part.places) for part in work)
    progress = progress_lines(total, 'damages')
    try:
        for part, judged in run(work, arguments.jobs):
            tally.add(judged)
            progress(len(part.places))
    except KeyboardInterrupt:
        say('stopped')
        return 130
    tables = [_table(tally, kind, damage) for kind in KINDS for damage in ('cut', 'flip')]
    tables = [table for table in tables if table.rows]
    for kind, damage, place, name, verdict in tally.faults:
        say(f'{name}, {kind}, {damage} {place}: {verdict}')
    seconds = time.monotonic() - started
    tables.append(
        machine_table(
            begin,
            ('seed', str(arguments.seed)),
            ('damages', f'{total:,} in {seconds:.0f} s, {arguments.jobs} processes'),
        )
    )
    for table in tables:
        show(table)
    if arguments.write:
        write_page(PAGE, 'Damaged bags', INTRO, tables)
    return int(bool(tally.faults))


def _table(tally: Tally, kind: str, damage: str) -> Table:
    counts: dict[str, Counter[str]] = {}
    for (of_kind, of_damage, judge, verdict), count in tally.verdicts.items():
        if (of_kind, of_damage) == (kind, damage):
            counts.setdefault(verdict, Counter())[judge] += count
    table = Table(f'{kind}: {damage}', ('verdict', *JUDGES))
    for verdict in sorted(counts, key=lambda v: (not v.startswith(FAULT), v)):
        table.rows.append([verdict, *(f'{counts[verdict][judge]:,}' for judge in JUDGES)])
    return table


if __name__ == '__main__':
    sys.exit(main())
