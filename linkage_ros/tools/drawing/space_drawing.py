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

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import dist, radians
from typing import Any, NamedTuple

from linkage_ros.kinematics import (
    bar_size,
    Circle,
    convex_hull,
    GROUND,
    Polygon,
    Position,
    Role,
    round_corners,
    Segment,
    Shape,
    SpaceClosure,
    SpatialJoint,
)
import numpy as np
from numpy.typing import NDArray

Places = NDArray[np.float64]
"""Places in the frame of the ground, in [m], of shape (places, 3)."""

STROKED: tuple[Role, ...] = ('axis', 'rail')
"""Roles of parts that are lines."""

_ARC = 16
"""Places of an arc."""

_SAME = 1e-6
"""Largest distance of places that are one, relative to the linkage."""

_AZIMUTHS, _ELEVATIONS = range(-170, 190, 10), (20, 30, 40)
"""Directions of which one is chosen, in [°]: none is along an axis of the ground."""

_AXIS_SEEN = 0.5
"""Length of an axis in the picture, relative to the axis, from which on it is seen well."""

_SHORTEST = 0.02
"""Least length of a line in the picture, relative to the line: shorter ones count as this."""

_FAINTEST, _FADING = 0.4, 0.6
"""Least strength of a shape, and what is lost of it over the extent of the linkage."""

_JOINTS: tuple[Role, ...] = ('hinge', 'base', 'ball', 'pin', 'block')


class Camera(NamedTuple):
    """Where the camera stands, in [rad]: about the z axis from x to y, and above the x-y plane."""

    azimuth: float
    elevation: float

    @property
    def axes(self) -> NDArray[np.float64]:
        """Return, as rows, the directions to the right, up, and to the camera."""
        ca, sa = np.cos(self.azimuth), np.sin(self.azimuth)
        ce, se = np.cos(self.elevation), np.sin(self.elevation)
        return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])

    def project(self, places: Places) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
        """Return places in the picture, and how near they are to the camera, in [m]."""
        right, up, near = self.axes @ places.T
        return right + 1j * up, near


class Part(NamedTuple):
    """A part of the drawing between places, by their numbers; one place is a ball."""

    role: Role
    name: str
    corners: tuple[int, ...]
    width: float = 1.0  # In widths of a bar
    is_hull: bool = False  # It is the hull of its places, or else a line through them


