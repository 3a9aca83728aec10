# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""How topics are described in bags, by what rosbag2 writes of them."""

import re

from linkage_ros.bag import INFINITE, QosProfile
from linkage_ros.node import recorded_qos
from linkage_ros.replay import describe_topic
from rclpy.duration import Duration
from rclpy.qos import (
    LivelinessPolicy,
    qos_profile_sensor_data,
    QoSProfile,
    ReliabilityPolicy,
)
from sensor_msgs.msg import MultiDOFJointState
from trajectory_msgs.msg import JointTrajectory


def test_topic_definition_lists_nested_messages_by_full_name():
    # As rosbag2_cpp's LocalMessageDefinitionSource, which keeps them in a std::set.
    needed = re.findall(
        r'^MSG: (.+)$',
        describe_topic('/a', MultiDOFJointState, QosProfile()).definition,
        re.MULTILINE,
    )
    assert needed == [
        'geometry_msgs/Transform',
        'geometry_msgs/Quaternion',
        'geometry_msgs/Vector3',
        'geometry_msgs/Twist',
        'geometry_msgs/Wrench',
        'std_msgs/Header',
        'builtin_interfaces/Time',
    ]
    trajectory = describe_topic('/b', JointTrajectory, QosProfile()).definition
    assert trajectory.index('MSG: std_msgs/Header') < trajectory.index('MSG: trajectory_msgs/')


def test_recorded_qos_keeps_every_policy_of_a_publisher():
    qos = recorded_qos(
        QoSProfile(
            depth=7,
            reliability=ReliabilityPolicy.BEST_EFFORT,
            deadline=Duration(nanoseconds=20_000_000),
            lifespan=Duration(seconds=2),
            liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
            liveliness_lease_duration=Duration(seconds=1),
            avoid_ros_namespace_conventions=True,
        ),
    )
    assert (qos.depth, qos.reliability) == (7, 'best_effort')
    assert (qos.deadline, qos.lifespan) == (20_000_000, 2 * 10**9)
    assert (qos.liveliness, qos.liveliness_lease_duration) == ('manual_by_topic', 10**9)
    assert qos.avoid_ros_namespace_conventions


def test_recorded_qos_without_limits_is_infinite():
    qos = recorded_qos(qos_profile_sensor_data)
    assert {qos.deadline, qos.lifespan, qos.liveliness_lease_duration} == {INFINITE}
    assert qos.liveliness == 'automatic'
