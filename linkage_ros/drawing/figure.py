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


"""A linkage painted by matplotlib: in a pose, and beside it its joints over the input."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees
from pathlib import Path
from typing import Any, NamedTuple

from linkage_ros.drawing.curves import Sweep, sweep
from linkage_ros.drawing.painting import (
    bar_size,
    COLOURS,
    corners,
    degree_step,
    GHOST,
    INK,
    LAYERS,
    NAME_INK,
    Names,
    outline,
    paint,
    save,
    settings,
)
from linkage_ros.drawing.shapes import Circle, Polygon, Shape, shapes, skeleton
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import GROUND
from linkage_ros.kinematics.results import InputRange, Position
from linkage_ros.kinematics.sweep_analysis import InputSweep

_GHOSTS = 5


class View(NamedTuple):
    """
    What a picture shows.

    Attributes
    ----------
    closure
        The linkage.
    inputs, position
        The pose that it is drawn in.
    ghosts
        Poses in the background.
    interval
        Range of the first input about the pose, the others held.
    sweep
        The linkage as it goes through that range.

    """

    closure: Closure
    inputs: tuple[float, ...]
    position: Position
    ghosts: tuple[Position, ...]
    interval: InputRange
    sweep: Sweep


def view(
    closure: Closure, inputs: tuple[float, ...], ghosts: Sequence[tuple[float, ...]] = ()
) -> View:
    """
    Prepare a picture.

    Parameters
    ----------
    closure
        The linkage.
    inputs
        The pose to draw, in [rad] or [m].
    ghosts
        Poses in the background; without them some of all over the range.

    Raises
    ------
    LinkageError
        Where a pose does not close.

    """
    position = _closed(closure, inputs)
    way = InputSweep(closure, inputs)
    value = inputs[0]
    # A pose beyond the limits lies in no range, and is drawn before the widest.
    interval = way.range_about(value) or way.widest_range
    interval = interval or InputRange(value, value, way.turning)
    if ghosts:
        behind = [_closed(closure, given) for given in ghosts]
    elif interval.whole:
        turn = interval.highest - interval.lowest
        behind = [way.position(value + turn * i / (_GHOSTS + 1)) for i in range(1, _GHOSTS + 1)]
    else:
        low, high = interval.lowest, interval.highest
        behind = [way.position(low + (high - low) * i / (_GHOSTS - 1)) for i in range(_GHOSTS)]
    return View(
        closure,
        inputs,
        position,
        tuple(ghost for ghost in behind if ghost.joints),
        interval,
        sweep(way, interval),
    )


def _closed(closure: Closure, inputs: tuple[float, ...]) -> Position:
    position = closure.position(*inputs)
    if not position.joints:
        ranges = InputSweep(closure, inputs).ranges
        near = ' or '.join(_ends_text(interval) for interval in ranges)
        held = ', the others held' if near and len(inputs) > 1 else ''
        raise LinkageError(
            _pose_text(closure, inputs),
            f'{position.status.value}, the links miss each other by {position.gap:.3g} m',
            f'closes from {near}{held}' if near else 'name another pose',
        )
    return position


def _ends_text(interval: InputRange) -> str:
    low, high = interval.lowest, interval.highest
    if interval.turning:
        return f'{degrees(low):.6g} to {degrees(high):.6g}°'
    return f'{low:.6g} to {high:.6g} m'


def _pose_text(closure: Closure, inputs: tuple[float, ...]) -> str:
    return ', '.join(
        f'{given.joint} {value:.4g} m' if given.slider else f'{given.joint} {degrees(value):.4g}°'
        for given, value in zip(closure.linkage.inputs, inputs, strict=True)
    )


def all_places(shown: View) -> list[complex]:
    """Return all places through which something goes, in [m]."""
    places = [place for path in shown.sweep.paths.values() for place in path]
    for position in (shown.position, *shown.ghosts):
        for line in skeleton(shown.closure, position):
            places += (line.start, line.end)
    return places


def symbol_size(shown: View) -> float:
    """Return half the width of a bar, in [m]: what suits the picture and its shortest link."""
    low, high = corners(all_places(shown))
    picture = abs(high - low)
    points = shown.closure.points(shown.position)
    bars = [
        abs(points[link, one] - points[link, other])
        for link, named in shown.closure.linkage.links.items()
        if link != GROUND
        for one in named
        for other in named
        if one < other and points[link, one] != points[link, other]
    ]
    shortest = min(bars, default=picture)
    return bar_size(picture, shortest)


def _beyond_text(shown: View) -> str:
    beyond = shown.closure.beyond(shown.position)
    return f' (limited: {beyond})' if beyond else ''


def picture(shown: View, title: str, file: Path, *, names: bool = False) -> None:
    """
    Paint a picture to a file.

    Raises
    ------
    LinkageError
        Where matplotlib is not installed, or the file cannot be written.

    """
    context = settings()
    from matplotlib.figure import Figure  # local import: an extra, and slow to load

    size = symbol_size(shown)
    drawn = shapes(shown.closure, shown.position, size, shown.sweep.travels)
    low, high = corners([*all_places(shown), *(p for shape in drawn for p in outline(shape))])
    margin = complex(3.0, 3.0) * size
    width, height = (high - low + 2.0 * margin).real, (high - low + 2.0 * margin).imag
    wide = min(max(4.9 * width / height, 3.0), 6.4)
    tall = min(max(wide * height / width, 3.2), 4.9)
    with context:
        figure = Figure(figsize=(wide + 4.9, tall + 0.5), dpi=110, layout='constrained')
        left, right = figure.subplots(1, 2, width_ratios=(wide, 4.2))
        left.set_title(
            f'{title}, {_pose_text(shown.closure, shown.inputs)}{_beyond_text(shown)}',
            loc='left',
            fontsize=9,
        )
        left.set_aspect('equal')
        left.set_xlim((low - margin).real, (high + margin).real)
        left.set_ylim((low - margin).imag, (high + margin).imag)
        left.set_xlabel('x [m]')
        left.set_ylabel('y [m]')
        left.tick_params(labelsize=7, width=0.5)
        for side in ('top', 'right'):
            left.spines[side].set_visible(False)
        paint_background(left, shown)
        paint(left, drawn)
        _joints(right, shown)
        if names:
            figure.draw_without_rendering()  # from here on a text has its size
            _names(left, shown, drawn, size)
        save(figure, file)


def paint_background(axes: Any, shown: View) -> None:
    """Paint poses in light grey, and the paths of the traced points dashed."""
    for position in shown.ghosts:
        for line in skeleton(shown.closure, position):
            axes.plot(
                [line.start.real, line.end.real],
                [line.start.imag, line.end.imag],
                color=GHOST,
                linewidth=1.0,
                marker='o',
                markersize=2.0,
                zorder=LAYERS['ghost'],
            )
    points = shown.closure.points(shown.position)
    for number, (name, path) in enumerate(shown.sweep.paths.items()):
        colour = COLOURS[number % len(COLOURS)]
        axes.plot(
            [p.real for p in path],
            [p.imag for p in path],
            color=colour,
            linewidth=1.1,
            linestyle=(0, (5, 2)),
            zorder=LAYERS['path'],
        )
        place = next(place for (_, point), place in points.items() if point == name)
        axes.plot(
            [place.real], [place.imag], 'o', color=colour, markersize=3.5, zorder=LAYERS['label']
        )


def _joints(axes: Any, shown: View) -> None:
    """Plot the joints over the input: angles on the left axis, slides on the right."""
    from matplotlib.ticker import MultipleLocator  # local import: an extra, and slow to load

    given = shown.closure.linkage.inputs[0]
    joints = shown.sweep.joints
    kinds = sorted({joint.turning for joint in joints}, reverse=True)
    sides = {turning: axes if i == 0 else axes.twinx() for i, turning in enumerate(kinds)}
    turning_input = not given.slider
    now = degrees(shown.inputs[0]) if turning_input else shown.inputs[0]
    handles = []
    for number, joint in enumerate(joints):
        side = sides[joint.turning]
        xs = [degrees(x) for x in joint.x] if turning_input else joint.x
        ys = [degrees(y) for y in joint.y] if joint.turning else joint.y
        both = len(kinds) > 1
        colour = COLOURS[number % len(COLOURS)]
        (line,) = side.plot(
            xs,
            ys,
            color=colour,
            linewidth=1.3,
            linestyle='-' if joint.turning or not both else (0, (6, 2)),
            label=f'{joint.name}{" (right)" if both and not joint.turning else ""}',
        )
        handles.append(line)
    for turning, side in sides.items():
        side.set_ylabel('joint angle [°]' if turning else 'slide [m]')
        if turning:
            side.yaxis.set_major_locator(MultipleLocator(degree_step(*side.get_ylim())))
        side.tick_params(labelsize=7, width=0.5)
        side.spines['top'].set_visible(False)
        side.margins(x=0.0)
    if len(kinds) < 2:
        axes.spines['right'].set_visible(False)
    if turning_input:
        axes.xaxis.set_major_locator(MultipleLocator(degree_step(*axes.get_xlim())))
    axes.axvline(now, color='0.55', linewidth=0.8, linestyle=':')
    held = len(shown.inputs) > 1
    axes.set_xlabel(
        f'{given.joint} [{"°" if turning_input else "m"}]{", the others held" if held else ""}'
    )
    axes.grid(alpha=0.25, linewidth=0.5)
    axes.legend(
        handles=handles,
        loc='lower left',
        bbox_to_anchor=(0.0, 1.0),
        ncols=2 if len(joints) > 1 else 1,
        frameon=False,
        fontsize=7,
        borderaxespad=0.2,
        columnspacing=1.2,
    )


def _names(axes: Any, shown: View, drawn: Sequence[Shape], size: float) -> None:
    """Write the names of pins and links where they hide little."""
    names = Names(axes)
    radius = abs(names.pixel(complex(size, 0.0)) - names.pixel(0j))
    pins = {shape.name: shape.centre for shape in drawn if isinstance(shape, Circle)}
    points = shown.closure.points(shown.position)
    for (link, name), place in points.items():
        if link in shown.closure.linkage.links and link != GROUND:
            pins.setdefault(name, place)
    for name, place in pins.items():
        names.want(name, (place,), 1.2 * radius, fontsize=7.5, fontweight='bold', color=INK)
    for link, named in shown.closure.linkage.links.items():
        if link == GROUND:
            continue
        places = [points[link, point] for point in named]
        bodies = [shape for shape in drawn if isinstance(shape, Polygon) and shape.name == link]
        middle = sum(places) / len(places)
        if bodies:
            edge = bodies[-1].corners
            middle = sum(edge) / len(edge)
        anchors = [middle]
        if len(places) > 1:
            one, other = places[0], places[-1]
            anchors += [one + (other - one) * part for part in (0.35, 0.65, 0.25, 0.75)]
        names.want(link, anchors, 1.1 * radius, fontsize=6.5, fontstyle='italic', color=NAME_INK)
    lines = [outline(shape) for shape in drawn]
    lines += [(line.start, line.end) for line in skeleton(shown.closure, shown.position)]
    names.place(lines)
