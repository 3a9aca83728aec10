# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Read the messages of a bag by log time; messages with equal times in file order.

A file with an index is read chunk by chunk, each chunk when its time has come: memory holds only
the chunks whose times overlap, and chunks before a given start are not read. A file without an
index (its recording was killed, or wrote none) is read from its start, and sorted within a window.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from heapq import heapify, heappop, heappush, merge
from itertools import count
from operator import attrgetter
from pathlib import Path

from linkage_ros.bag.mcap_records import (
    chunk_at,
    content_of,
    DamagedError,
    Definitions,
    FileIndex,
    index_of,
    messages_in,
    RecordSource,
)
from linkage_ros.bag.reader import Bag, BagMessage, unreadable_error
from linkage_ros.errors import BagError

WINDOW = 1_000_000_000
"""How far out of order the messages of a file without an index may be, in [ns]."""

MOST_HELD = 2**30
"""Most bytes in memory: of chunks whose times overlap, or of a window."""

_BESIDE = 400
"""Memory of a message in addition to its bytes."""

_Entry = tuple[int, int, int, int, BagMessage | None]
"""Time, index of the file, position of the chunk, number in it from 1; 0 for a whole chunk."""


class LogTimeOrder:
    """
    Messages of a bag, ordered by log time.

    Raise `BagError` if a file cannot be read, or if its beginning is damaged.
    """

    def __init__(self, bag: Bag) -> None:
        self._files, self._path = bag.files, bag.path
        self._definitions: dict[int, Definitions] = {}
        self._chunks: list[tuple[int, _Entry]] = []  # with the last time of each
        unindexed = []
        for number, file in enumerate(bag.files):
            index = _usable_index(file)
            if index is None:
                unindexed.append(file)
                continue
            self._definitions[number] = index.definitions
            for chunk in index.chunks:
                # A chunk of definitions only has no times.
                if chunk.message_end_time or chunk.message_index_offsets:
                    place = chunk.message_start_time, number, chunk.chunk_start_offset, 0, None
                    self._chunks.append((chunk.message_end_time, place))
        self._unindexed = replace(bag, files=tuple(unindexed))
        # Greatest log time, in [ns]; None if this requires reading the whole bag.
        self.end = None if unindexed else max((last for last, _ in self._chunks), default=None)
        first = next(self.messages(), None)
        # Least log time, in [ns]; None without messages.
        self.begin = first.log_time if first else None

    def messages(self, since: int = 0) -> Iterator[BagMessage]:
        """Yield the messages from a log time [ns] on; raise `BagError` where a file is damaged."""
        yield from merge(
            self._read_indexed(since),
            self._order_messages(
                message for message in self._unindexed.messages() if message.log_time >= since
            ),
            key=attrgetter('log_time'),
        )

    def _read_indexed(self, since: int) -> Iterator[BagMessage]:
        heap = [place for last, place in self._chunks if last >= since]
        heapify(heap)
        held = 0
        while heap:
            _, number, place, _, message = heappop(heap)
            if message is not None:
                held -= len(message.data) + _BESIDE
                yield message
                continue
            for index, following in enumerate(self._read_chunk(number, place), 1):
                if following.log_time >= since:
                    held = self._count_held(held, following)
                    heappush(heap, (following.log_time, number, place, index, following))

    def _order_messages(self, messages: Iterator[BagMessage]) -> Iterator[BagMessage]:
        """Yield messages by log time, each as soon as one is a window later."""
        heap: list[tuple[int, int, BagMessage]] = []
        numbers = count()
        held = 0
        for message in messages:
            held = self._count_held(held, message)
            heappush(heap, (message.log_time, next(numbers), message))
            while heap[0][0] < message.log_time - WINDOW:
                first = heappop(heap)[2]
                held -= len(first.data) + _BESIDE
                yield first
        while heap:
            yield heappop(heap)[2]

    def _count_held(self, held: int, message: BagMessage) -> int:
        """Count the bytes held with one more message."""
        held += len(message.data) + _BESIDE
        if held > MOST_HELD:
            raise BagError(
                self._path,
                f'more than {MOST_HELD:,} bytes of its messages are not in the order of time',
                'write it again in this order',
            )
        return held

    def _read_chunk(self, number: int, place: int) -> list[BagMessage]:
        """Return the messages of one chunk of a file."""
        file = self._files[number]
        try:
            with file.open('rb') as stream:
                content = content_of(chunk_at(RecordSource(stream), place))
            messages = messages_in(content, self._definitions[number])
            return [
                BagMessage(each.channel.topic, each.log_time, each.publish_time, each.data)
                for each in messages
            ]
        except OSError as error:
            raise unreadable_error(file, error) from None
        except DamagedError as error:
            raise BagError(
                file,
                f'is damaged: the chunk at byte {place:,} {error}',
                'linkage recover saves the whole parts',
            ) from None


def _usable_index(file: Path) -> FileIndex | None:
    """Return the index of a file; None if it has none, or one without chunks or channels."""
    try:
        with file.open('rb') as stream:
            index = index_of(RecordSource(stream))
    except OSError as error:
        raise unreadable_error(file, error) from None
    except DamagedError:
        return None
    return index if index.chunks and index.definitions.channels else None
