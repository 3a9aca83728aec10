# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The xacro of config/ros2_control, expanded: what ros2_control reads is what was asked for."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest

PLUGIN = 'joint_state_topic_hardware_interface/JointStateTopicSystem'


@pytest.fixture
def expanded(root, tmp_path):
    xacro = pytest.importorskip('xacro')

    def expand(call):
        file = tmp_path / 'robot.urdf.xacro'
        include = root / 'config' / 'ros2_control' / 'linkage.ros2_control.xacro'
        file.write_text(
            '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
            f'<xacro:include filename="{include}"/>{call}</robot>'
        )
        return ET.fromstring(xacro.process_file(str(file)).toxml())

    return expand


def parameters(system):
    return {each.get('name'): each.text for each in system.find('hardware').iter('param')}


def joints(system):
    return {
        joint.get('name'): [state.get('name') for state in joint.findall('state_interface')]
        for joint in system.findall('joint')
    }


def test_xacro_joints_have_state_interfaces_only(expanded):
    robot = expanded(
        '<xacro:linkage_ros2_control name="gripper" joints="coupler_joint rocker_joint"/>'
    )
    (system,) = robot.findall('ros2_control')
    assert (system.get('name'), system.get('type')) == ('gripper', 'system')
    assert system.findtext('hardware/plugin') == PLUGIN
    # As https://control.ros.org/jazzy/doc/topic_based_hardware_interfaces has them.
    assert parameters(system) == {
        'joint_states_topic': '/linkage/joint_states',
        'joint_commands_topic': '/linkage/joint_states/no_commands',
        'trigger_joint_command_threshold': '1e300',
        'sum_wrapped_joint_states': 'false',
    }
    both = ['position', 'velocity']
    assert joints(system) == {'coupler_joint': both, 'rocker_joint': both}
    assert not list(system.iter('command_interface'))


def test_xacro_takes_several_linkages_topics_and_interfaces(expanded):
    robot = expanded(
        '<xacro:linkage_ros2_control name="left" joints="left_rocker_joint"'
        ' joint_states_topic="/left/states" interfaces="position"/>'
        '<xacro:linkage_ros2_control name="leg" joints="  a b c d e f  "'
        ' interfaces="position velocity effort"/>'
    )
    left, leg = robot.findall('ros2_control')
    assert parameters(left)['joint_states_topic'] == '/left/states'
    assert joints(left) == {'left_rocker_joint': ['position']}
    assert list(joints(leg)) == list('abcdef')
    assert set(map(tuple, joints(leg).values())) == {('position', 'velocity', 'effort')}
