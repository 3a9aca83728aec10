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
``python -m campaigns.endurance``: a day at 100 Hz in minutes, and ten minutes over DDS.

Memory, open files and threads have to stay what they are, every message has to be accounted for,
and what ran over DDS has to replay to the same bytes.
"""

from __future__ import annotations

import argparse
from datetime import datetime
from pathlib import Path
import sys

from bench.report import say, show, Table
from campaigns.endurance import accelerated, over_dds
from campaigns.endurance.memory import flatness
from campaigns.endurance.report import accelerated_tables, dds_tables, INTRO
from campaigns.endurance.telling import telling
from campaigns.page import load, write_page
from linkage_ros.measuring import describe_machine

PAGE = Path('docs/recordings/endurance.md')
_ONE_FILE = 0.25  # of the time: its index grows evenly


def main() -> int:
    """Run what the command line asks for; 1 where something is at fault or grows."""
    parser = argparse.ArgumentParser('python -m campaigns.endurance', description=__doc__)
    parser.add_argument('--hours', type=float, default=24.0, help='of simulated time')
    parser.add_argument('--rate', type=float, default=100.0, help='ticks a simulated second')
    parser.add_argument('--scenes', nargs='+', default=['demo', 'excavator_delay'])
    parser.add_argument('--jobs', type=int, default=2, help='accelerated runs at once')
    parser.add_argument('--minutes', type=float, default=10.0, help='over DDS')
    only = parser.add_mutually_exclusive_group()
    only.add_argument('--accelerated', action='store_true', help='only this')
    only.add_argument('--dds', action='store_true', help='only this')
    parser.add_argument('--write', action='store_true', help=f'keep the outcome in {PAGE}')
    given = parser.parse_args()
    begin = datetime.now().astimezone()
    tables: list[Table] = []
    faults: list[str] = []
    try:
        if not given.dds:
            runs = accelerated.run_all(_plans(given), given.jobs)
            tables += accelerated_tables(runs)
            faults += [fault for run in runs for fault in run.faults]
            ringed = [run for run in runs if run.plan.keep_files]
            faults += [f'{r.plan.name} grows' for r in ringed if not flatness(r.samples).flat]
        if not given.accelerated:
            say(f'over DDS: {given.minutes:g} min')
            run = over_dds.run(given.minutes, telling(f'of {given.minutes:g} min'))
            tables += dds_tables(run)
            faults += run.faults
            if run.samples and not flatness(run.samples).flat:
                faults.append('the node grows')
    except KeyboardInterrupt:
        say('stopped')
        return 130
    machine = Table('Machine', ('', ''), [*describe_machine()])
    machine.rows.extend([('begun', f'{begin:%F %T}'), ('load in the end', load())])
    tables.append(machine)
    for table in tables:
        show(table)
    for fault in faults:
        say(fault)
    if given.write:
        write_page(PAGE, 'Long runs', INTRO, tables)
    return int(bool(faults))


def _plans(given: argparse.Namespace) -> list[accelerated.Plan]:
    plans = [accelerated.Plan(scene, given.hours, given.rate) for scene in given.scenes]
    one = plans[0]._replace(hours=_ONE_FILE * given.hours, split_seconds=0.0, keep_files=0)
    return [*plans, one]


if __name__ == '__main__':
    sys.exit(main())
