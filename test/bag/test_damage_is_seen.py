# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A reader gives nothing that a checksum does not prove, and says where an end is missing."""

from collections.abc import Callable
import os
from pathlib import Path
import shutil

from linkage_ros.bag import (
    Bag,
    BagWriter,
    read_bag,
    recover_bag,
    Storage,
    TopicCounts,
)
from linkage_ros.errors import BagError
from mcap.writer import CompressionType, IndexType, Writer
import pytest
import yaml

from .damage import chunks_of, COUNT, damaged, data_of, flip, in_chunk, without, write_run


@pytest.fixture
def run(tmp_path, topics, messages):
    return write_run(tmp_path / 'run', topics, messages)


def test_chunk_with_a_changed_record_type_is_damage(run):
    # mcap skips what it does not know.
    damaged(run, in_chunk(2, 0))
    with pytest.raises(BagError, match='with another record type'):
        list(read_bag(run).messages())


def test_index_with_a_wrong_checksum_is_damage(run):
    damaged(run, lambda c: flip(c.rindex(b'/arm/joint_states') + 3)(c))
    with pytest.raises(BagError, match='the checksum of its index does not match'):
        read_bag(run)


def test_attachment_with_a_wrong_checksum_is_damage(run):
    damaged(run, lambda c: flip(c.index(b'four_bar: {}'))(c))
    with pytest.raises(BagError, match='its checksum does not match'):
        read_bag(run)


def test_message_index_read_as_a_message_is_damage(run):
    # 0x07, an index of messages, to 0x05, a message.
    damaged(run, lambda c: flip(chunks_of(c)[2][1], 1)(c))
    with pytest.raises(BagError, match='a message outside of the chunks'):
        list(read_bag(run).messages())


def test_empty_last_file_is_read_as_truncated(run, messages):
    (run / 'metadata.yaml').unlink()
    (run / 'run_1.mcap').touch()
    with pytest.raises(BagError, match=r'run_1\.mcap: is empty'):
        read_bag(run)
    bag = read_bag(run, allow_truncated=True)
    assert bag.truncated
    assert [m.data for m in bag.messages()] == [m.data for m in messages[:COUNT]]
    # The file before is finished: damage in it is not the end that a kill leaves.
    damaged(run, in_chunk(2, 500))
    with pytest.raises(BagError, match='checksum does not match'):
        list(read_bag(run, allow_truncated=True).messages())


