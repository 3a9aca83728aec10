# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What a picture of a linkage shows, as shapes in its plane, of a planar or a spatial linkage."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from linkage_ros.kinematics import (
    bounding_corners,
    Circle,
    draw_shapes,
    draw_skeleton,
    drawn_once,
    GROUND,
    Linkage,
    LinkageView,
    Polygon,
    Segment,
    Shape,
    shape_outline,
    symbol_size,
)
from linkage_ros.tools.drawing.space_drawing import (
    Camera,
    projected_shapes,
    skeleton_of,
    SpaceDrawing,
)

_PLACES_ON_A_PATH = 180


class Name(NamedTuple):
    """A name to be written beside one of some places, the first the best."""

    text: str
    anchors: Sequence[complex]
    is_link: bool = False
    clear: float = 1.2  # Of the anchor, in half widths of a bar


class DrawnLinkage(NamedTuple):
    """A linkage as it is painted; all lengths in [m]."""

    size: float  # Half the width of a bar
    shapes: Sequence[Shape]  # The topmost last
    skeleton: Sequence[Segment]  # The links as lines
    ghosts: Sequence[Sequence[Segment]]  # Poses in the background
    paths: Mapping[str, Sequence[complex]]  # Of the traced points
    dots: Mapping[str, complex]  # The traced points
    names: Sequence[Name]
    strengths: Sequence[float] = ()  # How strong shapes are painted; those behind are fainter
    camera: Camera | None = None  # Of a spatial linkage
    has_lengths: bool = True

    def corners(self, margin: float) -> tuple[complex, complex]:
        """Return lower left and upper right of all, with a margin in half widths of a bar."""
        places = [place for shape in self.shapes for place in shape_outline(shape)]
        places += [place for path in self.paths.values() for place in path]
        for lines in (self.skeleton, *self.ghosts):
            places += [end for line in lines for end in shape_outline(line)]
        low, high = bounding_corners(places)
        edge = margin * self.size * (1.0 + 1.0j)
        return low - edge, high + edge


def draw_linkage(
    shown: LinkageView, camera: Sequence[float | None] = (None, None)
) -> DrawnLinkage:
    """Draw a linkage; a spatial one from a camera, as `choose_camera` has it."""
    if isinstance(shown.closure.linkage, Linkage):
        return _draw_planar(shown)
    return _draw_spatial(shown, camera)


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


def _planar_names(shown: LinkageView, drawn: Sequence[Shape]) -> Iterator[Name]:
    pins = {shape.name: shape.centre for shape in drawn if isinstance(shape, Circle)}
    points = shown.closure.points(shown.position)
    for (link, name), place in points.items():
        if link in shown.closure.linkage.links and link != GROUND:
            pins.setdefault(name, place)
    for name, place in pins.items():
        yield Name(name, (place,))
    for link, named in shown.closure.linkage.links.items():
        if link == GROUND:
            continue
        places = [points[link, point] for point in named]
        bodies = [shape for shape in drawn if isinstance(shape, Polygon) and shape.name == link]
        middle = sum(places) / len(places)
        if bodies:
            edge = bodies[-1].corners
            middle = sum(edge) / len(edge)
        anchors = (
            [middle, *_places_between(places[0], places[-1])] if len(places) > 1 else [middle]
        )
        yield Name(link, anchors, is_link=True, clear=1.1)


def _places_between(one: complex, other: complex) -> Iterator[complex]:
    return (one + (other - one) * part for part in (0.35, 0.65, 0.25, 0.75))


def _draw_spatial(shown: LinkageView, angles: Sequence[float | None]) -> DrawnLinkage:
    drawing = SpaceDrawing(shown.closure)
    over = shown.sweep.joints[0].x if shown.sweep.joints else ()
    step = max(1, len(over) // _PLACES_ON_A_PATH)
    moved = [shown.closure.position(value, *shown.inputs[1:]) for value in over[::step]]
    swept = [drawing.places(position) for position in moved if position.joints]
    several = len(shown.inputs) > 1 and not shown.are_ghosts_given
    behind = [] if several else [drawing.places(ghost) for ghost in shown.ghosts]
    places = drawing.places(shown.position)
    camera = drawing.choose_camera(places, *angles)
    drawn = projected_shapes(drawing, places, camera)
    seen, _ = camera.project(places)
    traced = {name: drawing.points[name] for name in shown.closure.linkage.traced}
    paths = {}
    for name, row in traced.items():
        path = [complex(camera.project(each[row : row + 1])[0][0]) for each in swept]
        if path:
            paths[name] = drawn_once(path)
    return DrawnLinkage(
        drawing.size,
        [shape for shape, _ in drawn],
        list(skeleton_of(drawing, places, camera)),
        [list(skeleton_of(drawing, each, camera)) for each in behind],
        paths,
        {name: complex(seen[traced[name]]) for name in paths},
        list(_spatial_names(drawing, seen)),
        [strength for _, strength in drawn],
        camera,
        drawing.has_lengths,
    )


def _spatial_names(drawing: SpaceDrawing, seen: Any) -> Iterator[Name]:
    for name, row in drawing.joints.items():
        yield Name(name, (complex(seen[row]),), clear=1.8)
    for name, row in drawing.points.items():
        yield Name(name, (complex(seen[row]),))
    for part in drawing.bodies:
        corners = [complex(seen[row]) for row in part.corners]
        anchors = [corners[len(corners) // 2], *corners[2:-2]]
        if len(corners) == 2:
            anchors = [sum(corners) / 2.0, *_places_between(*corners)]
        elif part.is_hull:
            anchors = [sum(corners) / len(corners)]
        yield Name(part.name, anchors, is_link=True, clear=1.1)
