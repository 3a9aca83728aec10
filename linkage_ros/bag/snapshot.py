# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Memory of the last seconds of a run, until a snapshot is written to a bag.

`LastSeconds` packs the messages into blocks of bytes. They take half the memory of Python objects,
the garbage collector has nothing to visit, and a snapshot only copies the list of blocks.
`SnapshotMemory` fills it on its own thread; its `offer` works as a recorder's. `SnapshotWriting`
writes a snapshot to a bag, on another thread.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from struct import Struct
import threading
import time
from typing import NamedTuple

from linkage_ros.bag.metadata import count_topics, TopicCounts
from linkage_ros.bag.recorder import BATCH, MessageQueue, NAP, POLL, Recorder, RecordingSummary
from linkage_ros.bag.topic import Topic
from linkage_ros.bag.writer import BagWriter, TIME_END
from linkage_ros.errors import RecordingError

_HEAD = Struct('<HqqqI')
"""Head of a message: topic, elapsed time, log time, publish time [ns], size [bytes]."""

_BLOCK_SIZE = 64 * 1024
_BLOCKS_IN_SPAN = 16

_JUMP = 1_000_000_000
"""A larger step back of log time is a jump of the clock, not a message out of order [ns]."""

_WHERE = 'the memory of the last seconds'
_BLOCKS = 16  # 1 MiB

_AHEAD = 5000
"""Most messages handed to the recorder that it has not written yet."""

_PATIENCE = 10.0
"""Longest wait for a disk that does not answer, in [s]."""


class Extent(NamedTuple):
    """Amount of messages in memory."""

    seconds: float = 0.0  # Time between the oldest message and the newest [s]
    size: int = 0  # Size of the messages [bytes]
    # Whether messages that were not too old had to be removed for lack of memory.
    over_budget: bool = False


class KeptMessages(NamedTuple):
    """
    Content of the memory at an instant, as packed messages; immutable.

    The first message begins at ``begin`` in the first block. From it to the newest pass
    ``seconds``. The memory is whole if no message has been removed.
    """

    blocks: tuple[bytes, ...]
    begin: int
    counts: tuple[int, ...]
    seconds: float
    is_complete: bool

    def messages(self) -> Iterator[tuple[int, int, int, bytes]]:
        """Yield topic, log time, publish time and bytes, in order of arrival."""
        at = self.begin
        for block in self.blocks:
            while at < len(block):
                topic, _, log_time, publish_time, size = _HEAD.unpack_from(block, at)
                data = at + _HEAD.size
                at = data + size
                yield topic, log_time, publish_time, block[data:at]
            at = 0


