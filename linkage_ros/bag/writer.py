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
Write a bag that is readable at every instant and stays so when the disk fills.

From the first error of the disk on, mcap's ``Writer`` goes on into memory (`disk.RecordFile`), and
`BagWriter` ends the recording with the records and indexes that it makes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
import time
from typing import cast, IO, NoReturn

from linkage_ros import __version__
from linkage_ros.bag.disk import CHUNK_SIZE, FIRST_RESERVE, RecordFile, Reserve
from linkage_ros.bag.metadata import (
    BagSummary,
    metadata_text,
    NO_START,
    qos_text,
    sync_folder,
    write_metadata,
)
from linkage_ros.bag.topic import Topic
from linkage_ros.errors import RecordingError
from mcap.records import (
    Statistics,
)
from mcap.writer import CompressionType, Writer

_TIME_END = 2**63  # rosbag2's times are signed
_SEQUENCE_END = 2**32  # MCAP's sequence numbers; at 10 kHz they start again after five days


class BagWriter:
    """
    A new bag, open for writing; not for several threads at once.

    Parameters
    ----------
    folder
        Where the bag goes. It is made here; one that exists is never touched.
    topics
        What will be written; a topic's number is its place in this sequence.
    attachments
        Name to (media type, content), written first, so that a killed bag still explains itself.

    Raises
    ------
    RecordingError
        The folder exists, or cannot be made or written to. Nothing is left behind.

    """

    def __init__(
        self,
        folder: str | Path,
        topics: Sequence[Topic],
        attachments: Mapping[str, tuple[str, bytes]] | None = None,
    ) -> None:
        self.folder = Path(folder)
        self.topics = tuple(topics)
        self._counts = [0] * len(self.topics)
        self._refused = [0] * len(self.topics)
        self._start, self._end = NO_START, 0
        self._flushes, self._flushed = 0, 0
        self._summary: BagSummary | None = None
        self._failure: RecordingError | None = None
        try:
            self.folder.mkdir(parents=True)
        except FileExistsError:
            raise RecordingError(
                self.folder, 'exists already', 'name a new folder; nothing is overwritten'
            ) from None
        except OSError as error:
            self._give_up(error)
        path = self.folder / f'{self.folder.name}_0.mcap'
        try:
            with ExitStack() as undo:
                undo.callback(_remove, self.folder)
                self._file = RecordFile(path)
                undo.callback(self._file.close)
                self._reserve = Reserve(self.folder)
                undo.callback(self._reserve.release)
                self._begin(attachments or {})
                undo.pop_all()
        except OSError as error:
            self._give_up(error)

    def _begin(self, attachments: Mapping[str, tuple[str, bytes]]) -> None:
        # Our stream stands in for a binary file: mcap asks it for write, tell and flush only.
        self._mcap = Writer(
            cast('IO[bytes]', self._file),
            chunk_size=CHUNK_SIZE,
            compression=CompressionType.NONE,
        )
        self._mcap.start(profile='ros2', library=f'linkage_ros {__version__}')
        for name, (media_type, content) in attachments.items():
            self._mcap.add_attachment(0, time.time_ns(), name, media_type, content)
        schemas: dict[str, int] = {}
        self._channels: list[int] = []
        for topic in self.topics:
            if topic.type not in schemas:
                definition = topic.definition.encode()
                schemas[topic.type] = self._mcap.register_schema(topic.type, 'ros2msg', definition)
            description = {
                'offered_qos_profiles': qos_text(topic.qos),
                'topic_type_hash': topic.type_hash,
            }
            self._channels.append(
                self._mcap.register_channel(topic.name, 'cdr', schemas[topic.type], description)
            )
        if self._file.error:
            raise self._file.error
        self._file.sync()
        write_metadata(self._summarize(self._counts), {})
        sync_folder(self.folder.absolute().parent)

    def write(self, topic: int, log_time: int, publish_time: int, data: bytes) -> bool:
        """
        Take one message; it is on the disk at the latest after the next `flush`.

        Parameters
        ----------
        topic
            The topic's number.
        log_time, publish_time
            When it was received, and when its source made it [ns].
        data
            The CDR bytes with their 4-byte header.

        Returns
        -------
        bool
            Whether the message was taken. One whose times are negative or beyond 63 bits is
            refused and counted: inside mcap it would break the chunk it comes into.

        Raises
        ------
        RecordingError
            The recording has ended here, and the bag is closed as well as the disk let it be.

        """
        if self._failure:
            raise self._failure
        if not (0 <= log_time < _TIME_END and 0 <= publish_time < _TIME_END):
            self._refused[topic] += 1
            return False
        count = self._counts[topic]
        self._mcap.add_message(
            self._channels[topic], log_time, data, publish_time, count % _SEQUENCE_END
        )
        self._counts[topic] = count + 1
        self._start, self._end = min(self._start, log_time), max(self._end, log_time)
        if self._file.error:
            self._fail(self._file.error)
        return True

    def flush(self) -> None:
        """
        Bring to the disk what was written; raises as `write` does.

        mcap before 1.6 cannot close a chunk early: there, whole chunks only are safe.
        """
        if self._failure:
            raise self._failure
        if hasattr(self._mcap, 'flush'):
            self._mcap.flush()  # type: ignore[no-untyped-call]
        if self._file.position == self._flushed:
            return
        self._flushed = self._file.position
        self._flushes += 1
        chunks = self._flushes + self._file.position // CHUNK_SIZE
        try:
            if self._file.error:
                raise self._file.error
            self._file.sync()
            # The index at the end grows by about this much with each chunk.
            self._reserve.grow(FIRST_RESERVE + chunks * (90 + 10 * len(self.topics)))
        except OSError as error:
            self._fail(error)

    def close(self, custom: Mapping[str, str] | None = None) -> BagSummary:
        """
        Finish the bag and return what it holds; after a failure, return what could be kept.

        Parameters
        ----------
        custom
            Goes to ``custom_data`` of the bag's metadata.

        Raises
        ------
        RecordingError
            As `write`, once; a second call returns the summary.

        """
        if self._summary:
            return self._summary
        error = self._finish(custom or {})
        if error:
            self._failure = self._ended_by(error)
            raise self._failure
        assert self._summary
        return self._summary

    @property
    def size(self) -> int:
        """Return the size of the MCAP file by now [bytes]."""
        return self._file.size

    def _finish(self, custom: Mapping[str, str]) -> OSError | None:
        """Close the bag as well as the disk allows; return what went wrong, now or before."""
        text = metadata_text(self._summarize(self._counts), custom, root=False)
        self._file.keep_tail()
        self._mcap.add_metadata('rosbag2', {'serialized_metadata': text})
        self._mcap.finish()  # type: ignore[no-untyped-call]
        self._reserve.release()
        error = self._file.error
        try:
            try:
                self._file.drain()
            except OSError as full:
                error = error or full
                self._count_only(self._file.cut_back())
            self._file.sync()
        except OSError as worse:
            error = error or worse
        self._summary = self._summarize(self._counts)
        try:
            self._file.close()
            write_metadata(self._summary, custom)
        except OSError as worse:
            error = error or worse
        return error

    def _count_only(self, kept: Statistics) -> None:
        """Forget the messages that did not reach the file."""
        self._counts = [kept.channel_message_counts.get(channel, 0) for channel in self._channels]
        if kept.message_count:
            self._start, self._end = kept.message_start_time, kept.message_end_time
        else:
            self._start, self._end = NO_START, 0

    def _fail(self, error: OSError) -> NoReturn:
        self._failure = self._ended_by(error)
        if not self._summary:
            self._finish({'linkage_ros.failure': str(self._failure)})
        raise self._failure

    def _ended_by(self, error: OSError) -> RecordingError:
        return RecordingError(
            self.folder,
            f'the recording ended early: {error.strerror or error}',
            'what is on the disk stays readable; make room there before the next recording',
        )

    def _give_up(self, error: OSError) -> NoReturn:
        raise RecordingError(
            self.folder,
            f'cannot be recorded to: {error.strerror or error}',
            'name a folder on a disk that can be written to',
        ) from None

    def _summarize(self, counts: Sequence[int]) -> BagSummary:
        return BagSummary(
            folder=self.folder,
            file=self._file.path.name,
            topics=self.topics,
            counts=tuple(counts),
            refused=tuple(self._refused),
            start=self._start,
            duration=max(0, self._end - self._start),
            size=self._file.size,
        )


def _remove(folder: Path) -> None:
    """Remove a folder that nobody but us has written to."""
    for leftover in folder.iterdir():
        leftover.unlink()
    folder.rmdir()
