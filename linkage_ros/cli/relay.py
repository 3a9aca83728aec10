# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Relay commands of other joints than the inputs to the inputs, as a ROS 2 node.

The scene names the joints, drive: {topic: {joint: NAME, branch: N}}, or --joint does. JointState
on joint_commands goes to crank_commands, JointTrajectory on joint_trajectory to
crank_trajectory, with efforts that do the same work. It ends by Ctrl-C.
"""

from __future__ import annotations

import argparse
from importlib import import_module
from threading import Event

from linkage_ros.cli.arguments import add_ros_arguments, add_set, bounded_number, SCENE_HELP
from linkage_ros.errors import missing_packages_reported

EXAMPLE = 'linkage relay four_bar --joint rocker_joint --branch 1 --seconds 5'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('scene', metavar='SCENE', help=SCENE_HELP)
    parser.add_argument(
        '--joint',
        action='append',
        default=[],
        metavar='NAME',
        help='the commanded joint; repeated, as many as there are inputs',
    )
    parser.add_argument(
        '--branch',
        type=bounded_number(0, 10_000, int),
        default=0,
        metavar='N',
        help='its branch, as in linkage check --branches; required if there are several and no '
        'pose',
    )
    add_set(parser)
    parser.add_argument(
        '--seconds',
        type=bounded_number(0.0, 1e9),
        default=0.0,
        metavar='SECONDS',
        help='duration; without it, until a signal',
    )
    add_ros_arguments(parser, 'remappings: -r OLD:=NEW')


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Relay until the event is set."""
    with missing_packages_reported():
        relay = import_module('linkage_ros.node.relay')
    settings = arguments.set
    if arguments.joint:
        topic = f'{{joint: [{", ".join(arguments.joint)}], branch: {arguments.branch}}}'
        settings = [f'drive={{topic: {topic}}}', *settings]
    return int(relay.run_relay(stop, arguments.scene, settings, arguments.seconds))
