# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A bag written by `BagWriter`, as other readers see it, and the files it never touches."""

import errno
from io import BytesIO
import os
import subprocess
import threading

from linkage_ros import __version__
from linkage_ros.bag import (
    BagWriter,
    qos_text,
    read_bag,
    Recorder,
    SnapshotMemory,
    SnapshotWriting,
    Storage,
)
from linkage_ros.errors import RecordingError
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, Schema
from mcap.stream_reader import StreamReader
import pytest
import yaml

ATTACHMENTS = {
    'scene.yaml': ('text/yaml', b'linkage: four_bar\n'),
    'empty': ('text/plain', b''),
    'bytes': ('application/octet-stream', bytes(range(256)) * 400),
}


@pytest.fixture
def bag(tmp_path, topics, messages):
    """Return a finished bag of all messages, flushed now and then, and its summary."""
    writer = BagWriter(tmp_path / 'run', topics, ATTACHMENTS)
    for index, message in enumerate(messages):
        assert writer.write(*message)
        if index % 1000 == 500:
            writer.flush()
    return writer.close({'seed': '7'})


def test_mcap_and_rosbags_read_every_message(bag, topics, messages, readers):
    readers.agree(bag.folder, topics, messages)


def test_recorded_joint_states_deserialize_by_the_recorded_type(bag, readers):
    found = dict.fromkeys(['/crank', '/arm/joint_states'], 0)
    for topic, message in readers.deserialized(bag.folder):
        number = int(message.header.frame_id.removeprefix('frame '))
        assert message.name == ['coupler_joint', 'rocker_joint']
        assert list(message.position) == [0.001 * (number // 2), -0.002 * number]
        assert list(message.velocity) == [1.0, -2.0]
        assert list(message.effort) == []
        found[topic] += 1
    assert found == {'/crank': 6000, '/arm/joint_states': 6000}


def test_writer_summary_equals_the_file(bag, messages):
    times = [message.log_time for message in messages]
    assert bag.counts == (6000, 6000)
    assert (bag.start, bag.duration) == (min(times), max(times) - min(times))
    assert bag.size == (bag.folder / bag.file).stat().st_size


def test_bag_folder_holds_metadata_and_one_mcap_file(bag):
    assert sorted(p.name for p in bag.folder.iterdir()) == ['metadata.yaml', 'run_0.mcap']


def test_mcap_file_holds_the_records_of_rosbag2(bag, topics):
    with (bag.folder / bag.file).open('rb') as stream:
        reader = make_reader(stream)
        header, summary = reader.get_header(), reader.get_summary()
        (record,) = reader.iter_metadata()
        attachments = {a.name: (a.media_type, a.data) for a in reader.iter_attachments()}
    assert header.profile == 'ros2'
    assert header.library == f'linkage_ros {__version__}'
    (schema,) = summary.schemas.values()
    assert (schema.name, schema.encoding) == (topics[0].type, 'ros2msg')
    assert schema.data.decode() == topics[0].definition
    for topic, channel in zip(topics, summary.channels.values(), strict=True):
        assert (channel.topic, channel.message_encoding) == (topic.name, 'cdr')
        assert channel.metadata == {
            'offered_qos_profiles': qos_text(topic.qos),
            'topic_type_hash': topic.type_hash,
        }
    text = yaml.safe_load((bag.folder / 'metadata.yaml').read_text())
    inner = yaml.safe_load(record.metadata['serialized_metadata'])
    assert record.name == 'rosbag2'
    assert inner == text['rosbag2_bagfile_information']
    assert inner['message_count'] == 12_000
    assert inner['custom_data'] == {'seed': '7'}
    media_type, spare = attachments.pop('channels.mcap')
    assert attachments == ATTACHMENTS
    assert summary.statistics.attachment_count == 4
    assert media_type == 'application/mcap'
    records = [*StreamReader(BytesIO(spare)).records]
    assert [r for r in records if isinstance(r, Schema)] == [schema]
    assert [r for r in records if isinstance(r, Channel)] == [*summary.channels.values()]


def test_chunks_are_small_uncompressed_and_have_checksums(bag):
    with (bag.folder / bag.file).open('rb') as stream:
        chunks = [r for r in StreamReader(stream, emit_chunks=True).records if type(r) is Chunk]
    assert {chunk.compression for chunk in chunks} == {''}
    assert all(chunk.uncompressed_crc for chunk in chunks)
    assert max(chunk.uncompressed_size for chunk in chunks) < 70_000


@pytest.mark.parametrize('custom', [{}, {'a': 'b'}])
def test_bag_without_messages_is_read(tmp_path, topics, readers, custom):
    summary = BagWriter(tmp_path / 'run', topics).close(custom)
    assert summary.counts == (0, 0)
    readers.agree(tmp_path / 'run', topics, [])


def test_writer_with_an_older_mcap_loses_no_message(
    tmp_path, topics, messages, readers, monkeypatch
):
    monkeypatch.delattr('mcap.writer.Writer.flush')
    writer = BagWriter(tmp_path / 'run', topics)
    for message in messages[:2000]:
        writer.write(*message)
        writer.flush()
    writer.close()
    readers.agree(tmp_path / 'run', topics, messages[:2000])


@pytest.mark.parametrize(
    ('log_time', 'publish_time', 'taken'),
    [
        (0, 0, True),
        (2**63 - 1, 2**63 - 1, True),
        (-1, 5, False),
        (5, -1, False),
        (2**63, 5, False),
        (5, 2**63, False),
        (2**64, 5, False),
        (5, 2**64 + 5, False),
    ],
)
def test_message_of_an_out_of_range_time_is_refused(
    tmp_path, topics, messages, readers, log_time, publish_time, taken
):
    writer = BagWriter(tmp_path / 'run', topics)
    odd = messages[1]._replace(log_time=log_time, publish_time=publish_time)
    assert writer.write(*messages[0])
    assert writer.write(*odd) is taken
    assert writer.write(*messages[2])
    summary = writer.close()
    kept = [messages[0], *([odd] if taken else []), messages[2]]
    assert summary.counts == (2, int(taken))
    assert [data for *_, data in readers.mcap(tmp_path / 'run' / 'run_0.mcap')] == [
        message.data for message in kept
    ]


def _contents(folder):
    return {path: path.read_bytes() for path in folder.rglob('*') if path.is_file()}


def test_writer_leaves_an_existing_bag_untouched(bag, topics):
    before = _contents(bag.folder)
    with pytest.raises(RecordingError, match='run: exists already; name a new folder'):
        BagWriter(bag.folder, topics)
    assert _contents(bag.folder) == before


@pytest.mark.parametrize('kind', ['empty folder', 'file', 'link to nowhere'])
def test_writer_leaves_an_existing_path_untouched(tmp_path, topics, kind):
    path = tmp_path / 'run'
    if kind == 'empty folder':
        path.mkdir()
    elif kind == 'file':
        path.write_text('mine')
    else:
        path.symlink_to(tmp_path / 'nowhere')
    with pytest.raises(RecordingError, match='exists already'):
        BagWriter(path, topics)
    assert list(tmp_path.iterdir()) == [path]
    if kind == 'empty folder':
        assert not list(path.iterdir())


def test_writer_refuses_a_folder_below_a_file(tmp_path, topics):
    (tmp_path / 'file').write_text('mine')
    with pytest.raises(RecordingError, match='cannot be recorded to: Not a directory'):
        BagWriter(tmp_path / 'file' / 'run', topics)
    assert (tmp_path / 'file').read_text() == 'mine'


@pytest.mark.skipif(os.geteuid() == 0, reason='root may write anywhere')
def test_writer_refuses_a_folder_without_permission(tmp_path, topics):
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(RecordingError, match='Permission denied'):
            BagWriter(tmp_path / 'run', topics)
    finally:
        tmp_path.chmod(0o700)


def test_writer_refuses_a_read_only_disk(small_disk, topics):
    subprocess.run(['mount', '-o', 'remount,ro', str(small_disk)], check=True)
    with pytest.raises(RecordingError, match='Read-only file system'):
        BagWriter(small_disk / 'run', topics)


def test_full_disk_at_the_start_gets_no_bag(small_disk, topics):
    (small_disk / 'other').write_bytes(bytes(1_700_000))
    with pytest.raises(RecordingError, match='No space left on device'):
        BagWriter(small_disk / 'run', topics)
    assert list(small_disk.iterdir()) == [small_disk / 'other']


# The beginning of each file of a bag: messages published once, such as a robot model.


MODEL = b'\0\1\0\0\6\0\0\0model\0'


@pytest.fixture
def with_model(topics):
    """Return the topics, with that of a model as the last."""
    model = type(topics[0])('/model', 'std_msgs/msg/String', 'string data\n', 'RIHS01_' + '0' * 64)
    return (*topics, model)


def models_in(path):
    """Return what comes first, and how often the model does."""
    found = list(read_bag(path).messages())
    return found[0], sum(message.data == MODEL for message in found)


@pytest.mark.parametrize(
    ('storage', 'files'),
    [
        (Storage(), 1),
        (Storage(split_seconds=2.0), 3),
        (Storage(split_seconds=2.0, keep_files=2), 2),
    ],
    ids=['one file', 'split', 'a ring'],
)
def test_each_bag_file_begins_with_the_opening_message(
    tmp_path, with_model, messages, storage, files
):
    writer = BagWriter(tmp_path / 'run', with_model, storage=storage, opening=[(2, MODEL)])
    recorder = Recorder(writer)
    looks = []
    for message in messages:
        recorder.offer(*message)
        looks += recorder.read_counts()
    summary = recorder.stop()
    assert all(c.received == c.recorded + c.dropped + c.discarded + c.waiting for c in looks)
    assert min(c.waiting for c in looks) >= 0
    counts = summary.topics[2]
    made = 1 if files == 1 else 3
    assert (counts.received, counts.recorded, counts.discarded) == (made, files, made - files)
    assert len(list((tmp_path / 'run').glob('*.mcap'))) == files
    for file in (tmp_path / 'run').glob('*.mcap'):
        first, count = models_in(file)
        second = list(read_bag(file).messages())[1]
        assert (first.topic, first.data, count) == ('/model', MODEL, 1)
        assert first.log_time == first.publish_time == second.log_time


def test_bag_without_messages_has_no_opening_message(tmp_path, with_model):
    recorder = Recorder(BagWriter(tmp_path / 'run', with_model, opening=[(2, MODEL)]))
    assert [(c.received, c.recorded) for c in recorder.stop().topics] == 3 * [(0, 0)]
    assert list(read_bag(tmp_path / 'run').messages()) == []


def test_snapshot_begins_with_the_opening_message(tmp_path, with_model, messages):
    memory = SnapshotMemory(with_model, 100.0, 10**9)
    for message in messages[:1000]:
        memory.offer(*message)
    done = threading.Event()
    writing = SnapshotWriting(
        memory.take_content(),
        lambda: BagWriter(tmp_path / 'run', with_model, opening=[(2, MODEL)]),
        done.set,
    )
    assert done.wait(30)
    memory.stop()
    counts = [(c.received, c.recorded, c.dropped) for c in writing.outcome.topics]
    assert counts == [(500, 500, 0), (500, 500, 0), (1, 1, 0)]
    assert models_in(tmp_path / 'run')[1] == 1


def test_failing_disk_counts_the_opening_message_as_dropped(
    tmp_path, with_model, messages, monkeypatch
):
    recorder = Recorder(
        BagWriter(tmp_path / 'run', with_model, opening=[(2, MODEL)]), flush_period=3600.0
    )

    def failing(*_):
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    monkeypatch.setattr('os.pwrite', failing)
    for message in messages[:2000]:
        recorder.offer(*message)
    summary = recorder.stop()
    assert summary.failure
    assert [(c.received, c.recorded, c.dropped) for c in summary.topics] == [
        (1000, 0, 1000),
        (1000, 0, 1000),
        (1, 0, 1),
    ]
