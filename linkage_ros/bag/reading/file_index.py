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


"""What stands at the end of an MCAP file: schemas and channels again, places, counts."""

from __future__ import annotations

from struct import Struct
from typing import Any, NamedTuple
from zlib import crc32

from linkage_ros.bag.reading.compression import DamagedError
from linkage_ros.bag.reading.records import Definitions, HEAD, Source, strict
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, ChunkIndex, MetadataIndex, Statistics
from mcap.writer import MCAP0_MAGIC

_FOOTER = Struct('<BQQQI')
"""Kind, length, where the index begins and its second part, its checksum."""

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
"""How many an index may hold: of a terabyte in rosbag2's chunks it has that many."""


class FileIndex(NamedTuple):
    """
    The index of a file.

    Attributes
    ----------
    start
        Where it begins, and the data end.
    checked
        Whether it has a checksum. It fits then.
    definitions
        All schemas and channels, where it repeats them.
    chunks, attachments, metadata
        Where they are.
    statistics
        What the file holds; nothing where it does not say.

    """

    start: int
    checked: bool
    definitions: Definitions
    chunks: tuple[ChunkIndex, ...]
    attachments: tuple[AttachmentIndex, ...]
    metadata: tuple[MetadataIndex, ...]
    statistics: Statistics | None


def index_of(source: Source) -> FileIndex:
    """Return a file's index, an empty one where it was written without; or DamagedError."""
    footer_at = source.size - _FOOTER.size - len(MCAP0_MAGIC)
    footer = source.read(footer_at, _FOOTER.size)
    opcode, length, start, _, crc = _FOOTER.unpack(footer)
    if (opcode, length) != (Opcode.FOOTER, _FOOTER.size - HEAD.size):
        raise DamagedError('its last record is no footer')
    start = start or footer_at
    if start > footer_at:
        raise DamagedError('its index begins behind the end')
    content = source.read(start, footer_at - start)
    if crc and crc32(footer[:-4], crc32(content)) != crc:
        raise DamagedError("its index's checksum does not fit")
    definitions = Definitions()
    found: dict[Any, list[Any]] = {kind: [] for kind in _KINDS.values()}
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
            record = strict(_KINDS[opcode], content[at:end])
            if opcode in _PLACES:
                place = getattr(record, _PLACES[opcode])
                if place in places:
                    raise DamagedError(f'its index names the record at byte {place:,} twice')
                places.add(place)
            found[_KINDS[opcode]].append(record)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            definitions.add(opcode, content[at:end])
        at = end
    return FileIndex(
        start=start,
        checked=bool(crc),
        definitions=definitions,
        chunks=tuple(found[ChunkIndex]),
        attachments=tuple(found[AttachmentIndex]),
        metadata=tuple(found[MetadataIndex]),
        statistics=found[Statistics][-1] if found[Statistics] else None,
    )
