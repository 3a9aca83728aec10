# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Base of the benchmark's programs: a node that takes and publishes bytes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import sys
from typing import Any

from linkage_ros.node import CRANK_QOS, OUTPUT_QOS
import rclpy
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

Take = Callable[[], 'tuple[bytes, dict[str, Any]] | None']


@contextmanager
def node(name: str) -> Iterator[Node]:
    """Initialise ROS and create a node; remappings come from the command line."""
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    made = rclpy.create_node(name)
    try:
        yield made
    finally:
        made.destroy_node()  # type: ignore[no-untyped-call]
        rclpy.try_shutdown()


def keep_last(depth: int) -> QoSProfile:
    """Return reliable, volatile quality of service of a depth."""
    return QoSProfile(depth=depth)  # type: ignore[no-untyped-call]


def publisher(owner: Node, topic: str, qos: QoSProfile = OUTPUT_QOS) -> Any:
    """Return a publisher of joint states; ``handle.publish_raw`` takes bytes."""
    return owner.create_publisher(JointState, topic, qos)


def subscription(owner: Node, topic: str, qos: QoSProfile = CRANK_QOS) -> Any:
    """Return a subscription to joint states that no executor serves."""
    return owner.create_subscription(JointState, topic, _never_called, qos)


def taker(source: Any) -> Take:
    """Return a function that takes the next message of a subscription as bytes, or None."""
    take = source.handle.take_message
    return lambda: take(JointState, True)


def waiter(owner: Node, source: Any) -> Callable[[int], bool]:
    """Return a function that waits up to some [ns] for a message; it returns whether one came."""
    wait_set = _rclpy.WaitSet(1, 0, 0, 0, 0, 0, owner.context.handle)

    def wait(longest: int) -> bool:
        wait_set.clear_entities()
        wait_set.add_subscription(source.handle)
        wait_set.wait(longest)
        return bool(wait_set.get_ready_entities('subscription'))

    return wait


def _never_called(_: Any) -> None:
    pass
