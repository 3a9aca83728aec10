# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A spatial linkage as parts between places that its links carry.

A link between two places is a bar, one of more is the hull of them. Hinges are short cylinders
about their axes, which stand where both links have a point on the axis, or else at ``at``. If all
axes pass one point, they stand on a sphere about it, and links are arcs on it. A slide is a block
on a rail, where its link has places of its own; a strut is a rod in a tube.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from math import dist
from typing import NamedTuple

from linkage_ros.kinematics.analysis.curves import RangeSweep
from linkage_ros.kinematics.analysis.shapes import bar_size, Role
from linkage_ros.kinematics.plane.linkage import GROUND
from linkage_ros.kinematics.results import Position
from linkage_ros.kinematics.space.closure import SpaceClosure
from linkage_ros.kinematics.space.linkage import SpatialJoint
from linkage_ros.kinematics.space.point_tracker import SpatialTracker
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
    tubes
        Places on struts: each its number, those of the ends, and how far it is from the first one,
        in [m].
    points, joints
        For each point and each joint the number of a place.
    traced
        The traced points that a link carries.
    size
        Half the width of a bar, in [m].
    picture
        The extent of the linkage in the pose, with what it needs to move, in [m].
    has_lengths
        Whether its extent means anything: a linkage of axes through one point has none.

    Parameters
    ----------
    closure
        The linkage.
    thickness
        Width of a bar, as a fraction of ``picture``; 0 for a suitable one.

    """

    def __init__(self, closure: SpaceClosure, thickness: float = 0.0) -> None:
        self.closure, self.linkage = closure, closure.linkage
        self.bodies: list[Part] = []
        self.points: dict[str, int] = {}
        self.joints: dict[str, int] = {}
        pose = closure.close_unlimited(*closure.linkage.pose.inputs)
        self._origins = {link: place for link, (place, _) in closure.frames(pose).items()}
        self._links: list[str] = []
        self._arms: list[Places] = []
        self.tubes: list[tuple[int, int, int, float]] = []
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
        self.picture = (0.8 if self._radius else 1.4) * self.extent
        suitable = bar_size(self.picture, min(bars, default=self.picture))
        self.size = 0.5 * thickness * self.picture if thickness else suitable
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
        places = np.asarray(origins + arms + 2.0 * (turns[:, 3:] * half + np.cross(axis, half)))
        for row, first, second, length in self.tubes:
            way = places[second] - places[first]
            places[row] = places[first] + way * min(length / np.linalg.norm(way), 0.9)
        return places

    def tracker(self) -> SpatialTracker:
        """Return a tracker of all places but those of ``tubes``, for compiled code."""
        rows = range(self.count)
        return self.closure.point_tracker(
            [(self._links[row], tuple(self._pose_place(row).tolist())) for row in rows]
        )

    @property
    def joined_rows(self) -> list[int]:
        """Return the numbers of the places between which links are drawn."""
        return sorted({row for rows in self._carried.values() for row in rows})

    def paths(self, sweep: RangeSweep, inputs: Sequence[float]) -> dict[str, Places]:
        """Return where the traced points come by over a range of the first input."""
        over = sweep.joints[0].x if self.traced and sweep.joints else ()
        step = max(1, len(over) // _PLACES_ON_A_PATH)
        moved = [self.closure.position(value, *inputs[1:]) for value in over[::step]]
        points = [self.closure.points(position) for position in moved if position.joints]
        return {
            name: np.array([place[name] for place in points])
            for name in (self.traced if points else ())
        }

    def below(self, number: int) -> list[int]:
        """Return the numbers of the parts before which a part is painted."""
        joins = self.parts[number].joins
        return [i for i, part in enumerate(self.parts[:number]) if part.name in joins]

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
        linkage, centres_of = self.linkage, {}
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
            centres_of[name] = centres or [at]
            for centre in centres_of[name]:
                for link in (hinge.parent, hinge.child):
                    self.joints[name] = self._carry(link, centre)
        return centres_of

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
        for name, (first, second) in self.linkage.struts.items():
            start, end = self.points[first], self.points[second]
            (tube,) = self._add_places(GROUND, np.zeros(3))
            length = 0.55 * dist(self._pose_place(start), self._pose_place(end))
            self.tubes.append((tube, start, end, length))
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
        first, second = (self._pose_place(row) - centre for row in (start, end))
        off = max(abs(np.linalg.norm(way) - self._radius) for way in (first, second))
        if not self._radius or off > _SAME * self._radius:
            return ()
        ways = [first + (second - first) * i / _ARC for i in range(1, _ARC)]
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