def test_flipped_length_bit_of_an_empty_attachment_is_damage(tmp_path, topics):
    BagWriter(tmp_path / 'run', topics, {'empty': ('text/plain', b'')}).close()
    content = (tmp_path / 'run' / 'run_0.mcap').read_bytes()
    # Behind it no checksum of nothing, but the head of the next record, which ends in zeros.
    place = content.index(b'text/plain') + 10
    for index in range(64):
        damaged(tmp_path / 'run', flip(place + index // 8, index % 8))
        with pytest.raises(BagError, match='is damaged'):
            read_bag(tmp_path / 'run')
        damaged(tmp_path / 'run', flip(place + index // 8, index % 8))
    assert read_bag(tmp_path / 'run').attachments == {'empty': b''}


@pytest.mark.parametrize('bit', range(8))
@pytest.mark.parametrize('what', ['chunk', 'attachment'])
def test_flipped_opcode_bit_without_statistics_is_damage(tmp_path, messages, what, bit):
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
        for act in (read_bag, recover_bag):
            with pytest.raises(BagError, match=match):
                act(run)
        assert not run.with_name('run_recovered').exists()

    @pytest.mark.parametrize(
        'name', ['../secret.mcap', 'a/../../secret.mcap', '..', '', '/', 'a\0b', '\ud800', 'a\nb']
    )
    def test_metadata_path_out_of_the_folder_is_refused(self, run, tmp_path, name):
        (run / 'run_0.mcap').rename(tmp_path / 'secret.mcap')
        text = yaml.safe_dump({'rosbag2_bagfile_information': {'relative_file_paths': [name]}})
        (run / 'metadata.yaml').write_text(text)
        self._refused(run, 'as a file')

    @pytest.mark.parametrize('named', [True, False])
    def test_symbolic_link_out_of_the_folder_is_refused(self, run, tmp_path, named):
        (run / 'run_0.mcap').rename(tmp_path / 'secret.mcap')
        (run / 'run_0.mcap').symlink_to('../secret.mcap')
        if not named:
            (run / 'metadata.yaml').unlink()
        self._refused(run, "leads out of the bag's folder")

    def test_symbolic_link_within_the_folder_is_followed(self, run, messages):
        (run / 'run_0.mcap').rename(run / 'moved')
        (run / 'run_0.mcap').symlink_to('moved')
        assert data_of(run) == without(messages, range(0))

    def test_file_named_twice_in_metadata_is_refused(self, run):
        named = {'relative_file_paths': ['run_0.mcap', 'run_0.mcap']}
        text = yaml.safe_dump({'rosbag2_bagfile_information': named})
        (run / 'metadata.yaml').write_text(text)
        self._refused(run, 'twice')

    def test_named_pipe_in_a_bag_folder_is_refused(self, run):
        (run / 'run_0.mcap').unlink()
        os.mkfifo(run / 'run_0.mcap')
        self._refused(run, 'is not a file')


# A bag says that an end is missing: of a file, or after files that are all whole.


SECOND = 1_000_000_000


class Recording:
    """A recording in files of 1 s, of ten messages a second, of which each state can be kept."""

    def __init__(self, folder: Path, topics: object, keep_files: int = 0) -> None:
        storage = Storage(split_seconds=1.0, keep_files=keep_files)
        self.writer = BagWriter(folder / 'run', topics, {'run.json': ('', b'{}')}, storage)
        self.writer.make_statistics = lambda bag: [
            TopicCounts(topic.name, count, count, 0)
            for topic, count in zip(bag.topics, bag.counts, strict=True)
        ]
        self._kept = folder
        self._number = 0

    def write(self, messages: int) -> None:
        for _ in range(messages):
            self._number += 1
            time = self._number * SECOND // 10
            self.writer.write(0, time, time, b'\0\1\0\0' + self._number.to_bytes(8, 'little'))

    def keep(self, name: str) -> Path:
        """Return a copy of the bag as it is on the disk now."""
        return Path(shutil.copytree(self.writer.folder, self._kept / name))


def killed_in_a_file(folder: Path, topics: object) -> Path:
    recording = Recording(folder, topics)
    recording.write(15)
    recording.writer.flush()
    return recording.keep('killed')


def killed_between_files(folder: Path, topics: object) -> Path:
    # The first file has got its end; the second one is not there, and nobody has named it.
    recording = Recording(folder, topics)
    recording.write(9)
    before = recording.keep('before')
    recording.write(9)
    recording.writer.close()
    bag = recording.keep('killed')
    (bag / 'run_1.mcap').unlink()
    shutil.copy(before / 'metadata.yaml', bag / 'metadata.yaml')
    return bag


def without_metadata(folder: Path, topics: object) -> Path:
    bag = killed_between_files(folder, topics)
    (bag / 'metadata.yaml').unlink()
    return bag


def a_file_that_is_not_the_last(folder: Path, topics: object) -> Path:
    return killed_between_files(folder, topics) / 'run_0.mcap'


def finished(folder: Path, topics: object) -> Path:
    recording = Recording(folder, topics)
    recording.write(15)
    recording.writer.close()
    return recording.keep('finished')


def finished_but_for_the_last_words(folder: Path, topics: object) -> Path:
    # Killed between the end of the last file and the renewal of metadata.yaml.
    recording = Recording(folder, topics)
    recording.write(15)
    words = recording.keep('before') / 'metadata.yaml'
    recording.writer.close()
    bag = recording.keep('finished')
    shutil.copy(words, bag / 'metadata.yaml')
    return bag


def the_last_file(folder: Path, topics: object) -> Path:
    return finished(folder, topics) / 'run_1.mcap'


def recovered(folder: Path, topics: object) -> Path:
    recovery = recover_bag(killed_between_files(folder, topics))
    assert recovery is not None
    return recovery.folder


# For each bag whether an end is missing, and its number of messages.
BAGS: dict[Callable[[Path, object], Path], tuple[bool, int]] = {
    killed_in_a_file: (True, 15),
    killed_between_files: (True, 10),
    without_metadata: (True, 10),
    a_file_that_is_not_the_last: (True, 10),
    finished: (False, 15),
    finished_but_for_the_last_words: (False, 15),
    the_last_file: (False, 5),
    recovered: (False, 10),
}


@pytest.mark.parametrize('made', BAGS, ids=lambda made: made.__name__)
def test_reader_reports_whether_a_bag_is_truncated(made, tmp_path, topics):
    truncated, count = BAGS[made]
    path = made(tmp_path, topics)
    bag: Bag = read_bag(path, allow_truncated=True)
    assert bag.truncated == truncated
    assert len(list(bag.messages())) == count
    if truncated and path.is_dir():
        with pytest.raises(BagError, match='its recording was killed, or still runs'):
            read_bag(path)
    else:
        assert len(list(read_bag(path).messages())) == count


def test_recovery_reads_older_files_of_a_killed_ring_first(tmp_path, topics):
    # Killed between the renewal of metadata.yaml and the removal of the file that is not in it.
    recording = Recording(tmp_path, topics, keep_files=2)
    recording.write(19)
    before = recording.keep('before')
    recording.write(10)
    recording.writer.flush()
    killed = recording.keep('killed')
    shutil.copy(before / 'run_0.mcap', killed)
    assert sorted(file.name for file in killed.glob('*.mcap')) == [
        'run_0.mcap', 'run_1.mcap', 'run_2.mcap'
    ]  # fmt: skip
    assert len(list(read_bag(killed, allow_truncated=True).messages())) == 19
    recovery = recover_bag(killed)
    assert recovery is not None
    times = [message.log_time for message in read_bag(recovery.folder).messages()]
    assert times == [index * SECOND // 10 for index in range(1, 30)]


def test_custom_data_are_read_from_the_file_without_metadata(tmp_path, topics):
    recording = Recording(tmp_path, topics, keep_files=2)
    recording.write(45)
    recording.writer.close({'seed': '7'})
    said = read_bag(recording.writer.folder).custom
    assert 'linkage_ros.discarded' in said
    (recording.writer.folder / 'metadata.yaml').unlink()
    assert read_bag(recording.writer.folder).custom == said


@pytest.mark.parametrize('cut', [5, 400])
def test_progress_hook_follows_the_search_for_channels(tmp_path, topics, cut):
    # Of a file with an index nothing is searched.
    recording = Recording(tmp_path, topics)
    recording.write(9)
    recording.writer.close()
    heard: list[int] = []
    read_bag(recording.writer.folder, progress=heard.append)
    assert heard == []
    file = recording.writer.folder / 'run_0.mcap'
    file.write_bytes(file.read_bytes()[:-cut])
    read_bag(recording.writer.folder, allow_truncated=True, progress=heard.append)
    assert heard == sorted(heard)
    assert len(heard) > 1

    class EnoughError(Exception):
        pass

    def enough(_read: int) -> None:
        raise EnoughError

    with pytest.raises(EnoughError):
        read_bag(recording.writer.folder, allow_truncated=True, progress=enough)
