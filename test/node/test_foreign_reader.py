# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Bags of a node as a reader in another language sees them, and as the graph describes them."""

import signal
import time

from linkage_ros.cli.main import main
import pytest
from sensor_msgs.msg import JointState

from .graph import crank, wait_for
from ..bag.foreign_reader.agreement import (
    assert_agreement,
    of_kind,
    read,
    require_reader,
)

SCENE = """
rate: 200
effects: {acceleration: {}, noise: {joints: {rocker_joint: {white: 1.0e-4}}}}
faults: {cable: {silence: {}, at: %s, seconds: 0.2}}
record: {directory: %s, name: bag, compression: zstd, flush_period: 0.1}
"""
# However late the node is discovered, one falls within the time of 150 joint states.
SILENCES = [0.5 * index for index in range(60)]
TOPICS = {'/joint_states', '/crank_states', '/diagnostics', '/linkage_node/motion'}


@pytest.fixture(autouse=True)
def _reader():
    require_reader()


@pytest.fixture
def running(graph, tmp_path, write_scene, start):
    """Return a node that has recorded for a second, and is fed no more."""
    node = start(
        write_scene(tmp_path.name, SCENE % (SILENCES, tmp_path)),
        *('-p', f'runs_directory:={tmp_path}'),
    )
    publisher = graph.publisher(JointState, '/crank_states')
    heard = graph.listen(JointState, '/joint_states')
    wait_for(publisher.get_subscription_count, 'the node')

    def enough():
        publisher.publish(crank(time.monotonic() % 6.0, 1.0))
        return len(heard) > 150 and graph.diagnostics

    wait_for(enough, 'joint states')
    return node


def test_node_bag_agrees_with_a_foreign_reader(graph, tmp_path, running):
    offered = {
        topic: graph.node.get_publishers_info_by_topic(topic)
        for topic in (*TOPICS, '/linkage_node/faults')
    }
    assert running.end() == 0
    bag = assert_agreement(tmp_path / 'bag')
    counts = dict.fromkeys((topic.name for topic in bag.topics), 0)
    for message in bag.messages():
        counts[message.topic] += 1
    assert {topic for topic, count in counts.items() if count} == {
        *TOPICS,
        '/linkage_node/faults',
        '/linkage_node/withheld',
    }
    for topic in bag.topics:
        for info in offered.get(topic.name, ()):
            assert topic.type == info.topic_type
            assert topic.type_hash == str(info.topic_type_hash)
            # History and depth stay with who publishes; the graph does not know them.
            qos = info.qos_profile
            if info.node_name == 'linkage_node':
                assert topic.qos.reliability == qos.reliability.name.lower()
                assert topic.qos.durability == qos.durability.name.lower()


def test_recovered_bag_of_a_killed_node_passes_foreign_reader(tmp_path, running):
    time.sleep(0.3)  # three periods of flushing
    running.end(signal.SIGKILL)
    (file,) = (tmp_path / 'bag').glob('*.mcap')
    before = [m['sha256'] for m in of_kind(read(file, 'streamed'), 'message')]
    assert len(before) > 100
    assert main(['recover', str(tmp_path / 'bag')]) in {0, 3}
    recovered = assert_agreement(tmp_path / 'bag_recovered')
    (file,) = recovered.files
    assert [m['sha256'] for m in of_kind(read(file, 'streamed'), 'message')] == before
