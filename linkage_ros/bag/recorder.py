# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Record on a separate thread; the caller only hands messages over.

``offer`` is two length checks and an append. The recorder's thread does the rest. A disk that
stalls or fills stops only that thread: the queue fills, and further messages are counted as
dropped. After a full disk the recording continues in a new file of the bag as soon as there is
space. However it ends, the bag states the outcome of all messages offered until `Recorder.stop`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import count
import json
from pathlib import Path
import threading
import time

from linkage_ros.bag.metadata import BagSummary, count_topics, TopicCounts
from linkage_ros.bag.writer import BagWriter
from linkage_ros.errors import RecordingError

FLUSH_AFTER = 0.9
"""
Fraction of the flush period after which the next flush begins: waking, writing and waiting for the
disk take time too, and messages older than the period must be on the disk.
"""

POLL = 0.02
"""Period at which a thread checks the queue, in [s]."""

ROOM_POLL = 1.0
"""Period at which a recorder checks a full disk for space, in [s]."""

BATCH, NAP = 50, 50e-6
"""
Messages between two naps of a thread, about 0.3 ms of work, and the nap [s].

It is not 0: with a nap of 0 the thread often takes the interpreter back before a waiting tick
wakes up.
"""

PLACE = 16 * 1024
"""
How large a message may be that takes one place in a queue [bytes]; a larger one takes more.

So a bound on the places is one on the bytes too, at most one message more for each thread that
offers. To count bytes, these threads would need a lock, and a tick would wait for it.
"""

_FLUSHED_EVERY = 50_000

OfferedMessage = tuple[int, int, int, bytes]
"""A message in the queue: topic, log time, publish time [ns] and its CDR bytes."""


class DirectRecorder:
    """Writes each message at once, on the thread that offers it."""

    def __init__(self, writer: BagWriter) -> None:
        self._writer = writer
        self._written = [0] * len(writer.topics)
        self._unflushed = 0

    def offer(self, topic: int, log_time: int, publish_time: int, data: bytes) -> None:
        """Write a message; raise RecordingError if that fails."""
        self._written[topic] += self._writer.write(topic, log_time, publish_time, data)
        self._unflushed += 1
        if self._unflushed == _FLUSHED_EVERY:
            self._writer.flush()
            self._unflushed = 0

    @property
    def message_counts(self) -> dict[str, int]:
        """Return the number of messages written on each topic."""
        names = (topic.name for topic in self._writer.topics)
        return dict(zip(names, self._written, strict=True))

    def close(self) -> None:
        """Finish the bag."""
        dropped = dict.fromkeys(self.message_counts, 0)
        self._writer.close({'linkage_ros.dropped': json.dumps(dropped)})


class ThreadCounter:
    """
    A counter that several threads increment without a lock.

    A step of an `itertools.count` is one C call, atomic for threads unlike ``n += 1``. Reading the
    counter takes a step too, so the steps made by reading are subtracted.
    """

    __slots__ = ('_reading', '_readings', 'add')

    def __init__(self) -> None:
        self.add = count().__next__
        self._readings = 0
        self._reading = threading.Lock()

    def read_count(self) -> int:
        with self._reading:
            steps = self.add() - self._readings
            self._readings += 1
            return steps


class MessageQueue:
    """
    Queue of messages to one thread, with counts of offered and dropped messages by topic.

    ``capacity`` messages may wait, each of up to `PLACE` bytes; a larger one counts as several.
    """

    def __init__(self, topics: int, capacity: int) -> None:
        self.is_open = True  # Whether messages are accepted; else they are dropped
        self._capacity = capacity
        self._waiting: deque[OfferedMessage | None] = deque()
        # A counter for each topic.
        self.received = [ThreadCounter() for _ in range(topics)]
        self.dropped = [ThreadCounter() for _ in range(topics)]
        self._add_received = [counter.add for counter in self.received]
        self._add_dropped = [counter.add for counter in self.dropped]

    def offer(self, topic: int, log_time: int, publish_time: int, data: bytes) -> None:
        """
        Hand over one message, from any thread; never blocks, and never raises on a disk error.

        Log time and publish time are in [ns]. The CDR bytes are kept, not copied: pass
        ``bytes(buffer)`` for a buffer that is reused.
        """
        self._add_received[topic]()
        if not self.is_open or len(self._waiting) >= self._capacity:
            self._add_dropped[topic]()
        elif len(data) < PLACE:
            self._waiting.append((topic, log_time, publish_time, data))
        else:
            places = len(data) // PLACE
            self._waiting.extend(((topic, log_time, publish_time, data), *(None,) * places))

    def __len__(self) -> int:
        """Return the number of occupied places."""
        return len(self._waiting)

    def take_messages(self, most: int) -> Iterator[OfferedMessage]:
        """Yield the waiting messages, of at most this number of places."""
        for _ in range(min(most, len(self._waiting))):
            if message := self._waiting.popleft():
                yield message


