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


"""
A bag that another process cuts, moves or removes while it is recorded: said, and counted as lost.

Everything is done to real files, by the calls that ``truncate``, ``mv`` and ``rm`` make.
"""

from __future__ import annotations

import os
import shutil
import time

from linkage_ros.bag.reader import read_bag
from linkage_ros.bag.recorder import Recorder
from linkage_ros.bag.recover import recover
from linkage_ros.bag.storage import Storage
from linkage_ros.bag.writer import BagWriter
from linkage_ros.errors import BagError
import pytest

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
    shutil.rmtree(folder)
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
    received = sum(counts.received for counts in recorder.inspect())
    wait_for(lambda: recorder.failure or sum(recorder._safe) == received, 'a flush')


def readable(folder, beside):
    """Return the messages of what is left, if need be by way of `linkage recover`."""
    try:
        return list(read_bag(folder).messages())
    except BagError:
        pass
    try:
        recover(folder, beside)
    except BagError:
        return []
    return list(read_bag(beside).messages())


@pytest.mark.parametrize('storage', STORAGES)
@pytest.mark.parametrize('then', ['silence', 'more messages', 'the end'])
@pytest.mark.parametrize('do', WHAT_IS_DONE)
def test_what_another_process_does_is_said_at_once_and_counted(
    tmp_path, topics, messages, do, then, storage
):
    folder = tmp_path / 'run'
    writer = BagWriter(folder, topics, storage=STORAGES[storage])
    recorder = Recorder(writer, flush_period=3600.0 if then == 'the end' else 0.02)
    if then == 'the end':
        for message in messages[:8000]:
            recorder.offer(*message)
        wait_for(lambda: not any(counts.waiting for counts in recorder.inspect()), 'all written')
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
def test_a_file_that_was_ended_long_ago_is_looked_for_at_the_end(tmp_path, topics, messages, how):
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


def test_what_was_cut_does_not_come_back_as_zeros(tmp_path, topics, messages):
    recorder = Recorder(BagWriter(tmp_path / 'run', topics), flush_period=3600.0)
    file = tmp_path / 'run' / 'run_0.mcap'
    for message in messages[:4000]:
        recorder.offer(*message)
    wait_for(lambda: not any(counts.waiting for counts in recorder.inspect()), 'all written')
    size = file.stat().st_size
    os.truncate(file, 0)
    for message in messages[4000:]:
        recorder.offer(*message)
    wait_for(lambda: recorder.failure, 'the loss noticed')
    recorder.stop()
    assert size > 500_000
    assert file.read_bytes() == b''
