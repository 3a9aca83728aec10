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
A PD controller of one joint, for demos and tests: plain rclpy, as a user's own would be.

It hears where the joint is on ``joint_states`` and commands its effort on ``crank_commands``::

    τ = kp·(r − q) + kd·(ṙ − q̇)        r(t) = target + swing·sin(2π·t/period)

It knows nothing of weight and friction: where they pull, it stands off its target by what kp needs
to hold against them. Where it hears nothing it commands nothing.
"""

from __future__ import annotations

from math import cos, inf, sin, tau
from threading import Event
from time import monotonic

from linkage_ros.node.companion import Companion, run_companion
from linkage_ros.node.simulated_time import ClockGuard
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState

_LOOK = 0.1
_OLDEST = 0.1
"""A state that came longer ago is none, in [s]."""


class PDController(Companion):
    """Commands the effort of a joint."""

    def __init__(self) -> None:
        super().__init__('pd_controller')
        self._joint = self.joint()
        rate = self.number('rate', 500.0, 'Commands a second [Hz]', 0.1, 20_000.0)
        self._target = self.number('target', 2.0, 'Where the joint is to be [rad]', -1e6, 1e6)
        self._swing = self.number('swing', 0.0, 'Amplitude about the target [rad]', 0.0, 1e6)
        self._period = self.number('period', 5.0, 'Of the swing [s]', 1e-3, 1e6)
        self._kp = self.number('kp', 1.0, 'Effort for each unit of error [N·m/rad]', 0.0, 1e9)
        self._kd = self.number(
            'kd', 0.05, "Effort for each unit of the error's rate [N·m·s/rad]", 0.0, 1e9
        )
        self._seconds = self.number('seconds', 0.0, 'How long [s]; 0 for ever', 0.0, 1e9)
        self._state = (0.0, 0.0)
        self._heard = -inf
        self._begun = self.get_clock().now()
        # Reliable, for whoever listens, and no more than the newest, since it alone counts.
        self._publisher = self.create_publisher(JointState, 'crank_commands', 1)
        self.create_subscription(JointState, 'joint_states', self._hear, 10)
        self.create_timer(1.0 / rate, self._command)
        ClockGuard(self._time_source)

    def _hear(self, message: JointState) -> None:
        """Keep position and rate of the joint."""
        if self._joint not in message.name:
            return
        place = message.name.index(self._joint)
        # An array without values is an empty one.
        if place < min(len(message.position), len(message.velocity)):
            self._state = message.position[place], message.velocity[place]
            self._heard = monotonic()

    def _command(self) -> None:
        """Publish an effort."""
        if monotonic() - self._heard > _OLDEST:
            return
        now = self.get_clock().now()
        frequency = tau / self._period
        phase = frequency * (now - self._begun).nanoseconds * 1e-9
        target = self._target + self._swing * sin(phase)
        target_rate = self._swing * frequency * cos(phase)
        position, rate = self._state
        effort = self._kp * (target - position) + self._kd * (target_rate - rate)
        message = JointState(name=[self._joint], effort=[effort])
        message.header.stamp = now.to_msg()
        self._publisher.publish(message)

    def run(self, stop: Event) -> None:
        """Control until the event, or for the time that was set."""
        executor = SingleThreadedExecutor()
        executor.add_node(self)
        end = monotonic() + (self._seconds or inf)
        while not stop.is_set() and monotonic() < end:
            executor.spin_once(timeout_sec=_LOOK)
        executor.shutdown()


def run_pd_controller(stop: Event) -> int:
    """Control until the event, or for the time that was set, and return the exit code."""
    return run_companion('pd_controller', PDController, PDController.run, stop)
