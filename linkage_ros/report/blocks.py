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


"""The messages of a bag, some thousands at a time, each topic's together; and their counts."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from typing import NamedTuple

from linkage_ros.bag.contents import Contents, TopicContents
from linkage_ros.bag.reader import Bag, BagMessage
from linkage_ros.bag.topic import Topic
from linkage_ros.errors import BagError

_MOST_MESSAGES = 8192
_MOST_BYTES = 32 * 2**20
_FARTHEST = 4
"""By how many times a block may be larger, for the sake of one log time."""

_BESIDE = 31
"""What a message takes in an MCAP file beside its own bytes."""

Entry = tuple[int, int, int, bytes]
"""Number of the message, log time, publish time, bytes; none of a topic that is only counted."""


class Progress(NamedTuple):
    """What is told how many bytes were read, now and then; and whether to stop."""

    told: Callable[[int], None] = lambda _read: None
    stopped: Callable[[], bool] = lambda: False


class Blocks:
    """
    Reads a bag block by block, and counts.

    A block ends between two ticks: messages of one log time are in one, unless they are more than
    any tick has.

    Parameters
    ----------
    bag
        The bag. Where it is damaged, what lies before the damage is read.
    wanted
        Topics whose messages are wanted, not their counts alone.
    progress
        Whom to tell, and whether to stop.

    """

    def __init__(self, bag: Bag, wanted: Collection[str], progress: Progress) -> None:
        self._bag, self._wanted, self._progress = bag, set(wanted), progress
        self._counts: dict[str, list[int]] = {topic.name: [0, 0, 2**64, 0] for topic in bag.topics}
        self._damage, self._stopped = '', False
        self._read = 0

    def __iter__(self) -> Iterator[Mapping[str, list[Entry]]]:
        """Yield block by block the messages of each wanted topic."""
        wanted = self._wanted
        found: dict[str, list[Entry]] = {}
        others: dict[str, list[tuple[int, int]]] = {}
        count = size = last = 0
        for topic, logged, published, data in self._whole(self._bag.messages()):
            filled = max(count / _MOST_MESSAGES, size / _MOST_BYTES)
            if filled >= (1 if logged != last else _FARTHEST):
                yield self._counted(found, others)
                found, others, count, size = {}, {}, 0, 0
                if self._progress.stopped():
                    self._stopped = True
                    return
            last = logged
            if topic in wanted:
                if topic in found:
                    found[topic].append((count, logged, published, data))
                else:
                    found[topic] = [(count, logged, published, data)]
                size += len(data)
            else:
                others.setdefault(topic, []).append((logged, len(data)))
            count += 1
        if found or others:
            yield self._counted(found, others)

    def contents(self) -> Contents:
        """Return what has been read."""
        topics = {topic.name: topic for topic in self._bag.topics}
        rows = tuple(
            TopicContents(
                topics.get(name) or Topic(name, '', '', ''),
                count,
                size,
                first if count else 0,
                last,
            )
            for name, (count, size, first, last) in self._counts.items()
        )
        held = [row for row in rows if row.messages]
        begin = min((row.first for row in held), default=None)
        end = max((row.last for row in held), default=None)
        return Contents(rows, begin, end, self._damage, self._stopped)

    def _whole(self, messages: Iterable[BagMessage]) -> Iterator[BagMessage]:
        try:
            yield from messages
        except BagError as error:
            self._damage = f'{error.where}: {error.reason}'

    def _counted(
        self,
        found: Mapping[str, list[Entry]],
        others: Mapping[str, list[tuple[int, int]]],
    ) -> Mapping[str, list[Entry]]:
        """Count a block, tell of it, and return what is wanted of it."""
        for name, entries in found.items():
            self._count(name, [(logged, len(data)) for _, logged, _, data in entries])
        for name, sizes in others.items():
            self._count(name, sizes)
        self._progress.told(self._read)
        return found

    def _count(self, name: str, entries: list[tuple[int, int]]) -> None:
        logs, sizes = zip(*entries, strict=True)
        tally = self._counts.setdefault(name, [0, 0, 2**64, 0])
        tally[0] += len(entries)
        tally[1] += sum(sizes)
        tally[2] = min(tally[2], *logs)
        tally[3] = max(tally[3], *logs)
        self._read += sum(sizes) + _BESIDE * len(entries)
