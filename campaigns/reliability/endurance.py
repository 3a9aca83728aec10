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
from dataclasses import dataclass, field
import json
from pathlib import Path
from tempfile import TemporaryDirectory
import time
from typing import Any

from bench.processes import MeasurementError
from bench.report import say, Table
from campaigns.campaign import Findings, Page, progress_lines
from campaigns.reliability import accelerated
from campaigns.reliability.accelerated import MESSAGES
from campaigns.reliability.judge import Counts, counts_of, shortcomings
from campaigns.reliability.memory import (
    flatness,
    MOST_GROWTH,
    nearest,
    Usage,
    usage,
    verdict_table,
)
from campaigns.reliability.processes import in_own_process, recording_node
from linkage_ros.bag import read_bag
from rosbags.typesys import get_typestore, Stores

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

_CRANK_RATE = 500
_PATIENCE = 3600.0
"""Time limit for the replay [s]."""

_SAMPLES = 600
"""Number of samples of the node's memory, at most one per second."""


@dataclass(slots=True)
class DdsRun:
    """The outcome of a run of minutes: usage, counts of ticks and bag, and ``replay --json``."""

    minutes: float
    samples: list[Usage] = field(default_factory=list)
    ticks: dict[str, str] = field(default_factory=dict)
    counts: Counts = field(default_factory=dict)
    replayed: dict[str, Any] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)


def run_over_dds(minutes: float) -> DdsRun:
    """
    Run the demo over DDS, on a graph of its own.

    Its bag is split once a minute, since the index of a file stays in memory until its end.
    """
    with TemporaryDirectory(prefix='linkage_ros_endurance_') as name:
        folder = Path(name)
        done = DdsRun(minutes)
        try:
            _record(folder, done)
        except MeasurementError as error:
            done.faults.append(str(error))
            return done
        done.faults += shortcomings(folder / 'bag')
        done.counts = counts_of(folder / 'bag')
        done.ticks = _ticks(folder / 'bag')
        done.replayed = _replayed(folder / 'bag')
        if done.replayed.get('verdict') != 'identical':
            done.faults.append(f'the replay is {done.replayed.get("verdict")}')
        return done


def _record(folder: Path, done: DdsRun) -> None:
    """Run node and source, sample the node's usage, and end both."""
    longest = 60.0 * done.minutes + 120
    split = f'split_seconds: {max(min(60.0, 6.0 * done.minutes), 1.0):g}'
    with recording_node(folder, folder / 'bag', longest, 'demo', (), split) as (graph, node):
        source_arguments = ['--ros-args', '-p', f'rate:={_CRANK_RATE}.0']
        with graph.run_module('linkage_ros.node.crank_source', source_arguments) as source:
            begin = time.monotonic()
            seconds = 60.0 * done.minutes
            step = max(seconds / _SAMPLES, min(1.0, seconds / 40))
            progress = progress_lines(seconds, 's over DDS')
            while (now := time.monotonic() - begin) < seconds:
                node.check_running()
                source.check_running()
                done.samples.append(usage(now, node.pid))
                progress(step)
                time.sleep(max(0.0, begin + step * len(done.samples) - time.monotonic()))
    node.check_end()
    source.check_end()


def _ticks(bag: Path) -> dict[str, str]:
    """Return the last diagnostics in a bag about the ticks and the crank."""
    store = get_typestore(Stores.ROS2_JAZZY)
    last = b''
    for message in read_bag(bag).messages():
        if message.topic == '/diagnostics':
            last = message.data
    if not last:
        return {}
    diagnostics: Any = store.deserialize_cdr(last, 'diagnostic_msgs/msg/DiagnosticArray')
    return {
        pair.key: pair.value
        for status in diagnostics.status
        if status.name.endswith((': tick', ': crank'))
        for pair in status.values
    }


def _replayed(bag: Path) -> dict[str, Any]:
    """Return the result of ``linkage replay --json`` for a bag."""
    answer = in_own_process(['replay', str(bag), '--json'], _PATIENCE)
    try:
        result: dict[str, Any] = json.loads(answer.stdout)
    except ValueError:
        return {'verdict': f'missing: {answer.stderr.strip()}'}
    return result


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


def tables_over_dds(run: DdsRun) -> list[Table]:
    """Return the memory by the minute, its verdict, the counts of messages, and the ticks."""
    title = f'Over DDS: {run.minutes:g} min'
    memory = Table(f'{title}, memory of the node', ('minute', 'kB', 'open files', 'threads'))
    for index in range(11):
        time = 6.0 * run.minutes * index
        if run.samples:
            sample = nearest(run.samples, time)
            memory.rows.append(
                (f'{sample.time / 60.0:.1f}', *(f'{value:,}' for value in sample[1:]))
            )
    verdicts = verdict_table(title, {'linkage_node': run.samples} if run.samples else {})
    messages = Table(f'{title}, messages', MESSAGES)
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
        node = run_over_dds(options.minutes)
        findings.tables.extend(tables_over_dds(node))
        findings.faults.extend(node.faults)
        if node.samples and not flatness(node.samples).flat:
            findings.faults.append('the node grows')
    return findings
