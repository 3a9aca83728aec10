# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Animate a linkage through the range of its first input, next to its joints.

A turn begins at the usual pose; a limited range is shown there and back. A spatial linkage is seen
from a camera, as linkage draw sees it.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from threading import Event
from typing import Any

from linkage_ros.cli import (
    add_output,
    add_robot,
    output_or,
    robot_of,
    show_progress,
)
from linkage_ros.description import linkage_content, read_any_closure
from linkage_ros.kinematics import prepare_view, usual_inputs
from linkage_ros.resources import named_file
from linkage_ros.signals import StoppedError
from linkage_ros.tools.drawing import (
    add_camera,
    animate,
    AnimatedMotion,
    ANIMATION_KINDS,
    camera_of,
    check_kind,
    range_motion,
)

_TURN = 4.0
"""How long a range is shown, in [s]."""

EXAMPLE = 'linkage animate jansen_leg -o leg.gif'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('file', metavar='FILE', help='linkage file, or a name of linkage gallery')
    add_output(parser, ANIMATION_KINDS, 'FILE.gif in this folder')
    parser.add_argument(
        '--seconds',
        type=float,
        default=_TURN,
        metavar='SECONDS',
        help='how long it lasts (default: %(default)g)',
    )
    add_camera(parser)
    add_robot(parser)


def run(arguments: argparse.Namespace, stop: Event) -> int:
    """Animate it."""
    source = Path(arguments.file)
    file = output_or(arguments, Path(f'{source.stem}.gif'))
    check_kind(file)
    motion = _load_motion(arguments, source)
    with show_progress('pictures') as advance:

        def report_picture(done: int, of: int) -> None:
            if stop.is_set():
                raise StoppedError
            advance(done, of)

        animate(motion, file, report_picture)
    print(file)
    return 0


def _load_motion(arguments: argparse.Namespace, source: Path) -> AnimatedMotion:
    content = linkage_content(named_file(arguments.file, 'linkages'), robot_of(arguments))
    closure: Any = read_any_closure(content, source.stem)
    camera = camera_of(arguments, closure)
    shown = prepare_view(closure, usual_inputs(closure))._replace(length=content.units.length)
    return range_motion(shown, source.stem, arguments.seconds, camera)
