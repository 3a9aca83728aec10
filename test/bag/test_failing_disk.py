# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A disk whose calls fail, one by one: what ends a recording, what does not, and what is counted.

All calls in all ways are the matter of ``campaigns.reliability.disk``.
"""

import errno
import os
from pathlib import Path

from linkage_ros.bag import BagWriter, METADATA_FILE, read_bag, Recorder, ROOT_KEY, Storage
from linkage_ros.errors import RecordingError
import pytest
import yaml


def failing(call, numbers, error=errno.EIO):
    """Return a call that fails at these of its turns, from 0 on; None for all."""
    turns = iter(range(10**9))

    def call_or_fail(*arguments, **named):
        turn = next(turns)
        if numbers is None or turn in numbers:
            raise OSError(error, os.strerror(error))
        return call(*arguments, **named)

    return call_or_fail


def write(writer, messages):
    for message in messages:
        writer.write(*message)


def write_and_flush(writer, messages, every):
    for index, message in enumerate(messages):
        writer.write(*message)
        if every and index % every == 0:
            writer.flush()


def custom_data(folder):
    return yaml.safe_load((folder / METADATA_FILE).read_text())[ROOT_KEY]['custom_data']


def data_of(folder, **how):
    return [message.data for message in read_bag(folder, **how).messages()]


def data(messages):
    return [message.data for message in messages]


@pytest.fixture
def ages(monkeypatch):
    """Let the metadata be due for renewal at every flush."""
    monkeypatch.setattr('linkage_ros.bag.writer._RENEWAL', -1e9)


@pytest.mark.parametrize(
    ('call', 'error'),
    [
        ('pathlib.Path.replace', errno.EIO),
        ('pathlib.Path.replace', errno.ENOSPC),
        ('linkage_ros.bag.metadata.sync_folder', errno.EIO),
    ],
)
def test_failed_metadata_renewal_does_not_end_a_recording(
    tmp_path, topics, messages, readers, monkeypatch, ages, call, error
):
    writer = BagWriter(tmp_path / 'run', topics)
    with monkeypatch.context() as patch:
        module, _, name = call.rpartition('.')
        owner = Path if name == 'replace' else __import__(module, fromlist=[name])
        patch.setattr(call, failing(getattr(owner, name), None, error))
        write(writer, messages[:100])
        writer.flush()
        write(writer, messages[100:200])
    writer.close()
    assert custom_data(tmp_path / 'run') is None
    readers.agree(tmp_path / 'run', topics, messages[:200])


def test_final_metadata_are_written_at_a_second_attempt(
    tmp_path, topics, messages, readers, monkeypatch
):
    writer = BagWriter(tmp_path / 'run', topics)
    write(writer, messages[:100])
    monkeypatch.setattr('pathlib.Path.replace', failing(Path.replace, [0]))
    writer.close()
    assert custom_data(tmp_path / 'run') is None
    readers.agree(tmp_path / 'run', topics, messages[:100])


def test_failing_rename_raises_and_keeps_the_first_metadata(
    tmp_path, topics, messages, readers, monkeypatch
):
    writer = BagWriter(tmp_path / 'run', topics)
    write(writer, messages[:100])
    monkeypatch.setattr('pathlib.Path.replace', failing(Path.replace, None, errno.EDQUOT))
    with pytest.raises(RecordingError, match=r'Disk quota exceeded; .* make room there'):
        writer.close()
    assert sorted(p.name for p in (tmp_path / 'run').iterdir()) == ['metadata.yaml', 'run_0.mcap']
    assert 'linkage_ros.unfinished' in custom_data(tmp_path / 'run')
    readers.agree(tmp_path / 'run', topics, messages[:100])


def test_ring_with_failing_metadata_removes_no_file(tmp_path, topics, messages, monkeypatch):
    storage = Storage(split_seconds=0.1, keep_files=2)
    writer = BagWriter(tmp_path / 'run', topics, storage=storage)
    with monkeypatch.context() as patch:
        patch.setattr('pathlib.Path.replace', failing(Path.replace, None))
        write(writer, messages[:1000])
        # What the metadata name is there, for who reads it now.
        assert (tmp_path / 'run' / 'run_0.mcap').exists()
        assert writer.discarded == (0, 0)
    write(writer, messages[1000:2000])
    summary = writer.close()
    kept = sum(summary.counts)
    assert len(list((tmp_path / 'run').glob('*.mcap'))) == 2
    assert kept + sum(summary.discarded) == 2000
    assert data_of(tmp_path / 'run') == data(messages[:2000][-kept:])


def test_ring_retries_the_removal_of_a_file(tmp_path, topics, messages, monkeypatch):
    storage = Storage(split_seconds=0.1, keep_files=2)
    writer = BagWriter(tmp_path / 'run', topics, storage=storage)
    with monkeypatch.context() as patch:
        patch.setattr('pathlib.Path.unlink', failing(Path.unlink, None, errno.EROFS))
        write(writer, messages[:1000])
        assert (tmp_path / 'run' / 'run_0.mcap').exists()
    summary = writer.close()
    assert len(list((tmp_path / 'run').glob('*.mcap'))) == 2
    assert sum(summary.counts) + sum(summary.discarded) == 1000


def losing(file, numbers):
    """Return an fsync that fails at these turns and lets go of all since its last success."""
    turns, safe, fsync = iter(range(10**9)), 0, os.fsync

    def fsync_or_lose(descriptor):
        nonlocal safe
        if not file.exists() or not os.path.samestat(os.fstat(descriptor), file.stat()):
            fsync(descriptor)
            return
        end = file.stat().st_size
        if next(turns) in numbers:
            os.pwrite(descriptor, bytes(end - safe), safe)
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        fsync(descriptor)
        safe = end

    return fsync_or_lose


@pytest.mark.parametrize('when', ['flush', 'close'])
def test_messages_lost_by_a_failed_fsync_are_written_again(
    tmp_path, topics, messages, readers, monkeypatch, when
):
    monkeypatch.setattr('os.fsync', losing(tmp_path / 'run' / 'run_0.mcap', [2]))
    writer = BagWriter(tmp_path / 'run', topics)  # 0
    write(writer, messages[:1000])
    writer.flush()  # 1
    write(writer, messages[1000:3000])
    with pytest.raises(RecordingError) as caught:
        getattr(writer, when)()
    assert str(caught.value) == (
        f'{tmp_path}/run: the recording ended early: Input/output error; what was flushed before '
        'stays readable; check the disk before the next recording'
    )
    assert sum(writer.close().counts) == 3000
    assert custom_data(tmp_path / 'run')['linkage_ros.failure'] == str(caught.value)
    readers.agree(tmp_path / 'run', topics, messages[:3000])


@pytest.mark.parametrize('when', ['flush', 'close'])
def test_messages_never_synced_are_not_counted(tmp_path, topics, messages, monkeypatch, when):
    monkeypatch.setattr('os.fsync', losing(tmp_path / 'run' / 'run_0.mcap', range(2, 100)))
    writer = BagWriter(tmp_path / 'run', topics)
    write(writer, messages[:1000])
    writer.flush()
    write(writer, messages[1000:3000])
    with pytest.raises(RecordingError, match='what was flushed before stays readable'):
        getattr(writer, when)()
    with pytest.raises(RecordingError, match='Input/output error'):
        writer.write(*messages[3000])
    assert sum(writer.close().counts) == 1000


@pytest.mark.parametrize('failed', ['os.pwrite', 'os.fsync', 'os.posix_fallocate'])
def test_counts_add_up_under_any_failing_disk_call(
    tmp_path, topics, messages, monkeypatch, failed
):
    recorder = Recorder(BagWriter(tmp_path / 'run', topics), flush_period=0.0)
    name = failed.partition('.')[2]
    monkeypatch.setattr(failed, failing(getattr(os, name), None))
    for message in messages[:5000]:
        recorder.offer(*message)
    summary = recorder.stop()
    for counts in summary.topics:
        assert counts.received == 2500
        assert counts.received == counts.recorded + counts.dropped + counts.discarded
    # A reserve that cannot grow is no reason as long as it is large enough.
    assert (summary.failure is None) == (failed == 'os.posix_fallocate')


@pytest.mark.parametrize('sizes', [[1] * 10**4, [7, 1000, 3] * 10**3], ids=['bytes', 'parts'])
def test_short_writes_are_completed(tmp_path, topics, messages, readers, monkeypatch, sizes):
    pwrite, sizes = os.pwrite, iter(sizes)

    def short(descriptor, view, offset):
        return pwrite(descriptor, view[: next(sizes, len(view))], offset)

    monkeypatch.setattr('os.pwrite', short)
    writer = BagWriter(tmp_path / 'run', topics)
    write(writer, messages[:100])
    writer.close()
    readers.agree(tmp_path / 'run', topics, messages[:100])


@pytest.mark.parametrize('healthy', [0, 5, 19, 20, None])
def test_disk_that_stops_writing_leaves_a_readable_bag(
    tmp_path, topics, messages, monkeypatch, healthy
):
    writer = BagWriter(tmp_path / 'run', topics)
    write(writer, messages[:100])
    writer.flush()
    if healthy is None:
        reason, pwrite = 'the disk accepts no data', lambda descriptor, view, offset: 0
    else:
        reason, pwrite = 'Input/output error', failing(os.pwrite, range(healthy, 10**9))
    monkeypatch.setattr('os.pwrite', pwrite)
    with pytest.raises(RecordingError, match=rf'ended early: {reason}; .* check'):
        write(writer, messages[100:])
    kept = sum(writer.close().counts)
    assert kept > 100 if healthy else kept == 100
    assert data_of(tmp_path / 'run', allow_truncated=True) == data(messages[:kept])


class _Deaf:
    """A file that takes nothing."""

    def __init__(self, file):
        self._file = file

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self._file.close()

    def write(self, part):
        return 0


def test_disk_that_accepts_no_metadata_raises_at_close(tmp_path, topics, messages, monkeypatch):
    writer = BagWriter(tmp_path / 'run', topics)
    write(writer, messages[:100])
    whole = Path.open
    monkeypatch.setattr('pathlib.Path.open', lambda *args, **named: _Deaf(whole(*args, **named)))
    with pytest.raises(RecordingError, match='the disk accepts no data'):
        writer.close()
    monkeypatch.undo()
    assert 'linkage_ros.unfinished' in custom_data(tmp_path / 'run')


def test_failing_close_is_recorded_in_the_metadata(
    tmp_path, topics, messages, readers, monkeypatch
):
    writer = BagWriter(tmp_path / 'run', topics)
    write(writer, messages[:100])
    monkeypatch.setattr('os.close', failing(os.close, [0]))
    with pytest.raises(RecordingError) as caught:
        writer.close()
    assert custom_data(tmp_path / 'run')['linkage_ros.failure'] == str(caught.value)
    assert sum(writer.close().counts) == 100
    readers.agree(tmp_path / 'run', topics, messages[:100])


def test_failing_close_of_the_reserve_loses_no_message(
    tmp_path, topics, messages, readers, monkeypatch
):
    writer = BagWriter(tmp_path / 'run', topics)
    write(writer, messages[:100])
    reserve = writer._file._reserve

    class Failing:
        def close(self):
            raise OSError(errno.EIO, 'Input/output error')

    monkeypatch.setattr(reserve, '_file', Failing())
    writer.close()
    readers.agree(tmp_path / 'run', topics, messages[:100])


@pytest.mark.parametrize('flush_every', [0, 10])
def test_min_free_bytes_holds_between_two_flushes(
    tmp_path, topics, messages, monkeypatch, flush_every
):
    floor, room = 1_000_000, 2_000_000

    class Disk:
        f_frsize = 1

        @property
        def f_bavail(self):
            # The file alone: what is set aside was given back by then.
            return room + floor - (tmp_path / 'run' / 'run_0.mcap').stat().st_size

    monkeypatch.setattr('os.statvfs', lambda folder: Disk())
    writer = BagWriter(tmp_path / 'run', topics, storage=Storage(min_free_bytes=floor))
    with pytest.raises(RecordingError, match='fewer than min_free_bytes: 1,000,000') as caught:
        write_and_flush(writer, messages, flush_every)
    assert 'the recording was interrupted: ' in str(caught.value)
    size = (tmp_path / 'run' / 'run_0.mcap').stat().st_size
    assert room / 2 < size <= room
    kept = sum(writer.close().counts)
    assert data_of(tmp_path / 'run') == data(messages[:kept])
