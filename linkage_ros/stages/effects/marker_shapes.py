# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage's markers, from the shapes of `linkage_ros.kinematics.analysis.shapes`, packed once.

The shape of a link has its own frame, at a point of the link and turned with it, so only positions
and angles change from message to message. Shapes that lie on top in the drawing get a greater z,
by less than the width of a bar. The ground and the curves of traced points do not move.
"""

from __future__ import annotations

from cmath import phase, rect
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import log1p, pi
from typing import NamedTuple

from linkage_ros.kinematics import (
    all_places,
    bounding_corners,
    carried_shapes,
    Circle,
    COLOURS,
    FACES,
    GROUND,
    INK,
    Input,
    links_by_point,
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
    ARROW,
    Colour,
    LINE_LIST,
    LINE_STRIP,
    Marker,
    Place,
    SPHERE_LIST,
    TEXT_VIEW_FACING,
    TRIANGLE_LIST,
)

ARROW_POINTS = 16
"""Number of points of an effort's arrow, with its head."""

_GRAVITY = 9.81
_SHORTEST = 0.25
"""Least length of an arrow, in half bars."""

_WIDEST = 1.7 * pi
"""Greatest angle of an arc, in [rad]; a longer one would meet itself."""

Points = Mapping[tuple[str, str], complex]


class Key(NamedTuple):
    """A point of a link, as a key."""

    link: str
    point: str


class MarkerBody(NamedTuple):
    """A marker that moves with a link."""

    number: int  # Index of the marker
    origin: Key  # Origin of its frame
    colour: Colour  # Colour when not near a toggle
    filled: bool  # Whether it is a filled area; else a line


class MarkerShapes(NamedTuple):
    """The markers of a linkage."""

    moving: tuple[Marker, ...]  # Markers that change from message to message
    still: tuple[Marker, ...]  # The ground, and the curves of traced points
    bodies: tuple[MarkerBody, ...]  # Moving markers that belong to a link
    # Moving markers for pins: each has a sphere for every place in `pin_places`.
    pins: tuple[int, ...]
    pin_places: tuple[Key, ...]  # Positions of the pins
    # Moving markers for the trails of traced points, and the positions of these points.
    trails: tuple[int, ...]
    trail_places: tuple[Key, ...]
    # Moving markers that are arrows.
    forces: tuple[int, ...]
    efforts: tuple[int, ...]
    status: int  # Index of the text marker
    size: float  # Half the width of a bar, in [m]
    extent: float  # Diagonal of the linkage's whole workspace, in [m]


def rgba(code: str) -> Colour:
    """Return the colour for #rrggbb or #rrggbbaa."""
    red, green, blue, *alpha = (value / 255.0 for value in bytes.fromhex(code[1:]))
    return red, green, blue, alpha[0] if alpha else 1.0


ALARM = rgba('#e0241b')
"""Colour near a toggle."""

_HATCHED = rgba('#7f93a6')
"""Colour of the ground's lines: visible on white and on black."""

_EDGE, _SLOT, _FORCE, _EFFORT = map(rgba, (INK, '#ffffff', '#CC79A7', '#009E73'))
_NOWHERE: list[Place] = [(0.0, 0.0, 0.0)]


def marker_shapes(
    closure: PlanarClosure,
    width: float,
    trail: int,
    forces: int,
    efforts: int,
    lifetimes: tuple[int, int],
) -> MarkerShapes:
    """
    Build the markers of a linkage, with their numbers of arrows for forces and efforts.

    ``width`` is the width of a bar, as a share of the workspace; 0 for a suitable one. ``trail``
    is the number of points in a traced point's trail; 0 for its whole curve instead. ``lifetimes``
    are the lifetimes of moving and of still markers, in [ns].
    """
    shown = prepare_view(closure, usual_inputs(closure))
    low, high = bounding_corners(all_places(shown))
    extent = abs(high - low)
    size = 0.5 * width * extent if width else symbol_size(shown)
    moves, stays = lifetimes
    drawn = carried_shapes(closure, shown.position, size, shown.sweep.travels)
    still = _ground_markers([shape for link, shape in drawn if link == GROUND], size, stays)
    pile = _Pile(size, moves)
    bodies = _body_markers(pile, closure, shown.position, drawn)
    pin_places = tuple(Key(link, s.name) for link, s in drawn if isinstance(s, Circle))
    pins = _pin_markers(pile, len(pin_places))
    traced = _traced_points(closure)
    trails = []
    for index, name in enumerate(traced):
        colour, scale = rgba(COLOURS[index % len(COLOURS)]), (0.35 * size, 0.0, 0.0)
        if trail:
            marker = Marker('traces', index, LINE_STRIP, scale, colour, _NOWHERE * trail)
            trails.append(pile.add(marker._replace(z=pile.z)))
        elif len(closure.linkage.inputs) == 1:
            curve = [_flat_point(place) for place in shown.sweep.paths[name]]
            marker = Marker('traces', index, LINE_STRIP, scale, colour, curve)
            still.append(marker._replace(lifetime=stays))
    top = pile.z + size
    thick, line = (0.6 * size, 1.5 * size, 2.2 * size), (0.5 * size, 0.0, 0.0)
    arrows = [
        pile.add(Marker('forces', n, ARROW, thick, _FORCE, _NOWHERE * 2, z=top))
        for n in range(forces)
    ]
    places = _NOWHERE * ARROW_POINTS
    turns = [
        pile.add(Marker('efforts', n, LINE_STRIP, line, _EFFORT, places, z=top))
        for n in range(efforts)
    ]
    above = complex(0.5 * (low + high).real, high.imag + 5.0 * size)
    letters = (0.0, 0.0, 4.0 * size)
    status = pile.add(Marker('status', 0, TEXT_VIEW_FACING, letters, ALARM, at=above, z=top))
    return MarkerShapes(
        moving=tuple(pile.markers),
        still=tuple(still),
        bodies=bodies,
        pins=pins,
        pin_places=pin_places,
        trails=tuple(trails),
        trail_places=tuple(traced.values()) if trail else (),
        forces=tuple(arrows),
        efforts=tuple(turns),
        status=status,
        size=size,
        extent=extent,
    )


