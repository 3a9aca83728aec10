# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
The points of a spatial linkage in its pose, and the links that carry them.

The axis of a hinge gives two points to both of its links, and a slide two points off it to the
link that it is on, if that is not the ground. Points of one link in one place are one point.
"""

from __future__ import annotations

from itertools import combinations
from math import dist, hypot

from linkage_ros.kinematics.plane.linkage import GROUND
from linkage_ros.kinematics.space.linkage import SpaceLinkage
from linkage_ros.kinematics.space.vectors import (
    cross,
    dot,
    drop_rounding,
    GROUND_FRAME,
    length,
    minus,
    plus,
    scale,
    Vector,
)

SAME = 0.5e-6
"""Points of one link nearer to each other than this are one; no others are, after `merge_pose`,
and a point as near to the axis of a hinge of its links lies on it."""


class CarriedPoints:
    """
    Places, in lengths of ``size`` metres; the links of each point and the points of each link.

    ``axes`` are those of hinges and slides, ``same`` has for each point the one that it is known
    by.
    """

    def __init__(self, linkage: SpaceLinkage, size: float) -> None:
        self.size = size
        joints = linkage.pair_joints.values()
        self._held = {end for joint in joints for end in (joint.parent, joint.child)}
        unit = 1.0 / size
        self.places: dict[str, Vector] = {
            name: scale(unit, place) for name, place in linkage.points.items()
        }
        self.carriers: dict[str, list[str]] = {name: [] for name in self.places}
        self.carried: dict[str, list[str]] = {name: [] for name in linkage.link_names}
        self.axes: dict[str, Vector] = {}
        for link, points in linkage.links.items():
            for point in points:
                self._carry(point, link)
        for name, joint in linkage.pair_joints.items():
            self.axes[name] = _unit(joint.axis)
            if name in linkage.slides:
                continue
            at = scale(unit, joint.at)
            for number, place in enumerate((at, plus(at, self.axes[name]))):
                point = f'{name}, point {number + 1} of the axis'
                self.places[point], self.carriers[point] = place, []
                for link in (joint.parent, joint.child):
                    self._carry(point, link)
        for name, joint in linkage.slides.items():
            if joint.parent != GROUND and self.carried[joint.parent]:
                self._add_beside(name, joint.parent)
        self._merge_points()

    @property
    def rods(self) -> list[str]:
        """Return the links of points on one line that no joint holds: they may spin."""
        return [
            link
            for link, points in self.carried.items()
            if link not in self._held and link != GROUND and not self._spans(points)
        ]

    def _spans(self, points: list[str]) -> bool:
        """Return whether points do not lie on one line."""
        start, *others = (self.places[point] for point in points)
        arms = [minus(place, start) for place in others]
        return any(
            length(cross(first, second)) > 1e-3 * length(first) * length(second)
            for first, second in combinations(arms, 2)
        )

    def _add_beside(self, slide: str, tube: str) -> None:
        """Add points of a tube by which it is turned to where its slide ends."""
        axis, start = self.axes[slide], self.places[self.carried[tube][0]]
        x = unit_across(axis)
        for number, way in enumerate((x, cross(axis, x))):
            point = f'{slide}, point {number + 1} beside'
            self.places[point], self.carriers[point] = plus(start, way), []
            self._carry(point, tube)

    def _merge_points(self) -> None:
        """Make one point of those that share a link and a place, as in a universal joint."""
        self.same = {name: name for name in self.places}
        """For each point the one that it is known by."""
        merged = True
        while merged:
            merged = False
            for points in self.carried.values():
                for first, second in combinations(points, 2):
                    if dist(self.places[first], self.places[second]) < SAME:
                        self._make_same(first, second)
                        merged = True
                        break

    def _make_same(self, kept: str, gone: str) -> None:
        self.same = {name: kept if of == gone else of for name, of in self.same.items()}
        for link in self.carriers.pop(gone):
            others = self.carried[link]
            others[others.index(gone)] = kept
            self.carried[link] = list(dict.fromkeys(others))
            self.carriers[kept] = list(dict.fromkeys((*self.carriers[kept], link)))

    def _carry(self, point: str, link: str) -> None:
        self.carriers[point].append(link)
        self.carried[link].append(point)


def _unit(vector: Vector) -> Vector:
    size = hypot(*vector)
    x, y, z = (component / size for component in vector)
    return drop_rounding((x, y, z))


def unit_across(axis: Vector) -> Vector:
    """Return a unit vector across an axis; one of the axes of the ground where it can be."""
    ways = sorted(GROUND_FRAME[:3], key=lambda way: abs(dot(way, axis)))
    first = ways[0]
    return _unit(minus(first, scale(dot(first, axis), axis)))
