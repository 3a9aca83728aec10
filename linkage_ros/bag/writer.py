# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Write a bag of one or more files; every flushed message survives a kill or a full disk.

``metadata.yaml`` exists from the start and is updated about once a second and with each new file:
it names all files, and counts the messages on the disk. Until the bag is closed its custom data
has `metadata.UNFINISHED`, so that the bag of a killed process is recognisable, with the
point where it stopped.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from itertools import count
import os
from pathlib import Path
import time
from typing import NoReturn

from linkage_ros.bag.bag_file import BagFile, channels_file, compression_type
from linkage_ros.bag.disk import FIRST_RESERVE, LostError, NO_ROOM, Reserve
from linkage_ros.bag.metadata import (
    BagSummary,
    custom_data,
    FAILURE,
    last_records,
    merge_summaries,
    sync_folder,
    TopicCounts,
    UNFINISHED_DATA,
    write_metadata,
)
from linkage_ros.bag.storage import Storage
from linkage_ros.bag.topic import CHANNELS_FILE, Topic
from linkage_ros.errors import RecordingError

_MAKE_ROOM = 'make room there'
_GO_ON = 'make room there: a run then goes on in a new file'
_CHECK_DISK = 'check the disk before the next recording'
_KEEP_OUT = 'let no other process write to the folder of a bag while it is recorded'
TIME_END = 2**63  # rosbag2's times are signed
_SEQUENCE_END = 2**32  # MCAP's sequence numbers; at 10 kHz they start again after five days
_RENEWAL = 0.8  # [s]; less than the time between two flushes at a period of 1 s
_ROOM_TO_GO_ON = 4 * FIRST_RESERVE  # avoids many small files on a full disk [bytes]

# Data written between two checks of free space: a chunk and the data of a flush [bytes]. It is
# kept free in addition, so that the required space is never missing.
_ON_ITS_WAY = 256 * 1024


