# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Nodes for demos and tests, in plain rclpy, as a user would write them.

`PDController` reads the positions of joints from ``joint_states`` and commands their efforts, in
one message, on ``crank_commands``; of each::

    τ = kp·(r − q) + kd·(ṙ − q̇)        r(t) = target + swing·sin(2π·t/period)

It has no model of weight and friction: under load it stays off its target by the error at which kp
balances the load. A joint without joint states gets no command.

`CrankSource` publishes angle and rate of one joint as ``sensor_msgs/JointState`` on
``crank_states``. The speed varies about its mean, as in a machine whose load varies with the
angle: angle(t) = start + speed·t + (ripple·speed/2π)·sin(2πt).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from math import cos, inf, sin, tau
import sys
from threading import Event
from time import monotonic, monotonic_ns, sleep, time_ns
from typing import Any, ClassVar, TypeVar

from linkage_ros.messages import JointStateWriter, NANOSECONDS
from linkage_ros.node.pacing import ClockGuard
from linkage_ros.node.parameters import declare_parameters, NodeParameter, show_help
from linkage_ros.node.real_time import leave_out_shared_memory
from linkage_ros.signals import bounded_end
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

_SECONDS = NodeParameter('seconds', 0.0, 'How long [s]; 0 for ever', (0.0, 1e9))

AnyNode = TypeVar('AnyNode', bound=Node)

_LOOK = 0.1
_OLDEST = 0.1
"""Greatest age of a joint state that is still used, in [s]."""


class DemoNode(Node):
    """A node with `PARAMETERS`, which are fixed at its start."""

    PARAMETERS: ClassVar[tuple[NodeParameter, ...]]

    def __init__(self, name: str) -> None:
        super().__init__(name)
        declare_parameters(self, self.own_parameters())

    def own_parameters(self) -> Iterable[NodeParameter]:
        """Return the parameters to declare."""
        return self.PARAMETERS

    def value_of_parameter(self, name: str) -> Any:
        """Return the value of a parameter."""
        return self.get_parameter(name).value


