# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A bag in several files, packed or not, and a ring of the last: each reader finds it all."""

from itertools import pairwise
import json
from pathlib import Path
import pickle
import subprocess
import sys

from linkage_ros.bag import (
    bag_file,
    BagWriter,
    read_bag,
    Recorder,
    STATS_RECORD,
    Storage,
    UNFINISHED,
)
from linkage_ros.errors import RecordingError
from mcap.exceptions import UnsupportedCompressionError
from mcap.reader import make_reader
import pytest
import yaml

from .conftest import START, Written

ROOT = Path(__file__).parents[2]
ATTACHMENTS = {'scene.yaml': ('text/yaml', b'linkage: four_bar\n')}
SECOND = 10**9

SPLITS = {
    'one file': Storage(),
    'by size': Storage(split_bytes=300_000),
    'by time': Storage(split_seconds=1.0),
    'by either': Storage(split_bytes=700_000, split_seconds=1.7),
    'lz4': Storage(compression='lz4'),
    'zstd, by size': Storage(split_bytes=40_000, compression='zstd'),
}


def record(folder, topics, messages, storage, flush_every=1000):
    writer = BagWriter(folder, topics, ATTACHMENTS, storage)
    for index, message in enumerate(messages):
        assert writer.write(*message)
        if index % flush_every == 500:
            writer.flush()
    return writer.close({'seed': '7'})


def information(folder):
    text = (folder / 'metadata.yaml').read_text()
    return yaml.safe_load(text)['rosbag2_bagfile_information']


def triples(topics, messages):
    return [(topics[m.topic].name, m.log_time, m.data) for m in messages]


@pytest.mark.sample(2)
@pytest.mark.parametrize('storage', SPLITS.values(), ids=SPLITS)
def test_every_reader_finds_all_messages_of_split_bags(
    tmp_path, topics, messages, readers, storage
):
    summary = record(tmp_path / 'run', topics, messages, storage)
    names = [part.file for part in summary.parts or (summary,)]
    assert len(names) > 2 or storage in (SPLITS['one file'], SPLITS['lz4'])
    assert names == [f'run_{index}.mcap' for index in range(len(names))]
    assert sorted(p.name for p in (tmp_path / 'run').iterdir()) == sorted(
        [*names, 'metadata.yaml']
    )
    assert sorted(readers.rosbags(tmp_path / 'run')) == sorted(triples(topics, messages))
    bag = read_bag(tmp_path / 'run')
    assert [m.data for m in bag.messages()] == [m.data for m in messages]
    assert (bag.topics, bag.truncated) == (topics, False)
    found = []
    for name in names:
        by_mcap = readers.mcap(tmp_path / 'run' / name)
        by_rosbags = readers.rosbags(tmp_path / 'run' / name)
        assert sorted(by_rosbags) == sorted((t, log, data) for t, log, _, data in by_mcap)
        alone = read_bag(tmp_path / 'run' / name)
        assert [m.data for m in alone.messages()] == [data for *_, data in by_mcap]
        assert (alone.topics, alone.attachments) == (
            topics,
            {'scene.yaml': ATTACHMENTS['scene.yaml'][1]},
        )
        found += by_mcap
    assert found == [(topics[m.topic].name, m.log_time, m.publish_time, m.data) for m in messages]


@pytest.mark.parametrize('storage', SPLITS.values(), ids=SPLITS)
def test_metadata_list_the_content_of_each_file(tmp_path, topics, messages, readers, storage):
    record(tmp_path / 'run', topics, messages, storage)
    said = information(tmp_path / 'run')
    assert said['relative_file_paths'] == [each['path'] for each in said['files']]
    for each in said['files']:
        times = [log for _, log, _, _ in readers.mcap(tmp_path / 'run' / each['path'])]
        assert each == {
            'path': each['path'],
            'duration': {'nanoseconds': max(times) - min(times)},
            'starting_time': {'nanoseconds_since_epoch': min(times)},
            'message_count': len(times),
        }
    times = [message.log_time for message in messages]
    assert said['starting_time'] == {'nanoseconds_since_epoch': min(times)}
    assert said['duration'] == {'nanoseconds': max(times) - min(times)}
    assert said['message_count'] == len(messages)
    assert said['custom_data'] == {'seed': '7'}
    with (tmp_path / 'run' / said['relative_file_paths'][-1]).open('rb') as stream:
        (last,) = [m for m in make_reader(stream).iter_metadata() if m.name == 'rosbag2']
    assert yaml.safe_load(last.metadata['serialized_metadata']) == said


