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


"""A bag made of what was found in others: channels, times and bytes stay what they were."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from contextlib import suppress
import os
from pathlib import Path
from typing import Any

from linkage_ros import __version__
from linkage_ros.bag.metadata import (
    BagSummary,
    metadata_text,
    NO_START,
    sync_folder,
    write_metadata,
)
from linkage_ros.bag.reading.data_section import Found
from linkage_ros.bag.reading.folder import serialized_metadata
from linkage_ros.bag.reading.reader import topic_of
from linkage_ros.bag.reading.records import Definitions, Message
from linkage_ros.bag.topic import Topic
from linkage_ros.bag.writing.disk import CHUNK_SIZE
from linkage_ros.errors import BagError
from mcap.exceptions import UnsupportedCompressionError
from mcap.records import Attachment, Channel
from mcap.writer import CompressionType, Writer

MOST_CHANNELS = 10_000
"""How many channels a new bag may have: its metadata, 700 bytes for each, must stay readable."""

_COMPRESSIONS = {'lz4': CompressionType.LZ4, 'zstd': CompressionType.ZSTD}


class NewBag:
    """
    A new bag, open for writing.

    Parameters
    ----------
    folder
        Where it goes; it is there, and empty.
    profile
        The profile of its file: 'ros2'.
    compression
        How its chunks are packed: '', 'lz4' or 'zstd'.

    Attributes
    ----------
    counts
        Messages by topic.
    attachments
        Content by name.
    information
        What rosbag2 wrote of itself into the file that this is made of.

    Raises
    ------
    OSError
        As the system gives it, here and from all that writes.
    BagError
        From `add` and `describe`: there are more than `MOST_CHANNELS`.

    """

    def __init__(self, folder: Path, profile: str, compression: str) -> None:
        self.counts: Counter[str] = Counter()
        self.attachments: dict[str, bytes] = {}
        self.information: Mapping[str, Any] = {}
        self._folder = folder
        self._topics: dict[str, Topic] = {}
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._channels: dict[tuple[object, ...], int] = {}
        self._numbers: dict[int, int] = {}
        self._start, self._end = NO_START, 0
        self._file = (folder / f'{folder.name}_0.mcap').open('xb')
        packing = _COMPRESSIONS.get(compression, CompressionType.NONE)
        try:
            self._mcap = Writer(self._file, chunk_size=CHUNK_SIZE, compression=packing)
        except UnsupportedCompressionError:
            self._mcap = Writer(
                self._file, chunk_size=CHUNK_SIZE, compression=CompressionType.NONE
            )
        self._mcap.start(profile=profile, library=f'linkage_ros {__version__}')

    @property
    def topics(self) -> tuple[str, ...]:
        """Return the names of its topics."""
        return tuple(self._topics)

    def begin_file(self) -> None:
        """Forget the numbers of channels: they are those of a file."""
        self._numbers.clear()

    def add(self, found: Found, definitions: Definitions) -> None:
        """Add what was found in a file, of which these schemas and channels are known."""
        if isinstance(found, Message):
            if not self._numbers:
                self.describe(definitions)
            number = self._numbers.get(found.channel.id)
            if number is None:
                # Not all that are known by now: of thousands, each comes with its first message.
                number = self._number_of(found.channel, definitions)
                self._numbers[found.channel.id] = number
            self._mcap.add_message(
                number, found.log_time, found.data, found.publish_time, found.sequence
            )
            self.counts[found.channel.topic] += 1
            self._start = min(self._start, found.log_time)
            self._end = max(self._end, found.log_time)
        elif isinstance(found, Attachment):
            # Files of one bag repeat them.
            if self.attachments.get(found.name) != found.data:
                self.attachments.setdefault(found.name, found.data)
                self._mcap.add_attachment(
                    found.create_time, found.log_time, found.name, found.media_type, found.data
                )
        elif found.name != 'rosbag2':
            self._mcap.add_metadata(found.name, found.metadata)
        else:
            self.information = serialized_metadata(found)

    def describe(self, definitions: Definitions) -> None:
        """Take over all channels, those without a message too."""
        for channel in definitions.channels.values():
            if channel.id not in self._numbers:
                self._numbers[channel.id] = self._number_of(channel, definitions)

    def close(self, custom: Mapping[str, str]) -> BagSummary:
        """Finish the bag, and return what it holds."""
        summary = self._summary()
        text = metadata_text(summary, custom, root=False)
        self._mcap.add_metadata('rosbag2', {'serialized_metadata': text})
        self._mcap.finish()  # type: ignore[no-untyped-call]
        self._file.flush()
        os.fsync(self._file.fileno())
        summary = self._summary()
        self._file.close()
        write_metadata(summary, custom)
        sync_folder(self._folder.absolute().parent)
        return summary

    def abandon(self) -> None:
        """Let go of the file; what is in it is of no use."""
        with suppress(OSError):
            self._file.close()

    def _number_of(self, channel: Channel, definitions: Definitions) -> int:
        """Return the number that a channel has here, the same for the same one of each file."""
        schema = definitions.schema_of(channel)
        kind = (schema.name, schema.encoding, schema.data) if schema else None
        described = (channel.topic, channel.message_encoding, kind, *channel.metadata.items())
        if described not in self._channels:
            if len(self._channels) == MOST_CHANNELS:
                raise BagError(
                    self._folder,
                    f'would hold more than {MOST_CHANNELS:,} channels; no more are recovered',
                    'no ROS graph has as many: ask who made the bag',
                )
            number = 0
            if kind is not None:
                if kind not in self._schemas:
                    self._schemas[kind] = self._mcap.register_schema(*kind)
                number = self._schemas[kind]
            self._channels[described] = self._mcap.register_channel(
                channel.topic, channel.message_encoding, number, channel.metadata
            )
            self._topics.setdefault(channel.topic, topic_of(channel, schema))
        return self._channels[described]

    def _summary(self) -> BagSummary:
        return BagSummary(
            folder=self._folder,
            file=Path(self._file.name).name,
            topics=tuple(self._topics.values()),
            counts=tuple(self.counts[name] for name in self._topics),
            refused=(0,) * len(self._topics),
            start=self._start,
            duration=max(0, self._end - self._start),
            size=self._file.tell(),
        )
