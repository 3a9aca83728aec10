# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Rods whose balls are written as hinges: planned as rods, whatever their turn about themselves.

A robot's file has no balls: exporters write one as three hinges through one point, with two links
that carry nothing else. A rod between two balls may turn about itself, and nothing else depends on
that turn. So one hinge of a ball keeps its value: the one whose axis is most along the rod, if the
other two lie across each other, since these then point the rod nearly everywhere. The plan has the
links at that hinge as one.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

from linkage_ros.kinematics.plane.linkage import GROUND
from linkage_ros.kinematics.space.linkage import size_of, SpaceLinkage
from linkage_ros.kinematics.space.merged_pose import MERGED
from linkage_ros.kinematics.space.vectors import (
    cross,
    direction_of,
    dot,
    length,
    minus,
    plus,
    scale,
    Vector,
)
from linkage_ros.names import free_name

_INDEPENDENT = 0.1
"""Least volume that the axes of a ball span in the pose: 1 if they are at right angles."""


class _Ball(NamedTuple):
    """A ball of a rod: its place, and the hinges that it is written as, if any."""

    place: Vector
    hinges: tuple[str, ...] = ()  # From the rod on
    on: str = ''  # The link to which they lead


class BallsOfHinges(NamedTuple):
    """A linkage with balls for such hinges, and the same linkage with the hinges of its rods."""

    linkage: SpaceLinkage
    hung: SpaceLinkage | None  # None if there are none
    one_with: Mapping[str, str]  # For each link that is not there, that which it is one with


def plan_balls_of_hinges(linkage: SpaceLinkage) -> BallsOfHinges:
    """Return a linkage whose rods hang on balls, and the same whose rods do not spin."""
    one_with: dict[str, str] = {}
    held: dict[str, float] = {}
    chains: list[str] = []
    points, links = dict(linkage.points), dict(linkage.links)
    for rod, balls in _rods(linkage):
        name = _hinge_to_hold(linkage, balls)
        if name in chains:
            continue
        hinge = linkage.hinges[name]
        held[name] = hinge.value
        gone, kept = hinge.parent, hinge.child
        if gone in (rod, GROUND) or links.get(gone) or gone == balls[0].on:
            gone, kept = kept, gone
        one_with[gone] = kept
        for ball in balls:
            if ball.hinges:
                chains += ball.hinges
                point = free_name(f'{rod}_ball', points)
                points[point] = ball.place
                for link in (rod, ball.on):
                    links[link] = (*links.get(link, ()), point)
    if not held:
        return BallsOfHinges(linkage, None, {})
    on_balls = replace(
        linkage,
        points=points,
        links=links,
        hinges={name: hinge for name, hinge in linkage.hinges.items() if name not in chains},
    )
    hinges = {
        name: replace(
            hinge,
            parent=one_with.get(hinge.parent, hinge.parent),
            child=one_with.get(hinge.child, hinge.child),
        )
        for name, hinge in linkage.hinges.items()
        if name not in held
    }
    hung = replace(on_balls, hinges=hinges, held=held)
    return BallsOfHinges(on_balls, hung, one_with)


def _rods(linkage: SpaceLinkage) -> Iterator[tuple[str, list[_Ball]]]:
    """Yield the links that two balls hold and nothing else, of which hinges are one."""
    joints = defaultdict[str, list[str]](list)
    for name, joint in linkage.pair_joints.items():
        joints[joint.parent].append(name)
        joints[joint.child].append(name)
    carried = Counter(point for points in linkage.links.values() for point in points)
    moved = {point for ends in linkage.struts.values() for point in ends}
    reach = MERGED * size_of(linkage)
    for link in linkage.link_names:
        points = [one for one in linkage.links.get(link, ()) if carried[one] > 1 or one in moved]
        if link == GROUND or len(points) + len(joints[link]) != 2 or not joints[link]:
            continue
        balls = [_Ball(linkage.points[point]) for point in points if point not in moved]
        balls += filter(None, (_ball(linkage, joints, link, name, reach) for name in joints[link]))
        if len(balls) == 2:
            yield link, sorted(balls, key=lambda ball: not ball.hinges)


def _ball(
    linkage: SpaceLinkage, joints: dict[str, list[str]], link: str, first: str, reach: float
) -> _Ball | None:
    """Return the ball that three hinges from a link on are; None if they are none."""
    chain, at = [first], link
    while True:
        joint = linkage.pair_joints[chain[-1]]
        at = joint.child if joint.parent == at else joint.parent
        if len(chain) == 3:
            break
        if at == GROUND or len(joints[at]) != 2 or linkage.links.get(at):
            return None
        chain.append(next(name for name in joints[at] if name != chain[-1]))
    if not linkage.hinges.keys() >= {*chain} or not {*chain}.isdisjoint(
        (*linkage.driven, *linkage.ratios, *(ratio.of for ratio in linkage.ratios.values()))
    ):
        return None
    one, two, three = (linkage.hinges[name] for name in chain)
    u, v = direction_of(one.axis), direction_of(two.axis)
    normal = cross(u, v)
    square = dot(normal, normal)
    if abs(dot(normal, direction_of(three.axis))) < _INDEPENDENT:
        return None
    # The point of the first axis that is nearest to the second.
    along = dot(cross(minus(two.at, one.at), v), normal) / square
    place = plus(one.at, scale(along, u))
    for hinge in (two, three):
        if length(cross(minus(place, hinge.at), direction_of(hinge.axis))) > reach:
            return None
    return _Ball(place, tuple(chain), at)


def _hinge_to_hold(linkage: SpaceLinkage, balls: list[_Ball]) -> str:
    """Return the hinge that is most along the rod, where the others lie across each other."""
    rod = direction_of(minus(balls[1].place, balls[0].place))
    fitness = {}
    for ball in balls:
        axes = {name: direction_of(linkage.hinges[name].axis) for name in ball.hinges}
        for name, axis in axes.items():
            others = (other for of, other in axes.items() if of != name)
            fitness[name] = abs(dot(axis, rod)) * length(cross(*others))
    return max(fitness, key=fitness.__getitem__, default='')
