# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The tests' own end of a ROS graph, in plain rclpy, and nodes as real processes.

Nothing of the package is used here: what a node says is seen as any other program would see it.
"""

from collections.abc import Callable, Sequence
import os
from pathlib import Path
import signal
import subprocess
import sys
from threading import Event, Thread
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter as ParameterMessage, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

PATIENCE = 20.0
"""How long anything is waited for, in [s]: on a loaded machine too, it comes much sooner."""

NS = 1_000_000_000


def wait_for(condition: Callable[[], Any], what: str, patience: float = PATIENCE) -> Any:
    """Return the condition's value as soon as it is true."""
    end = time.monotonic() + patience
    while not (value := condition()):
        assert time.monotonic() < end, f'waited {patience} s in vain for {what}'
        time.sleep(0.01)
    return value


def crank(
    angle: float, rate: float = 0.0, stamp: int | None = None, name: str = 'crank_joint'
) -> JointState:
    """Return a crank message; stamped with the time unless told otherwise."""
    message = JointState(name=[name], position=[angle], velocity=[rate])
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(
        time.time_ns() if stamp is None else stamp, NS
    )
    return message


def stamp_of(message: Any) -> int:
    return int(message.header.stamp.sec * NS + message.header.stamp.nanosec)


def node_of(context: rclpy.Context, name: str) -> Node:
    """Return a node without its type description service, which rclpy 7.1 may free twice."""
    without = Parameter('start_type_description_service', value=False)
    return Node(name, context=context, parameter_overrides=[without])


class Graph:
    """A node of the tests, spun on a thread of its own."""

    def __init__(self, domain: int) -> None:
        self.domain = domain
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = node_of(self._context, 'tester')
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._ending = Event()
        self._thread = Thread(target=self._spin, daemon=True)
        self._thread.start()
        self._others: list[Node] = []
        self.diagnostics: list[DiagnosticArray] = self.listen(DiagnosticArray, '/diagnostics')

    def _spin(self) -> None:
        while not self._ending.is_set():
            self._executor.spin_once(timeout_sec=0.05)

    def end(self) -> None:
        self._ending.set()
        self._thread.join()
        self._executor.shutdown()
        for node in (self.node, *self._others):
            node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def listen(self, kind: Any, topic: str) -> list[Any]:
        """Return a list to which every message on a topic will be appended."""
        heard: list[Any] = []
        self.node.create_subscription(kind, topic, heard.append, 1000)
        return heard

    def publisher(self, kind: Any, topic: str, node: str = '') -> Any:
        """Return a publisher, of the tests' node or of another one of that name."""
        owner = self.node
        if node:
            owner = node_of(self._context, node)
            self._others.append(owner)
        return owner.create_publisher(kind, topic, 100)

    def call(self, kind: Any, service: str, request: Any = None) -> Any:
        """Return what a service answers."""
        client = self.node.create_client(kind, service)
        try:
            assert client.wait_for_service(PATIENCE), f'no service {service}'
            future = client.call_async(kind.Request() if request is None else request)
            wait_for(future.done, f'an answer of {service}')
            return future.result()
        finally:
            self.node.destroy_client(client)

    def trigger(self, service: str) -> tuple[bool, str]:
        """Call one of the node's services; return its success and message."""
        answer = self.call(Trigger, f'/linkage_node/{service}')
        return answer.success, answer.message

    def change_state(self, transition: int) -> bool:
        """Ask the node for a transition; return whether it succeeded."""
        request = ChangeState.Request(transition=Transition(id=transition))
        success: bool = self.call(ChangeState, '/linkage_node/change_state', request).success
        return success

    def status(self, task: str) -> DiagnosticStatus | None:
        """Return the newest status of a task: tick, crank, loop closure or recording."""
        if not self.diagnostics:
            return None
        return next(
            status for status in self.diagnostics[-1].status if status.name.endswith(f': {task}')
        )

    def value(self, task: str, key: str) -> str:
        """Return the newest value of a task; '' where there is none."""
        status = self.status(task)
        return (
            next((pair.value for pair in status.values if pair.key == key), '') if status else ''
        )

    def next_status(self, task: str) -> DiagnosticStatus:
        """Return the next status of a task."""
        self.diagnostics.clear()
        return wait_for(lambda: self.status(task), 'diagnostics')

    def wait_for_level(self, task: str, level: bytes) -> DiagnosticStatus:
        """Return the first status of a task that has a level, of those still to come."""
        self.diagnostics.clear()
        return wait_for(
            lambda: (status := self.status(task)) and status.level == level and status,
            f'{task} at level {level!r}',
        )


class NodeProcess:
    """`linkage_node`, as a process."""

    def __init__(
        self,
        domain: int,
        folder: Path,
        *arguments: str,
        program: Sequence[str] = ('-m', 'linkage_ros.node.linkage_node'),
        **popen: Any,
    ) -> None:
        self._log = folder / f'node_{time.monotonic_ns()}.log'
        self._log_begin = 0
        self.graph: Graph | None = None
        """Where the process is one that tests share: the graph of the test that it runs for."""
        command = [sys.executable, *program, '--ros-args', *arguments]
        environment = os.environ | {
            'ROS_DOMAIN_ID': str(domain),
            'ROS_LOG_DIR': str(folder),
            'RCUTILS_COLORIZED_OUTPUT': '0',
            'PYTHONFAULTHANDLER': '1',  # where it has to be aborted, its log says where it was
        }
        with self._log.open('wb') as log:
            self.process = subprocess.Popen(
                command, cwd=folder, env=environment, stdout=log, stderr=log, **popen
            )

    @property
    def log(self) -> str:
        begin = self._log_begin
        return self._log.read_bytes()[begin:].decode()

    def wait_for_log(self, text: str) -> None:
        wait_for(lambda: text in self.log or self.process.poll() is not None, f'{text!r}')
        assert text in self.log, self.log

    def set_up(self, graph: Graph, scene: Path) -> None:
        """Give a node that is unconfigured a scene, and let it tick."""
        self.graph = graph
        self._log_begin = self._log.stat().st_size
        value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=str(scene))
        change = SetParameters.Request(parameters=[ParameterMessage(name='scene', value=value)])
        (result,) = graph.call(SetParameters, '/linkage_node/set_parameters', change).results
        assert result.successful, result.reason
        self._change_state(Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE)

    def clean_up(self) -> int:
        """Leave a node that tests share unconfigured for the next one, or end it; return 0."""
        try:
            if self.graph is not None and self.process.poll() is None:
                self._change_state(Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP)
            code = self.process.poll() or 0
        except AssertionError:
            self.graph = None
            code = self.end()
        self.graph = None
        return code

    def _change_state(self, *transitions: int) -> None:
        assert self.graph is not None
        for transition in transitions:
            assert self.graph.change_state(transition), self.log

    def end(self, number: int = signal.SIGINT) -> int:
        """Send a signal, and return the exit code; one that tests share is only cleaned up."""
        if self.graph is not None and number == signal.SIGINT:
            return self.clean_up()
        self.process.send_signal(number)
        try:
            return self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.send_signal(signal.SIGABRT)
            self.process.wait(PATIENCE)
            raise AssertionError(f'it did not end by signal {number}: {self.log}') from None

    def kill(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
