# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A spatial linkage as parts between places that its links carry, and its axonometric picture.

A link between two places is a bar, one of more is the hull of them. Hinges are short cylinders
about their axes, which stand where both links have a point on the axis, or else at ``at``. If all
axes pass one point, they stand on a sphere about it, and links are arcs on it. A slide is a block
on a rail, where its link has places of its own; a strut is a rod in a tube.

The camera is far away: lengths across its view are true. Azimuth and elevation are the direction
in which it stands, and the z axis of the ground points up in the picture.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import combinations, pairwise
from math import dist, radians
from typing import Any, NamedTuple

from linkage_ros.errors import LinkageError
from linkage_ros.kinematics import (
    bar_size,
    Circle,
    convex_hull,
    drawn_once,
    GROUND,
    LinkageView,
    Polygon,
    Position,
    Role,
    round_corners,
    Segment,
    Shape,
    SpaceClosure,
    SpatialJoint,
)
from linkage_ros.tools.drawing.painting import DrawnLinkage, DrawnName
import numpy as np
from numpy.typing import NDArray

Places = NDArray[np.float64]
"""Places in the frame of the ground, in [m], of shape (places, 3); or one of them."""

_ARC = 16
"""Pieces of an arc."""

_RAIL = 0.4
"""Length of a rail to either side of the pose, relative to the extent of the linkage."""

_PLACES_ON_A_PATH = 180

_SAME = 1e-6
"""Largest distance of places that are one, relative to the extent."""

_AZIMUTHS, _ELEVATIONS = [a for a in range(-170, 190, 10) if a % 90], (20, 30, 40)
"""Directions of which one is chosen, in [°]."""

_BESIDE = 0.87
"""Cosine of the angle between an axis and the direction in which it is seen, at most."""

_SHORTEST = 0.01
"""Length that is added to lines in the picture, relative to the extent: some are points."""

_FAINTEST, _FADING = 0.4, 0.6
"""Least strength of a shape, and what is lost of it over the extent of the linkage."""


class Camera(NamedTuple):
    """Where the camera stands, in [rad]: about the z axis from x to y, and above the x-y plane."""

    azimuth: float
    elevation: float

    @property
    def axes(self) -> Places:
        """Return, as rows, the directions to the right, up, and to the camera."""
        ca, sa = np.cos(self.azimuth), np.sin(self.azimuth)
        ce, se = np.cos(self.elevation), np.sin(self.elevation)
        return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])

    def project(self, places: Places) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
        """Return places in the picture, and how near they are to the camera, in [m]."""
        right, up, near = self.axes @ places.T
        return right + 1j * up, near


class Part(NamedTuple):
    """A part of the drawing: a ball, a bar, a bent bar or the hull of places, by their numbers."""

    role: Role
    name: str
    corners: tuple[int, ...]
    width: float = 1.0  # In widths of a bar
    is_hull: bool = False
    joins: tuple[str, ...] = ()  # Parts before which it is painted, as a joint before links


