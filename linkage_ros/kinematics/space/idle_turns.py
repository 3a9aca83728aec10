# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Links that may turn about a line while nothing else moves: planned with that turn held.

A robot's file has no balls: exporters write one as three hinges through one point, with two links
that carry nothing else. A rod between two balls may turn about itself, and nothing else depends on
that turn; its parts may slide in each other. So may a link between two hinges on one line, or
between a hinge and a ball on its line. One hinge of each keeps its value. Of a ball it is the one
whose axis is most along the rod, if the other two lie across each other, since these then point
the rod nearly everywhere. Where several would do, names decide, and not the order of a file. The
plan has the links at that hinge as one, and rods on balls.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

from linkage_ros.errors import DefinitionError, quote
from linkage_ros.kinematics.plane.linkage import GROUND
from linkage_ros.kinematics.space.linkage import size_of, SpaceLinkage, SpatialJoint
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

_ALIKE = 1e-6
"""Difference in fitness of two hinges that their file's rounding may make."""

_OF_BALL = 3
"""Hinges of a ball."""


class _IdleEnd(NamedTuple):
    """Where a rod hangs: on a ball, one written as three hinges, or one hinge."""

    link: str  # Of the rod
    place: Vector
    on: tuple[str, ...]  # Links beyond it
    hinges: tuple[str, ...] = ()  # From the rod on


class IdleTurns(NamedTuple):
    """A linkage whose idle turns are held."""

    still: SpaceLinkage  # Links at a hinge that is held are one
    planned: SpaceLinkage  # The same with rods on balls instead of their hinges
    hung: SpaceLinkage | None  # The same with both; None if no ball is written as hinges
    one_with: Mapping[str, str]  # For each link that is not there, that which it is one with


def hold_idle_turns(linkage: SpaceLinkage) -> IdleTurns:
    """Return the linkage with a hinge held for each turn that moves nothing else."""
    reach, still = MERGED * size_of(linkage), linkage
    one_with: dict[str, str] = {}
    rods: list[list[_IdleEnd]] = []
    while idle := next(_idle_turns(still, reach), None):
        name, gone, balls = idle
        _check_traced(still, name, gone, balls, reach)
        (kept,) = {still.hinges[name].parent, still.hinges[name].child} - {gone}
        one_with = {of: kept if on == gone else on for of, on in one_with.items()} | {gone: kept}
        still = _as_one(still, name, gone, kept)
        # Of rods in a row on one line the last is planned, and the others hang on its hinges.
        chain = {name, *(hinge for ball in balls for hinge in ball.hinges)}
        rods = [rod for rod in rods if chain.isdisjoint(h for ball in rod for h in ball.hinges)]
        rods.append([ball for ball in balls if ball.hinges])
    points, links, chains = dict(linkage.points), dict(still.links), set[str]()
    for ball in (ball for rod in rods for ball in rod):
        chains |= {*ball.hinges}
        point = free_name(f'{ball.link}_ball', points)
        points[point] = ball.place
        for link in (
            one_with.get(link_before, link_before) for link_before in (ball.link, *ball.on)
        ):
            links[link] = (*links.get(link, ()), point)
    hung = replace(still, points=points, links=links)
    hinges = {name: hinge for name, hinge in still.hinges.items() if name not in chains}
    planned = replace(hung, hinges=hinges)
    return IdleTurns(still, planned, hung if chains else None, one_with)


def _check_traced(
    linkage: SpaceLinkage, name: str, gone: str, balls: list[_IdleEnd], reach: float
) -> None:
    """Refuse a traced point that a turn moves which nothing determines."""
    hinge = linkage.hinges[name]
    at, axis = hinge.at, hinge.axis
    if balls:
        at, axis = balls[0].place, minus(balls[1].place, balls[0].place)
    for link in dict.fromkeys([ball.link for ball in balls] or [gone]):
        for point in linkage.links.get(link, ()):
            arm = minus(linkage.points[point], at)
            if point in linkage.traced and length(cross(arm, direction_of(axis))) > reach:
                reason = f'{quote(point)} is on {link}, which may turn about itself'
                raise DefinitionError('traced', reason, 'trace a point on its axis, or drive it')


def _as_one(linkage: SpaceLinkage, name: str, gone: str, kept: str) -> SpaceLinkage:
    """Return the linkage with the links at a hinge as one."""

    def join(joints: Mapping[str, SpatialJoint]) -> dict[str, SpatialJoint]:
        ends = {
            of: [kept if end == gone else end for end in (joint.parent, joint.child)]
            for of, joint in joints.items()
            if of != name
        }
        return {
            of: replace(joints[of], parent=parent, child=two) for of, (parent, two) in ends.items()
        }

    links = dict(linkage.links)
    if points := links.pop(gone, ()):
        links[kept] = tuple(dict.fromkeys((*links.get(kept, ()), *points)))
    return replace(
        linkage,
        links=links,
        hinges=join(linkage.hinges),
        slides=join(linkage.slides),
        held={**linkage.held, name: linkage.hinges[name].value},
    )