class LastSeconds:
    """
    Keeps messages; removes those older than ``span`` [ns], and the oldest beyond ``most`` bytes.

    The age of a message is the time that has passed since, by the log times of the topic by which
    most time has passed. Where log times go back, no time passes: if by less than a second, until
    they reach the earlier value again; if by more, the clock has jumped, and time continues from
    there. So messages from before a jump are kept like all others, and differing clocks of the
    topics remove none.
    """

    def __init__(self, topics: int, span: int, most: int) -> None:
        self.discarded = [0] * topics  # Number of removed messages of each topic
        self._span = span
        self._most = most
        self._counts = [0] * topics
        self._now = 0  # time that has passed [ns]
        self._clocks: list[tuple[int, int] | None] = [None] * topics
        self._blocks: deque[bytes] = deque()
        self._begin = 0  # position of the oldest message, in the first block
        self._newest: list[bytes] = []
        self._newest_size, self._newest_since = 0, 0
        self._size = 0
        self._last_removed: int | None = None  # log time of the message that was removed last
        self._last_overflow: int | None = None  # time of the last removal for lack of memory

    def add(self, topic: int, log_time: int, publish_time: int, data: bytes) -> None:
        """Add a message with 63-bit times."""
        latest, passed = self._clocks[topic] or (log_time, self._now)
        if log_time > latest:
            self._now = max(self._now, passed + log_time - latest)
        if log_time >= latest or log_time < latest - _JUMP:
            self._clocks[topic] = log_time, self._now
        age = self._now - self._newest_since
        if self._newest_size >= _BLOCK_SIZE or age > self._span // _BLOCKS_IN_SPAN:
            self._seal_block()
        if not self._newest:
            self._newest_since = self._now
        head = _HEAD.pack(topic, self._now, log_time, publish_time, len(data))
        self._newest += head, data
        size = len(head) + len(data)
        self._newest_size += size
        self._size += size
        self._counts[topic] += 1

    def discard_old(self, limit: int) -> bool:
        """Remove up to `limit` messages that are due; return whether there may be more."""
        # The newest block is small, and none of its messages is too old.
        for _ in range(limit):
            if not self._blocks:
                return False
            block = self._blocks[0]
            topic, at, log_time, _, size = _HEAD.unpack_from(block, self._begin)
            crowded = self._size > self._most
            # Messages taken and made by one tick stay together.
            if self._now - at <= self._span and not crowded and log_time != self._last_removed:
                return False
            if crowded:
                self._last_overflow = self._now
            self._last_removed = log_time
            self.discarded[topic] += 1
            self._counts[topic] -= 1
            self._begin += _HEAD.size + size
            self._size -= _HEAD.size + size
            if self._begin == len(block):
                self._blocks.popleft()
                self._begin = 0
        return True

    def kept_content(self) -> KeptMessages:
        """Return the content of the memory."""
        self._seal_block()
        seconds, _, _ = self.measure_extent()
        whole = not any(self.discarded)
        return KeptMessages(tuple(self._blocks), self._begin, tuple(self._counts), seconds, whole)

    def measure_extent(self) -> Extent:
        """Return the amount of messages in memory."""
        oldest = self._newest_since if self._newest else self._now
        if self._blocks:
            oldest = _HEAD.unpack_from(self._blocks[0], self._begin)[1]
        crowded = self._last_overflow is not None and self._now - self._last_overflow <= self._span
        return Extent((self._now - oldest) * 1e-9, self._size, crowded)

    def free_blocks(self, limit: int) -> bool:
        """Free the memory of up to `limit` blocks; return whether there are more."""
        for _ in range(min(limit, len(self._blocks))):
            self._blocks.popleft()
        return bool(self._blocks)

    def _seal_block(self) -> None:
        if self._newest:
            self._blocks.append(b''.join(self._newest))
            self._newest, self._newest_size = [], 0


class SnapshotMemory:
    """
    Memory of the last ``seconds`` [s] of the offered messages, as in `LastSeconds`.

    A topic's number is its index in ``topics``. If the messages need more than ``most`` bytes, the
    oldest are removed. ``capacity`` is the same as for `Recorder`.
    """

    def __init__(
        self, topics: Sequence[Topic], seconds: float, most: int, *, capacity: int = 65536
    ) -> None:
        self.topics = tuple(topics)
        self.seconds = seconds
        self.extent = Extent()  # Amount of messages in memory
        # Reason why the memory has ended early; None if it has not.
        self.failure: RecordingError | None = None
        self._queue = MessageQueue(len(topics), capacity)
        self.offer = self._queue.offer
        """Hands over one message, as `MessageQueue.offer`."""
        # The owner of the lock: the thread, or briefly the caller that takes a snapshot.
        self._lock = threading.Lock()
        self._last = LastSeconds(len(topics), round(seconds * 1e9), most)
        self._stopping = threading.Event()
        self._thread = threading.Thread(
            target=self._run_thread, name='snapshot memory', daemon=True
        )
        self._thread.start()

    def read_counts(self) -> tuple[TopicCounts, ...]:
        """Return the current counts; messages that wait for the thread count as kept."""
        counts = []
        for index, topic in enumerate(self.topics):
            discarded, dropped = (
                self._last.discarded[index],
                self._queue.dropped[index].read_count(),
            )
            # Read last, so that a message in transit counts as kept, and never twice.
            received = self._queue.received[index].read_count()
            kept = received - discarded - dropped
            counts.append(TopicCounts(topic.name, received, kept, dropped, discarded))
        return tuple(counts)

    def take_content(self) -> KeptMessages:
        """
        Return the content of the memory: all messages offered before that are not too old.

        A RecordingError says that the memory has ended.
        """
        with self._lock:
            if self.failure:
                raise self.failure
            if not self._queue.is_open:
                raise RecordingError(_WHERE, 'has ended', 'ask while the node is active')
            self._store_waiting(len(self._queue))
            while self._last.discard_old(BATCH):
                pass
            return self._last.kept_content()

    def stop(self) -> tuple[TopicCounts, ...]:
        """End the memory; return the last counts, with the messages kept to the end."""
        self._queue.is_open = False
        self._stopping.set()
        self._thread.join()
        return self.read_counts()

    def _run_thread(self) -> None:
        try:
            stopping = False
            while not stopping:
                # Checked before the queue is emptied: messages offered until then are counted.
                stopping = self._stopping.wait(POLL)
                while self._process_batch():
                    time.sleep(NAP)
        except Exception as error:  # noqa: BLE001 (no error may end the thread silently)
            self._store_failure(error)
        # Not all at once: a tick may be running, and would wait for it.
        while self._last.free_blocks(_BLOCKS):
            time.sleep(NAP)

    def _process_batch(self) -> bool:
        """Add a batch of messages, and remove as many; return whether there may be more."""
        with self._lock:
            self._store_waiting(BATCH)
            more = self._last.discard_old(2 * BATCH)
            self.extent = self._last.measure_extent()
        return more or bool(self._queue)

    def _store_waiting(self, count: int) -> None:
        for message in self._queue.take_messages(count):
            topic, log_time, publish_time, _ = message
            if 0 <= log_time < TIME_END and 0 <= publish_time < TIME_END:
                self._last.add(*message)
            else:
                self._queue.dropped[topic].add()

    def _store_failure(self, error: Exception) -> None:
        """Store the failure; the content of the memory is lost."""
        self._queue.is_open = False
        self.failure = RecordingError(
            _WHERE, f'has ended early: {type(error).__name__}: {error}', 'please report this'
        )
        for index, counts in enumerate(self.read_counts()):
            self._last.discarded[index] += counts.recorded


