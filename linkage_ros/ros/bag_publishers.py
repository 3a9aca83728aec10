# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""A bag's topics offered on the graph, with the types and qualities of service of the bag."""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import suppress
import re
from typing import Any

from linkage_ros.bag.topic import QosProfile, Topic
from linkage_ros.errors import LinkageError, quoted
from linkage_ros.ros.bag_topics import bag_topic, message_type
from linkage_ros.shipped import share_folders
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

_TYPE = re.compile(r'([a-z][a-z0-9_]*)/msg/([A-Z][A-Za-z0-9]*)')
_MOST_DEPTH = 2**31 - 1  # as DDS counts it


def offer(
    node: Node, topics: Collection[Topic], left_out: Callable[[LinkageError], None]
) -> dict[str, Publisher]:
    """
    Offer a bag's topics on the graph.

    Parameters
    ----------
    node
        The node.
    topics
        The topics.
    left_out
        Takes why a topic cannot be offered.

    Returns
    -------
    publishers : dict of str to Publisher
        By the names in the bag.

    """
    publishers = {}
    for topic in topics:
        try:
            publishers[topic.name] = _publisher(node, topic)
        except LinkageError as error:  # noqa: PERF203 (a bag has a few topics)
            left_out(error)
    return publishers


def offered(qos: QosProfile) -> QoSProfile:
    """
    Return what is offered where this was recorded.

    Deadline, lifespan and liveliness are promises about the recorded publisher's life, which
    playing at another rate would break.
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


def _publisher(node: Node, topic: Topic) -> Publisher:
    """Return what publishes a topic; raises LinkageError where that cannot be."""
    kind = _class_of(topic)
    unfit = LinkageError(
        quoted(topic.name)[1:-1] or "''", 'is no name of a ROS 2 topic', 'convert the bag'
    )
    if '\0' in topic.name:  # rclpy would publish on what stands before it
        raise unfit
    try:
        return node.create_publisher(kind, topic.name, offered(topic.qos))
    except Exception:  # noqa: BLE001 (a space, a {word}, a name too long: each has its own)
        raise unfit from None


def _class_of(topic: Topic) -> Any:
    """
    Return the class of a topic's messages.

    Raises
    ------
    LinkageError
        There is none, or it is not what was recorded.

    """
    matched = _TYPE.fullmatch(topic.type)
    if matched is None:
        raise LinkageError(
            topic.name,
            f'its type {quoted(topic.type)} is none of a ROS 2 message',
            'convert the bag',
        )
    package, kind = matched.groups()
    # A bag comes from anywhere: nothing is imported by a name in it that is no message package.
    if not any((folder / 'msg' / f'{kind}.idl').is_file() for folder in share_folders(package)):
        raise LinkageError(
            topic.name, f'{topic.type} is not installed', f'install the ROS package {package}'
        )
    found = message_type(topic.type, topic.name)
    installed = ''
    with suppress(LinkageError):
        installed = bag_topic(topic.name, found, QoSProfile(depth=1)).type_hash
    if topic.type_hash and installed and topic.type_hash != installed:
        raise LinkageError(
            topic.name,
            f'{topic.type} was another when it was recorded',
            f'install the ROS package {package} of that time',
        )
    return found
