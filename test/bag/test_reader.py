# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""`read_bag` reads our bags and those of others, refuses what is none, and sorts by time."""

from linkage_ros.bag import BagMessage, BagWriter, QosProfile, read_bag
from linkage_ros.errors import BagError
from mcap.writer import MCAP0_MAGIC, Writer
import pytest
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import (
    CompressionFormat,
    CompressionMode,
    StoragePlugin,
    Writer as RosbagsWriter,
)


@pytest.fixture
def folder(tmp_path, topics, messages):
    writer = BagWriter(tmp_path / 'run', topics, {'scene.yaml': ('text/yaml', b'a: 1\n')})
    for message in messages:
        writer.write(*message)
    writer.close({'seed': '7'})
    return tmp_path / 'run'


@pytest.mark.parametrize('name', ['.', 'run_0.mcap'])
def test_messages_are_read_in_the_order_of_writing(folder, topics, messages, name):
    bag = read_bag(folder / name)
    assert bag.topics == topics
    assert bag.attachments == {'scene.yaml': b'a: 1\n'}
    assert not bag.truncated
    expected = [BagMessage(topics[m.topic].name, *m[1:]) for m in messages]
    assert [m.log_time for m in expected] != sorted(m.log_time for m in expected)
    assert list(bag.messages()) == expected
    assert list(bag.messages()) == expected, 'a second time'


def test_custom_data_are_read_from_the_metadata_file(folder):
    assert read_bag(folder).custom == {'seed': '7'}
    assert read_bag(folder / 'run_0.mcap').custom == {}


def test_folder_without_metadata_is_read(folder, topics, messages):
    (folder / 'metadata.yaml').unlink()
    assert sum(1 for _ in read_bag(folder).messages()) == len(messages)


@pytest.mark.parametrize('mode', [CompressionMode.NONE, CompressionMode.STORAGE])
def test_bag_written_by_rosbags_is_read(tmp_path, topics, messages, mode):
    no_limit = QosTime(9223372036, 854775807)
    qos = Qos(
        QosHistory.KEEP_LAST, 5, QosReliability.BEST_EFFORT, QosDurability.VOLATILE, no_limit,
        no_limit, QosLiveliness.AUTOMATIC, no_limit, False
    )  # fmt: skip
    writer = RosbagsWriter(tmp_path / 'run', version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection(
            '/crank',
            topics[0].type,
            msgdef=topics[0].definition,
            rihs01=topics[0].type_hash,
            offered_qos_profiles=[qos],
        )
        for message in messages:
            writer.write(connection, message.log_time, message.data)
    bag = read_bag(tmp_path / 'run')
    (topic,) = bag.topics
    assert (topic.name, topic.type) == ('/crank', topics[0].type)
    assert topic.definition == topics[0].definition
    assert topic.qos == QosProfile(depth=5, reliability='best_effort')
    assert [(m.log_time, m.data) for m in bag.messages()] == [
        (m.log_time, m.data) for m in messages
    ]


def test_file_without_an_index_is_read(tmp_path):
    file = tmp_path / 'plain.mcap'
    with file.open('wb') as stream:
        writer = Writer(stream, use_chunking=False, repeat_channels=False, repeat_schemas=False)
        writer.start()
        schema = writer.register_schema('std_msgs/msg/Empty', 'ros2msg', b'')
        channel = writer.register_channel('/tick', 'cdr', schema)
        writer.add_message(channel, 5, b'\0\1\0\0\0', 4)
        writer.add_attachment(0, 0, 'note', 'text/plain', b'hello')
        writer.finish()
    bag = read_bag(file)
    assert list(bag.messages()) == [('/tick', 5, 4, b'\0\1\0\0\0')]
    assert bag.attachments == {'note': b'hello'}
    assert bag.topics[0].qos == QosProfile()


@pytest.mark.parametrize(
    ('content', 'reason'),
    [
        (b'', 'is empty; its recording never began'),
        (b'rate: 1000\n', "is a text file, not an MCAP file; name a bag's folder, or its .mcap"),
        (b'SQLite format 3\0', 'is a bag in SQLite (.db3), not an MCAP file'),
        (MCAP0_MAGIC[:5], 'not an MCAP file'),
        (MCAP0_MAGIC, 'has no end'),
        (MCAP0_MAGIC * 2, 'is damaged: '),
        (MCAP0_MAGIC + bytes(100) + MCAP0_MAGIC, 'is damaged: '),
    ],
)
def test_text_or_foreign_file_is_refused_with_its_kind(tmp_path, content, reason):
    file = tmp_path / 'run.mcap'
    file.write_bytes(content)
    with pytest.raises(BagError) as caught:
        list(read_bag(file).messages())
    assert str(caught.value).startswith(f'{file}: ')
    assert reason in str(caught.value)
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(
    ('name', 'reason'),
    [
        ('missing', 'does not exist'),
        ('no bag', r'holds no \.mcap file'),
        ('no metadata', "is not a bag's metadata"),
        ('list', "is not a bag's metadata"),
        ('file gone', 'run_7.mcap: does not exist'),
        ('folder.mcap', r'holds no \.mcap file'),
    ],
)
def test_folder_that_is_no_bag_is_refused(tmp_path, name, reason):
    for folder in ['no bag', 'no metadata', 'list', 'file gone', 'folder.mcap']:
        (tmp_path / folder).mkdir()
    (tmp_path / 'no metadata' / 'metadata.yaml').write_text('a: [')
    (tmp_path / 'list' / 'metadata.yaml').write_text('[1, 2]')
    (tmp_path / 'file gone' / 'metadata.yaml').write_text(
        'rosbag2_bagfile_information: {relative_file_paths: [run_7.mcap]}'
    )
    with pytest.raises(BagError, match=reason):
        read_bag(tmp_path / name)


def test_truncated_file_is_read_up_to_its_whole_chunks(folder, messages):
    file = folder / 'run_0.mcap'
    whole = file.read_bytes()
    expected = [message.data for message in messages]
    counts = []
    for size in [9, 60, 4_000, 70_000, 300_001, len(whole) // 2, len(whole) - 8, len(whole) - 1]:
        file.write_bytes(whole[:size])
        with pytest.raises(BagError, match='has no end'):
            read_bag(folder)
        bag = read_bag(folder, allow_truncated=True)
        found = [message.data for message in bag.messages()]
        assert bag.truncated
        assert found == expected[: len(found)]
        counts.append(len(found))
    assert counts == sorted(counts)
    assert counts[0] == 0
    assert counts[-1] == len(messages)


def test_flipped_bit_is_reported_after_the_messages_before(folder, messages):
    file = folder / 'run_0.mcap'
    content = bytearray(file.read_bytes())
    place = content.index(messages[6000].data)
    content[place + 30] ^= 1
    file.write_bytes(content)
    found = []
    with pytest.raises(BagError, match=r'is damaged: the record at .*checksum does not match'):
        found.extend(message.data for message in read_bag(folder).messages())
    assert found == [message.data for message in messages[: len(found)]]
    assert 5000 < len(found) <= 6000


def test_exception_in_the_message_loop_is_not_wrapped(folder):
    def stumble():
        for _ in read_bag(folder).messages():
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        stumble()
