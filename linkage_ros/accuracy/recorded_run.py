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


"""A run recorded in real time, and what it took: of the processor, of the disk, of the ticks."""

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
from linkage_ros.pipeline.pipeline import Pipeline
from linkage_ros.scene.scene import Scene

FASTEST = 1000.0
"""The greatest rate of ticks here, and that of a scene that ticks with its samples, in [Hz]."""

_SWITCH_INTERVAL = 1e-4  # as the node has it, in [s]
_PATIENCE = 4.0  # by how many times a run may be longer than asked for, until it has flushed
_JOINT_STATE = 'sensor_msgs/msg/JointState'


class Flush(NamedTuple):
    """
    A time at which the disk was waited for, all in [ns].

    Attributes
    ----------
    begin, end
        By the steady clock.
    cpu
        Processor time of the recorder thread in between.
    stake
        From the beginning of the flush before to the end of this one: what was recorded in that
        time, a power cut just before the end would have taken.

    """

    begin: int
    end: int
    cpu: int
    stake: int


class Recorded(NamedTuple):
    """
    What a run cost.

    Attributes
    ----------
    seconds
        How long messages came, in [s].
    ticks
        How late each tick was, in [ns].
    received, recorded, dropped
        Messages on all topics; where there is no bag, received only.
    cpu
        What the recorder's thread worked, from its beginning until all was written and before the
        bag was closed, in [ns].
    flushes
        The flushes until then.
    written
        What the system says that it was given for its disks in between, and in which time:
        [bytes] and [s]; nothing where it does not say.
    size
        What the bag grew by from its beginning to its end, in [bytes].

    """

    seconds: float
    ticks: tuple[int, ...]
    received: int
    recorded: int
    dropped: int
    cpu: int
    flushes: tuple[Flush, ...]
    written: tuple[int, float] | None
    size: int


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
        Its linkages: they remember nothing, and serve every run.
    folder
        Where the bag is made; it stays. Without it nothing is recorded, for comparison.
    storage
        How it is stored.
    seconds
        How long, in [s]; longer where there was no flush by then.

    Raises
    ------
    RecordingError
        The bag cannot be made, or ended early.

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
    """Tick at a period, in [ns]; return how late each tick was, in [ns], and how long all took."""
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
    """Return what the node would record beside its diagnostics, without the types' texts."""
    names = [(pipeline.topic, _JOINT_STATE)] if pipeline.topic else []
    names.append(('/joint_states', _JOINT_STATE))
    names += [(extra.topic.replace('~', '/node'), extra.message) for extra in pipeline.extras]
    return [Topic(name, kind, '', '') for name, kind in names]


def _attachments(scene: Scene) -> Mapping[str, tuple[str, bytes]]:
    return {name: ('application/yaml', data) for name, data in scene.files.items()}


@contextmanager
def _as_in_the_node() -> Iterator[None]:
    """Switch threads as often as the node, and do not search for cycles of objects meanwhile."""
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
    """A writer that measures its cost; only its constructor runs outside the recorder thread."""

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
        """Return the bytes given to disks until the last flush, and the time that took, in [s]."""
        if self._given is None or self._given_at_first is None:
            return None
        seconds = (self.flushes[-1].end - self._begun) * 1e-9
        return self._given - self._given_at_first, seconds


def _given_to_disks() -> int | None:
    """Return how much this process has had written to disks, in [bytes], as Linux counts it."""
    try:
        lines = Path('/proc/self/io').read_text('ascii').splitlines()
    except OSError:
        return None
    return next((int(line.split()[1]) for line in lines if line.startswith('write_bytes:')), None)
