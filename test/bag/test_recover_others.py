# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""`recover_bag` on bags that others wrote, or forged: packed, split, without checksums, bombs."""

from pathlib import Path
import struct
import sys
import tracemalloc

from linkage_ros.bag import BagWriter, MOST_CHANNELS, read_bag, recover_bag
from linkage_ros.cli.main import main
from linkage_ros.errors import BagError
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Chunk, DataEnd, Footer, Header, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, MCAP0_MAGIC, Writer
import pytest
import yaml
import zstandard

from .damage import chunks_of, data_of

CHECKSUM = 33
"""Where in a chunk's record its checksum stands."""


def written(file: Path, messages, *, count: int = 90, chunk_size: int = 5000, **options) -> Path:
    """Write a file by mcap's writer with these options."""
    file.parent.mkdir(exist_ok=True)
    with file.open('wb') as stream:
        writer = Writer(stream, chunk_size=chunk_size, **options)
        writer.start(profile='ros2')
        schema = writer.register_schema('std_msgs/msg/String', 'ros2msg', b'string data')
        channel = writer.register_channel('/text', 'cdr', schema)
        for index, message in enumerate(messages[:count]):
            writer.add_message(channel, index, message.data, index, index)
        writer.finish()
    return file


def with_channels(file: Path, count: int) -> Path:
    """Write a file in which each of so many channels comes right before its only message."""
    builder = RecordBuilder()
    Header('ros2', 'test').write(builder)
    Schema(id=1, name='std_msgs/msg/String', encoding='ros2msg', data=b'string data').write(
        builder
    )
    for index in range(count):
        Channel(
            id=index, topic=f'/topic_{index}', message_encoding='cdr', metadata={}, schema_id=1
        ).write(builder)
        Message(
            channel_id=index, log_time=1, publish_time=1, sequence=1, data=b'\0\1\0\0\1\0\0\0\0'
        ).write(builder)
    DataEnd(0).write(builder)
    Footer(0, 0, 0).write(builder)
    file.parent.mkdir(exist_ok=True)
    file.write_bytes(MCAP0_MAGIC + builder.end() + MCAP0_MAGIC)
    return file


