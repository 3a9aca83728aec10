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
from threading import Event
from time import monotonic_ns, sleep, time_ns

from linkage_ros.messages.joint_state import JointStateWriter
from linkage_ros.messages.layout import NANOSECONDS
from linkage_ros.node.companion import Companion, run_companion
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState


class CrankSource(Companion):
    """Publishes a turning crank."""

    def __init__(self) -> None:
        super().__init__('crank_source')
        joint = self.joint()
        self._rate = self.number('rate', 500.0, 'Messages a second [Hz]', 0.1, 20_000.0)
        self._speed = self.number('speed', tau, 'Mean speed [rad/s]', -1e4, 1e4)
        self._ripple = self.number('ripple', 0.3, 'Swing of the speed, of its mean', 0.0, 1.0)
        self._start = self.number('start', 0.0, 'First angle [rad]', -1e6, 1e6)
        self._seconds = self.number('seconds', 0.0, 'How long [s]; 0 for ever', 0.0, 1e9)
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


def run_crank_source(stop: Event) -> int:
    """Publish a turning crank until the event, and return the exit code."""
    return run_companion('crank_source', CrankSource, CrankSource.run, stop)
