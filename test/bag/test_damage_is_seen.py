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


"""Reading: what no checksum vouches for is not given, and nothing outside of the folder."""

from __future__ import annotations

import os

from linkage_ros.bag.reader import read_bag
from linkage_ros.bag.recover import recover
from linkage_ros.bag.writer import BagWriter
from linkage_ros.errors import BagError
from mcap.writer import CompressionType, IndexType, Writer
import pytest
import yaml

from .damage import chunks_of, COUNT, damaged, data_of, flip, in_chunk, without, write_run


@pytest.fixture
def run(tmp_path, topics, messages):
    return write_run(tmp_path / 'run', topics, messages)


def test_a_chunk_that_calls_itself_something_else_is_seen(run):
    # mcap skips what it does not know.
    damaged(run, in_chunk(2, 0))
    with pytest.raises(BagError, match='calls itself something else'):
        list(read_bag(run).messages())


def test_the_index_is_read_only_if_its_checksum_fits(run):
    damaged(run, lambda c: flip(c.rindex(b'/arm/joint_states') + 3)(c))
    with pytest.raises(BagError, match="its index's checksum does not fit"):
        read_bag(run)


def test_an_attachment_is_read_only_if_its_checksum_fits(run):
    damaged(run, lambda c: flip(c.index(b'four_bar: {}'))(c))
    with pytest.raises(BagError, match='its checksum does not fit'):
        read_bag(run)


def test_an_index_of_messages_is_never_a_message(run):
    # 0x07, an index of messages, to 0x05, a message.
    damaged(run, lambda c: flip(chunks_of(c)[2][1], 1)(c))
    with pytest.raises(BagError, match='a message outside of the chunks'):
        list(read_bag(run).messages())


def test_a_last_file_that_was_only_begun_is_no_hindrance(run, messages):
    (run / 'metadata.yaml').unlink()
    (run / 'run_1.mcap').touch()
    with pytest.raises(BagError, match=r'run_1\.mcap: is empty'):
        read_bag(run)
    bag = read_bag(run, allow_truncated=True)
    assert bag.truncated
    assert [m.data for m in bag.messages()] == [m.data for m in messages[:COUNT]]
    # The file before is finished: damage in it is not the end that a kill leaves.
    damaged(run, in_chunk(2, 500))
    with pytest.raises(BagError, match='checksum does not fit'):
        list(read_bag(run, allow_truncated=True).messages())


def test_each_bit_of_the_lengths_of_an_empty_attachment(tmp_path, topics):
    BagWriter(tmp_path / 'run', topics, {'empty': ('text/plain', b'')}).close()
    content = (tmp_path / 'run' / 'run_0.mcap').read_bytes()
    # Behind it no checksum of nothing, but the head of the next record, which ends in zeros.
    place = content.index(b'text/plain') + 10
    for number in range(64):
        damaged(tmp_path / 'run', flip(place + number // 8, number % 8))
        with pytest.raises(BagError, match='is damaged'):
            read_bag(tmp_path / 'run')
        damaged(tmp_path / 'run', flip(place + number // 8, number % 8))
    assert read_bag(tmp_path / 'run').attachments == {'empty': b''}


@pytest.mark.parametrize('bit', range(8))
@pytest.mark.parametrize('what', ['chunk', 'attachment'])
def test_each_bit_of_a_kind_in_a_file_without_counts(tmp_path, messages, what, bit):
    file = tmp_path / 'a.mcap'
    with file.open('wb') as stream:
        options = {'index_types': IndexType.NONE, 'use_statistics': False}
        writer = Writer(stream, compression=CompressionType.NONE, **options)
        writer.start(profile='ros2')
        channel = writer.register_channel('/text', 'cdr', 0)
        for message in messages[:20]:
            writer.add_message(channel, 0, message.data, 0)
        writer.flush()
        place = {'attachment': stream.tell()}
        writer.add_attachment(0, 0, 'note', 'text/plain', b'some')
        place['chunk'] = stream.tell()
        writer.add_message(channel, 0, b'last', 0)
        writer.finish()
    content = bytearray(file.read_bytes())
    assert content[place[what]] == {'chunk': 6, 'attachment': 9}[what]
    content[place[what]] ^= 1 << bit
    file.write_bytes(content)
    with pytest.raises(BagError, match='is damaged'):
        list(read_bag(file).messages())


class TestOutside:
    """Metadata and links that lead out of the folder: neither read nor recovered."""

    def _refused(self, run, match):
        for act in (read_bag, recover):
            with pytest.raises(BagError, match=match):
                act(run)
        assert not run.with_name('run_recovered').exists()

    @pytest.mark.parametrize(
        'name', ['../secret.mcap', 'a/../../secret.mcap', '..', '', '/', 'a\0b', '\ud800', 'a\nb']
    )
    def test_a_name_that_leads_out(self, run, tmp_path, name):
        (run / 'run_0.mcap').rename(tmp_path / 'secret.mcap')
        text = yaml.safe_dump({'rosbag2_bagfile_information': {'relative_file_paths': [name]}})
        (run / 'metadata.yaml').write_text(text)
        self._refused(run, 'as a file')

    @pytest.mark.parametrize('named', [True, False])
    def test_a_link_that_leads_out(self, run, tmp_path, named):
        (run / 'run_0.mcap').rename(tmp_path / 'secret.mcap')
        (run / 'run_0.mcap').symlink_to('../secret.mcap')
        if not named:
            (run / 'metadata.yaml').unlink()
        self._refused(run, "leads out of the bag's folder")

    def test_a_link_within_the_folder_is_followed(self, run, messages):
        (run / 'run_0.mcap').rename(run / 'moved')
        (run / 'run_0.mcap').symlink_to('moved')
        assert data_of(run) == without(messages, range(0))

    def test_a_file_named_twice(self, run):
        named = {'relative_file_paths': ['run_0.mcap', 'run_0.mcap']}
        text = yaml.safe_dump({'rosbag2_bagfile_information': named})
        (run / 'metadata.yaml').write_text(text)
        self._refused(run, 'twice')

    def test_a_pipe(self, run):
        (run / 'run_0.mcap').unlink()
        os.mkfifo(run / 'run_0.mcap')
        self._refused(run, 'is no file')
