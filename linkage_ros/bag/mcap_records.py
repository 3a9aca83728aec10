# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Read the records of an MCAP file; accept a record only if length, content and CRC agree.

mcap's own reader accepts the remains of a record in a truncated file, and checks only the CRC of
chunks. Here a record ends where its length says, its content fills it, and every CRC is checked.
`DataSection` reads the part of a file with the messages, `index_of` its index. No record,
compressed or decompressed, may take more memory than `LARGEST`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from importlib import import_module
from io import BytesIO, SEEK_END
from struct import error as StructError, Struct
from typing import Any, BinaryIO, NamedTuple
from zlib import crc32

from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)
from mcap.writer import MCAP0_MAGIC

LARGEST = 256 * 2**20
"""
What one record may take in memory, packed or unpacked [bytes].

rosbag2 makes chunks of less than 1 MiB. A few kilobytes that claim to be gigabytes are not a bag.
"""

HEAD = Struct('<BQ')
"""Head of a record: its kind, and the length of its content."""

_CHUNK = Struct('<QQQII')
"""First and last time, decompressed size, its checksum, length of the compression's name."""

_MESSAGE = Struct('<HIQQ')
_LONG = Struct('<Q')
_INT = Struct('<I')
_LONGEST_NAME = 16
_LONGEST_RECORD = 8 * 2**20
"""Limit for records of many parts, each of which takes a multiple of its bytes [bytes]."""

MOST_CHANNELS = 10_000
"""Most channels, and most schemas, of a file; MCAP has numbers for 65,535."""

_INDEX = Struct('<HI')
_CRC = Struct('<I')
_WINDOW = 2**20

MOST_UNPACKED, MOST_TIMES = 2**30, 1000
"""
Bounds on the unpacked size of all chunks of a file: bytes, or multiples of the file's size.

A megabyte of zstd can hold fifty gigabytes of zeros.
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
"""Kinds of records that no data section contains."""

_FOOTER = Struct('<BQQQI')
"""Kind, length, start of the index and of its second part, checksum."""

_KINDS: dict[int, Any] = {
    Opcode.CHUNK_INDEX: ChunkIndex,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex,
    Opcode.METADATA_INDEX: MetadataIndex,
    Opcode.STATISTICS: Statistics,
}

_PLACES = {
    Opcode.CHUNK_INDEX: 'chunk_start_offset',
    Opcode.ATTACHMENT_INDEX: 'offset',
    Opcode.METADATA_INDEX: 'offset',
}

MOST_RECORDS = 1_000_000
"""Most records of an index: a terabyte in rosbag2's chunks has that many."""


class DamagedError(Exception):
    """An incomplete or invalid record; the text gives the reason."""


def decompress(data: bytes, compression: str, size: int) -> bytes:
    """
    Decompress a chunk (compression '', 'lz4' or 'zstd') to its stated size [bytes], never beyond.

    Raise `DamagedError` if the size is wrong or not allowed, or if decompression fails.
    """
    if size > LARGEST:
        raise DamagedError(f'would unpack to {size:,} bytes; at most {LARGEST:,} are read')
    if compression == '':
        content = data
    elif compression in _UNPACKERS:
        try:
            content = _UNPACKERS[compression](data, size + 1)
        except ImportError:
            raise DamagedError(
                f'is packed with {compression}, and the Python package for it is missing'
            ) from None
        except Exception as error:  # noqa: BLE001 (each library has its own exceptions)
            raise DamagedError(f'cannot be unpacked: {error}') from None
    else:
        raise DamagedError(f'has the unknown compression {compression!r}')
    if len(content) != size:
        raise DamagedError(f'does not unpack to its stated {size:,} bytes')
    return content


def _decompress_lz4(data: bytes, most: int) -> bytes:
    lz4: Any = import_module('lz4.frame')
    content: bytes = lz4.LZ4FrameDecompressor().decompress(data, max_length=most)
    return content


def _decompress_zstd(data: bytes, most: int) -> bytes:
    zstandard: Any = import_module('zstandard')
    with zstandard.ZstdDecompressor().stream_reader(data, read_across_frames=True) as stream:
        content: bytes = stream.read(most)
    return content


