# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The tick, from the newest crank sample to the published bytes.

One thread without an executor: it waits (for a time, a sample or the simulation's clock), takes
the messages that have arrived, solves, publishes, and passes the same bytes to the recorder. It
never logs and never waits for another thread; it leaves its counts for others to read.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from threading import Event, Thread
from time import monotonic_ns, time_ns
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.bag import MessageSink
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import Position, Status
from linkage_ros.messages import Rejection, time_message
from linkage_ros.tick.interpreted_tick import Tick
from linkage_ros.tick.linkage_state import LinkageState
from linkage_ros.tick.pipeline import Pipeline
from linkage_ros.tick.run_topics import find_handles, list_run_topics

if TYPE_CHECKING:
    from linkage_ros.stages.faults import FaultChange, Injection


_STEPS = 5
"""Leading bits kept of a duration: the width of a bin is at most 1/32 of its value."""

_LONGEST_DRAIN = 20_000_000
"""Longest time that a tick takes messages, in [ns]; reached with huge, unparsed messages."""

_TakenMessage = tuple[bytes, dict[str, Any]]
TakeMessage = Callable[[], _TakenMessage | None]


class DurationHistogram:
    """Histogram of durations, in [ns], of constant size; the bins widen with the duration."""

    __slots__ = ('_bins', 'count', 'longest')

    def __init__(self) -> None:
        self._bins = [0] * (64 << _STEPS)
        self.count = 0
        self.longest = 0

    def add_duration(self, duration: int) -> None:
        """Count a duration, in [ns]; a negative one counts as 0."""
        if duration > self.longest:
            self.longest = duration
        elif duration < 0:
            duration = 0
        shift = duration.bit_length() - _STEPS - 1
        self._bins[duration if shift <= 0 else (shift << _STEPS) + (duration >> shift)] += 1
        self.count += 1

    def percentile(self, percent: float) -> int:
        """Return the duration, in [ns], that this percentage does not exceed; 0 without counts."""
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


class Stall(NamedTuple):
    """A lag that lost ticks."""

    duration: int  # In [ns]
    in_tick: bool  # Whether ticks took so long; else the operating system woke the thread so late


@dataclass(slots=True)
class WrenchCounts:
    """Counts of the messages on the topic of a wrench."""

    received: int = 0
    rejected: dict[Rejection, int] = field(default_factory=lambda: dict.fromkeys(Rejection, 0))
    """Those that changed nothing, by the reason."""


@dataclass(slots=True)
class Counts:
    """Counts of the tick since its start; only its thread writes them."""

    time: int = 0
    """When they were read, in [ns] of the steady clock."""
    ticks: int = 0
    published: int = 0
    without_crank: int = 0
    suppressed: int = 0
    lost: int = 0
    stalls: int = 0
    """Times at which ticks were lost."""
    last_stall: Stall | None = None
    """The last of them."""
    late: int = 0
    clock_jumps: int = 0
    resets: int = 0
    received: int = 0
    """Messages on the drives' topic: used + stale + superseded + ignored + rejected."""
    used: int = 0
    stale: int = 0
    """Good messages, the newest of a tick, whose stamps are too old to give a crank."""
    stale_age: int = 0
    """Age of the last of them by its stamp, in [ns]."""
    superseded: int = 0
    """Good messages followed by a newer one in the same tick, or by a clock that jumped back."""
    ignored: int = 0
    """Messages without the crank's joints: other publishers may share the topic."""
    last_ignored: bytes = b''
    missed: int = 0
    """Gaps in the sequence numbers of a single publisher."""
    interleaved: int = 0
    """Crank messages whose number is not above that before: publishers number theirs by one."""
    own_interleaved: int = 0
    """Likewise of messages with the published joints, where they come back on that topic."""
    rejected: dict[Rejection, int] = field(default_factory=lambda: dict.fromkeys(Rejection, 0))
    lateness: DurationHistogram = field(default_factory=DurationHistogram)
    last_tick: Tick | None = None
    unclosed: dict[Status, int] = field(default_factory=lambda: dict.fromkeys(Status, 0))
    last_unclosed: dict[Status, tuple[int, Position]] = field(default_factory=dict)
    """Index and position of the linkage that had each status last."""
    wrenches: tuple[WrenchCounts, ...] = ()
    """Of each topic with a wrench."""
    chatter: Sequence[int] = ()
    """Steps in which motor and crank of each linkage met and parted too often, when read."""


Pace = Callable[['TickLoop', Event], None]
"""Runs a tick loop until the event is set: waits, and calls `tick_at` or `tick_samples`."""


def _take_nothing() -> None:
    return None


class TickLoop:
    """
    Runs a pipeline tick by tick; a reset builds it again.

    ``take_sample`` takes the next message for the drives, as bytes and message info; it returns
    None if there is no message, and is None if the drives have no topic. ``take_wrenches`` do the
    same for each topic with a wrench. A tick takes ``depth`` messages at most, the depth of the
    queue. ``is_own`` recognises the node's own messages on the crank's topic. ``publish_extras``
    has a function for each auxiliary topic; ``publish_change`` publishes the begin or end of a
    fault, and returns the message.
    """

    def __init__(
        self,
        build: Callable[[], Pipeline],
        take_sample: TakeMessage | None,
        publish: Callable[[bytes], None],
        is_own: Callable[[bytes], bool] | None = None,
        publish_extras: Sequence[Callable[[bytes], None]] = (),
        publish_change: Callable[[FaultChange], bytes] | None = None,
        depth: int = 100,
        take_wrenches: Sequence[TakeMessage] = (),
    ) -> None:
        self._build = build
        self._take_sample = take_sample or _take_nothing
        self._publish = publish
        self._is_own = is_own
        self._queue_depth = depth
        self._take_wrenches = take_wrenches
        self._sample_sequence = self._own_sequence = 0
        self._crank_sequences: dict[object, int] = {}
        """Number of the last message that moved the same inputs."""
        self._last_time = 0
        self._jump_time = 0
        """System's time at which the clock was seen to be back, in [ns]."""
        self._rejected_old = 0
        """Samples that the last tick rejected as older than the last one."""
        self._pipeline = build()
        self._meets_cells = [closure.makes_cells_in_motion for closure in self._pipeline.closures]
        self._earlier_chatter: Sequence[int] = [0] * len(self._pipeline.linkages)
        self.injection = self._pipeline.injection
        self._publish_change = publish_change
        self.topics = find_handles(list_run_topics(self._pipeline))
        """Handles under which the tick offers messages to the recorder."""
        self._publish_extras = tuple(zip(self.topics.extras, publish_extras, strict=True))
        self._stopping = Event()
        self._thread: Thread | None = None
        self.counts = Counts(wrenches=tuple(WrenchCounts() for _ in take_wrenches))
        self.recorder: MessageSink | None = None
        self.reset_requested = False
        self.had_several_publishers = False
        """Whether the drives' topic ever had several publishers, each with its own numbers."""
        self.failure = ''
        self._start_time = 0
        self.run_seconds = 0.0

    def start(self, pace: Pace) -> None:
        """Start ticking on its own thread."""
        self._stopping.clear()
        self._start_time = monotonic_ns()
        self._thread = Thread(target=self._guard_pace, args=(pace,), name='tick', daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop ticking and wait for the end of the last tick."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
            self.run_seconds = (monotonic_ns() - self._start_time) * 1e-9

    @property
    def is_running(self) -> bool:
        """Whether the loop is started and not stopped."""
        return self._thread is not None

    @property
    def sample_counts_text(self) -> str:
        """Return the counts of messages on the drives' topic, as text."""
        counts = self.counts
        return (
            f'{counts.received} received, {counts.used} used, {counts.superseded} superseded, '
            f'{sum(counts.rejected.values())} rejected'
            + (f', {counts.stale} stale' if counts.stale else '')
            + (f', {counts.ignored} without the crank' if counts.ignored else '')
            + (f'; {self.missed_messages} lost before' if self.missed_messages else '')
        )

    @property
    def missed_messages(self) -> int | None:
        """
        Return the number of messages lost between publisher and tick; None if it is unknown.

        A full queue of the middleware drops its oldest message without a report. But publishers
        number their messages.
        """
        if self.had_several_publishers or (self.counts.received and not self._sample_sequence):
            return None
        return self.counts.missed

    @property
    def newest_stamp(self) -> int:
        """Stamp of the newest good sample, in [ns]; 0 before the first."""
        return self._pipeline.newest_stamp

    def read_counts(self, time: int) -> Counts:
        """Return the counts as they are at a time of the steady clock, in [ns]."""
        chatter = zip(self._earlier_chatter, self._pipeline.linkages, strict=True)
        counts = self.counts
        return replace(
            counts,
            time=time,
            rejected=counts.rejected.copy(),
            unclosed=counts.unclosed.copy(),
            wrenches=tuple(replace(w, rejected=w.rejected.copy()) for w in counts.wrenches),
            chatter=[earlier + linkage.drive.chatter_count for earlier, linkage in chatter],
        )

    @property
    def pipeline(self) -> Pipeline:
        """Pipeline as it was last built."""
        return self._pipeline

    def _take_messages(self, clock: Callable[[], int] | None, tick_for_each: bool) -> None:
        """
        Take the waiting messages: record, count and offer each to the pipeline.

        A clock advances `_last_time` to the time when a message is taken. Wrenches come first: a
        tick for a sample has them.
        """
        for which, take in enumerate(self._take_wrenches):
            self._take_wrench(which, take, clock)
        counts, pipeline = self.counts, self._pipeline
        good, end = 0, 0
        self._rejected_old = 0
        for _ in range(self._queue_depth):
            if (taken := self._take_sample()) is None:
                break
            if clock is not None:
                self._advance_time(clock())
            now = self._last_time
            message, info = taken
            number = info.get('publication_sequence_number')
            if self._is_own is None or not self._is_own(message):
                counts.received += 1
                if number:
                    # Neither the first message, nor a restarted publisher.
                    if 0 < self._sample_sequence < number:
                        counts.missed += number - self._sample_sequence - 1
                    self._sample_sequence = number
                # Another thread may set it to None.
                recorder, topic = self.recorder, self.topics.crank
                if recorder is not None and topic is not None:
                    recorder.offer(topic, now, info['source_timestamp'], message)
                rejection = pipeline.offer(message, now)
                if rejection is None:
                    good += 1
                    if tick_for_each:
                        self._run_tick(now, pipeline.newest_stamp)
                elif rejection is Rejection.MISSING:
                    counts.ignored += 1
                    counts.last_ignored = message
                elif (
                    rejection is Rejection.STAMP_FUTURE
                    and info.get('received_timestamp', self._jump_time) < self._jump_time
                ):
                    counts.superseded += 1
                else:
                    counts.rejected[rejection] += 1
                    self._rejected_old += rejection is Rejection.STAMP_OLD
                if number and rejection is not Rejection.MISSING:
                    cranks = pipeline.moved_inputs
                    counts.interleaved += number <= self._crank_sequences.get(cranks, 0)
                    self._crank_sequences[cranks] = number
            elif number:
                counts.own_interleaved += number <= self._own_sequence
                self._own_sequence = number
            if not end:
                end = monotonic_ns() + _LONGEST_DRAIN
            elif monotonic_ns() > end:
                break
        if good and tick_for_each:
            counts.used += good
        elif good:
            used, stale = pipeline.count_fresh_and_stale(self._last_time)
            counts.used += used
            counts.superseded += good - used - stale
            if stale:
                counts.stale += stale
                silent = pipeline.silent_inputs(self._last_time)
                counts.stale_age = self._last_time - max(silent.values())

    def _take_wrench(self, index: int, take: TakeMessage, clock: Callable[[], int] | None) -> None:
        """Take the waiting messages of a topic with a wrench: record, offer and count them."""
        counts, wrench = self.counts.wrenches[index], self._pipeline.wrenches[index]
        end = 0
        for _ in range(self._queue_depth):
            if (taken := take()) is None:
                break
            if clock is not None:
                self._advance_time(clock())
            now = self._last_time
            message, info = taken
            counts.received += 1
            if (recorder := self.recorder) is not None:
                recorder.offer(self.topics.wrenches[index], now, info['source_timestamp'], message)
            rejection = wrench.offer_wrench(message, now)
            if rejection is not None:
                counts.rejected[rejection] += 1
            if not end:
                end = monotonic_ns() + _LONGEST_DRAIN
            elif monotonic_ns() > end:
                break

    def _advance_time(self, time: int) -> None:
        """Advance `_last_time`: a message may be newer than the tick that takes it."""
        if self.injection is not None:
            time = self.injection.tick_time(time)
        if time > self._last_time:
            self._last_time = time

    def tick_at(self, now: int, clock: Callable[[], int] | None = None) -> None:
        """
        Take the waiting messages, and tick at the time ``now``, in [ns].

        ``clock`` returns the time when a message is taken, in [ns]; by default it is the time of
        the tick.
        """
        if self.injection is not None:
            now = self._advance_faults(self.injection, now)
        if now < self._last_time or self.reset_requested:
            self._rebuild_pipeline(now)
        self._last_time = now
        self._take_messages(clock, tick_for_each=False)
        self._run_tick(self._last_time, now)

    def tick_samples(self, now: int, clock: Callable[[], int] | None = None) -> None:
        """Take the waiting messages, as in `tick_at`, and tick for each, at its stamp."""
        if self.injection is not None:
            now = self._advance_faults(self.injection, now)
        if now < self._last_time or self.reset_requested:
            self._rebuild_pipeline(now)
        self._last_time = now
        self._take_messages(clock, tick_for_each=True)

    def _rebuild_pipeline(self, now: int) -> None:
        """Build the pipeline again, after a reset request or a backward jump of time."""
        if now < self._last_time:
            # As where a bag is played in a loop: what waits is of the time before, and what came a
            # little before the clock did was not too old.
            self._jump_time = time_ns()
            self.counts.clock_jumps += 1
            self.counts.rejected[Rejection.STAMP_OLD] -= self._rejected_old
            self.counts.superseded += self._rejected_old
        if self.reset_requested:
            self.reset_requested = False
            self.counts.resets += 1
        if (recorder := self.recorder) is not None:
            # Recorded, since the bag itself shows no jump back of the clock after ticks that
            # recorded nothing.
            recorder.offer(self.topics.resets, now, now, time_message(now))
        chatter, self._pipeline = self.read_counts(now).chatter, self._build()
        self._earlier_chatter = chatter

    def _advance_faults(self, injection: Injection, now: int) -> int:
        """Let faults begin and end; return the time of the tick, in [ns]."""
        changes = injection.advance(now)
        now = injection.tick_time(now)
        for change in changes:
            if self._publish_change is not None:
                message = self._publish_change(change)
                recorder, topic = self.recorder, self.topics.faults
                if recorder is not None and topic is not None:
                    recorder.offer(topic, now, now, message)
        return now

    def _run_tick(self, now: int, solve_time: int) -> None:
        """Solve at time ``now`` for time ``solve_time``, in [ns]; publish, record and count."""
        counts = self.counts
        counts.last_tick = tick = self._pipeline.tick(solve_time)
        message, extras = tick.message, tick.extras
        recorder = self.recorder
        if message:
            self._publish(message)
            if recorder is not None:
                recorder.offer(self.topics.joint_states, now, solve_time, message)
            counts.published += 1
        # A linkage without a pose may still have an auxiliary message, which then records the
        # tick.
        if extras:
            for (topic, publish), extra in zip(self._publish_extras, extras, strict=True):
                if extra:
                    publish(extra)
                    if recorder is not None:
                        recorder.offer(topic, now, solve_time, extra)
        elif message or recorder is None:
            pass
        elif (withheld := self.topics.suppressed) is not None and self._pipeline.changes_state(
            tick
        ):
            recorder.offer(withheld, now, solve_time, time_message(solve_time))
        counts.ticks += 1
        if True in self._meets_cells:
            self._make_cells_ahead(tick)
        for index, state in enumerate(tick.computed):
            if not isinstance(state, LinkageState):
                continue
            if state.is_compiled:
                counts.suppressed += state.reading is None
                continue
            position = state.position
            if position is None:
                counts.without_crank += 1
                continue
            if position.status is not Status.CLOSED:
                counts.unclosed[position.status] += 1
                counts.last_unclosed[position.status] = index, position
            if state.reading is None and position.joints:
                counts.suppressed += 1

    def _make_cells_ahead(self, tick: Tick) -> None:
        """Make what the next ticks need, after this one is published."""
        for linkage, meets, state in zip(
            tick.linkages, self._meets_cells, tick.states, strict=True
        ):
            if meets and (crank := state.crank) is not None:
                linkage.closure.make_cells_ahead(crank.angles, crank.rates)

    def _guard_pace(self, pace: Pace) -> None:
        # A defect here must be reported, and without a traceback.
        try:
            pace(self, self._stopping)
        except LinkageError as error:
            self.failure = str(error)
        except Exception as error:  # noqa: BLE001 (see above)
            self.failure = f'{type(error).__name__}: {error}'
