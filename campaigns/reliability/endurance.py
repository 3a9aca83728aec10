# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A day at 100 Hz in minutes, and ten minutes over DDS.

Memory, open files and threads must not grow, every message has to be counted, and the run over
DDS has to replay to the same bytes.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from bench.report import say
from campaigns.campaign import Findings, Page
from campaigns.reliability import accelerated, over_dds
from campaigns.reliability.memory import flatness, MOST_GROWTH

PAGE = Page(
    Path('docs/recordings/endurance.md'),
    'Long runs',
    f"""
Made by `make endurance`.

**Accelerated**: scenes that come with the package, at another rate, run through the node's own
tick loop and recorder on simulated time, each in a process of its own. The bag is a ring of a few
files; there are about as many flushes as in a real run. From time to time the ticks wait for the
recorder, so that nothing is dropped. Memory is measured while its queue is empty.

**Over DDS**: the demo as a node at 1 kHz, with a crank source at 500 Hz, each a process of its
own, in real time. Memory is that of the node.

Memory is `VmRSS`. The first quarter of a run is warm-up. *Slope* is the median of the slopes
between any two later samples. A run is *flat* if the slope makes no more than {MOST_GROWTH:,} kB
over these three quarters, and if open files and threads do not increase. *One file* is not flat:
the index of an MCAP file stays in memory until the file ends, 0.7 kB for each chunk, and each
flush makes a chunk. `split_bytes`, by default 1 GiB, bounds it.
""",
)

_ONE_FILE = 0.25  # share of the duration: its index grows evenly


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this campaign."""
    parser.add_argument('--hours', type=float, default=24.0, help='of simulated time')
    parser.add_argument('--rate', type=float, default=100.0, help='ticks per simulated second')
    parser.add_argument('--scenes', nargs='+', default=['demo', 'excavator_delay'])
    parser.add_argument('--minutes', type=float, default=10.0, help='over DDS')
    only = parser.add_mutually_exclusive_group()
    only.add_argument('--accelerated', action='store_true', help='only this')
    only.add_argument('--dds', action='store_true', help='only this')


def run(options: argparse.Namespace) -> Findings:
    """Let scenes run; growth is a fault too."""
    findings = Findings([], [])
    if not options.dds:
        plans = [accelerated.Plan(name, options.hours, options.rate) for name in options.scenes]
        short = _ONE_FILE * options.hours
        plans.append(plans[0]._replace(hours=short, split_seconds=0.0, keep_files=0))
        runs = accelerated.run_all(plans, options.jobs)
        findings.tables.extend(accelerated.tables_of(runs))
        for done in runs:
            findings.faults.extend(done.faults)
            if done.plan.keep_files and not flatness(done.samples).flat:
                findings.faults.append(f'{done.plan.name} grows')
    if not options.accelerated:
        say(f'over DDS: {options.minutes:g} min')
        node = over_dds.run(options.minutes)
        findings.tables.extend(over_dds.tables_of(node))
        findings.faults.extend(node.faults)
        if node.samples and not flatness(node.samples).flat:
            findings.faults.append('the node grows')
    return findings
