# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Run another scene on the crank samples of a bag, or on the commands that it holds.

If both scenes have the same rate, the ticks are those of the run. Where the bag has none, the
recorded scene tells why: if the linkage was open or had no crank state, ticks are one period
apart; else the run lost them, and the other scene makes none either. At another rate ticks are
one period apart from the first one on, and each moves to a tick of the bag that is within half a
period, so that both can be compared. A scene with a rate of 0 ticks for every good sample.

The recorded scene runs together with the other one, at the same ticks. So it is known how much of
the difference comes from the ticks, or from what the bag lacks, and not from the other scene.

A fault that is the same in both scenes begins and ends as in the run; others follow the other
scene. The events that are yielded are those that a recorder would have been given, so that a
replay of them gives the same result: time jumps back where the written times do.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple, TYPE_CHECKING, TypeAlias

from linkage_ros.bag import (
    Bag,
    BagMessage,
    Event,
    FaultEvent,
    ResetEvent,
    RunMetadata,
    SampleEvent,
    TickEvent,
    WrenchEvent,
)
from linkage_ros.description import Scene, SceneLinkage
from linkage_ros.errors import BagError, did_you_mean, LinkageError, list_names
from linkage_ros.messages import (
    head_of,
    input_reader,
    JOINT_STATE_TYPE,
    JointEffortReader,
    Rejection,
    text_message,
    TIME_END,
)
from linkage_ros.replay.node_messages import change_text, read_change
from linkage_ros.replay.replay import Rerun
from linkage_ros.tick import list_run_topics, Pipeline, Tick

if TYPE_CHECKING:
    from linkage_ros.stages.faults import Injection


_TOPICS = {'topic': '/crank_states', 'torque': '/crank_commands'}
"""Drives that take messages, and the topic of each where the bag does not tell."""

_LONGEST_GAP = 60 * 1_000_000_000
"""Longest time without an event of the bag through which a torque drive ticks, in [ns]."""

_LARGEST_LEAD = 2 * 3600 * 1_000_000_000
"""Bound on the lead of a sample's stamp over its tick, in [ns]."""


class CounterfactualTick(NamedTuple):
    """A tick of the other scene."""

    # Time of the tick, and the time it is solved for, in [ns].
    log_time: int
    time: int
    recorded: tuple[bytes, ...]  # Recorded messages of the tick; empty if the bag has none
    tick: Tick | None  # Result of the scene; None if it does not tick then
    unchanged: Tick | None = None  # Result of the recorded scene; None if it cannot be run


ReplayEvent: TypeAlias = SampleEvent | FaultEvent | ResetEvent | CounterfactualTick


def check_drives(scene: Scene, where: str) -> None:
    """Raise LinkageError if a scene does not take crank angles, or efforts, from one topic."""
    drives = [scene_linkage.drive[0] for scene_linkage in scene.linkages]
    for scene_linkage, drive in zip(scene.linkages, drives, strict=True):
        if drive not in _TOPICS or drive != drives[0]:
            with_drive = f' with {drives[0]}' if drive in _TOPICS else ''
            raise LinkageError(
                where,
                f'{f"{scene_linkage.name}: " if scene_linkage.name else ""}its drive is '
                f'{drive}{with_drive}, which takes no samples from a bag',
                f'write drive: {{{drives[0] if with_drive else "topic"}: {{}}}}',
            )
        if scene_linkage.loads is not None and scene_linkage.loads.applied.wrenches:
            raise LinkageError(
                where,
                'its loads.wrenches have topics, and another scene takes no messages from these',
                'leave them out',
            )