class SpaceDrawing:
    """
    The parts of a spatial linkage, and where their places are at a position.

    Attributes
    ----------
    parts, bodies
        The parts, and those of them that are links.
    points, joints
        For each point and each joint the number of a place.
    traced
        The traced points that a link carries.
    size
        Half the width of a bar, in [m].
    has_lengths
        Whether its extent means anything: a linkage of axes through one point has none.

    """

    def __init__(self, closure: SpaceClosure) -> None:
        self.closure, self.linkage = closure, closure.linkage
        self.bodies: list[Part] = []
        self.points: dict[str, int] = {}
        self.joints: dict[str, int] = {}
        pose = closure.close_unlimited(*closure.linkage.pose.inputs)
        self._origins = {link: place for link, (place, _) in closure.frames(pose).items()}
        self._links: list[str] = []
        self._arms: list[Places] = []
        self._tubes: list[tuple[int, int, int, float]] = []
        self._carried: dict[str, list[int]] = {link: [] for link in self.linkage.link_names}
        hinges = [hinge.at for hinge in self.linkage.hinges.values()]
        places = np.array([*self.linkage.points.values(), *hinges] or [(0.0, 0.0, 0.0)])
        extent = float(np.linalg.norm(np.ptp(places, axis=0)))
        self.has_lengths, self.extent = extent > 0.0, extent or 2.0
        ends = {
            end for hinge in self.linkage.hinges.values() for end in (hinge.parent, hinge.child)
        }
        on_axes = ends.issuperset(self.linkage.link_names) and not self.linkage.struts
        one_place = len(hinges) > 2 and np.ptp(hinges, axis=0).max() <= _SAME * self.extent
        self._radius = 0.5 * self.extent if one_place and on_axes else 0.0
        self._add_places(GROUND, np.zeros(3))  # one place there is, if there are only slides
        # What links carry comes first: it determines the size of symbols.
        for link, names in self.linkage.links.items():
            for name in names:
                self.points[name] = self._carry(link, np.array(self.linkage.points[name]))
        self.traced = [name for name in self.linkage.traced if name in self.points]
        centres = self._hinge_centres()
        bars = [
            dist(*map(self._pose_place, rows))
            for link, rows in self._carried.items()
            if link != GROUND and len(rows) == 2
        ]
        picture = (0.8 if self._radius else 1.4) * self.extent
        self.size = bar_size(picture, min(bars, default=picture))
        joints = [*self._slide_parts(), *self._hinge_parts(centres), *self._strut_parts()]
        self.bodies.extend(self._link_parts())
        self.parts = [*self.bodies, *joints, *self._point_parts()]
        self.count = len(self._links)

    def places(self, position: Position) -> Places:
        """Return all places at a position that closes."""
        frames = self.closure.frames(position)
        origins = np.array([frames[link][0] for link in self._links])
        turns = np.array([frames[link][1] for link in self._links])
        axis, arms = turns[:, :3], np.array(self._arms)
        half = np.cross(axis, arms)
        found = np.asarray(origins + arms + 2.0 * (turns[:, 3:] * half + np.cross(axis, half)))
        for row, one, other, length in self._tubes:
            way = found[other] - found[one]
            found[row] = found[one] + way * min(length / np.linalg.norm(way), 0.9)
        return found

    def below(self, number: int) -> list[int]:
        """Return the numbers of the parts before which a part is painted."""
        joins = self.parts[number].joins
        return [i for i, other in enumerate(self.parts[:number]) if other.name in joins]

    def choose_camera(
        self, places: Places, azimuth: float | None = None, elevation: float | None = None
    ) -> Camera:
        """
        Return the camera before which links hide each other least; its angles may be given.

        Of every 10° of azimuth and three elevations, where none is within 30° of an axis if that
        can be, it is the one that shortens lines between joints and points least, by the mean of
        the logarithms.
        """
        joined = places[sorted({row for rows in self._carried.values() for row in rows})]
        lines = np.array([a - b for a, b in combinations(joined, 2)]).reshape(-1, 3)
        lines = lines[np.linalg.norm(lines, axis=1) > _SAME * self.extent]
        rows = [part.corners for part in self.parts if part.role == 'axis']
        axes = np.array([places[a] - places[b] for a, b in rows]).reshape(-1, 3)
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        azimuths = [*map(radians, _AZIMUTHS)] if azimuth is None else [azimuth]
        elevations = [*map(radians, _ELEVATIONS)] if elevation is None else [elevation]
        cameras = [Camera(a, e) for e in elevations for a in azimuths]
        beside = [
            each for each in cameras if np.abs(axes @ each.axes[2]).max(initial=0.0) < _BESIDE
        ]

        def length_seen(camera: Camera) -> float:
            seen = np.abs(camera.project(lines)[0]) + _SHORTEST * self.extent
            return float(np.log(seen).mean()) if len(lines) else 0.0

        return max(beside or cameras, key=length_seen)

    def page_data(self, seen: Places) -> dict[str, Any]:
        """Return the drawing as JSON data; ``seen`` are its places at many positions."""
        middle = 0.5 * (seen.min(axis=(0, 1)) + seen.max(axis=(0, 1)))
        away = seen - middle
        reach = [np.linalg.norm(each, axis=2).max() for each in (away[:, :, :2], away)]
        return {
            'camera': self.choose_camera(seen[0]),
            'middle': middle.tolist(),
            # To the side and upward, from wherever it is seen.
            'reach': [float(each) + 2.0 * self.size for each in reach],
            'size': self.size,
            'extent': self.extent,
            'has_lengths': self.has_lengths,
            'count': self.count,
            'shapes': [
                {**part._asdict(), 'number': number, 'below': self.below(number)}
                for number, part in enumerate(self.parts)
            ],
            'traced': [
                {'point': name, 'link': self.points[name], 'at': []} for name in self.traced
            ],
            'paths': {},
        }

    def _pose_place(self, row: int) -> Places:
        return self._arms[row] + self._origins[self._links[row]]

    def _add_places(self, link: str, *places: Places) -> tuple[int, ...]:
        """Add places of a link, by where they are in the pose; return their numbers."""
        self._links += [link] * len(places)
        self._arms += [place - self._origins[link] for place in places]
        return tuple(range(len(self._links) - len(places), len(self._links)))

    def _carry(self, link: str, place: Places) -> int:
        """Return the number of a place between which a link is drawn; add it if it is new."""
        for row in self._carried[link]:
            if dist(self._pose_place(row), place) <= _SAME * self.extent:
                return row
        self._carried[link] += self._add_places(link, place)
        return self._carried[link][-1]

    def _hinge_centres(self) -> dict[str, list[Places]]:
        """Return where the symbols of the hinges stand in the pose."""
        linkage, found = self.linkage, {}
        ways: list[Places] = []
        for name, hinge in linkage.hinges.items():
            at, way = np.array(hinge.at), _unit(hinge)
            names = [linkage.links.get(link, ()) for link in (hinge.parent, hinge.child)]
            both = [np.array(linkage.points[point]) for point in names[0] if point in names[1]]
            off = [np.linalg.norm(np.cross(place - at, way)) for place in both]
            centres = [p for p, r in zip(both, off, strict=True) if r <= _SAME * self.extent]
            if self._radius:
                # The shorter arc to the hinge before; of equal ones, away from all others.
                last = float(way @ ways[-1]) if ways else 1.0
                side = last if abs(last) > 0.1 else -float(way @ np.sum(ways, axis=0))
                ways.append(way if side >= 0.0 else -way)
                centres = [at + self._radius * ways[-1]]
            found[name] = centres or [at]
            for centre in found[name]:
                for link in (hinge.parent, hinge.child):
                    self.joints[name] = self._carry(link, centre)
        return found

    def _hinge_parts(self, centres: dict[str, list[Places]]) -> Iterator[Part]:
        together = Counter(hinge.at for hinge in self.linkage.hinges.values())
        balls: set[tuple[float, float, float]] = set()
        for name, hinge in self.linkage.hinges.items():
            joins = (hinge.parent, hinge.child)
            if not self._radius and together[hinge.at] > 2:
                # Three hinges through one point are a ball.
                if hinge.at not in balls:
                    (centre,) = centres[name]
                    yield Part('ball', name, (self._carry(hinge.child, centre),), joins=joins)
                balls.add(hinge.at)
                continue
            link = hinge.child if hinge.parent == GROUND else hinge.parent
            way = self.size * _unit(hinge)
            first, *_, last = [centres[name][0], *centres[name]]
            begin = np.array(hinge.at) if self._radius else first
            along = first - begin if self._radius else last - first
            beyond = way if float(along @ way) >= 0.0 else -way
            ends = begin - (not self._radius) * 5.0 * beyond, last + 5.0 * beyond
            yield Part('axis', name, self._add_places(link, *ends))
            for centre in centres[name]:
                corners = self._add_places(link, centre - 1.3 * way, centre + 1.3 * way)
                yield Part(
                    'base' if GROUND in joins else 'hinge', name, corners, 1.35, joins=joins
                )

    def _slide_parts(self) -> Iterator[Part]:
        """Yield rails and blocks; links without places only keep others from turning."""
        for name, slide in self.linkage.slides.items():
            rows = self._carried[slide.child]
            if not rows or not (slide.parent == GROUND or self._carried[slide.parent]):
                continue
            middle = np.mean([*map(self._pose_place, rows)], axis=0)
            way, rail = self.size * _unit(slide), _RAIL * self.extent * _unit(slide)
            self._carry(slide.parent, middle)
            self.joints[name] = self._carry(slide.child, middle)
            yield Part('rail', name, self._add_places(slide.parent, middle - rail, middle + rail))
            ends = self._add_places(slide.child, middle - 2.4 * way, middle + 2.4 * way)
            role: Role = 'input' if name in self.linkage.driven else 'block'
            yield Part(role, name, ends, 1.6, joins=(slide.parent, slide.child))

    def _strut_parts(self) -> Iterator[Part]:
        for name, (one, other) in self.linkage.struts.items():
            start, end = self.points[one], self.points[other]
            (tube,) = self._add_places(GROUND, np.zeros(3))
            length = 0.55 * dist(self._pose_place(start), self._pose_place(end))
            self._tubes.append((tube, start, end, length))
            self.joints[name] = tube
            yield Part('link', name, (start, end), 0.6)
            role: Role = 'input' if name in self.linkage.driven else 'tube'
            yield Part(role, name, (start, tube), 1.5, joins=(name,))

    def _link_parts(self) -> Iterator[Part]:
        joints = self.linkage.pair_joints
        ends = [(joints[n].child, joints[n].parent) for n in self.linkage.driven if n in joints]
        driven = {child if child != GROUND else parent for child, parent in ends}
        for link, rows in self._carried.items():
            role: Role = 'input' if link in driven else 'plate' if len(rows) > 2 else 'link'
            if link == GROUND or len(rows) < 2:
                continue
            if len(rows) == 2:
                yield Part(role, link, (rows[0], *self._arc(link, *rows), rows[1]))
            else:
                yield Part(role, link, tuple(rows), 0.9, is_hull=True)

    def _arc(self, link: str, start: int, end: int) -> tuple[int, ...]:
        """Return places of an arc between two on the sphere; none without a sphere."""
        centre = next((np.array(hinge.at) for hinge in self.linkage.hinges.values()), np.zeros(3))
        one, other = (self._pose_place(row) - centre for row in (start, end))
        off = max(abs(np.linalg.norm(way) - self._radius) for way in (one, other))
        if not self._radius or off > _SAME * self._radius:
            return ()
        ways = [one + (other - one) * i / _ARC for i in range(1, _ARC)]
        arc = (centre + self._radius / np.linalg.norm(way) * way for way in ways)
        return self._add_places(link, *arc)

    def _point_parts(self) -> Iterator[Part]:
        carriers = [*self.linkage.links.items(), *self.linkage.struts.items()]
        for name, row in self.points.items():
            joins = tuple(carrier for carrier, names in carriers if name in names)
            shared = len(joins) > 1
            role: Role = 'base' if GROUND in joins else 'ball' if shared else 'pin'
            yield Part(role, name, (row,), 1.0 if shared else 0.6, joins=joins)


