# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""~/markers over DDS: what a display receives, what the bag holds, and views that fit the node."""

import json
from math import cos, sin
from pathlib import Path
import re

from linkage_ros.bag import read_bag
from linkage_ros.replay import recorded_scene, replay_ticks
import pytest
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker, MarkerArray
import yaml

from .graph import crank, NS, stamp_of, wait_for

ROOT = Path(__file__).parents[2]
MARKERS = '/linkage_node/markers'
RVIZ = ROOT / 'config' / 'rviz' / 'linkage.rviz'
FOXGLOVE = ROOT / 'config' / 'foxglove' / 'linkage.json'


@pytest.fixture
def arrays(graph):
    return graph.listen(MarkerArray, MARKERS)


def shown(arrays):
    """Return what a display shows that has received messages, by namespace and id."""
    display = {}
    for array in arrays:
        for marker in array.markers:
            if marker.action == Marker.DELETE:
                display.pop((marker.ns, marker.id), None)
            else:
                display[marker.ns, marker.id] = marker
    return display


def test_markers_show_pose_then_open_loop_then_pose(graph, write_scene, start, arrays):
    publisher = graph.publisher(JointState, '/crank_states')
    scene = 'rate: 200\ndrive: {topic: {carry_forward: false}}\neffects: {markers: {rate: 50}}'
    node = start(write_scene('seen', scene, 'double_rocker'))
    states = graph.listen(JointState, '/joint_states')

    def hold(angle, condition, what):
        wait_for(
            lambda: publisher.publish(crank(angle, name='left_rocker_joint')) or condition(), what
        )

    hold(1.0, lambda: ('traces', 0) in shown(arrays.copy()), 'all that is shown')
    display = shown(arrays.copy())
    assert {ns for ns, _ in display} == {'links', 'edges', 'pins', 'ground', 'traces'}
    pins = [complex(p.x, p.y) for p in display['pins', 0].points]
    assert min(abs(pin - 0.2 * complex(cos(1.0), sin(1.0))) for pin in pins) < 1e-12
    hold(2.0, lambda: ('status', 0) in shown(arrays.copy()), 'that it is open')
    states.clear()
    arrays_before = len(arrays)
    hold(2.0, lambda: len(arrays) > arrays_before + 5, 'more of it')
    display = shown(arrays.copy())
    assert {ns for ns, _ in display} == {'status', 'ground', 'traces'}
    assert re.fullmatch(r'open: the links miss each other by 0\.\d+ m', display['status', 0].text)
    assert states == []
    hold(1.0, lambda: ('links', 0) in shown(arrays.copy()), 'the pose again')
    assert ('status', 0) not in shown(arrays.copy())
    assert node.end() == 0
    assert f'to /joint_states and {MARKERS}' in node.log


