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
The records of an MCAP file, taken exactly as they say to be, or not at all.

mcap's own reader takes what a file that was cut has left of a record for the record, and looks at
the checksums of chunks only. Here a record ends where its length says, its content fills it, and a
checksum that stands beside something is held against it.
"""

from __future__ import annotations

from collections.abc import Iterator
from io import BytesIO, SEEK_END
from struct import error as StructError
from struct import Struct
from typing import Any, BinaryIO, NamedTuple
from zlib import crc32

from linkage_ros.bag.reading.compression import DamagedError, LARGEST, unpacked
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Schema

HEAD = Struct('<BQ')
"""What each record begins with: its kind, and the length of what follows."""

_CHUNK = Struct('<QQQII')
"""First and last time, size when unpacked, its checksum, length of the name of its packing."""

_MESSAGE = Struct('<HIQQ')
_LONG = Struct('<Q')
_INT = Struct('<I')
_LONGEST_NAME = 16
_LONGEST_RECORD = 8 * 2**20
"""Of those that are made of parts, each of which takes many times its bytes [bytes]."""

MOST_CHANNELS = 10_000
"""How many a file may describe, and how many schemas; MCAP has numbers for 65,535."""


class Source:
    """A file that is open for reading, as large as it was when it was opened."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self.size = stream.seek(0, SEEK_END)

    def read(self, at: int, length: int) -> bytes:
        """Return so many bytes from there on; raises DamagedError where they are not there."""
        if length > LARGEST:
            raise DamagedError(f'would be {length:,} bytes; no more than {LARGEST:,} are taken')
        if not 0 <= at <= self.size - length:
            raise DamagedError('goes beyond the end of the file')
        try:
            self._stream.seek(at)
            data = self._stream.read(length)
        except OSError as error:
            # A disk that cannot read one place may well read the others.
            raise DamagedError(f'cannot be read: {error.strerror or error}') from None
        if len(data) < length:
            raise DamagedError('goes beyond the end of the file')
        return data

    def head(self, at: int) -> tuple[int, int]:
        """Return a record's kind and the place of its end, which may be beyond the file's."""
        opcode, length = HEAD.unpack(self.read(at, HEAD.size))
        return opcode, at + HEAD.size + length


class Message(NamedTuple):
    """A message as its record has it; times in [ns]."""

    channel: Channel
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


class Chunk(NamedTuple):
    """
    A chunk as it stands in a file.

    Attributes
    ----------
    size
        What it says to be when unpacked [bytes].
    crc
        The checksum of what is unpacked; 0 where there is none.
    compression
        How it is packed.
    data
        Packed.
    end
        Where the file goes on, by the length of its content, not by that of its record.

    """

    size: int
    crc: int
    compression: str
    data: bytes
    end: int


class Definitions:
    """The schemas and channels of a file by their numbers; none ever means two things."""

    def __init__(self) -> None:
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}

    def add(self, opcode: int, content: bytes) -> None:
        if opcode == Opcode.SCHEMA:
            schema = strict(Schema, content)
            if self.schemas.setdefault(schema.id, schema) != schema:
                raise DamagedError(f'makes schema {schema.id} another one')
        else:
            channel = strict(Channel, content)
            if self.channels.setdefault(channel.id, channel) != channel:
                raise DamagedError(f'makes channel {channel.id} another one')
        if max(len(self.schemas), len(self.channels)) > MOST_CHANNELS:
            raise DamagedError(f'describes more than {MOST_CHANNELS:,} channels or schemas')

    def complete(self, others: Definitions) -> None:
        """Take over what is not known yet."""
        self.schemas = others.schemas | self.schemas
        self.channels = others.channels | self.channels

    def schema_of(self, channel: Channel) -> Schema | None:
        """Return a channel's schema; nothing where it has none, or it is lost."""
        return self.schemas.get(channel.schema_id)


