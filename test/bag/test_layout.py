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


"""`layout_of`: who wrote a file and how it is compressed, also of one that is cut or rubbish."""

from __future__ import annotations

from pathlib import Path

from linkage_ros.bag.contents import layout_of
from linkage_ros.bag.reader import serialized_metadata
from linkage_ros.bag.writer import BagWriter
from linkage_ros.errors import BagError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, MCAP0_MAGIC, Writer
import pytest

PAYLOAD = b'\0\1\0\0' + b'the same again ' * 100


def write(file: Path, compression: CompressionType, *, chunked: bool = True) -> None:
    with file.open('wb') as stream:
        writer = Writer(stream, 20_000, compression, use_chunking=chunked)
        writer.start(library='somebody else 1.0')
        schema = writer.register_schema('a/msg/B', 'ros2msg', b'')
        channel = writer.register_channel('/b', 'cdr', schema)
        for number in range(200):
            writer.add_message(channel, number, PAYLOAD, number)
        writer.add_metadata('other', {'serialized_metadata': 'version: 1'})
        writer.finish()


@pytest.mark.parametrize(
    ('compression', 'name'),
    [
        (CompressionType.NONE, 'none'),
        (CompressionType.LZ4, 'lz4'),
        (CompressionType.ZSTD, 'zstd'),
    ],
)
def test_compression_is_as_mcaps_own_index_has_it(
    tmp_path: Path, compression: CompressionType, name: str
) -> None:
    file = tmp_path / 'a.mcap'
    write(file, compression)
    with file.open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunks = summary.chunk_indexes
    assert len(chunks) > 5
    assert {chunk.compression or 'none' for chunk in chunks} == {name}
    found = layout_of(file)
    # A chunk's length in the index counts its nine bytes of opcode and length too.
    stored = sum(chunk.chunk_length - 9 for chunk in chunks)
    made = sum(chunk.uncompressed_size for chunk in chunks)
    assert found.compressions == {name: (stored, made)}
    assert found.content > 200 * len(PAYLOAD)
    assert found.library.startswith('somebody else')
    assert found.rosbag2 is None


def test_without_chunks_nothing_is_compressed(tmp_path: Path) -> None:
    write(tmp_path / 'a.mcap', CompressionType.ZSTD, chunked=False)
    found = layout_of(tmp_path / 'a.mcap')
    assert found.compressions == {}
    assert found.content > 200 * len(PAYLOAD)


def test_what_rosbag2_says_is_found(tmp_path: Path) -> None:
    BagWriter(tmp_path / 'bag', []).close({'seed': '7'})
    record = layout_of(tmp_path / 'bag' / 'bag_0.mcap').rosbag2
    assert record is not None
    found = serialized_metadata(record)
    assert (found['version'], found['custom_data']) == (9, {'seed': '7'})


def test_cut_anywhere_it_tells_what_is_whole(tmp_path: Path) -> None:
    write(tmp_path / 'a.mcap', CompressionType.ZSTD)
    content = (tmp_path / 'a.mcap').read_bytes()
    stored = []
    for size in range(0, len(content), 7):
        (tmp_path / 'cut.mcap').write_bytes(content[:size])
        stored.append(layout_of(tmp_path / 'cut.mcap').compressions.get('zstd', (0, 0))[0])
    assert stored == sorted(stored)
    assert stored[0] == 0
    assert stored[-1] == layout_of(tmp_path / 'a.mcap').compressions['zstd'][0]


@pytest.mark.parametrize(
    'record',
    [
        (Opcode.CHUNK, bytes(3)),
        (Opcode.CHUNK, bytes(28) + b'\xff\xff\xff\xff' + b'x' * 200),
        (Opcode.CHUNK, bytes(28) + b'\3\0\0\0' + b'\xff\x1b\n' + b'x' * 200),
        (Opcode.HEADER, b'\xff' * 8),
        (Opcode.HEADER, b''),
        (Opcode.METADATA, b'\xff' * 8),
        (Opcode.METADATA, b'\7\0\0\0rosbag2' + bytes(4)),
        (200, b'nobody knows'),
    ],
)
def test_no_record_is_too_odd(tmp_path: Path, record: tuple[int, bytes]) -> None:
    opcode, content = record
    file = tmp_path / 'odd.mcap'
    head = bytes([opcode]) + len(content).to_bytes(8, 'little')
    file.write_bytes(MCAP0_MAGIC + head + content + b'\x05' + b'\xff' * 8)
    found = layout_of(file)
    assert found.library == ''
    assert found.rosbag2 is None or serialized_metadata(found.rosbag2) == {}
    assert all(len(name) < 200 for name in found.compressions)


def test_what_cannot_be_read_says_so(tmp_path: Path) -> None:
    with pytest.raises(BagError, match='cannot be read: Is a directory'):
        layout_of(tmp_path)
