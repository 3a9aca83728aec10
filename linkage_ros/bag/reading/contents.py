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


"""What a bag holds, message by message: counts, sizes and times of its topics, to any damage."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from linkage_ros.bag.reading.reader import Bag
from linkage_ros.bag.topic import Topic
from linkage_ros.errors import BagError

TOLD_EVERY = 4096
"""After how many messages progress is told and a wish to stop is looked for."""

_RECORD_SIZE = 31
"""What a message takes in an MCAP file beside its own bytes."""


class TopicContents(NamedTuple):
    """
    What a bag holds of a topic.

    Attributes
    ----------
    topic
        The topic.
    messages
        How many there are.
    size
        Their bytes.
    first, last
        Least and greatest log time, in [ns]; 0 without messages.

    """

    topic: Topic
    messages: int
    size: int
    first: int
    last: int

    @property
    def rate(self) -> float | None:
        """Return how many messages there are a second, on average; nothing where there is none."""
        span = self.last - self.first
        return (self.messages - 1) * 1e9 / span if span > 0 else None


class Contents(NamedTuple):
    """
    What a bag holds.

    Attributes
    ----------
    topics
        In the order of the bag.
    begin, end
        Least and greatest log time, in [ns]; nothing without messages.
    damage
        What is damaged, on one line, where reading ended there; '' where all was read.
    stopped
        Whether it was stopped before all was read.

    """

    topics: tuple[TopicContents, ...]
    begin: int | None
    end: int | None
    damage: str
    stopped: bool


class _Tally:
    """Counts the messages of a topic."""

    __slots__ = ('count', 'first', 'last', 'size', 'topic')

    def __init__(self, topic: Topic) -> None:
        self.topic = topic
        self.count = self.size = self.last = 0
        self.first = 2**64


def contents_of(
    bag: Bag,
    told: Callable[[int], None] = lambda _: None,
    stopped: Callable[[], bool] = lambda: False,
) -> Contents:
    """
    Read all messages of a bag and count them; memory does not grow with them.

    Parameters
    ----------
    bag
        The bag. Where it is damaged, what lies before the damage is counted.
    told
        Takes how many bytes have been read, now and then.
    stopped
        Whether to stop.

    """
    tallies = {topic.name: _Tally(topic) for topic in bag.topics}
    damage, halted = '', False
    number = read = 0
    try:
        for number, (name, log_time, _, data) in enumerate(bag.messages(), 1):
            tally = tallies.get(name)
            if tally is None:  # its channel is not in the index
                tally = tallies[name] = _Tally(Topic(name, '', '', ''))
            size = len(data)
            tally.count += 1
            tally.size += size
            tally.first = min(tally.first, log_time)
            tally.last = max(tally.last, log_time)
            read += size + _RECORD_SIZE
            if not number % TOLD_EVERY:
                told(read)
                if stopped():
                    halted = True
                    break
    except BagError as error:
        damage = f'{error.where}: {error.reason}'
    topics = tuple(
        TopicContents(t.topic, t.count, t.size, t.first if t.count else 0, t.last)
        for t in tallies.values()
    )
    held = [topic for topic in topics if topic.messages]
    return Contents(
        topics,
        min((topic.first for topic in held), default=None),
        max((topic.last for topic in held), default=None),
        damage,
        halted,
    )
