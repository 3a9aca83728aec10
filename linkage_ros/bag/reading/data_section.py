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


"""The part of an MCAP file that holds the messages, record by record."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from io import BytesIO
from struct import Struct
from zlib import crc32

from linkage_ros.bag.reading.compression import DamagedError
from linkage_ros.bag.reading.records import (
    attachment_at,
    Chunk,
    chunk_at,
    content_of,
    Definitions,
    HEAD,
    is_whole_attachment,
    is_whole_chunk,
    Message,
    message_of,
    messages_in,
    Source,
    strict,
)
from mcap.opcode import Opcode
from mcap.records import Attachment, Header, Metadata
from mcap.writer import MCAP0_MAGIC

Found = Message | Attachment | Metadata

_INDEX = Struct('<HI')
_CRC = Struct('<I')
_WINDOW = 2**20

MOST_UNPACKED, MOST_TIMES = 2**30, 1000
"""
What the chunks of a file may make together when unpacked: so many bytes, or so many times the
file's. A megabyte of zstd can hold fifty gigabytes of zeros.
"""
_ELSEWHERE = {
    0,
    Opcode.FOOTER,
    Opcode.STATISTICS,
    Opcode.CHUNK_INDEX,
    Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX,
    Opcode.SUMMARY_OFFSET,
}
"""Kinds that no data section holds."""


class DataSection:
    """
    Takes the records of a file, each where it is asked to; remembers what rules the next ones.

    What has a checksum is given only where that fits. Messages outside of chunks, and chunks
    without a checksum, are given where the whole data section has one that fits, or nothing in
    the file has any: then they are counted in `unchecked`.

    Parameters
    ----------
    source
        The file.
    definitions
        Schemas and channels that are known already.
    index_start
        Where the file's index begins, 0 if that is not known: in front of it the data end.

    """

    def __init__(self, source: Source, definitions: Definitions, index_start: int = 0) -> None:
        self.source = source
        self.definitions = definitions
        self.finished = False
        self.loose = True  # whether messages may stand outside of chunks
        self.unchecked = 0
        self.unknown: list[tuple[int, int]] = []
        self.misfits: list[int] = []
        self.profile = ''
        self.compression = ''
        self._crc_seen = False
        self._end = max(index_start - HEAD.size - _CRC.size, 0)
        self._unpacked = 0
        self._covered: bool | None = None
        self._misfit: DamagedError | None = None

    def take(self, at: int) -> tuple[Iterable[Found], int]:
        """
        Take the record that begins there.

        Returns
        -------
        found
            What it holds, to be looked at before the next one is taken: channels are among it.
        end
            Where the next one begins.

        Raises
        ------
        DamagedError
            It is not whole, or not what it says; also when what was found is looked at.

        """
        opcode, end = self.source.head(at)
        if opcode == Opcode.CHUNK:
            chunk = chunk_at(self.source, at)
            return self.chunk(chunk, fits=self._fits(at, chunk.end, end, chunk.crc)), chunk.end
        if opcode == Opcode.ATTACHMENT:
            attachment, inner, crc = attachment_at(self.source, at)
            if not crc and self._crc_seen and not self.covered():
                raise DamagedError('has no checksum, others have')
            self._crc_seen |= bool(crc)
            self._fits(at, inner, end, crc)
            return (attachment,), inner
        if opcode == Opcode.MESSAGE and not self.loose:
            raise DamagedError('is a message outside of the chunks')
        if opcode in _ELSEWHERE:
            raise DamagedError('is of a kind that is not for this place')
        content = self.source.read(at + HEAD.size, end - at - HEAD.size)
        found: tuple[Found, ...] = ()
        if opcode == Opcode.MESSAGE:
            found = (message_of(content, 0, len(content), self.definitions),)
            self.unchecked += not self.covered()
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self.definitions.add(opcode, content)
        elif opcode == Opcode.HEADER:
            self.profile = strict(Header, content).profile
        elif opcode == Opcode.METADATA:
            found = (strict(Metadata, content),)
        elif opcode == Opcode.MESSAGE_INDEX:
            if (
                len(content) < _INDEX.size
                or len(content) % 16 != _INDEX.size
                or (_INDEX.unpack_from(content)[1] != len(content) - _INDEX.size)
            ):
                raise DamagedError('is no index of messages')
        elif opcode == Opcode.DATA_END:
            if len(content) != _CRC.size:
                raise DamagedError('is no end of the data')
            self.finished, self._end = True, at
        elif is_whole_chunk(self.source, at) or is_whole_attachment(self.source, at):
            raise DamagedError('is a chunk or an attachment that calls itself something else')
        else:
            self.unknown.append((at, end))
        return found, end

    def chunk(self, chunk: Chunk, *, fits: bool = True) -> Iterable[Message]:
        """Return a chunk's messages; it begins and ends where its record does, if it fits."""
        if self._unpacked > max(MOST_UNPACKED, MOST_TIMES * self.source.size):
            raise DamagedError(
                f'would make more than {self._unpacked:,} bytes of a file of '
                f'{self.source.size:,}: no recording packs so well'
            )
        content = content_of(chunk)
        self._unpacked += len(content)
        if not chunk.crc and content:
            if not fits:
                raise DamagedError('is not as long as it says')
            # No writer gives a checksum to some chunks only.
            if self._crc_seen and not self.covered():
                raise DamagedError('has no checksum, others have')
            known = Definitions()
            known.schemas |= self.definitions.schemas
            known.channels |= self.definitions.channels
            count = sum(1 for _ in messages_in(content, known))
            self.unchecked += 0 if self.covered() else count
        self._crc_seen |= bool(chunk.crc)
        self.loose = False
        self.compression = self.compression or chunk.compression
        return messages_in(content, self.definitions)

    def covered(self) -> bool:
        """
        Return whether the whole data section has a checksum.

        Raises
        ------
        DamagedError
            It does not fit.

        """
        if self._misfit:
            raise self._misfit
        if self._covered is None:
            try:
                end = self._end or self._find_end()
                if self.source.head(end) != (Opcode.DATA_END, end + HEAD.size + _CRC.size):
                    raise DamagedError('is no end of the data')
                (crc,) = _CRC.unpack(self.source.read(end + HEAD.size, _CRC.size))
            except DamagedError:
                crc = 0
            self._covered = bool(crc)
            if crc and crc != self._crc_to(end):
                self._misfit = DamagedError('the checksum of all data does not fit')
                raise self._misfit
        return self._covered

    def _find_end(self) -> int:
        at = len(MCAP0_MAGIC)
        while True:
            opcode, end = self.source.head(at)
            if opcode == Opcode.DATA_END:
                return at
            at = end

    def _crc_to(self, end: int) -> int:
        found = 0
        for place in range(0, end, _WINDOW):
            found = crc32(self.source.read(place, min(_WINDOW, end - place)), found)
        return found

    def _fits(self, at: int, inner: int, end: int, crc: int) -> bool:
        """Say whether a record ends where its content does; without a checksum it has to."""
        if inner == end:
            return True
        if not crc:
            raise DamagedError('is not as long as it says')
        self.misfits.append(at)
        return False


def definitions_in(content: bytes) -> Definitions:
    """Return the schemas and channels that stand in a small MCAP file, as far as it is one."""
    definitions = Definitions()
    data, at = DataSection(Source(BytesIO(content)), definitions), len(MCAP0_MAGIC)
    with suppress(DamagedError):
        while not data.finished:
            _, at = data.take(at)
    return definitions
