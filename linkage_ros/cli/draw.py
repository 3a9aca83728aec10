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


"""Draw a linkage in a pose, its range behind it, and beside it its joints over the input."""

from __future__ import annotations

import argparse
from pathlib import Path
from threading import Event

from linkage_ros.cli.arguments import add_at, inputs
from linkage_ros.drawing.figure import picture, view
from linkage_ros.files.linkage_file import load
from linkage_ros.kinematics.sweep_analysis import usual_inputs


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('file', help='the linkage file')
    parser.add_argument(
        '-o', '--output', type=Path, help='PNG, SVG or PDF; without it FILE.png in this folder'
    )
    add_at(
        parser,
        'pose to draw, in degrees, or metres for a slide; further ones are drawn in light grey',
    )
    parser.add_argument('--names', action='store_true', help='write the names of pins and links')


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """Draw the linkage."""
    closure = load(arguments.file)
    typed = [inputs(closure.linkage, at, '--at') for at in arguments.at]
    pose, *ghosts = typed or [usual_inputs(closure)]
    name = Path(arguments.file).stem
    file = arguments.output or Path(f'{name}.png')
    picture(view(closure, pose, ghosts), name, file, names=arguments.names)
    print(file)
    return 0
