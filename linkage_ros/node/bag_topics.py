# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Describe topics of the ROS graph for a bag."""

from __future__ import annotations

from typing import Any

from linkage_ros.bag import INFINITE, QosProfile, Topic
from linkage_ros.replay import describe_topic
from rclpy.qos import QoSProfile


def bag_topic(name: str, message_class: Any, qos: QoSProfile) -> Topic:
    """Describe a topic for a bag, as `describe_topic` does, with the QoS of a publisher."""
    return describe_topic(name, message_class, _recorded_qos(qos))


def _recorded_qos(profile: QoSProfile) -> QosProfile:
    return QosProfile(
        history=profile.history.name.lower(),
        depth=profile.depth,
        reliability=profile.reliability.name.lower(),
        durability=profile.durability.name.lower(),
        # In rclpy's own profiles these are 0, which stands for no limit and for automatic.
        deadline=profile.deadline.nanoseconds or INFINITE,
        lifespan=profile.lifespan.nanoseconds or INFINITE,
        liveliness=profile.liveliness.name.lower() if profile.liveliness else 'automatic',
        liveliness_lease_duration=profile.liveliness_lease_duration.nanoseconds or INFINITE,
        avoid_ros_namespace_conventions=bool(profile.avoid_ros_namespace_conventions),
    )
