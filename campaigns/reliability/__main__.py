# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
``python -m campaigns.reliability CAMPAIGN``: recordings, files and nodes under adverse conditions.

Each campaign has a table of faults, lets each of them befall what it tests, and judges the
outcome. The exit code is 1 if a judgement is a violation.
"""

from __future__ import annotations

import argparse
from datetime import datetime
import sys
import time
from types import ModuleType

from bench.report import machine_table, say
from campaigns.campaign import exit_code, Findings, publish
from campaigns.reliability import attacks, damage, disk, endurance, kills

CAMPAIGNS: dict[str, ModuleType] = {
    # Each has a PAGE, `add_options` and `run`.
    'attacks': attacks,
    'damage': damage,
    'disk': disk,
    'endurance': endurance,
    'kills': kills,
}


def main() -> int:
    """Run a campaign, print its tables and its findings, and write its page if that is wanted."""
    parser = argparse.ArgumentParser('python -m campaigns.reliability', description=__doc__)
    names = parser.add_subparsers(required=True, dest='campaign', metavar='CAMPAIGN')
    for name, module in CAMPAIGNS.items():
        options = names.add_parser(name, help=module.PAGE.title, description=module.__doc__)
        options.add_argument('--jobs', type=int, default=2, help='number of processes')
        options.add_argument('--seed', type=int, default=1, help='of all random numbers')
        options.add_argument(
            '--write', action='store_true', help=f'write the page {module.PAGE.file}'
        )
        module.add_options(options)
    chosen = parser.parse_args()
    campaign = CAMPAIGNS[chosen.campaign]
    started, begin = time.monotonic(), datetime.now().astimezone()
    findings: Findings = campaign.run(chosen)
    took = f'{time.monotonic() - started:.0f} s, {chosen.jobs} processes'
    facts = (*findings.facts, ('seed', str(chosen.seed)), ('took', took))
    publish(
        [*findings.tables, machine_table(begin, *facts)], campaign.PAGE if chosen.write else None
    )
    for fault in findings.faults:
        say(fault)
    return int(bool(findings.faults))


if __name__ == '__main__':
    sys.exit(exit_code(main))
