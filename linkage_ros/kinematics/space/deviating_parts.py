# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A spatial linkage of parts that are not as drawn, put together at the inputs of the pose.

Each link is a part with its own holes and axes. Where these deviate, the links meet elsewhere than
in the pose: each moves by a small displacement and turn, until points and axes coincide again, by
Newton's method on all equations, with the least motion where links are free (the spin of a rod).
The drawn zeros of the joints stay on their parts, so the values of the joints in the pose change;
driven joints keep theirs, and ratios hold.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import atan2, hypot
from types import MappingProxyType
from typing import Any

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.plane.linkage import GROUND
from linkage_ros.kinematics.space.carried_points import unit_across
from linkage_ros.kinematics.space.linkage import size_of, SpaceLinkage, SpatialJoint
from linkage_ros.kinematics.space.masses import SpatialMass, turned_tensor
from linkage_ros.kinematics.space.vectors import turn_about, Vector
import numpy as np
from numpy.typing import NDArray

Vectors = NDArray[np.float64]
Rows = list[tuple[float, dict[str, Vectors]]]
"""Errors of equations, each with its slopes by the displacement and the turn of links."""

_MOST_STEPS = 30
_MET = 1e-13
"""Errors that are rounding, relative to the size of the linkage."""

_MISSED = 1e-9
"""Errors of parts that do not fit, relative to the size of the linkage."""


def put_together(
    linkage: SpaceLinkage,
    deviations: Mapping[tuple[str, str], Vector],
    tilts: Mapping[tuple[str, str], tuple[float, float]] = MappingProxyType({}),
) -> SpaceLinkage:
    """
    Return a linkage of parts that deviate.

    Parameters
    ----------
    linkage
        The linkage as drawn.
    deviations
        For link and point, or link and hinge, how far the hole is from the drawn one, in [m],
        along the axes of the ground in the pose.
    tilts
        For link and hinge, the turn of the axis from the drawn one, in [rad]: about `unit_across`
        of the axis, and about the direction across both.

    Raises
    ------
    DefinitionError
        The parts cannot be put together.

    """
    parts = _DeviatingParts(linkage, deviations, tilts)
    size = size_of(linkage)
    for _ in range(_MOST_STEPS):
        errors, slopes = parts.equations()
        if not len(errors) or np.abs(errors).max() <= _MET * size:
            break
        parts.move(np.linalg.lstsq(slopes, -errors, rcond=1e-11)[0].astype(float))
    missed = float(np.abs(errors).max()) if len(errors) else 0.0
    if missed > _MISSED * size:
        raise DefinitionError(
            'points',
            f'the parts do not fit: they miss each other by {missed:.3g} m at the least',
            'let only what need not meet exactly deviate: parallel axes, and axes through one '
            'point, meet more equations than are needed',
        )
    return parts.as_linkage()


def _directions(joint: SpatialJoint) -> Vectors:
    """Return directions across, across and along the axis of a joint as drawn."""
    along = np.array(joint.axis) / np.linalg.norm(joint.axis)
    one = np.array(unit_across((along[0], along[1], along[2])))
    return np.array([one, np.cross(along, one), along])


def _tilt(hinge: SpatialJoint, angles: Sequence[float]) -> Vectors:
    """Return the rotation by small angles about both directions across an axis."""
    angle = hypot(*angles)
    if not angle:
        return np.eye(3)
    x, y, z = (np.array(angles) / angle @ _directions(hinge)[:2]).tolist()
    return np.array([turn_about((x, y, z), angle, (i, j, k)) for i, j, k in np.eye(3)]).T


