# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
``python -m campaigns.endurance``: a day at 100 Hz in minutes, and ten minutes over DDS.

Memory, open files and threads must not grow, every message has to be counted, and the run over
DDS has to replay to the same bytes.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
import sys

from bench.report import machine_table, say, Table
from campaigns.campaign import exit_code, Page, parser_of, publish
from campaigns.endurance import accelerated, over_dds
from campaigns.endurance.accelerated import Run
from campaigns.endurance.memory import flatness, MOST_GROWTH, Usage
from campaigns.endurance.over_dds import DdsRun

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

_TICKS = (
    'Events since startup',
    'Joint states published',
    'Samples received',
    'Samples used',
    'Lost ticks',
    'Late by more than a period',
    'Lateness p50 (us)',
    'Lateness p99 (us)',
    'Lateness max (us)',
)


def accelerated_tables(runs: Sequence[Run]) -> list[Table]:
    """Return the memory by the hour, its verdicts, and the counts of messages."""
    first = runs[0].plan
    title = f'Accelerated: {first.hours:g} h at {first.rate:g} Hz'
    memory = Table(
        f'{title}, memory in kB',
        ('hour', *(f'{run.plan.name} ({run.plan.hours:g} h)' for run in runs)),
    )
    step = first.hours / 24.0
    for index in range(25):
        memory.rows.append(
            [f'{index * step:.3g}', *(_at(run.samples, 3600.0 * index * step) for run in runs)]
        )
    verdicts = _verdicts(f'{title}, verdicts')
    for run in runs:
        verdicts.rows.append(_verdict(run.plan.name, run.samples, exempt=not run.plan.keep_files))
    messages = _messages(f'{title}, messages')
    for run in runs:
        for counts in run.summary.topics:
            numbers = (counts.received, counts.recorded, counts.dropped, counts.discarded)
            messages.rows.append([f'{run.plan.name}: {counts.name}', *(f'{n:,}' for n in numbers)])
    took = Table(
        f'{title}, duration',
        ('', 'h', 'ticks', 's', 'µs a tick', 'faults'),
        [
            [
                run.plan.name,
                f'{run.plan.hours:g}',
                f'{ticks:,}',
                f'{run.seconds:.0f}',
                f'{1e6 * run.seconds / ticks:.1f}',
                '; '.join(run.faults) or 'none',
            ]
            for run in runs
            for ticks in [round(run.plan.hours * 3600.0 * run.plan.rate)]
        ],
    )
    return [memory, verdicts, messages, took]


def dds_tables(run: DdsRun) -> list[Table]:
    """Return the memory by the minute, its verdict, the counts of messages, and the ticks."""
    title = f'Over DDS: {run.minutes:g} min'
    memory = Table(f'{title}, memory of the node', ('minute', 'kB', 'open files', 'threads'))
    for index in range(11):
        time = 6.0 * run.minutes * index
        if run.samples:
            sample = _nearest(run.samples, time)
            memory.rows.append(
                (f'{sample.time / 60.0:.1f}', *(f'{value:,}' for value in sample[1:]))
            )
    verdicts = _verdicts(f'{title}, verdicts')
    if run.samples:
        verdicts.rows.append(_verdict('linkage_node', run.samples))
    messages = _messages(f'{title}, messages')
    for topic, received in run.counts.get('received', {}).items():
        numbers = [run.counts[kind][topic] for kind in ('recorded', 'dropped', 'discarded')]
        messages.rows.append([topic, f'{received:,}', *(f'{number:,}' for number in numbers)])
    ticks = Table(f'{title}, ticks', ('', ''), [(k, run.ticks.get(k, '')) for k in _TICKS])
    replayed = run.replayed
    ticks.rows.append(
        (
            'Replay',
            f'{replayed.get("verdict")}, {replayed.get("compared_ticks", 0):,} ticks compared',
        )
    )
    ticks.rows.append(('Faults', '; '.join(run.faults) or 'none'))
    return [memory, verdicts, messages, ticks]


def _verdicts(title: str) -> Table:
    return Table(
        title,
        ('', 'slope, kB/h', 'growth, kB', 'peak, kB', 'more files', 'more threads', 'verdict'),
    )


def _verdict(name: str, samples: Sequence[Usage], *, exempt: bool = False) -> list[str]:
    growth = flatness(samples)
    verdict = 'flat' if growth.flat else 'grows'
    return [
        name,
        f'{3600.0 * growth.slope:.1f}',
        f'{growth.growth:,.0f}',
        f'{growth.peak:,.0f}',
        str(growth.files),
        str(growth.threads),
        'one file: not judged' if exempt else verdict,
    ]


def _messages(title: str) -> Table:
    return Table(title, ('', 'received', 'recorded', 'dropped', 'removed by the ring'))


def _at(samples: Sequence[Usage], time: float) -> str:
    """Return the memory at a time; '' after the end."""
    if time > samples[-1].time * 1.001:
        return ''
    return f'{_nearest(samples, time).resident:,}'


def _nearest(samples: Sequence[Usage], time: float) -> Usage:
    return min(samples, key=lambda sample: abs(sample.time - time))


_ONE_FILE = 0.25  # share of the duration: its index grows evenly


def main() -> int:
    """Run the campaign; return 1 if there are faults, or if a run grows."""
    parser = parser_of('endurance', __doc__, page=PAGE, seed=False)
    parser.add_argument('--hours', type=float, default=24.0, help='of simulated time')
    parser.add_argument('--rate', type=float, default=100.0, help='ticks per simulated second')
    parser.add_argument('--scenes', nargs='+', default=['demo', 'excavator_delay'])
    parser.add_argument('--minutes', type=float, default=10.0, help='over DDS')
    only = parser.add_mutually_exclusive_group()
    only.add_argument('--accelerated', action='store_true', help='only this')
    only.add_argument('--dds', action='store_true', help='only this')
    options = parser.parse_args()
    begin = datetime.now().astimezone()
    tables: list[Table] = []
    faults: list[str] = []
    if not options.dds:
        runs = accelerated.run_all(_plans(options), options.jobs)
        tables += accelerated_tables(runs)
        faults += [fault for run in runs for fault in run.faults]
        rings = [run for run in runs if run.plan.keep_files]
        faults += [f'{run.plan.name} grows' for run in rings if not flatness(run.samples).flat]
    if not options.accelerated:
        say(f'over DDS: {options.minutes:g} min')
        run = over_dds.run(options.minutes)
        tables += dds_tables(run)
        faults += run.faults
        if run.samples and not flatness(run.samples).flat:
            faults.append('the node grows')
    publish([*tables, machine_table(begin)], PAGE if options.write else None)
    for fault in faults:
        say(fault)
    return int(bool(faults))


def _plans(options: argparse.Namespace) -> list[accelerated.Plan]:
    plans = [accelerated.Plan(scene, options.hours, options.rate) for scene in options.scenes]
    one = plans[0]._replace(hours=_ONE_FILE * options.hours, split_seconds=0.0, keep_files=0)
    return [*plans, one]


if __name__ == '__main__':
    sys.exit(exit_code(main))
