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
The last seconds of a run, kept in memory until a snapshot of them is written to a bag.

`LastSeconds` packs the messages into blocks of bytes. They take half the memory of Python's
objects, the garbage collector has nothing to visit, and to take them all is to copy the list of
the blocks. `SnapshotMemory` fills it on a thread of its own: its `offer` is that of a recorder.
`SnapshotWriting` writes what was taken to a bag, on another thread.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from struct import Struct
import threading
import time
from typing import NamedTuple

from linkage_ros.bag.metadata import BagSummary
from linkage_ros.bag.recorder import BATCH, MessageQueue, NAP, POLL, Recorder, RecordingSummary
from linkage_ros.bag.recording_stats import RecordingStats
from linkage_ros.bag.topic import Topic
from linkage_ros.bag.writer import BagWriter, TIME_END
from linkage_ros.errors import RecordingError

_HEAD = Struct('<HqqqI')
"""Before each message: topic, time that has passed, log time, publish time [ns], size [bytes]."""

_BLOCK_SIZE = 64 * 1024
_BLOCKS_IN_SPAN = 16

_JUMP = 1_000_000_000
"""What goes back by more is a clock that has jumped, and not messages out of order [ns]."""


class Extent(NamedTuple):
    """
    How much is in memory.

    Attributes
    ----------
    seconds
        Time between the oldest message and the newest [s].
    size
        What the messages take [bytes].
    crowded
        Whether for want of room something had to go that was not too old.

    """

    seconds: float = 0.0
    size: int = 0
    crowded: bool = False