class _DeviatingParts:
    """The links of a linkage, each moved from where it is drawn."""

    def __init__(
        self,
        linkage: SpaceLinkage,
        deviations: Mapping[tuple[str, str], Vector],
        tilts: Mapping[tuple[str, str], tuple[float, float]],
    ) -> None:
        self._linkage = linkage
        self._tilts = {
            (link, hinge): _tilt(linkage.hinges[hinge], angles)
            for (link, hinge), angles in tilts.items()
        }
        # For points on the axis of a hinge, on both of its links: the hinge.
        self._on_axes: dict[tuple[str, str], str] = {}
        pairs = {frozenset((h.parent, h.child)): name for name, h in linkage.hinges.items()}
        for point, *ends in linkage.shared_points(on_axes=True):
            self._on_axes |= {(link, point): pairs[frozenset(ends)] for link in ends}
        self._deviations = deviations
        self._links = linkage.link_names[1:]
        self._carriers: dict[str, list[str]] = {name: [] for name in linkage.points}
        for link, names in linkage.links.items():
            for name in names:
                self._carriers[name].append(link)
        drawn: dict[str, list[Vector]] = {link: [] for link in linkage.link_names}
        for link, names in linkage.links.items():
            drawn[link] += [linkage.points[name] for name in names]
        for hinge in linkage.hinges.values():
            drawn[hinge.parent].append(hinge.at)
            drawn[hinge.child].append(hinge.at)
        # Links turn about the middle of what they carry.
        self._middles = {
            link: np.mean(places, axis=0) if places else np.zeros(3)
            for link, places in drawn.items()
        }
        self._turns = {link: np.eye(3) for link in linkage.link_names}
        self._origins = dict(self._middles)
        self._size = size_of(linkage)

    def _place(self, link: str, name: str, drawn: Vector) -> Vectors:
        if (link, name) in self._on_axes:
            hinge = self._on_axes[link, name]
            at = self._linkage.hinges[hinge].at
            along = self._turn_of(link, hinge) @ np.subtract(drawn, at)
            return np.asarray(self._place(link, hinge, at) + along)
        off = np.array(self._deviations.get((link, name), (0.0, 0.0, 0.0)))
        arm = np.array(drawn) + off - self._middles[link]
        return np.asarray(self._origins[link] + self._turns[link] @ arm)

    def _point(self, name: str) -> tuple[str, Vectors]:
        """Return the first link that carries a point, and where the point is."""
        link = self._carriers[name][0]
        return link, self._place(link, name, self._linkage.points[name])

    def equations(self) -> tuple[Vectors, Vectors]:
        """Return the errors of all equations, and their slopes by the motions of all links."""
        rows = [*self._coincidences(), *self._joints(), *self._struts(), *self._ratios()]
        columns = {link: slice(6 * n, 6 * n + 6) for n, link in enumerate(self._links)}
        slopes = np.zeros((len(rows), 6 * len(columns)))
        for number, (_, of_links) in enumerate(rows):
            for link, slope in of_links.items():
                if link != GROUND:
                    slopes[number, columns[link]] += slope
        return np.array([error for error, _ in rows]), slopes

    def move(self, step: Vectors) -> None:
        """Move all links by displacements and turns."""
        for link, (*by, x, y, z) in zip(self._links, step.reshape(-1, 6), strict=True):
            self._origins[link] = self._origins[link] + np.array(by)
            about = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) / self._size
            # Cayley's transform is a rotation, whatever the size of the turn.
            half = 0.5 * about
            self._turns[link] = (
                np.linalg.solve(np.eye(3) - half, np.eye(3) + half) @ self._turns[link]
            )

    def _slope(self, link: str, place: Vectors, way: Vectors) -> Vectors:
        """Return how a place of a link moves along a direction."""
        return np.concatenate([way, np.cross(place - self._origins[link], way) / self._size])

    def _distance_along(
        self, first: str, second: str, places: tuple[Vectors, Vectors], way: Vectors
    ) -> Any:
        """Return how far two places of links are apart along a direction, with its slopes."""
        start, end = places
        slopes = {first: -self._slope(first, start, way), second: self._slope(second, end, way)}
        return float((end - start) @ way), slopes

    def _coincidences(self) -> Iterator[Any]:
        """Yield the errors of points that links share, and of axes."""
        shared = self._linkage.shared_points(on_axes=False)
        ends = [
            (first, second, name, self._linkage.points[name]) for name, first, second in shared
        ]
        ends += [(h.parent, h.child, name, h.at) for name, h in self._linkage.hinges.items()]
        for first, second, name, drawn in ends:
            places = self._place(first, name, drawn), self._place(second, name, drawn)
            for way in np.eye(3):
                yield self._distance_along(first, second, places, way)

    def _axes(self, name: str) -> tuple[Vectors, Vectors]:
        """Return across, across and along a joint's axis: the directions on parent and child."""
        joint = self._linkage.pair_joints[name]
        drawn = _directions(joint)
        on_parent, on_child = (
            drawn @ self._turn_of(link, name).T for link in (joint.parent, joint.child)
        )
        return on_parent, on_child

    def _turn_of(self, link: str, joint: str) -> Vectors:
        """Return the turn of a joint's directions on a link, from where they are drawn."""
        return self._turns[link] @ self._tilts.get((link, joint), np.eye(3))

    def _right_angle_error(
        self, joint: SpatialJoint, on_parent: Vectors, on_child: Vectors
    ) -> Any:
        """Return by how much two directions are off a right angle, times the size."""
        slope = np.concatenate([np.zeros(3), np.cross(on_parent, on_child)])
        return (
            float(on_parent @ on_child) * self._size,
            {joint.parent: slope, joint.child: -slope},
        )

    def _joints(self) -> Iterator[Any]:
        """Yield by how much joints turn or move where they may not, or are driven."""
        driven = self._linkage.driven
        for name, joint in self._linkage.pair_joints.items():
            (first, two, _), (_, second, along) = self._axes(name)
            yield self._right_angle_error(joint, first, along)
            yield self._right_angle_error(joint, two, along)
            if name in self._linkage.slides or name in driven:
                yield self._right_angle_error(joint, first, second)
            if name in self._linkage.slides:
                ways = self._axes(name)[0]
                for way in ways if name in driven else ways[:2]:
                    yield self._slide_motion(joint, way)

    def _slide_motion(self, joint: SpatialJoint, way: Vectors) -> Any:
        """Return how far the child of a slide has moved along a direction of the parent."""
        middle = self._middles[joint.child]
        drawn = middle[0], middle[1], middle[2]
        places = self._place(joint.parent, '', drawn), self._place(joint.child, '', drawn)
        moved, slopes = self._distance_along(joint.parent, joint.child, places, way)
        # The direction turns with the parent.
        slopes[joint.parent][3:] += np.cross(way, places[1] - places[0]) / self._size
        return moved, slopes

    def _joint_motion(self, name: str) -> Any:
        """Return how far a joint is from its value in the drawn pose, with its slopes."""
        joint = self._linkage.pair_joints[name]
        on_parent, on_child = self._axes(name)
        if name in self._linkage.slides:
            return self._slide_motion(joint, on_parent[2])
        angle = atan2(on_child[0] @ on_parent[1], on_child[0] @ on_parent[0])
        slope = np.concatenate([np.zeros(3), on_parent[2] / self._size])
        return angle, {joint.parent: -slope, joint.child: slope}

    def _struts(self) -> Iterator[Any]:
        """Yield by how much driven struts differ from their lengths."""
        for name in self._linkage.struts.keys() & {*self._linkage.driven}:
            ends = [self._point(point) for point in self._linkage.struts[name]]
            (first, start), (second, end) = ends
            way = (end - start) / np.linalg.norm(end - start)
            apart, slopes = self._distance_along(first, second, (start, end), way)
            yield apart - self._linkage.pose_value(name), slopes

    def _ratios(self) -> Iterator[Any]:
        """Yield by how much joints are off their ratios, angles times the size."""
        for name, ratio in self._linkage.ratios.items():
            terms = [(name, -1.0), *ratio.terms.items()]
            unit = self._size if name in self._linkage.hinges else 1.0
            error, slopes = 0.0, dict[str, Vectors]()
            for joint, factor in terms:
                moved, of_links = self._joint_motion(joint)
                error += unit * factor * moved
                for link, slope in of_links.items():
                    slopes[link] = slopes.get(link, 0.0) + unit * factor * slope
            yield error, slopes

    def as_linkage(self) -> SpaceLinkage:
        """Return the linkage in the pose in which the parts fit."""
        linkage = self._linkage

        def put_joint(joint: SpatialJoint, name: str) -> SpatialJoint:
            moved, _ = self._joint_motion(name)
            x, y, z = (self._turn_of(joint.parent, name) @ np.array(joint.axis)).tolist()
            value = joint.value if name in linkage.driven else joint.value + float(moved)
            placed = replace(joint, axis=(x, y, z), value=value)
            if name in linkage.slides:
                return placed
            return replace(placed, at=tuple(self._place(joint.parent, name, joint.at).tolist()))

        points = {
            name: tuple(self._point(name)[1].tolist()) if self._carriers[name] else place
            for name, place in linkage.points.items()
        }
        return replace(
            linkage,
            points=points,
            hinges={name: put_joint(joint, name) for name, joint in linkage.hinges.items()},
            slides={name: put_joint(joint, name) for name, joint in linkage.slides.items()},
            masses={link: self._put_mass(link, mass) for link, mass in linkage.masses.items()},
        )

    def _put_mass(self, link: str, mass: SpatialMass) -> SpatialMass:
        center = self._place(link, '', mass.center).tolist()
        axes = [(x, y, z) for x, y, z in self._turns[link].T.tolist()]
        return replace(mass, center=tuple(center), inertia=turned_tensor(axes, mass.inertia))
