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


"""
What the markers of a linkage look like: the shapes of `linkage_ros.drawing`, packed once.

A link's shape stands in a frame of its own, at one of its points and turned as the link is, so
that of a message only places and angles are new. What lies on top in the drawing lies higher, by
less than a bar is wide. The ground and the curves of traced points do not move.
"""

from __future__ import annotations

from cmath import rect
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from linkage_ros.drawing.figure import all_places, symbol_size, view
from linkage_ros.drawing.painting import COLOURS, corners, FACES, INK, outline
from linkage_ros.drawing.shapes import carried_shapes, Circle, Polygon, Segment, Shape
from linkage_ros.kinematics.closure import Closure, Position
from linkage_ros.kinematics.linkage import GROUND
from linkage_ros.kinematics.sweep_analysis import usual_inputs
from linkage_ros.messages.marker_array import (
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
"""Of an effort's arrow, with its head."""


class Key(NamedTuple):
    """A point of a link."""

    link: str
    point: str


class Body(NamedTuple):
    """
    A marker that moves with a link.

    Attributes
    ----------
    number
        Of the marker.
    at
        Where its frame is.
    colour
        Far from a toggle.
    filled
        Whether it is an area and no line.

    """

    number: int
    at: Key
    colour: Colour
    filled: bool


class MarkerShapes(NamedTuple):
    """
    The markers of a linkage.

    Attributes
    ----------
    moving
        Those that change from message to message.
    still
        The ground, and the curves of traced points.
    bodies
        Which of the moving ones lie on a link.
    pins
        Which of them are pins: each has a sphere for every one of `pin_places`.
    pin_places
        Where the pins are.
    trails, trail_places
        Which of them are the ways of traced points so far, and where those points are.
    forces, efforts
        Which of them are arrows.
    status
        The number of the text.
    size
        Half the width of a bar, in [m].
    extent
        The diagonal of all that the linkage reaches, in [m].

    """

    moving: tuple[Marker, ...]
    still: tuple[Marker, ...]
    bodies: tuple[Body, ...]
    pins: tuple[int, ...]
    pin_places: tuple[Key, ...]
    trails: tuple[int, ...]
    trail_places: tuple[Key, ...]
    forces: tuple[int, ...]
    efforts: tuple[int, ...]
    status: int
    size: float
    extent: float


def rgba(code: str) -> Colour:
    """Return a colour, #rrggbb or #rrggbbaa."""
    red, green, blue, *alpha = (value / 255.0 for value in bytes.fromhex(code[1:]))
    return red, green, blue, alpha[0] if alpha else 1.0


ALARM = rgba('#e0241b')
"""Of what is near a toggle."""

_HATCHED = rgba('#7f93a6')
"""Of the ground's lines: to be seen on white as on black."""

_EDGE, _SLOT, _FORCE, _EFFORT = map(rgba, (INK, '#ffffff', '#CC79A7', '#009E73'))
_NOWHERE: list[Place] = [(0.0, 0.0, 0.0)]


def marker_shapes(
    closure: Closure,
    width: float,
    trail: int,
    forces: int,
    efforts: int,
    lifetimes: tuple[int, int],
) -> MarkerShapes:
    """
    Draw a linkage's markers.

    Parameters
    ----------
    closure
        The linkage.
    width
        Of a bar, as a share of all that the linkage reaches; 0 for what suits it.
    trail
        Of how many places the trail of a traced point is made; 0 for its whole curve instead.
    forces, efforts
        How many arrows there are of each.
    lifetimes
        Of what moves and of what does not, in [ns].

    """
    shown = view(closure, usual_inputs(closure))
    low, high = corners(all_places(shown))
    extent = abs(high - low)
    size = 0.5 * width * extent if width else symbol_size(shown)
    moves, stays = lifetimes
    drawn = carried_shapes(closure, shown.position, size, shown.sweep.travels)
    still = _still([shape for link, shape in drawn if link == GROUND], size, stays)
    pile = _Pile(size, moves)
    bodies = _bodies(pile, closure, shown.position, drawn)
    pin_places = tuple(Key(link, s.name) for link, s in drawn if isinstance(s, Circle))
    pins = _pins(pile, len(pin_places))
    traced = _traced(closure)
    trails = []
    for number, name in enumerate(traced):
        colour, scale = rgba(COLOURS[number % len(COLOURS)]), (0.35 * size, 0.0, 0.0)
        if trail:
            marker = Marker('traces', number, LINE_STRIP, scale, colour, _NOWHERE * trail)
            trails.append(pile.add(marker._replace(z=pile.z)))
        elif len(closure.linkage.inputs) == 1:
            curve = [_flat(place) for place in shown.sweep.paths[name]]
            marker = Marker('traces', number, LINE_STRIP, scale, colour, curve)
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
    """Markers that lie above each other, and how high the next one lies, in [m]."""

    def __init__(self, size: float, lifetime: int) -> None:
        self.size = size
        self.layer = self.z = 0.5 * size
        self._lifetime = lifetime
        self.markers: list[Marker] = []

    def add(self, marker: Marker) -> int:
        """Add a marker; return its number."""
        self.markers.append(marker._replace(lifetime=self._lifetime))
        return len(self.markers) - 1


def _bodies(
    pile: _Pile, closure: Closure, position: Position, drawn: Sequence[tuple[str, Shape]]
) -> tuple[Body, ...]:
    """Return the markers of all that moves with a link, each in the frame of its link."""
    points, angles = closure.points(position), closure.link_angles(position)
    anchors = {link: Key(link, next(iter(p))) for link, p in closure.structure.links.items()}
    ids: Counter[str] = Counter()
    whole, edge_line = (1.0, 1.0, 1.0), (0.16 * pile.size, 0.0, 0.0)
    found = []

    def add(link: str, marker: Marker) -> None:
        marker = marker._replace(number=ids[marker.ns])
        ids[marker.ns] += 1
        filled = marker.kind == TRIANGLE_LIST
        found.append(Body(pile.add(marker), anchors[link], marker.colour, filled))

    for link, shape in drawn:
        if link == GROUND or isinstance(shape, Circle):
            continue
        origin, back = points[anchors[link]], rect(1.0, -angles[link])
        edge = [_flat((place - origin) * back) for place in outline(shape)]
        if isinstance(shape, Segment):
            slot_line, z = (0.5 * pile.size, 0.0, 0.0), pile.z - 0.6 * pile.layer
            add(link, Marker('slots', 0, LINE_LIST, slot_line, _SLOT, edge, z=z))
            continue
        area, colour = _triangles(edge[:-1]), rgba(FACES[shape.role])
        ns = 'links' if shape.name == link else 'sliders'
        add(link, Marker(ns, 0, TRIANGLE_LIST, whole, colour, area, z=pile.z))
        z = pile.z + 0.2 * pile.layer
        add(link, Marker('edges', 0, LINE_STRIP, edge_line, _EDGE, edge, z=z))
        pile.z += pile.layer
    return tuple(found)


def _pins(pile: _Pile, count: int) -> tuple[int, int]:
    """Return the numbers of two spheres for each pin: the smaller stands out above the larger."""
    wide, narrow = 1.1 * pile.size, 0.68 * pile.size
    places = _NOWHERE * count
    rim = pile.add(Marker('pins', 0, SPHERE_LIST, (wide,) * 3, _EDGE, places, z=pile.z))
    up = pile.z + 0.3 * pile.size
    face = pile.add(Marker('pins', 1, SPHERE_LIST, (narrow,) * 3, _SLOT, places, z=up))
    return rim, face


def _still(drawn: Sequence[Shape], size: float, lifetime: int) -> list[Marker]:
    """Return the ground as markers: what is filled, and lines."""
    filled = [shape for shape in drawn if isinstance(shape, Polygon)]
    area = [p for shape in filled for p in _triangles([_flat(q) for q in shape.corners])]
    lines = [_flat(q) for shape in drawn for ends in pairwise(outline(shape)) for q in ends]
    whole, thin = (1.0, 1.0, 1.0), (0.16 * size, 0.0, 0.0)
    found = [
        Marker('ground', 0, TRIANGLE_LIST, whole, rgba(FACES['ground']), area, lifetime=lifetime),
        Marker('ground', 1, LINE_LIST, thin, _HATCHED, lines, lifetime=lifetime),
    ]
    return [marker for marker in found if marker.points]


def _traced(closure: Closure) -> dict[str, Key]:
    """Return of each traced point where it is found."""
    links = closure.linkage.links
    return {
        point: Key(next(link for link, named in links.items() if point in named), point)
        for point in closure.linkage.traced
    }


def _triangles(corners: Sequence[Place]) -> list[Place]:
    """Return the corners of triangles that fill a convex area, seen from above."""
    found = []
    for i in range(1, len(corners) - 1):
        found += [corners[0], corners[i], corners[i + 1]]
    return found


def _flat(place: complex) -> Place:
    return place.real, place.imag, 0.0
