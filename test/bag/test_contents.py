# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Topics of a bag by count, bytes and time; who wrote a file; and whether it is in use."""

from dataclasses import astuple
import fcntl
from pathlib import Path
import subprocess
import sys

from linkage_ros.bag import (
    BagWriter,
    contents_of,
    is_in_use,
    layout_of,
    read_bag,
    serialized_metadata,
)
from linkage_ros.errors import BagError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, MCAP0_MAGIC, Writer
import pytest


@pytest.fixture
def folder(tmp_path, topics, messages):
    writer = BagWriter(tmp_path / 'run', topics)
    for message in messages:
        writer.write(*message)
    writer.close()
    return tmp_path / 'run'


def test_contents_count_messages_bytes_and_times_per_topic(folder, topics, messages):
    found = contents_of(read_bag(folder))
    for index, topic in enumerate(topics):
        own = [message for message in messages if message.topic == index]
        times = [message.log_time for message in own]
        size = sum(len(message.data) for message in own)
        _, *counted = astuple(found.topics[index])
        assert found.topics[index].topic == topic
        assert counted == [len(own), size, min(times), max(times)]
        rate = (len(own) - 1) / ((max(times) - min(times)) / 1e9)
        assert found.topics[index].mean_rate == pytest.approx(rate, rel=1e-12)
    times = [message.log_time for message in messages]
    assert (found.begin, found.end) == (min(times), max(times))
    assert (found.damage, found.stopped) == ('', False)


@pytest.mark.parametrize(('count', 'span'), [(0, 0), (1, 0), (2, 0)])
def test_topic_without_a_time_span_has_no_rate(tmp_path, topics, count, span):
    writer = BagWriter(tmp_path / 'run', topics)
    for _ in range(count):
        writer.write(0, 5 + span, 5, b'\0\1\0\0')
    writer.close()
    first, second = contents_of(read_bag(tmp_path / 'run')).topics
    assert (first.mean_rate, second.mean_rate) == (None, None)
    assert (second.first, second.last) == (0, 0)


def test_bag_times_are_the_least_and_greatest_log_times(tmp_path, topics):
    writer = BagWriter(tmp_path / 'run', topics)
    for log_time in (7_000, 5_000, 9_000, 8_000):
        writer.write(1, log_time, 5, b'\0\1\0\0')
    writer.close()
    found = contents_of(read_bag(tmp_path / 'run'))
    assert (found.begin, found.end) == (5_000, 9_000)
    assert found.topics[1].mean_rate == 3 / 4e-6


def test_contents_count_messages_before_the_damage(folder, messages):
    file = folder / 'run_0.mcap'
    content = bytearray(file.read_bytes())
    content[content.index(messages[6000].data) + 30] ^= 1
    file.write_bytes(content)
    found = contents_of(read_bag(folder))
    assert 'is damaged: ' in found.damage
    assert found.damage.startswith(f'{file}: ')
    assert 5000 < sum(topic.messages for topic in found.topics) <= 6000


def test_contents_report_progress_and_can_be_stopped(folder, messages):
    told: list[int] = []
    found = contents_of(read_bag(folder), told.append, lambda: len(told) == 2)
    assert found.stopped
    assert sum(topic.messages for topic in found.topics) == 8192
    assert told == sorted(told)
    # A message takes 31 bytes beside its own: opcode, length, channel, sequence, two times.
    assert told[-1] == sum(len(message.data) + 31 for message in messages[:8192])


# `layout_of`: who wrote a file and how it is compressed, also of one that is cut or rubbish.


PAYLOAD = b'\0\1\0\0' + b'the same again ' * 100


def write(file: Path, compression: CompressionType, *, chunked: bool = True) -> None:
    with file.open('wb') as stream:
        writer = Writer(stream, 20_000, compression, use_chunking=chunked)
        writer.start(library='somebody else 1.0')
        schema = writer.register_schema('a/msg/B', 'ros2msg', b'')
        channel = writer.register_channel('/b', 'cdr', schema)
        for index in range(200):
            writer.add_message(channel, index, PAYLOAD, index)
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
def test_compression_sizes_equal_the_index_of_mcap(tmp_path, compression, name):
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


