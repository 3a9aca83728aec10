# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
A spatial linkage: points in one pose, links that carry them, and the joints between links.

Lengths are in metres, angles in radians. A point that two links carry is a ball joint; a link of
two points is a rod. In the pose every joint has its ``value``, which is 0 unless said.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations
from math import dist, frexp, isfinite, ldexp
from typing import ClassVar

from linkage_ros.errors import DefinitionError, quote
from linkage_ros.kinematics.checks import (
    check_all_limits,
    check_inputs,
    check_name,
    check_named_once,
    check_ratios,
    check_traced,
    check_weighed,
)
from linkage_ros.kinematics.plane.linkage import (
    AssemblyPose,
    GROUND,
    Input,
    JointedLinkage,
    Limits,
    NO_LIMITS,
    PoseCorrections,
    Ratio,
    remove_limits,
    RevoluteJoint,
    SlideJoint,
)
from linkage_ros.kinematics.space.masses import MASSLESS, SpatialMass
from linkage_ros.kinematics.space.vectors import (
    cross,
    direction_of,
    length,
    minus,
    Vector,
    ZERO,
)

ONE_PLACE = 1e-6
"""Extent of axes that meet in one place but for rounding, in [m]."""


_MOST_LINKS, _MOST_POINTS = 120, 10_000
"""Most links, and most points of all links together: what moves is found in seconds."""


@dataclass(frozen=True, slots=True)
class SpatialJoint:
    """
    A hinge of ``child`` on ``parent``, or a slide.

    Attributes
    ----------
    parent, child
        Names of the links.
    axis
        Its direction in the pose; the joint turns or moves the child positively about or along
        it. Any length but zero.
    at
        A point of the axis of a hinge, in the pose, in [m].
    value
        Its value in the pose, in [rad] or [m].
    limits
        Its limits.

    """

    parent: str
    child: str
    axis: Vector
    at: Vector = ZERO
    value: float = 0.0
    limits: Limits = NO_LIMITS

    def __post_init__(self) -> None:
        for field_name in ('axis', 'at'):
            object.__setattr__(self, field_name, _as_doubles(getattr(self, field_name)))
        object.__setattr__(self, 'value', float(self.value))


def _as_doubles(vector: Iterable[float]) -> Vector:
    """Return a vector of Python's numbers: NumPy's divide by 0, and print, in their own way."""
    x, y, z = map(float, vector)
    return x, y, z