class SpaceDrawing:
    """
    The parts of a spatial linkage, and where their places are at a position.

    Attributes
    ----------
    parts, bodies
        The parts, and those of them that are links.
    points, joints
        For each point and each joint the number of a place.
    size
        Half the width of a bar, in [m].
    has_lengths
        Whether its size means anything: a linkage of axes through one point has none.

    """

    def __init__(self, closure: SpaceClosure) -> None:
        self.closure = closure
        self.linkage = closure.linkage
        self.bodies: list[Part] = []
        self.parts: list[Part] = []
        self.points: dict[str, int] = {}
        self.joints: dict[str, int] = {}
        pose = closure.close_unlimited(*closure.linkage.pose.inputs)
        self._origins = {link: place for link, (place, _) in closure.frames(pose).items()}
        self._links: list[str] = []
        self._arms: list[Places] = []
        self._tubes: list[tuple[int, int, int, float]] = []
        self._rails: list[tuple[int, int, int]] = []
        self._carried: dict[str, list[int]] = {link: [] for link in self.linkage.link_names}
        self._driven = {
            joint.parent if joint.child == GROUND else joint.child
            for name, joint in self.linkage.pair_joints.items()
            if name in self.linkage.driven
        }
        hinges = [hinge.at for hinge in self.linkage.hinges.values()]
        places = np.array([*self.linkage.points.values(), *hinges])
        self.extent = float(np.linalg.norm(np.ptp(places, axis=0)))
        self.has_lengths = self.extent > 0.0
        self.extent = self.extent or 2.0
        together = len(hinges) > 2 and np.ptp(hinges, axis=0).max() <= _SAME * self.extent
        self._radius = 0.5 * self.extent if together else 0.0
        self._add_all()

    def _add_all(self) -> None:
        """Add all parts; what they carry comes first, as it determines the size of symbols."""
        linkage = self.linkage
        for link, names in linkage.links.items():
            for name in names:
                self.points[name] = self._carry(link, np.array(linkage.points[name]))
        centres = self._hinge_centres()
        for name, hinge in linkage.hinges.items():
            for centre in centres[name]:
                for link in (hinge.parent, hinge.child):
                    self.joints[name] = self._carry(link, centre)
        bars = [
            dist(*(self._pose_place(row) for row in rows))
            for link, rows in self._carried.items()
            if link != GROUND and len(rows) == 2
        ]
        self.size = bar_size(
            (0.8 if self._radius else 1.4) * self.extent, min(bars, default=self.extent)
        )
        for name, slide in linkage.slides.items():
            self._add_slide(name, slide)
        for link, rows in self._carried.items():
            if link != GROUND and len(rows) > 1:
                self._add_link(link, rows)
        for name, hinge in linkage.hinges.items():
            self._add_hinge(name, hinge, centres[name])
        for name, (one, other) in linkage.struts.items():
            self._add_strut(name, one, other)
        ends = [end for pair in linkage.struts.values() for end in pair]
        for name, row in self.points.items():
            carriers = [link for link, names in linkage.links.items() if name in names]
            if len(carriers) + ends.count(name) < 2:
                self.parts.append(Part('pin', name, (row,), 0.6))
            else:
                self.parts.append(Part('base' if GROUND in carriers else 'ball', name, (row,)))
        self.below = list(self._find_below())

    @property
    def count(self) -> int:
        """Return the number of places."""
        return len(self._links)

    def lines(self, places: Places) -> list[Places]:
        """Return the vectors between places that links join, and along the axes, in two arrays."""
        joined = places[sorted({row for rows in self._carried.values() for row in rows})]
        one, other = np.triu_indices(len(joined), 1)
        axes = [places[part.corners[1]] - places[part.corners[0]]
                for part in self.parts if part.role == 'axis']  # fmt: skip
        between = joined[one] - joined[other]
        long = np.linalg.norm(between, axis=1) > _SAME * self.extent
        return [between[long], np.array(axes)]

    def _find_below(self) -> Iterator[list[int]]:
        """Yield for each part those, of before, that it is in front of: what a joint joins."""
        for i, part in enumerate(self.parts):
            found = []
            if part.role in _JOINTS or part.name in self.joints:
                middle = np.mean([self._pose_place(row) for row in part.corners], axis=0)
                for other, body in enumerate(self.parts[:i]):
                    ends = [self._pose_place(row) for row in body.corners]
                    ends.append(np.mean(ends, axis=0))
                    near_by = any(dist(end, middle) < _SAME * self.extent for end in ends)
                    if near_by or (body.role, body.name) == ('rail', part.name):
                        found.append(other)
            yield found

    def page_data(self, seen: Places) -> dict[str, Any]:
        """Return the drawing as JSON data; ``seen`` are its places at many positions."""
        middle = 0.5 * (seen.min(axis=(0, 1)) + seen.max(axis=(0, 1)))
        away = seen - middle
        return {
            'camera': choose_camera(self.lines(seen[0])),
            'middle': middle.tolist(),
            # To the side and upward, from whatever side it is seen.
            'reach': [
                float(np.linalg.norm(reached, axis=2).max()) + 2.0 * self.size
                for reached in (away[:, :, :2], away)
            ],
            'size': self.size,
            'extent': self.extent,
            'has_lengths': self.has_lengths,
            'count': self.count,
            'shapes': [
                {**part._asdict(), 'number': number, 'below': below}
                for number, (part, below) in enumerate(zip(self.parts, self.below, strict=True))
            ],
            'traced': [
                {'point': name, 'link': self.points[name], 'at': []}
                for name in self.linkage.traced
            ],
            'paths': {},
        }

    def places(self, position: Position) -> Places:
        """Return all places at a position that closes."""
        frames = self.closure.frames(position)
        origins = np.array([frames[link][0] for link in self._links])
        turns = np.array([frames[link][1] for link in self._links])
        axis, arms = turns[:, :3], np.array(self._arms)
        half = np.cross(axis, arms)
        found = origins + arms + 2.0 * (turns[:, 3:] * half + np.cross(axis, half))
        for row, one, other, length in self._tubes:
            way = found[other] - found[one]
            found[row] = found[one] + way * min(length / np.linalg.norm(way), 0.9)
        return np.asarray(found)

    def stretch_rails(self, seen: Sequence[Places]) -> None:
        """Make rails as long as the slides need in some poses."""
        for on, block, first in self._rails:
            start, end = (self._arms[row] for row in (first, first + 1))
            way = (end - start) / np.linalg.norm(end - start)
            travels = [0.0]
            for places in seen:
                along = places[first + 1] - places[first]
                along /= np.linalg.norm(along)
                travels.append(float((places[block] - places[on]) @ along))
            self._arms[first] = start + min(travels) * way
            self._arms[first + 1] = end + max(travels) * way

    def _pose_place(self, row: int) -> Places:
        return self._arms[row] + self._origins[self._links[row]]

    def _add_place(self, link: str, place: Places) -> int:
        """Add a place of a link, by where it is in the pose; return its number."""
        self._links.append(link)
        self._arms.append(place - self._origins[link])
        return len(self._links) - 1

    def _carry(self, link: str, place: Places) -> int:
        """Return the number of a place between which a link is drawn; add it if it is new."""
        for row in self._carried[link]:
            if dist(self._pose_place(row), place) <= _SAME * self.extent:
                return row
        self._carried[link].append(self._add_place(link, place))
        return self._carried[link][-1]

    def _hinge_centres(self) -> dict[str, list[Places]]:
        """Return where the symbols of the hinges stand in the pose."""
        linkage, found = self.linkage, {}
        ways: list[Places] = []
        for name, hinge in linkage.hinges.items():
            at, way = np.array(hinge.at), _unit(hinge)
            carried = [linkage.links.get(link, ()) for link in (hinge.parent, hinge.child)]
            both = [np.array(linkage.points[point]) for point in carried[0] if point in carried[1]]
            centres = [
                place
                for place in both
                if np.linalg.norm(np.cross(place - at, way)) <= _SAME * self.extent
            ]
            if self._radius:
                # The shorter arc to the hinge before; of equal ones, away from all others.
                last = float(way @ ways[-1]) if ways else 1.0
                apart = last if abs(last) > 0.1 else -float(way @ np.sum(ways, axis=0))
                ways.append(way if apart >= 0.0 else -way)
                centres = [at + self._radius * ways[-1]]
            found[name] = centres or [at]
        return found

    def _add_hinge(self, name: str, hinge: SpatialJoint, centres: Sequence[Places]) -> None:
        way, fixed = _unit(hinge), GROUND in (hinge.parent, hinge.child)
        role: Role = 'base' if fixed else 'hinge'
        link = hinge.child if hinge.parent == GROUND else hinge.parent
        for centre in centres:
            ends = (self._add_place(link, centre + k * self.size * way) for k in (-1.6, 1.6))
            self.parts.append(Part(role, name, tuple(ends), 1.5))
        if self._radius:
            start = np.array(hinge.at)
            line = start, centres[0] + 5.0 * self.size * (centres[0] - start) / self._radius
        else:
            reach = [float((centre - centres[0]) @ way) for centre in centres]
            low, high = min(reach) - 5.0 * self.size, max(reach) + 5.0 * self.size
            line = centres[0] + low * way, centres[0] + high * way
        axis = (self._add_place(link, place) for place in line)
        self.parts.append(Part('axis', name, tuple(axis)))

    def _add_slide(self, name: str, slide: SpatialJoint) -> None:
        """Add block and rail of a slide; links without places only keep others from turning."""
        rows = self._carried[slide.child]
        if not rows or not (slide.parent == GROUND or self._carried[slide.parent]):
            return
        middle = np.mean([self._pose_place(row) for row in rows], axis=0)
        way = _unit(slide) * self.size
        block = self._carry(slide.child, middle)
        on = self._carry(slide.parent, middle)
        ends = [self._add_place(slide.child, middle + k * way) for k in (-2.4, 2.4)]
        role: Role = 'input' if name in self.linkage.driven else 'block'
        rail = [self._add_place(slide.parent, middle + k * way) for k in (-5.0, 5.0)]
        self.parts.append(Part('rail', name, tuple(rail)))
        self.parts.append(Part(role, name, tuple(ends), 1.6))
        self._rails.append((on, block, rail[0]))
        self.joints[name] = block

    def _add_link(self, link: str, rows: Sequence[int]) -> None:
        driven = link in self._driven
        if len(rows) > 2:
            role: Role = 'input' if driven else 'plate'
            part = Part(role, link, tuple(rows), 0.9, is_hull=True)
        else:
            role = 'input' if driven else 'link'
            part = Part(role, link, (rows[0], *self._arc(link, *rows), rows[1]))
        self.bodies.append(part)
        self.parts.append(part)

    def _arc(self, link: str, start: int, end: int) -> list[int]:
        """Return places of an arc between two on the sphere; none without a sphere."""
        if not self._radius:
            return []
        centre = np.array(next(iter(self.linkage.hinges.values())).at)
        one, other = (self._pose_place(row) - centre for row in (start, end))
        if max(abs(np.linalg.norm(way) - self._radius) for way in (one, other)) > _SAME:
            return []
        ways = [one + (other - one) * i / _ARC for i in range(1, _ARC)]
        arc = [centre + self._radius / np.linalg.norm(way) * way for way in ways]
        return [self._add_place(link, place) for place in arc]

    def _add_strut(self, name: str, one: str, other: str) -> None:
        start, end = self.points[one], self.points[other]
        tube = self._add_place(GROUND, np.zeros(3))
        length = 0.55 * dist(self._pose_place(start), self._pose_place(end))
        self._tubes.append((tube, start, end, length))
        role: Role = 'input' if name in self.linkage.driven else 'tube'
        self.parts.append(Part('link', name, (start, end), 0.6))
        self.parts.append(Part(role, name, (start, tube), 1.5))
        self.joints[name] = tube


