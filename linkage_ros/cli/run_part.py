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


"""Run a scene as a ROS 2 node, with a live display and a summary at the end."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from math import inf
from pathlib import Path
from threading import Event

from linkage_ros.cli.run import Display
from linkage_ros.cli.summary import summary
from linkage_ros.node.node import LinkageNode
from linkage_ros.node.run import run_linkage_node
from linkage_ros.signals import heeded


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('scene', help='the scene file; or a linkage file, which it moves')
    add_run_arguments(parser)
    parser.add_argument(
        '--ros-args', nargs=argparse.REMAINDER, default=[], help='remappings, parameters, QoS'
    )


def add_run_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments that every run has."""
    parser.add_argument(
        '--seconds', type=_seconds, default=inf, help='how long; without it, until Ctrl-C'
    )
    parser.add_argument('--runs', default='', metavar='FOLDER', help="folder of the bags' folders")
    parser.add_argument('--plain', action='store_true', help='a line a second, no live display')


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Run the scene."""
    ros = ['--ros-args', *arguments.ros_args] if arguments.ros_args else []
    code, _ = run_scene(arguments.scene, arguments, stop, ros)
    return code


def run_scene(
    scene: str, arguments: argparse.Namespace, stop: Event, ros: Sequence[str] = ()
) -> tuple[int, Path | None]:
    """Run a scene; return the exit code and the bag."""
    bags: list[Path] = []

    def at_end(node: LinkageNode) -> None:
        bags.extend(recording.folder for recording in node.recording.ended)
        print(summary(node))

    with heeded():
        code = run_linkage_node(
            stop,
            ros,
            {'scene': scene, 'runs_directory': arguments.runs},
            seconds=arguments.seconds,
            view=Display(plain=arguments.plain),
            at_end=at_end,
        )
    return code, bags[-1] if bags else None


def _seconds(text: str) -> float:
    seconds = float(text)
    if not 0.0 < seconds < 1e9:
        raise argparse.ArgumentTypeError(f'{text} is not a time; write seconds, more than 0')
    return seconds
