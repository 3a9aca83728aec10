# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Write a robot whose URDF has loops as a linkage file, to edit; every command reads the URDF itself.

The file is planar if its links move in a plane across an axis of the link that the loops hang on.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
from threading import Event

from linkage_ros.cli import add_output, add_robot, LINKAGES, robot_of
from linkage_ros.description import linkage_text, parse_yaml, read_any_closure, urdf_content
from linkage_ros.tools.models.robot_model_command import write_or_print

EXAMPLE = 'linkage import four_bar.urdf --input crank_joint -o my_four_bar.yaml'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('file', type=Path, metavar='URDF', help='the URDF, or the output of xacro')
    add_robot(parser)
    add_output(parser, LINKAGES, 'the linkage file is printed')


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """Write the linkage file; say what it leaves out."""
    file = arguments.file
    linkage = read_any_closure(urdf_content(file, robot_of(arguments)), file.stem).linkage
    text = linkage_text(linkage, [f'Imported from {file.name} by linkage import.'])
    read_any_closure(parse_yaml(text.encode(), f'{file}, as a linkage'))
    for part in linkage.left_out:
        print(f'left out: {part}', file=sys.stderr)
    write_or_print(text.encode(), arguments.output)
    return 0