@pytest.mark.sample(1)
@pytest.mark.parametrize('count', [MOST_CHANNELS + 1, 65_535, 65_536])
def test_recovery_refuses_too_many_channels_in_one_line(tmp_path, count, capsys):
    file = with_channels(tmp_path / 'many' / 'many_0.mcap', count)
    assert main(['recover', str(file)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert 'would contain more than 10,000 channels; no more are recovered; ' in line
    assert [path.name for path in tmp_path.glob('*/*')] == ['many_0.mcap']


def test_channel_limit_of_recovery_counts_over_all_files(tmp_path, monkeypatch):
    monkeypatch.setattr('linkage_ros.bag.recover.MOST_CHANNELS', 20)
    for index, count in enumerate((15, 20)):
        with_channels(tmp_path / 'bag' / f'bag_{index}.mcap', count)
    recovery = recover_bag(tmp_path / 'bag')
    assert [topic.saved for topic in recovery.topics] == 15 * [2] + 5 * [1]
    with_channels(tmp_path / 'bag' / 'bag_2.mcap', 21)
    with pytest.raises(BagError, match='more than 20 channels'):
        recover_bag(tmp_path / 'bag', tmp_path / 'again')


@pytest.mark.parametrize('compression', [CompressionType.LZ4, CompressionType.ZSTD])
def test_recovery_unpacks_checks_and_repacks_compressed_chunks(tmp_path, messages, compression):
    file = written(tmp_path / 'a.mcap', messages, compression=compression)
    content = bytearray(file.read_bytes())
    start, end = chunks_of(content)[1]
    content[(start + end) // 2] ^= 4
    file.write_bytes(content)
    recovery = recover_bag(file)
    saved = data_of(recovery.folder)
    assert 40 < len(saved) < 90
    rest = iter(message.data for message in messages[:90])
    assert all(data in rest for data in saved)
    with (recovery.folder / 'a_recovered_0.mcap').open('rb') as stream:
        chunks = [r for r in StreamReader(stream, emit_chunks=True).records if type(r) is Chunk]
    assert {chunk.compression for chunk in chunks} == {compression.name.lower()}


def test_recovery_without_zstandard_names_the_missing_package(tmp_path, messages, monkeypatch):
    file = written(tmp_path / 'a.mcap', messages, compression=CompressionType.ZSTD)
    monkeypatch.setitem(sys.modules, 'zstandard', None)
    recovery = recover_bag(file)
    assert not recovery.is_whole
    assert {loss.reason for _, loss in recovery.losses} == {
        'is packed with zstd, and the Python package for it is missing'
    }


def forged(file: Path, data: bytes, size: int, compression: str = 'zstd') -> Path:
    """Write a file with one chunk that says to be so large."""
    with file.open('wb') as stream:
        options = {'index_types': IndexType.NONE, 'use_statistics': False}
        writer = Writer(stream, compression=CompressionType.NONE, **options)
        writer.start(profile='ros2')
        writer.register_channel('/text', 'cdr', 0)
        writer.add_attachment(0, 0, 'note', 'text/plain', b'saved')
        body = struct.pack('<QQQII', 0, 0, size, 1, len(compression)) + compression.encode()
        body += struct.pack('<Q', len(data)) + data
        stream.write(struct.pack('<BQ', 6, len(body)) + body)
        writer.finish()
    return file


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ('size', 'reason'),
    [
        (2**40, 'at most 268,435,456 are read'),
        (2**29, 'at most 268,435,456 are read'),
        (1000, 'does not unpack to its stated 1,000 bytes'),
    ],
)
@pytest.mark.parametrize('open_end', [False, True])
def test_compression_bomb_takes_bounded_memory(tmp_path, size, reason, open_end):
    unpacked = zstandard.ZstdCompressor(write_content_size=not open_end)
    bomb = unpacked.compress(bytes(2**29))
    assert len(bomb) < 50_000
    file = forged(tmp_path / 'bomb.mcap', bomb, size)
    tracemalloc.start()
    try:
        recovery = recover_bag(file)
        with pytest.raises(BagError, match='is damaged'):
            list(read_bag(file).messages())
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 20_000_000
    assert any(reason in loss.reason for _, loss in recovery.losses)
    assert recovery.attachments == ('note',)


def test_chunk_without_a_checksum_is_kept_if_it_parses(tmp_path, messages):
    options = {'compression': CompressionType.NONE}
    file = written(tmp_path / 'a.mcap', messages, **options)
    content = bytearray(file.read_bytes())
    chunks = chunks_of(content)
    for start, _ in chunks:
        struct.pack_into('<I', content, start + CHECKSUM, 0)
    file.write_bytes(content)
    recovery = recover_bag(file, tmp_path / 'whole')
    assert data_of(recovery.folder) == [m.data for m in messages[:90]]
    assert recovery.remarks == ('a.mcap: 90 messages without a checksum, kept unchecked',)
    # A length within the second chunk: now its records do not fill it.
    content[chunks[1][0] + 9 + 40 + 1] ^= 1
    file.write_bytes(content)
    saved = data_of(recover_bag(file, tmp_path / 'part').folder)
    assert 0 < len(saved) < 90
    rest = iter(message.data for message in messages[:90])
    assert all(data in rest for data in saved)


def test_chunk_without_a_checksum_among_others_is_damage(tmp_path, messages):
    file = written(tmp_path / 'a.mcap', messages, compression=CompressionType.NONE)
    content = bytearray(file.read_bytes())
    start, _ = chunks_of(content)[1]
    struct.pack_into('<I', content, start + CHECKSUM, 0)
    file.write_bytes(content)
    with pytest.raises(BagError, match='has no checksum, but others have one'):
        list(read_bag(file).messages())
    assert any('checksum' in loss.reason for _, loss in recover_bag(file).losses)


def test_messages_outside_of_chunks_are_recovered_as_unchecked(tmp_path, messages):
    options = {'use_chunking': False, 'compression': CompressionType.NONE}
    file = written(tmp_path / 'a.mcap', messages, **options)
    content = file.read_bytes()
    place = content.index(messages[50].data)
    # In the middle of a message: what is left of it is no message.
    file.write_bytes(content[: place + 20])
    assert [m.data for m in read_bag(file, allow_truncated=True).messages()] == [
        m.data for m in messages[:50]
    ]
    recovery = recover_bag(file)
    assert data_of(recovery.folder) == [m.data for m in messages[:50]]
    assert not recovery.is_whole
    assert 'without a checksum' in recovery.remarks[0]


def test_checksum_of_all_data_is_verified(tmp_path, messages):
    options = {'use_chunking': False, 'enable_data_crcs': True}
    file = written(tmp_path / 'a.mcap', messages, compression=CompressionType.NONE, **options)
    recovery = recover_bag(file, tmp_path / 'whole')
    assert recovery.is_whole
    assert recovery.remarks == ()
    content = bytearray(file.read_bytes())
    content[content.index(messages[50].data) + 9] ^= 1
    file.write_bytes(content)
    with pytest.raises(BagError, match='checksum of all data'):
        list(read_bag(file).messages())
    recovery = recover_bag(file, tmp_path / 'part')
    assert [topic.saved for topic in recovery.topics] == [0]
    assert not recovery.is_whole


class TestSplit:
    @pytest.fixture
    def split(self, tmp_path, messages):
        folder = tmp_path / 'split'
        dealt = messages[:30], messages[30:60], messages[60:90]
        for index in range(3):
            written(
                folder / f'split_{index}.mcap',
                dealt[index],
                chunk_size=1000,
                compression=CompressionType.NONE,
            )
        return folder

    def test_recovery_merges_split_files_in_order(self, split, messages):
        recovery = recover_bag(split)
        assert recovery.is_whole
        assert data_of(recovery.folder) == [m.data for m in messages[:90]]

    def test_recovery_reports_an_empty_and_a_truncated_file(self, split, messages):
        (split / 'split_2.mcap').write_bytes(b'')
        content = (split / 'split_1.mcap').read_bytes()
        start, _ = chunks_of(content)[-1]
        (split / 'split_1.mcap').write_bytes(content[: start + 5])
        recovery = recover_bag(split)
        saved = data_of(recovery.folder)
        assert 30 < len(saved) < 60
        assert saved == [m.data for m in messages[: len(saved)]]
        assert {file for file, _ in recovery.losses} == {'split_1.mcap', 'split_2.mcap'}

    def test_missing_file_of_a_bag_is_a_loss(self, split, messages):
        named = {'relative_file_paths': ['split_0.mcap', 'split_1.mcap', 'split_7.mcap']}
        text = yaml.safe_dump({'rosbag2_bagfile_information': named})
        (split / 'metadata.yaml').write_text(text)
        recovery = recover_bag(split)
        assert [(file, loss.reason) for file, loss in recovery.losses] == [
            ('split_7.mcap', 'does not exist')
        ]
        assert data_of(recovery.folder) == [m.data for m in messages[:90]]


@pytest.mark.parametrize('index', [True, False])
def test_bag_within_a_damaged_attachment_is_not_salvaged(tmp_path, topics, messages, index):
    inner = written(tmp_path / 'inner.mcap', messages, compression=CompressionType.NONE)
    attached = {'inner.mcap': ('application/octet-stream', inner.read_bytes())}
    writer = BagWriter(tmp_path / 'run', topics, attached)
    for message in messages[1000:1100]:
        writer.write(*message)
    writer.close()
    file = tmp_path / 'run' / 'run_0.mcap'
    content = bytearray(file.read_bytes())
    content[content.index(b'inner.mcap') - 4 - 16 - 8] ^= 1  # the length of the record
    content[content.index(messages[60].data)] ^= 1  # and the content
    file.write_bytes(content if index else content[: chunks_of(content)[0][1]])
    recovery = recover_bag(tmp_path / 'run')
    assert data_of(recovery.folder) == [m.data for m in messages[1000:1100]]
    assert recovery.attachments == ()
    assert not recovery.is_whole
