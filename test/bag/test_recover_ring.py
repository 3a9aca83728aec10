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


"""A ring of files, killed between naming the files that are kept and removing the oldest."""

from __future__ import annotations

from linkage_ros.bag.reader import read_bag
from linkage_ros.bag.recover import recover
from linkage_ros.bag.storage import Storage
from linkage_ros.bag.topic import Topic
from linkage_ros.bag.writer import BagWriter


def test_a_file_that_made_way_is_recovered_before_those_that_are_kept(tmp_path, monkeypatch):
    topics = [Topic('/a', 'std_msgs/msg/Empty', '', '')]
    storage = Storage(split_seconds=1e-8, keep_files=2)
    writer = BagWriter(tmp_path / 'run', topics, {}, storage)
    # Twelve files, the last of them `run_11`; what is not removed is as after a kill.
    monkeypatch.setattr('pathlib.Path.unlink', lambda *_, **__: None)
    for time in range(120):
        writer.write(0, time, time, b'\0\1\0\0')
    writer.flush()
    monkeypatch.undo()
    assert [m.log_time for m in read_bag(tmp_path / 'run', allow_truncated=True).messages()] == [
        *range(100, 120)
    ]
    recover(tmp_path / 'run', tmp_path / 'whole')
    assert [m.log_time for m in read_bag(tmp_path / 'whole').messages()] == [*range(120)]