def _unit(joint: SpatialJoint) -> Places:
    axis = np.array(joint.axis)
    return np.asarray(axis / np.linalg.norm(axis))


def choose_camera(
    lines: Sequence[Places], azimuth: float | None = None, elevation: float | None = None
) -> Camera:
    """
    Return the camera before which places hide each other least; its angles may be given.

    Of every 10° of azimuth and three elevations it is the one that shortens lines between places
    least, by the mean of the logarithms; axes count as shortened where it is within 30° of them.
    """
    azimuths = [radians(a) for a in _AZIMUTHS if a % 90] if azimuth is None else [azimuth]
    elevations = [radians(e) for e in _ELEVATIONS] if elevation is None else [elevation]

    def length_seen(camera: Camera) -> float:
        total = 0.0
        for vectors, most in zip(lines, (1.0, _AXIS_SEEN), strict=True):
            if len(vectors):
                seen = np.abs(camera.project(vectors)[0]) / np.linalg.norm(vectors, axis=1)
                total += float(np.log(np.clip(seen, _SHORTEST, most)).mean())
        return total

    return max((Camera(a, e) for e in elevations for a in azimuths), key=length_seen)


def projected_shapes(
    drawing: SpaceDrawing, places: Places, camera: Camera
) -> list[tuple[Shape, float]]:
    """Return shapes in the picture, the farthest first, each with its strength from 0 to 1."""
    seen, near = camera.project(places)
    depths = [float(np.mean(near[list(part.corners)])) for part in drawing.parts]
    order = list(depths)
    for i, below in enumerate(drawing.below):
        order[i] = max([order[i], *(order[other] for other in below)])
    nearest = max(depths)
    return [
        (
            _shape_of(part, [complex(seen[i]) for i in part.corners], drawing.size),
            max(_FAINTEST, 1.0 - _FADING * (nearest - depth) / drawing.extent),
        )
        for _, _, depth, part in sorted(
            (at, i, depths[i], drawing.parts[i]) for i, at in enumerate(order)
        )
    ]


