# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Find the whole records of a damaged MCAP file.

The file is read record by record, as by a reader. After an invalid record, the index says where to
continue, if the checksum of the index matches. Otherwise the surrounding records decide, or the
file is searched for the next chunk or attachment with a matching checksum. A record with a
checksum is returned only if it matches; a record without one is never returned after damage.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import suppress
import re
from struct import Struct
from typing import NamedTuple

from linkage_ros.bag.mcap_records import (
    attachment_at,
    Chunk,
    chunk_at,
    DamagedError,
    DataSection,
    Definitions,
    definitions_in,
    FileIndex,
    FoundRecord,
    HEAD,
    index_of,
    is_whole_attachment,
    is_whole_chunk,
    LARGEST,
    Message,
    RecordSource,
)
from linkage_ros.bag.topic import CHANNELS_FILE
from mcap.opcode import Opcode
from mcap.records import Attachment, AttachmentIndex, ChunkIndex, MetadataIndex
from mcap.writer import MCAP0_MAGIC

_WINDOW = 2**20
_BLOCK = 4096
_BEYOND = max(HEAD.size, len(MCAP0_MAGIC))
# The upper half of a record's length is zero, since no record of 4 GiB is accepted. The
# lookahead consumes nothing, so that no record within the bytes of another is missed.
_BEGINNING = re.compile(rb'[\x06\x09](?=.{4}\x00{4})|' + re.escape(MCAP0_MAGIC), re.DOTALL)
_MOST_IN_VAIN = 16
"""Limit for reading false candidates of chunks, in multiples of the file size."""

_INT = Struct('<I')
_CHECKSUM_PLACE = HEAD.size + 24
_KINDS = {
    ChunkIndex: Opcode.CHUNK,
    AttachmentIndex: Opcode.ATTACHMENT,
    MetadataIndex: Opcode.METADATA,
}
_MADE_ANEW = {(MetadataIndex, 'rosbag2'), (AttachmentIndex, CHANNELS_FILE)}
_IN_DATA = {*_KINDS.values(), Opcode.MESSAGE_INDEX, Opcode.DATA_END}

BEGINNING = 'the MCAP magic at the beginning'


def find_next_whole(source: RecordSource, at: int) -> int:
    """
    Return the position of the next chunk or attachment; the file's size if there is none.

    A candidate must have a matching checksum. A whole MCAP file within the file, as in an
    attachment, is skipped: its messages are not in this file.
    """
    budget = _MOST_IN_VAIN * source.size + LARGEST
    while at < source.size:
        window, size = _read_window(source, at)
        goes_on = at + size
        for match in _BEGINNING.finditer(window):
            place = at + match.start()
            if place >= goes_on:
                break
            if match.group() == MCAP0_MAGIC:
                end = _end_of_file_at(source, place)
                if end:
                    goes_on = end
                    break
            elif _is_whole(source, place):
                return place
            else:
                budget -= max(source.read_head(place)[1] - place, 0)
                if budget < 0:
                    return source.size
        at = goes_on
    return source.size


def _read_window(source: RecordSource, at: int) -> tuple[bytes, int]:
    """Return some bytes, and the number of them at which a record may begin."""
    to_next_block = _BLOCK - at % _BLOCK
    # The disk cannot read all of a window, but what is before and after a bad block.
    for size, beyond in ((_WINDOW, _BEYOND), (to_next_block, _BEYOND), (to_next_block, 0)):
        with suppress(DamagedError):
            return source.read(at, min(size + beyond, source.size - at)), size
    return b'', to_next_block


def _is_whole(source: RecordSource, at: int) -> bool:
    opcode, end = source.read_head(at)
    if end > source.size:
        return False
    if opcode == Opcode.CHUNK:
        return is_whole_chunk(source, at)
    return is_whole_attachment(source, at)


def _end_of_file_at(source: RecordSource, at: int) -> int:
    """Return the end of an MCAP file that begins at a position within this file; else 0."""
    place = at + len(MCAP0_MAGIC)
    while place < source.size:
        window, size = _read_window(source, place)
        offset = window.find(MCAP0_MAGIC)
        if offset >= 0:
            end = place + offset + len(MCAP0_MAGIC)
            return end if end < source.size else 0
        place += size
    return 0


