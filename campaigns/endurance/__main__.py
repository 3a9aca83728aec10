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
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
import sys

from bench.report import machine_table, say, show, Table, write_page
from campaigns.endurance import accelerated, over_dds
from campaigns.endurance.accelerated import Run
from campaigns.endurance.memory import flatness, MOST_GROWTH, Usage
from campaigns.endurance.over_dds import DdsRun

INTRO = f"""\
Made by `make endurance`.

**Accelerated**: scenes that come with the package, at another rate, go through the node's own
tick loop and recorder on simulated time, each in a process of its own. The bag is a ring of a
few files; flushes come about as often as in a real run. Every so often the ticks wait for the
recorder, so that nothing is dropped, and memory is looked at while nothing waits.

**Over DDS**: the demo as a node at 1 kHz, with a crank source at 500 Hz, each a process of its
own, in real time; memory is the node's.

Memory is `VmRSS`. The first quarter of a run is warm-up. *Slope* is the median of the slopes
between any two later samples; a run is *flat* if that makes no more than {MOST_GROWTH:,} kB over
these three quarters, and no file or thread is left open. *One file* shows what is not flat: the
index of an MCAP file stays in memory until the file ends, 0.7 kB for each chunk, and each
flush makes one. `split_bytes`, by default 1 GiB, bounds that.
"""

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
    """Return memory by the hour, the judgement on it, and the accounts."""
    first = runs[0].plan
    title = f'Accelerated: {first.hours:g} h at {first.rate:g} Hz'
    memory = Table(
        f'{title}, memory in kB',
        ('hour', *(f'{run.plan.name} ({run.plan.hours:g} h)' for run in runs)),
    )
    step = first.hours / 24.0
    for number in range(25):
        memory.rows.append(
            [f'{number * step:.3g}', *(_at(run.samples, 3600.0 * number * step) for run in runs)]
        )
    judged = _judged(f'{title}, judged')
    for run in runs:
        judged.rows.append(_judgement(run.plan.name, run.samples, exempt=not run.plan.keep_files))
    account = _account(f'{title}, messages')
    for run in runs:
        for counts in run.summary.topics:
            numbers = (counts.received, counts.recorded, counts.dropped, counts.let_go)
            account.rows.append([f'{run.plan.name}: {counts.name}', *(f'{n:,}' for n in numbers)])
    took = Table(
        f'{title}, took',
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
    return [memory, judged, account, took]


def dds_tables(run: DdsRun) -> list[Table]:
    """Return memory by the minute, the judgement on it, the account and the ticks."""
    title = f'Over DDS: {run.minutes:g} min'
    memory = Table(f'{title}, memory of the node', ('minute', 'kB', 'open files', 'threads'))
    for number in range(11):
        time = 6.0 * run.minutes * number
        if run.samples:
            sample = _nearest(run.samples, time)
            memory.rows.append(
                (f'{sample.time / 60.0:.1f}', *(f'{value:,}' for value in sample[1:]))
            )
    judged = _judged(f'{title}, judged')
    if run.samples:
        judged.rows.append(_judgement('linkage_node', run.samples))
    account = _account(f'{title}, messages')
    for topic, received in run.account.get('received', {}).items():
        numbers = [run.account[word][topic] for word in ('recorded', 'dropped', 'let_go')]
        account.rows.append([topic, f'{received:,}', *(f'{number:,}' for number in numbers)])
    ticks = Table(f'{title}, ticks', ('', ''), [(k, run.ticks.get(k, '')) for k in _TICKS])
    replayed = run.replayed
    ticks.rows.append(
        (
            'Replay',
            f'{replayed.get("verdict")}, {replayed.get("compared_ticks", 0):,} ticks compared',
        )
    )
    ticks.rows.append(('Faults', '; '.join(run.faults) or 'none'))
    return [memory, judged, account, ticks]


def _judged(title: str) -> Table:
    return Table(
        title,
        ('', 'slope, kB/h', 'growth, kB', 'peak, kB', 'more files', 'more threads', 'verdict'),
    )


def _judgement(name: str, samples: Sequence[Usage], *, exempt: bool = False) -> list[str]:
    found = flatness(samples)
    verdict = 'flat' if found.flat else 'grows'
    return [
        name,
        f'{3600.0 * found.slope:.1f}',
        f'{found.growth:,.0f}',
        f'{found.peak:,.0f}',
        str(found.files),
        str(found.threads),
        'one file: not judged' if exempt else verdict,
    ]


def _account(title: str) -> Table:
    return Table(title, ('', 'received', 'recorded', 'dropped', 'let go'))


def _at(samples: Sequence[Usage], time: float) -> str:
    """Return the memory at a time; '' after the end."""
    if time > samples[-1].time * 1.001:
        return ''
    return f'{_nearest(samples, time).resident:,}'


def _nearest(samples: Sequence[Usage], time: float) -> Usage:
    return min(samples, key=lambda sample: abs(sample.time - time))


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
            run = over_dds.run(given.minutes)
            tables += dds_tables(run)
            faults += run.faults
            if run.samples and not flatness(run.samples).flat:
                faults.append('the node grows')
    except KeyboardInterrupt:
        say('stopped')
        return 130
    tables.append(machine_table(begin))
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