def test_markers_have_their_own_rate_and_stamps_of_states(graph, write_scene, start, arrays):
    scene = 'rate: 500\ndrive: {constant_rate: {rate: 3.0}}\neffects: {markers: {rate: 40}}'
    states = graph.listen(JointState, '/joint_states')
    node = start(write_scene('rates', scene))
    wait_for(lambda: len(arrays) > 60, 'markers')
    assert node.end() == 0
    stamps = [stamp_of(array.markers[0]) for array in arrays]
    for array, stamp in zip(arrays, stamps, strict=True):
        assert {stamp_of(marker) for marker in array.markers} == {stamp}
    # One in each fortieth of a second: none has two, and few have none on a busy machine.
    periods = [stamp * 40 // NS for stamp in stamps]
    assert periods == sorted(set(periods))
    assert len(periods) > 0.7 * (periods[-1] - periods[0])
    of_states = {stamp_of(state) for state in states}
    assert sum(stamp in of_states for stamp in stamps) > 0.9 * len(stamps)
    assert len(states) > 5 * len(arrays)


def test_bag_records_and_replays_the_markers(folder, graph, write_scene, start, arrays):
    # Out of its range for a part of each turn: there only the markers tell of a tick.
    scene = (
        'rate: 500\ndrive: {sine: {mean: 1.2, amplitude: 0.9, frequency: 2.0}}\n'
        'effects: {velocity: {}, markers: {rate: 60, trace: 0.5}}\n'
        f'record: {{directory: {folder}, name: seen}}'
    )
    node = start(write_scene('seen_in_bag', scene, 'double_rocker'))
    wait_for(lambda: len(arrays) > 120, 'markers')
    assert node.end() == 0
    with AnyReader([folder / 'seen']) as reader:
        (connection,) = (c for c in reader.connections if c.topic == MARKERS)
        assert connection.msgtype == 'visualization_msgs/msg/MarkerArray'
        bagged = [
            reader.deserialize(data, connection.msgtype)
            for _, _, data in reader.messages([connection])
        ]
    assert len(bagged) >= len(arrays)
    in_bag = {stamp_of(array.markers[0]): array for array in bagged}
    for array in arrays:
        found = in_bag[stamp_of(array.markers[0])]
        assert [m.ns for m in found.markers] == [m.ns for m in array.markers]
    texts = {m.text for array in bagged for m in array.markers if m.action == Marker.ADD}
    assert any(text.startswith('open') for text in texts)
    bag = read_bag(folder / 'seen')
    alone = seen = 0
    for tick in replay_ticks(bag, recorded_scene(bag)):
        assert tick.tick.message == tick.recorded
        if any(tick.recorded_extras):
            seen += 1
            alone += not tick.recorded
            assert tick.tick.extras == tick.recorded_extras
    assert seen == len(bagged)
    assert alone > 5


def topics_of_rviz():
    view = yaml.safe_load(RVIZ.read_text('utf-8'))
    return {
        display[key]['Value']: display['Class']
        for display in view['Visualization Manager']['Displays']
        for key in ('Topic', 'Description Topic')
        if key in display
    }


def topics_of_foxglove():
    layout = json.loads(FOXGLOVE.read_text('utf-8'))
    panels = layout['configById']
    found = {}
    for name, panel in panels.items():
        found |= dict.fromkeys(panel.get('topics', {}), name)
        found |= {path['value'].partition('.')[0]: name for path in panel.get('paths', ())}
        if 'topicToRender' in panel:
            found[panel['topicToRender']] = name
    return found


def test_shipped_views_name_existing_displays_and_panels():
    view = yaml.safe_load(RVIZ.read_text('utf-8'))['Visualization Manager']
    assert [display['Class'] for display in view['Displays']] == [
        'rviz_default_plugins/MarkerArray',
        'rviz_default_plugins/RobotModel',
        'rviz_default_plugins/TF',
    ]
    assert view['Global Options']['Fixed Frame'] == 'ground'
    assert topics_of_rviz() == {
        MARKERS: 'rviz_default_plugins/MarkerArray',
        '/robot_description': 'rviz_default_plugins/RobotModel',
    }
    layout = json.loads(FOXGLOVE.read_text('utf-8'))

    def panels(node):
        return [node] if isinstance(node, str) else panels(node['first']) + panels(node['second'])

    assert sorted(panels(layout['layout'])) == sorted(layout['configById'])
    assert layout['configById']['3D!linkage']['followTf'] == 'ground'


def test_view_topics_are_published_by_the_node(graph, start, arrays):
    node = start(ROOT / 'config' / 'scenes' / 'visible_bucket.yaml')
    wait_for(lambda: arrays, 'markers')
    # What a scene asks for with a key of its own is not in this one.
    wanted = {*topics_of_rviz(), *topics_of_foxglove()} - {'/robot_description'}

    def published():
        topics = dict(graph.node.get_topic_names_and_types())
        return wanted <= topics.keys() and topics

    topics = wait_for(published, f'{sorted(wanted)}')
    assert topics[MARKERS] == ['visualization_msgs/msg/MarkerArray']
    assert topics['/joint_states'] == ['sensor_msgs/msg/JointState']
    assert {marker.header.frame_id for marker in arrays[0].markers} == {'ground'}
    assert node.end() == 0