def _unit(joint: SpatialJoint) -> Places:
    return np.asarray(np.array(joint.axis) / np.linalg.norm(joint.axis))


def projected_shapes(
    drawing: SpaceDrawing, places: Places, camera: Camera
) -> list[tuple[Shape, float]]:
    """Return shapes in the picture, the farthest first, each with its strength from 0 to 1."""
    seen, near = camera.project(places)
    depths = [float(np.mean(near[list(part.corners)])) for part in drawing.parts]
    nearest, found = max(depths), []
    for i, part in enumerate(drawing.parts):
        # A rail is behind all.
        order = max([depths[i], *(depths[other] for other in drawing.below(i))])
        shape = _shape_of(part, [complex(seen[row]) for row in part.corners], drawing.size)
        strength = max(_FAINTEST, 1.0 - _FADING * (nearest - depths[i]) / drawing.extent)
        found.append((part.role != 'rail', order, i, shape, strength))
    return [(shape, strength) for *_, shape, strength in sorted(found, key=lambda each: each[:3])]


def _shape_of(part: Part, corners: list[complex], size: float) -> Shape:
    radius = part.width * size
    if part.role in ('axis', 'rail'):
        return Segment(part.role, part.name, corners[0], corners[-1])
    if len(corners) == 1:
        return Circle(part.role, part.name, corners[0], radius)
    if len(corners) == 2 or part.is_hull:
        return Polygon(part.role, part.name, round_corners(convex_hull(corners), radius))
    ways = np.gradient(np.array(corners))
    across = 1j * radius * ways / np.maximum(np.abs(ways), _SAME * radius)
    edges = (*(corners + across), *(corners - across)[::-1])
    return Polygon(part.role, part.name, tuple(map(complex, edges)))


