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


"""A run recorded in real time, with its cost: processor time, disk writes, late ticks."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import gc
from itertools import count
from pathlib import Path
import sys
from time import monotonic_ns, sleep, thread_time_ns
from typing import NamedTuple

from linkage_ros.bag.metadata import BagSummary
from linkage_ros.bag.recorder import Recorder, RecordingSummary
from linkage_ros.bag.storage import Storage
from linkage_ros.bag.topic import Topic
from linkage_ros.bag.writer import BagWriter
from linkage_ros.cost import feed
from linkage_ros.errors import RecordingError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.messages.joint_values import JOINT_STATE
from linkage_ros.pipeline.pipeline import Pipeline
from linkage_ros.scene.scene import Scene

FASTEST = 1000.0
"""Maximum tick rate here, and the rate of a scene that ticks with its samples, in [Hz]."""

_SWITCH_INTERVAL = 1e-4  # as in the node, in [s]
_PATIENCE = 4.0  # a run may be longer than requested by this factor, until it has flushed


class Flush(NamedTuple):
    """A wait for the disk, all in [ns]."""

    # On the monotonic clock.
    begin: int
    end: int
    cpu: int  # Processor time of the recorder thread during the wait
    # From the begin of the previous flush to the end of this one: a power cut just before the end
    # would lose the messages recorded in this time.
    stake: int


class Recorded(NamedTuple):
    """The cost of a run."""

    seconds: float  # Duration of the messages, in [s]
    ticks: tuple[int, ...]  # Lateness of each tick, in [ns]
    # Number of messages on all topics; without a bag, only ``received`` counts.
    received: int
    recorded: int
    dropped: int
    # Processor time of the recorder thread, from its start until all messages were written and
    # before the bag was closed, in [ns].
    cpu: int
    flushes: tuple[Flush, ...]  # The flushes in that time
    # Bytes given to disks in that time, as the system counts them, and the time: [bytes] and [s];
    # None if the system does not count them.
    written: tuple[int, float] | None
    size: int  # Growth of the bag in that time, in [bytes]


def record_run(
    scene: Scene,
    closures: Sequence[Closure],
    folder: Path | None,
    storage: Storage,
    seconds: float,
) -> Recorded:
    """
    Tick a scene in real time, at its own rate up to `FASTEST`, and record it as the node does.

    Parameters
    ----------
    scene
        The scene.
    closures
        Its linkages; they have no state and serve every run.
    folder
        Folder of the bag, which stays. None records nothing, for comparison.
    storage
        Settings of the recorder.
    seconds
        Duration, in [s]; longer if there was no flush by then.

    Raises
    ------
    RecordingError
        If the bag cannot be created, or ended early.

    """
    period = 1e9 / min(scene.rate or FASTEST, FASTEST)
    pipeline = Pipeline(scene, closures)
    with _as_in_the_node():
        if folder is None:
            ticks, span = _tick(scene, pipeline, None, period, lambda now: now < seconds)
            return Recorded(span, ticks, 0, 0, 0, 0, (), None, 0)
        writer = _Watched(folder, _topics(pipeline), _attachments(scene), storage)
        before = writer.size
        recorder = Recorder(writer, flush_period=storage.flush_period)

        def going_on(now: float) -> bool:
            return now < (seconds if writer.flushes else _PATIENCE * seconds)

        ticks, span = _tick(scene, pipeline, recorder, period, going_on)
        summary = recorder.stop()
    if summary.failure or not writer.flushes:
        reason = summary.failure or f'no flush within {span:.1f} s'
        raise RecordingError(folder, f'cannot be measured: {reason}', 'name another folder')
    return _recorded(writer, summary, ticks, span, before)


def _recorded(
    writer: _Watched, summary: RecordingSummary, ticks: tuple[int, ...], span: float, before: int
) -> Recorded:
    return Recorded(
        seconds=span,
        ticks=ticks,
        received=sum(topic.received for topic in summary.topics),
        recorded=sum(topic.recorded for topic in summary.topics),
        dropped=sum(topic.dropped for topic in summary.topics),
        cpu=writer.cpu,
        flushes=tuple(writer.flushes),
        written=writer.written(),
        size=summary.size - before,
    )


def _tick(
    scene: Scene,
    pipeline: Pipeline,
    recorder: Recorder | None,
    period: float,
    going_on: Callable[[float], bool],
) -> tuple[tuple[int, ...], float]:
    """Tick at a period, in [ns]; return each tick's lateness and the total time, in [ns]."""
    crank = 1 if pipeline.topic else 0
    lateness = []
    begin = monotonic_ns()
    for number, (now, sample) in zip(count(1), feed(scene, pipeline)):
        due = begin + round(number * period)
        wait = due - monotonic_ns()
        if wait > 0:
            sleep(wait * 1e-9)
        late = monotonic_ns() - due
        lateness.append(late)
        if sample:
            if recorder:
                recorder.offer(0, now, now, sample)
            pipeline.offer(sample, now)
        tick = pipeline.tick(now)
        if recorder and tick.message:
            recorder.offer(crank, now, now, tick.message)
            for topic, extra in enumerate(tick.extras, crank + 1):
                if extra:
                    recorder.offer(topic, now, now, extra)
        if not going_on((due + late - begin) * 1e-9):
            break
    return tuple(lateness), (monotonic_ns() - begin) * 1e-9


def _topics(pipeline: Pipeline) -> list[Topic]:
    """Return the topics the node would record, without diagnostics and message definitions."""
    names = [(pipeline.topic, JOINT_STATE)] if pipeline.topic else []
    names.append(('/joint_states', JOINT_STATE))
    names += [(extra.topic.replace('~', '/node'), extra.message) for extra in pipeline.extras]
    return [Topic(name, kind, '', '') for name, kind in names]


def _attachments(scene: Scene) -> Mapping[str, tuple[str, bytes]]:
    return {name: ('application/yaml', data) for name, data in scene.files.items()}


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


class _Watched(BagWriter):
    """A writer that measures its own cost; only its constructor runs outside its thread."""

    def __init__(
        self,
        folder: Path,
        topics: list[Topic],
        attachments: Mapping[str, tuple[str, bytes]],
        storage: Storage,
    ) -> None:
        super().__init__(folder, topics, attachments, storage)
        self.flushes: list[Flush] = []
        self.cpu = 0
        self._begun = self._safe_from = monotonic_ns()
        self._given = self._given_at_first = _given_to_disks()

    def flush(self) -> None:
        begin, worked = monotonic_ns(), thread_time_ns()
        super().flush()
        end = monotonic_ns()
        cpu = thread_time_ns() - worked
        self.flushes.append(Flush(begin, end, cpu, end - self._safe_from))
        self._safe_from = begin
        self._given = _given_to_disks()

    def close(self, custom: Mapping[str, str] | None = None) -> BagSummary:
        self.cpu = self.cpu or thread_time_ns()
        return super().close(custom)

    def written(self) -> tuple[int, float] | None:
        """Return the bytes given to disks until the last flush, and the time in [s], or None."""
        if self._given is None or self._given_at_first is None:
            return None
        seconds = (self.flushes[-1].end - self._begun) * 1e-9
        return self._given - self._given_at_first, seconds


def _given_to_disks() -> int | None:
    """Return the bytes this process has given to disks, as Linux counts them, or None."""
    try:
        lines = Path('/proc/self/io').read_text('ascii').splitlines()
    except OSError:
        return None
    return next((int(line.split()[1]) for line in lines if line.startswith('write_bytes:')), None)
