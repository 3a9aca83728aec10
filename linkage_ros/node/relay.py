# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The relay: commands for a dependent joint in, commands for its crank out.

=====================  ====================================  ======================
in                     type                                  out
=====================  ====================================  ======================
``joint_commands``     ``sensor_msgs/JointState``            ``crank_commands``
``joint_trajectory``   ``trajectory_msgs/JointTrajectory``   ``crank_trajectory``
=====================  ====================================  ======================

Given positions, velocities and accelerations are converted; efforts are left out. A command
without a crank position is not sent; nor is a trajectory with such a point.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isfinite, nan
from threading import Event
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from linkage_ros.description import load_scene, Scene
from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics import Closure, CrankBranch, Status
from linkage_ros.node.demo_nodes import run_demo_node
from linkage_ros.node.parameters import declare_parameters, LINKAGE_NODE
from linkage_ros.stages.drives import sampled_branch
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

PARAMETERS = tuple(
    one for one in LINKAGE_NODE if one.name in ('scene', 'set', 'diagnostics_period')
)
_LOOK = 0.1
_QUIET = 5.0
"""Least time between two warnings, in [s]; the diagnostics count all."""


class RefusedError(ValueError):
    """A command that has no crank; its text says which value, and why."""


class CommandRelay:
    """
    Turns commands for dependent joints of a scene into commands for their cranks.

    DefinitionError if no linkage of the scene names such a joint, or if the joint does not
    determine the crank.
    """

    def __init__(self, scene: Scene) -> None:
        self._inverses: dict[str, tuple[Closure, CrankBranch, str]] = {}
        for scene_linkage in scene.linkages:
            if scene_linkage.dependent_joint:
                closure, joint = scene_linkage.closure, scene_linkage.dependent_joint
                branch = sampled_branch(closure, joint, scene_linkage.drive[1].branch)
                self._inverses[scene_linkage.sampled_joints[0]] = (
                    closure.driven_by(joint, branch=branch.number),
                    branch,
                    scene_linkage.input_names[0],
                )
        if not self._inverses:
            raise DefinitionError(
                'drive.topic.joint', 'names no dependent joint', 'name the one that is commanded'
            )

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the joints whose commands it takes."""
        return tuple(self._inverses)

    def turn_state(self, message: JointState) -> JointState | None:
        """Return the command for the cranks of the joints that a message names; None if none."""
        known = [name for name in message.name if name in self._inverses]
        if not known:
            return None
        places = [list(message.name).index(name) for name in known]
        rows = [
            [array[place] for place in places] if len(array) == len(message.name) else []
            for array in (message.position, message.velocity)
        ]
        positions, velocities, _ = self._crank_arrays(known, *rows, [])
        cranks = [self._inverses[name][-1] for name in known]
        return JointState(
            header=message.header, name=cranks, position=positions, velocity=velocities
        )

    def turn_trajectory(self, message: JointTrajectory) -> JointTrajectory:
        """Return the trajectory of the cranks."""
        names = list(message.joint_names)
        strange = [name for name in names if name not in self._inverses]
        if strange:
            raise RefusedError(
                f'names {list_names(strange)}; send {list_names(self.joint_names)} only'
            )
        points = []
        for number, point in enumerate(message.points, 1):
            try:
                found = self._crank_arrays(
                    names, point.positions, point.velocities, point.accelerations
                )
            except RefusedError as error:
                raise RefusedError(f'point {number} of {len(message.points)}: {error}') from None
            points.append(
                JointTrajectoryPoint(
                    positions=found[0],
                    velocities=found[1],
                    accelerations=found[2],
                    time_from_start=point.time_from_start,
                )
            )
        cranks = [self._inverses[name][-1] for name in names]
        return JointTrajectory(header=message.header, joint_names=cranks, points=points)

    def _crank_arrays(self, names: Sequence[str], *rows: Sequence[float]) -> list[list[float]]:
        """Return positions, velocities and accelerations of cranks, as far as they are given."""
        positions, velocities, accelerations = rows
        if len(positions) != len(names):
            raise RefusedError(f'{len(positions)} positions for {len(names)} joints')
        if not {len(velocities), len(accelerations)} <= {0, len(names)}:
            raise RefusedError('arrays of unequal length')
        columns = [
            self._crank_motion(
                name,
                positions[i],
                velocities[i] if velocities else nan,
                accelerations[i] if accelerations else nan,
            )
            for i, name in enumerate(names)
        ]
        turned = [list(row) for row in zip(*columns, strict=True)]
        return [row if given else [] for row, given in zip(turned, rows, strict=True)]

    def _crank_motion(
        self, joint: str, value: float, rate: float, change: float
    ) -> tuple[float, float, float]:
        """Return crank, rate and acceleration, NaN where the joint's is NaN."""
        inverse, branch, _ = self._inverses[joint]
        position = inverse.position(value)
        place = f'{joint} at {value:.6g} {inverse.linkage.inputs[0].unit}'
        # Beyond a toggle of the crank the joint goes on in another assembly.
        if not position.status.has_pose or branch.distance_beyond(value):
            ends = f'it goes from {branch.low:.6g} to {branch.high:.6g}'
            raise RefusedError(f'{place} is not reached: {ends}')
        crank = position.joints[0]
        if position.status is Status.TOGGLE:
            if any(isfinite(one) and one for one in (rate, change)):
                raise RefusedError(f'{place} turns back there: the crank has no rate')
            return crank, rate, change
        if not isfinite(rate):
            return crank, nan, nan
        velocity = inverse.velocity(position, rate)
        if not isfinite(change):
            return crank, velocity.joints[0], nan
        acceleration = inverse.acceleration(position, velocity, change)
        return crank, velocity.joints[0], acceleration.joints[0]


