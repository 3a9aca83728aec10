# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A linkage, planar or spatial, as the shapes that a picture of it shows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from linkage_ros.kinematics import (
    Circle,
    draw_shapes,
    draw_skeleton,
    GROUND,
    Linkage,
    LinkageView,
    Polygon,
    Shape,
    symbol_size,
)
from linkage_ros.tools.drawing.painting import DrawnLinkage, DrawnName


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
        one, other = places[0], places[-1]
        apart = (0.35, 0.65, 0.25, 0.75) if len(places) > 1 else ()
        anchors = [middle, *(one + (other - one) * part for part in apart)]
        yield DrawnName(link, anchors, is_link=True, clear=1.1)
