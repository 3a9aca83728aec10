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


"""The node's parameters, declared with their units and bounds."""

from __future__ import annotations

from math import pi

from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    ParameterType,
)
from rclpy.node import Node
from rclpy.parameter import Parameter

_PERIOD = FloatingPointRange(from_value=0.1, to_value=3600.0)

_LIMITS = {
    'warn.transmission_angle': (0.0, pi / 2, 'Transmission angle [rad]'),
    'warn.conditioning': (1e-6, 1.0, 'Smallest singular value of the scaled loop Jacobian'),
    'warn.toggle_distance': (1e-3, 1e6, 'Input to the nearest toggle [rad or m]'),
}
"""Default, highest value and meaning."""


def declare_parameters(node: Node) -> None:
    """Declare the parameters of the linkage node; rclpy refuses values out of bounds."""
    for name, default, description in (
        ('scene', '', 'Path of the scene file'),
        ('runs_directory', '', "Folder of the bags; '' for the scene's own"),
    ):
        node.declare_parameter(
            name,
            default,
            ParameterDescriptor(
                type=ParameterType.PARAMETER_STRING, description=description, read_only=True
            ),
        )
    node.declare_parameter(
        'autostart',
        True,
        ParameterDescriptor(
            type=ParameterType.PARAMETER_BOOL,
            description='Whether the node configures and activates itself',
            read_only=True,
        ),
    )
    _declare_real_time(node)
    for name, default_period, description in (
        ('diagnostics_period', 1.0, 'Time between two diagnostics [s]'),
        ('warning_period', 5.0, 'Least time between two warnings of one kind [s]'),
    ):
        node.declare_parameter(
            name,
            default_period,
            ParameterDescriptor(
                type=ParameterType.PARAMETER_DOUBLE,
                description=description,
                floating_point_range=[_PERIOD],
                additional_constraints='may be changed at any time',
            ),
        )
    for name, (default_limit, highest, description) in _LIMITS.items():
        node.declare_parameter(
            name,
            default_limit,
            ParameterDescriptor(
                type=ParameterType.PARAMETER_DOUBLE,
                description=f'{description}, below which the diagnostics warn; 0: never',
                floating_point_range=[FloatingPointRange(from_value=0.0, to_value=highest)],
                additional_constraints='may be changed at any time',
            ),
        )


def _declare_real_time(node: Node) -> None:
    node.declare_parameter(
        'thread_priority',
        0,
        ParameterDescriptor(
            type=ParameterType.PARAMETER_INTEGER,
            description='Priority of the tick under SCHED_FIFO; 0: none',
            integer_range=[IntegerRange(from_value=0, to_value=99, step=1)],
            read_only=True,
        ),
    )
    node.declare_parameter(
        'cpu_affinity',
        Parameter.Type.INTEGER_ARRAY,  # rclpy cannot infer the type of an empty list
        ParameterDescriptor(
            type=ParameterType.PARAMETER_INTEGER_ARRAY,
            description='Numbers of the processors that may run the tick; not set: all',
            read_only=True,
        ),
    )
    node.declare_parameter(
        'lock_memory',
        False,
        ParameterDescriptor(
            type=ParameterType.PARAMETER_BOOL,
            description='Whether the memory of the process stays in that of the machine',
            read_only=True,
        ),
    )


def nearness_limits(node: Node) -> dict[str, float]:
    """Return the warning threshold of each singularity measure."""
    return {name.removeprefix('warn.'): float(node.get_parameter(name).value) for name in _LIMITS}
