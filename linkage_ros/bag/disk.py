# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
File of a bag on a disk that may fill: whole records, space for the index, and an end that fits.

mcap's ``Writer`` becomes inconsistent if its stream raises, so `RecordFile` never does: after the
first error it keeps the records in memory. They are then written to the space that `Reserve` has
held. If even that is too little (a limit on the file's size, another process that was faster),
`RecordFile.cut_back` ends the file after the last chunk where an index still fits. A minimal
footer without an index was rejected: rosbags refuses such a file when log times are out of order.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
import errno
from io import BytesIO
from operator import itemgetter
import os
from pathlib import Path
import tempfile

from mcap.data_stream import RecordBuilder
from mcap.records import (
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    Schema,
    Statistics,
)
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC

# Closing a chunk holds the GIL while its message index is built: 0.5 ms for 64 KiB of joint
# states. mcap's default of 1 MiB would hold it, and a tick, for 10 ms.
CHUNK_SIZE = 64 * 1024
FIRST_RESERVE = 512 * 1024
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Errors by which the system reports a lack of space."""
# Data kept in memory until the disk has it, in case an fsync fails [bytes].
_MOST_UNSYNCED = 16 * 1024 * 1024


class LostError(OSError):
    """Another process has truncated, moved or removed a file of the recording."""


class RecordFile:
    """
    File of whole records; writing to it never raises but stores the failure in `error`.

    After the first error, records wait in memory for `write_waiting`. Each write first checks the
    file: if another process has truncated it, the write would leave a hole of zeros.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.position = 0  # of the next record, once the waiting ones are on the disk
        self.size = 0  # end of the last record that the system accepted completely [bytes]
        self.error: OSError | None = None
        self.has_end = False  # whether the system has its last record, and so its index
        self.in_doubt = False  # whether the system has ever failed to write it to the disk
        self._unsynced: list[tuple[int, bytes]] = []  # (offset, data) since the last sync
        self._unsynced_size = 0
        self._waiting: list[bytes] = []
        self._is_cut = False
        self._tail: list[bytes] | None = None
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)

    def write(self, records: bytes) -> None:
        self.position += len(records)
        self._waiting.append(records)
        if self._tail is not None:
            self._tail.append(records)
        if not self.error:
            try:
                self.write_waiting()
            except OSError as error:
                self.error = error

    def tell(self) -> int:
        return self.position

    def flush(self) -> None:
        """Do nothing: there is no buffer between `write` and the system."""

    def check_intact(self) -> None:
        """
        Raise LostError if another process has truncated, moved or removed the file.

        Its `size` is then the size of the truncated file, or 0 if it was removed. After an `error`
        no further check is made.
        """
        if self.error:
            return
        lost = ''
        there = os.fstat(self._descriptor)
        if there.st_size < self.size:
            lost = f'was cut from {self.size:,} to {there.st_size:,} bytes'
            self.size, self._is_cut = there.st_size, True
        elif not _is_named(there, self.path):
            lost = 'was moved or replaced'
            if not there.st_nlink:
                lost, self.size, self._is_cut = 'was removed', 0, True
        if lost:
            self.error = LostError(f'{self.path.name} {lost} by another process')
            raise self.error

    def sync(self) -> None:
        """
        Write the data to the disk (fsync).

        After a failure the system may have dropped data that it could not write, and still succeed
        the next time. So all data since the last success is written again before the next fsync.
        """
        if self.in_doubt:
            for offset, data in self._unsynced:
                self._write_at(data, offset)
        try:
            os.fsync(self._descriptor)
        except OSError:
            self.in_doubt = True
            raise
        self._unsynced.clear()
        self._unsynced_size = 0

    def close(self) -> None:
        os.close(self._descriptor)

    def keep_tail(self) -> None:
        """Keep in memory what is written from now on: the index that `cut_back` needs."""
        self._tail = []

    def write_waiting(self) -> None:
        """Write the waiting records; raises OSError, and can then be called again."""
        if self.error and self._is_cut:
            raise self.error
        while self._waiting:
            self.check_intact()
            self._write_at(self._waiting[0], self.size)
            self._unsynced.append((self.size, self._waiting.pop(0)))
            self.size += len(self._unsynced[-1][1])
            self._unsynced_size += len(self._unsynced[-1][1])
            if self._unsynced_size > _MOST_UNSYNCED:
                self.sync()
        self.has_end = self._tail is not None

    def cut_back(self) -> Statistics:
        """
        End the file with as many chunks as leave space for an index; return their statistics.

        The index overwrites the end of the file in place, which needs no new space on the disk; in
        a file that another process has truncated this is not needed. If even that fails, or if
        there is no space for any index, the file stays without an end, but with whole records
        only.
        """
        stream = BytesIO(b''.join(self._tail or []))
        records = list(StreamReader(stream, skip_magic=True, emit_chunks=True).records)
        whole = [
            r
            for r in records
            if isinstance(r, ChunkIndex) and r.chunk_start_offset + r.chunk_length <= self.size
        ]
        # The last chunk may lack its message indexes; readers of a file without an end need none.
        chunks = [chunk for chunk in whole if _end_of(chunk) <= self.size]
        while chunks:
            start = _end_of(chunks[-1])
            ending = _ending_bytes(records, chunks, start)
            if self._is_cut or start + len(ending) <= self.size:
                if not self._end_with(ending, start):
                    chunks = whole
                break
            chunks.pop()
        with suppress(OSError):
            os.ftruncate(self._descriptor, self.size)
        return _chunk_statistics(records, chunks or whole)

    def _end_with(self, ending: bytes, start: int) -> bool:
        """Write an ending over existing content; return False if nothing was changed."""
        try:
            count = os.pwrite(self._descriptor, ending, start)
        except OSError as error:
            if error.errno not in NO_ROOM:
                return False
            count = 0
        self._unsynced = [(o, d[: start - o]) for o, d in self._unsynced if o < start]
        self.size = start
        with suppress(OSError):
            if not count:
                # A copy-on-write file system needs the space first.
                os.ftruncate(self._descriptor, start)
            self._write_at(ending[count:], start + count)
            self._unsynced.append((start, ending))
            self.size = start + len(ending)
            self.has_end = True
        return True

    def _write_at(self, data: bytes, offset: int) -> None:
        view = memoryview(data)
        while view:
            count = os.pwrite(self._descriptor, view, offset)
            if not count:
                raise OSError(errno.EIO, 'the disk accepts no data')
            view, offset = view[count:], offset + count


