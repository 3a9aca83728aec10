# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Write one file of a bag, complete in itself: attachments, types, messages, index.

After the first disk error, mcap's ``Writer`` continues in memory (`disk.RecordFile`), and
`BagFile.finish` ends the file with the records and indexes that it produces.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from io import BytesIO
from pathlib import Path
import time
from typing import cast, IO

from linkage_ros import __version__
from linkage_ros.bag.disk import CHUNK_SIZE, FIRST_RESERVE, RecordFile, Reserve
from linkage_ros.bag.metadata import BagSummary, NO_START, qos_text
from linkage_ros.bag.storage import NONE
from linkage_ros.bag.topic import Topic
from linkage_ros.errors import RecordingError
from mcap.exceptions import UnsupportedCompressionError
from mcap.records import Statistics
from mcap.writer import CompressionType, IndexType, Writer

COMPRESSION_TYPES: Mapping[str, CompressionType] = {
    NONE: CompressionType.NONE,
    'lz4': CompressionType.LZ4,
    'zstd': CompressionType.ZSTD,
}
_LIBRARIES = {'lz4': 'lz4', 'zstd': 'zstandard'}


def compression_type(name: str, folder: Path) -> CompressionType:
    """
    Return mcap's compression for a name.

    Raise `RecordingError`, which names ``folder``, if the library for it is not installed.
    """
    kind = COMPRESSION_TYPES[name]
    try:
        Writer(BytesIO(), compression=kind)
    except UnsupportedCompressionError:
        library = _LIBRARIES[name]
        raise RecordingError(
            folder,
            f'cannot be packed with {name}: the Python package {library} is missing',
            f'install {library}, or set record.compression: {NONE}',
        ) from None
    return kind


def start_file(mcap: Writer, profile: str = 'ros2') -> None:
    """Begin a file of this package."""
    mcap.start(profile=profile, library=f'linkage_ros {__version__}')


def register_topics(mcap: Writer, topics: Sequence[Topic]) -> list[int]:
    """Register topics with a writer; return their channel numbers, equal for equal topics."""
    schemas: dict[str, int] = {}
    channels = []
    for topic in topics:
        if topic.type not in schemas:
            definition = topic.definition.encode()
            schemas[topic.type] = mcap.register_schema(topic.type, 'ros2msg', definition)
        description = {
            'offered_qos_profiles': qos_text(topic.qos),
            'topic_type_hash': topic.type_hash,
        }
        channels.append(mcap.register_channel(topic.name, 'cdr', schemas[topic.type], description))
    return channels


def channels_file(topics: Sequence[Topic]) -> bytes:
    """Return an MCAP file with these topics and without messages."""
    file = BytesIO()
    mcap = Writer(
        file,
        compression=CompressionType.NONE,
        index_types=IndexType.NONE,
        repeat_channels=False,
        repeat_schemas=False,
        use_chunking=False,
        use_statistics=False,
        use_summary_offsets=False,
    )
    start_file(mcap)
    register_topics(mcap, topics)
    mcap.finish()  # type: ignore[no-untyped-call]
    return file.getvalue()


