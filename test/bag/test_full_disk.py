# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A recording on a disk that fills or fails: what was written stays a bag.

Real faults where the machine allows: a tmpfs of 2 MiB, a limit on the size of a file, SIGKILL.
"""

from contextlib import suppress
import json
import os
from pathlib import Path
import pickle
import shutil
import signal
import subprocess
import sys
import time

from linkage_ros.bag import BagWriter, read_bag, Recorder, recover_bag, Reserve, Storage
from linkage_ros.errors import BagError, RecordingError
import pytest
import yaml

ATTACHMENTS = {'scene.yaml': ('text/yaml', b'linkage: four_bar\n')}
ROOT = Path(__file__).parents[2]


def _write_until_it_fails(writer, messages, *, flush_every=10**9):
    """Return how many messages were taken before the first error, and the error."""
    taken = 0
    try:
        for taken, message in enumerate(messages):
            writer.write(*message)
            if taken % flush_every == flush_every - 1:
                writer.flush()
    except RecordingError as error:
        return taken, error
    return len(messages), None


@pytest.mark.parametrize('flush_every', [10**9, 100])
def test_full_disk_loses_no_accepted_message(small_disk, topics, messages, readers, flush_every):
    writer = BagWriter(small_disk / 'run', topics, ATTACHMENTS)
    taken, error = _write_until_it_fails(writer, messages, flush_every=flush_every)
    assert 2000 < taken < len(messages), 'the disk was to fill in the middle'
    assert str(error) == (
        f'{small_disk}/run: the recording was interrupted: No space left on device; what is on '
        'the disk stays readable; make room there: a run then goes on in a new file'
    )
    summary = writer.close()
    # The message at which the disk was found full went into the room set aside.
    assert taken <= sum(summary.counts) <= taken + 1
    readers.agree(small_disk / 'run', topics, messages[: sum(summary.counts)])
    text = yaml.safe_load((small_disk / 'run' / 'metadata.yaml').read_text())
    information = text['rosbag2_bagfile_information']
    assert information['message_count'] == sum(summary.counts)
    assert 'No space left' in information['custom_data']['linkage_ros.failure']
    assert read_bag(small_disk / 'run').attachments == {'scene.yaml': b'linkage: four_bar\n'}


def test_lost_reserve_on_a_full_disk_leaves_whole_chunks(
    small_disk, topics, messages, readers, monkeypatch
):
    monkeypatch.setattr(Reserve, 'release', lambda reserve: None)
    writer = BagWriter(small_disk / 'run', topics)
    taken, _ = _write_until_it_fails(writer, messages, flush_every=100)
    summary = writer.close()
    kept = sum(summary.counts)
    # At most the chunk in progress and those that made way for the index.
    assert taken - 600 < kept < taken
    assert summary.start == min(message.log_time for message in messages[:kept])
    readers.agree(small_disk / 'run', topics, messages[:kept])


def test_full_disk_at_the_end_still_gets_an_index(small_disk, topics, messages, readers):
    writer = BagWriter(small_disk / 'run', topics)
    for message in messages[:1000]:
        writer.write(*message)
    writer.flush()
    with (small_disk / 'other').open('wb', buffering=0) as other, suppress(OSError):
        while True:
            other.write(bytes(4096))
    with pytest.raises(RecordingError, match='No space left'):
        writer.close()
    assert writer.close().counts == (500, 500)
    readers.agree(small_disk / 'run', topics, messages[:1000])


LIMITED = """
import json, pickle, resource, signal, sys
from linkage_ros.bag.writer import BagWriter
from linkage_ros.errors import RecordingError
folder, limit, flush_every, pickled = sys.argv[1:]
topics, messages = pickle.load(open(pickled, 'rb'))
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
writer = BagWriter(folder, topics)
resource.setrlimit(resource.RLIMIT_FSIZE, (int(limit), int(limit)))
taken = 0
try:
    for message in messages:
        writer.write(*message)
        taken += 1
        if taken % int(flush_every) == 0:
            writer.flush()
    writer.close()
except RecordingError as error:
    print(json.dumps([taken, writer.close().counts, str(error)]))