class Reserve:
    """
    Disk space held by an unnamed file; `release`, or the end of the process, frees it.

    An OSError says that there is not enough.
    """

    def __init__(self, folder: Path) -> None:
        self._file = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115 (`release` closes it)
        self._size = 0
        self.grow(FIRST_RESERVE)

    def grow(self, size: int) -> None:
        if size > self._size:
            size += CHUNK_SIZE  # to ask the system rarely
            os.posix_fallocate(self._file.fileno(), 0, size)
            self._size = size

    def release(self) -> None:
        with suppress(OSError):  # the file holds no data
            self._file.close()


def _is_named(file: os.stat_result, path: Path) -> bool:
    """Return whether the path still names this file; True if the disk does not answer."""
    try:
        return os.path.samestat(file, path.stat())
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError:
        return True


def _end_of(chunk: ChunkIndex) -> int:
    return chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length


def _chunk_statistics(records: Sequence[McapRecord], chunks: Sequence[ChunkIndex]) -> Statistics:
    """Return the statistics of these chunks from their indexes alone."""
    counts: dict[int, int] = {}
    for chunk in chunks:
        # The message indexes are contiguous: 15 bytes, and 16 for each message.
        end = _end_of(chunk)
        for channel, start in sorted(
            chunk.message_index_offsets.items(), key=itemgetter(1), reverse=True
        ):
            counts[channel] = counts.get(channel, 0) + (end - start - 15) // 16
            end = start
    return Statistics(
        attachment_count=sum(isinstance(r, AttachmentIndex) for r in records),
        channel_count=sum(isinstance(r, Channel) for r in records),
        channel_message_counts=counts,
        chunk_count=len(chunks),
        message_count=sum(counts.values()),
        message_end_time=max((chunk.message_end_time for chunk in chunks), default=0),
        message_start_time=min((chunk.message_start_time for chunk in chunks), default=0),
        metadata_count=0,
        schema_count=sum(isinstance(r, Schema) for r in records),
    )


def _ending_bytes(
    records: Sequence[McapRecord], chunks: Sequence[ChunkIndex], start: int
) -> bytes:
    """Return the bytes after the last of these chunks: end of data, index, footer, magic."""
    builder = RecordBuilder()
    DataEnd(0).write(builder)
    summary_start = start + builder.count
    for record in records:
        if isinstance(record, Schema | Channel | AttachmentIndex):
            record.write(builder)
    _chunk_statistics(records, chunks).write(builder)
    for chunk in chunks:
        chunk.write(builder)
    Footer(summary_start, 0, 0).write(builder)
    ending: bytes = builder.end()  # type: ignore[no-untyped-call]
    return ending + MCAP0_MAGIC
