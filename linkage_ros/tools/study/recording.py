# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What recording costs, and what a crash loses.

The scene ticks in real time and is recorded as the node does it. A power cut loses what was
recorded since the flush before the last one began, until the last is done: the flush period and
the wait for the disk. A killed process loses no more. The price is the processor time of the
recorder's thread and of passing the messages to it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
import gc
from pathlib import Path
from statistics import median
import sys
import tempfile
from time import monotonic_ns, sleep, thread_time_ns
from typing import Any, NamedTuple

from linkage_ros.bag import BagSummary, BagWriter, FLUSH_AFTER, Recorder, Storage, Topic
from linkage_ros.description import LEAST_FLUSH_PERIOD, Scene
from linkage_ros.errors import RecordingError
from linkage_ros.replay import to_attachments
from linkage_ros.tick import find_handles, list_run_topics, Pipeline
from linkage_ros.tools.study.budget import Price, RecordingLoss
from linkage_ros.tools.study.measuring import alternate_order, Progress, spread_of
from linkage_ros.tools.study.prices import Feed, turn_crank, USUAL_RATE

_SWITCH_INTERVAL = 1e-4  # as in the node, in [s]
_LONGER = 1.1
"""A run is longer than its flush period by this factor, so that it has at least one flush."""

_PATIENCE = 4.0
"""A run may be longer than requested by this factor, until it has flushed."""

_SHORTEST = 0.5  # [s]
_LONGEST_PERIOD = 2.0  # [s]
_ROUNDS = 3


def measure_recording(
    scene: Scene,
    folder: Path,
    *,
    quick: bool = False,
    feed: Feed = turn_crank,
    progress: Progress = lambda _: None,
) -> list[RecordingLoss]:
    """
    Record a scene with its own flush period and two others; if quick, with its own only, once.

    The bags are made in the folder, on the disk to be measured, and removed. The scene's own
    setting comes first; there is none if it records no bag as it runs. A RecordingError says that
    a bag cannot be made there, or ended early.
    """
    if scene.record is None or scene.record.storage.snapshot_seconds:
        return []
    own = scene.record.storage
    rounds, settings = (1, [own]) if quick else (_ROUNDS, [own, *_other_periods(own)])
    closures = Pipeline(scene).closures
    runs: list[list[_RecordedRun]] = [[] for _ in settings]
    lengths = [max(_SHORTEST, _LONGER * setting.flush_period) for setting in settings]
    done, whole = 0.0, rounds * sum(lengths)
    with tempfile.TemporaryDirectory(prefix='recording_', dir=folder) as temporary:
        for index in alternate_order(range(len(settings)), rounds):
            progress(done / whole)
            bag = Path(temporary, f'{index}_{len(runs[index])}')
            pipeline = Pipeline(scene, closures)
            runs[index].append(
                _record_run(scene, pipeline, bag, settings[index], lengths[index], feed)
            )
            done += lengths[index]
    progress(1.0)
    rate = scene.rate or USUAL_RATE
    return [
        RecordingLoss(
            f'record.flush_period: {setting.flush_period:g}',
            max(run.stake for run in runs_of_setting),
            Price(spread_of([run.per_tick for run in runs_of_setting]), rate),
            sum(run.dropped for run in runs_of_setting),
        )
        for setting, runs_of_setting in zip(settings, runs, strict=True)
    ]


def _other_periods(own: Storage) -> Iterator[Storage]:
    """Yield settings that flush more and less often."""
    for factor in (0.2, 2.0):
        period = float(f'{factor * own.flush_period:.2g}')
        if LEAST_FLUSH_PERIOD <= period <= _LONGEST_PERIOD:
            yield replace(own, flush_period=period)


class _RecordedRun(NamedTuple):
    """What was measured of a run."""

    per_tick: float  # Processor time for recording a tick, in [µs]
    stake: float  # Longest time that a power cut would have lost, in [s]
    dropped: int


def _record_run(
    scene: Scene, pipeline: Pipeline, folder: Path, storage: Storage, seconds: float, feed: Feed
) -> _RecordedRun:
    """Tick in real time, at the scene's rate up to 1 kHz, and record it as the node does."""
    period = 1e9 / min(scene.rate or USUAL_RATE, USUAL_RATE)
    topics = list_run_topics(pipeline)
    handles = find_handles(topics)
    passing = []
    with _as_in_the_node():
        files = to_attachments(scene.files)
        # Their definitions and their names on the graph cost nothing after the start.
        empty = [Topic(f'/{topic.name}', topic.type, '', '') for topic in topics]
        writer = _WatchedWriter(folder, empty, files, storage)
        recorder = Recorder(writer, flush_period=storage.flush_period)
        offer = recorder.offer
        begin = monotonic_ns()
        for number, (now, sample) in enumerate(feed(scene, pipeline), 1):
            wait = begin + round(number * period) - monotonic_ns()
            if wait > 0:
                sleep(wait * 1e-9)
            if sample:
                pipeline.offer(sample, now)
            tick = pipeline.tick(now)
            before = monotonic_ns()
            if sample and handles.crank is not None:
                offer(handles.crank, now, now, sample)
            if tick.message:
                offer(handles.joint_states, now, now, tick.message)
                for topic, extra in zip(handles.extras, tick.extras, strict=False):
                    if extra:
                        offer(topic, now, now, extra)
            passing.append(monotonic_ns() - before)
            patience = 1.0 if writer.flushes else _PATIENCE
            if (before - begin) * 1e-9 >= patience * seconds:
                break
        summary = recorder.stop()
    if summary.failure or not writer.flushes:
        reason = summary.failure or 'the disk was not written to in time'
        raise RecordingError(folder, f'cannot be measured: {reason}', 'name another folder')
    # A run has only one flush or a few: they count with the cost of one, at the rate of the
    # flush period.
    flushing = sum(flush.cpu for flush in writer.flushes)
    between = FLUSH_AFTER * storage.flush_period * 1e9 / period
    writing = (writer.cpu - flushing) / len(passing)
    per_tick = writing + flushing / len(writer.flushes) / between + median(passing)
    return _RecordedRun(
        per_tick * 1e-3,
        max(flush.stake for flush in writer.flushes) * 1e-9,
        sum(topic.dropped for topic in summary.topics),
    )


@contextmanager
def _as_in_the_node() -> Iterator[None]:
    """Switch threads as often as the node does, with garbage collection off."""
    interval, collecting = sys.getswitchinterval(), gc.isenabled()
    gc.collect()
    gc.disable()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    try:
        yield
    finally:
        sys.setswitchinterval(interval)
        if collecting:
            gc.enable()


class _Flush(NamedTuple):
    """A flush, in [ns]."""

    cpu: int  # Processor time of the recorder's thread
    stake: int  # From the begin of the previous flush to the end of this one


class _WatchedWriter(BagWriter):
    """A writer that measures its own cost; only its constructor runs outside its thread."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.flushes: list[_Flush] = []
        self.cpu = 0
        self._safe_from = monotonic_ns()

    def flush(self) -> None:
        begin, worked = monotonic_ns(), thread_time_ns()
        super().flush()
        cpu = thread_time_ns() - worked
        self.flushes.append(_Flush(cpu, monotonic_ns() - self._safe_from))
        self._safe_from = begin

    def close(self, custom: Mapping[str, str] | None = None) -> BagSummary:
        self.cpu = self.cpu or thread_time_ns()
        return super().close(custom)
