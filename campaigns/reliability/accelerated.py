# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A day of ticks without waiting: the node's tick loop and its recorder on simulated time.

From time to time the ticks wait for the recorder's queue, so that nothing is dropped. In a real
run the disk has the time between ticks, which is missing here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from math import cos, sin, tau
import multiprocessing
from pathlib import Path
from tempfile import TemporaryDirectory
import time
from typing import Any, NamedTuple

from bench.report import say, Table
from campaigns.campaign import progress_lines
from campaigns.reliability.judge import shortcomings
from campaigns.reliability.memory import nearest, Usage, usage, verdict_table
from campaigns.reliability.recording import START, wait_for
from linkage_ros.bag import BagWriter, Recorder, RecordingSummary, Storage, Topic
from linkage_ros.description import load_scene
from linkage_ros.messages import JointStateWriter, NANOSECONDS
from linkage_ros.tick import list_run_topics, Pipeline, TickLoop
from rosbags.typesys import get_typestore, Stores

_SPEED = 0.5  # of the crank [turns/s]
_BURST = 500  # ticks between two checks of the queue
_FLUSH_PERIOD = 0.004
"""In [s]. At some hundred times real time it corresponds to one second of a real run."""


class Plan(NamedTuple):
    """A run of a shipped scene for hours of simulated time, at a rate, with options of the bag."""

    scene: str
    hours: float
    rate: float
    split_seconds: float = 60.0
    keep_files: int = 3

    @property
    def name(self) -> str:
        """Return its name in tables."""
        return self.scene if self.split_seconds else f'{self.scene}, one file'


@dataclass(slots=True)
class Run:
    """The outcome of a run: the usage of the process, and the counts of recorder and tick loop."""

    plan: Plan
    samples: list[Usage]
    summary: RecordingSummary
    published: int
    seconds: float
    faults: list[str] = field(default_factory=list)


def run_all(plans: Sequence[Plan], jobs: int) -> list[Run]:
    """Run plans in parallel, each in a new process: memory freed by another run hides growth."""
    with multiprocessing.get_context('spawn').Pool(jobs, maxtasksperchild=1) as pool:
        return list(pool.imap(run, plans))


def run(plan: Plan) -> Run:
    """Run a plan, and compare the bag with the counts."""
    say(f'{plan.name}: {plan.hours:g} h at {plan.rate:g} Hz')
    with TemporaryDirectory(prefix='linkage_ros_endurance_') as name:
        return _run(plan, Path(name))


def _run(plan: Plan, folder: Path) -> Run:
    scene = load_scene(plan.scene, [f'rate={plan.rate:g}'])
    pending: list[tuple[bytes, dict[str, Any]]] = []
    take = partial(_take, pending)
    pipeline = Pipeline(scene)
    extras = [lambda message: None for _ in pipeline.extras]
    from_topic = bool(pipeline.topic)
    loop = TickLoop(
        partial(Pipeline, scene, pipeline.closures),
        take if from_topic else None,
        lambda message: None,
        publish_extras=extras,
    )
    storage = Storage(split_seconds=plan.split_seconds, keep_files=plan.keep_files)
    attached = {name: ('application/yaml', data) for name, data in scene.files.items()}
    writer = BagWriter(folder / 'bag', _topics(pipeline), attached, storage)
    loop.recorder = recorder = Recorder(writer, flush_period=_FLUSH_PERIOD)
    crank = JointStateWriter(scene.linkages[0].input_names).write
    period, ticks = round(NANOSECONDS / plan.rate), round(plan.hours * 3600.0 * plan.rate)
    between = max(ticks // 144, 1)  # ten minutes of 24 h
    progress = progress_lines(ticks, f'ticks of {plan.name}')
    begin = time.monotonic()
    samples = [usage(0.0)]
    for tick in range(1, ticks + 1):
        now = START + tick * period
        if from_topic:
            angle, rate = _crank_at(tick / plan.rate)
            message = crank(now - 100_000, (angle,), (rate,))
            pending.append((message, {'source_timestamp': now - 90_000}))
        loop.tick_at(now)
        if tick % _BURST == 0:
            wait_for(recorder, 4 * _BURST)
        if tick % between == 0:
            wait_for(recorder, 0)
            samples.append(usage(tick / plan.rate))
            progress(between)
    seconds = time.monotonic() - begin
    summary = recorder.stop(timeout=60.0)
    done = Run(plan, samples, summary, loop.counts.published, seconds)
    done.faults += shortcomings(summary.folder)
    received = {counts.name: counts.received for counts in summary.topics}
    if received['/joint_states'] != loop.counts.published or not loop.counts.published:
        done.faults.append('the recorder did not receive every joint state')
    if from_topic and not received['/crank_states'] == loop.counts.used == ticks:
        done.faults.append('not every sample was used')
    if summary.failure or any(c.received != c.recorded + c.discarded for c in summary.topics):
        done.faults.append(f'dropped: {summary.failure or summary.topics}')
    if len(list(summary.folder.glob('*.mcap'))) != (plan.keep_files if plan.split_seconds else 1):
        done.faults.append('wrong number of files')
    return done


def _take(pending: list[tuple[bytes, dict[str, Any]]]) -> tuple[bytes, dict[str, Any]] | None:
    return pending.pop() if pending else None


def _crank_at(seconds: float) -> tuple[float, float]:
    """Return angle and rate of a crank whose speed oscillates about its mean."""
    turns = tau * _SPEED * seconds
    return turns + 0.3 * sin(turns), tau * _SPEED * (1.0 + 0.3 * cos(turns))


def _topics(pipeline: Pipeline) -> list[Topic]:
    """Describe the topics in the order of the tick loop's numbers."""
    store = get_typestore(Stores.ROS2_JAZZY)
    topics = [
        (each.name.replace('~', '/linkage_node'), each.type) for each in list_run_topics(pipeline)
    ]
    return [
        Topic(
            f'/{name}'.replace('//', '/'),
            kind,
            store.generate_msgdef(kind, ros_version=2)[0],
            store.hash_rihs01(kind),
        )
        for name, kind in topics
    ]


MESSAGES = ('', 'received', 'recorded', 'dropped', 'removed by the ring')


def tables_of(runs: Sequence[Run]) -> list[Table]:
    """Return the memory by the hour, its verdicts, the counts of messages and the durations."""
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
    single = [run.plan.name for run in runs if not run.plan.keep_files]
    verdicts = verdict_table(title, {run.plan.name: run.samples for run in runs}, single)
    messages = Table(f'{title}, messages', MESSAGES)
    for run in runs:
        for counts in run.summary.topics:
            numbers = (counts.received, counts.recorded, counts.dropped, counts.discarded)
            messages.rows.append([f'{run.plan.name}: {counts.name}', *(f'{n:,}' for n in numbers)])
    took = Table(f'{title}, duration', ('', 'h', 'ticks', 's', 'µs a tick', 'faults'))
    for run in runs:
        ticks = round(run.plan.hours * 3600.0 * run.plan.rate)
        pace, faults = f'{1e6 * run.seconds / ticks:.1f}', '; '.join(run.faults) or 'none'
        counted = f'{run.plan.hours:g}', f'{ticks:,}', f'{run.seconds:.0f}', pace
        took.rows.append([run.plan.name, *counted, faults])
    return [memory, verdicts, messages, took]


def _at(samples: Sequence[Usage], time: float) -> str:
    """Return the memory at a time; '' after the end."""
    if time > samples[-1].time * 1.001:
        return ''
    return f'{nearest(samples, time).resident:,}'
