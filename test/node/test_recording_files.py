# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A recording in a ring of packed files: read, replayed from, and accounted for to the message."""

import json
import time

import pytest
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
import yaml

from .graph import crank, wait_for

ERROR = b'\2'
INCOMPLETE = 1
WORDS = ('Recorded', 'Dropped', 'Waiting', 'Discarded')


def told(status, word):
    values = {pair.key: pair.value for pair in status.values}
    return int(values.get(f'{word}: /joint_states', 0))


@pytest.mark.parametrize('compression', ['lz4', 'zstd'])
def test_ring_of_packed_files_counts_every_message(
    graph, tmp_path, write_scene, start, compression
):
    record = f'split_seconds: 1, keep_files: 2, compression: {compression}, flush_period: 0.1'
    node = start(
        write_scene('ring', f'rate: 500\nrecord: {{directory: {tmp_path}, name: bag, {record}}}')
    )
    publisher = graph.publisher(JointState, '/crank_states')

    def feed(seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            publisher.publish(crank(0.5, 1.0))
            time.sleep(0.01)

    def files():
        feed(0.01)
        return {*(tmp_path / 'bag').glob('*.mcap')}

    feed(4.5)
    status = wait_for(
        lambda: (status := graph.status('recording')) and told(status, 'Discarded') and status,
        'files that made way',
    )
    assert told(status, 'Received') == sum(told(status, word) for word in WORDS)
    # Half a second into a file: it has some messages by then, and is the last one still.
    before = files()
    wait_for(lambda: files() - before, 'the next file')
    feed(0.5)
    success, message = graph.trigger('stop_recording')
    assert success
    assert ' discarded' in message
    assert node.end() == 0
    said = yaml.safe_load((tmp_path / 'bag' / 'metadata.yaml').read_text())
    information = said['rosbag2_bagfile_information']
    names = information['relative_file_paths']
    assert len(names) == 2
    there = {path.name for path in (tmp_path / 'bag').iterdir()}
    assert there == {'metadata.yaml', *names}
    with AnyReader([tmp_path / 'bag']) as reader:
        found = {name: topic.msgcount for name, topic in reader.topics.items()}
        assert sum(1 for _ in reader.messages()) == sum(found.values())
    custom = information['custom_data']
    received, dropped, gone = (
        json.loads(custom[f'linkage_ros.{word}']) for word in ('received', 'dropped', 'discarded')
    )
    for topic, count in found.items():
        assert received[topic] == count + dropped[topic] + gone[topic]


def test_recording_refuses_a_disk_below_min_free_bytes(graph, tmp_path, write_scene, start):
    record = f'record: {{directory: {tmp_path}, name: bag, min_free_bytes: 1000000000000000}}'
    # With an argument it is a process of its own, which has an exit code.
    node = start(write_scene('scarce', f'rate: 100\n{record}'), '-p', 'autostart:=true')
    message = graph.wait_for_level('recording', ERROR).message
    assert (
        'bytes are free on its disk, fewer than min_free_bytes: 1,000,000,000,000,000' in message
    )
    assert node.end() == INCOMPLETE
    assert list(tmp_path.iterdir()) == []