_UNPACKERS: dict[str, Callable[[bytes, int], bytes]] = {
    'lz4': _decompress_lz4,
    'zstd': _decompress_zstd,
}


class RecordSource:
    """A file open for reading, with its size at the time of opening."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self.size = stream.seek(0, SEEK_END)

    def read(self, at: int, length: int) -> bytes:
        """Return `length` bytes from position `at`; raise DamagedError if they are missing."""
        if length > LARGEST:
            raise DamagedError(f'would be {length:,} bytes; at most {LARGEST:,} are read')
        if not 0 <= at <= self.size - length:
            raise DamagedError('goes beyond the end of the file')
        try:
            self._stream.seek(at)
            data = self._stream.read(length)
        except OSError as error:
            # A disk that fails to read one place may read the others.
            raise DamagedError(f'cannot be read: {error.strerror or error}') from None
        if len(data) < length:
            raise DamagedError('goes beyond the end of the file')
        return data

    def read_head(self, at: int) -> tuple[int, int]:
        """Return a record's kind and the position of its end, which may be beyond the file's."""
        opcode, length = HEAD.unpack(self.read(at, HEAD.size))
        return opcode, at + HEAD.size + length


class Message(NamedTuple):
    """A message as in its record; times in [ns]."""

    channel: Channel
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


class ChunkHead(NamedTuple):
    """Head of a chunk: size [bytes] and CRC (0: none) of its content, position of its data."""

    size: int
    crc: int
    compression: str
    begin: int
    length: int


class Chunk(NamedTuple):
    """A chunk: fields of its head, its data, and their end, which may not be its record's end."""

    size: int
    crc: int
    compression: str
    data: bytes
    end: int


class Definitions:
    """Schemas and channels of a file by number; no number may have two definitions."""

    def __init__(self) -> None:
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}

    def add_record(self, opcode: int, content: bytes) -> None:
        if opcode == Opcode.SCHEMA:
            schema = parse_strictly(Schema, content)
            if self.schemas.setdefault(schema.id, schema) != schema:
                raise DamagedError(f'redefines schema {schema.id}')
        else:
            channel = parse_strictly(Channel, content)
            if self.channels.setdefault(channel.id, channel) != channel:
                raise DamagedError(f'redefines channel {channel.id}')
        if max(len(self.schemas), len(self.channels)) > MOST_CHANNELS:
            raise DamagedError(f'defines more than {MOST_CHANNELS:,} channels or schemas')

    def add_missing(self, others: Definitions) -> None:
        """Add the schemas and channels whose numbers are new."""
        self.schemas = others.schemas | self.schemas
        self.channels = others.channels | self.channels

    def schema_of(self, channel: Channel) -> Schema | None:
        """Return a channel's schema; None if it has none, or if it is lost."""
        return self.schemas.get(channel.schema_id)


def parse_strictly(kind: Any, content: bytes) -> Any:
    """Parse a record of this kind; its fields must fill the content to the last byte."""
    if len(content) > _LONGEST_RECORD:
        raise DamagedError(
            f'is a {kind.__name__} of {len(content):,} bytes; at most {_LONGEST_RECORD:,} are read'
        )
    try:
        record = kind.read(ReadDataStream(BytesIO(content)))
        builder = RecordBuilder()
        record.write(builder)
        again: bytes = builder.end()  # type: ignore[no-untyped-call]
    except Exception as error:  # noqa: BLE001 (damage makes mcap raise many kinds)
        raise DamagedError(f'is not a valid {kind.__name__}: {error}') from None
    # mcap reads a truncated string as its remains; written again, the record differs.
    if again != HEAD.pack(again[0], len(content)) + content:
        raise DamagedError(f'is not a valid {kind.__name__}')
    return record


def chunk_head(source: RecordSource, at: int) -> ChunkHead:
    """Return the head of the chunk whose record begins at a position."""
    begin = at + HEAD.size
    _, _, size, crc, letters = _CHUNK.unpack(source.read(begin, _CHUNK.size))
    if letters > _LONGEST_NAME:
        raise DamagedError(f'has a compression name of {letters:,} bytes')
    begin += _CHUNK.size
    name = source.read(begin, letters + _LONG.size)
    (length,) = _LONG.unpack_from(name, letters)
    compression = name[:letters].decode('ascii', 'backslashreplace')
    return ChunkHead(size, crc, compression, begin + len(name), length)