class RelayNode(Node):
    """The node; ``scene`` and ``settings`` stand for its parameters."""

    def __init__(self, scene: str = '', settings: Sequence[str] = ()) -> None:
        given = [Parameter('scene', value=scene)] if scene else []
        if settings:
            given.append(Parameter('set', value=list(settings)))
        super().__init__('linkage_relay', parameter_overrides=given)
        declare_parameters(self, PARAMETERS)
        file = self.get_parameter('scene').value
        if not file:
            raise DefinitionError('parameter scene', 'names no file', 'start with -p scene:=FILE')
        set_keys = [key for key in self.get_parameter('set').value if key]
        self.relay = CommandRelay(load_scene(file, settings=set_keys))
        self._counts = {'sent': 0, 'refused': 0, 'of other joints': 0}
        self._last_refusal = ''
        self._reported_refusals = 0
        self._states = self.create_publisher(JointState, 'crank_commands', 10)
        self._trajectories = self.create_publisher(JointTrajectory, 'crank_trajectory', 10)
        self.create_subscription(JointState, 'joint_commands', self._take_state, 10)
        self.create_subscription(JointTrajectory, 'joint_trajectory', self._take_trajectory, 10)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.create_timer(self.get_parameter('diagnostics_period').value, self._publish_counts)

    def _take_state(self, message: JointState) -> None:
        self._send_turned(self._states, self.relay.turn_state, message)

    def _take_trajectory(self, message: JointTrajectory) -> None:
        self._send_turned(self._trajectories, self.relay.turn_trajectory, message)

    def _send_turned(self, publisher: Any, turn: Any, message: Any) -> None:
        try:
            found = turn(message)
        except RefusedError as error:
            self._counts['refused'] += 1
            self._last_refusal = str(error)
            text = f'{publisher.topic_name}: not sent: {error}'
            self.get_logger().warning(text, throttle_duration_sec=_QUIET)
            return
        if found is None:
            self._counts['of other joints'] += 1
            return
        publisher.publish(found)
        self._counts['sent'] += 1

    def _publish_counts(self) -> None:
        """Publish the counts; a warning if something was refused since the last time."""
        refused = self._counts['refused'] > self._reported_refusals
        self._reported_refusals = self._counts['refused']
        status = DiagnosticStatus(
            level=DiagnosticStatus.WARN if refused else DiagnosticStatus.OK,
            name=f'{self.get_name()}: commands',
            message=f'not sent: {self._last_refusal}' if refused else 'all commands are sent',
            values=[KeyValue(key=key, value=str(count)) for key, count in self._counts.items()]
            + [KeyValue(key='last refused', value=self._last_refusal)],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)


def _spin_relay(node: RelayNode, stop: Event, seconds: float) -> None:
    print(f'relays commands of {list_names(node.relay.joint_names)}', flush=True)
    end = monotonic() + (seconds or inf)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while not stop.is_set() and monotonic() < end:
        executor.spin_once(timeout_sec=_LOOK)
    executor.shutdown()


def run_relay(
    stop: Event, scene: str = '', settings: Sequence[str] = (), seconds: float = 0.0
) -> int:
    """Relay until the event is set, or for some time in [s], and return the exit code."""

    def spin_until_stop(node: RelayNode, stop: Event) -> None:
        _spin_relay(node, stop, seconds)

    return run_demo_node(
        'linkage_relay', lambda: RelayNode(scene, settings), spin_until_stop, stop
    )