@dataclass(frozen=True)
class SpaceLinkage(JointedLinkage):
    """
    A spatial linkage, as its file says it.

    Attributes
    ----------
    points
        The points in the pose, in the frame of the ground, in [m].
    links
        The points that each link carries; links that only joints name are left out.
    hinges, slides
        The joints, by name.
    struts
        Pairs of points whose distance is a joint, by name.
    driven, published
        Names of the driven and of the published joints: of hinges, slides and struts.
    ratios
        How a joint follows another, by name.
    traced
        Names of points whose paths are drawn.
    masses
        Masses by link name; given only for forces, and then for every link that moves.
    left_out
        What belongs to no loop of the robot that it is read from.
    corrections
        What was corrected in the pose.
    held
        Values of published joints that are left out of the hinges, since they never change.
    strut_limits
        Limits of struts, by name.

    """

    axes: ClassVar = ('x', 'y', 'z')
    """The names of the axes of the ground."""

    points: Mapping[str, Vector]
    links: Mapping[str, tuple[str, ...]]
    hinges: Mapping[str, SpatialJoint]
    slides: Mapping[str, SpatialJoint]
    struts: Mapping[str, tuple[str, str]]
    driven: tuple[str, ...]
    published: tuple[str, ...]
    ratios: Mapping[str, Ratio] = field(default_factory=dict)
    traced: tuple[str, ...] = ()
    masses: Mapping[str, SpatialMass] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()
    corrections: PoseCorrections = field(default_factory=PoseCorrections)
    held: Mapping[str, float] = field(default_factory=dict)
    strut_limits: Mapping[str, Limits] = field(default_factory=dict)

    def __post_init__(self) -> None:
        points = {name: _as_doubles(place) for name, place in self.points.items()}
        object.__setattr__(self, 'points', points)

    @cached_property
    def pair_joints(self) -> dict[str, SpatialJoint]:
        """Return the hinges and slides by name."""
        return {**self.hinges, **self.slides}

    @cached_property
    def link_names(self) -> tuple[str, ...]:
        """Return all links, the ground first."""
        ends = (end for joint in self.pair_joints.values() for end in (joint.parent, joint.child))
        return tuple(dict.fromkeys((GROUND, *self.links, *ends)))

    def with_masses(
        self, masses: Mapping[str, SpatialMass], massless: Iterable[str]
    ) -> SpaceLinkage:
        """Return the linkage with masses; some other links are massless."""
        weighed = replace(self, masses=masses)
        return replace(weighed, masses=weighed.masses_with(*massless))

    def masses_with(self, *links: str) -> Mapping[str, SpatialMass]:
        """Return the masses with those of links that are added: they have none."""
        return {**dict.fromkeys(links, MASSLESS), **self.masses} if self.masses else {}

    def without_limits(self, joints: Collection[str]) -> SpaceLinkage:
        """Return the linkage without the limits of some joints' ranges."""
        hinges, slides = remove_limits(self.hinges, joints), remove_limits(self.slides, joints)
        return replace(self, hinges=hinges, slides=slides)

    def with_limits(self, limits: Mapping[str, Limits]) -> SpaceLinkage:
        """Return the linkage with other limits of some joints."""

        def limit_joints(joints: Mapping[str, SpatialJoint]) -> dict[str, SpatialJoint]:
            return {
                name: replace(joint, limits=limits.get(name, joint.limits))
                for name, joint in joints.items()
            }

        of_struts = {name: of for name, of in limits.items() if name in self.struts}
        return replace(
            self,
            hinges=limit_joints(self.hinges),
            slides=limit_joints(self.slides),
            strut_limits={**self.strut_limits, **of_struts},
        )

    def shared_points(self, *, on_axes: bool) -> Iterator[tuple[str, str, str]]:
        """Yield each point with the links that share it: on the axis of their hinge, or not."""
        for first, second in combinations(self.links, 2):
            axes = [h for h in self.hinges.values() if {h.parent, h.child} == {first, second}]
            for name in self.links[first]:
                if name in self.links[second] and on_axes is any(
                    _distance_from_axis(self.points[name], hinge) <= ONE_PLACE for hinge in axes
                ):
                    yield name, first, second

    @cached_property
    def holes(self) -> dict[tuple[str, str], Vector]:
        """
        Return where each link carries points and the places of hinges, in [m].

        Points on the axis of a hinge between links that share them are the hinge's. Hinges in one
        place are a ball or a universal joint: its axes meet.
        """
        shared = {(end, name) for name, *ends in self.shared_points(on_axes=True) for end in ends}
        places = {
            (link, name): self.points[name]
            for link, names in self.links.items()
            for name in names
            if (link, name) not in shared
        }
        hinges_at = Counter(hinge.at for hinge in self.hinges.values())
        for name, hinge in self.hinges.items():
            if hinges_at[hinge.at] == 1:
                places |= {(end, name): hinge.at for end in (hinge.parent, hinge.child)}
        return places

    @cached_property
    def inputs(self) -> tuple[Input, ...]:
        """Return the driven joints, as those of a planar linkage."""
        return tuple(map(self._as_input, self.driven))

    @cached_property
    def joints(self) -> dict[str, RevoluteJoint | SlideJoint]:
        """Return the published joints, as those of a planar linkage."""
        return {name: self._as_input(name).as_joint() for name in self.published}

    @cached_property
    def driven_joints(self) -> tuple[Input, ...]:
        """Return the inputs, then the joints that follow others, as if they were inputs."""
        return (*self.inputs, *map(self._as_input, self.ratios))

    @cached_property
    def pose(self) -> AssemblyPose:
        """Return the inputs of the pose."""
        return AssemblyPose(tuple(map(self.pose_value, self.driven)), {})

    def pose_value(self, name: str) -> float:
        """Return the value of a joint in the pose, in [rad] or [m]."""
        if name in self.struts:
            first, second = self.struts[name]
            return dist(self.points[first], self.points[second])
        return self.pair_joints[name].value

    def _as_input(self, name: str) -> Input:
        if name in self.struts:
            return Input(name, slider=name, limits=self.strut_limits.get(name, NO_LIMITS))
        joint = self.pair_joints[name]
        slider = name if name in self.slides else ''
        return Input(name, joint.parent, joint.child, slider, joint.limits)


