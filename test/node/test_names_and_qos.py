# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Names and QoS that whoever starts the node gives it: namespace, node name, remaps, overrides."""

from cmath import rect
import json

from linkage_ros.bag import read_bag
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from .graph import crank, wait_for
from ..support.commands import linkage

TICKED = 'rate: 100\ndrive: {topic: {carry_forward: false}}\n'


def gap(state, angle):
    """Return by how much the four-bar's loop stays open in a state, were this its crank angle."""
    coupler, rocker = state.position
    return abs(rect(0.040, angle) + rect(0.120, angle + coupler) - 0.100 - rect(0.080, rocker))


def test_nodes_in_two_namespaces_do_not_mix(graph, write_scene, start):
    scene = write_scene('two', TICKED)
    heard, publishers = {}, {}
    for side in ('left', 'right'):
        start(scene, '-r', f'__ns:=/{side}')
        heard[side] = graph.listen(JointState, f'/{side}/joint_states')
        publishers[side] = graph.publisher(JointState, f'/{side}/crank_states')
    nowhere = graph.listen(JointState, '/joint_states')

    def turn(side, angle):
        wait_for(
            lambda: publishers[side].publish(crank(angle)) or len(heard[side]) > 5,
            f'joint states of {side}',
        )

    turn('left', 0.5)
    assert heard['right'] == []
    turn('right', 2.0)
    for side, angle in (('left', 0.5), ('right', 2.0)):
        assert max(gap(state, angle) for state in heard[side].copy()) < 1e-12
    assert nowhere == []


def test_private_topics_follow_the_name_of_the_node(graph, write_scene, start):
    scene = 'rate: 100\ndrive: {constant_rate: {rate: 3.0}}\neffects: {markers: {rate: 20}}'
    node = start(write_scene('renamed', scene), '-r', '__ns:=/arm', '-r', '__node:=press')
    markers = graph.listen(MarkerArray, '/arm/press/markers')
    wait_for(lambda: markers, 'markers')
    assert graph.call(Trigger, '/arm/press/reset').success
    tick = graph.next_status('tick')
    assert tick.name == '/arm/press: tick'
    assert node.end() == 0
    assert 'to /arm/joint_states and /arm/press/markers' in node.log


def test_remapped_topics_are_recorded_and_replayed(folder, graph, write_scene, start):
    scene = f'{TICKED}record: {{directory: {folder}, name: remapped}}'
    node = start(
        write_scene('remapped', scene),
        *('-r', '__ns:=/arm', '-r', 'joint_states:=/all_joints'),
        *('-r', 'crank_states:=/motor/state', '-r', '__node:=press'),
    )
    publisher = graph.publisher(JointState, '/motor/state')
    states = graph.listen(JointState, '/all_joints')
    wait_for(lambda: publisher.publish(crank(0.7)) or len(states) > 20, 'joint states')
    wait_for(lambda: graph.value('crank', 'Topic') == '/motor/state', 'the topic in diagnostics')
    assert node.end() == 0
    assert 'from /motor/state' in node.log
    bag = folder / 'remapped'
    assert {topic.name for topic in read_bag(bag).topics} >= {'/all_joints', '/motor/state'}
    answer = linkage(folder, 'replay', bag.name, '--json')
    said = json.loads(answer.stdout)
    assert said['verdict'] == 'identical'


def test_diagnostics_names_contain_the_namespace(graph, write_scene, start):
    scene = write_scene('apart', TICKED)
    for side in ('left', 'right'):
        start(scene, '-r', f'__ns:=/{side}')
    tasks = ('tick', 'crank', 'loop closure', 'recording')
    expected = {f'/{side}/linkage_node: {task}' for side in ('left', 'right') for task in tasks}

    def named():
        return {status.name for message in graph.diagnostics for status in message.status}

    wait_for(lambda: len(named()) >= len(expected), 'the diagnostics of both')
    assert named() == expected


def test_remapped_node_ignores_its_own_joint_states(folder, graph, write_scene, start):
    # docs/how_to/see_it.md: the crank comes from the topic of the broadcaster's joint states.
    scene = f'{TICKED}record: {{directory: {folder}, name: both}}'
    publisher = graph.node.create_publisher(
        JointState, '/joint_states', QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    )
    wait_for(lambda: graph.node.count_publishers('/joint_states') == 1, 'the crank on the graph')
    node = start(
        write_scene('both', scene),
        *('-r', 'joint_states:=/linkage/joint_states', '-r', 'crank_states:=joint_states'),
    )
    states = graph.listen(JointState, '/linkage/joint_states')
    wait_for(lambda: publisher.publish(crank(0.7)) or len(states) > 5, 'joint states')
    wait_for(lambda: graph.value('crank', 'Publishers') == '/tester', 'who publishes the crank')
    assert graph.value('crank', 'Topic') == '/joint_states'
    impostor = graph.publisher(JointState, '/joint_states', node='impostor')

    def is_warned_of():
        publisher.publish(crank(0.7))
        impostor.publish(crank(0.7))
        return 'several publishers' in graph.status('crank').message

    wait_for(is_warned_of, 'the warning of a second publisher')
    named = graph.value('crank', 'Publishers').split(', ')
    assert sorted(named) == ['/impostor', '/tester']
    assert node.end() == 0
    (topic,) = [t for t in read_bag(folder / 'both').topics if t.name == '/joint_states']
    assert topic.qos.reliability == 'best_effort', 'of the publisher, not of the node'


def test_qos_overrides_set_the_published_qos(folder, graph, write_scene, start):
    scene = f'{TICKED}record: {{directory: {folder}, name: overridden}}'
    node = start(
        write_scene('overridden', scene),
        *('-p', 'qos_overrides./joint_states.publisher.reliability:=best_effort'),
        *('-p', 'qos_overrides./joint_states.publisher.depth:=3'),
        *('-p', 'qos_overrides./crank_states.subscription.reliability:=reliable'),
    )
    (out,) = wait_for(
        lambda: graph.node.get_publishers_info_by_topic('/joint_states'), 'its publisher'
    )
    assert out.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    (into,) = wait_for(
        lambda: graph.node.get_subscriptions_info_by_topic('/crank_states'), 'its subscription'
    )
    assert into.qos_profile.reliability == ReliabilityPolicy.RELIABLE
    publisher = graph.publisher(JointState, '/crank_states')
    states = []
    graph.node.create_subscription(
        JointState,
        '/joint_states',
        states.append,
        QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT),
    )
    wait_for(lambda: publisher.publish(crank(0.7)) or len(states) > 5, 'joint states')
    assert node.end() == 0
    bag = read_bag(folder / 'overridden')
    (topic,) = [topic for topic in bag.topics if topic.name == '/joint_states']
    assert (topic.qos.reliability, topic.qos.depth) == ('best_effort', 3)
