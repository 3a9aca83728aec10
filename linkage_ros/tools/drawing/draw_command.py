# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Draw a linkage in a pose, its range behind it, and next to it its joints over the input.

A spatial linkage is seen from a camera far away, with the z axis of its ground upward. Without
--azimuth and --elevation it stands where places of the linkage hide each other least.

With --reach the picture shows what joints reach instead, by lines at equal inputs.

A DXF holds the links as flat parts with holes instead, in millimetres, to be cut.
"""

from __future__ import annotations

import argparse
from math import radians
from pathlib import Path
from threading import Event
from typing import Any

from linkage_ros.cli import (
    add_at,
    add_file,
    add_output,
    add_robot,
    bounded_number,
    DEGREES,
    DisplayUnits,
    output_or,
    PICTURES,
    read_inputs,
    robot_of,
)
from linkage_ros.description import (
    atomic_write,
    find_closures,
    is_planar_file,
    linkage_content,
    linkage_text,
    parse_yaml,
    pose_text,
    read_any_closure,
    Section,
)
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import (
    Closure,
    COLOURS,
    prepare_view,
    reach_boxes,
    ReachBox,
    read_drawn_pose,
    SpaceClosure,
    usual_inputs,
)
from linkage_ros.names import picture_text
from linkage_ros.resources import named_file
from linkage_ros.tools.drawing.dxf import links_dxf
from linkage_ros.tools.drawing.figure import assemblies_picture, paint_picture
from linkage_ros.tools.drawing.painting import picture_settings, save_picture
import numpy as np
from numpy.typing import NDArray

EXAMPLE = 'linkage draw jansen_leg -o jansen_leg.svg --names'

_LINES, _STATES = 11, 61
"""Lines of equal inputs for each of them, the first and last at its limits; states on a line."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_file(parser)
    add_robot(parser)
    add_output(parser, (*PICTURES, '.dxf'), 'FILE.png in this folder')
    add_at(
        parser,
        'pose to draw: degrees, or the length of a slide in the unit of the file; further ones '
        'are drawn in light grey',
    )
    parser.add_argument(
        '--names', action='store_true', help='write the names of points, joints and links'
    )
    parser.add_argument(
        '--assemblies',
        action='store_true',
        help='draw each assembly that closes, with the pose for the file, which is printed too',
    )
    parser.add_argument(
        '--reach',
        action='store_true',
        help='draw what two joints reach within the limits of two inputs, or inputs within theirs',
    )
    add_camera(parser)