class _Pile:
    """Stack of markers, with the height of the next one, in [m]."""

    def __init__(self, size: float, lifetime: int) -> None:
        self.size = size
        self.layer = self.z = 0.5 * size
        self._lifetime = lifetime
        self.markers: list[Marker] = []

    def add(self, marker: Marker) -> int:
        """Add a marker; return its index."""
        self.markers.append(marker._replace(lifetime=self._lifetime))
        return len(self.markers) - 1


def _body_markers(
    pile: _Pile, closure: PlanarClosure, position: Position, drawn: Sequence[tuple[str, Shape]]
) -> tuple[MarkerBody, ...]:
    """Return the markers that move with a link, each in the frame of its link."""
    points, angles = closure.points(position), closure.link_angles(position)
    anchors = {link: Key(link, next(iter(p))) for link, p in closure.structure.links.items()}
    ids: Counter[str] = Counter()
    whole, edge_line = (1.0, 1.0, 1.0), (0.16 * pile.size, 0.0, 0.0)
    found = []

    def add_body(link: str, marker: Marker) -> None:
        marker = marker._replace(number=ids[marker.ns])
        ids[marker.ns] += 1
        filled = marker.kind == TRIANGLE_LIST
        found.append(MarkerBody(pile.add(marker), anchors[link], marker.colour, filled))

    for link, shape in drawn:
        if link == GROUND or isinstance(shape, Circle):
            continue
        origin, back = points[anchors[link]], rect(1.0, -angles[link])
        edge = [_flat_point((place - origin) * back) for place in shape_outline(shape)]
        if isinstance(shape, Segment):
            slot_line, z = (0.5 * pile.size, 0.0, 0.0), pile.z - 0.6 * pile.layer
            add_body(link, Marker('slots', 0, LINE_LIST, slot_line, _SLOT, edge, z=z))
            continue
        area, colour = _fan_triangles(edge[:-1]), rgba(FACES[shape.role])
        ns = 'links' if shape.name == link else 'sliders'
        add_body(link, Marker(ns, 0, TRIANGLE_LIST, whole, colour, area, z=pile.z))
        z = pile.z + 0.2 * pile.layer
        add_body(link, Marker('edges', 0, LINE_STRIP, edge_line, _EDGE, edge, z=z))
        pile.z += pile.layer
    return tuple(found)


def _pin_markers(pile: _Pile, count: int) -> tuple[int, int]:
    """Return the indices of two spheres per pin: the smaller one stands out above the larger."""
    wide, narrow = 1.1 * pile.size, 0.68 * pile.size
    places = _NOWHERE * count
    rim = pile.add(Marker('pins', 0, SPHERE_LIST, (wide,) * 3, _EDGE, places, z=pile.z))
    up = pile.z + 0.3 * pile.size
    face = pile.add(Marker('pins', 1, SPHERE_LIST, (narrow,) * 3, _SLOT, places, z=up))
    return rim, face


def _ground_markers(drawn: Sequence[Shape], size: float, lifetime: int) -> list[Marker]:
    """Return the markers of the ground: areas and lines."""
    filled = [shape for shape in drawn if isinstance(shape, Polygon)]
    area = [p for shape in filled for p in _fan_triangles([_flat_point(q) for q in shape.corners])]
    lines = [
        _flat_point(q) for shape in drawn for ends in pairwise(shape_outline(shape)) for q in ends
    ]
    whole, thin = (1.0, 1.0, 1.0), (0.16 * size, 0.0, 0.0)
    found = [
        Marker('ground', 0, TRIANGLE_LIST, whole, rgba(FACES['ground']), area, lifetime=lifetime),
        Marker('ground', 1, LINE_LIST, thin, _HATCHED, lines, lifetime=lifetime),
    ]
    return [marker for marker in found if marker.points]


