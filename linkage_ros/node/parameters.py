# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The parameters of the nodes: declarations with units and bounds, help, warnings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from math import pi
import sys
from textwrap import fill
from typing import Any, NamedTuple

from linkage_ros.errors import did_you_mean, list_names
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

_PERIOD = 0.1, 3600.0
"""Bounds of a period, in [s]."""

_ANY_TIME = 'may be changed at any time'
_UNCONFIGURED = 'may be changed while the node is unconfigured'


class NodeParameter(NamedTuple):
    """A parameter of a node."""

    name: str  # Name
    default: Any  # Default
    meaning: str  # Meaning with its unit, for the descriptor and ``--help``
    bounds: tuple[float, float] | None = None  # Least and greatest value; None for no bounds
    changeable: str = ''  # When it may be changed, as a remark; '' for never


_LIMITS = tuple(
    NodeParameter(
        f'warn.{measure}',
        default,
        f'{meaning}, below which the diagnostics warn; 0: never',
        (0.0, highest),
        changeable=_ANY_TIME,
    )
    for measure, default, highest, meaning in (
        ('transmission_angle', 0.0, pi / 2, 'Transmission angle [rad]'),
        ('conditioning', 1e-6, 1.0, 'Smallest singular value of the scaled loop Jacobian'),
        ('toggle_distance', 1e-3, 1e6, 'Input to the nearest toggle [rad or m]'),
    )
)

LINKAGE_NODE = (
    NodeParameter(
        'scene',
        '',
        'Scene file or linkage file, or the name of a shipped one',
        changeable=_UNCONFIGURED,
    ),
    NodeParameter(
        'set',
        # Not empty: rclpy cannot tell the type of an empty list, nor read one from a file. And one
        # parameter without a value makes it answer a request for all with none.
        [''],
        "Keys of the scene to set, as rate=500; '': none",
        changeable=_UNCONFIGURED,
    ),
    NodeParameter('runs_directory', '', "Folder of the bags; '' for the scene's own"),
    NodeParameter(
        'model_joints',
        False,
        'Whether all joints of the robot model are published, as with model_joints in the scene',
    ),
    NodeParameter(
        'scene_directory',
        '',
        "Folder below which a scene may name files if it is set after the start; '': the working "
        'directory',
    ),
    NodeParameter(
        'trust_effects',
        False,
        'Whether a scene that is set after the start may import user-defined effects',
    ),
    NodeParameter('autostart', True, 'Whether the node configures and activates itself'),
    NodeParameter('thread_priority', 0, 'Priority of the tick under SCHED_FIFO; 0: none', (0, 99)),
    NodeParameter(
        'cpu_affinity', [-1], 'Numbers of the processors that may run the tick; -1: all'
    ),
    NodeParameter('lock_memory', False, 'Whether the memory of the process is locked in RAM'),
    NodeParameter(
        'diagnostics_period',
        1.0,
        'Time between two diagnostics [s]',
        _PERIOD,
        changeable=_ANY_TIME,
    ),
    NodeParameter(
        'warning_period',
        5.0,
        'Least time between two warnings of one kind [s]',
        _PERIOD,
        changeable=_ANY_TIME,
    ),
    *_LIMITS,
)
"""The parameters of the linkage node."""

SET_BEFORE_CONFIGURATION = frozenset(
    parameter.name for parameter in LINKAGE_NODE if parameter.changeable == _UNCONFIGURED
)


def declare_parameters(node: Node, parameters: Iterable[NodeParameter]) -> None:
    """
    Declare parameters; rclpy refuses values out of bounds. Warn of unknown ones.

    Each is declared before the next is asked for, which may depend on its value.
    """
    overrides = node._parameter_overrides  # noqa: SLF001 (rclpy has no other way)
    names = []
    for name, default, meaning, bounds, changeable in parameters:
        if name in overrides and overrides[name].type_ is Parameter.Type.NOT_SET:
            del overrides[name]  # an empty list in a file
        descriptor = ParameterDescriptor(description=meaning, read_only=not changeable)
        descriptor.additional_constraints = changeable
        if bounds is not None:
            low, high = bounds
            if isinstance(default, float):
                descriptor.floating_point_range = [
                    FloatingPointRange(from_value=low, to_value=high)
                ]
            else:
                descriptor.integer_range = [IntegerRange(from_value=low, to_value=high, step=1)]
        node.declare_parameter(name, default, descriptor)
        names.append(name)
    for name in overrides:
        # Qualities of service are declared with their publisher.
        if not node.has_parameter(name) and not name.startswith('qos_overrides.'):
            remedy = did_you_mean(name, names, f'known: {list_names(names)}')
            node.get_logger().warning(f'parameter {name}: unknown, and without effect; {remedy}')


def nearness_limits(node: Node) -> dict[str, float]:
    """Return the warning threshold of each singularity measure."""
    return {
        limit.name.removeprefix('warn.'): float(node.get_parameter(limit.name).value)
        for limit in _LIMITS
    }


def show_help(program: str, purpose: str, declared: Sequence[NodeParameter], example: str) -> bool:
    """
    Print the help of a node's program if its command line asks for it; return whether it does.

    A ``--help`` among the arguments for ROS does not count.
    """
    typed = sys.argv[1:]
    if '--ros-args' in typed:
        typed = typed[: typed.index('--ros-args')]
    if not {'--help', '-h'} & {*typed}:
        return False
    print('\n'.join(_help_lines(program, purpose, declared, example)))
    return True


def _help_lines(
    program: str, purpose: str, declared: Sequence[NodeParameter], example: str
) -> Iterator[str]:
    command = f'ros2 run linkage_ros {program}'
    yield f'usage: {command} [-h] [--ros-args -p NAME:=VALUE -r OLD:=NEW ...]'
    yield f'\n{purpose}\n\nparameters:'
    width = max(len(parameter.name) for parameter in declared) + 4
    for name, default, meaning, bounds, changeable in declared:
        facts = [meaning, f'default {default!r}']
        if bounds is not None:
            facts.append(f'{bounds[0]:g} to {bounds[1]:g}')
        if changeable:
            facts.append(changeable)
        head = f'  {name}'.ljust(width)
        yield fill('; '.join(facts), 96, initial_indent=head, subsequent_indent=' ' * width)
    yield f'\nexample:\n  {command} --ros-args {example}'
