# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A planar linkage's markers, from the shapes of `linkage_ros.kinematics.analysis.shapes`.

The shape of a link has its own frame, at a point of the link and turned with it, so only positions
and angles change from message to message. Shapes that lie on top in the drawing get a greater z,
by less than the width of a bar. The ground and the curves of traced points do not move.
"""

from __future__ import annotations

from cmath import rect
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from linkage_ros.kinematics import (
    all_places,
    bounding_corners,
    carried_shapes,
    Circle,
    FACES,
    GROUND,
    Input,
    links_by_point,
    links_of,
    PlanarClosure,
    Polygon,
    Position,
    prepare_view,
    Segment,
    Shape,
    shape_outline,
    symbol_size,
    usual_inputs,
)
from linkage_ros.messages import (
    Colour,
    LINE_LIST,
    LINE_STRIP,
    Marker,
    MarkerArrayWriter,
    Place,
    SPHERE_LIST,
    TRIANGLE_LIST,
)
from linkage_ros.stages.effects.marker_pile import (
    ALARM,
    DriveArm,
    EDGE,
    HATCHED,
    MarkerPile,
    MarkersWanted,
    NOWHERE,
    PlacedMarkers,
    rgba,
)

_SLOT = rgba('#ffffff')
_X, _Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


class _Key(NamedTuple):
    """A point of a link, as a key."""

    link: str
    point: str


class _MarkerBody(NamedTuple):
    """A marker that moves with a link."""

    number: int  # Index of the marker
    origin: _Key  # Origin of its frame
    colour: Colour  # Colour when not near a toggle
    filled: bool  # Whether it is a filled area; else a line


class PlanarMarkers:
    """The markers of a planar linkage."""

    def __init__(self, closure: PlanarClosure, wanted: MarkersWanted) -> None:
        self._closure = closure
        shown = prepare_view(closure, usual_inputs(closure))
        low, high = bounding_corners(all_places(shown))
        extent = abs(high - low)
        size = 0.5 * wanted.thickness * extent if wanted.thickness else symbol_size(shown)
        drawn = carried_shapes(closure, shown.position, size, shown.sweep.travels)
        self.pile = pile = MarkerPile(size, extent, wanted)
        pile.add_still(_ground_markers([shape for link, shape in drawn if link == GROUND], size))
        self._bodies = _body_markers(pile, closure, shown.position, drawn)
        self._pin_places = [_Key(link, s.name) for link, s in drawn if isinstance(s, Circle)]
        self._pins = _pin_markers(pile, len(self._pin_places))
        self._traced = _traced_points(closure)
        paths = shown.sweep.paths if len(closure.linkage.inputs) == 1 else {}
        pile.add_traces({name: [*map(_flat_point, paths.get(name, ()))] for name in self._traced})
        pile.add_arrows()
        pile.add_status((0.5 * (low + high).real, high.imag + 5.0 * size))
        self.groups = tuple(frozenset(links_of(group)) for group in closure.structure.groups)
        self._joints = [
            _Key(joint.link, closure.linkage.sliders[joint.name].point)
            if joint.slides
            else _Key(joint.link, joint.name)
            for joint in wanted.joints
        ]
        self._drives = wanted.inputs

    def place(
        self, write: MarkerArrayWriter, position: Position, red: Collection[str]
    ) -> PlacedMarkers:
        """Move what moves with links to a position, and colour the links near a toggle."""
        closure = self._closure
        points, angles = closure.points(position), closure.link_angles(position)
        for marker, at, colour, filled in self._bodies:
            write.place_marker(marker, points[at], angles[at.link])
            write.colour_marker(marker, ALARM if filled and at.link in red else colour)
        pins = [_flat_point(points[at]) for at in self._pin_places]
        for marker in self._pins:
            write.move_points(marker, pins)
        return PlacedMarkers(
            [_flat_point(points[at]) for at in self._traced.values()],
            [_flat_point(points[at]) for at in self._joints],
            [self._drive_arm(driven, points, angles) for driven in self._drives],
        )

    def _drive_arm(
        self, driven: Input, points: Mapping[tuple[str, str], complex], angles: Mapping[str, float]
    ) -> DriveArm:
        linkage, blocks = self._closure.linkage, self._closure.structure.blocks
        if driven.slider:
            slider = linkage.sliders[driven.slider]
            way = rect(1.0, angles[slider.along]) * slider.unit
            start = points[blocks[driven.slider], slider.point]
            return DriveArm(_flat_point(start), (_flat_point(way), _flat_point(way * 1j)))
        links = linkage.links
        pin = next(point for point in links[driven.parent] if point in links[driven.child])
        centre = _flat_point(points[driven.child, pin])
        return DriveArm(centre, (_X, _Y), angles[driven.child])


def _body_markers(
    pile: MarkerPile,
    closure: PlanarClosure,
    position: Position,
    drawn: Sequence[tuple[str, Shape]],
) -> tuple[_MarkerBody, ...]:
    """Return the markers that move with a link, each in the frame of its link."""
    points, angles = closure.points(position), closure.link_angles(position)
    anchors = {link: _Key(link, next(iter(p))) for link, p in closure.structure.links.items()}
    ids: Counter[str] = Counter()
    whole, edge_line = (1.0, 1.0, 1.0), (0.16 * pile.size, 0.0, 0.0)
    bodies = []

    def add_body(link: str, marker: Marker) -> None:
        marker = marker._replace(number=ids[marker.ns])
        ids[marker.ns] += 1
        filled = marker.kind == TRIANGLE_LIST
        bodies.append(_MarkerBody(pile.add(marker), anchors[link], marker.colour, filled))

    for link, shape in drawn:
        if link == GROUND or isinstance(shape, Circle):
            continue
        origin, back = points[anchors[link]], rect(1.0, -angles[link])
        edge = [_flat_point((place - origin) * back) for place in shape_outline(shape)]
        if isinstance(shape, Segment):
            slot_line, z = (0.5 * pile.size, 0.0, 0.0), pile.z - 0.6 * pile.layer
            add_body(link, Marker('slots', 0, LINE_LIST, slot_line, _SLOT, edge, (0.0, 0.0, z)))
            continue
        area, colour = _fan_triangles(edge[:-1]), rgba(FACES[shape.role])
        ns = 'links' if shape.name == link else 'sliders'
        add_body(link, Marker(ns, 0, TRIANGLE_LIST, whole, colour, area, pile.above))
        z = pile.z + 0.2 * pile.layer
        add_body(link, Marker('edges', 0, LINE_STRIP, edge_line, EDGE, edge, (0.0, 0.0, z)))
        pile.z += pile.layer
    return tuple(bodies)


def _pin_markers(pile: MarkerPile, count: int) -> tuple[int, int]:
    """Return the indices of two spheres per pin: the smaller one stands out above the larger."""
    wide, narrow = 1.1 * pile.size, 0.68 * pile.size
    places = NOWHERE * count
    rim = pile.add(Marker('pins', 0, SPHERE_LIST, (wide,) * 3, EDGE, places, pile.above))
    up = (0.0, 0.0, pile.z + 0.3 * pile.size)
    face = pile.add(Marker('pins', 1, SPHERE_LIST, (narrow,) * 3, _SLOT, places, up))
    return rim, face


def _ground_markers(drawn: Sequence[Shape], size: float) -> list[Marker]:
    """Return the markers of the ground: areas and lines."""
    filled = [shape for shape in drawn if isinstance(shape, Polygon)]
    area = [p for shape in filled for p in _fan_triangles([_flat_point(q) for q in shape.corners])]
    lines = [
        _flat_point(q) for shape in drawn for ends in pairwise(shape_outline(shape)) for q in ends
    ]
    whole, thin = (1.0, 1.0, 1.0), (0.16 * size, 0.0, 0.0)
    markers = [
        Marker('ground', 0, TRIANGLE_LIST, whole, rgba(FACES['ground']), area),
        Marker('ground', 1, LINE_LIST, thin, HATCHED, lines),
    ]
    return [marker for marker in markers if marker.points]


def _traced_points(closure: PlanarClosure) -> dict[str, _Key]:
    """Return the key of each traced point."""
    links = links_by_point(closure.linkage.links)
    return {point: _Key(links[point][0], point) for point in closure.linkage.traced}


def _fan_triangles(corners: Sequence[Place]) -> list[Place]:
    """Return the corners of triangles that fill a convex area, seen from above."""
    fan = []
    for i in range(1, len(corners) - 1):
        fan += [corners[0], corners[i], corners[i + 1]]
    return fan


def _flat_point(place: complex) -> Place:
    return place.real, place.imag, 0.0