def _shape_of(part: Part, corners: list[complex], size: float) -> Shape:
    radius = part.width * size
    if part.role in STROKED:
        return Segment(part.role, part.name, corners[0], corners[-1])
    if len(corners) == 1:
        return Circle(part.role, part.name, corners[0], radius)
    if len(corners) > 2 and not part.is_hull:
        return Polygon(part.role, part.name, _ribbon(corners, radius))
    return Polygon(part.role, part.name, round_corners(convex_hull(corners), radius))


def _ribbon(line: Sequence[complex], radius: float) -> tuple[complex, ...]:
    """Return the outline of a band about a line."""
    ways = np.gradient(np.array(line))
    across = 1j * radius * ways / np.maximum(np.abs(ways), 1e-12)
    one, other = np.array(line) + across, np.array(line) - across
    return tuple(map(complex, (*one, *other[::-1])))


def skeleton_of(drawing: SpaceDrawing, places: Places, camera: Camera) -> Iterator[Segment]:
    """Yield the links as lines in the picture, for a pose in the background."""
    seen, _ = camera.project(places)
    for part in drawing.bodies:
        corners = [complex(seen[i]) for i in part.corners]
        if part.is_hull:
            corners = convex_hull(corners)
            corners += corners[:1] if len(corners) > 2 else []
        for start, end in pairwise(corners):
            yield Segment('ghost', part.name, start, end)