class BagWriter:
    """
    A new bag that is open for writing; not thread-safe.

    A topic's number is its index in ``topics``. Each file gets the ``attachments`` (name to media
    type and content) and topics, so that it is complete in itself. ``opening`` (topic number and
    CDR bytes of latched messages) is written before the first message of each file, with its log
    time. The caller has to call `flush` every ``flush_period`` of the storage. Raise
    `RecordingError`, which leaves nothing behind, if the folder exists, or cannot be created or
    written to.
    """

    def __init__(
        self,
        folder: str | Path,
        topics: Sequence[Topic],
        attachments: Mapping[str, tuple[str, bytes]] | None = None,
        storage: Storage | None = None,
        opening: Sequence[tuple[int, bytes]] = (),
    ) -> None:
        self.folder = Path(folder)
        self.topics = tuple(topics)
        self.storage = storage or Storage()
        self._compression = compression_type(self.storage.compression, self.folder)
        # Messages of each topic in files that were removed to keep newer ones.
        self.discarded = (0,) * len(self.topics)
        # Returns the statistics of all messages, given the summary of the bag; None for a bag
        # without statistics.
        self.make_statistics: Callable[[BagSummary], Sequence[TopicCounts] | None] = lambda _: None
        channels = 'application/mcap', channels_file(self.topics)
        self._attachments = {**(attachments or {}), CHANNELS_FILE: channels}
        self._split_time = round(self.storage.split_seconds * 1e9)  # [ns]
        self._splits = self.storage.split_bytes > 0 or self._split_time > 0
        self._paths = (self.folder / f'{self.folder.name}_{number}.mcap' for number in count())
        self._opening = tuple(opening)
        # Number of messages of each topic written because of `opening`, not by `write`.
        self.opening_counts = (0,) * len(self.topics)
        self._sequences = [0] * len(self.topics)
        self._ended_files: list[BagSummary] = []
        self._files_to_remove: list[Path] = []  # files to remove that still exist
        self._due = 0.0
        self._has_news = False  # Whether messages on the disk are not in the metadata yet
        self._checked = 0  # size of the file at the last check of free space [bytes]
        self._summary: BagSummary | None = None
        # Whether it failed for lack of space, so that `resume` may continue.
        self.out_of_room = False
        self._failure: RecordingError | None = None
        self._outcome: dict[str, str] = {}  # messages about failures, for the metadata
        try:
            self.folder.mkdir(parents=True)
        except FileExistsError:
            raise RecordingError(
                self.folder, 'exists already', 'name a new folder; nothing is overwritten'
            ) from None
        except OSError as error:
            self._give_up(error)
        try:
            with ExitStack() as undo:
                undo.callback(_remove_folder, self.folder)
                self._file = self._next_file()
                undo.callback(self._file.abandon)
                self._refuse_if_scarce('cannot be recorded to', _MAKE_ROOM)
                self._renew_metadata(self._summarize())
                sync_folder(self.folder.absolute().parent)
                undo.pop_all()
        except OSError as error:
            self._give_up(error)

    def write(self, topic: int, log_time: int, publish_time: int, data: bytes) -> bool:
        """
        Take a message (CDR with header, times in [ns]); return whether it was accepted.

        The message is on the disk after the next `flush` at the latest. A message with negative
        times, or times beyond 63 bits, is refused: in mcap it would corrupt its chunk.
        Raise `RecordingError` once the recording has ended; the bag is closed as well as the disk
        allows.
        """
        if self._failure:
            raise self._failure
        if not (0 <= log_time < TIME_END and 0 <= publish_time < TIME_END):
            return False
        if self._splits and self._is_full(log_time):
            self._begin_next_file()
        if self.storage.min_free_bytes and self._file.size != self._checked:
            self._check_space()
        if self._opening and self._file.first is None:
            self._open_file(log_time)
        self._add_message(topic, log_time, publish_time, data)
        if self._file.error:
            self._end_recording(self._file.error)
        return True

    def _open_file(self, log_time: int) -> None:
        opened = list(self.opening_counts)
        for topic, data in self._opening:
            self._add_message(topic, log_time, log_time, data)
            opened[topic] += 1
        self.opening_counts = tuple(opened)

    def _add_message(self, topic: int, log_time: int, publish_time: int, data: bytes) -> None:
        sequence = self._sequences[topic]
        self._file.add_message(topic, log_time, publish_time, data, sequence % _SEQUENCE_END)
        self._sequences[topic] = sequence + 1

    def flush(self) -> None:
        """Write the data to the disk, and check its free space; raises as `write` does."""
        if self._failure:
            raise self._failure
        try:
            self._has_news |= self._file.flush()
            if self._has_news and time.monotonic() >= self._due:
                self._try_to_renew(self._summarize())
            self._refuse_if_scarce('the recording was interrupted')
        except (OSError, RecordingError) as error:
            self._end_recording(error)

    def resume(self) -> bool:
        """
        Continue in a new file after a lack of space, if there is some again; return whether so.

        The failure stays recorded in the metadata.
        """
        if not self.out_of_room or not self._file.has_ended:
            return False
        try:
            reserve = Reserve(self.folder)
            try:
                # Quotas and reserved blocks show only in an allocation.
                reserve.grow(_ROOM_TO_GO_ON)
                self._refuse_if_scarce('cannot go on')
            finally:
                reserve.release()
            file = self._next_file()
        except (OSError, RecordingError):
            return False
        self._ended_files, self._file = self._file_summaries(), file
        self._failure, self.out_of_room = None, False
        self._renew_and_discard()
        return True

    def close(self, custom: Mapping[str, str] | None = None) -> BagSummary:
        """
        Finish the bag and return its summary; after a failure, the summary of the messages kept.

        ``custom`` is added to ``custom_data`` in the bag's metadata. A `RecordingError` as for
        `write` is raised once; the next call returns the summary.
        """
        if self._summary:
            return self._summary
        failed, error = self._failure, self._finish_bag(custom or {})
        self._summary = self._summarize()
        if error and not failed:
            self._failure = self._ended_by(error)
            raise self._failure
        return self._summary

    @property
    def kept_counts(self) -> tuple[int, ...]:
        """Return how many messages of each topic `write` has taken and not lost since."""
        summary = self._summarize()
        there = zip(summary.counts, summary.discarded, self.opening_counts, strict=True)
        return tuple(counts + gone - opened for counts, gone, opened in there)

    @property
    def size(self) -> int:
        """Return the current size of the MCAP files [bytes]."""
        return sum(part.size for part in self._ended_files) + self._file.size

    def _is_full(self, log_time: int) -> bool:
        file = self._file
        if file.first is None:
            return False
        if 0 < self.storage.split_bytes <= file.size and file.has_chunks:
            return True
        # After a backward jump of time, new messages do not join the earlier ones.
        return 0 < self._split_time <= abs(log_time - file.first)

    def _check_space(self) -> None:
        """End the recording if there is too little free space."""
        self._checked = self._file.size
        try:
            self._refuse_if_scarce('the recording was interrupted')
        except (OSError, RecordingError) as error:
            self._end_recording(error)

    def _begin_next_file(self) -> None:
        """End the file and begin the next; with too many files, remove the oldest."""
        try:
            self._refuse_if_scarce('the recording was interrupted')
            error = self._file.finish(
                last_records(self._unfinished_metadata, self._summarize(), None)
            )
            if error:
                raise error
            file = self._next_file()
            self._ended_files, self._file = self._file_summaries(), file
            self._renew_and_discard()
        except (OSError, RecordingError) as worse:
            self._end_recording(worse)

    def _renew_and_discard(self) -> None:
        """List the kept files, then remove the others: every listed file exists."""
        parts, most = self._file_summaries(), self.storage.keep_files
        excess = max(0, len(parts) - most) if most else 0
        gone, kept = parts[:excess], parts[excess:]
        discarded = [self.discarded, *(part.counts for part in gone)]
        summary = merge_summaries(kept, tuple(map(sum, zip(*discarded, strict=True))))
        if not self._try_to_renew(summary):
            return
        self._ended_files, self.discarded = kept[:-1], summary.discarded
        self._files_to_remove += [self.folder / part.file for part in gone]
        self._remove_gone()

    def _remove_gone(self) -> None:
        """Remove the files that are due; retry later if one cannot be removed."""
        self._files_to_remove = [file for file in self._files_to_remove if not _is_removed(file)]

    def _finish_bag(self, custom: Mapping[str, str], *, accounted: bool = True) -> OSError | None:
        """
        Close the bag as well as the disk allows; return the error, if any, of this call.

        After an earlier failure, only update its metadata.
        """
        error = None
        if not self._file.finished:
            summary = self._summarize()
            account = self.make_statistics(summary) if accounted else None
            entries = {**custom, **self._outcome}
            error = self._file.finish(last_records(entries, summary, account))
        gone = self._discount_lost_files()
        error = error or gone
        if error and not self._failure:
            self._outcome = {FAILURE: str(self._ended_by(error))}
        summary = self._summarize()
        self._remove_gone()
        account = self.make_statistics(summary) if accounted else None
        last = custom_data({**self._outcome, **custom}, summary, account)
        try:
            try:
                write_metadata(summary, last)
            except OSError:
                # The whole metadata once more: this is the final version.
                write_metadata(summary, last)
        except OSError as worse:
            error = error or worse
        return error

    def _discount_lost_files(self) -> LostError | None:
        """Remove from the counts the messages in files that another process has cut or removed."""
        parts = self._file_summaries()
        gone = [part for part in parts if not _is_there(self.folder / part.file, part.size)]
        if not gone:
            return None
        self._ended_files = [part for part in self._ended_files if part not in gone]
        if parts[-1] in gone:
            self._file.mark_removed()
        names = ', '.join(part.file for part in gone)
        return LostError(f'{names}: cut or removed by another process')

    def _try_to_renew(self, summary: BagSummary) -> bool:
        """Update the metadata, or keep the old ones on failure: no message depends on them."""
        try:
            self._renew_metadata(summary)
        except OSError:
            self._due = time.monotonic() + _RENEWAL
            return False
        return True

    def _renew_metadata(self, summary: BagSummary) -> None:
        """Write the messages on the disk by now into the metadata."""
        begin = time.monotonic()
        write_metadata(summary, custom_data(self._unfinished_metadata, summary, None))
        self._has_news = False
        end = time.monotonic()
        # With many files the metadata are long, and must not keep a slow disk busy.
        self._due = end + max(_RENEWAL, 20.0 * (end - begin))

    def _next_file(self) -> BagFile:
        return BagFile(next(self._paths), self.topics, self._attachments, self._compression)

    @property
    def _unfinished_metadata(self) -> dict[str, str]:
        """Return the custom data of a recording in progress."""
        return {**UNFINISHED_DATA, **self._outcome}

    def _refuse_if_scarce(self, what: str, remedy: str = _GO_ON) -> None:
        """Raise RecordingError if too little is free, without the files' reserve."""
        if not (least := self.storage.min_free_bytes):
            return
        disk = os.statvfs(self.folder)
        free = disk.f_bavail * disk.f_frsize
        if free < least + _ON_ITS_WAY:
            reason = (
                f'{what}: {free:,} bytes are free on its disk, fewer than min_free_bytes: '
                f'{least:,} and {_ON_ITS_WAY:,} to go on'
            )
            raise RecordingError(self.folder, reason, remedy)

    def _end_recording(self, error: OSError | RecordingError) -> NoReturn:
        self._failure = error if isinstance(error, RecordingError) else self._ended_by(error)
        self._outcome = {FAILURE: str(self._failure)}
        # Only `_refuse_if_scarce` raises RecordingError.
        self.out_of_room = isinstance(error, RecordingError) or error.errno in NO_ROOM
        if self.out_of_room:
            self._finish_bag(UNFINISHED_DATA, accounted=False)
        else:
            self._finish_bag({})
        raise self._failure

    def _ended_by(self, error: OSError) -> RecordingError:
        kept = 'what was flushed before' if self._file.in_doubt else 'what is on the disk'
        reason, remedy = 'the recording ended early', _CHECK_DISK
        if error.errno in NO_ROOM:
            reason, remedy = 'the recording was interrupted', _GO_ON
        elif isinstance(error, LostError):
            kept, remedy = 'what is left', _KEEP_OUT
        return RecordingError(
            self.folder,
            f'{reason}: {error.strerror or error}',
            f'{kept} stays readable; {remedy}',
        )

    def _give_up(self, error: OSError) -> NoReturn:
        raise RecordingError(
            self.folder,
            f'cannot be recorded to: {error.strerror or error}',
            'name a folder on a disk that can be written to',
        ) from None

    def _file_summaries(self) -> list[BagSummary]:
        if self._file.removed and self._ended_files:
            return self._ended_files
        return [*self._ended_files, self._file.summarize(self.topics)]

    def _summarize(self) -> BagSummary:
        return merge_summaries(self._file_summaries(), self.discarded)


def _remove_folder(folder: Path) -> None:
    """Remove a folder that only this process has written to."""
    for leftover in folder.iterdir():
        leftover.unlink()
    folder.rmdir()


def _is_there(file: Path, size: int) -> bool:
    """Return whether a file still exists with its size; True if the disk does not answer."""
    try:
        return 0 < size <= file.stat().st_size
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError:
        return True


def _is_removed(file: Path) -> bool:
    try:
        file.unlink(missing_ok=True)
    except OSError:
        return False
    return True
