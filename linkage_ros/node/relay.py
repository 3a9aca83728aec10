# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The relay: commands for other joints than the inputs in, commands for the inputs out.

=====================  ====================================  ======================
in                     type                                  out
=====================  ====================================  ======================
``joint_commands``     ``sensor_msgs/JointState``            ``crank_commands``
``joint_trajectory``   ``trajectory_msgs/JointTrajectory``   ``crank_trajectory``
=====================  ====================================  ======================

Given positions, velocities, accelerations and efforts are converted; efforts as those that do the
same work, without masses and friction. A command that no inputs reach is not sent; nor is a
trajectory with such a point. With several inputs a message names all of the joints that are
commanded instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isfinite
from threading import Event
from time import monotonic
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from linkage_ros.description import load_scene, Scene
from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics import Position, Status
from linkage_ros.node.demo_nodes import run_demo_node
from linkage_ros.node.parameters import declare_parameters, LINKAGE_NODE
from linkage_ros.stages.drives import ExchangedInputs, ExchangedMotion
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

PARAMETERS = tuple(
    parameter
    for parameter in LINKAGE_NODE
    if parameter.name in ('scene', 'set', 'diagnostics_period')
)
_LOOK = 0.1
_QUIET = 5.0
"""Least time between two warnings, in [s]; the diagnostics count all."""


class RefusedError(ValueError):
    """A command that has no crank; its text says which value, and why."""


