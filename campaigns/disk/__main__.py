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
``python -m campaigns.disk``: recordings on a disk that fails, fills or stalls.

What was counted as recorded has to be there, what is not has to be said, and no tick may wait.
"""

from __future__ import annotations

import argparse
from datetime import datetime
from importlib import metadata
from pathlib import Path
import sys
import time

from bench.report import say, show, Table
from campaigns.disk import failing, filling, stalling
from campaigns.disk.notifications import why_not
from campaigns.disk.report import failing_tables, filling_table, INTRO, stalling_tables
from campaigns.disk.small_disks import DISKS, NotPermittedError
from campaigns.disk.subject import SETTINGS
from campaigns.page import write_page
from linkage_ros.measuring import describe_machine

PAGE = Path('docs/recordings/disk.md')
PARTS = ('failing', 'filling', 'stalling')


def main() -> int:
    """Let disks fail, and judge; 1 where a verdict is a fault."""
    parser = argparse.ArgumentParser('python -m campaigns.disk', description=__doc__)
    parser.add_argument('--only', nargs='+', choices=PARTS, default=PARTS, help='only these')
    parser.add_argument('--every', type=int, default=1, help='only every so manyth failing call')
    parser.add_argument('--messages', type=int, default=100_000, help='to a disk that fills')
    parser.add_argument('--jobs', type=int, default=2, help='processes')
    parser.add_argument('--write', action='store_true', help=f'keep the outcome in {PAGE}')
    given = parser.parse_args()
    started, begin = time.monotonic(), datetime.now().astimezone()
    tables: list[Table] = []
    faults: list[str] = []
    skipped: list[tuple[str, str]] = []
    doing = {
        'failing': lambda: _fail(given.every, given.jobs, faults),
        'filling': lambda: _fill(given.messages, faults),
        'stalling': lambda: _stall(faults),
    }
    try:
        for part in PARTS:
            if part in given.only:
                try:
                    tables += doing[part]()
                except NotPermittedError as error:
                    skipped.append((f'left out: {part}', str(error)))
    except KeyboardInterrupt:
        say('stopped')
        return 130
    known = [
        *describe_machine(),
        ('mcap', metadata.version('mcap')),
        ('rosbags', metadata.version('rosbags')),
        ('took', f'{time.monotonic() - started:.0f} s, {given.jobs} processes'),
        ('begun', f'{begin:%F %T}'),
        *skipped,
    ]
    tables.append(Table('Machine', ('', ''), [*known]))
    for table in tables:
        show(table)
    for fault in faults:
        say(fault)
    if given.write:
        write_page(PAGE, 'Recordings on a disk that fails', INTRO, tables)
    return int(bool(faults))


def _fail(every: int, jobs: int, faults: list[str]) -> list[Table]:
    if why_not():
        raise NotPermittedError(why_not())
    work = [part for setting in SETTINGS for part in failing.parts(setting, every)]
    of = sum(len(part.injections) for part in work)
    tried: list[failing.Tried] = []
    begin = told = time.monotonic()
    for some in failing.attempts(work, jobs):
        tried += some
        if time.monotonic() - told > 10 or len(tried) == of:
            told = time.monotonic()
            say(f'{len(tried):,} of {of:,} failing calls, {told - begin:.0f} s')
    for one in tried:
        faults += [f'{f}: {one.setting}, {one.injection}' for f in one.outcome.faults]
    return failing_tables(tried)


def _fill(messages: int, faults: list[str]) -> list[Table]:
    filled = []
    cases = [*filling.cases(DISKS)]
    for case in cases:
        filled.append(filling.fill(*case, messages))
        faults += [f'{fault}: {filled[-1][:3]}' for fault in filled[-1].outcome.faults]
        say(f'{len(filled)} of {len(cases)} disks that fill')
    return [filling_table(filled)]


def _stall(faults: list[str]) -> list[Table]:
    runs = []
    for plan in stalling.PLANS:
        say(f'a disk that stalls: {plan.name}')
        runs.append(stalling.run(plan, frozen=True))
        faults += [f'{fault}: {plan.name}' for fault in runs[-1].faults]
    return stalling_tables(runs)


if __name__ == '__main__':
    sys.exit(main())
