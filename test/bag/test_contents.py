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


"""`contents_of`: counts, bytes and times by topic, also to a damage or a wish to stop."""

from __future__ import annotations

from pathlib import Path

from linkage_ros.bag.contents import contents_of
from linkage_ros.bag.reader import read_bag
from linkage_ros.bag.writer import BagWriter
import pytest


@pytest.fixture
def folder(tmp_path, topics, messages):
    writer = BagWriter(tmp_path / 'run', topics)
    for message in messages:
        writer.write(*message)
    writer.close()
    return tmp_path / 'run'


def test_each_topic_has_its_own_count_bytes_and_times(folder, topics, messages):
    found = contents_of(read_bag(folder))
    for number, topic in enumerate(topics):
        own = [message for message in messages if message.topic == number]
        times = [message.log_time for message in own]
        assert found.topics[number] == (
            topic, len(own), sum(len(message.data) for message in own), min(times), max(times)
        )  # fmt: skip
        rate = (len(own) - 1) / ((max(times) - min(times)) / 1e9)
        assert found.topics[number].rate == pytest.approx(rate, rel=1e-12)
    times = [message.log_time for message in messages]
    assert (found.begin, found.end) == (min(times), max(times))
    assert (found.damage, found.stopped) == ('', False)


@pytest.mark.parametrize(('count', 'span'), [(0, 0), (1, 0), (2, 0)])
def test_without_a_span_there_is_no_rate(tmp_path: Path, topics, count, span):
    writer = BagWriter(tmp_path / 'run', topics)
    for _ in range(count):
        writer.write(0, 5 + span, 5, b'\0\1\0\0')
    writer.close()
    first, second = contents_of(read_bag(tmp_path / 'run')).topics
    assert (first.rate, second.rate) == (None, None)
    assert (second.first, second.last) == (0, 0)


def test_log_times_stand_in_any_order(tmp_path: Path, topics):
    writer = BagWriter(tmp_path / 'run', topics)
    for log_time in (7_000, 5_000, 9_000, 8_000):
        writer.write(1, log_time, 5, b'\0\1\0\0')
    writer.close()
    found = contents_of(read_bag(tmp_path / 'run'))
    assert (found.begin, found.end) == (5_000, 9_000)
    assert found.topics[1].rate == 3 / 4e-6


def test_what_lies_before_a_damage_is_counted(folder, messages):
    file = folder / 'run_0.mcap'
    content = bytearray(file.read_bytes())
    content[content.index(messages[6000].data) + 30] ^= 1
    file.write_bytes(content)
    found = contents_of(read_bag(folder))
    assert 'is damaged: ' in found.damage
    assert found.damage.startswith(f'{file}: ')
    assert 5000 < sum(topic.messages for topic in found.topics) <= 6000


def test_progress_is_told_and_a_wish_to_stop_is_heard(folder, messages):
    told: list[int] = []
    found = contents_of(read_bag(folder), told.append, lambda: len(told) == 2)
    assert found.stopped
    assert sum(topic.messages for topic in found.topics) == 8192
    assert told == sorted(told)
    # A message takes 31 bytes beside its own: opcode, length, channel, sequence, two times.
    assert told[-1] == sum(len(message.data) + 31 for message in messages[:8192])
