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


"""
A crank that turns, for demos and tests.

It publishes angle and rate of one joint as ``sensor_msgs/JointState`` on ``crank_states``. The
speed swings about its mean, as that of a machine under a load that varies with the angle does:
angle(t) = start + speed·t + (ripple·speed/2π)·sin(2πt).
"""

from __future__ import annotations

from math import cos, sin, tau
import sys
from threading import Event
from time import monotonic_ns, sleep, time_ns

from linkage_ros.joint_state import JointStateWriter, NANOSECONDS
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState


class CrankSource(Node):
    """Publishes a turning crank."""

    def __init__(self) -> None:
        super().__init__('crank_source')
        joint = self.declare_parameter(
            'joint', 'crank_joint', ParameterDescriptor(description='Name of the joint')
        ).value
        self._rate = self._number('rate', 500.0, 'Messages a second [Hz]', 0.1, 20_000.0)
        self._speed = self._number('speed', tau, 'Mean speed [rad/s]', -1e4, 1e4)
        self._ripple = self._number('ripple', 0.3, 'Swing of the speed, of its mean', 0.0, 1.0)
        self._start = self._number('start', 0.0, 'First angle [rad]', -1e6, 1e6)
        self._seconds = self._number('seconds', 0.0, 'How long [s]; 0 for ever', 0.0, 1e9)
        self._writer = JointStateWriter([joint])
        self._publisher = self.create_publisher(
            JointState, 'crank_states', qos_profile_sensor_data
        )

    def run(self, stop: Event) -> None:
        """Publish until the event, or for the time that was set."""
        period = NANOSECONDS / self._rate
        swing = self._ripple * self._speed
        begin = monotonic_ns()
        number = 0
        while not stop.is_set():
            number += 1
            wait = begin + round(number * period) - monotonic_ns()
            if wait > 0:
                sleep(wait * 1e-9)
            stamp = time_ns()
            t = (monotonic_ns() - begin) * 1e-9
            if 0.0 < self._seconds < t:
                return
            angle = self._start + self._speed * t + swing / tau * sin(tau * t)
            message = self._writer.write(stamp, (angle,), (self._speed + swing * cos(tau * t),))
            self._publisher.publish(message)

    def _number(
        self, name: str, default: float, description: str, least: float, most: float
    ) -> float:
        bounds = FloatingPointRange(from_value=least, to_value=most)
        descriptor = ParameterDescriptor(
            description=description, read_only=True, floating_point_range=[bounds]
        )
        return float(self.declare_parameter(name, default, descriptor).value)


def run_crank_source(stop: Event) -> int:
    """Publish a turning crank until the event, and return the exit code."""
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        node = CrankSource()
    except Exception as error:  # noqa: BLE001 (rcl's errors have no common root)
        print(f'crank_source: {str(error).splitlines()[0]}; see the README', file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    node.run(stop)
    node.destroy_node()
    rclpy.try_shutdown()
    return 0