class Kept(NamedTuple):
    """
    What was in memory at an instant; it stays as it is.

    Attributes
    ----------
    blocks
        The messages, packed.
    begin
        Where the first of them begins in the first block.
    counts
        How many of each topic there are.
    seconds
        Time between the oldest and the newest [s].
    whole
        Whether nothing has been let go of.

    """

    blocks: tuple[bytes, ...]
    begin: int
    counts: tuple[int, ...]
    seconds: float
    whole: bool

    def messages(self) -> Iterator[tuple[int, int, int, bytes]]:
        """Yield topic, log time, publish time and bytes, in the order in which they came."""
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
    Takes messages, and lets go of those that are too old.

    A message is as old as much time has passed since, by the log times of one topic: of the one by
    which most has passed. Where these go back no time passes: by less than a second, until they
    are where they were; by more, a clock has jumped, and time goes on from there. So what was
    before a jump is kept as all else is, and where the topics' clocks differ nothing goes for it.

    Parameters
    ----------
    topics
        How many topics there are.
    span
        How old a message may be [ns].
    most
        How much memory they may take [bytes]; where that is too little, the oldest go.

    Attributes
    ----------
    let_go
        Messages of each topic that are gone.

    """

    def __init__(self, topics: int, span: int, most: int) -> None:
        self.let_go = [0] * topics
        self._span = span
        self._most = most
        self._counts = [0] * topics
        self._now = 0  # time that has passed [ns]
        self._clocks: list[tuple[int, int] | None] = [None] * topics
        self._blocks: deque[bytes] = deque()
        self._begin = 0  # of the oldest message, in the first block
        self._newest: list[bytes] = []
        self._newest_size, self._newest_since = 0, 0
        self._size = 0
        self._gone: int | None = None  # log time of what has gone last
        self._crowded: int | None = None  # when something last had to go too early

    def add(self, topic: int, log_time: int, publish_time: int, data: bytes) -> None:
        """Take a message, whose times fit into 63 bits."""
        latest, passed = self._clocks[topic] or (log_time, self._now)
        if log_time > latest:
            self._now = max(self._now, passed + log_time - latest)
        if log_time >= latest or log_time < latest - _JUMP:
            self._clocks[topic] = log_time, self._now
        age = self._now - self._newest_since
        if self._newest_size >= _BLOCK_SIZE or age > self._span // _BLOCKS_IN_SPAN:
            self._seal()
        if not self._newest:
            self._newest_since = self._now
        head = _HEAD.pack(topic, self._now, log_time, publish_time, len(data))
        self._newest += head, data
        size = len(head) + len(data)
        self._newest_size += size
        self._size += size
        self._counts[topic] += 1

    def let_old_go(self, limit: int) -> bool:
        """Let go of so many messages that have to go; return whether there may be more."""
        # The newest block holds nothing that is too old, and is small.
        for _ in range(limit):
            if not self._blocks:
                return False
            block = self._blocks[0]
            topic, at, log_time, _, size = _HEAD.unpack_from(block, self._begin)
            crowded = self._size > self._most
            # What one tick has taken and made goes together.
            if self._now - at <= self._span and not crowded and log_time != self._gone:
                return False
            if crowded:
                self._crowded = self._now
            self._gone = log_time
            self.let_go[topic] += 1
            self._counts[topic] -= 1
            self._begin += _HEAD.size + size
            self._size -= _HEAD.size + size
            if self._begin == len(block):
                self._blocks.popleft()
                self._begin = 0
        return True

    def kept(self) -> Kept:
        """Return what is in memory."""
        self._seal()
        seconds, _, _ = self.extent()
        whole = not any(self.let_go)
        return Kept(tuple(self._blocks), self._begin, tuple(self._counts), seconds, whole)

    def extent(self) -> Extent:
        """Return how much is in memory."""
        oldest = self._newest_since if self._newest else self._now
        if self._blocks:
            oldest = _HEAD.unpack_from(self._blocks[0], self._begin)[1]
        crowded = self._crowded is not None and self._now - self._crowded <= self._span
        return Extent((self._now - oldest) * 1e-9, self._size, crowded)

    def forget(self, limit: int) -> bool:
        """Give back the memory of so many blocks; return whether there are more."""
        for _ in range(min(limit, len(self._blocks))):
            self._blocks.popleft()
        return bool(self._blocks)

    def _seal(self) -> None:
        if self._newest:
            self._blocks.append(b''.join(self._newest))
            self._newest, self._newest_size = [], 0


_WHERE = 'the memory of the last seconds'
_BLOCKS = 16  # 1 MiB


class KeptCounts(NamedTuple):
    """
    What became of one topic's messages: ``received == kept + let_go + dropped``, at every instant.

    Attributes
    ----------
    name
        The topic's.
    received
        What was offered.
    kept
        What is in memory.
    let_go
        What has become too old, or had to make room.
    dropped
        What no bag can hold, or came while the memory's thread could not keep up.

    """

    name: str
    received: int
    kept: int
    let_go: int
    dropped: int


class SnapshotMemory:
    """
    The last seconds of what is offered, as `LastSeconds` has it.

    Parameters
    ----------
    topics
        What will be offered; a topic's number is its place in this sequence.
    seconds
        How old a message may be [s].
    most
        How much memory they may take [bytes]; where that is too little, the oldest go.
    capacity
        Messages that may wait for the memory's thread; as for `Recorder`.

    Attributes
    ----------
    extent
        How much is in memory.
    failure
        Why the memory has ended early; None while it has not.

    """

    def __init__(
        self, topics: Sequence[Topic], seconds: float, most: int, *, capacity: int = 65536
    ) -> None:
        self.topics = tuple(topics)
        self.seconds = seconds
        self.extent = Extent()
        self.failure: RecordingError | None = None
        self._queue = MessageQueue(len(topics), capacity)
        self.offer = self._queue.offer
        """Hands over one message, as `MessageQueue.offer`."""
        # Whose has the lock: the thread's, or for a moment that of who takes a snapshot.
        self._lock = threading.Lock()
        self._last = LastSeconds(len(topics), round(seconds * 1e9), most)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name='snapshot memory', daemon=True)
        self._thread.start()

    def inspect(self) -> tuple[KeptCounts, ...]:
        """Return the counts as they are now; what waits for the thread counts as kept."""
        counts = []
        for number, topic in enumerate(self.topics):
            let_go, dropped = self._last.let_go[number], self._queue.dropped[number].value()
            # Last, so that a message on its way is kept, and never gone twice.
            received = self._queue.received[number].value()
            kept = received - let_go - dropped
            counts.append(KeptCounts(topic.name, received, kept, let_go, dropped))
        return tuple(counts)

    def take(self) -> Kept:
        """
        Return what is in memory: all that was offered before, and is not too old.

        Raises
        ------
        RecordingError
            The memory has ended.

        """
        with self._lock:
            if self.failure:
                raise self.failure
            if not self._queue.open:
                raise RecordingError(_WHERE, 'has ended', 'ask while the node is active')
            self._put_away(len(self._queue))
            while self._last.let_old_go(BATCH):
                pass
            return self._last.kept()

    def stop(self) -> tuple[KeptCounts, ...]:
        """End the memory; return the counts as they were then, with what was kept to the end."""
        self._queue.open = False
        self._stopping.set()
        self._thread.join()
        return self.inspect()

    def _run(self) -> None:
        try:
            stopping = False
            while not stopping:
                # Asked before the queue is emptied: what was offered until then is counted.
                stopping = self._stopping.wait(POLL)
                while self._work():
                    time.sleep(NAP)
        except Exception as error:  # noqa: BLE001 (nothing may end the thread in silence)
            self._fail(error)
        # Not all at once: a tick may go on, and would wait for it.
        while self._last.forget(_BLOCKS):
            time.sleep(NAP)

    def _work(self) -> bool:
        """Put away a batch of messages, and let as many go; return whether there may be more."""
        with self._lock:
            self._put_away(BATCH)
            more = self._last.let_old_go(2 * BATCH)
            self.extent = self._last.extent()
        return more or bool(self._queue)

    def _put_away(self, count: int) -> None:
        for message in self._queue.take(count):
            topic, log_time, publish_time, _ = message
            if 0 <= log_time < TIME_END and 0 <= publish_time < TIME_END:
                self._last.add(*message)
            else:
                self._queue.dropped[topic].add()

    def _fail(self, error: Exception) -> None:
        """Keep the failure; what was in memory is gone."""
        self._queue.open = False
        self.failure = RecordingError(
            _WHERE, f'has ended early: {type(error).__name__}: {error}', 'please report this'
        )
        for number, counts in enumerate(self.inspect()):
            self._last.let_go[number] += counts.kept


_AHEAD = 5000
"""How many messages are handed to the recorder before it has written them."""

_PATIENCE = 10.0
"""How long a disk that does not answer is waited for, in [s]."""


class SnapshotWriting:
    """
    A bag that is written from memory on a thread of its own.

    Parameters
    ----------
    kept
        What goes into it.
    make
        Makes the bag, on that thread.
    done
        Called on that thread when the outcome is there.

    Attributes
    ----------
    kept
        As given.
    outcome
        How the recording went, or why there is none; None until then.

    """

    def __init__(
        self, kept: Kept, make: Callable[[], BagWriter], done: Callable[[], None]
    ) -> None:
        self.kept = kept
        self.outcome: RecordingSummary | RecordingError | None = None
        self._make = make
        self._done = done
        self._seen = time.monotonic()
        # A daemon: a disk that never answers must not keep the process from ending.
        self._thread = threading.Thread(target=self._run, name='snapshot', daemon=True)
        self._thread.start()

    def wait(self) -> RecordingSummary | RecordingError:
        """Return the outcome as soon as it is there, or a disk has not answered for too long."""
        # The thread has some patience of its own, and has to close a bag then.
        while self.outcome is None and time.monotonic() - self._seen < 3.0 * _PATIENCE:
            self._thread.join(POLL)
        return self.outcome or RecordingError(
            'snapshot', 'the disk does not answer', 'what was flushed before is readable'
        )

    def _run(self) -> None:
        try:
            self.outcome = self._write(self._make())
        except RecordingError as error:
            self.outcome = error
        except Exception as error:  # noqa: BLE001 (nothing may end the thread in silence)
            reason = f'{type(error).__name__}: {error}'
            self.outcome = RecordingError('snapshot', reason, 'please report this')
        self._done()

    def _write(self, writer: BagWriter) -> RecordingSummary:
        recorder = Recorder(writer, capacity=_AHEAD + BATCH)
        writer.account = partial(self._account, writer)
        for number, message in enumerate(self.kept.messages()):
            if number % BATCH == 0:
                time.sleep(NAP)
                if not self._is_taken(recorder, _AHEAD):
                    break
            recorder.offer(*message)
        self._is_taken(recorder, 0)
        summary = recorder.stop(timeout=_PATIENCE)
        # After a failure not all was offered.
        topics = [
            replace(topic, received=there, dropped=there - topic.recorded)
            for topic, there in zip(summary.topics, self._received(writer), strict=True)
        ]
        return replace(summary, topics=tuple(topics))

    def _is_taken(self, recorder: Recorder, most: int) -> bool:
        """Wait until no more messages than that wait; return whether the disk goes on."""
        left = -1
        while not recorder.failure:
            before, left = left, sum(topic.waiting for topic in recorder.inspect())
            if left != before:
                self._seen = time.monotonic()
            if left <= most:
                return True
            if time.monotonic() - self._seen > _PATIENCE:
                break
            time.sleep(POLL)
        return False

    def _received(self, writer: BagWriter) -> list[int]:
        """Return how many messages of each topic there are to be written."""
        return list(map(sum, zip(self.kept.counts, writer.opened, strict=True)))

    def _account(self, writer: BagWriter, summary: BagSummary) -> RecordingStats:
        received = self._received(writer)
        dropped = [
            there - written for there, written in zip(received, summary.counts, strict=True)
        ]
        return RecordingStats(received, summary.counts, dropped, (0,) * len(dropped))