def test_file_without_chunks_has_no_compression(tmp_path):
    write(tmp_path / 'a.mcap', CompressionType.ZSTD, chunked=False)
    found = layout_of(tmp_path / 'a.mcap')
    assert found.compressions == {}
    assert found.content > 200 * len(PAYLOAD)


def test_layout_holds_the_metadata_record_of_rosbag2(tmp_path):
    BagWriter(tmp_path / 'bag', []).close({'seed': '7'})
    record = layout_of(tmp_path / 'bag' / 'bag_0.mcap').rosbag2
    assert record is not None
    found = serialized_metadata(record)
    assert (found['version'], found['custom_data']) == (9, {'seed': '7'})


def test_layout_of_a_truncated_file_lists_whole_chunks(tmp_path):
    write(tmp_path / 'a.mcap', CompressionType.ZSTD)
    content = (tmp_path / 'a.mcap').read_bytes()
    with (tmp_path / 'a.mcap').open('rb') as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    ends = [chunk.chunk_start_offset + chunk.chunk_length for chunk in chunks]
    sizes = {*range(0, len(content), 7), *ends, *(end - 1 for end in ends)}
    for size in sorted(sizes):
        (tmp_path / 'cut.mcap').write_bytes(content[:size])
        # A chunk's record has a head of 9 bytes.
        whole = [
            (chunk.chunk_length - 9, chunk.uncompressed_size)
            for chunk, end in zip(chunks, ends, strict=True)
            if end <= size
        ]
        expected = {'zstd': tuple(map(sum, zip(*whole, strict=True)))} if whole else {}
        assert layout_of(tmp_path / 'cut.mcap').compressions == expected


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
def test_layout_reads_any_malformed_record(tmp_path, record):
    opcode, content = record
    file = tmp_path / 'odd.mcap'
    head = bytes([opcode]) + len(content).to_bytes(8, 'little')
    file.write_bytes(MCAP0_MAGIC + head + content + b'\x05' + b'\xff' * 8)
    found = layout_of(file)
    assert found.library == ''
    assert found.rosbag2 is None or serialized_metadata(found.rosbag2) == {}
    assert all(len(name) < 200 for name in found.compressions)


def test_unreadable_path_raises_a_bag_error(tmp_path):
    with pytest.raises(BagError, match='cannot be read: Is a directory'):
        layout_of(tmp_path)


# `is_in_use`: asked of the system, while somebody holds the file and after.


WRITES = 'import sys; stream = open(sys.argv[1], "ab"); print(flush=True); sys.stdin.read()'


def lease_is_refused(file):
    """Return whether the system knows of a writer, and so refuses a read lease."""
    with file.open('rb') as stream:
        try:
            fcntl.fcntl(stream, fcntl.F_SETLEASE, fcntl.F_RDLCK)
        except BlockingIOError:
            return True
    return False


def test_file_held_open_by_a_writer_is_in_use(tmp_path):
    file = tmp_path / 'run.mcap'
    file.write_bytes(b'some')
    with subprocess.Popen(
        [sys.executable, '-c', WRITES, str(file)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        process.stdout.readline()
        if not lease_is_refused(file):
            pytest.skip('this file system grants leases to anybody')
        assert is_in_use(file)
        process.stdin.close()
    assert not is_in_use(file)
    assert file.read_bytes() == b'some'


def test_file_open_for_reading_is_not_in_use(tmp_path):
    file = tmp_path / 'run.mcap'
    file.write_bytes(b'some')
    with file.open('rb'):
        assert not is_in_use(file)


def test_missing_file_or_folder_is_not_in_use(tmp_path):
    assert not is_in_use(tmp_path / 'missing')
    assert not is_in_use(tmp_path)
