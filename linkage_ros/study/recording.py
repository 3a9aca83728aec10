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
What recording costs, and what a crash loses.

The scene ticks in real time and is recorded as the node does it. A power cut loses what was
recorded since the flush before the last one began, until the last is done: the flush period and
the wait for the disk. A killed process loses no more. The price is the processor time of the
recorder's thread and of passing the messages to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
import gc
from itertools import count
from pathlib import Path
from statistics import median
import sys
import tempfile
from time import monotonic_ns, sleep, thread_time_ns
from typing import NamedTuple

from linkage_ros.bag.metadata import BagSummary
from linkage_ros.bag.recorder import Recorder
from linkage_ros.bag.storage import FLUSH_AFTER, Storage
from linkage_ros.bag.topic import Topic
from linkage_ros.bag.writer import BagWriter
from linkage_ros.errors import RecordingError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.measuring import alternating, Progress, spread_of
from linkage_ros.messages.joint_values import JOINT_STATE
from linkage_ros.pipeline.pipeline import Pipeline
from linkage_ros.scene.scene import LEAST_FLUSH_PERIOD, Scene
from linkage_ros.study.budget import Loss, Price
from linkage_ros.study.prices import Feed, turn_crank, USUAL_RATE

_SWITCH_INTERVAL = 1e-4  # as in the node, in [s]
_LONGER = 1.1
"""A run is longer than its flush period by this factor, so that it has at least one flush."""

_PATIENCE = 4.0
"""A run may be longer than requested by this factor, until it has flushed."""

_SHORTEST = 0.5  # [s]
_LONGEST_PERIOD = 2.0  # [s]
_ROUNDS = 3


class RecordedRun(NamedTuple):
    """What was measured of a run."""

    per_tick: float  # Processor time for recording a tick, in [µs]
    stake: float  # Longest time that a power cut would have lost, in [s]
    dropped: int


def measure_recording(
    scene: Scene,
    folder: Path,
    *,
    quick: bool = False,
    feed: Feed = turn_crank,
    progress: Progress = lambda _: None,
) -> list[Loss]:
    """
    Record a scene with its own flush period and two others.

    Parameters
    ----------
    scene
        The scene.
    folder
        Folder on the disk to be measured; the bags are made there and removed.
    quick
        Whether to run the scene's own setting only, once.
    feed
        Times and crank messages of a run.
    progress
        Called now and then with the fraction that is done.

    Returns
    -------
    losses
        Of the scene's own setting first; empty if the scene records no bag as it runs.

    Raises
    ------
    RecordingError
        If a bag cannot be made there, or ended early.

    """
    if scene.record is None or scene.record.storage.snapshot_seconds:
        return []
    own = scene.record.storage
    rounds = 1 if quick else _ROUNDS
    settings = [own] if quick else [own, *_others(own)]
    closures = Pipeline(scene).closures
    runs: list[list[RecordedRun]] = [[] for _ in settings]
    lengths = [max(_SHORTEST, _LONGER * each.flush_period) for each in settings]
    done, whole = 0.0, rounds * sum(lengths)
    with tempfile.TemporaryDirectory(prefix='recording_', dir=folder) as temporary:
        for index in alternating(range(len(settings)), rounds):
            progress(done / whole)
            bag = Path(temporary, f'{index}_{len(runs[index])}')
            runs[index].append(
                record_run(scene, closures, bag, settings[index], lengths[index], feed)
            )
            done += lengths[index]
    progress(1.0)
    rate = scene.rate or USUAL_RATE
    return [
        Loss(
            f'record.flush_period: {setting.flush_period:g}',
            max(run.stake for run in found),
            Price(spread_of([run.per_tick for run in found]), rate),
            sum(run.dropped for run in found),
        )
        for setting, found in zip(settings, runs, strict=True)
    ]


def _others(own: Storage) -> Iterator[Storage]:
    """Yield settings that flush more and less often."""
    for factor in (0.2, 2.0):
        period = float(f'{factor * own.flush_period:.2g}')
        if LEAST_FLUSH_PERIOD <= period <= _LONGEST_PERIOD:
            yield replace(own, flush_period=period)


def record_run(
    scene: Scene,
    closures: Sequence[Closure],
    folder: Path,
    storage: Storage,
    seconds: float,
    feed: Feed = turn_crank,
) -> RecordedRun:
    """
    Tick a scene in real time, at its own rate up to 1 kHz, and record it as the node does.

    Parameters
    ----------
    scene
        The scene.
    closures
        Its linkages; they have no state and serve every run.
    folder
        Folder of the bag, which stays.
    storage
        Settings of the recorder.
    seconds
        Duration, in [s]; longer if there was no flush by then.
    feed
        Times and crank messages of the run.

    Raises
    ------
    RecordingError
        If the bag cannot be created, or ended early.

    """
    period = 1e9 / min(scene.rate or USUAL_RATE, USUAL_RATE)
    pipeline = Pipeline(scene, closures)
    with _as_in_the_node():
        files = {name: ('application/yaml', data) for name, data in scene.files.items()}
        writer = _WatchedWriter(folder, _topics(pipeline), files, storage)
        recorder = Recorder(writer, flush_period=storage.flush_period)

        def going_on(now: float) -> bool:
            return now < (seconds if writer.flushes else _PATIENCE * seconds)

        passing = _tick(feed(scene, pipeline), pipeline, recorder, period, going_on)
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
    return RecordedRun(
        per_tick * 1e-3,
        max(flush.stake for flush in writer.flushes) * 1e-9,
        sum(topic.dropped for topic in summary.topics),
    )


def _tick(
    fed: Iterator[tuple[int, bytes]],
    pipeline: Pipeline,
    recorder: Recorder,
    period: float,
    going_on: Callable[[float], bool],
) -> list[int]:
    """Tick at a period, in [ns]; return the time of passing the messages of each tick, in [ns]."""
    crank = 1 if pipeline.topic else 0
    offer = recorder.offer
    passing = []
    begin = monotonic_ns()
    for number, (now, sample) in zip(count(1), fed):
        due = begin + round(number * period)
        wait = due - monotonic_ns()
        if wait > 0:
            sleep(wait * 1e-9)
        if sample:
            pipeline.offer(sample, now)
        tick = pipeline.tick(now)
        before = monotonic_ns()
        if sample:
            offer(0, now, now, sample)
        if tick.message:
            offer(crank, now, now, tick.message)
            for topic, extra in enumerate(tick.extras, crank + 1):
                if extra:
                    offer(topic, now, now, extra)
        after = monotonic_ns()
        passing.append(after - before)
        if not going_on((after - begin) * 1e-9):
            break
    return passing


def _topics(pipeline: Pipeline) -> list[Topic]:
    """Return the topics the node would record, without diagnostics and message definitions."""
    names = [(pipeline.topic, JOINT_STATE)] if pipeline.topic else []
    names.append(('/joint_states', JOINT_STATE))
    names += [(extra.topic.replace('~', '/node'), extra.message) for extra in pipeline.extras]
    return [Topic(name, kind, '', '') for name, kind in names]


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

    def __init__(
        self,
        folder: Path,
        topics: list[Topic],
        attachments: Mapping[str, tuple[str, bytes]],
        storage: Storage,
    ) -> None:
        super().__init__(folder, topics, attachments, storage)
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
