# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
``python -m campaigns CAMPAIGN``: millions of cases, hostile input, long runs.

Each campaign judges its cases by references of its own, prints its tables and its findings, and
may write a page. The exit code is 1 if there are findings.
"""

from __future__ import annotations

import argparse
from datetime import datetime
from importlib import import_module
import sys
import time

from bench.report import machine_table, say
from campaigns.campaign import Findings, publish
from linkage_ros.cli.terminal import give_up_output

CAMPAIGNS = {
    # Each module has `add_options` and `run`; it may have a PAGE, and FAMILIES with `show`.
    'accuracy': 'campaigns.accuracy.run',
    'attacks': 'campaigns.reliability.attacks',
    'damage': 'campaigns.reliability.damage',
    'disk': 'campaigns.reliability.disk',
    'endurance': 'campaigns.reliability.endurance',
    'inverse': 'campaigns.inverse',
    'kills': 'campaigns.reliability.kills',
    'mutants': 'campaigns.mutants',
    'robots': 'campaigns.robots',
    'space': 'campaigns.space',
    'synthesis': 'campaigns.synthesis',
    'topologies': 'campaigns.topologies.run',
}


def main() -> int:
    """Run a campaign; at Ctrl-C, or without a reader, it ends without a traceback."""
    try:
        return _run()
    except KeyboardInterrupt:
        say('stopped')
        return 130
    except BrokenPipeError:
        # The reader of the output has gone: there is nobody to report to.
        give_up_output()
        return 1


def _run() -> int:
    first = argparse.ArgumentParser('python -m campaigns', description=__doc__)
    first.add_argument('campaign', choices=CAMPAIGNS, metavar='CAMPAIGN')
    name = first.parse_args(sys.argv[1:2]).campaign
    campaign = import_module(CAMPAIGNS[name])
    page, families = getattr(campaign, 'PAGE', None), getattr(campaign, 'FAMILIES', {})
    parser = argparse.ArgumentParser(f'python -m campaigns {name}', description=campaign.__doc__)
    parser.add_argument('--jobs', type=int, default=2, help='number of processes')
    parser.add_argument('--seed', type=int, default=1, help='of all random numbers')
    if page:
        parser.add_argument('--write', action='store_true', help=f'write the page {page.file}')
    if families:
        parser.add_argument('--only', nargs='+', metavar='FAMILY', help='only these families')
        parser.add_argument('--show', nargs=2, metavar=('FAMILY', 'CASE'), help='repeat a case')
    campaign.add_options(parser)
    options = parser.parse_args(sys.argv[2:])
    if families:
        for family in [*(options.only or []), *(options.show or [])[:1]]:
            if family not in families:
                parser.error(f'no family {family!r}; the families are: {", ".join(families)}')
        if options.show:
            campaign.show(options)
            return 0
        options.only = options.only or [*families]
    started, begin = time.monotonic(), datetime.now().astimezone()
    findings: Findings = campaign.run(options)
    took = f'{time.monotonic() - started:.0f} s, {options.jobs} processes'
    facts = (*findings.facts, ('seed', str(options.seed)), ('took', took))
    tables = [*findings.tables, machine_table(begin, *facts)]
    publish(tables, page if page and options.write else None)
    for fault in findings.faults:
        say(fault)
    return int(bool(findings.faults))


if __name__ == '__main__':
    sys.exit(main())
