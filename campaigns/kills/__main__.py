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
``python -m campaigns.kills``: recordings at 1 kHz, killed at random instants by SIGKILL.

What is left has to be readable, the beginning of what was offered without a false message, and
short of it by the flush period and one tick at most.
"""

from __future__ import annotations

import argparse
from datetime import datetime
from importlib import metadata
from pathlib import Path
import sys
import time

from bench.report import say, show, Table
from campaigns.kills.plan import plans
from campaigns.kills.report import INTRO, is_beyond, tables
from campaigns.kills.run import KillError, run
from campaigns.page import load, write_page
from linkage_ros.measuring import describe_machine

PAGE = Path('docs/recordings/kills.md')


def main() -> int:
    """Kill and judge; 1 where a verdict is a fault, or more was lost than may be."""
    parser = argparse.ArgumentParser('python -m campaigns.kills', description=__doc__)
    parser.add_argument('--kills', type=int, default=1000, help='at any instant')
    parser.add_argument('--aimed', type=int, default=400, help='at what takes milliseconds only')
    parser.add_argument(
        '--seconds', type=float, nargs=2, default=(0.2, 3.0), help='shortest and longest run'
    )
    parser.add_argument('--jobs', type=int, default=4, help='recordings at once')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--write', action='store_true', help=f'keep the outcome in {PAGE}')
    given = parser.parse_args()
    started = told = time.monotonic()
    begin = datetime.now().astimezone()
    work = plans(given.seed, given.kills, given.aimed, (given.seconds[0], given.seconds[1]))
    outcomes = []
    try:
        for outcome in run(work, given.jobs):
            outcomes.append(outcome)
            if time.monotonic() - told > 10 or len(outcomes) == len(work):
                told = time.monotonic()
                say(f'{len(outcomes):,} of {len(work):,} kills, {told - started:.0f} s')
    except KeyboardInterrupt:
        say('stopped')
        return 130
    except KillError as error:
        print(f'kills: {error}', file=sys.stderr)
        return 1
    outcomes.sort(key=lambda outcome: outcome.plan.number)
    for outcome in outcomes:
        for fault in outcome.faults:
            say(f'{fault}: {outcome.plan}')
        if is_beyond(outcome):
            say(f'lost for {outcome.excess / 1e6:.1f} ms more than may be: {outcome.plan}')
    machine = Table('Machine', ('', ''), [*describe_machine()])
    seconds = time.monotonic() - started
    machine.rows.extend(
        [
            ('mcap', metadata.version('mcap')),
            ('rosbags', metadata.version('rosbags')),
            ('seed', str(given.seed)),
            ('kills', f'{given.kills:,} at any instant, {given.aimed:,} aimed'),
            ('took', f'{seconds:.0f} s, {given.jobs} at once'),
            ('begun', f'{begin:%F %T}'),
            ('load in the end', load()),
        ]
    )
    found = [*tables(outcomes), machine]
    for table in found:
        show(table)
    if given.write:
        write_page(PAGE, 'Recordings that are killed', INTRO, found)
    return int(any(outcome.faults or is_beyond(outcome) for outcome in outcomes))


if __name__ == '__main__':
    sys.exit(main())
