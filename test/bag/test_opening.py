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


"""The beginning of each file of a bag: messages published once, such as a robot model."""

from __future__ import annotations

import errno
import os
import threading

from linkage_ros.bag.reader import read_bag
from linkage_ros.bag.recorder import Recorder
from linkage_ros.bag.snapshot import SnapshotMemory, SnapshotWriting
from linkage_ros.bag.storage import Storage
from linkage_ros.bag.writer import BagWriter
import pytest

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
def test_each_file_begins_with_it_and_the_counts_close(
    tmp_path, with_model, messages, storage, files
):
    writer = BagWriter(tmp_path / 'run', with_model, storage=storage, opening=[(2, MODEL)])
    recorder = Recorder(writer)
    looks = []
    for message in messages:
        recorder.offer(*message)
        looks += recorder.inspect()
    summary = recorder.stop()
    assert all(c.received == c.recorded + c.dropped + c.let_go + c.waiting for c in looks)
    assert min(c.waiting for c in looks) >= 0
    counts = summary.topics[2]
    made = 1 if files == 1 else 3
    assert (counts.received, counts.recorded, counts.let_go) == (made, files, made - files)
    assert len(list((tmp_path / 'run').glob('*.mcap'))) == files
    for file in (tmp_path / 'run').glob('*.mcap'):
        first, count = models_in(file)
        second = list(read_bag(file).messages())[1]
        assert (first.topic, first.data, count) == ('/model', MODEL, 1)
        assert first.log_time == first.publish_time == second.log_time


def test_without_a_message_a_file_is_empty(tmp_path, with_model):
    recorder = Recorder(BagWriter(tmp_path / 'run', with_model, opening=[(2, MODEL)]))
    assert [(c.received, c.recorded) for c in recorder.stop().topics] == 3 * [(0, 0)]
    assert list(read_bag(tmp_path / 'run').messages()) == []


def test_a_snapshot_begins_with_it(tmp_path, with_model, messages):
    memory = SnapshotMemory(with_model, 100.0, 10**9)
    for message in messages[:1000]:
        memory.offer(*message)
    done = threading.Event()
    writing = SnapshotWriting(
        memory.take(),
        lambda: BagWriter(tmp_path / 'run', with_model, opening=[(2, MODEL)]),
        done.set,
    )
    assert done.wait(30)
    memory.stop()
    counts = [(c.received, c.recorded, c.dropped) for c in writing.outcome.topics]
    assert counts == [(500, 500, 0), (500, 500, 0), (1, 1, 0)]
    assert models_in(tmp_path / 'run')[1] == 1


def test_where_a_disk_fails_it_is_accounted_for_too(tmp_path, with_model, messages, monkeypatch):
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
