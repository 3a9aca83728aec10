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
The last seconds of a sequence of messages, packed into blocks of bytes.

They take half the room of Python's objects, and the search for cycles, which visits every message
that lies about in tuples, has nothing to visit. To take hold of them all is to copy the list of
the blocks.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from struct import Struct
from typing import NamedTuple

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
