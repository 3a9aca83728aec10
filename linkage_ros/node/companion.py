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


"""What the small nodes have in common that run beside the linkage's own, for demos and tests."""

from __future__ import annotations

from collections.abc import Callable
import sys
from threading import Event
from typing import TypeVar

from linkage_ros.node.transports import leave_out_shared_memory
from linkage_ros.signals import bounded_end
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions


class Companion(Node):
    """A node whose parameters are numbers within bounds, and the name of a joint."""

    def joint(self) -> str:
        """Declare and return the name of the joint."""
        descriptor = ParameterDescriptor(description='Name of the joint', read_only=True)
        return str(self.declare_parameter('joint', 'crank_joint', descriptor).value)

    def number(
        self, name: str, default: float, description: str, least: float, most: float
    ) -> float:
        """Declare and return a number; rclpy itself refuses one that is out of bounds."""
        bounds = FloatingPointRange(from_value=least, to_value=most)
        descriptor = ParameterDescriptor(
            description=description, read_only=True, floating_point_range=[bounds]
        )
        return float(self.declare_parameter(name, default, descriptor).value)


AnyNode = TypeVar('AnyNode', bound=Node)


def run_companion(
    name: str, make: Callable[[], AnyNode], run: Callable[[AnyNode, Event], None], stop: Event
) -> int:
    """
    Run a node of its own process, and return the exit code.

    Parameters
    ----------
    name
        What messages call it.
    make
        Makes the node.
    run
        Runs it until the event.
    stop
        Ends the run.

    """
    leave_out_shared_memory()
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        node = make()
    except Exception as error:  # noqa: BLE001 (rcl's errors have no common root)
        print(f'{name}: {str(error).splitlines()[0]}; see the README', file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    run(node, stop)
    with bounded_end():
        node.destroy_node()
        rclpy.try_shutdown()
    return 0
