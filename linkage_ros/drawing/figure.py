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

from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from itertools import pairwise
from math import ceil, degrees
from pathlib import Path
from typing import Any, NamedTuple

from linkage_ros.drawing.curves import Sweep, sweep
from linkage_ros.drawing.labels import Label, place_labels
from linkage_ros.drawing.shapes import Circle, Polygon, Segment, Shape, shapes, skeleton
from linkage_ros.errors import LinkageError
from linkage_ros.kinematics.closure import Closure, Position
from linkage_ros.kinematics.linkage import GROUND
from linkage_ros.kinematics.ranges import InputRange
from linkage_ros.kinematics.survey import Way

COLOURS = ('#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9', '#000000')
"""Okabe and Ito's, which colour-blind readers can tell."""

_INK = '#1f2d3a'
_FACES = {
    'link': '#c3d3e2',
    'plate': '#d3e0ecc0',
    'input': '#f0a07a',
    'block': '#fff6d6',
    'tube': '#e8edf2',
    'ground': '#ffffff',
}
_GHOST = '#cfcfcf'
_GHOSTS = 5
_STEPS = (1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 90.0, 180.0)
_STROKES = {'rail': (_INK, 1.3), 'hatch': (_INK, 0.7), 'slot': ('#ffffff', 2.2)}
_LAYERS = {'ghost': 1, 'path': 2, 'shape': 3, 'label': 6}


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
    way = Way(closure, inputs)
    value = inputs[0]
    interval = way.range_about(value) or InputRange(value, value, way.turning)
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
        ranges = Way(closure, inputs).ranges
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


def _corners(places: Iterable[complex]) -> tuple[complex, complex]:
    """Return the lower left and the upper right corner of places."""
    xs, ys = zip(*((p.real, p.imag) for p in places), strict=True)
    return complex(min(xs), min(ys)), complex(max(xs), max(ys))


def _places(shown: View) -> list[complex]:
    """Return all places through which something goes, in [m]."""
    places = [place for path in shown.sweep.paths.values() for place in path]
    for position in (shown.position, *shown.ghosts):
        for line in skeleton(shown.closure, position):
            places += (line.start, line.end)
    return places


def _outline(shape: Shape) -> tuple[complex, ...]:
    if isinstance(shape, Segment):
        return shape.start, shape.end
    if isinstance(shape, Polygon):
        return (*shape.corners, shape.corners[0])
    return tuple(shape.centre + shape.radius * way for way in (1, 1j, -1, -1j, 1))


def symbol_size(shown: View) -> float:
    """Return half the width of a bar, in [m]: what suits the picture and its shortest link."""
    low, high = _corners(_places(shown))
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
    return min(0.013 * picture, max(0.26 * shortest, 0.006 * picture))


