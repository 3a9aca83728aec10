# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Places of a pose that nearly coincide, made one before anything is planned.

CAD writes 7e-18 or 1e-9 for 0. Two axes that should meet then miss each other by that, and a
direction from one place to the other would be noise. Nobody builds two joints that are a millionth
of the size apart: nearer places are one, and so is what axes lead to. A point of two links that is
as near to the axis of their hinge lies on it.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from math import dist

from linkage_ros.kinematics.space.linkage import size_of, SpaceLinkage, SpatialJoint, unit_of
from linkage_ros.kinematics.space.vectors import direction_of, dot, minus, plus, scale, Vector

MERGED = 1e-6
"""Places nearer to each other than this, relative to the size, are one."""

_ROUNDING = 2.0**-50
"""Distance of places that are one but for rounding, relative to the size."""


def merge_pose(linkage: SpaceLinkage) -> SpaceLinkage:
    """
    Return a linkage without places that nearly coincide; itself if it has none.

    All places that are one take that of the first in the file: points and hinges. An axis is
    turned to a place that it leads to, at the distance at which a link is held by it. Points move
    to the axis that they are next to.
    """
    unit = unit_of(linkage)
    places = _Places(MERGED * size_of(linkage), _ROUNDING * unit)
    points = {name: places.merge(place) for name, place in linkage.points.items()}
    hinges = {
        name: replace(hinge, at=places.merge(hinge.at)) for name, hinge in linkage.hinges.items()
    }
    hinges = {name: _turn_axis(hinge, unit, places) for name, hinge in hinges.items()}
    moved: dict[Vector, Vector] = {}
    for hinge in hinges.values():
        first, second = (linkage.links.get(end, ()) for end in (hinge.parent, hinge.child))
        for place in {points[name] for name in set(first).intersection(second)}:
            now = moved.get(place, place)
            moved[place] = places.bring(now, _foot_on(hinge, now))
    if not places.largest:
        return linkage
    points = {name: moved.get(place, place) for name, place in points.items()}
    hinges = {
        name: replace(hinge, at=moved.get(hinge.at, hinge.at)) for name, hinge in hinges.items()
    }
    merged_by = max(places.largest, linkage.corrections.merged_by)
    corrections = replace(linkage.corrections, merged_by=merged_by)
    return replace(linkage, points=points, hinges=hinges, corrections=corrections)


def _turn_axis(hinge: SpatialJoint, unit: float, places: _Places) -> SpatialJoint:
    end = plus(hinge.at, scale(unit, direction_of(hinge.axis)))
    to = places.merge(end, _ROUNDING * unit)
    return hinge if to is end else replace(hinge, axis=minus(to, hinge.at))


def _foot_on(hinge: SpatialJoint, point: Vector) -> Vector:
    """Return the place of an axis that is nearest to a point."""
    way = direction_of(hinge.axis)
    return plus(hinge.at, scale(dot(minus(point, hinge.at), way), way))


class _Places:
    """Places further than a bound from each other, found in cells of that size."""

    def __init__(self, bound: float, rounding: float) -> None:
        self._bound, self._rounding = bound, rounding
        self._cells: dict[tuple[float, ...], list[Vector]] = {}
        self.largest = 0.0
        """The largest distance of two places that were merged."""

    def merge(self, place: Vector, rounding: float = 0.0) -> Vector:
        """Return the place that a new one is merged with, if not by rounding; or itself."""
        cell = tuple(coordinate // self._bound for coordinate in place)
        for near in product(*((row - 1.0, row, row + 1.0) for row in cell)):
            for near_place in self._cells.get(near, ()):
                if (apart := dist(place, near_place)) < self._bound:
                    if apart <= rounding:
                        return place
                    self.largest = max(self.largest, apart)
                    return near_place
        self._cells.setdefault(cell, []).append(place)
        return place

    def bring(self, place: Vector, to: Vector) -> Vector:
        """Return another place that one is brought to, if it is within the bound; or itself."""
        if not (apart := dist(place, to)) < self._bound or apart <= self._rounding:
            return place
        self.largest = max(self.largest, apart)
        return to