"""


@pytest.mark.sample(1)
@pytest.mark.parametrize('limit', [1_000_000, 1_000_001, 1_003_000, 1_060_000])
@pytest.mark.parametrize('flush_every', [7, 100, 10**9])
def test_file_size_limit_leaves_a_bag_of_whole_chunks(
    tmp_path, topics, messages, readers, limit, flush_every
):
    plain = [tuple(message) for message in messages]
    pickled = tmp_path / 'messages'
    pickled.write_bytes(_pickle(topics, plain))
    folder = tmp_path / 'run'
    script = [sys.executable, '-c', LIMITED, folder, str(limit), str(flush_every), pickled]
    done = subprocess.run(script, cwd=ROOT, capture_output=True, text=True, check=True)
    taken, counts, error = json.loads(done.stdout)
    assert 'the recording was interrupted: File too large' in error
    assert 3000 < taken < len(messages)
    # Lost are the chunk in progress, and at the file's end as much as the index takes.
    assert taken - 1200 < sum(counts) <= taken
    readers.agree(folder, topics, messages[: sum(counts)])
    assert (folder / 'run_0.mcap').stat().st_size <= limit


def _pickle(topics, messages):
    return pickle.dumps((topics, messages))


def test_full_disk_keeps_every_file_of_a_split_bag(small_disk, topics, messages, readers):
    storage = Storage(split_bytes=300_000)
    writer = BagWriter(small_disk / 'run', topics, ATTACHMENTS, storage)
    taken, error = _write_until_it_fails(writer, messages, flush_every=100)
    assert 'interrupted: No space left on device' in str(error)
    summary = writer.close()
    assert len(summary.parts) >= 3
    assert taken <= sum(summary.counts) <= taken + 1
    there = [message.data for message in messages[: sum(summary.counts)]]
    assert [m.data for m in read_bag(small_disk / 'run').messages()] == there
    assert sorted(data for *_, data in readers.rosbags(small_disk / 'run')) == sorted(there)
    for part in summary.parts:
        assert read_bag(small_disk / 'run' / part.file).attachments == {
            'scene.yaml': b'linkage: four_bar\n'
        }


def test_ring_records_more_than_the_disk_holds(small_disk, topics, messages, readers):
    storage = Storage(split_bytes=200_000, keep_files=3)
    writer = BagWriter(small_disk / 'run', topics, ATTACHMENTS, storage)
    for _ in range(2):  # 4 MB on a disk of 2 MiB
        assert _write_until_it_fails(writer, messages, flush_every=100)[1] is None
    summary = writer.close()
    kept, gone = sum(summary.counts), sum(summary.discarded)
    assert kept + gone == 2 * len(messages)
    assert kept > 1000
    there = [message.data for message in messages[-kept:]]
    assert [m.data for m in read_bag(small_disk / 'run').messages()] == there
    assert sorted(data for *_, data in readers.rosbags(small_disk / 'run')) == sorted(there)


def test_recording_ends_when_free_space_falls_below_minimum(small_disk, topics, messages, readers):
    storage = Storage(min_free_bytes=600_000)
    recorder = Recorder(
        BagWriter(small_disk / 'run', topics, ATTACHMENTS, storage), flush_period=0.01
    )
    for message in messages:
        recorder.offer(*message)
        if recorder.failure:
            break
        time.sleep(0.0002)
    summary = recorder.stop()
    free = os.statvfs(small_disk)
    assert free.f_bavail * free.f_frsize >= 600_000
    assert summary.failure.startswith(f'{small_disk}/run: the recording was interrupted: ')
    assert summary.failure.endswith(
        'bytes are free on its disk, fewer than min_free_bytes: 600,000 and 262,144 to go on; '
        'make room there: a run then goes on in a new file'
    )
    kept = sum(counts.recorded for counts in summary.topics)
    assert kept > 500
    assert all(c.received == c.recorded + c.dropped for c in summary.topics)
    readers.agree(small_disk / 'run', topics, messages[:kept])
    text = yaml.safe_load((small_disk / 'run' / 'metadata.yaml').read_text())
    custom = text['rosbag2_bagfile_information']['custom_data']
    assert custom['linkage_ros.failure'] == summary.failure


def test_split_begins_no_file_below_min_free_bytes(small_disk, topics, messages):
    storage = Storage(min_free_bytes=600_000, split_seconds=0.5)
    writer = BagWriter(small_disk / 'run', topics, storage=storage)
    half_a_second = [m for m in messages if m.log_time - messages[0].log_time < 400_000_000]
    for message in half_a_second:
        writer.write(*message)
    writer.flush()
    free = os.statvfs(small_disk)
    (small_disk / 'other').write_bytes(bytes(free.f_bavail * free.f_frsize - 500_000))
    with pytest.raises(RecordingError, match='fewer than min_free_bytes: 600,000'):
        writer.write(*messages[-1])
    assert sum(writer.close().counts) == len(half_a_second)
    assert [file.name for file in small_disk.glob('run/*.mcap')] == ['run_0.mcap']


def test_disk_below_min_free_bytes_gets_no_bag(small_disk, topics):
    with pytest.raises(
        RecordingError, match=r'cannot be recorded to: .* min_free_bytes: 5,000,000'
    ):
        BagWriter(small_disk / 'run', topics, storage=Storage(min_free_bytes=5_000_000))
    assert list(small_disk.iterdir()) == []


KILLED = """
import pickle, sys, time
from linkage_ros.bag.recorder import Recorder
from linkage_ros.bag.writer import BagWriter
kind, folder, pickled = sys.argv[1:]
topics, messages = pickle.load(open(pickled, 'rb'))
writer = BagWriter(folder, topics, {'scene.yaml': ('text/yaml', b'linkage: four_bar')})
if kind == 'writer':
    for message in messages[:500]:
        writer.write(*message)
    writer.flush()
    for message in messages[500:600]:
        writer.write(*message)
    print('flushed', flush=True)
    time.sleep(60)