def chunk_at(source: RecordSource, at: int) -> Chunk:
    """Return the chunk whose record begins at a position, without checking its content."""
    size, crc, compression, begin, length = chunk_head(source, at)
    return Chunk(size, crc, compression, source.read(begin, length), begin + length)


def content_of(chunk: Chunk) -> bytes:
    """Decompress the content of a chunk, and check its CRC if it has one."""
    content = decompress(chunk.data, chunk.compression, chunk.size)
    if chunk.crc and crc32(content) != chunk.crc:
        raise DamagedError('its checksum does not match')
    return content


def attachment_at(source: RecordSource, at: int) -> tuple[Attachment, int, int]:
    """Return the attachment that begins at a position, its content's end, and its CRC."""
    begin = end = at + HEAD.size + 16
    for _ in ('name', 'media type'):
        (letters,) = _INT.unpack(source.read(end, _INT.size))
        end += _INT.size + letters
    (length,) = _LONG.unpack(source.read(end, _LONG.size))
    end += _LONG.size + length
    content = source.read(begin - 16, end - begin + 16)
    (crc,) = _INT.unpack(source.read(end, _INT.size))
    if crc and crc32(content) != crc:
        raise DamagedError('its checksum does not match')
    # If the length is damaged, zeros of the content may take the place of the checksum.
    if not crc and source.read_head(at)[1] != end + _INT.size:
        raise DamagedError('does not have its stated length')
    try:
        attachment = Attachment.read(ReadDataStream(BytesIO(content + _INT.pack(crc))))
    except UnicodeDecodeError:
        raise DamagedError('has a name that is not UTF-8') from None
    return attachment, end + _INT.size, crc


def is_whole_chunk(source: RecordSource, at: int) -> bool:
    """Return whether a chunk with a matching CRC begins there, whatever kind its record states."""
    try:
        chunk = chunk_at(source, at)
        return chunk.end == source.read_head(at)[1] and chunk.crc != 0 and bool(content_of(chunk))
    except DamagedError:
        return False


def is_whole_attachment(source: RecordSource, at: int) -> bool:
    """Return whether an attachment with a matching CRC begins there, whatever its kind."""
    try:
        _, end, crc = attachment_at(source, at)
        return end == source.read_head(at)[1] and crc != 0
    except DamagedError:
        return False


def messages_in(content: bytes, definitions: Definitions) -> Iterator[Message]:
    """Yield the messages of a chunk's content; add its schemas and channels to `definitions`."""
    at, size = 0, len(content)
    while at < size:
        try:
            opcode, length = HEAD.unpack_from(content, at)
        except StructError:
            raise DamagedError('ends in the middle of a record') from None
        at += HEAD.size
        end = at + length
        if end > size:
            raise DamagedError('ends in the middle of a record')
        if opcode == Opcode.MESSAGE:
            yield message_of(content, at, end, definitions)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            definitions.add_record(opcode, content[at:end])
        elif not opcode:  # a zeroed area may hold millions of such records
            raise DamagedError('contains a record without a type')
        at = end


def message_of(content: bytes, at: int, end: int, definitions: Definitions) -> Message:
    """Parse the message in this range of bytes."""
    if end - at < _MESSAGE.size:
        raise DamagedError('contains a message that ends before its timestamps')
    number, sequence, log_time, publish_time = _MESSAGE.unpack_from(content, at)
    channel = definitions.channels.get(number)
    if channel is None:
        raise DamagedError(f'contains a message of channel {number}, which is not defined')
    begin = at + _MESSAGE.size
    return Message(channel, sequence, log_time, publish_time, content[begin:end])


FoundRecord = Message | Attachment | Metadata