class SnapshotWriting:
    """Writes a bag from memory on its own thread, which calls ``make_writer`` and ``on_done``."""

    def __init__(
        self, kept: KeptMessages, make_writer: Callable[[], BagWriter], on_done: Callable[[], None]
    ) -> None:
        self.kept = kept
        # Summary of the recording, or the error that prevented it; None until then.
        self.outcome: RecordingSummary | RecordingError | None = None
        self._make_writer = make_writer
        self._on_done = on_done
        self._last_progress = time.monotonic()
        # A daemon thread: a disk that never answers must not keep the process alive.
        self._thread = threading.Thread(target=self._run_thread, name='snapshot', daemon=True)
        self._thread.start()

    def wait(self) -> RecordingSummary | RecordingError:
        """Wait for the outcome, but not too long for a disk that does not answer; return it."""
        # The thread has its own time limit, and then has to close a bag.
        while self.outcome is None and time.monotonic() - self._last_progress < 3.0 * _PATIENCE:
            self._thread.join(POLL)
        return self.outcome or RecordingError(
            'snapshot', 'the disk does not answer', 'what was flushed before is readable'
        )

    def _run_thread(self) -> None:
        try:
            self.outcome = self._write_bag(self._make_writer())
        except RecordingError as error:
            self.outcome = error
        except Exception as error:  # noqa: BLE001 (no error may end the thread silently)
            reason = f'{type(error).__name__}: {error}'
            self.outcome = RecordingError('snapshot', reason, 'please report this')
        self._on_done()

    def _write_bag(self, writer: BagWriter) -> RecordingSummary:
        recorder = Recorder(writer, capacity=_AHEAD + BATCH)
        writer.make_statistics = lambda bag: count_topics(bag, self._received_counts(writer))
        for index, message in enumerate(self.kept.messages()):
            if index % BATCH == 0:
                time.sleep(NAP)
                if not self._wait_for_recorder(recorder, _AHEAD):
                    break
            recorder.offer(*message)
        self._wait_for_recorder(recorder, 0)
        summary = recorder.stop(timeout=_PATIENCE)
        # After a failure some messages were not offered.
        topics = [
            replace(topic, received=there, dropped=there - topic.recorded)
            for topic, there in zip(summary.topics, self._received_counts(writer), strict=True)
        ]
        return replace(summary, topics=tuple(topics))

    def _wait_for_recorder(self, recorder: Recorder, most: int) -> bool:
        """Wait until at most `most` messages wait; return whether the disk still works."""
        left = -1
        while not recorder.failure:
            before, left = left, sum(topic.waiting for topic in recorder.read_counts())
            if left != before:
                self._last_progress = time.monotonic()
            if left <= most:
                return True
            if time.monotonic() - self._last_progress > _PATIENCE:
                break
            time.sleep(POLL)
        return False

    def _received_counts(self, writer: BagWriter) -> list[int]:
        """Return the number of messages of each topic to write."""
        return list(map(sum, zip(self.kept.counts, writer.opening_counts, strict=True)))