recorder = Recorder(writer, flush_period=0.05)
said = False
for message in messages:
    recorder.offer(*message)
    time.sleep(0.001)
    if not said and sum(recorder._flushed_counts) >= 200:
        said = True
        print('flushed', flush=True)
time.sleep(60)
"""


@pytest.mark.parametrize(('kind', 'least'), [('writer', 500), ('recorder', 200)])
def test_killed_recording_leaves_flushed_messages_readable(
    tmp_path, topics, messages, kind, least
):
    pickled = tmp_path / 'messages'
    pickled.write_bytes(_pickle(topics, [tuple(message) for message in messages]))
    script = [sys.executable, '-c', KILLED, kind, tmp_path / 'run', pickled]
    with subprocess.Popen(script, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == 'flushed\n'
        process.send_signal(signal.SIGKILL)
    assert sorted(p.name for p in (tmp_path / 'run').iterdir()) == ['metadata.yaml', 'run_0.mcap']
    with pytest.raises(BagError, match='has no end: its recording was killed'):
        read_bag(tmp_path / 'run')
    bag = read_bag(tmp_path / 'run', allow_truncated=True)
    found = [message.data for message in bag.messages()]
    assert len(found) >= least
    assert found == [message.data for message in messages[: len(found)]]
    assert bag.topics == topics
    assert bag.attachments == {'scene.yaml': b'linkage: four_bar'}


# A bag that another process cuts, moves or removes while it is recorded: said, and counted as
# lost. Everything is done to real files, by the calls that ``truncate``, ``mv`` and ``rm`` make.


KEEP_OUT = 'let no other process write to the folder of a bag while it is recorded'


def newest(folder):
    return max(folder.glob('*.mcap'), key=lambda file: (len(file.name), file.name))


def cut(folder):
    os.truncate(newest(folder), newest(folder).stat().st_size // 2)


def empty(folder):
    os.truncate(newest(folder), 0)


def remove(folder):
    newest(folder).unlink()


def remove_folder(folder):
    shutil.rmtree(folder)


def remove_folder_and_make_it_again(folder):
    while folder.exists():  # the recorder may write into it meanwhile
        shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()


def replace(folder):
    (folder / 'other').write_bytes(bytes(10**7))
    (folder / 'other').rename(newest(folder))


def move(folder):
    newest(folder).rename(folder.parent / 'moved.mcap')


def move_folder(folder):
    folder.rename(folder.parent / 'moved')


WHAT_IS_DONE = {
    # what another process does, and what is said of it
    cut: 'run_{}.mcap was cut from',
    empty: 'run_{}.mcap was cut from',
    remove: 'run_{}.mcap was removed by another process',
    remove_folder: 'run_{}.mcap was removed by another process',
    remove_folder_and_make_it_again: 'run_{}.mcap was removed by another process',
    replace: 'run_{}.mcap was removed by another process',
    move: 'run_{}.mcap was moved or replaced by another process',
    move_folder: 'run_{}.mcap was moved or replaced by another process',
}

STORAGES = {'one file': Storage(), 'split': Storage(split_bytes=1_000_000)}


def wait_for(true, what):
    end = time.monotonic() + 20.0
    while not true():
        assert time.monotonic() < end, what
        time.sleep(0.005)


def offered(recorder, messages):
    """Offer messages, and wait until they are flushed."""
    for message in messages:
        recorder.offer(*message)
    received = sum(counts.received for counts in recorder.read_counts())
    wait_for(lambda: recorder.failure or sum(recorder._flushed_counts) == received, 'a flush')


def readable(folder, beside):
    """Return the messages of what is left, if need be by way of `linkage recover`."""
    try:
        return list(read_bag(folder).messages())
    except BagError:
        pass
    try:
        recover_bag(folder, beside)
    except BagError:
        return []
    return list(read_bag(beside).messages())


@pytest.mark.sample(2)
@pytest.mark.parametrize('storage', STORAGES)
@pytest.mark.parametrize('then', ['silence', 'more messages', 'the end'])
@pytest.mark.parametrize('do', WHAT_IS_DONE)
def test_interference_of_another_process_is_reported_and_counted(
    tmp_path, topics, messages, do, then, storage
):
    folder = tmp_path / 'run'
    writer = BagWriter(folder, topics, storage=STORAGES[storage])
    recorder = Recorder(writer, flush_period=3600.0 if then == 'the end' else 0.02)
    if then == 'the end':
        for message in messages[:8000]:
            recorder.offer(*message)
        wait_for(
            lambda: not any(counts.waiting for counts in recorder.read_counts()), 'all written'
        )
    else:
        offered(recorder, messages[:8000])
    number = len(list(folder.glob('*.mcap'))) - 1
    do(folder)
    if then != 'the end':
        for message in messages[8000:9000] if then == 'more messages' else []:
            recorder.offer(*message)
        # Nobody ends the recording: that it is lost is noticed by itself.
        wait_for(lambda: recorder.failure, 'the loss noticed')
    summary = recorder.stop()
    assert WHAT_IS_DONE[do].format(number) in summary.failure
    assert summary.failure.endswith(KEEP_OUT)
    assert all(c.received == c.recorded + c.dropped for c in summary.topics)
    recorded = sum(counts.recorded for counts in summary.topics)
    if do not in (move, move_folder):
        assert recorded < 8000
        left = [message.data for message in readable(folder, tmp_path / 'recovered')]
        assert left[:recorded] == [message.data for message in messages[:recorded]]


@pytest.mark.parametrize('how', ['removed', 'cut'])
def test_removed_split_file_is_noticed_at_the_end(tmp_path, topics, messages, how):
    folder = tmp_path / 'run'
    writer = BagWriter(folder, topics, storage=Storage(split_bytes=200_000))
    recorder = Recorder(writer, flush_period=0.02)
    offered(recorder, messages[:6000])
    assert len(list(folder.glob('*.mcap'))) > 3
    before = len(list(read_bag(folder / 'run_0.mcap').messages()))
    (folder / 'run_1.mcap').unlink() if how == 'removed' else os.truncate(
        folder / 'run_1.mcap', 1000
    )
    # Somebody may have made room with it: what comes now is recorded all the same.
    offered(recorder, messages[6000:])
    assert recorder.failure is None
    summary = recorder.stop()
    assert 'run_1.mcap: cut or removed by another process' in summary.failure
    left = [message.data for message in read_bag(folder).messages()]
    assert sum(counts.recorded for counts in summary.topics) == len(left)
    gone = 12_000 - len(left)
    assert gone > 300
    there = [message.data for message in messages]
    end = before + gone
    del there[before:end]
    assert left == there


def test_emptied_file_is_not_filled_with_zeros(tmp_path, topics, messages):
    recorder = Recorder(BagWriter(tmp_path / 'run', topics), flush_period=3600.0)
    file = tmp_path / 'run' / 'run_0.mcap'
    for message in messages[:4000]:
        recorder.offer(*message)
    wait_for(lambda: not any(counts.waiting for counts in recorder.read_counts()), 'all written')
    size = file.stat().st_size
    os.truncate(file, 0)
    for message in messages[4000:]:
        recorder.offer(*message)
    wait_for(lambda: recorder.failure, 'the loss noticed')
    recorder.stop()
    assert size > 500_000
    assert file.read_bytes() == b''
