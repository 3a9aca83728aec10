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
The last seconds of a run in memory, until one asks for them.

`SnapshotMemory.offer` is that of a recorder. A thread of the memory's own puts away what was
offered, and lets go of what is too old.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
import threading
import time
from typing import NamedTuple

from linkage_ros.bag.topic import Topic
from linkage_ros.bag.writing.handover import (
    BATCH,
    in_places,
    NAP,
    Offered,
    PLACE,
    POLL,
    Tally,
)
from linkage_ros.bag.writing.last_seconds import Extent, Kept, LastSeconds
from linkage_ros.errors import RecordingError

_WHERE = 'the memory of the last seconds'
_TIME_END = 2**63  # rosbag2's times are signed
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
        self._capacity = capacity
        self._open = True
        self._queue: deque[Offered | None] = deque()
        self._received = [Tally() for _ in topics]
        self._add_received = [tally.add for tally in self._received]
        self._dropped = [Tally() for _ in topics]
        self._add_dropped = [tally.add for tally in self._dropped]
        # Whose has the lock: the thread's, or for a moment that of who takes a snapshot.
        self._lock = threading.Lock()
        self._last = LastSeconds(len(topics), round(seconds * 1e9), most)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name='snapshot memory', daemon=True)
        self._thread.start()

    def offer(self, topic: int, log_time: int, publish_time: int, data: bytes) -> None:
        """Hand over one message, from any thread; as `Recorder.offer`."""
        self._add_received[topic]()
        if not self._open or len(self._queue) >= self._capacity:
            self._add_dropped[topic]()
        elif len(data) < PLACE:
            self._queue.append((topic, log_time, publish_time, data))
        else:
            self._queue.extend(in_places((topic, log_time, publish_time, data)))

    def inspect(self) -> tuple[KeptCounts, ...]:
        """Return the counts as they are now; what waits for the thread counts as kept."""
        counts = []
        for number, topic in enumerate(self.topics):
            let_go, dropped = self._last.let_go[number], self._dropped[number].value()
            # Last, so that a message on its way is kept, and never gone twice.
            received = self._received[number].value()
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
            if not self._open:
                raise RecordingError(_WHERE, 'has ended', 'ask while the node is active')
            self._put_away(len(self._queue))
            while self._last.let_old_go(BATCH):
                pass
            return self._last.kept()

    def stop(self) -> tuple[KeptCounts, ...]:
        """End the memory; return the counts as they were then, with what was kept to the end."""
        self._open = False
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
            self._put_away(min(BATCH, len(self._queue)))
            more = self._last.let_old_go(2 * BATCH)
            self.extent = self._last.extent()
        return more or bool(self._queue)

    def _put_away(self, count: int) -> None:
        for _ in range(count):
            message = self._queue.popleft()
            if message is None:
                continue
            topic, log_time, publish_time, _ = message
            if 0 <= log_time < _TIME_END and 0 <= publish_time < _TIME_END:
                self._last.add(*message)
            else:
                self._add_dropped[topic]()

    def _fail(self, error: Exception) -> None:
        """Keep the failure; what was in memory is gone."""
        self._open = False
        self.failure = RecordingError(
            _WHERE, f'has ended early: {type(error).__name__}: {error}', 'please report this'
        )
        for number, counts in enumerate(self.inspect()):
            self._last.let_go[number] += counts.kept