class CommandRelay:
    """
    Turns commands for other joints of a scene's linkages into commands for their inputs.

    DefinitionError if no linkage of the scene names such joints, or if they do not determine its
    inputs.
    """

    def __init__(self, scene: Scene) -> None:
        self._lines = [
            _Line(
                ExchangedInputs(
                    linkage.closure, linkage.instead_of_inputs, linkage.drive[1].branch
                ),
                linkage.sampled_joints,
                linkage.input_names,
            )
            for linkage in scene.linkages
            if linkage.instead_of_inputs
        ]
        if not self._lines:
            raise DefinitionError(
                'drive.topic.joint', 'names no dependent joint', 'name the one that is commanded'
            )

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the joints whose commands it takes."""
        return tuple(name for line in self._lines for name in line.joints)

    def turn_state(self, message: JointState) -> JointState | None:
        """Return the command for the inputs of the joints that a message names; None if none."""
        names = [name for name in message.name if name in self.joint_names]
        if not names:
            return None
        lines = self._lines_of(names)
        places = [list(message.name).index(name) for name in names]
        rows = [
            [array[place] for place in places] if len(array) == len(message.name) else []
            for array in (message.position, message.velocity, message.effort)
        ]
        positions, velocities, _, efforts = _input_arrays(lines, names, *rows[:2], [], rows[2])
        return JointState(
            header=message.header,
            name=[name for line in lines for name in line.inputs],
            position=positions,
            velocity=velocities,
            effort=efforts,
        )

    def turn_trajectory(self, message: JointTrajectory) -> JointTrajectory:
        """Return the trajectory of the inputs."""
        names = list(message.joint_names)
        strange = [name for name in names if name not in self.joint_names]
        if strange:
            raise RefusedError(
                f'names {list_names(strange)}; send {list_names(self.joint_names)} only'
            )
        lines, points = self._lines_of(names), []
        for number, point in enumerate(message.points, 1):
            try:
                rows = point.positions, point.velocities, point.accelerations, point.effort
                arrays = _input_arrays(lines, names, *rows)
            except RefusedError as error:
                raise RefusedError(f'point {number} of {len(message.points)}: {error}') from None
            points.append(
                JointTrajectoryPoint(
                    positions=arrays[0],
                    velocities=arrays[1],
                    accelerations=arrays[2],
                    effort=arrays[3],
                    time_from_start=point.time_from_start,
                )
            )
        inputs = [name for line in lines for name in line.inputs]
        return JointTrajectory(header=message.header, joint_names=inputs, points=points)

    def _lines_of(self, names: Sequence[str]) -> list[_Line]:
        """Return the linkages whose joints a message names, in its order."""
        named = (line for name in names for line in self._lines if name in line.joints)
        lines = [*{line.joints: line for line in named}.values()]
        for line in lines:
            if missing := [joint for joint in line.joints if joint not in names]:
                own = list_names(joint for joint in line.joints if joint in names)
                raise RefusedError(f'names {own} without {list_names(missing)}; send all')
        return lines


def _input_arrays(
    lines: Sequence[_Line], names: Sequence[str], *rows: Sequence[float]
) -> list[list[float]]:
    """Return positions, velocities, accelerations and efforts of inputs, as far as given."""
    positions, *others = rows
    if len(positions) != len(names):
        raise RefusedError(f'{len(positions)} positions for {len(names)} joints')
    if not {len(row) for row in others} <= {0, len(names)}:
        raise RefusedError('arrays of unequal length')
    named_rows = [dict(zip(names, row, strict=False)) for row in rows]
    motions = [
        line.motion_at(*([of[name] for name in line.joints if of] for of in named_rows))
        for line in lines
    ]
    return [
        [value for motion in motions for value in motion[order]] if of else []
        for order, of in enumerate(named_rows)
    ]


class _Line(NamedTuple):
    """A linkage with the joints that are commanded instead of its inputs, with prefixes."""

    exchange: ExchangedInputs
    joints: tuple[str, ...]
    inputs: tuple[str, ...]

    def motion_at(
        self,
        values: list[float],
        rates: list[float],
        accelerations: list[float],
        efforts: list[float],
    ) -> ExchangedMotion:
        """Return the inputs with rates, accelerations and efforts: NaN where a joint's are."""
        exchange = self.exchange
        position = exchange.find_position(values)
        if position is None or position.status is Status.LIMITED:
            places = ', '.join(
                f'{name} at {value:.6g} {driven.unit}'
                for name, value, driven in zip(
                    self.joints, values, exchange.inverse.linkage.inputs, strict=True
                )
            )
            raise RefusedError(f'{places} is not reached: {self._reason(position)}')
        motion = exchange.motion_at(position, rates, accelerations)
        if efforts and all(map(isfinite, efforts)):
            if not (efforts_found := exchange.efforts_at(motion.inputs, efforts)):
                raise RefusedError(
                    f'an effort of {list_names(self.joints)} comes to none of the inputs there'
                )
            motion = motion._replace(efforts=efforts_found)
        if position.status is Status.TOGGLE:
            if any(isfinite(value) and value for value in (*rates, *accelerations)):
                joints = list_names(self.joints)
                raise RefusedError(f'{joints} turns back there: the crank has no rate')
            return motion._replace(rates=tuple(rates), accelerations=tuple(accelerations))
        return motion

    def _reason(self, position: Position | None) -> str:
        if position is not None:
            return f'beyond limits: {self.exchange.inverse.limit_exceeded(position)}'
        if (branch := self.exchange.branch) is not None:
            return f'it goes from {branch.low:.6g} to {branch.high:.6g}'
        return 'no inputs lead there in the assembly of the pose'


class RelayNode(Node):
    """The node; ``scene`` and ``settings`` stand for its parameters."""

    def __init__(self, scene: str = '', settings: Sequence[str] = ()) -> None:
        overrides = [Parameter('scene', value=scene)] if scene else []
        if settings:
            overrides.append(Parameter('set', value=list(settings)))
        super().__init__('linkage_relay', parameter_overrides=overrides)
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
            turned = turn(message)
        except RefusedError as error:
            self._counts['refused'] += 1
            self._last_refusal = str(error)
            text = f'{publisher.topic_name}: not sent: {error}'
            self.get_logger().warning(text, throttle_duration_sec=_QUIET)
            return
        if turned is None:
            self._counts['of other joints'] += 1
            return
        publisher.publish(turned)
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