def _traced_points(closure: PlanarClosure) -> dict[str, Key]:
    """Return the key of each traced point."""
    links = links_by_point(closure.linkage.links)
    return {point: Key(links[point][0], point) for point in closure.linkage.traced}


def _fan_triangles(corners: Sequence[Place]) -> list[Place]:
    """Return the corners of triangles that fill a convex area, seen from above."""
    found = []
    for i in range(1, len(corners) - 1):
        found += [corners[0], corners[i], corners[i + 1]]
    return found


def _flat_point(place: complex) -> Place:
    return place.real, place.imag, 0.0


class Arrows:
    """
    Arrows for forces and efforts, each as its points; none where it is too short to be seen.

    They begin at the ``joints`` where the forces act. The lengths follow ``scale``, in [m/N]; if
    it is 0, they are::

        L = D/8 · ln(1 + F/W)

    with D the diagonal of the workspace, and W = 9.81 m/s² · Σm the weight of the moving links: so
    no force is too small or too large to be seen, and an arrow does not depend on earlier ones.
    The effort of a rotating drive is an arc about its pin, at a radius of eight half bars, as long
    as the arrow of its force at that radius.
    """

    def __init__(
        self, scale: float, closure: PlanarClosure, shapes: MarkerShapes, joints: Sequence[Key]
    ) -> None:
        self._closure = closure
        self._scale = scale
        self._eighth = 0.125 * shapes.extent
        weight = _GRAVITY * sum(each.mass for each in closure.linkage.masses.values())
        self._weight = weight or 1.0  # of a massless linkage: one newton
        self._shortest = _SHORTEST * shapes.size
        self._radius = 8.0 * shapes.size
        self._head = 2.0 * shapes.size
        self._joints = joints

    def _arrow_length(self, force: float) -> float:
        if self._scale:
            return self._scale * force
        return self._eighth * log1p(force / self._weight)

    def force_arrows(
        self, points: Points, reactions: Sequence[tuple[float, ...]]
    ) -> list[list[complex]]:
        """Return the arrow of each joint."""
        if not (self._joints and reactions):
            return [[] for _ in self._joints]
        drawn = []
        for at, (fx, fy, *_) in zip(self._joints, reactions, strict=True):
            force = complex(fx, fy)
            length = self._arrow_length(abs(force))
            start = points[at]
            end = start + rect(length, phase(force))
            drawn.append([start, end] if length >= self._shortest else [])
        return drawn

    def effort_arrows(
        self,
        inputs: Sequence[Input],
        points: Points,
        angles: Mapping[str, float],
        efforts: Sequence[float],
    ) -> list[list[complex]]:
        """Return the effort arrow of each input: an arc about the pin, or a straight arrow."""
        if not (inputs and efforts):
            return [[] for _ in inputs]
        return [
            self._straight_arrow(given, points, angles, effort)
            if given.slider
            else self._arc_arrow(given, points, angles, effort)
            for given, effort in zip(inputs, efforts, strict=True)
        ]

    def _straight_arrow(
        self, given: Input, points: Points, angles: Mapping[str, float], effort: float
    ) -> list[complex]:
        slider = self._closure.linkage.sliders[given.slider]
        block = self._closure.structure.blocks[given.slider]
        way = rect(1.0 if effort > 0.0 else -1.0, angles[slider.along])
        way *= slider.unit
        start = points[block, slider.point]
        length = self._arrow_length(abs(effort))
        return self._add_head([start, start + length * way], way, length)

    def _arc_arrow(
        self, given: Input, points: Points, angles: Mapping[str, float], effort: float
    ) -> list[complex]:
        links = self._closure.linkage.links
        pin = next(point for point in links[given.parent] if point in links[given.child])
        centre, start = points[given.child, pin], angles[given.child]
        length = self._arrow_length(abs(effort) / self._radius)
        turn = min(length / self._radius, _WIDEST) * (1.0 if effort > 0.0 else -1.0)
        steps = ARROW_POINTS - 4
        arc = [centre + rect(self._radius, start + turn * i / steps) for i in range(steps)]
        arc.append(centre + rect(self._radius, start + turn))
        way = rect(1.0, start + turn) * (1j if effort > 0.0 else -1j)
        return self._add_head(arc, way, length)

    def _add_head(self, line: list[complex], way: complex, length: float) -> list[complex]:
        """Return a line with a head; all arrows have the same number of points."""
        if length < self._shortest:
            return []
        end, back = line[-1], min(self._head, length) * way
        drawn = [*line, end - back * rect(1.0, 0.5), end, end - back * rect(1.0, -0.5)]
        return [*drawn, *[drawn[-1]] * (ARROW_POINTS - len(drawn))]
