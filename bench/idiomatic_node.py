# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The same linkage in the style of the rclpy tutorials: timer, callback, message, `rclpy.spin`.

Like the benchmark's scene, it solves with the package's own closure, extrapolates the crank and
publishes rates. It does not count, check or record.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
import sys

from linkage_ros.description import load_scene
from linkage_ros.kinematics import Closure
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.time import Time
from sensor_msgs.msg import JointState


class IdiomaticNode(Node):
    """Publishes the dependent joints at a rate, in [Hz]."""

    def __init__(self, scene: Path, rate: float) -> None:
        super().__init__('idiomatic_node')
        linkage = load_scene(scene).linkages[0].linkage
        self.closure = Closure(linkage)
        self.crank_name = linkage.inputs[0].joint
        self.names = list(linkage.joints)
        self.crank: tuple[Time, float, float] | None = None
        self.publisher = self.create_publisher(JointState, 'joint_states', 10)
        self.create_subscription(
            JointState, 'crank_states', self.on_crank, qos_profile_sensor_data
        )
        self.create_timer(1.0 / rate, self.on_timer)

    def on_crank(self, message: JointState) -> None:
        if self.crank_name in message.name:
            index = message.name.index(self.crank_name)
            stamp = Time.from_msg(message.header.stamp)
            self.crank = (stamp, message.position[index], message.velocity[index])

    def on_timer(self) -> None:
        if self.crank is None:
            return
        stamp, angle, rate = self.crank
        now = self.get_clock().now()
        position = self.closure.position(angle + rate * (now - stamp).nanoseconds * 1e-9)
        message = JointState()
        message.header.stamp = now.to_msg()
        message.name = self.names
        message.position = position.joints
        message.velocity = self.closure.velocity(position, rate).joints
        self.publisher.publish(message)


def main() -> None:
    """Spin until a signal; the scene and the rate, in [Hz], are the arguments."""
    rclpy.init()
    try:
        rclpy.spin(IdiomaticNode(Path(sys.argv[1]), float(sys.argv[2])))
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except RuntimeError:
        # Raised by rclpy if its signal handler shuts the context down while a message is taken.
        if rclpy.ok():
            raise
    finally:
        # The signal handler shuts down at the same time.
        with suppress(RuntimeError):
            rclpy.try_shutdown()


if __name__ == '__main__':
    main()
