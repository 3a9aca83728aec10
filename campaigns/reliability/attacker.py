# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
``python -m campaigns.reliability.attacker SECONDS SEED SCENE``: a node that attacks another one.

First come floods of messages, as many and as large as possible, then calls of services, parameters
and transitions in any order.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import partial
import json
from math import inf, nan
from pathlib import Path
from random import Random
import sys
import time
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from linkage_ros.description import load
from linkage_ros.messages import JointStateReader, JointStateWriter
from linkage_ros.resources import shipped_path
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

SHUTDOWNS = {5, 6, 7}
"""Transitions that shut a node down; they are not tried."""

_TRIGGERS = ('reset', 'start_recording', 'stop_recording', 'snapshot')
_PARAMETERS = (
    *(
        'scene',
        'set',
        'scene_directory',
        'trust_effects',
        'autostart',
        'runs_directory',
        'diagnostics_period',
        'warning_period',
    ),
    *('warn.transmission_angle', 'warn.conditioning', 'use_sim_time', 'no_such', ''),
)
_NUMBERS = (nan, inf, -inf, -1.0, 0.0, 0.1, 1.0, 3600.0, 1e308)


class Calls:
    """Calls the services of a node with random requests."""

    def __init__(self, node: Node, name: str, random: Random) -> None:
        self._random = random
        kinds: dict[str, Any] = {
            **dict.fromkeys(_TRIGGERS, Trigger),
            'inject/mute': SetBool,
            'change_state': ChangeState,
            'get_state': GetState,
            'set_parameters': SetParameters,
            'set_parameters_atomically': SetParametersAtomically,
            'get_parameters': GetParameters,
            'describe_parameters': DescribeParameters,
            'list_parameters': ListParameters,
        }
        self._kinds = kinds
        self._clients = {
            service: node.create_client(kind, f'{name}/{service}')
            for service, kind in kinds.items()
        }

    def pick(self) -> tuple[str, Any]:
        """Call a random service; return its name and the future of its response."""
        random = self._random
        service = random.choice(sorted(self._clients))
        request = self._kinds[service].Request()
        if service == 'change_state':
            numbers = [1, 2, 3, 4] * 30 + [n for n in range(256) if n not in SHUTDOWNS]
            request.transition = Transition(id=random.choice(numbers))
        elif service == 'inject/mute':
            request.data = random.random() < 0.5
        elif service.startswith('set_parameters'):
            request.parameters = [self._parameter() for _ in range(random.randrange(4))]
        elif service in ('get_parameters', 'describe_parameters'):
            request.names = random.choices(_PARAMETERS, k=random.randrange(4))
        elif service == 'list_parameters':
            request.prefixes, request.depth = random.choices(_PARAMETERS, k=2), 2**63
        return service, self._clients[service].call_async(request)

    def transition(self, number: int) -> Any:
        """Ask for a transition."""
        request = ChangeState.Request(transition=Transition(id=number))
        return self._clients['change_state'].call_async(request)

    def state(self) -> Any:
        """Ask for the state."""
        return self._clients['get_state'].call_async(GetState.Request())

    def restore(self, scene: Path) -> Any:
        """Ask the node to use the system clock and its own scene again."""
        clock = ParameterValue(type=1, bool_value=False)
        named = ParameterValue(type=4, string_value=str(scene))
        request = SetParameters.Request(
            parameters=[
                Parameter(name='use_sim_time', value=clock),
                Parameter(name='scene', value=named),
            ]
        )
        return self._clients['set_parameters'].call_async(request)

    def _parameter(self) -> Parameter:
        random = self._random
        value = ParameterValue(
            type=random.choice((0, 1, 2, 3, 4, 5, 9, 10, 77, 255)),
            bool_value=random.random() < 0.5,
            integer_value=random.randrange(-(2**63), 2**63),
            double_value=random.choice(_NUMBERS),
            string_value='x' * random.choice((0, 1, 1_000_000)),
        )
        return Parameter(name=random.choice(_PARAMETERS), value=value)


GOOD, BAD = 0.5, 2.0
"""The angle of all valid messages, and of invalid ones, in [rad]."""

LARGEST = 60_000
"""Number of joints of the largest messages, of 2.8 MB."""

_CRANK = 'crank_joint'
_PATIENCE = 20.0  # for each answer of the node [s]


def crank(angle: float, *, joints: int = 1, rate: float = 0.0) -> bytes:
    """Return a serialized message of the crank with a number of joints, stamped now."""
    names = [_CRANK, *(f'joint_with_a_long_name_{index}' for index in range(1, joints))]
    return JointStateWriter(names).write(time.time_ns(), [angle] * joints, [rate] * joints)


