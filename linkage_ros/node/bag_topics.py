# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Describe topics for a bag, and publish a bag's topics on the ROS graph."""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import suppress
from typing import Any

from linkage_ros.bag import INFINITE, QosProfile, Topic
from linkage_ros.errors import LinkageError, quote
from linkage_ros.replay import describe_topic, message_type
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

_MOST_DEPTH = 2**31 - 1  # as DDS counts it


def bag_topic(name: str, message_class: Any, qos: QoSProfile) -> Topic:
    """Describe a topic for a bag, as `describe_topic` does, with the QoS of a publisher."""
    return describe_topic(name, message_class, recorded_qos(qos))


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


def create_publishers(
    node: Node, topics: Collection[Topic], left_out: Callable[[LinkageError], None]
) -> dict[str, Publisher]:
    """
    Return a publisher for each topic of a bag, by its name there.

    ``left_out`` receives the reason if a topic cannot be published.
    """
    publishers = {}
    for topic in topics:
        try:
            publishers[topic.name] = _create_publisher(node, topic)
        except LinkageError as error:  # noqa: PERF203 (a bag has a few topics)
            left_out(error)
    return publishers


def offered_qos(qos: QosProfile) -> QoSProfile:
    """
    Return the QoS to offer for a topic that was recorded with this one.

    Deadline, lifespan and liveliness are left out: they are promises about the recorded publisher,
    which a playback at another rate would break.
    """
    return QoSProfile(
        history=HistoryPolicy.KEEP_ALL if qos.history == 'keep_all' else HistoryPolicy.KEEP_LAST,
        depth=min(max(1, qos.depth), _MOST_DEPTH),
        reliability=(
            ReliabilityPolicy.BEST_EFFORT
            if qos.reliability == 'best_effort'
            else ReliabilityPolicy.RELIABLE
        ),
        durability=(
            DurabilityPolicy.TRANSIENT_LOCAL
            if qos.durability == 'transient_local'
            else DurabilityPolicy.VOLATILE
        ),
    )


def _create_publisher(node: Node, topic: Topic) -> Publisher:
    """Return a publisher for a topic; raise LinkageError if there can be none."""
    kind = _class_of(topic)
    unfit = LinkageError(
        quote(topic.name)[1:-1] or "''", 'is not a ROS 2 topic name', 'convert the bag'
    )
    if '\0' in topic.name:  # rclpy would publish on the part before it
        raise unfit
    try:
        return node.create_publisher(kind, topic.name, offered_qos(topic.qos))
    except Exception:  # noqa: BLE001 (a space, a {word}, a name too long: each has its own)
        raise unfit from None


def _class_of(topic: Topic) -> Any:
    """Return the class of a topic's messages, if it is installed and as it was recorded."""
    message_class = message_type(topic.type, topic.name)
    installed = ''
    with suppress(LinkageError):
        installed = bag_topic(topic.name, message_class, QoSProfile(depth=1)).type_hash
    if topic.type_hash and installed and topic.type_hash != installed:
        raise LinkageError(
            topic.name,
            f'{topic.type} had another definition when it was recorded',
            'install the version of its ROS package that the recording used',
        )
    return message_class
