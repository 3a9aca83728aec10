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
How an MCAP file is laid out: who wrote it, how it is compressed, what rosbag2 says in it.

The file is walked from record to record, and chunks are passed over as they are: nothing is
decompressed, and no more is held than the head of a record and the small metadata.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from io import BytesIO
from pathlib import Path
from struct import Struct
from typing import BinaryIO, NamedTuple

from linkage_ros.bag.reading.folder import MOST_METADATA, unreadable
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Header, Metadata
from mcap.writer import MCAP0_MAGIC

_RECORD = Struct('<BQ')
_CHUNK = Struct('<QQQII')
"""First and last time, size when decompressed, its checksum, length of the compression's name."""

_LONGEST_NAME = 64


class Layout(NamedTuple):
    """
    How a file is laid out.

    Attributes
    ----------
    library
        What wrote it; '' where it does not say.
    compressions
        Of each compression of its chunks how many bytes are stored, and how many they make when
        decompressed, as the file says; 'none' is one of them.
    content
        Bytes of all its records when decompressed.
    rosbag2
        What rosbag2 says of the bag in the file itself, the last that it says; nothing where it
        does not.

    """

    library: str
    compressions: Mapping[str, tuple[int, int]]
    content: int
    rosbag2: Metadata | None


def layout_of(file: Path) -> Layout:
    """
    Return how a file is laid out, as far as its records are whole.

    Raises
    ------
    BagError
        Where it cannot be read.

    """
    library = ''
    compressions: dict[str, tuple[int, int]] = {}
    content = 0
    rosbag2: Metadata | None = None
    try:
        with file.open('rb') as stream:
            for opcode, length in _records(stream):
                unpacked = length
                if opcode == Opcode.CHUNK:
                    name, unpacked = _chunk(stream)
                    stored, made = compressions.get(name, (0, 0))
                    compressions[name] = stored + length, made + unpacked
                elif opcode == Opcode.HEADER and length <= MOST_METADATA:
                    library = _library(stream.read(length))
                elif opcode == Opcode.METADATA and length <= MOST_METADATA:
                    rosbag2 = _rosbag2(stream.read(length)) or rosbag2
                content += unpacked
    except OSError as error:
        raise unreadable(file, error) from None
    return Layout(library, compressions, content, rosbag2)


def _records(stream: BinaryIO) -> Iterator[tuple[int, int]]:
    """Yield kind and length of each whole record up to the index; the stream is at its content."""
    size = stream.seek(0, 2)
    at = len(MCAP0_MAGIC)
    while at + _RECORD.size <= size:
        stream.seek(at)
        opcode, length = _RECORD.unpack(stream.read(_RECORD.size))
        at += _RECORD.size + length
        if at > size or opcode in (Opcode.DATA_END, Opcode.FOOTER):
            return
        yield opcode, length


def _chunk(stream: BinaryIO) -> tuple[str, int]:
    """Return the name of a chunk's compression, and how long it is when decompressed."""
    head = stream.read(_CHUNK.size + _LONGEST_NAME)
    if len(head) < _CHUNK.size:
        return '?', 0
    _, _, unpacked, _, length = _CHUNK.unpack_from(head)
    start = _CHUNK.size
    end = start + min(length, _LONGEST_NAME)
    return head[start:end].decode('utf-8', 'backslashreplace') or 'none', unpacked


def _library(content: bytes) -> str:
    try:
        return str(Header.read(ReadDataStream(BytesIO(content))).library)
    except Exception:  # noqa: BLE001 (as the damage has it; reading the messages says so)
        return ''


def _rosbag2(content: bytes) -> Metadata | None:
    try:
        record = Metadata.read(ReadDataStream(BytesIO(content)))
    except Exception:  # noqa: BLE001 (as above)
        return None
    return record if record.name == 'rosbag2' else None