def check_space_linkage(linkage: SpaceLinkage) -> None:
    """Refuse a linkage whose parts do not match; the error names the key of the part."""
    links, points_of_all = len(linkage.link_names), sum(map(len, linkage.links.values()))
    if links > _MOST_LINKS or points_of_all > _MOST_POINTS:
        raise DefinitionError(
            'links',
            f'{links} with {points_of_all} points',
            f'keep {_MOST_LINKS} links, and {_MOST_POINTS} points of links, at most',
        )
    for link, points in linkage.links.items():
        for point in points:
            check_name(f'links.{link}', point, 'point', linkage.points)
        check_named_once(f'links.{link}', points)
    for name, ends in linkage.struts.items():
        for point in ends:
            check_name(f'struts.{name}', point, 'point', linkage.points)
        if dist(*(linkage.points[point] for point in ends)) == 0.0:
            reason = f'{quote(ends[0])} and {quote(ends[1])} are in one place'
            raise DefinitionError(f'struts.{name}', reason, 'name two points apart')
    for kind, joints in (('hinges', linkage.hinges), ('slides', linkage.slides)):
        for name, joint in joints.items():
            if joint.parent == joint.child:
                raise DefinitionError(
                    f'{kind}.{name}.child', f'{quote(joint.child)} is its own parent',
                    'name two links',
                )  # fmt: skip
            if not isfinite(length(joint.axis)) or length(joint.axis) < 1e-100:
                axis = ', '.join(f'{component:g}' for component in joint.axis)
                raise DefinitionError(
                    f'{kind}.{name}.axis', f'[{axis}] has no direction',
                    'write for example [0, 0, 1]',
                )  # fmt: skip
    _check_held(linkage)
    _check_joints(linkage)
    check_traced(linkage, linkage.points)
    check_weighed(linkage.link_names, linkage.masses)
    check_all_limits(linkage)


def _check_held(linkage: SpaceLinkage) -> None:
    """Refuse a link that a single ball holds, and a point that nothing carries."""
    carried = Counter(point for points in linkage.links.values() for point in points)
    ends = {end for joint in linkage.pair_joints.values() for end in (joint.parent, joint.child)}
    if GROUND not in {*ends, *linkage.links}:
        reason = f'no link is called {GROUND}'
        raise DefinitionError('links', reason, f'call the one that stands still {GROUND}')
    moved = {point for pair in linkage.struts.values() for point in pair}
    for link, points in linkage.links.items():
        if link in ends or link == GROUND:
            continue
        places = [linkage.points[point] for point in points]
        for number, place in enumerate(places):
            if place in places[:number]:
                first, second = points[places.index(place)], points[number]
                reason = f'{quote(first)} and {quote(second)} are in one place'
                raise DefinitionError(f'links.{link}', reason, 'name points apart')
        if sum(carried[point] > 1 for point in points) < 2:
            remedy = (
                f'add the hinge of {quote(link)}, or name its points on the links that hold it'
            )
            if not moved.isdisjoint(points):
                remedy = (
                    'struts move it and hold nothing: hang it on three slides and a ball, as '
                    'linkage gallery hexapod does'
                )
            raise DefinitionError(f'links.{link}', 'is held by one ball at most, and free', remedy)
    for name, (first, second) in linkage.struts.items():
        for point in (first, second):
            if not carried[point]:
                raise DefinitionError(
                    f'struts.{name}', f'no link carries {quote(point)}', 'name it under links'
                )


def _check_joints(linkage: SpaceLinkage) -> None:
    """Refuse inputs, published joints and ratios that name no joint, or do not fit the pose."""
    names = (*linkage.pair_joints, *linkage.struts)
    for key, chosen in (('input', linkage.driven), ('joints', linkage.published)):
        for name in chosen:
            check_name(key, name, 'joint', names)
        check_named_once(key, chosen)
    check_inputs(linkage)
    check_ratios(linkage, linkage.pair_joints, 'hinge or slide', names)
    for name, ratio in linkage.ratios.items():
        expected = ratio.value_at({term: linkage.pose_value(term) for term in ratio.terms})
        value = linkage.pose_value(name)
        if abs(expected - value) > 1e-9 * (1.0 + abs(expected)):
            raise DefinitionError(
                f'ratios.{name}',
                f'gives {expected:.6g} in the pose, where {quote(name)} is {value:.6g}',
                'write the offset that fits the pose',
            )


def _distance_from_axis(place: Vector, hinge: SpatialJoint) -> float:
    """Return how far a place is from the axis of a hinge, in [m]."""
    return length(cross(minus(place, hinge.at), direction_of(hinge.axis)))


def size_of(linkage: SpaceLinkage) -> float:
    """
    Return the size of a linkage: the greatest extent of its points and hinges, in [m].

    Hinges alone that meet within a micrometre meet in one place, which has no size: then it is 1.
    """
    places = [*linkage.points.values(), *(hinge.at for hinge in linkage.hinges.values())]
    size = extent_of(places)
    return size if size > (0.0 if linkage.points else ONE_PLACE) else 1.0


def extent_of(places: Iterable[Vector]) -> float:
    """Return the greatest extent of places along an axis of the ground."""
    return max((max(row) - min(row) for row in zip(*places, strict=True)), default=0.0)


def unit_of(linkage: SpaceLinkage) -> float:
    """Return the power of two above the size of a linkage, in [m]."""
    return ldexp(1.0, frexp(size_of(linkage))[1])