def picture(shown: View, title: str, file: Path, *, names: bool = False) -> None:
    """
    Paint a picture to a file.

    Raises
    ------
    LinkageError
        Where matplotlib is not installed, or the file cannot be written.

    """
    if find_spec('matplotlib') is None:
        raise LinkageError(
            'matplotlib', 'is not installed', 'pip install linkage_ros[report], or apt its package'
        )
    import matplotlib as mpl  # local import: an extra, and slow to load
    from matplotlib.figure import Figure  # local import: as above

    size = symbol_size(shown)
    drawn = shapes(shown.closure, shown.position, size, shown.sweep.travels)
    low, high = _corners([*_places(shown), *(p for shape in drawn for p in _outline(shape))])
    margin = complex(3.0, 3.0) * size
    width, height = (high - low + 2.0 * margin).real, (high - low + 2.0 * margin).imag
    wide = min(max(4.9 * width / height, 3.0), 6.4)
    tall = min(max(wide * height / width, 3.2), 4.9)
    settings: Any = {'font.size': 8.0, 'svg.hashsalt': 'linkage_ros', 'axes.linewidth': 0.6}
    with mpl.rc_context(settings):
        figure = Figure(figsize=(wide + 4.9, tall + 0.5), dpi=110, layout='constrained')
        left, right = figure.subplots(1, 2, width_ratios=(wide, 4.2))
        left.set_title(
            f'{title}, {_pose_text(shown.closure, shown.inputs)}', loc='left', fontsize=9
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
        kind = file.suffix.lower()
        metadata = {'.png': {'Software': None}, '.svg': {'Date': None}}.get(kind)
        try:
            figure.savefig(file, metadata=metadata)
        except (OSError, ValueError) as error:
            reason = (
                error.strerror if isinstance(error, OSError) and error.strerror else str(error)
            )
            raise LinkageError(
                str(file), f'cannot be written ({reason})', 'name another picture with -o'
            ) from None


def paint(axes: Any, drawn: Sequence[Shape]) -> None:
    """Paint shapes, the last on top."""
    from matplotlib import patches  # local import: an extra, and slow to load

    for shape in drawn:
        if isinstance(shape, Polygon):
            corners = [(p.real, p.imag) for p in shape.corners]
            patch = patches.Polygon(
                corners,
                closed=True,
                facecolor=_FACES[shape.role],
                edgecolor=_INK,
                linewidth=0.9,
                joinstyle='round',
                zorder=_LAYERS['shape'],
            )
            axes.add_patch(patch)
        elif isinstance(shape, Circle):
            centre = (shape.centre.real, shape.centre.imag)
            axes.add_patch(
                patches.Circle(
                    centre,
                    shape.radius,
                    facecolor='white',
                    edgecolor=_INK,
                    linewidth=0.9,
                    zorder=_LAYERS['shape'],
                )
            )
        else:
            colour, width = _STROKES[shape.role]
            axes.plot(
                [shape.start.real, shape.end.real],
                [shape.start.imag, shape.end.imag],
                color=colour,
                linewidth=width,
                solid_capstyle='round',
                zorder=_LAYERS['shape'],
            )


def paint_background(axes: Any, shown: View) -> None:
    """Paint poses in light grey, and the paths of the traced points dashed."""
    for position in shown.ghosts:
        for line in skeleton(shown.closure, position):
            axes.plot(
                [line.start.real, line.end.real],
                [line.start.imag, line.end.imag],
                color=_GHOST,
                linewidth=1.0,
                marker='o',
                markersize=2.0,
                zorder=_LAYERS['ghost'],
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
            zorder=_LAYERS['path'],
        )
        place = next(place for (_, point), place in points.items() if point == name)
        axes.plot(
            [place.real], [place.imag], 'o', color=colour, markersize=3.5, zorder=_LAYERS['label']
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
            side.yaxis.set_major_locator(MultipleLocator(_step(*side.get_ylim())))
        side.tick_params(labelsize=7, width=0.5)
        side.spines['top'].set_visible(False)
        side.margins(x=0.0)
    if len(kinds) < 2:
        axes.spines['right'].set_visible(False)
    if turning_input:
        axes.xaxis.set_major_locator(MultipleLocator(_step(*axes.get_xlim())))
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


def _step(low: float, high: float) -> float:
    """Return the step of an axis in degrees."""
    return next((step for step in _STEPS if (high - low) / step <= 8.0), _STEPS[-1])


def _names(axes: Any, shown: View, drawn: Sequence[Shape], size: float) -> None:
    """Write the names of pins and links where they hide little."""
    from matplotlib.patheffects import withStroke  # local import: an extra, and slow to load

    transform = axes.transData

    def pixel(place: complex) -> complex:
        x, y = transform.transform((place.real, place.imag))
        return complex(x, y)

    halo = [withStroke(linewidth=2.0, foreground='white')]
    radius = abs(pixel(complex(size, 0.0)) - pixel(0j))
    texts, labels = [], []

    def want(text: str, anchors: tuple[complex, ...], clear: float, **style: Any) -> None:
        written = axes.text(
            0.0, 0.0, text, ha='center', va='center', zorder=_LAYERS['label'] + 1,
            path_effects=halo, **style,
        )  # fmt: skip
        box = written.get_window_extent()
        texts.append(written)
        labels.append(Label(tuple(map(pixel, anchors)), box.width + 2.0, box.height, clear))

    pins = {shape.name: shape.centre for shape in drawn if isinstance(shape, Circle)}
    points = shown.closure.points(shown.position)
    for (link, name), place in points.items():
        if link in shown.closure.linkage.links and link != GROUND:
            pins.setdefault(name, place)
    for name, place in pins.items():
        want(name, (place,), 1.2 * radius, fontsize=7.5, fontweight='bold', color=_INK)
    for link, named in shown.closure.linkage.links.items():
        if link == GROUND:
            continue
        places = [points[link, point] for point in named]
        bodies = [shape for shape in drawn if isinstance(shape, Polygon) and shape.name == link]
        middle = sum(places) / len(places)
        if bodies:
            corners = bodies[-1].corners
            middle = sum(corners) / len(corners)
        anchors = [middle]
        if len(places) > 1:
            one, other = places[0], places[-1]
            anchors += [one + (other - one) * part for part in (0.35, 0.65, 0.25, 0.75)]
        want(link, tuple(anchors), 1.1 * radius, fontsize=6.5, fontstyle='italic', color='#35608a')
    obstacles = []
    for shape in drawn:
        for start, end in pairwise(map(pixel, _outline(shape))):
            obstacles += _between(start, end)
    for line in skeleton(shown.closure, shown.position):
        obstacles += _between(pixel(line.start), pixel(line.end))
    box = axes.get_window_extent()
    frame = complex(box.x0, box.y0), complex(box.x1, box.y1)
    back = transform.inverted()
    for written, label, found in zip(
        texts, labels, place_labels(labels, obstacles, frame), strict=True
    ):
        centre, anchor = found
        written.set_position(back.transform((centre.real, centre.imag)))
        away = centre - anchor
        beside = max(abs(away.real) - 0.5 * label.width, abs(away.imag) - 0.5 * label.height)
        if beside > label.clear + 0.4 * label.height:
            start, end = (back.transform((p.real, p.imag)) for p in (anchor, centre))
            axes.plot(
                [start[0], end[0]], [start[1], end[1]],
                color='#35608a', linewidth=0.5, zorder=_LAYERS['label'],
            )  # fmt: skip


def _between(start: complex, end: complex) -> list[complex]:
    count = max(1, ceil(abs(end - start) / 4.0))
    return [start + (end - start) * i / count for i in range(count)]