def run_demo_node(
    name: str, make: Callable[[], AnyNode], run: Callable[[AnyNode, Event], None], stop: Event
) -> int:
    """Run a demo node in this process until the event is set, and return the exit code."""
    leave_out_shared_memory()
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        node = make()
    except Exception as error:  # noqa: BLE001 (rcl's errors have no common base class)
        print(f'{name}: {str(error).splitlines()[0]}; see {name} --help', file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    run(node, stop)
    with bounded_end(0):
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


_OF_EACH_JOINT = (
    NodeParameter(
        'target', 2.0, 'Target position [rad]; of one joint: JOINT.target, and so on', (-1e6, 1e6)
    ),
    NodeParameter('swing', 0.0, 'Amplitude about the target [rad]', (0.0, 1e6)),
    NodeParameter('period', 5.0, 'Of the swing [s]', (1e-3, 1e6)),
    NodeParameter('kp', 1.0, 'Effort for each unit of error [N·m/rad]', (0.0, 1e9)),
    NodeParameter('kd', 0.05, "Effort for each unit of the error's rate [N·m·s/rad]", (0.0, 1e9)),
)


@dataclass(slots=True)
class ControlledJoint:
    """A joint under a PD law, with its state as last heard; see the module."""

    target: float
    swing: float
    period: float
    kp: float
    kd: float
    position: float = 0.0
    rate: float = 0.0
    last_heard: float = -inf  # [s], of the monotonic clock

    def effort_at(self, t: float) -> float:
        """Return the effort at a time since the start, in [s]."""
        frequency = tau / self.period
        target = self.target + self.swing * sin(frequency * t)
        target_rate = self.swing * frequency * cos(frequency * t)
        return self.kp * (target - self.position) + self.kd * (target_rate - self.rate)


class PDController(DemoNode):
    """Commands the efforts of joints."""

    PARAMETERS = (
        NodeParameter('joints', ['crank_joint'], 'Names of the joints'),
        NodeParameter('rate', 500.0, 'Commands a second [Hz]', (0.1, 20_000.0)),
        *_OF_EACH_JOINT,
        _SECONDS,
    )

    def __init__(self) -> None:
        super().__init__('pd_controller')
        self._joints = {
            joint: ControlledJoint(
                *(
                    self.value_of_parameter(f'{joint}.{parameter.name}')
                    for parameter in _OF_EACH_JOINT
                )
            )
            for joint in self.value_of_parameter('joints')
        }
        self._seconds = self.value_of_parameter('seconds')
        self._begin_time = self.get_clock().now()
        # Reliable, for any subscriber; depth 1, since only the newest command matters.
        self._publisher = self.create_publisher(JointState, 'crank_commands', 1)
        self.create_subscription(JointState, 'joint_states', self._on_joint_state, 10)
        self.create_timer(1.0 / self.value_of_parameter('rate'), self._publish_efforts)
        ClockGuard(self._time_source)

    def own_parameters(self) -> Iterator[NodeParameter]:
        """Yield the common parameters, and those of each joint, by default the common."""
        yield from self.PARAMETERS
        for joint in self.value_of_parameter('joints'):
            for common in _OF_EACH_JOINT:
                value = self.value_of_parameter(common.name)
                yield common._replace(name=f'{joint}.{common.name}', default=value)

    def _on_joint_state(self, message: JointState) -> None:
        """Store positions and rates of the joints."""
        # Array fields without values are empty, not None.
        for name, position, rate in zip(
            message.name, message.position, message.velocity, strict=False
        ):
            if (joint := self._joints.get(name)) is not None:
                joint.position, joint.rate, joint.last_heard = position, rate, monotonic()

    def _publish_efforts(self) -> None:
        """Publish the efforts of the joints that were heard."""
        now = self.get_clock().now()
        t = (now - self._begin_time).nanoseconds * 1e-9
        oldest = monotonic() - _OLDEST
        efforts = {
            name: joint.effort_at(t)
            for name, joint in self._joints.items()
            if joint.last_heard >= oldest
        }
        if efforts:
            message = JointState(name=[*efforts], effort=[*efforts.values()])
            message.header.stamp = now.to_msg()
            self._publisher.publish(message)

    def run(self, stop: Event) -> None:
        """Control until the event is set, or for the configured time."""
        executor = SingleThreadedExecutor()
        executor.add_node(self)
        end = monotonic() + (self._seconds or inf)
        while not stop.is_set() and monotonic() < end:
            executor.spin_once(timeout_sec=_LOOK)
        executor.shutdown()


def run_pd_controller(stop: Event) -> int:
    """Control until the event is set, or for the configured time, and return the exit code."""
    purpose = 'Reads joints from joint_states and commands their efforts on crank_commands.'
    if show_help('pd_controller', purpose, PDController.PARAMETERS, '-p target:=1.0'):
        return 0
    return run_demo_node('pd_controller', PDController, PDController.run, stop)


class CrankSource(DemoNode):
    """Publishes the angle of a turning crank."""

    PARAMETERS = (
        NodeParameter('joint', 'crank_joint', 'Name of the joint'),
        NodeParameter('rate', 500.0, 'Messages a second [Hz]', (0.1, 20_000.0)),
        NodeParameter('speed', tau, 'Mean speed [rad/s]', (-1e4, 1e4)),
        NodeParameter('ripple', 0.3, 'Swing of the speed, of its mean', (0.0, 1.0)),
        NodeParameter('start', 0.0, 'First angle [rad]', (-1e6, 1e6)),
        _SECONDS,
    )

    def __init__(self) -> None:
        super().__init__('crank_source')
        self._rate = self.value_of_parameter('rate')
        self._speed = self.value_of_parameter('speed')
        self._ripple = self.value_of_parameter('ripple')
        self._start = self.value_of_parameter('start')
        self._seconds = self.value_of_parameter('seconds')
        self._writer = JointStateWriter([self.value_of_parameter('joint')])
        # Reliable, as a broadcaster is: some subscribers refuse less, as joint_state_publisher.
        self._publisher = self.create_publisher(JointState, 'crank_states', 10)

    def run(self, stop: Event) -> None:
        """Publish until the event is set, or for the configured time."""
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
    """Publish a turning crank until the event is set, and return the exit code."""
    purpose = 'Publishes angle and rate of a turning crank on crank_states.'
    if show_help('crank_source', purpose, CrankSource.PARAMETERS, '-p speed:=3.0'):
        return 0
    return run_demo_node('crank_source', CrankSource, CrankSource.run, stop)