def skeleton_of(drawing: SpaceDrawing, places: Places, camera: Camera) -> Iterator[Segment]:
    """Yield the links as lines in the picture, for a pose in the background."""
    seen, _ = camera.project(places)
    for part in drawing.bodies:
        corners: Sequence[complex] = [complex(seen[row]) for row in part.corners]
        if part.is_hull:
            corners = convex_hull(corners)
            corners = [*corners, corners[0]] if len(corners) > 2 else corners
        for start, end in pairwise(corners):
            yield Segment('ghost', part.name, start, end)


def draw_spatial(shown: LinkageView, angles: Sequence[float | None]) -> DrawnLinkage:
    """Draw a spatial linkage from a camera, whose angles `SpaceDrawing.choose_camera` takes."""
    drawing, closure = SpaceDrawing(shown.closure), shown.closure
    if not drawing.parts:
        raise LinkageError(closure.name, 'has only slides, which have no place', 'add a point')
    several = len(shown.inputs) > 1 and not shown.are_ghosts_given
    behind = [] if several else [drawing.places(ghost) for ghost in shown.ghosts]
    places = drawing.places(shown.position)
    camera = drawing.choose_camera(places, *angles)
    drawn = projected_shapes(drawing, places, camera)
    seen, _ = camera.project(places)
    over = shown.sweep.joints[0].x if drawing.traced and shown.sweep.joints else ()
    step = max(1, len(over) // _PLACES_ON_A_PATH)
    moved = [closure.position(value, *shown.inputs[1:]) for value in over[::step]]
    points = [closure.points(position) for position in moved if position.joints]
    paths = {}
    for name in drawing.traced if points else ():
        path, _ = camera.project(np.array([place[name] for place in points]))
        paths[name] = drawn_once(path.tolist())
    return DrawnLinkage(
        drawing.size,
        [shape for shape, _ in drawn],
        list(skeleton_of(drawing, places, camera)),
        [list(skeleton_of(drawing, each, camera)) for each in behind],
        paths,
        {name: complex(seen[drawing.points[name]]) for name in paths},
        list(_spatial_names(drawing, seen)),
        [strength for _, strength in drawn],
        camera,
        drawing.has_lengths,
    )


def _spatial_names(drawing: SpaceDrawing, seen: Any) -> Iterator[DrawnName]:
    for name, row in drawing.joints.items():
        yield DrawnName(name, (complex(seen[row]),), clear=1.8)
    for name, row in drawing.points.items():
        yield DrawnName(name, (complex(seen[row]),))
    for part in drawing.bodies:
        corners = [complex(seen[row]) for row in part.corners]
        anchors = [corners[len(corners) // 2], *corners[2:-2]]
        if len(corners) == 2:
            (one, other), parts = corners, (0.5, 0.35, 0.65, 0.25, 0.75)
            anchors = [one + (other - one) * part for part in parts]
        elif part.is_hull:
            anchors = [sum(corners) / len(corners)]
        yield DrawnName(part.name, anchors, is_link=True, clear=1.1)
