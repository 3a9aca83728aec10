# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Joints for what balls and struts leave open, so that joints alone say where every link is.

A link that only balls hold hangs by one of them: on two hinges if it is a rod, which then cannot
spin, else on three. A strut is a rod that slides in a tube, on two hinges at its first point. A
robot model has these joints, and who moves the model needs their values.
"""

from __future__ import annotations

from dataclasses import replace

from linkage_ros.kinematics.plane.linkage import GROUND
from linkage_ros.kinematics.space.linkage import SpaceLinkage, SpatialJoint
from linkage_ros.kinematics.space.vectors import (
    cross,
    direction_of,
    GROUND_FRAME,
    length,
    minus,
    Vector,
)
from linkage_ros.names import free_name

_FLAT = 1e-3
"""Sine of an angle below which directions are one."""


def with_rod_joints(linkage: SpaceLinkage) -> SpaceLinkage:
    """Return the linkage with joints that place every link, all of them published."""
    named = linkage.link_names
    linkage = _hang_links(_with_tubes(linkage))
    left = [name for name in linkage.pair_joints if name not in linkage.driven]
    return replace(
        linkage,
        published=tuple(dict.fromkeys((*linkage.published, *left))),
        masses=linkage.masses_with(*(link for link in linkage.link_names if link not in named)),
    )


def _with_tubes(linkage: SpaceLinkage) -> SpaceLinkage:
    """Return the linkage with a tube and a rod for each strut, between which it is a slide."""
    hinges, slides = dict(linkage.hinges), dict(linkage.slides)
    links, names = dict(linkage.links), {*linkage.link_names}
    for strut, (start, end) in linkage.struts.items():
        at, on = linkage.points[start], next(link for link in links if start in links[link])
        way = direction_of(minus(linkage.points[end], at))
        across = _direction_across(way)
        cross_link, tube, rod = (
            free_name(f'{strut}_{part}', names) for part in ('cross', 'tube', 'rod')
        )
        names |= {cross_link, tube, rod}
        taken = {*hinges, *slides, *linkage.struts}
        for axis, letter, ends in (
            (across, 'x', (on, cross_link)), (cross(way, across), 'y', (cross_link, tube)),
        ):  # fmt: skip
            hinges[free_name(f'{strut}_{letter}', taken)] = SpatialJoint(*ends, axis, at)
        slides[strut] = SpatialJoint(tube, rod, way, value=linkage.pose_value(strut))
        links[rod] = (end,)
    return replace(linkage, hinges=hinges, slides=slides, links=links, struts={})


def _hang_links(linkage: SpaceLinkage) -> SpaceLinkage:
    """Return the linkage with hinges by which links hang that no joint leads to."""
    reached = _reach({GROUND}, linkage)
    while hanging := next(
        (
            (link, point)
            for link, points in linkage.links.items()
            for point in points
            if link not in reached and any(point in linkage.links.get(on, ()) for on in reached)
        ),
        None,
    ):
        linkage = _hang(linkage, *hanging, reached)
        reached = _reach(reached, linkage)
    return linkage


def _reach(reached: set[str], linkage: SpaceLinkage) -> set[str]:
    """Return the links to which joints lead from some links."""
    reached, before = {*reached}, 0
    while before != len(reached):
        before = len(reached)
        for joint in linkage.pair_joints.values():
            if {joint.parent, joint.child} & reached:
                reached |= {joint.parent, joint.child}
    return reached


def _hang(linkage: SpaceLinkage, link: str, point: str, reached: set[str]) -> SpaceLinkage:
    """Return the linkage with a link on hinges at a point that a link among others carries."""
    places, points = linkage.points, linkage.links[link]
    on = next(link for link in linkage.links if link in reached and point in linkage.links[link])
    arms = [minus(places[name], places[point]) for name in points if name != point]
    way = direction_of(arms[0])
    across = _direction_across(way)
    axes = [across, cross(way, across)]
    if any(length(cross(way, arm)) > _FLAT * length(arm) for arm in arms):
        axes.append(way)
    chain = [free_name(f'{link}_{n}', linkage.link_names) for n in range(1, len(axes))]
    hinges = dict(linkage.hinges)
    for number, ends in enumerate(zip((on, *chain), (*chain, link), strict=True)):
        name = free_name(f'{link}_joint{number + 1}', (*hinges, *linkage.slides))
        hinges[name] = SpatialJoint(*ends, axes[number], places[point])
    # The hinges are there instead of the ball.
    left = tuple(name for name in points if name != point)
    return replace(linkage, hinges=hinges, links={**linkage.links, link: left})


def _direction_across(way: Vector) -> Vector:
    return direction_of(max((cross(way, axis) for axis in GROUND_FRAME[:3]), key=length))