@dataclass(frozen=True, slots=True)
class RecordingSummary:
    """Outcome of a recording."""

    folder: Path  # Folder of the bag
    # Counts for each topic, in the order of their numbers; no message waits any more, so
    # ``received == recorded + dropped + discarded``.
    topics: tuple[TopicCounts, ...]
    size: int  # Size of the MCAP files [bytes]
    failure: str | None  # Reason for missing messages, on one line; None if no disk has failed


class Recorder:
    """
    Writes a bag on its own thread; owns the writer from now on.

    ``capacity`` messages may wait, each of up to 16 KiB; a larger one counts as several. The
    default is 16 s of two topics at 2 kHz, about 25 MB, and 1 GiB at most. A power cut may lose
    the messages of the last ``flush_period`` [s], if the disk answers within a tenth of this time.
    """

    def __init__(
        self, writer: BagWriter, *, capacity: int = 65536, flush_period: float = 1.0
    ) -> None:
        self.failure: RecordingError | None = None
        """Reason for lost messages; also set after a recording has continued."""
        self._recording = True
        self.folder = writer.folder
        self._writer = writer
        self._flush_after = FLUSH_AFTER * flush_period
        self._queue = MessageQueue(len(writer.topics), capacity)
        self.offer = self._queue.offer
        """Hands over one message, as `MessageQueue.offer`."""
        # Written by the recorder's thread: counts of messages taken by the writer, and of lost
        # ones. One tuple, so that another thread never sees a message in both counts, or in
        # neither.
        self._taken_and_lost = ([0] * len(writer.topics), [0] * len(writer.topics))
        self._flushed_counts = (0,) * len(writer.topics)
        self._custom: dict[str, str] = {}
        writer.make_statistics = self._count_topics
        self._summary: RecordingSummary | None = None
        self._stopping = threading.Event()
        # A daemon thread: a disk that never answers must not keep the process alive.
        self._thread = threading.Thread(target=self._run_thread, name='bag recorder', daemon=True)
        self._thread.start()

    def read_counts(self) -> tuple[TopicCounts, ...]:
        """Return the current counts; after a failure, ``recorded`` counts the messages kept."""
        counts = []
        # Read first, so that no message is discarded before it is recorded.
        discarded = self._writer.discarded
        opened = self._writer.opening_counts
        taken, lost = self._taken_and_lost
        for index, topic in enumerate(self._writer.topics):
            gone = discarded[index]
            recorded = taken[index] + opened[index] - gone
            dropped = self._queue.dropped[index].read_count() + lost[index]
            # Read last, so that a message in transit counts as waiting, and never twice.
            received = self._queue.received[index].read_count() + opened[index]
            waiting = received - recorded - dropped - gone
            counts.append(TopicCounts(topic.name, received, recorded, dropped, gone, waiting))
        return tuple(counts)

    def stop(
        self, custom: Mapping[str, str] | None = None, *, timeout: float = 10.0
    ) -> RecordingSummary:
        """
        Write the waiting messages, close the bag and return the outcome; raises nothing.

        ``custom`` is added to ``custom_data`` in the bag's metadata. After ``timeout`` [s] without
        an answer from the disk, the summary counts only flushed messages as recorded.
        """
        if self._summary:
            return self._summary
        self._custom = dict(custom or {})
        self._queue.is_open = False
        self._stopping.set()
        self._thread.join(timeout)
        stuck = self._thread.is_alive()
        if stuck:
            self.failure = RecordingError(
                self._writer.folder,
                f'the disk has not answered for {timeout:g} s',
                'what was flushed before is readable; check the disk',
            )
        topics = []
        for index, counts in enumerate(self.read_counts()):
            recorded = counts.recorded
            if stuck:
                recorded = max(0, self._flushed_counts[index] - counts.discarded)
            dropped = counts.received - recorded - counts.discarded
            topics.append(replace(counts, recorded=recorded, dropped=dropped, waiting=0))
        self._summary = RecordingSummary(
            folder=self._writer.folder,
            topics=tuple(topics),
            size=self._writer.size,
            failure=str(self.failure) if self.failure else None,
        )
        return self._summary

    @property
    def is_recording(self) -> bool:
        """Return whether messages reach the bag; False after a failure, until there is space."""
        return self._recording

    @property
    def has_ended(self) -> bool:
        """Return whether it has failed for good, and accepts no more messages."""
        return self.failure is not None and not self._queue.is_open

    def _run_thread(self) -> None:
        going = True
        while going:
            try:
                if self._wait_for_space():
                    self._record_messages()
                going = False
            except Exception as error:  # noqa: BLE001, PERF203 (no error may end it silently)
                self._store_failure(error)
        try:
            self._writer.close(self._custom)
        except Exception as error:  # noqa: BLE001 (as above)
            self._store_failure(error)
        self._count_kept()
        self._lose_queue()

    def _wait_for_space(self) -> bool:
        """Wait after a failure until there is space again; return False when stopped."""
        while not self._recording:
            patience = ROOM_POLL if self._writer.out_of_room else None
            if self._stopping.wait(patience):
                return False
            self._recording = self._writer.resume()
        return True

    def _record_messages(self) -> None:
        """Write the offered messages until the recorder is to stop."""
        due = time.monotonic() + self._flush_after
        stopping = False
        while not stopping:
            # Checked before the queue is emptied: messages offered until then are written.
            stopping = self._stopping.wait(max(0.0, min(POLL, due - time.monotonic())))
            more = True
            while more:
                more = self._write_batch()
                now = time.monotonic()
                # A backlog comes first, else a slow disk would only flush.
                if now >= due + self._flush_after * more:
                    self._writer.flush()
                    self._flushed_counts = tuple(self._taken_and_lost[0])
                    # Messages that arrived during the flush have not reached the system yet.
                    due = max(now + self._flush_after, time.monotonic())
                if more:
                    time.sleep(NAP)

    def _count_topics(self, summary: BagSummary) -> list[TopicCounts]:
        """Return the final counts, when no more messages are taken."""
        received, opened = self._queue.received, self._writer.opening_counts
        pairs = zip(received, opened, strict=True)
        return count_topics(summary, [counter.read_count() + more for counter, more in pairs])

    def _write_batch(self) -> bool:
        """Write up to a batch of messages; return whether there may be more."""
        queue, write, (taken, lost) = self._queue, self._writer.write, self._taken_and_lost
        for message in queue.take_messages(BATCH):
            topic = message[0]
            # Until the writer returns, the message is not counted, and so it waits.
            try:
                kept = write(*message)
            except BaseException:
                lost[topic] += 1
                raise
            (taken if kept else lost)[topic] += 1
        return bool(queue)

    def _store_failure(self, error: Exception) -> None:
        """Store the failure, and count only the messages kept by the writer as recorded."""
        self._recording = False
        if not isinstance(error, RecordingError):
            reason = f'the recording ended early: {type(error).__name__}: {error}'
            error = RecordingError(self._writer.folder, reason, 'please report this')
        self._count_kept()
        if not self._writer.out_of_room:
            self._queue.is_open = False
            self._lose_queue()
        self.failure = error

    def _count_kept(self) -> None:
        """Count messages as lost that the writer took and could not keep."""
        kept = self._writer.kept_counts
        taken, lost = self._taken_and_lost
        lost = [gone + had - has for gone, had, has in zip(lost, taken, kept, strict=True)]
        self._taken_and_lost = (list(kept), lost)
        self._flushed_counts = kept

    def _lose_queue(self) -> None:
        """Count the waiting messages as lost."""
        _, lost = self._taken_and_lost
        while self._queue:
            for topic, *_ in self._queue.take_messages(BATCH):
                lost[topic] += 1
