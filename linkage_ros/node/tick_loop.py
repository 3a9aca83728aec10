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
The tick, from the newest crank sample to the published bytes.

One thread, no executor: it waits (for a time, a sample or the simulation's clock), takes what has
come, solves, publishes, and hands the same bytes to the recorder. It never logs and never waits
for another thread; what it has seen stands in its counts, for others to read.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
import itertools
from threading import Event, Thread
from time import monotonic_ns
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.bag.recorder import Recorder
from linkage_ros.kinematics.results import Position
from linkage_ros.kinematics.status import Status
from linkage_ros.messages.joint_state import Rejection
from linkage_ros.messages.single_values import time_message
from linkage_ros.pipeline.pipeline import LinkageTick, Pipeline, Tick

if TYPE_CHECKING:
    from linkage_ros.faults.injection import Change, Injection


# A histogram of durations of constant size, fit for a hot loop and for days.

_STEPS = 5
"""Bits that are kept of a duration: a bin is at most 1/32 wide of its value."""


class DurationHistogram:
    """Counts durations, in [ns], in bins that grow with the duration."""

    __slots__ = ('_bins', 'count', 'longest')

    def __init__(self) -> None:
        self._bins = [0] * (64 << _STEPS)
        self.count = 0
        self.longest = 0

    def add(self, duration: int) -> None:
        """Count a duration, in [ns]; a negative one counts as 0."""
        if duration > self.longest:
            self.longest = duration
        elif duration < 0:
            duration = 0
        shift = duration.bit_length() - _STEPS - 1
        self._bins[duration if shift <= 0 else (shift << _STEPS) + (duration >> shift)] += 1
        self.count += 1

    def percentile(self, percent: float) -> int:
        """Return the duration, in [ns], that so many per cent do not exceed; 0 of nothing."""
        wanted = self.count * percent / 100.0
        seen = 0
        for index, count in enumerate(self._bins):
            seen += count
            if count and seen >= wanted:
                return min(_upper_edge(index), self.longest)
        return 0


def _upper_edge(index: int) -> int:
    shift = (index >> _STEPS) - 1
    if shift <= 0:
        return index
    return ((index - (shift << _STEPS) + 1) << shift) - 1


# The topics that a run records, each by its handle: its number in the bag.
#
# They are numbered here alone. The tick offers messages to the recorder by handle, and the bag's
# topics are described by handle.


class RecordedTopics(NamedTuple):
    """
    The handles; None of a topic that a run does not have.

    Attributes
    ----------
    joint_states, diagnostics
        What every run publishes.
    crank
        What the drives listen to.
    faults
        When faults begin and end.
    withheld
        Ticks without a message of which a replay has to know.
    extras
        The pipeline's further topics.
    resets
        When the pipeline was built anew.
    description
        The robot model. No tick publishes it.

    """

    joint_states: int
    diagnostics: int
    crank: int | None
    faults: int | None
    withheld: int | None
    extras: tuple[int, ...]
    resets: int
    description: int


def recorded_topics(pipeline: Pipeline) -> RecordedTopics:
    """Return the handles of the topics that a run of a pipeline records."""
    handles = itertools.count()
    return RecordedTopics(
        joint_states=next(handles),
        diagnostics=next(handles),
        crank=next(handles) if pipeline.topic else None,
        faults=next(handles) if pipeline.injection is not None else None,
        withheld=next(handles) if pipeline.withholds else None,
        extras=tuple(next(handles) for _ in pipeline.extras),
        resets=next(handles),
        description=next(handles),
    )


_LONGEST_DRAIN = 20_000_000
"""How long a tick takes messages at most, in [ns]: huge ones, each read for the first time."""


@dataclass(slots=True)
class Counts:
    """What the tick has seen since it began; written by its thread alone."""

    ticks: int = 0
    published: int = 0
    silent: int = 0
    withheld: int = 0
    lost: int = 0
    late: int = 0
    clock_jumps: int = 0
    resets: int = 0
    received: int = 0
    """Messages on the drives' topic: used + superseded + ignored + those rejected."""
    used: int = 0
    superseded: int = 0
    """Good ones of which the same tick took a newer."""
    ignored: int = 0
    """Those that do not name the crank: others may share the topic."""
    missed: int = 0
    """Numbers left out where one publisher counts its messages."""
    rejected: dict[Rejection, int] = field(default_factory=lambda: dict.fromkeys(Rejection, 0))
    lateness: DurationHistogram = field(default_factory=DurationHistogram)
    last: Tick | None = None
    unclosed: dict[Status, int] = field(default_factory=lambda: dict.fromkeys(Status, 0))
    last_unclosed: dict[Status, tuple[int, Position]] = field(default_factory=dict)
    """Number of the linkage and its position, where one had the status last."""


_Taken = tuple[bytes, dict[str, Any]]
Take = Callable[[], _Taken | None]
Pace = Callable[['TickLoop', Event], None]
"""Runs a tick loop until the event: waits, and calls `tick_at` or `tick_samples`."""


def _take_nothing() -> None:
    return None


class TickLoop:
    """
    Drives a pipeline.

    Parameters
    ----------
    build
        Builds the pipeline; called again for a reset.
    take
        Takes the next message for the drives, as bytes and message info; nothing where there is
        none. Absent where they listen to no topic.
    publish
        Publishes a serialized JointState.
    own
        Tells the node's own messages from others, where they come back on the crank's topic.
    publish_extras
        For each of the pipeline's extras what publishes it, serialized.
    publish_change
        Publishes that a fault has begun or ended, and returns the message, serialized.
    depth
        How many messages a tick takes at most: as many as the queue before it holds.

    """

    def __init__(
        self,
        build: Callable[[], Pipeline],
        take: Take | None,
        publish: Callable[[bytes], None],
        own: Callable[[bytes], bool] | None = None,
        publish_extras: Sequence[Callable[[bytes], None]] = (),
        publish_change: Callable[[Change], bytes] | None = None,
        depth: int = 100,
    ) -> None:
        self._build = build
        self._take = take or _take_nothing
        self._publish = publish
        self._own = own
        self._depth = depth
        self._sequence = 0
        self._last_time = 0
        self._pipeline = build()
        self.injection = self._pipeline.injection
        self._publish_change = publish_change
        self.topics = recorded_topics(self._pipeline)
        """The handles by which it offers messages to the recorder."""
        self._publish_extras = tuple(zip(self.topics.extras, publish_extras, strict=True))
        self._stopping = Event()
        self._thread: Thread | None = None
        self.counts = Counts()
        self.recorder: Recorder | None = None
        self.reset_requested = False
        self.several_publishers = False
        """Whether more than one was seen on the drives' topic: their numbers go apart."""
        self.failure = ''
        self._begun = 0
        self.seconds = 0.0

    def start(self, pace: Pace) -> None:
        """Start ticking on a thread of its own."""
        self._stopping.clear()
        self._begun = monotonic_ns()
        self._thread = Thread(target=self._guarded, args=(pace,), name='tick', daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop ticking and wait for the end of the last tick."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
            self.seconds = (monotonic_ns() - self._begun) * 1e-9

    @property
    def running(self) -> bool:
        """Whether it has been started and not stopped."""
        return self._thread is not None

    @property
    def samples(self) -> str:
        """Return what became of the messages on the drives' topic, in words."""
        counts = self.counts
        return (
            f'{counts.received} received, {counts.used} used, {counts.superseded} superseded, '
            f'{sum(counts.rejected.values())} rejected'
            + (f', {counts.ignored} without the crank' if counts.ignored else '')
            + (f'; {self.missed} lost before' if self.missed else '')
        )

    @property
    def missed(self) -> int | None:
        """
        Return how many messages got lost between publisher and tick; None where none can tell.

        The queue of the middleware lets the oldest go where it is full, and says nothing of it.
        But a publisher numbers its messages.
        """
        if self.several_publishers or (self.counts.received and not self._sequence):
            return None
        return self.counts.missed

    @property
    def newest_stamp(self) -> int:
        """Stamp of the newest good sample, in [ns]; 0 before the first."""
        return self._pipeline.newest_stamp

    @property
    def pipeline(self) -> Pipeline:
        """Return the pipeline, as it was built last."""
        return self._pipeline

    def _take_messages(self, clock: Callable[[], int] | None, tick_for_each: bool) -> None:
        """
        Take the messages that have come: record, count and offer each to the pipeline.

        Parameters
        ----------
        clock
            Returns the time when a message is taken, in [ns]; absent, that is `_last_time`, which
            is set to it.
        tick_for_each
            Whether to tick for each good one, at its stamp.

        """
        counts, pipeline = self.counts, self._pipeline
        good, end = 0, 0
        for _ in range(self._depth):
            if (taken := self._take()) is None:
                break
            if clock is not None:
                time = clock()
                # A message may be younger than the tick that takes it.
                if self.injection is not None:
                    time = self.injection.clock(time)
                if time > self._last_time:
                    self._last_time = time
            now = self._last_time
            message, info = taken
            if self._own is None or not self._own(message):
                counts.received += 1
                if number := info.get('publication_sequence_number'):
                    if 0 < self._sequence < number:  # else the first, or of a publisher begun anew
                        counts.missed += number - self._sequence - 1
                    self._sequence = number
                recorder, topic = self.recorder, self.topics.crank  # another thread takes it away
                if recorder is not None and topic is not None:
                    recorder.offer(topic, now, info['source_timestamp'], message)
                rejection = pipeline.offer(message, now)
                if rejection is None:
                    good += 1
                    if tick_for_each:
                        self._tick(now, pipeline.newest_stamp)
                elif rejection is Rejection.MISSING:
                    counts.ignored += 1
                else:
                    counts.rejected[rejection] += 1
            if not end:
                end = monotonic_ns() + _LONGEST_DRAIN
            elif monotonic_ns() > end:
                break
        if good:
            used = good if tick_for_each else pipeline.newly_used()
            counts.used += used
            counts.superseded += good - used

    def tick_at(self, now: int, clock: Callable[[], int] | None = None) -> None:
        """
        Take the messages that have come, and tick.

        Parameters
        ----------
        now
            The time of the tick, in [ns].
        clock
            Returns the time when a message is taken, in [ns]; absent, that is the tick's.

        """
        if self.injection is not None:
            now = self._inject(self.injection, now)
        if now < self._last_time or self.reset_requested:
            self._rebuild(now)
        self._last_time = now
        self._take_messages(clock, tick_for_each=False)
        self._tick(self._last_time, now)

    def tick_samples(self, now: int, clock: Callable[[], int] | None = None) -> None:
        """Take the messages that have come, as `tick_at`, and tick for each, at its stamp."""
        if self.injection is not None:
            now = self._inject(self.injection, now)
        if now < self._last_time or self.reset_requested:
            self._rebuild(now)
        self._last_time = now
        self._take_messages(clock, tick_for_each=True)

    def _rebuild(self, now: int) -> None:
        """Build the pipeline anew, since time has jumped back or one has asked."""
        if now < self._last_time:
            self.counts.clock_jumps += 1
        if self.reset_requested:
            self.reset_requested = False
            self.counts.resets += 1
        if (recorder := self.recorder) is not None:
            # Where the clock jumps back after ticks of which nothing is recorded, the times in the
            # bag go on.
            recorder.offer(self.topics.resets, now, now, time_message(now))
        self._pipeline = self._build()

    def _inject(self, injection: Injection, now: int) -> int:
        """Let faults begin and end; return the time by which the tick goes, in [ns]."""
        changes = injection.advance(now)
        now = injection.clock(now)
        for change in changes:
            if self._publish_change is not None:
                message = self._publish_change(change)
                recorder, topic = self.recorder, self.topics.faults
                if recorder is not None and topic is not None:
                    recorder.offer(topic, now, now, message)
        return now

    def _tick(self, now: int, at: int) -> None:
        """Solve now for a time, both in [ns]; publish, record and count."""
        counts = self.counts
        counts.last = tick = self._pipeline.tick(at)
        message, extras = tick.message, tick.extras
        recorder = self.recorder
        if message:
            self._publish(message)
            if recorder is not None:
                recorder.offer(self.topics.joint_states, now, at, message)
            counts.published += 1
        # Of a linkage without a pose there may be an extra, which then tells of the tick.
        if extras:
            for (topic, publish), extra in zip(self._publish_extras, extras, strict=True):
                if extra:
                    publish(extra)
                    if recorder is not None:
                        recorder.offer(topic, now, at, extra)
        elif message or recorder is None:
            pass
        elif (withheld := self.topics.withheld) is not None and self._pipeline.remembers(tick):
            recorder.offer(withheld, now, at, time_message(at))
        counts.ticks += 1
        for number, one in enumerate(tick.seen):
            if not isinstance(one, LinkageTick):
                _, reading, _ = one
                counts.withheld += reading is None
                continue
            position = one.position
            if position is None:
                counts.silent += 1
                continue
            if position.status is not Status.CLOSED:
                counts.unclosed[position.status] += 1
                counts.last_unclosed[position.status] = number, position
            if one.reading is None and position.joints:
                counts.withheld += 1

    def _guarded(self, pace: Pace) -> None:
        # A defect here must neither vanish with its thread nor show a traceback.
        try:
            pace(self, self._stopping)
        except Exception as error:  # noqa: BLE001 (see above)
            self.failure = f'{type(error).__name__}: {error}'
