# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The search for the next whole record of a damaged file, at each place in its windows."""

import io
from zlib import crc32

from linkage_ros.bag import find_next_whole, RecordSource
from mcap.data_stream import RecordBuilder
from mcap.records import Attachment, Chunk, Message
import pytest

MIB = 2**20
BLOCK = 4096


def chunk() -> bytes:
    """Return the record of a chunk whose checksum matches."""
    message = RecordBuilder()
    Message(channel_id=1, log_time=1, publish_time=1, sequence=1, data=b'text').write(message)
    data = message.end()
    builder = RecordBuilder()
    Chunk(
        compression='',
        data=data,
        message_end_time=1,
        message_start_time=1,
        uncompressed_crc=crc32(data),
        uncompressed_size=len(data),
    ).write(builder)
    return builder.end()


def attachment() -> bytes:
    builder = RecordBuilder()
    Attachment(
        create_time=1, log_time=1, name='name', media_type='text/plain', data=b'content'
    ).write(builder)
    return builder.end()


RECORDS = {'chunk': chunk, 'attachment': attachment}
# Around the end of a window, each record begins in one and ends in the next.
PLACES = [0, 1, MIB - 40, *range(MIB - 10, MIB + 3), 2 * MIB - 9, 2 * MIB, 3 * MIB + 5]


@pytest.mark.sample(2)
@pytest.mark.parametrize('kind', RECORDS)
@pytest.mark.parametrize('start', [0, 7])
def test_salvage_finds_a_whole_record_at_any_offset(kind, start):
    record = RECORDS[kind]()
    for place in PLACES:
        for after in (0, 100):
            content = bytes(start + place) + record + bytes(after)
            assert find_next_whole(RecordSource(io.BytesIO(content)), start) == start + place


@pytest.mark.parametrize('kind', RECORDS)
def test_salvage_refuses_a_record_with_a_changed_bit(kind):
    record = bytearray(RECORDS[kind]())
    # No checksum covers the times of a chunk, the first 16 bytes behind its head.
    for at in set(range(len(record))) - set(range(9, 25) if kind == 'chunk' else ()):
        changed = bytearray(record)
        changed[at] ^= 0x10
        content = bytes(50) + bytes(changed) + bytes(50)
        assert find_next_whole(RecordSource(io.BytesIO(content)), 0) == len(content)


class BadBlocks(io.BytesIO):
    """A file of which a disk cannot read some blocks."""

    def __init__(self, content: bytes, bad: set[int]) -> None:
        super().__init__(content)
        self._bad = bad

    def read(self, size: int | None = -1) -> bytes:
        begin = self.tell()
        data = super().read(size)
        if not self._bad.isdisjoint(range(begin // BLOCK, (begin + len(data) - 1) // BLOCK + 1)):
            raise OSError(5, 'Input/output error')
        return data


@pytest.mark.parametrize('kind', RECORDS)
@pytest.mark.parametrize('bad', [{1}, {2, 4}, {5, 6, 7}])
@pytest.mark.parametrize('start', [0, 7])
def test_salvage_finds_records_around_bad_disk_blocks(kind, bad, start):
    record = RECORDS[kind]()
    for block in range(10):
        for offset in (start, 100, BLOCK - len(record)):
            place = block * BLOCK + offset
            content = bytes(place) + record + bytes(12 * BLOCK - place)
            source = RecordSource(BadBlocks(content, bad))
            found = find_next_whole(source, start)
            assert found == (source.size if block in bad else place), (block, offset)
