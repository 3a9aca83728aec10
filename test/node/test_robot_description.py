# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
robot_description over DDS: a model for whoever comes late, which the joint states make move.

What robot_state_publisher does with both is done by yourdfpy here.
"""

from lifecycle_msgs.msg import Transition
from linkage_ros.bag import read_bag
from linkage_ros.replay import IDENTICAL, recorded_scene, verify_replay
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from .graph import wait_for
from ..tools.models.walked import Walked

JAZZY = get_typestore(Stores.ROS2_JAZZY)
TOPIC = '/robot_description'
AS_RVIZ = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
TURNING = 'rate: 200\ndrive: {constant_rate: {rate: 3.0}}\n'


def late(graph):
    """Return what one hears who comes when the node has long been there."""
    heard = []
    graph.node.create_subscription(String, TOPIC, heard.append, AS_RVIZ)
    return heard


def test_late_subscriber_receives_the_robot_description(graph, write_scene, start):
    start(write_scene('described', TURNING + 'robot_description: true'))
    states = graph.listen(JointState, '/joint_states')
    wait_for(lambda: len(states) > 100, 'joint states')
    for _ in range(2):
        heard = late(graph)
        wait_for(lambda heard=heard: heard, 'a robot model')
        assert len(heard) == 1
    model = Walked(heard[0].data.encode())
    for state in states[::5]:
        model.pose(list(state.name), list(state.position))
        ends = [model.place(f'B_on_{link}') for link in ('coupler', 'rocker')]
        assert abs(ends[0] - ends[1]) < 1e-12 * 0.12


def test_published_joints_close_the_rods_in_space(graph, write_scene, start):
    """Every joint of the model is published, also those by which rods hang."""
    text = 'rate: 200\ndrive: {sine: {amplitude: 0.2, frequency: 1}}\nrobot_description: true'
    start(write_scene('delta_described', text, 'space/delta'))
    states = graph.listen(JointState, '/joint_states')
    wait_for(lambda: len(states) > 100, 'joint states')
    heard = late(graph)
    wait_for(lambda: heard, 'a robot model')
    model = Walked(heard[0].data.encode())
    assert {'rod1_joint1', 'rod1_joint2'} < model.joints
    for state in states[::5]:
        model.pose(list(state.name), list(state.position))
        assert model.gap() < 1e-12


def test_node_parameter_takes_the_robot_description(graph, write_scene, start):
    """``-p robot_description:="$(cat leg.urdf)"``: rcl reads it as YAML."""
    start(write_scene('as_text', TURNING + 'robot_description: true'))
    heard = late(graph)
    wait_for(lambda: heard, 'a robot model')
    node = Node(
        'taker',
        context=graph.node.context,
        cli_args=['--ros-args', '-p', f'robot_description:={heard[0].data}'],
        automatically_declare_parameters_from_overrides=True,
    )
    taken = node.get_parameter('robot_description').value
    node.destroy_node()
    assert taken.split() == heard[0].data.split(), 'lines are folded, and that is all'


def test_several_linkages_share_one_robot_description(graph, folder, start, request):
    scene = request.config.rootpath / 'config' / 'scenes' / 'two_fingers.yaml'
    text = scene.read_text().replace('../linkages', str(scene.parents[1] / 'linkages'))
    (folder / 'two.yaml').write_text(text + '\nrobot_description: true\n')
    start(folder / 'two.yaml')
    heard = late(graph)
    states = graph.listen(JointState, '/joint_states')
    wait_for(lambda: heard and states, 'a robot model and a joint state')
    model = Walked(heard[0].data.encode())
    model.pose(list(states[-1].name), list(states[-1].position))
    assert model.joints == set(states[-1].name)


def test_robot_description_disappears_and_returns_with_the_scene(graph, write_scene, start):
    start(write_scene('gone', TURNING + 'robot_description: true'))
    wait_for(lambda: graph.node.count_publishers(TOPIC) == 1, 'a publisher')
    for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP):
        assert graph.change_state(transition)
    wait_for(lambda: graph.node.count_publishers(TOPIC) == 0, 'no publisher')
    for transition in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
        assert graph.change_state(transition)
    heard = late(graph)
    wait_for(lambda: heard, 'a robot model')


def test_each_bag_file_holds_the_robot_description(graph, folder, write_scene, start):
    record = f'record: {{directory: {folder}, name: bag, split_seconds: 1}}'
    node = start(write_scene('bagged', TURNING + f'robot_description: true\n{record}'))
    heard = late(graph)
    states = graph.listen(JointState, '/joint_states')
    wait_for(lambda: heard and len(states) > 300, 'a robot model, and joint states')
    assert node.end() == 0
    files = list((folder / 'bag').glob('*.mcap'))
    assert len(files) >= 2
    for file in files:
        with AnyReader([file], default_typestore=JAZZY) as reader:
            (connection,) = (c for c in reader.connections if c.topic == TOPIC)
            (model,) = (
                reader.deserialize(data, c.msgtype).data
                for c, _, data in reader.messages([connection])
            )
        assert model == heard[0].data
        assert connection.ext.offered_qos_profiles[0].durability.name == 'TRANSIENT_LOCAL'
    assert replayed(folder / 'bag')


def replayed(bag):
    """Return whether a bag replays to the same bytes."""
    found = read_bag(bag)
    return verify_replay(found, recorded_scene(found), found.messages()).verdict == IDENTICAL


def test_undetermined_link_of_a_robot_description_is_named(write_scene, start):
    linkage = (
        'links:\n'
        '  ground: {O2: [0, 0], O4: [0.1, 0]}\n'
        '  crank: {O2: [0, 0], A: [0.04, 0]}\n'
        '  coupler: {A: [0, 0], B: [0.12, 0]}\n'
        '  rocker: {O4: [0, 0], B: [0.08, 0]}\n'
        'input: {joint: crank_joint, parent: ground, child: crank}\n'
        'assembly: {B: left}\n'
        'joints: {rocker_joint: {parent: ground, child: rocker}}\n'
    )
    scene = write_scene('untold', TURNING + 'robot_description: true', linkage)
    node = start(scene, ready='do not determine')
    assert node.process.wait(20) == 2
    line = next(line for line in node.log.splitlines() if 'do not determine' in line)
    assert line.endswith(
        'untold_linkage.yaml:8: joints: the published joints do not determine where link '
        "'coupler' stands; add to joints: coupler_joint: {parent: crank, child: coupler}"
    )
