# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A spatial linkage's markers: its parts between places, as `SpaceDrawing` has them.

A part between two places is a round rod, one of more the hull of them, or a line; a joint is a
ball or a rod along its axis. All stand in the frame of the ground and are moved by their places,
since a strut grows, and a rod that may turn about itself has no frame.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Sequence
from itertools import combinations, pairwise
from typing import NamedTuple

from linkage_ros.kinematics import (
    convex_hull,
    cross,
    direction_of,
    FACES,
    Input,
    minus,
    Part,
    Position,
    prepare_view,
    SpaceClosure,
    SpaceDrawing,
    unit_across,
    usual_inputs,
)
from linkage_ros.messages import (
    Colour,
    CYLINDER,
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
    HATCHED,
    MarkerPile,
    MarkersWanted,
    NOWHERE,
    PlacedMarkers,
    rgba,
)
import numpy as np
from numpy.typing import NDArray

_FLAT = 1e-9
"""Largest distance of places that lie in one plane, relative to their extent."""


class _PlacedPart(NamedTuple):
    """A part of the drawing: its marker, the numbers of its places, its link and colour."""

    number: int
    rows: Sequence[int]
    link: str  # '' for a joint
    colour: Colour


class SpatialMarkers:
    """The markers of a spatial linkage."""

    def __init__(self, closure: SpaceClosure, wanted: MarkersWanted) -> None:
        inputs = usual_inputs(closure)
        self._drawing = drawing = SpaceDrawing(closure, wanted.thickness)
        self.pile = pile = MarkerPile(drawing.size, drawing.picture, wanted)
        pile.layer = pile.z = 0.0
        self._places = drawing.places(closure.position(*inputs))
        self._moved = self._moved_parts()
        curves: dict[str, list[Place]] = {name: [] for name in drawing.traced}
        if len(inputs) == 1 and not wanted.trail:
            sweep = prepare_view(closure, inputs).sweep
            for name, path in drawing.paths(sweep, inputs).items():
                curves[name] = [(x, y, z) for x, y, z in path.tolist()]
        pile.add_traces(curves)
        pile.add_arrows()
        low, high = self._places.min(axis=0), self._places.max(axis=0)
        pile.z = high[2] + 5.0 * pile.size
        pile.add_status((0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])))
        self.groups = tuple(frozenset(group.links) for group in closure.groups)
        self._joints = closure.point_tracker([joint.point for joint in wanted.joints])
        self._drives = [self._drive_arm(closure, driven) for driven in wanted.inputs]

    def place(
        self, write: MarkerArrayWriter, position: Position, red: Collection[str]
    ) -> PlacedMarkers:
        """Move all to a position, and colour the links near a toggle."""
        self._places = self._drawing.places(position)
        places = self._places.tolist()
        for number, rows, link, colour in self._moved:
            corners = [places[row] for row in rows]
            if self.pile.markers[number].kind == CYLINDER:
                write.lay_rod(number, *corners)
            else:
                write.move_points(number, corners)
            write.colour_marker(number, ALARM if link in red else colour)
        points = self._drawing.points
        return PlacedMarkers(
            [places[points[name]] for name in self._drawing.traced],
            self._joints.places(position),
            [arm(position) for arm in self._drives],
        )

    def _moved_parts(self) -> list[_PlacedPart]:
        """Add a marker for each part, which moves; return them."""
        drawing, size, parts = self._drawing, self._drawing.size, []
        bodies, numbers = {id(part) for part in drawing.bodies}, Counter[str]()
        for part in drawing.parts:
            ns = 'links' if id(part) in bodies else 'joints'
            colour = rgba(FACES[part.role]) if part.role in FACES else HATCHED
            kind, rows = _form_of(part, self._places)
            wide = 2.0 * part.width * size
            scale = {
                CYLINDER: (wide, wide, 0.0),
                SPHERE_LIST: (wide,) * 3,
                TRIANGLE_LIST: (1.0, 1.0, 1.0),
            }.get(kind, ((wide if ns == 'links' else 0.3 * size), 0.0, 0.0))
            points = () if kind == CYLINDER else NOWHERE * len(rows)
            marker = Marker(ns, numbers[ns], kind, scale, colour, points)
            numbers[ns] += 1
            link = part.name if ns == 'links' else ''
            parts.append(_PlacedPart(self.pile.add(marker), rows, link, colour))
        return parts

    def _drive_arm(self, closure: SpaceClosure, driven: Input) -> Callable[[Position], DriveArm]:
        """Return a function that says where the effort of an input is shown at a position."""
        linkage, drawing = closure.linkage, self._drawing
        row = drawing.joints.get(driven.joint, 0)
        if driven.joint in linkage.struts:
            start_point, end_point = (drawing.points[end] for end in linkage.struts[driven.joint])

            def along_strut(_position: Position) -> DriveArm:
                start, end = (self._places[point].tolist() for point in (start_point, end_point))
                way = direction_of(minus(end, start))
                return DriveArm(end, (way, unit_across(way)))

            return along_strut
        joint = linkage.pair_joints[driven.joint]
        axis = direction_of(joint.axis)
        way = closure.carried_vector(joint.parent, axis)
        # An arc begins at the link, and turns with it.
        side = closure.carried_vector(
            joint.parent if driven.slider else joint.child, unit_across(axis)
        )

        def at_joint(position: Position) -> DriveArm:
            at, along, across = self._places[row].tolist(), way(position), side(position)
            if driven.slider:
                return DriveArm(at, (along, across))
            return DriveArm(at, (across, cross(along, across)), 0.0)

        return at_joint


def _form_of(part: Part, places: NDArray[np.float64]) -> tuple[int, Sequence[int]]:
    """Return the kind of a part's marker, and the numbers of its places in their order."""
    if len(part.corners) == 1:
        return SPHERE_LIST, part.corners
    if len(part.corners) == 2 and part.role not in ('axis', 'rail'):
        return CYLINDER, part.corners
    triangles = _hull_triangles(places[list(part.corners)]) if part.is_hull else []
    if triangles:
        return TRIANGLE_LIST, [part.corners[i] for i in triangles]
    return LINE_STRIP, part.corners


def _hull_triangles(places: NDArray[np.float64]) -> list[int]:
    """Return the corners of triangles that cover the hull of places; none if it is a line."""
    away = places - places.mean(axis=0)
    _, extents, axes = np.linalg.svd(away)
    flat = _FLAT * extents[0]
    if extents[1] <= flat:
        return []
    if extents[2] <= flat:
        seen = [complex(*place) for place in (away @ axes[:2].T).tolist()]
        first, *rim = [seen.index(corner) for corner in convex_hull(seen)]
        return [i for pair in pairwise(rim) for i in (first, *pair)]
    corners_found: list[int] = []
    for corners in combinations(range(len(places)), 3):
        first_place, second, third = away[list(corners)]
        normal = np.cross(second - first_place, third - first_place)
        above = (away - first_place) @ normal
        slack = _FLAT * extents[0] ** 3
        if np.linalg.norm(normal) * extents[0] > slack and min(above.max(), -above.min()) <= slack:
            corners_found += corners
    return corners_found
