# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Read the messages of a bag ahead of time, and send each when it is due.

Bag time runs on the steady clock from the first message on, at the playback rate. The due time of
a message depends on its log time alone, so a late message delays no other. The same thread
publishes ``/clock``, so the clock is never ahead of a message that has not been sent.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Mapping
from math import inf
from queue import Empty, Full, Queue
from threading import Event, Thread
from time import monotonic_ns, sleep
from typing import NamedTuple, Protocol

from linkage_ros.bag import LogTimeOrder
from linkage_ros.errors import LinkageError

_BATCH = 256
_BATCH_SIZE = 2**20
_BATCHES = 8
"""Limits of reading ahead: batches, and messages and bytes per batch."""

_LOOK = 0.1

LATE = 10_000_000
"""Delay after the due time beyond which a sent message counts as late, in [ns]."""

_FINE = 20_000_000
"""Last part of a wait, in [ns], that cannot be interrupted; a stop is checked before it."""

_LONGEST_WAIT = 60.0  # [s]; `Event.wait` has an upper limit
_REPORT_EVERY = 250_000_000


class PlaybackPart(NamedTuple):
    """The part of a bag that is played."""

    # Range of log times to play, in [ns].
    first: int
    last: float
    topics: Collection[str]  # Topics to play
    loop: bool  # Whether to start again at the end


class QueuedMessage(NamedTuple):
    """A message and its time in the playback."""

    base: int  # Duration of the passes before this one, in [ns] of bag time
    log_time: int  # In [ns]
    # The message.
    topic: str
    data: bytes


def playback_queue(order: LogTimeOrder, part: PlaybackPart) -> Iterator[QueuedMessage]:
    """
    Yield the messages to play.

    BagError if the bag is damaged, after the messages before the damage; LinkageError if the part
    to loop has no duration.
    """
    base = 0
    while True:
        newest = part.first
        for topic, log_time, _, data in order.messages(part.first):
            if log_time > part.last:
                break
            if topic in part.topics:
                newest = max(newest, log_time)
                yield QueuedMessage(base, log_time, topic, data)
        if not part.loop:
            return
        if newest == part.first:
            raise LinkageError(
                '--loop', 'all messages have the same time', 'play it without --loop'
            )
        base += newest - part.first


def read_ahead(
    messages: Iterator[QueuedMessage], stop: Event
) -> Generator[QueuedMessage, None, None]:
    """
    Read messages on another thread, and yield them, until the event is set.

    The thread reads a few batches ahead at most. An exception raised while reading is raised here,
    after the messages that were read before it.
    """
    batches: Queue[list[QueuedMessage] | Exception] = Queue(_BATCHES)
    ended = Event()

    def hand_over(batch: list[QueuedMessage] | Exception) -> bool:
        while not ended.is_set():
            try:
                batches.put(batch, timeout=_LOOK)
            except Full:
                continue
            return True
        return False

    def read_batches() -> None:
        batch: list[QueuedMessage] = []
        size = 0
        error: Exception | None = None
        try:
            for cue in messages:
                batch.append(cue)
                size += len(cue.data)
                if len(batch) == _BATCH or size > _BATCH_SIZE:
                    if not hand_over(batch):
                        return
                    batch, size = [], 0
        except Exception as raised:  # noqa: BLE001 (raised again for the caller)
            error = raised
        if batch and not hand_over(batch):
            return
        hand_over(error or [])

    reader = Thread(target=read_batches, name='read ahead', daemon=True)
    reader.start()
    try:
        while not stop.is_set():
            try:
                batch = batches.get(timeout=_LOOK)
            except Empty:
                continue
            if isinstance(batch, Exception):
                raise batch
            if not batch:
                return
            yield from batch
    finally:
        # The reader thread is not joined: skipping to the start of the part may take long.
        ended.set()


class Steady(Protocol):
    """A monotonic clock that can wait."""

    def now(self) -> int:
        """Return the time, in [ns]."""

    def wait_until(self, due: int) -> bool:
        """Wait until a time, in [ns]; return whether the playback was stopped."""


class SteadyClock:
    """The steady clock of the machine; an event stops its waits."""

    def __init__(self, stop: Event) -> None:
        self._stop = stop
        self.now = monotonic_ns

    def wait_until(self, due: int) -> bool:
        """Wait until a time, in [ns]; return whether the playback was stopped."""
        while (left := due - monotonic_ns()) > _FINE:
            if self._stop.wait(min((left - _FINE) * 1e-9, _LONGEST_WAIT)):
                return True
        if left > 0:
            sleep(left * 1e-9)
        return self._stop.is_set()


class ClockTicks(NamedTuple):
    """Publication of bag time on ``/clock``: the period, in [ns], and the publishing function."""

    period: float
    publish: Callable[[int], None]


class Playback:
    """
    Sends messages when they are due, and counts them.

    ``first``: log time of the start, in [ns]; ``rate``: seconds of bag time per second; ``ticks``
    publish the bag's time; ``progress`` receives the log time, in [ns], now and then.
    """

    def __init__(
        self,
        first: int,
        rate: float,
        publish: Mapping[str, Callable[[bytes], None]],
        steady: Steady,
        ticks: ClockTicks | None = None,
        progress: Callable[[int], None] = lambda _: None,
    ) -> None:
        self._first = first
        self._rate = rate
        self._publish = publish
        self._steady = steady
        self._ticks = ticks
        self._progress = progress
        self.counts = dict.fromkeys(publish, 0)  # Messages sent, for each topic
        self.late = 0  # Messages sent later than due by more than `LATE`
        self.latest = 0  # Greatest delay of a message, in [ns]
        self.played = 0  # Bag time played, in [ns]
        self.took = 0  # Duration of the playback, in [ns]

    def send_messages(self, cues: Iterable[QueuedMessage]) -> None:
        """Send the messages, until there are no more or the clock reports a stop."""
        steady, counts = self._steady, self.counts
        begun: int | None = None
        last_base = number = 0
        tick = next_report = inf
        for base, log_time, topic, data in cues:
            if begun is None:
                begun = next_report = steady.now()
                tick = begun if self._ticks else inf
            offset = base + log_time - self._first
            due = begun + round(offset / self._rate)
            while self._ticks and tick <= due:
                if steady.wait_until(round(tick)):
                    return
                at = round((tick - begun) * self._rate)
                # Rounding must not give a time before the start of a pass.
                self._ticks.publish(self._first + max(0, at - base))
                number += 1
                tick = begun + number * self._ticks.period
            if steady.wait_until(due):
                return
            self._publish[topic](data)
            now = steady.now()
            counts[topic] += 1
            if now - due > LATE:
                self.late += 1
            self.latest = max(self.latest, now - due)
            self.played, self.took = offset, now - begun
            last_base = base
            if now >= next_report:
                self._progress(log_time)
                next_report = now + _REPORT_EVERY
        if self._ticks and begun is not None:
            # So that nodes on simulated time also reach the end of the bag.
            self._ticks.publish(self._first + self.played - last_base)