def add_camera(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments that say where a camera stands."""
    camera = parser.add_argument_group('camera, for a spatial linkage')
    camera.add_argument(
        '--azimuth',
        type=bounded_number(-360.0, 360.0),
        metavar='DEGREES',
        help='direction in which it stands, from x to y',
    )
    camera.add_argument(
        '--elevation',
        type=bounded_number(-90.0, 90.0),
        metavar='DEGREES',
        help='how far it stands above the x-y plane',
    )


def camera_of(arguments: argparse.Namespace, closure: Any) -> list[float | None]:
    """Return azimuth and elevation of the camera, in [rad]; a planar linkage has none."""
    angles = {option: getattr(arguments, option) for option in ('azimuth', 'elevation')}
    for option, angle in angles.items():
        if angle is not None and not isinstance(closure, SpaceClosure):
            raise LinkageError(f'--{option}', 'is of a spatial linkage', 'leave it out')
    return [None if angle is None else radians(angle) for angle in angles.values()]


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """Draw the linkage."""
    if arguments.reach:
        _check_reach(arguments)
    named = named_file(arguments.file, 'linkages')
    content = linkage_content(named, robot_of(arguments))
    is_dxf = arguments.output and arguments.output.suffix.lower() == '.dxf'
    # The sides of a planar file are all chosen, and need not be written.
    chosen = arguments.assemblies and is_planar_file(content)
    closure: Any = None if chosen else read_any_closure(content, named.stem)
    spatial = isinstance(closure, SpaceClosure)
    if spatial and (arguments.assemblies or is_dxf):
        remedies = [
            *(['leave --assemblies out'] if arguments.assemblies else []),
            *([f'write -o {arguments.output.with_suffix(".svg")}'] if is_dxf else []),
        ]
        reason = 'is a spatial linkage'
        if is_dxf:
            reason += ', whose links are no flat parts to be cut'
        raise LinkageError(arguments.file, reason, ', and '.join(remedies))
    camera = camera_of(arguments, closure)
    if arguments.assemblies:
        if not chosen:
            content = parse_yaml(linkage_text(closure.linkage).encode(), content.file)
        return _draw_assemblies(arguments, content)
    if is_dxf:
        atomic_write(arguments.output, links_dxf(closure))
        print(arguments.output)
        return 0
    units = arguments.angles = DEGREES.of_file(content.units)
    if arguments.reach:
        return _draw_reach(closure, arguments, units)
    typed = [read_inputs(closure.linkage, at, '--at', units) for at in arguments.at]
    pose, *ghosts = typed or [usual_inputs(closure)]
    name = Path(arguments.file).stem
    file = output_or(arguments, Path(f'{name}.png'))
    shown = prepare_view(closure, pose, ghosts)._replace(length=units.length)
    paint_picture(shown, name, file, names=arguments.names, camera=camera)
    print(file)
    return 0


def _check_reach(arguments: argparse.Namespace) -> None:
    """Refuse what says nothing of a picture of joints instead of links."""
    for option in ('at', 'names', 'assemblies', 'azimuth', 'elevation'):
        value = getattr(arguments, option)
        if value or isinstance(value, float):
            raise LinkageError(f'--{option}', 'says nothing with --reach', 'leave one of them out')
    if arguments.output and arguments.output.suffix.lower() == '.dxf':
        file = arguments.output.with_suffix('.svg')
        raise LinkageError(f'{arguments.output}', 'has the outlines of parts', f'write -o {file}')


def _draw_reach(closure: Closure, arguments: argparse.Namespace, units: DisplayUnits) -> int:
    """Draw what joints reach within limits."""
    file = output_or(arguments, Path(f'{Path(arguments.file).stem}_reach.png'))
    draw_reach(closure, file, units)
    print(file)
    return 0


def _draw_assemblies(arguments: argparse.Namespace, content: Section) -> int:
    """Draw all assemblies at the same inputs; one that is open there, at inputs of its own."""
    closures = list(find_closures(content, Path(arguments.file).stem).values())
    first = closures[0]
    units = arguments.angles = DEGREES.of_file(content.units)
    if arguments.at:
        pose = read_inputs(first.linkage, arguments.at[0], '--at', units)
        closed = [closure for closure in closures if closure.position(*pose).joints]
        # If it closes in no assembly there, `prepare_view` says so.
        views = [prepare_view(closure, pose) for closure in closed or [first]]
    else:
        pose = usual_inputs(first)
        views = [
            prepare_view(
                closure, pose if closure.position(*pose).joints else usual_inputs(closure)
            )
            for closure in closures
        ]
    views = [view._replace(length=units.length) for view in views]
    file = output_or(arguments, Path(f'{Path(arguments.file).stem}.png'))
    texts = [
        pose_text(
            view.closure.linkage, read_drawn_pose(view.closure, view.position), content.units
        )
        for view in views
    ]
    assemblies_picture(dict(zip(texts, views, strict=True)), file)
    for text in texts:
        print(text)
    print(file)
    return 0


def reach_lines(box: ReachBox) -> NDArray[np.float64]:
    """Return (2, lines, states, 2) values of two joints, where one input has a line's value."""
    values_at = box.values()
    lines = np.full((2, _LINES, _STATES, 2), np.nan)
    for index in np.ndindex(2, _LINES, _STATES):
        held, line, state = index
        parts = [line / (_LINES - 1), state / (_STATES - 1)]
        if values := values_at(parts[::-1] if held else parts):
            lines[index] = values[:2]
    return lines


def draw_reach(closure: Closure, file: Path, units: DisplayUnits) -> None:
    """
    Draw to a file what two joints reach; gaps are where the linkage does not close.

    A LinkageError says that no two inputs with limits move two joints.
    """
    pairs = (box for box in reach_boxes(closure) if len(box.limits) == 2 <= len(box.joints))
    box = next(pairs, None)
    if box is None:
        reason = 'has no two inputs with limits that move two joints'
        raise LinkageError(closure.name, reason, 'write limits of both inputs, or of two joints')
    unit_of = {name: joint.unit for name, joint in closure.linkage.named_joints.items()}
    first, second = (unit_of[name] for name in box.joints[:2])
    shown = reach_lines(box) * [units.convert(1.0, first), units.convert(1.0, second)]
    context = picture_settings()
    from matplotlib.figure import Figure  # local import: an extra, and slow to load

    with context:
        figure = Figure(figsize=(6.4, 5.6), dpi=110, layout='constrained')
        axes = figure.subplots()
        axes.set_title(picture_text(closure.name, 60), loc='left', fontsize=9)
        axes.set_xlabel(f'{picture_text(box.joints[0], 30)} [{units.name_unit(first)}]')
        axes.set_ylabel(f'{picture_text(box.joints[1], 30)} [{units.name_unit(second)}]')
        sweeps = zip(box.closure.input_names, box.limits, COLOURS, shown, strict=False)
        for name, limits, colour, lines in sweeps:
            unit = unit_of[name]
            low, high = (units.convert(end, unit) for end in (limits.low, limits.high))
            text = f'{picture_text(name, 30)}: {low:.4g} to {high:.4g} {units.name_unit(unit)}'
            _draw_lines(axes, lines, colour, text)
        axes.legend(loc='best', fontsize=7, title='limits, and tenths of them')
        save_picture(figure, file)


def _draw_lines(axes: Any, lines: NDArray[np.float64], colour: str, text: str) -> None:
    """Draw the lines of equal values of an input: those at its limits thick, and named."""
    for number, line in enumerate(lines):
        is_edge = number in (0, _LINES - 1)
        axes.plot(
            *line.T,
            color=colour,
            lw=2.0 if is_edge else 0.5,
            label=text if number == 0 else None,
        )