class BagFile:
    """
    MCAP file that is open for writing.

    ``path`` must not exist. A topic's number is its index in ``topics``. ``attachments`` (name to
    media type and content) are written first, so that the bag of a killed process has them. An
    `OSError` at creation leaves nothing behind.
    """

    def __init__(
        self,
        path: Path,
        topics: Sequence[Topic],
        attachments: Mapping[str, tuple[str, bytes]],
        compression: CompressionType,
    ) -> None:
        self.path = path
        self.counts = [0] * len(topics)  # Messages by topic
        self.first: int | None = None  # Log time of the first message [ns]
        self.finished = self.removed = False  # By this process, by another process
        self._start, self._end = NO_START, 0
        self._flushes, self._flushed = 0, 0
        self._flushed_counts = (tuple(self.counts), self._start, self._end)
        with ExitStack() as undo:
            self._file = RecordFile(path)
            undo.callback(path.unlink)
            undo.callback(self._file.close)
            self._reserve = Reserve(path.parent)
            undo.callback(self._reserve.release)
            self._begin_file(topics, attachments, compression)
            undo.pop_all()

    @property
    def error(self) -> OSError | None:
        """Return the first disk error; since then records wait in memory."""
        return self._file.error

    @property
    def in_doubt(self) -> bool:
        """Return whether the disk has ever failed to keep data that it had accepted."""
        return self._file.in_doubt

    @property
    def has_ended(self) -> bool:
        """Return whether its end is on the disk, so that readers find all counted messages."""
        return self._file.has_end

    @property
    def size(self) -> int:
        """Return the current size of the file [bytes]."""
        return self._file.size

    @property
    def has_chunks(self) -> bool:
        """Return whether messages have been passed to the operating system."""
        return self._file.position > self._start_position

    def add_message(
        self, topic: int, log_time: int, publish_time: int, data: bytes, sequence: int
    ) -> None:
        """Add a message with 63-bit times; never raises: check `error`."""
        self._mcap.add_message(self._channels[topic], log_time, data, publish_time, sequence)
        self.counts[topic] += 1
        self._start, self._end = min(self._start, log_time), max(self._end, log_time)
        if self.first is None:
            self.first = log_time

    def flush(self) -> bool:
        """
        Write added messages to the disk; return whether there were any. Raises OSError on failure.

        mcap before 1.6 cannot close a chunk early: with it, only full chunks are safe.
        """
        self._file.check_intact()
        if hasattr(self._mcap, 'flush'):
            self._mcap.flush()  # type: ignore[no-untyped-call]
        if self._file.position == self._flushed:
            return False
        self._flushed = self._file.position
        self._flushes += 1
        chunks = self._flushes + self._file.position // CHUNK_SIZE
        if self._file.error:
            raise self._file.error
        self._file.sync()
        if hasattr(self._mcap, 'flush'):
            self._flushed_counts = (tuple(self.counts), self._start, self._end)
        # Each chunk adds about this much to the index at the end.
        self._reserve.grow(FIRST_RESERVE + chunks * (90 + 10 * len(self.counts)))
        return True

    def finish(self, records: Mapping[str, Mapping[str, str]]) -> OSError | None:
        """
        End the file as well as the disk allows; return the error, if any, now or before.

        ``records`` are metadata records for the end of the file, by name. Messages that the disk
        does not keep in the end are not counted, even if they are there.
        """
        self.finished = True
        self._file.keep_tail()
        for name, content in records.items():
            self._mcap.add_metadata(name, dict(content))
        self._mcap.finish()  # type: ignore[no-untyped-call]
        self._reserve.release()
        with suppress(OSError):
            self._file.check_intact()
        error = self._file.error
        try:
            try:
                self._file.write_waiting()
            except OSError as full:
                error = error or full
                self._count_only(self._file.cut_back())
            self._file.sync()
        except OSError as worse:
            error = error or worse
            try:
                self._file.sync()
            except OSError:
                self._count_safe()
        try:
            self._file.close()
        except OSError as worse:
            error = error or worse
        return error

    def mark_removed(self) -> None:
        """Set all counts to 0, since another process has removed the file."""
        self.removed = True
        self.counts = [0] * len(self.counts)
        self._start, self._end = NO_START, 0

    def abandon(self) -> None:
        """Close the file without an end; its content is not needed."""
        self._reserve.release()
        self._file.close()

    def summarize(self, topics: tuple[Topic, ...]) -> BagSummary:
        """Return a summary of the current content."""
        return BagSummary(
            folder=self.path.parent,
            file=self.path.name,
            topics=topics,
            counts=tuple(self.counts),
            start=self._start,
            duration=max(0, self._end - self._start),
            size=self._file.size,
        )

    def _begin_file(
        self,
        topics: Sequence[Topic],
        attachments: Mapping[str, tuple[str, bytes]],
        compression: CompressionType,
    ) -> None:
        # This stream replaces a binary file: mcap only uses write, tell and flush.
        self._mcap = Writer(
            cast('IO[bytes]', self._file), chunk_size=CHUNK_SIZE, compression=compression
        )
        start_file(self._mcap)
        for name, (media_type, content) in attachments.items():
            self._mcap.add_attachment(0, time.time_ns(), name, media_type, content)
        self._channels = register_topics(self._mcap, topics)
        if self._file.error:
            raise self._file.error
        self._start_position = self._file.position
        self._file.sync()

    def _count_only(self, kept: Statistics) -> None:
        """Count only the messages that reached the file."""
        self.counts = [kept.channel_message_counts.get(channel, 0) for channel in self._channels]
        if kept.message_count:
            self._start, self._end = kept.message_start_time, kept.message_end_time
        else:
            self._start, self._end = NO_START, 0

    def _count_safe(self) -> None:
        """Count only the messages before the last successful flush."""
        if sum(self._flushed_counts[0]) < sum(self.counts):
            counts, self._start, self._end = self._flushed_counts
            self.counts = list(counts)