def test_split_files_keep_the_size_limit_plus_a_chunk(tmp_path, topics, messages):
    summary = record(tmp_path / 'run', topics, messages, Storage(split_bytes=300_000))
    *full, last = summary.parts
    assert all(300_000 <= part.size < 300_000 + 70_000 + 40_000 for part in full)
    assert last.size < 300_000 + 70_000 + 40_000
    for part in summary.parts:
        assert part.size == (part.folder / part.file).stat().st_size
    assert summary.size == sum(part.size for part in summary.parts)


def test_size_limit_of_1_byte_splits_at_every_chunk(tmp_path, topics, messages):
    summary = record(tmp_path / 'run', topics, messages[:2000], Storage(split_bytes=1))
    assert len(summary.parts) > 3
    for part in summary.parts:
        with (part.folder / part.file).open('rb') as stream:
            assert make_reader(stream).get_summary().statistics.chunk_count == 1


@pytest.mark.parametrize(
    ('times', 'files'),
    [
        ([0, 0.9], [[0, 0.9]]),
        ([0, 0.9, 1.0, 1.1], [[0, 0.9], [1.0, 1.1]]),
        ([0, 5, 5.5, 9], [[0], [5, 5.5], [9]]),
        ([5, 5.5, 4.7, 5.9, 6.0], [[5, 5.5, 4.7, 5.9], [6.0]]),
        # Time jumps back.
        ([100, 100.5, 3, 3.5, 4], [[100, 100.5], [3, 3.5], [4]]),
    ],
)
def test_split_by_seconds_follows_the_log_times(tmp_path, topics, readers, times, files):
    messages = [
        Written(0, START + round(t * SECOND), START, b'\0\1\0\0' + b'%f' % t) for t in times
    ]
    summary = record(tmp_path / 'run', topics, messages, Storage(split_seconds=1.0))
    found = [
        [(log - START) / SECOND for _, log, _, _ in readers.mcap(part.folder / part.file)]
        for part in summary.parts or (summary,)
    ]
    assert found == files


def test_message_numbers_of_a_topic_continue_across_files(tmp_path, topics, messages):
    summary = record(tmp_path / 'run', topics, messages, Storage(split_seconds=1.0))
    numbered = {topic.name: [] for topic in topics}
    for part in summary.parts:
        with (part.folder / part.file).open('rb') as stream:
            for _, channel, message in make_reader(stream).iter_messages(log_time_order=False):
                numbered[channel.topic].append(message.sequence)
    assert numbered == {topic.name: list(range(6000)) for topic in topics}


@pytest.mark.parametrize('keep', [1, 2, 3, 100])
def test_ring_keeps_the_last_files_and_counts_discarded_messages(
    tmp_path, topics, messages, readers, keep
):
    storage = Storage(split_seconds=1.0, keep_files=keep)
    recorder = Recorder(BagWriter(tmp_path / 'run', topics, ATTACHMENTS, storage), capacity=10**6)
    for message in messages:
        recorder.offer(*message)
    summary = recorder.stop()
    there = [message.data for message in read_bag(tmp_path / 'run').messages()]
    kept = min(keep, 6)
    names = [f'run_{index}.mcap' for index in range(6 - kept, 6)]
    assert information(tmp_path / 'run')['relative_file_paths'] == names
    assert sorted(p.name for p in (tmp_path / 'run').iterdir()) == ['metadata.yaml', *names]
    last = len(messages) - len(there)
    assert there == [message.data for message in messages[last:]]
    assert sorted(data for *_, data in readers.rosbags(tmp_path / 'run')) == sorted(there)
    for counts in summary.topics:
        assert counts.received == counts.recorded + counts.discarded == 6000
        assert (counts.dropped, counts.waiting) == (0, 0)
    assert sum(counts.recorded for counts in summary.topics) == len(there)
    custom = information(tmp_path / 'run')['custom_data']
    if keep < 6:
        assert json.loads(custom['linkage_ros.discarded']) == {
            t.name: t.discarded for t in summary.topics
        }
        assert summary.topics[0].discarded > 0
    else:
        assert 'linkage_ros.discarded' not in custom


def account_of(file):
    with file.open('rb') as stream:
        found = {m.name: m.metadata for m in make_reader(stream).iter_metadata()}
    return {word: json.loads(text) for word, text in found.get(STATS_RECORD, {}).items()}


def test_last_file_holds_counts_that_add_up(tmp_path, topics, messages):
    storage = Storage(split_seconds=1.0, keep_files=2)
    recorder = Recorder(BagWriter(tmp_path / 'run', topics, ATTACHMENTS, storage), capacity=10**6)
    for index, message in enumerate(messages):
        recorder.offer(*(message._replace(log_time=-1) if index % 100 == 0 else message))
    summary = recorder.stop()
    first, last = read_bag(tmp_path / 'run').files
    account = account_of(last)
    assert account_of(first) == {}
    for topic in summary.topics:
        assert [account[word][topic.name] for word in account] == [
            topic.received,
            topic.recorded,
            topic.dropped,
            topic.discarded,
        ]
        assert topic.received == topic.recorded + topic.dropped + topic.discarded
    assert list(account['dropped'].values()) == [120, 0]