def malformed(random: Random) -> bytes:
    """Return an invalid crank message, of any size."""
    joints = int(LARGEST ** random.random())
    message = crank(BAD, joints=joints)
    kind = random.randrange(7)
    if kind == 0:
        return message[: random.randrange(len(message) - 8)]
    if kind == 1:
        return random.randbytes(int(2.8e6 ** random.random()))
    if kind == 2:  # a count larger than the sequence
        at, after = 20, 24  # behind an empty frame_id
        count = random.randrange(joints + 1, 2**32).to_bytes(4, 'little')
        return message[:at] + count + message[after:]
    if kind == 3:
        return (
            message[:4]
            + (-random.randrange(1, 2**31)).to_bytes(4, 'little', signed=True)
            + (message[8:])
        )
    if kind == 4:
        return crank(random.choice((nan, inf, -inf, 1e11, 1.7e308)), joints=joints)
    if kind == 5:
        return crank(BAD, joints=joints, rate=random.choice((inf, -inf, 1e300)))
    names = [f'of_somebody_else_{index}' for index in range(joints)]
    return JointStateWriter(names).write(time.time_ns(), [BAD] * joints, [0.0] * joints)


class Attacker:
    """The attacking node."""

    def __init__(self, seconds: float, seed: int, scene: Path) -> None:
        rclpy.init()
        self._scene = scene
        self.node = Node('attacker')
        self._spin = partial(rclpy.spin_once, self.node)
        self.findings: list[str] = []
        self.tried: Counter[str] = Counter()
        self._seconds = seconds
        self._random = Random(seed)
        self._publisher = self.node.create_publisher(JointState, 'crank_states', 100)
        self._calls = Calls(self.node, '/linkage_node', self._random)
        self._heard = 0
        closure = load(shipped_path('linkages/four_bar.yaml'))
        self._reader = JointStateReader(closure.joint_names)
        self._pose = closure.position(GOOD).joints
        self.node.create_subscription(JointState, 'joint_states', self._hear, 100, raw=True)

    def run(self) -> None:
        """Attack, and check that the node still works."""
        self._wait(lambda: self._publisher.get_subscription_count() > 0, 'no node to attack')
        self._check_ticks()
        self.tried['first messages'] = self.tried['messages']
        self._flood(0.3 * self._seconds, lambda: crank(GOOD))
        self._flood(0.3 * self._seconds, self._valid_or_not)
        self._check_ticks()
        self.tried['messages of the floods'] = self.tried['messages']
        if not self.findings:
            self._reactivate()  # the node logs its counts
            self._storm(0.4 * self._seconds)
            self._spin_empty()
            self._reactivate()
            self._check_ticks()

    def _hear(self, message: bytes) -> None:
        self._heard += 1
        state = self._reader.read(message)
        angles = getattr(state, 'angles', ())
        off = [a - b for a, b in zip(angles, self._pose, strict=False)]
        if len(angles) != len(self._pose) or any(not abs(each) < 1e-9 for each in off):
            self.findings.append(f'a joint state that belongs to no crank message: {state}'[:200])

    def _send(self, message: bytes) -> None:
        self._publisher.publish(message)
        self.tried['messages'] += 1
        self.tried['bytes'] += len(message)

    def _wait(self, condition: Callable[[], Any], finding: str) -> None:
        end = time.monotonic() + _PATIENCE
        while not condition():
            if time.monotonic() > end:
                self.findings.append(finding)
                return
            self._spin(timeout_sec=0.01)

    def _check_ticks(self) -> None:
        """Send valid samples slowly until new joint states arrive."""
        time.sleep(0.2)
        self._spin_empty()
        heard = self._heard
        self._wait(
            lambda: self._sent_slowly() and self._heard > heard + 5,
            'the node does not tick',
        )

    def _sent_slowly(self) -> bool:
        self._send(crank(GOOD))
        time.sleep(0.02)
        return True

    def _spin_empty(self) -> None:
        for _ in range(200):
            self._spin(timeout_sec=0.0)

    def _flood(self, seconds: float, make: Callable[[], bytes]) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            message = make()
            for _ in range(100 if len(message) < 1000 else 1):
                self._send(message)
            self._spin(timeout_sec=0.0)

    def _valid_or_not(self) -> bytes:
        if self._random.random() < 0.3:
            joints = int(LARGEST ** self._random.random())
            return crank(GOOD, joints=joints)
        return malformed(self._random)

    def _storm(self, seconds: float) -> None:
        """Call all services in random order, 50 at once."""
        waiting: list[Any] = []
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if len(waiting) < 50:
                name, future = self._calls.pick()
                self.tried[name] += 1
                waiting.append(future)
            else:  # some get no response: rclpy raises for parameters without a type
                waiting.pop(0)
            self._send(crank(GOOD))
            self._spin(timeout_sec=0.001)
            waiting = [future for future in waiting if not future.done()]

    def _reactivate(self) -> None:
        """Deactivate the node if it is active, and activate it again, from any state."""
        calls = self._calls

        def ask(future: Any, finding: str) -> Any:
            self._wait(future.done, finding)
            return future.result() if future.done() else None

        for number in (4, 2, 1, 3):  # deactivate, clean up, configure, activate
            if number == 1:
                ask(calls.restore(self._scene), 'no answer to a parameter')
            ask(calls.transition(number), f'no answer to transition {number}')
        state = ask(calls.state(), 'no answer to get_state')
        if state is None or state.current_state.label != 'active':
            self.findings.append(f'cannot be activated again: {state}')


def main() -> int:
    """Attack, and print the outcome."""
    attacker = Attacker(float(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3]))
    attacker.run()
    print(json.dumps({'findings': attacker.findings[:20], 'tried': attacker.tried}), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
