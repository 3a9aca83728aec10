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


"""Calls of a node: its services, parameters and transitions, drawn without sense."""

from __future__ import annotations

from math import inf, nan
from random import Random
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger

SHUTDOWNS = {5, 6, 7}
"""Transitions that end a node for good; they do what they are asked for."""

_TRIGGERS = ('reset', 'start_recording', 'stop_recording', 'snapshot')
_PARAMETERS = (
    *('scene', 'autostart', 'runs_directory', 'diagnostics_period', 'warning_period'),
    *('warn.transmission_angle', 'warn.conditioning', 'use_sim_time', 'no_such', ''),
)
_NUMBERS = (nan, inf, -inf, -1.0, 0.0, 0.1, 1.0, 3600.0, 1e308)


class Calls:
    """
    Makes calls of one node.

    Parameters
    ----------
    node
        Who calls.
    name
        Full name of the node that is called.
    random
        Draws what is asked.

    """

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

    def any(self) -> tuple[str, Any]:
        """Call something; return what, and the future of its answer."""
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

    def by_the_machine(self) -> Any:
        """Ask it to go by the machine's clock again."""
        value = ParameterValue(type=1, bool_value=False)
        request = SetParameters.Request(parameters=[Parameter(name='use_sim_time', value=value)])
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
