# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Write a scene as an FMU, for simulators and test benches without ROS.

It is an FMI 3.0 co-simulation FMU: the crank, or its torque, goes in, and the joints come out,
with the effects and faults of the scene. It runs where a Python with this package is installed.
"""

from __future__ import annotations

import argparse
from threading import Event

from linkage_ros.cli import add_output, add_set, SCENE_HELP
from linkage_ros.description import atomic_write, load_scene
from linkage_ros.tools.models.fmu import scene_fmu

EXAMPLE = 'linkage fmu four_bar -o four_bar.fmu'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('file', metavar='SCENE', help=SCENE_HELP)
    add_output(parser, ('.fmu',))
    add_set(parser)


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """Write the FMU."""
    atomic_write(arguments.output, scene_fmu(load_scene(arguments.file, arguments.set)))
    print(arguments.output)
    return 0
