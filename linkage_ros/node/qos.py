# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Quality of service, as rclpy's profiles and as a bag holds it."""

from __future__ import annotations

from linkage_ros.bag import INFINITE, QosProfile
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy


def offered_qos(qos: QosProfile) -> QoSProfile:
    """Return the profile of rclpy for a topic of the node."""
    return QoSProfile(
        depth=qos.depth,
        reliability=ReliabilityPolicy[qos.reliability.upper()],
        durability=DurabilityPolicy[qos.durability.upper()],
    )


def recorded_qos(profile: QoSProfile) -> QosProfile:
    """Return a profile of rclpy as a bag holds it."""
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