def _rods(linkage: SpaceLinkage, reach: float) -> Iterator[list[_IdleEnd]]:
    """Yield the ends of links that two of them hold and nothing else, and not only balls."""
    joints = defaultdict[str, list[str]](list)
    for name, joint in sorted(linkage.pair_joints.items()):
        joints[joint.parent].append(name)
        joints[joint.child].append(name)
    carriers = defaultdict[str, list[str]](list)
    for link, points in linkage.links.items():
        for point in points:
            carriers[point].append(link)
    moved = {point for ends in linkage.struts.values() for point in ends}
    seen = {GROUND}
    for first in sorted(linkage.link_names):
        ends, parts = list[_IdleEnd | None](), [first]
        for link in parts:
            for point in linkage.links.get(link, ()):
                on = tuple(carrier for carrier in carriers[point] if carrier != link)
                if point in moved:
                    ends.append(None)
                elif on:
                    ends.append(_IdleEnd(link, linkage.points[point], on))
            for name in joints[link]:
                if name in linkage.hinges:
                    ends.append(_end_at(linkage, joints, link, name, reach))
                else:
                    slide = linkage.slides[name]
                    parts += [end for end in (slide.parent, slide.child) if end not in parts]
        known_ends = [end for end in ends if end is not None]
        is_held = len(known_ends) == len(ends) == 2 and any(end.hinges for end in known_ends)
        if is_held and seen.isdisjoint(parts):
            yield sorted(
                known_ends, key=lambda end: ((1, _OF_BALL, 0).index(len(end.hinges)), end.hinges)
            )
        seen |= {*parts} - {GROUND}


def _idle_turns(linkage: SpaceLinkage, reach: float) -> Iterator[tuple[str, str, list[_IdleEnd]]]:
    """Yield hinges to hold, with one of their links, and the balls of the rod that spins."""
    rods, beyond = [*_rods(linkage, reach)], defaultdict[str, list[Vector]](list)
    for ends in rods:
        if len(ends[0].hinges) != 1 and _are_apart([end.place for end in ends], reach):
            hinge = linkage.hinges[name := _hinge_to_hold(linkage, ends)]
            used = {link for end in ends for link in (end.link, *end.on)}
            yield name, hinge.child if hinge.parent in used else hinge.parent, ends
        if len(ends[1].hinges) != 1:
            beyond[ends[0].hinges[0]].append(ends[1].place)
    for ends in rods:
        first, *second = (linkage.hinges[end.hinges[0]] for end in ends if end.hinges)
        axis, places = direction_of(first.axis), [hinge.at for hinge in second] or [ends[1].place]
        if any(length(cross(axis, direction_of(hinge.axis))) > reach for hinge in second):
            # Four hinges through one point are a mechanism, unless balls at two are on its line.
            places = beyond[ends[0].hinges[0]]
            if len(ends[0].hinges) != 1 or not _are_apart(places, reach):
                continue
        on = [
            {hinge.parent, hinge.child} - {end.link}
            for end, hinge in zip(ends, [first, *second], strict=False)
        ]
        is_door = not on[0].isdisjoint(on[1] if second else ends[1].on)
        arms = [minus(place, first.at) for place in places]
        if not is_door and max(length(cross(arm, axis)) for arm in arms) <= reach:
            yield ends[0].hinges[0], ends[0].link, []


def _are_apart(places: list[Vector], reach: float) -> bool:
    return len(places) == 2 and length(minus(places[1], places[0])) > reach


def _end_at(
    linkage: SpaceLinkage, joints: dict[str, list[str]], link: str, first: str, reach: float
) -> _IdleEnd | None:
    """Return the end that a hinge of a link is, or three through one point; None if driven."""
    followed = (of for ratio in linkage.ratios.values() for of in ratio.terms)
    driven = {*linkage.driven, *linkage.ratios, *followed}
    if first in driven:
        return None
    joint, chain = linkage.pair_joints[first], [first]
    at = joint.child if joint.parent == link else joint.parent
    alone = _IdleEnd(link, joint.at, (at,), (first,))
    while len(chain) < _OF_BALL:
        if at == GROUND or len(joints[at]) != 2 or linkage.links.get(at):
            return alone
        chain.append(next(name for name in joints[at] if name != chain[-1]))
        joint = linkage.pair_joints[chain[-1]]
        at = joint.child if joint.parent == at else joint.parent
    if not linkage.hinges.keys() >= {*chain} or not driven.isdisjoint(chain):
        return alone
    one, two, three = (linkage.hinges[name] for name in chain)
    u, v = direction_of(one.axis), direction_of(two.axis)
    normal = cross(u, v)
    square = dot(normal, normal)
    if abs(dot(normal, direction_of(three.axis))) < _INDEPENDENT:
        return alone
    # The point of the first axis that is nearest to the second.
    along = dot(cross(minus(two.at, one.at), v), normal) / square
    place = plus(one.at, scale(along, u))
    for hinge in (two, three):
        if length(cross(minus(place, hinge.at), direction_of(hinge.axis))) > reach:
            return alone
    return _IdleEnd(link, place, (at,), tuple(chain))


def _hinge_to_hold(linkage: SpaceLinkage, balls: list[_IdleEnd]) -> str:
    """Return the hinge that is most along the rod, where the others lie across each other."""
    rod = direction_of(minus(balls[1].place, balls[0].place))
    fitness = {}
    for ball in balls:
        axes = {name: direction_of(linkage.hinges[name].axis) for name in ball.hinges}
        for name, axis in axes.items():
            others = (axis for of, axis in axes.items() if of != name)
            fitness[name] = abs(dot(axis, rod)) * length(cross(*others))
    best = max(fitness.values(), default=0.0)
    return min((name for name, fit in fitness.items() if fit > best - _ALIKE), default='')