def strict(kind: Any, content: bytes) -> Any:
    """Return a record of this kind; what it means fills it to the byte."""
    if len(content) > _LONGEST_RECORD:
        raise DamagedError(
            f'is a {kind.__name__} of {len(content):,} bytes; no more than {_LONGEST_RECORD:,} '
            'are taken'
        )
    try:
        record = kind.read(ReadDataStream(BytesIO(content)))
        builder = RecordBuilder()
        record.write(builder)
        again: bytes = builder.end()  # type: ignore[no-untyped-call]
    except Exception as error:  # noqa: BLE001 (mcap raises a dozen kinds, as the damage has it)
        raise DamagedError(f'is no {kind.__name__}: {error}') from None
    # mcap reads a string that is cut as what is left of it; written again, it is another.
    if again != HEAD.pack(again[0], len(content)) + content:
        raise DamagedError(f'is no {kind.__name__}')
    return record


def chunk_at(source: Source, at: int) -> Chunk:
    """Return the chunk whose record begins there; its content is not looked at."""
    begin = at + HEAD.size
    _, _, size, crc, letters = _CHUNK.unpack(source.read(begin, _CHUNK.size))
    if letters > _LONGEST_NAME:
        raise DamagedError(f'has {letters:,} letters for how it is packed')
    begin += _CHUNK.size
    name = source.read(begin, letters + _LONG.size)
    begin += len(name)
    (length,) = _LONG.unpack_from(name, letters)
    compression = name[:letters].decode('ascii', 'backslashreplace')
    return Chunk(size, crc, compression, source.read(begin, length), begin + length)


def content_of(chunk: Chunk) -> bytes:
    """Return what a chunk holds; its checksum fits, if it has one."""
    content = unpacked(chunk.data, chunk.compression, chunk.size)
    if chunk.crc and crc32(content) != chunk.crc:
        raise DamagedError('its checksum does not fit')
    return content


def attachment_at(source: Source, at: int) -> tuple[Attachment, int, int]:
    """Return the attachment whose record begins there, where its content ends, its checksum."""
    begin = end = at + HEAD.size + 16
    for _ in ('name', 'media type'):
        (letters,) = _INT.unpack(source.read(end, _INT.size))
        end += _INT.size + letters
    (length,) = _LONG.unpack(source.read(end, _LONG.size))
    end += _LONG.size + length
    content = source.read(begin - 16, end - begin + 16)
    (crc,) = _INT.unpack(source.read(end, _INT.size))
    if crc and crc32(content) != crc:
        raise DamagedError('its checksum does not fit')
    # Zeros of its content may stand where a damaged length looks for the checksum.
    if not crc and source.head(at)[1] != end + _INT.size:
        raise DamagedError('is not as long as it says')
    try:
        attachment = Attachment.read(ReadDataStream(BytesIO(content + _INT.pack(crc))))
    except UnicodeDecodeError:
        raise DamagedError('has a name that is no text') from None
    return attachment, end + _INT.size, crc


def is_whole_chunk(source: Source, at: int) -> bool:
    """Return whether a chunk is there, whatever its record calls itself; its checksum fits."""
    try:
        chunk = chunk_at(source, at)
        return chunk.end == source.head(at)[1] and chunk.crc != 0 and bool(content_of(chunk))
    except DamagedError:
        return False


def is_whole_attachment(source: Source, at: int) -> bool:
    """Return whether an attachment is there, as `is_whole_chunk` does."""
    try:
        _, end, crc = attachment_at(source, at)
        return end == source.head(at)[1] and crc != 0
    except DamagedError:
        return False


def messages_in(content: bytes, definitions: Definitions) -> Iterator[Message]:
    """Yield the messages of a chunk's content; its schemas and channels go to the definitions."""
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
            definitions.add(opcode, content[at:end])
        elif not opcode:  # millions of them fit into what was zeros
            raise DamagedError('holds a record of no kind')
        at = end


def message_of(content: bytes, at: int, end: int, definitions: Definitions) -> Message:
    """Return the message that fills these bytes."""
    if end - at < _MESSAGE.size:
        raise DamagedError('holds a message without its times')
    number, sequence, log_time, publish_time = _MESSAGE.unpack_from(content, at)
    channel = definitions.channels.get(number)
    if channel is None:
        raise DamagedError(f'holds a message of channel {number}, which is nowhere described')
    begin = at + _MESSAGE.size
    return Message(channel, sequence, log_time, publish_time, content[begin:end])
