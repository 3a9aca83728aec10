# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Contents of a bag: messages, sizes and times by topic, and the layout of its files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from linkage_ros.bag.mcap_records import (
    chunk_head,
    DamagedError,
    HEAD,
    parse_strictly,
    RecordSource,
)
from linkage_ros.bag.reader import Bag, MOST_METADATA, unreadable_error
from linkage_ros.bag.topic import Topic
from linkage_ros.errors import BagError
from mcap.opcode import Opcode
from mcap.records import Header, Metadata
from mcap.writer import MCAP0_MAGIC

REPORT_EVERY = 4096
"""Number of messages between two progress reports and checks for a stop."""

RECORD_SIZE = 31
"""Size of a message record without the message itself [bytes]."""


@dataclass(slots=True)
class TopicContents:
    """Messages of one topic in a bag."""

    topic: Topic
    messages: int = 0
    size: int = 0  # In [bytes]
    # Least and greatest log time, in [ns]; 0 without messages.
    first: int = 0
    last: int = 0

    def add_messages(self, messages: int, size: int, first: int, last: int) -> None:
        """Add messages with their size [bytes], and least and greatest log time, in [ns]."""
        self.first = min(self.first, first) if self.messages else first
        self.last = max(self.last, last)
        self.messages += messages
        self.size += size

    @property
    def mean_rate(self) -> float | None:
        """Return the mean number of messages per second; None if they all have one time."""
        span = self.last - self.first
        return (self.messages - 1) * 1e9 / span if span > 0 else None


class Contents(NamedTuple):
    """Contents of a bag."""

    topics: tuple[TopicContents, ...]  # In the order of the bag
    # Least and greatest log time, in [ns]; None without messages.
    begin: int | None
    end: int | None
    damage: str  # Damage at which reading ended, on one line; '' if all was read
    stopped: bool  # Whether reading was stopped early


class Tallies(dict[str, TopicContents]):
    """Counts of all topics, by name: first the bag's topics, then others as they appear."""

    def __init__(self, bag: Bag) -> None:
        super().__init__({topic.name: TopicContents(topic) for topic in bag.topics})

    def __missing__(self, name: str) -> TopicContents:
        # Its channel is missing in the index.
        contents = self[name] = TopicContents(Topic(name, '', '', ''))
        return contents

    def to_contents(self, damage: str, stopped: bool) -> Contents:
        """Return the counts."""
        held = [topic for topic in self.values() if topic.messages]
        begin = min((topic.first for topic in held), default=None)
        end = max((topic.last for topic in held), default=None)
        return Contents(tuple(self.values()), begin, end, damage, stopped)


def contents_of(
    bag: Bag,
    progress: Callable[[int], None] = lambda _: None,
    stopped: Callable[[], bool] = lambda: False,
) -> Contents:
    """
    Count all messages of a bag; memory does not grow with them.

    If the bag is damaged, the messages before the damage are counted. ``progress`` receives the
    number of bytes read, now and then; ``stopped`` returns whether to stop.
    """
    tallies = Tallies(bag)
    damage, halted = '', False
    read = 0
    try:
        for number, (name, log_time, _, data) in enumerate(bag.messages(), 1):
            size = len(data)
            tallies[name].add_messages(1, size, log_time, log_time)
            read += size + RECORD_SIZE
            if not number % REPORT_EVERY:
                progress(read)
                if stopped():
                    halted = True
                    break
    except BagError as error:
        damage = f'{error.where}: {error.reason}'
    return tallies.to_contents(damage, halted)


class Layout(NamedTuple):
    """Layout of an MCAP file."""

    library: str  # Library that wrote it; '' if the file does not name one
    # For each compression of its chunks ('none' is one): bytes stored, and bytes after
    # decompression as stated in the file.
    compressions: Mapping[str, tuple[int, int]]
    content: int  # Size of all its records after decompression [bytes]
    rosbag2: Metadata | None  # Last metadata record of rosbag2; None if there is none


def layout_of(file: Path) -> Layout:
    """Return the layout of a file, up to the first broken record; a BagError if unreadable."""
    library = ''
    compressions: dict[str, tuple[int, int]] = {}
    content = 0
    rosbag2: Metadata | None = None
    at = len(MCAP0_MAGIC)
    try:
        with file.open('rb') as stream, suppress(DamagedError):
            source = RecordSource(stream)
            while True:
                opcode, end = source.read_head(at)
                if end > source.size or opcode in (Opcode.DATA_END, Opcode.FOOTER):
                    break
                length = unpacked = end - at - HEAD.size
                # Damage is ignored here; reading the messages reports it.
                with suppress(DamagedError):
                    if opcode == Opcode.CHUNK:
                        head = chunk_head(source, at)
                        unpacked, name = head.size, head.compression or 'none'
                        stored, made = compressions.get(name, (0, 0))
                        compressions[name] = stored + length, made + unpacked
                    elif opcode in (Opcode.HEADER, Opcode.METADATA) and length <= MOST_METADATA:
                        data = source.read(at + HEAD.size, length)
                        if opcode == Opcode.HEADER:
                            library = parse_strictly(Header, data).library
                        elif (record := parse_strictly(Metadata, data)).name == 'rosbag2':
                            rosbag2 = record
                content += unpacked
                at = end
    except OSError as error:
        raise unreadable_error(file, error) from None
    return Layout(library, compressions, content, rosbag2)