class DataSection:
    """
    Reads records of a file at given positions; keeps the state that the next records depend on.

    Content with a checksum is returned only if the checksum matches. Messages outside of chunks,
    and chunks without a checksum, are returned if the whole data section has a matching checksum,
    or if the file has no checksum at all; then they are counted in `unchecked`. ``index_start`` is
    the position of the file's index, directly after the data section; 0 if unknown.
    """

    def __init__(
        self, source: RecordSource, definitions: Definitions, index_start: int = 0
    ) -> None:
        self.source = source
        self.definitions = definitions
        self.finished = False
        self.allows_unchunked = True  # whether messages may be outside of chunks
        self.unchecked = 0
        self.unknown: list[tuple[int, int]] = []
        self.wrong_lengths: list[int] = []
        self.profile = ''
        self.compression = ''
        self._crc_seen = False
        self._end = max(index_start - HEAD.size - _CRC.size, 0)
        self._unpacked = 0
        self._covered: bool | None = None
        self._checksum_error: DamagedError | None = None

    def read_record(self, at: int) -> tuple[Iterable[FoundRecord], int]:
        """
        Return the content of the record at a position, and the position of the next record.

        Consume the content before the next call: it may define channels. `DamagedError` is raised
        for an incomplete or invalid record, also while the content is consumed.
        """
        opcode, end = self.source.read_head(at)
        if opcode == Opcode.CHUNK:
            chunk = chunk_at(self.source, at)
            return self.read_chunk(
                chunk, fits=self._ends_at_content(at, chunk.end, end, chunk.crc)
            ), chunk.end
        if opcode == Opcode.ATTACHMENT:
            attachment, inner, crc = attachment_at(self.source, at)
            if not crc and self._crc_seen and not self.has_checksum():
                raise DamagedError('has no checksum, but others have one')
            self._crc_seen |= bool(crc)
            self._ends_at_content(at, inner, end, crc)
            return (attachment,), inner
        if opcode == Opcode.MESSAGE and not self.allows_unchunked:
            raise DamagedError('is a message outside of the chunks')
        if opcode in _ELSEWHERE:
            raise DamagedError('has a record type that is not allowed here')
        content = self.source.read(at + HEAD.size, end - at - HEAD.size)
        records: tuple[FoundRecord, ...] = ()
        if opcode == Opcode.MESSAGE:
            records = (message_of(content, 0, len(content), self.definitions),)
            self.unchecked += not self.has_checksum()
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self.definitions.add_record(opcode, content)
        elif opcode == Opcode.HEADER:
            self.profile = parse_strictly(Header, content).profile
        elif opcode == Opcode.METADATA:
            records = (parse_strictly(Metadata, content),)
        elif opcode == Opcode.MESSAGE_INDEX:
            if (
                len(content) < _INDEX.size
                or len(content) % 16 != _INDEX.size
                or (_INDEX.unpack_from(content)[1] != len(content) - _INDEX.size)
            ):
                raise DamagedError('is not a valid message index')
        elif opcode == Opcode.DATA_END:
            if len(content) != _CRC.size:
                raise DamagedError('is not the end of the data')
            self.finished, self._end = True, at
        elif is_whole_chunk(self.source, at) or is_whole_attachment(self.source, at):
            raise DamagedError('is a chunk or an attachment with another record type')
        else:
            self.unknown.append((at, end))
        return records, end

    def read_chunk(self, chunk: Chunk, *, fits: bool = True) -> Iterable[Message]:
        """Return a chunk's messages; `fits`: it begins and ends where its record does."""
        if self._unpacked > max(MOST_UNPACKED, MOST_TIMES * self.source.size):
            raise DamagedError(
                f'would unpack to more than {self._unpacked:,} bytes, from a file of '
                f'{self.source.size:,}: no recording packs as densely'
            )
        content = content_of(chunk)
        self._unpacked += len(content)
        if not chunk.crc and content:
            if not fits:
                raise DamagedError('does not have its stated length')
            # No writer gives a checksum to only some of the chunks.
            if self._crc_seen and not self.has_checksum():
                raise DamagedError('has no checksum, but others have one')
            known = Definitions()
            known.schemas |= self.definitions.schemas
            known.channels |= self.definitions.channels
            count = sum(1 for _ in messages_in(content, known))
            self.unchecked += 0 if self.has_checksum() else count
        self._crc_seen |= bool(chunk.crc)
        self.allows_unchunked = False
        self.compression = self.compression or chunk.compression
        return messages_in(content, self.definitions)

    def has_checksum(self) -> bool:
        """Return whether a checksum covers the data section; a DamagedError if it differs."""
        if self._checksum_error:
            raise self._checksum_error
        if self._covered is None:
            try:
                end = self._end or self._find_end()
                if self.source.read_head(end) != (Opcode.DATA_END, end + HEAD.size + _CRC.size):
                    raise DamagedError('is not the end of the data')
                (crc,) = _CRC.unpack(self.source.read(end + HEAD.size, _CRC.size))
            except DamagedError:
                crc = 0
            self._covered = bool(crc)
            if crc and crc != self._crc_to(end):
                self._checksum_error = DamagedError('the checksum of all data does not match')
                raise self._checksum_error
        return self._covered

    def _find_end(self) -> int:
        at = len(MCAP0_MAGIC)
        while True:
            opcode, end = self.source.read_head(at)
            if opcode == Opcode.DATA_END:
                return at
            at = end

    def _crc_to(self, end: int) -> int:
        crc = 0
        for place in range(0, end, _WINDOW):
            crc = crc32(self.source.read(place, min(_WINDOW, end - place)), crc)
        return crc

    def _ends_at_content(self, at: int, inner: int, end: int, crc: int) -> bool:
        """Return whether a record ends where its content does; required without a checksum."""
        if inner == end:
            return True
        if not crc:
            raise DamagedError('does not have its stated length')
        self.wrong_lengths.append(at)
        return False