class LostRange(NamedTuple):
    """Lost bytes of a file, from `start` to before `end`, and the reason."""

    start: int
    end: int
    reason: str


class Salvage:
    """Finds the whole records of a file, up to its size at the time of opening, once."""

    def __init__(self, source: RecordSource) -> None:
        self.examined_to = 0  # Position up to which it has been examined
        self.losses: list[
            LostRange
        ] = []  # Lost ranges; grows during the search, as do the next two
        self.repaired: list[str] = []  # Damage without a loss
        self.index = _trusted_index(source)  # The file's index, if its checksum matches
        index = self.index
        # Reader of the data section.
        self.data = DataSection(
            source,
            index.definitions if index else Definitions(),
            index.start if index else 0,
        )
        self._source = source
        self._expected = _promised_records(self.index)
        self._expected_positions = sorted(self._expected)
        # If all positions are known there is nothing to search for, and nothing else to lose.
        self._all_known = self.index is not None and _is_complete(self.index)
        self._end = self.index.start if self.index else source.size
        self._spare_definitions = Definitions()
        self._messages = 0
        self._indexes_end = 0  # end of the previous chunk's message indexes

    def find_records(self) -> Iterator[FoundRecord]:
        """Yield messages, attachments and metadata in file order."""
        at = len(MCAP0_MAGIC)
        if self._source.size < at or self._source.read(0, at) != MCAP0_MAGIC:
            self.repaired.append(BEGINNING)
        while at < self._end and not self.data.finished:
            try:
                records, end = self._read_record(at)
            except DamagedError as error:
                end = self._resume_position(at)
                self._add_loss(at, end, str(error))
            else:
                if self.data.unknown[-1:] == [(at, end)]:
                    self._add_loss(at, end, 'has an undefined record type')
                try:
                    yield from self._wanted_records(self._count_messages(records, end))
                except DamagedError as error:
                    self._add_loss(at, end, str(error))
            at = end
            self.examined_to = at
        self._check_end()

    def _read_record(self, at: int) -> tuple[Iterable[FoundRecord], int]:
        """Read the record at a position, or what the index says about it."""
        promised = self._expected.get(at)
        try:
            opcode, end = self._source.read_head(at)
            if promised and opcode != _KINDS[type(promised)]:
                raise DamagedError('does not match the index')
            if opcode not in (Opcode.CHUNK, Opcode.ATTACHMENT) and end > self._next_place(at):
                raise DamagedError('overlaps the next record of the index')
            return self.data.read_record(at)
        except DamagedError:
            taken: tuple[Iterable[FoundRecord], int]
            if isinstance(promised, ChunkIndex):
                taken = self._chunk_by_index(promised)
            elif isinstance(promised, AttachmentIndex):
                attachment, end, crc = attachment_at(self._source, at)
                if not crc:
                    raise
                taken = (attachment,), end
            else:
                raise
            self.repaired.append(f'the head of the record at byte {at:,}')
            return taken

    def _chunk_by_index(self, promised: ChunkIndex) -> tuple[Iterable[Message], int]:
        """Read a chunk by the index, which repeats all of its head except the checksum."""
        start, length = promised.chunk_start_offset, promised.compressed_size
        (crc,) = _INT.unpack(self._source.read(start + _CHECKSUM_PLACE, _INT.size))
        if not crc:
            raise DamagedError('has a damaged head and no checksum')
        end = start + promised.chunk_length
        data = self._source.read(end - length, length)
        chunk = Chunk(promised.uncompressed_size, crc, promised.compression, data, end)
        return self.data.read_chunk(chunk), end

    def _count_messages(self, records: Iterable[FoundRecord], end: int) -> Iterator[FoundRecord]:
        """Pass on the records, and compute the length of the message indexes after them."""
        counts: Counter[int] = Counter()
        for record in records:
            if isinstance(record, Message):
                counts[record.channel.id] += 1
            yield record
        if counts:
            self._messages += counts.total()
            self._indexes_end = end + sum(15 + 16 * count for count in counts.values())

    def _wanted_records(self, items: Iterable[FoundRecord]) -> Iterator[FoundRecord]:
        """Pass on the records for the caller; keep those for internal use."""
        for item in items:
            if isinstance(item, Attachment) and item.name == CHANNELS_FILE:
                self._spare_definitions = definitions_in(item.data)
            else:
                yield item

    def _resume_position(self, at: int) -> int:
        """Return the position to continue at after a damaged record."""
        self.data.allows_unchunked = False
        if self._all_known:
            return self._next_place(at)
        ends = [self._indexes_end]
        try:
            ends.append(self._source.read_head(at)[1])
            ends.append(chunk_at(self._source, at).end)
        except DamagedError:
            pass
        for end in ends:
            if end > at and self._records_follow(end):
                return end
        return find_next_whole(self._source, at + 1)

    def _next_place(self, at: int) -> int:
        number = bisect_right(self._expected_positions, at)
        return (
            self._expected_positions[number]
            if number < len(self._expected_positions)
            else self._end
        )

    def _records_follow(self, at: int) -> bool:
        """Return whether records follow there: two at this place, or the end of the data."""
        try:
            for _ in range(2):
                opcode, end = self._source.read_head(at)
                if opcode not in _IN_DATA or end > self._source.size:
                    return False
                if opcode == Opcode.DATA_END:
                    return end - at == HEAD.size + _INT.size
                at = end
        except DamagedError:
            return False
        return True

    def _add_loss(self, start: int, end: int, reason: str) -> None:
        # The lost range may contain schemas and channels.
        self.data.definitions.add_missing(self._spare_definitions)
        promised = self._expected.get(start)
        ours = (type(promised), getattr(promised, 'name', '')) in _MADE_ANEW
        if (self._all_known and not promised) or ours or end <= self._indexes_end:
            self.repaired.append(f'descriptions or index, at byte {start:,}: {reason}')
        else:
            self.losses.append(LostRange(start, end, reason))

    def _check_end(self) -> None:
        size, length = self._source.size, len(MCAP0_MAGIC)
        self.repaired += [
            f'the length of the record at byte {at:,}' for at in self.data.wrong_lengths
        ]
        if self.index is None and not self.data.finished:
            self.losses.append(LostRange(size, size, 'it ends here, without its end'))
        elif self.index is None:
            self.repaired.append('the index')
        elif self._source.read(size - length, length) != MCAP0_MAGIC:
            self.repaired.append('the MCAP magic at the end')
        if self.losses:
            return
        promised = self.index.statistics if self.index else None
        missing = promised.message_count - self._messages if promised else 0
        if missing > 0:
            reason = f'{missing:,} messages that the index counts are missing'
            self.losses.append(LostRange(size, size, reason))
        try:
            _ = self.data.finished and self.data.has_checksum()
        except DamagedError as error:
            self.repaired.append(str(error))


def _trusted_index(source: RecordSource) -> FileIndex | None:
    """Return the index if its checksum matches; an index without one is not trusted."""
    try:
        index = index_of(source)
    except DamagedError:
        return None
    return index if index.checked else None


def _is_complete(index: FileIndex) -> bool:
    """Return whether an index covers the whole content."""
    statistics = index.statistics
    return (
        statistics is not None
        and statistics.chunk_count == len(index.chunks)
        and statistics.attachment_count == len(index.attachments)
        and statistics.metadata_count == len(index.metadata)
        and bool(index.chunks or not statistics.message_count)
    )


def _promised_records(
    index: FileIndex | None,
) -> dict[int, ChunkIndex | AttachmentIndex | MetadataIndex]:
    promised: dict[int, ChunkIndex | AttachmentIndex | MetadataIndex] = {}
    if index:
        promised |= {chunk.chunk_start_offset: chunk for chunk in index.chunks}
        promised |= {entry.offset: entry for entry in index.attachments}
        promised |= {entry.offset: entry for entry in index.metadata}
    return promised
