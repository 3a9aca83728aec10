# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage, planar or spatial, as the shapes that a picture of it shows, and as SVG text of these.

The SVG is for notebooks and scripts; it needs no matplotlib.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from html import escape
from typing import Any

from linkage_ros.errors import quote
from linkage_ros.kinematics import (
    Circle,
    Closure,
    COLOURS,
    draw_shapes,
    draw_skeleton,
    FACES,
    GROUND,
    INK,
    Linkage,
    LinkageView,
    Polygon,
    Position,
    prepare_view,
    Shape,
    shape_outline,
    symbol_size,
    usual_inputs,
)
from linkage_ros.tools.drawing.painting import DrawnLinkage, DrawnName, GHOST, STROKES

_LONGER_SIDE = 420.0
"""Longer side of a picture, in pixels."""


def draw_linkage(
    shown: LinkageView, camera: Sequence[float | None] = (None, None)
) -> DrawnLinkage:
    """Draw a linkage; a spatial one from a camera, as `choose_camera` has it."""
    if isinstance(shown.closure.linkage, Linkage):
        return _draw_planar(shown)._replace(length=shown.length)
    from linkage_ros.tools.drawing.space_drawing import draw_spatial  # local import: loads numpy

    return draw_spatial(shown, camera)._replace(length=shown.length)


def _draw_planar(shown: LinkageView) -> DrawnLinkage:
    size = symbol_size(shown)
    shapes = draw_shapes(shown.closure, shown.position, size, shown.sweep.travels)
    points = {point: place for (_, point), place in shown.closure.points(shown.position).items()}
    return DrawnLinkage(
        size,
        shapes,
        draw_skeleton(shown.closure, shown.position),
        [draw_skeleton(shown.closure, ghost) for ghost in shown.ghosts],
        shown.sweep.paths,
        {name: points[name] for name in shown.sweep.paths},
        list(_planar_names(shown, shapes)),
    )


def _planar_names(shown: LinkageView, drawn: Sequence[Shape]) -> Iterator[DrawnName]:
    pins = {shape.name: shape.centre for shape in drawn if isinstance(shape, Circle)}
    points = shown.closure.points(shown.position)
    for (link, name), place in points.items():
        if link in shown.closure.linkage.links and link != GROUND:
            pins.setdefault(name, place)
    for name, place in pins.items():
        yield DrawnName(name, (place,))
    for link, named in shown.closure.linkage.links.items():
        if link == GROUND:
            continue
        places = [points[link, point] for point in named]
        bodies = [shape for shape in drawn if isinstance(shape, Polygon) and shape.name == link]
        middle = sum(places) / len(places)
        if bodies:
            edge = bodies[-1].corners
            middle = sum(edge) / len(edge)
        start, end = places[0], places[-1]
        apart = (0.35, 0.65, 0.25, 0.75) if len(places) > 1 else ()
        anchors = [middle, *(start + (end - start) * part for part in apart)]
        yield DrawnName(link, anchors, is_link=True, clear=1.1)


def svg(shown: Closure | Position) -> str:
    """
    Draw a linkage as SVG.

    Other poses of its range are grey, and the paths of its traced points are dashed.

    Parameters
    ----------
    shown
        A position; or a closure, which is drawn at its start.

    Returns
    -------
    text : str
        The SVG document.

    Raises
    ------
    LinkageError
        If the position does not close.
    TypeError
        If it is neither.

    """
    position: Any = shown
    if isinstance(shown, Closure):
        position = shown.position(*usual_inputs(shown))
    if not isinstance(position, Position):
        raise TypeError(f'svg: {quote(shown)} is not drawn; give a Closure or a Position')
    drawn = draw_linkage(prepare_view(position.closure, position.inputs))
    low, high = drawn.corners(2.0)
    scale = _LONGER_SIDE / max((high - low).real, (high - low).imag)
    width, height = scale * (high - low).real, scale * (high - low).imag

    def polyline_svg(places: Iterable[complex], style: str) -> str:
        pixels = (((p - low).real * scale, (high - p).imag * scale) for p in places)
        points = ' '.join(f'{x:.1f},{y:.1f}' for x, y in pixels)
        return f'<polyline points="{points}" {style}/>'

    lines = [
        polyline_svg(shape_outline(bar), f'stroke="{GHOST}"')
        for ghost in drawn.ghosts
        for bar in ghost
    ]
    for index, path in enumerate(drawn.paths.values()):
        colour = COLOURS[index % len(COLOURS)]
        lines.append(polyline_svg(path, f'stroke="{colour}" stroke-dasharray="5 2"'))
    for shape in drawn.shapes:
        if isinstance(shape, Polygon):
            colour, opacity = FACES[shape.role][:7], int(FACES[shape.role][7:] or 'ff', 16) / 255
            style = f'fill="{colour}" fill-opacity="{opacity:.2f}" stroke="{INK}"'
            lines.append(polyline_svg(shape_outline(shape), style))
        elif isinstance(shape, Circle):
            centre, radius = shape.centre - low, shape.radius * scale
            lines.append(
                f'<circle cx="{centre.real * scale:.1f}" cy="{height - centre.imag * scale:.1f}" '
                f'r="{radius:.1f}" fill="{FACES.get(shape.role, "#ffffff")}" stroke="{INK}"/>'
            )
        else:
            colour, weight = STROKES[shape.role]
            lines.append(
                polyline_svg(shape_outline(shape), f'stroke="{colour}" stroke-width="{weight}"')
            )
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.1f} {height:.1f}" fill="none" stroke-linejoin="round">'
    )
    title = f'<title>{escape(repr(shown), quote=False)}</title>'
    return '\n'.join((head, title, *lines, '</svg>\n'))
