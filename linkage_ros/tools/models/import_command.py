# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Make a linkage file of a URDF and the pins that close its loops.

Frames that are called PIN_on_LINK, as ``linkage urdf`` writes them, close by themselves, and so do
pins that simulators close loops by: the tags ``loop_joint`` and ``loop_constraint``, and joints of
``<gazebo>``, which are where they are with all joints at 0.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
from threading import Event

from linkage_ros.cli import add_output, LINKAGES, read_joint_value
from linkage_ros.description import (
    linkage_text,
    parse_yaml,
    read_linkage,
    read_urdf,
    read_urdf_file,
)
from linkage_ros.tools.models.from_urdf import linkage_from_urdf
from linkage_ros.tools.models.robot_model_command import write_or_print

EXAMPLE = 'linkage import four_bar.urdf --input crank_joint -o my_four_bar.yaml'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('file', type=Path, metavar='URDF', help='the URDF, or the output of xacro')
    parser.add_argument(
        '--close',
        action='append',
        type=_read_pair,
        default=[],
        metavar='FRAME=FRAME',
        help='links of the URDF whose origins meet in a pin, or places on them, LINK.x,y,z in '
        'metres; once for each pin',
    )
    parser.add_argument(
        '--input', action='append', default=[], metavar='JOINT', help='joint that is driven'
    )
    parser.add_argument(
        '--at',
        action='append',
        type=read_joint_value,
        default=[],
        metavar='JOINT=VALUE',
        help='value of a joint in a pose in which the loops close, in radians or metres '
        '(default: 0)',
    )
    parser.add_argument(
        '--no-limits', action='store_true', help='leave out the limits of the joints (<limit>)'
    )
    add_output(parser, LINKAGES, 'the linkage file is printed')


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """Write the linkage file; say what it leaves out."""
    file = arguments.file
    made = linkage_from_urdf(
        read_urdf(read_urdf_file(file), str(file)),
        arguments.close,
        arguments.input,
        dict(arguments.at),
        limits=not arguments.no_limits,
    )
    text = linkage_text(made.linkage, [f'Imported from {file.name} by linkage import.'])
    read_linkage(parse_yaml(text.encode(), f'{file}, as a linkage'))
    for part in made.left_out:
        print(f'left out: {part}', file=sys.stderr)
    write_or_print(text.encode(), arguments.output)
    return 0


def _read_pair(text: str) -> tuple[str, str]:
    one, equal, other = text.partition('=')
    if not (one and equal and other):
        raise argparse.ArgumentTypeError(f'{text!r} is not a pair; write FRAME=FRAME')
    return one, other