def definitions_in(content: bytes) -> Definitions:
    """Return the schemas and channels of a small MCAP file, as far as it can be read."""
    definitions = Definitions()
    data, at = DataSection(RecordSource(BytesIO(content)), definitions), len(MCAP0_MAGIC)
    with suppress(DamagedError):
        while not data.finished:
            _, at = data.read_record(at)
    return definitions


class FileIndex(NamedTuple):
    """Index of a file."""

    start: int  # Position of its start, which is the end of the data
    checked: bool  # Whether it has a checksum, which then matches
    definitions: Definitions  # All schemas and channels, if it repeats them
    # Positions of chunks, attachments and metadata.
    chunks: tuple[ChunkIndex, ...]
    attachments: tuple[AttachmentIndex, ...]
    metadata: tuple[MetadataIndex, ...]
    statistics: Statistics | None  # Counts stated by the file; None if it states none


def index_of(source: RecordSource) -> FileIndex:
    """Return a file's index, empty if the file has none; raise DamagedError if it is damaged."""
    footer_at = source.size - _FOOTER.size - len(MCAP0_MAGIC)
    footer = source.read(footer_at, _FOOTER.size)
    opcode, length, start, _, crc = _FOOTER.unpack(footer)
    if (opcode, length) != (Opcode.FOOTER, _FOOTER.size - HEAD.size):
        raise DamagedError('its last record is not a footer')
    start = start or footer_at
    if start > footer_at:
        raise DamagedError('its index begins after the footer')
    content = source.read(start, footer_at - start)
    if crc and crc32(footer[:-4], crc32(content)) != crc:
        raise DamagedError('the checksum of its index does not match')
    definitions = Definitions()
    by_kind: dict[Any, list[Any]] = {kind: [] for kind in _KINDS.values()}
    places = set()
    at = number = 0
    while at < len(content):
        number += 1
        if number > MOST_RECORDS:
            raise DamagedError(f'its index holds more than {MOST_RECORDS:,} records')
        if at + HEAD.size > len(content):
            raise DamagedError('its index ends in the middle of a record')
        opcode, length = HEAD.unpack_from(content, at)
        at += HEAD.size
        end = at + length
        if opcode in _KINDS:
            record = parse_strictly(_KINDS[opcode], content[at:end])
            if opcode in _PLACES:
                place = getattr(record, _PLACES[opcode])
                if place in places:
                    raise DamagedError(f'its index names the record at byte {place:,} twice')
                places.add(place)
            by_kind[_KINDS[opcode]].append(record)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            definitions.add_record(opcode, content[at:end])
        at = end
    return FileIndex(
        start=start,
        checked=bool(crc),
        definitions=definitions,
        chunks=tuple(by_kind[ChunkIndex]),
        attachments=tuple(by_kind[AttachmentIndex]),
        metadata=tuple(by_kind[MetadataIndex]),
        statistics=by_kind[Statistics][-1] if by_kind[Statistics] else None,
    )