@pytest.mark.parametrize('compression', ['lz4', 'zstd'])
def test_missing_compression_library_is_reported_before_recording(
    tmp_path, topics, monkeypatch, compression
):
    def missing(*_, **__):
        raise UnsupportedCompressionError(compression)

    monkeypatch.setattr(bag_file, 'Writer', missing)
    library = {'lz4': 'lz4', 'zstd': 'zstandard'}[compression]
    with pytest.raises(RecordingError, match=f'the Python package {library} is missing; install'):
        BagWriter(tmp_path / 'run', topics, storage=Storage(compression=compression))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('compression', ['lz4', 'zstd'])
def test_packed_chunks_are_smaller_and_have_checksums(tmp_path, topics, messages, compression):
    plain = record(tmp_path / 'plain', topics, messages, Storage())
    packed = record(tmp_path / 'packed', topics, messages, Storage(compression=compression))
    assert packed.size < 0.7 * plain.size
    content = (packed.folder / packed.file).read_bytes()
    with (packed.folder / packed.file).open('rb') as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    assert {chunk.compression for chunk in chunks} == {compression}
    for chunk in chunks:
        # The checksum stands behind opcode, length, two times and a size.
        begin = chunk.chunk_start_offset + 9 + 24
        end = begin + 4
        assert any(content[begin:end])


# A process that is killed at its n-th system call that changes something on the disk.
KILLED = """
import os, pathlib, pickle, signal, sys
from linkage_ros.bag import BagWriter, Storage
folder, pickled = sys.argv[1:]
topics, messages, storage = pickle.load(open(pickled, 'rb'))

def run(folder, deadline):
    left = [deadline]
    def mortal(call):
        def wrapped(*arguments, **named):
            left[0] -= 1
            if left[0] == 0:
                os.kill(os.getpid(), signal.SIGKILL)
            return call(*arguments, **named)
        return wrapped
    # A kill, other than a power cut, does not ask what has reached the disk.
    os.fsync = mortal(lambda descriptor: None)
    os.pwrite, os.open = mortal(os.pwrite), mortal(os.open)
    os.posix_fallocate = mortal(os.posix_fallocate)
    pathlib.Path.replace = mortal(pathlib.Path.replace)
    pathlib.Path.unlink = mortal(pathlib.Path.unlink)
    writer = BagWriter(folder, topics, {}, storage)
    for number, message in enumerate(messages):
        writer.write(*message)
        if number % 150 == 149:
            writer.flush()
            with open(folder + '.flushed', 'w') as said:
                said.write(str(number + 1))
    writer.close()

for deadline in range(1, 10**6):
    child = os.fork()
    if not child:
        run(f'{folder}/{deadline}', deadline)
        os._exit(0)
    if os.waitpid(child, 0)[1] == 0:
        break
"""


@pytest.mark.sample(0)
def test_kill_at_any_step_keeps_flushed_messages(tmp_path, topics, messages):
    storage = Storage(split_seconds=0.08, keep_files=3)
    messages = [tuple(message) for message in messages[:1000]]
    (tmp_path / 'pickled').write_bytes(pickle.dumps((topics, messages, storage)))
    (tmp_path / 'bags').mkdir()
    script = [sys.executable, '-c', KILLED, tmp_path / 'bags', tmp_path / 'pickled']
    subprocess.run(script, cwd=ROOT, check=True)
    folders = sorted((p for p in (tmp_path / 'bags').iterdir() if p.is_dir()), key=_number)
    assert len(folders) > 100
    place = {data: index for index, (*_, data) in enumerate(messages)}
    killed_while_finished = 0
    for folder in folders[:-1]:
        flushed = folder.with_name(f'{folder.name}.flushed')
        if not flushed.exists():
            continue  # killed while the bag was begun
        bag = read_bag(folder, allow_truncated=True)
        found = [place[message.data] for message in bag.messages()]
        assert all(after == before + 1 for before, after in pairwise(found)), folder
        assert found[-1] + 1 >= int(flushed.read_text())
        said = information(folder)
        assert said['relative_file_paths'] == [file.name for file in bag.files]
        discarded = json.loads((said['custom_data'] or {}).get('linkage_ros.discarded', '{}'))
        if UNFINISHED in (said['custom_data'] or {}):
            assert sum(discarded.values()) == found[0]
            # It promises no more than there is.
            assert said['message_count'] <= len(found)
        else:
            killed_while_finished += 1
    assert killed_while_finished <= 2
    whole = read_bag(folders[-1])
    assert [place[m.data] for m in whole.messages()][-1] == len(messages) - 1


def _number(folder):
    return int(folder.name)