class Counterfactual:
    """
    A scene, with all drives on one topic, that runs on the samples of a bag.

    ``recorded`` is the recorded scene; None if unknown. ``takes_own_samples`` says whether the
    samples are those that it took.
    """

    def __init__(
        self, bag: Bag, scene: Scene, recorded: Scene | None, *, takes_own_samples: bool
    ) -> None:
        self._scene = scene
        self._unchanged: Rerun | None = None
        if recorded is not None and not recorded.not_imported:
            drives = [scene_linkage.drive[0] for scene_linkage in recorded.linkages]
            if takes_own_samples or not set(drives) & set(_TOPICS):
                self._unchanged = Rerun(bag, recorded)
        self._shared_faults: set[str] = set()
        # Under torque the linkage moves without commands, too.
        self._moves_without_samples = scene.linkages[0].drive[1].gives_torque
        if recorded is not None:
            self._shared_faults = {
                name for name, fault in scene.faults.items() if recorded.faults.get(name) == fault
            }
        self._injection = self._make_injection()
        self._pipeline = Pipeline(scene, None, self._injection)
        self._closures = self._pipeline.closures
        self.topics = list_run_topics(self._pipeline)
        """Topics that a run of the scene records."""
        self.suppresses_ticks = self._pipeline.suppresses_ticks
        """Whether ticks without a message may matter to a replay."""
        self._last_event_time = self._last_written = (
            0  # the log times of the last event, and of what was written
        )
        self._period = round(1e9 / scene.rate) if scene.rate else 0
        theirs = recorded.rate if recorded is not None else 0.0
        self._recorded_has_rate = theirs > 0.0
        self._same_rate = theirs == scene.rate
        self._slack = min(self._period, round(1e9 / theirs)) // 2 if theirs else 0
        self._due: int | None = None

    def _make_injection(self) -> Injection | None:
        if not self._scene.faults:
            return None
        from linkage_ros.stages.faults import (
            Injection,  # local import: only where a scene has faults
        )

        return Injection(
            {
                name: replace(fault, at=()) if name in self._shared_faults else fault
                for name, fault in self._scene.faults.items()
            }
        )

    def run(self, events: Iterable[Event]) -> Iterator[ReplayEvent]:
        """Yield the events of the run, in order: samples, faults, resets and ticks."""
        return self._on_clock(events) if self._period else self._on_samples(events)

    def _let_unchanged_take(self, event: Event) -> None:
        """Let the recorded scene take an event; one that it refuses ends its run."""
        if self._unchanged is not None:
            try:
                self._unchanged.take(event)
            except BagError:
                self._unchanged = None

    def must_record(self, tick: Tick) -> bool:
        """Return whether a tick without a message is one that a replay has to know of."""
        published = tick.message or tick.extras
        return self.suppresses_ticks and not published and self._pipeline.changes_state(tick)

    def _on_samples(self, events: Iterable[Event]) -> Iterator[ReplayEvent]:
        made: CounterfactualTick | None = None  # its recorded messages may follow
        for event in events:
            if isinstance(event, TickEvent):
                if made is not None and made.time == event.time:
                    yield made._replace(recorded=event.messages)
                    made = None
                else:
                    yield CounterfactualTick(event.log_time, event.time, event.messages, None)
                continue
            if made is not None:
                yield made
                made = None
            if (yield from self._follow(event)):
                now = self._faulty_time(event.log_time)
                made = self._run_tick(now, self._pipeline.newest_stamp, ())
        if made is not None:
            yield made

    def _on_clock(self, events: Iterable[Event]) -> Iterator[ReplayEvent]:
        taken: tuple[int, int] | None = None  # times of the first and the last sample of a tick
        for event in events:
            at = event.log_time
            if taken is not None and self._is_of_later_tick(event, *taken):
                yield from self._tick_silently(taken[1])
                taken = None
            if at < self._last_event_time:
                yield from self._catch_up(self._last_event_time + 1)
                self._due = None
            if isinstance(event, TickEvent):
                self._let_unchanged_take(event)
                yield from self._tick_when_due(at, event.time, event.messages)
                taken = None
                self._last_event_time = at
                continue
            yield from self._catch_up(at)
            self._last_event_time = at
            yield from self._follow(event)
            if isinstance(event, SampleEvent):
                if self._recorded_has_rate:
                    taken = (taken[0] if taken else at), at
                elif self._due is None:
                    self._due = at
        if taken is not None:
            yield from self._tick_silently(taken[1])
        yield from self._catch_up(self._last_event_time + 1)

    def _follow(self, event: Event) -> Generator[ReplayEvent, None, bool]:
        """Let both scenes take an event; return whether it is a good sample."""
        self._let_unchanged_take(event)
        if isinstance(event, SampleEvent):
            return (yield from self._offer_sample(event))
        if isinstance(event, FaultEvent):
            yield from self._follow_fault(event)
        elif isinstance(event, ResetEvent):
            yield self._reset_pipeline(event)
        return False

    def _is_of_later_tick(self, event: Event, first: int, last: int) -> bool:
        """Return whether an event belongs to a later tick than the samples of a time span."""
        if isinstance(event, TickEvent):
            # A tick takes samples after the time that it solves for.
            return event.time > last
        if isinstance(event, SampleEvent | WrenchEvent):
            return not first <= event.log_time <= first + self._period // 2
        return True

    def _tick_silently(self, at: int) -> Iterator[FaultEvent | CounterfactualTick]:
        """Tick where the run took samples and the bag has no message, unless that is elsewhere."""
        if not (self._same_rate and self._would_be_recorded(at)):
            yield from self._tick_when_due(at, at, ())

    def _would_be_recorded(self, at: int) -> bool:
        """Return whether the bag would hold a tick at a time, in [ns], if the run had made it."""
        return self._unchanged is None or not self._unchanged.pipeline.is_idle(at)

    def _tick_when_due(
        self, log_time: int, at: int, recorded: tuple[bytes, ...]
    ) -> Iterator[FaultEvent | CounterfactualTick]:
        """Tick at a tick of the run, if it is due; times in [ns]."""
        yield from self._catch_up(at)
        due = self._due
        if due is not None and at < due - self._slack and not self._same_rate:
            if recorded:
                yield CounterfactualTick(log_time, at, recorded, None)
            return
        yield from self._change_faults(log_time)
        yield from self._tick_unless_back(
            self._faulty_time(log_time), self._faulty_time(at), recorded
        )
        self._due = (at if due is None or self._same_rate else due) + self._period

    def _catch_up(self, to: int) -> Iterator[FaultEvent | CounterfactualTick]:
        """Compute the ticks that were due before a time, in [ns]."""
        while (due := self._due) is not None and due + self._slack < to:
            if self._moves_without_samples:
                ticks = due - self._last_event_time <= _LONGEST_GAP
            else:
                age = self._faulty_time(due) - self._pipeline.newest_stamp
                ticks = -_LARGEST_LEAD <= age <= self._pipeline.max_age
            # Without a crank state, ticks have no result, however many there are; and the times of
            # a damaged bag may span years.
            if not ticks:
                self._due = due + -(-(to - self._slack - due) // self._period) * self._period
                return
            if self._same_rate and self._would_be_recorded(due):
                self._due = due + self._period  # the run lost this tick
                continue
            now = max(due, self._last_event_time)
            yield from self._change_faults(now)
            now = self._faulty_time(now)
            yield from self._tick_unless_back(now, now, ())
            self._due = due + self._period

    def _tick_unless_back(
        self, now: int, at: int, recorded: tuple[bytes, ...]
    ) -> Iterator[CounterfactualTick]:
        """Tick; after a backward jump of time there is no crank state until the next sample."""
        if now >= self._last_written:
            yield self._run_tick(now, at, recorded)
        elif recorded:
            yield CounterfactualTick(now, at, recorded, None)

    def _run_tick(self, now: int, at: int, recorded: tuple[bytes, ...]) -> CounterfactualTick:
        if at >= TIME_END:
            return CounterfactualTick(now, at, recorded, None)
        tick = self._pipeline.tick(at)
        if tick.message or tick.extras or self.must_record(tick):
            self._last_written = now
        return CounterfactualTick(now, at, recorded, tick, self._tick_unchanged(at))

    def _tick_unchanged(self, at: int) -> Tick | None:
        """Return the tick of the recorded scene at a time, in [ns]; None if it cannot be run."""
        try:
            return self._unchanged.tick(at) if self._unchanged is not None else None
        except LinkageError:
            self._unchanged = None
            return None

    def _offer_sample(self, event: SampleEvent) -> Generator[SampleEvent | FaultEvent, None, bool]:
        """Offer a sample; return whether it was good."""
        yield from self._change_faults(event.log_time)
        now = self._faulty_time(event.log_time)
        self._advance_written(now)
        good = self._pipeline.offer(event.data, now) is None
        yield event._replace(log_time=now)
        return good

    def _reset_pipeline(self, event: ResetEvent) -> ResetEvent:
        """Reset where the run did."""
        self._last_written = now = self._faulty_time(event.log_time)
        self._pipeline = Pipeline(self._scene, self._closures, self._injection)
        return ResetEvent(now, now, event.data)

    def _follow_fault(self, event: FaultEvent) -> Iterator[FaultEvent]:
        """Let a fault begin or end as in the run."""
        try:
            name, on = read_change(event.data)
        except ValueError:
            return
        if self._injection is None or name not in self._shared_faults:
            return
        # The times of the bag already contain the effect of a time jump.
        if self._scene.faults[name].kind != 'time_jump':
            self._injection.switch_fault(name, on)
        now = self._faulty_time(event.log_time)
        self._advance_written(now)
        yield FaultEvent(now, now, event.data)

    def _change_faults(self, now: int) -> Iterator[FaultEvent]:
        """Let faults of this scene begin and end at a time, in [ns]."""
        if self._injection is None:
            return
        for change in self._injection.advance(now):
            shifted = self._faulty_time(now)
            self._advance_written(shifted)
            text = change_text(change, self._scene.faults[change.name].kind)
            yield FaultEvent(shifted, shifted, text_message(text))

    def _faulty_time(self, time: int) -> int:
        return time if self._injection is None else self._injection.tick_time(time)

    def _advance_written(self, now: int) -> None:
        """Reset where the written time jumps back; a replay resets there too."""
        if now < self._last_written:
            self._pipeline = Pipeline(self._scene, self._closures, self._injection)
        self._last_written = now


def find_crank_topic(
    bag: Bag,
    messages: Iterable[BagMessage],
    scene: Scene,
    run: RunMetadata,
    recorded: Scene | None,
    typed: str | None,
) -> str:
    """
    Return the topic whose samples drive all linkages of a scene, or raise `BagError`.

    It is ``typed`` by the user. Otherwise it is the topic of the run, the topic in `_TOPICS`, or
    the only topic with such samples, whichever the bag has first; commands are on no other topic,
    since the efforts of joint states are not commands. ``messages`` are read only as far as
    needed.
    """
    drive, parameters = scene.linkages[0].drive
    readers = {
        topic: [
            _sample_reader(scene_linkage, scene.dependent_joints)
            for scene_linkage in scene.linkages
        ]
        for topic in _candidate_topics(bag, drive, run, recorded, typed)
    }
    if parameters.gives_torque and len(readers) == 1:
        return next(iter(readers))  # also where no command came: the linkage moved without
    wanting = {topic: set(range(len(scene.linkages))) for topic in readers}
    names: dict[str, None] = {}
    for topic, _, _, data in messages if readers else ():
        if not wanting.get(topic):
            continue
        candidates = [
            number for number in wanting[topic]
            if not isinstance(readers[topic][number](data), Rejection)
        ]  # fmt: skip
        wanting[topic].difference_update(candidates)
        if not candidates:
            head = head_of(data)
            names |= dict.fromkeys(
                name.decode('utf-8', 'backslashreplace')
                for name in sorted(head[0] if head else ())
            )
        elif sum(not left for left in wanting.values()) == min(2, len(wanting)):
            break
    good = [topic for topic, left in wanting.items() if not left]
    if len(good) == 1:
        return good[0]
    inputs = list(
        dict.fromkeys(
            name for scene_linkage in scene.linkages for name in scene_linkage.sampled_joints
        )
    )
    if good:
        raise BagError(
            bag.path,
            f'holds samples of {list_names(inputs)} on {list_names(good, " and ")}',
            'name one with --crank-topic',
        )
    if parameters.gives_torque and not readers:
        raise BagError(
            bag.path,
            'its run took no commands, which a torque drive needs',
            'name their topic with --crank-topic, or write drive: {topic: {}}',
        )
    raise _no_samples_error(bag, inputs, list(readers), list(names))


def _sample_reader(
    scene_linkage: SceneLinkage, dependent: Collection[str]
) -> Callable[[bytes], object]:
    if scene_linkage.drive[1].gives_torque:
        return JointEffortReader(scene_linkage.input_names, dependent).read
    return input_reader(scene_linkage.sampled_joints)


def _candidate_topics(
    bag: Bag, drive: str, run: RunMetadata, recorded: Scene | None, typed: str | None
) -> Sequence[str]:
    held = [topic.name for topic in bag.topics if topic.type == JOINT_STATE_TYPE]
    if typed is not None:
        if typed not in held:
            raise BagError(
                bag.path,
                f'holds no topic {typed} of {JOINT_STATE_TYPE}',
                did_you_mean(typed, held, f'it holds {list_names(held) or "none"}'),
            )
        return [typed]
    is_replaced = recorded is not None and any(
        scene_linkage.drive[0] != drive for scene_linkage in recorded.linkages
    )
    if run.crank_topic in held and not is_replaced:
        return [run.crank_topic]
    if _TOPICS[drive] in held and not is_replaced:
        return [_TOPICS[drive]]
    if drive == 'torque':
        return []
    return held


def _no_samples_error(
    bag: Bag, inputs: Sequence[str], topics: Sequence[str], names: Sequence[str]
) -> BagError:
    """Return an error message with the missing joints and the existing topics."""
    missing = [name for name in inputs if name not in names] or inputs
    where = f' on {list_names(topics)}' if topics else f'; it has no topic of {JOINT_STATE_TYPE}'
    there = f', which has {list_names(names)}' if names else ''
    return BagError(
        bag.path,
        f'holds no samples of {list_names(missing)}{where}{there}',
        'name a scene whose inputs it holds, or another topic with --crank-topic',
    )
