# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
A spatial linkage as URDF: a tree of its joints, and loop joints, which close it.

Each joint keeps its name, sign and zero. A joint that closes a loop moves a frame of its own,
which a fixed loop joint welds to the link. A link that only balls hold hangs by one of them: on
two hinges if it is a rod, which then cannot spin, else on three. The other balls are loop joints,
in the form of Isaac Sim, which robot_state_publisher passes over and `linkage check` reads.
A strut is a rod that slides in a tube, on two hinges at its first point, a ball at its second.
"""

from __future__ import annotations

from dataclasses import replace
from math import atan2, hypot, isfinite
from xml.etree import ElementTree as ET

from linkage_ros.kinematics import (
    cross,
    direction_of,
    GROUND,
    GROUND_FRAME,
    length,
    minus,
    Ratio,
    scale,
    SpaceFrame,
    SpaceLinkage,
    SpatialJoint,
    turn_about,
    Vector,
)
from linkage_ros.tools.models.part import free_name
from linkage_ros.tools.models.urdf import FARTHEST, write_limits
from linkage_ros.tools.models.xml import format_number, format_numbers, xml_comment, xml_document

_HEAD = """\
A spatial linkage, cut open to a tree. Names, axes, signs and zeroes of the joints are as in the
published joint states. Lengths in [m], angles in [rad]. Limits that the linkage does not give are
made up. Each loop_joint says where two links meet."""

_FLAT = 1e-3
"""Sine of an angle below which directions are one."""


def space_urdf(name: str, linkage: SpaceLinkage) -> bytes:
    """Return a robot model of a spatial linkage."""
    return _SpaceTree(name, _with_slides(linkage)).write()


def _with_slides(linkage: SpaceLinkage) -> SpaceLinkage:
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


def _direction_across(way: Vector) -> Vector:
    return direction_of(max((cross(way, one) for one in GROUND_FRAME[:3]), key=length))


class _SpaceTree:
    def __init__(self, name: str, linkage: SpaceLinkage) -> None:
        self._linkage = linkage
        self._robot = ET.Element('robot', name=name)
        self._robot.append(xml_comment(_HEAD.splitlines()))
        self._starts: dict[str, ET.Element] = {}
        self._frames = {GROUND: GROUND_FRAME}
        """Frames in the pose of the links that are written."""
        self._hung: set[tuple[str, str]] = set()
        """Points with the links that hang by them."""
        ET.SubElement(self._robot, 'link', name=GROUND)

    def write(self) -> bytes:
        links, names = self._linkage.links, self._linkage.link_names
        left = dict(self._linkage.pair_joints)
        while any(self._grow(name, joint, left) for name, joint in [*left.items()]) or any(
            map(self._hang, links)
        ):
            pass
        for name, joint in left.items():
            frame = free_name(f'{name}_frame', {*names, *self._frames})
            self._add_joint(name, joint, joint.parent, frame)
            self._add_loop(name, 'fixed', (frame, joint.child), self._frames[frame].origin)
        for point, place in self._linkage.points.items():
            on = [
                link
                for link, points in links.items()
                if point in points and (point, link) not in self._hung
            ]
            for number, link in enumerate(on[1:]):
                name = f'{point}_{number + 1}' if number else point
                self._add_loop(name, 'spherical', (on[0], link), place)
        start = ET.SubElement(self._robot, 'linkage_start')
        order = dict.fromkeys((*self._linkage.driven, *self._starts))
        start.extend(map(self._starts.__getitem__, order))
        return xml_document(self._robot)

    def _grow(self, name: str, joint: SpatialJoint, left: dict[str, SpatialJoint]) -> bool:
        """Write a joint that leads from the tree to another link."""
        ends = sorted((joint.parent, joint.child), key=lambda link: link not in self._frames)
        if ends[0] not in self._frames or ends[1] in self._frames:
            return False
        del left[name]
        self._add_joint(name, joint, *ends)
        return True

    def _hang(self, link: str) -> bool:
        """Hang a link by a ball on the tree."""
        links, places = self._linkage.links, self._linkage.points
        for point in links[link] if link not in self._frames else ():
            on = [one for one, points in links.items() if point in points and one in self._frames]
            arms = [minus(places[other], places[point]) for other in links[link] if other != point]
            if not on:
                continue
            way = direction_of(arms[0])
            across = _direction_across(way)
            axes = [across, cross(way, across)]
            if any(length(cross(way, arm)) > _FLAT * length(arm) for arm in arms):
                axes.append(way)
            self._hung.add((point, link))
            chain = [
                free_name(f'{link}_{n}', self._linkage.link_names) for n in range(1, len(axes))
            ]
            for number, ends in enumerate(zip((on[0], *chain), (*chain, link), strict=True)):
                name = free_name(f'{link}_joint{number + 1}', self._linkage.pair_joints)
                self._add_joint(name, SpatialJoint(*ends, axes[number], places[point]), *ends)
            return True
        return False

    def _add_joint(self, name: str, joint: SpatialJoint, parent: str, child: str) -> None:
        linkage, on = self._linkage, self._frames[parent]
        # The tree may lead the other way.
        axis = scale(-1.0 if parent == joint.child else 1.0, direction_of(joint.axis))
        slides, at = name in linkage.slides, joint.at
        if slides:
            at = next((linkage.points[each] for each in linkage.links.get(child, ())), on.origin)
            self._frames[child] = on._replace(origin=at)
            at = minus(at, scale(joint.value, axis))
        else:
            x, y, z = (turn_about(axis, joint.value, way) for way in on[:3])
            self._frames[child] = SpaceFrame(x, y, z, at)
        ET.SubElement(self._robot, 'link', name=child)
        kind = 'revolute' if isfinite(joint.limits.low) else 'continuous'
        element = ET.SubElement(
            self._robot, 'joint', name=name, type='prismatic' if slides else kind
        )
        ET.SubElement(element, 'origin', xyz=format_numbers(*on.locate(at)), rpy='0 0 0')
        ET.SubElement(element, 'parent', link=parent)
        ET.SubElement(element, 'child', link=child)
        ET.SubElement(element, 'axis', xyz=format_numbers(*on.resolve(axis)))
        mimic = linkage.ratios.get(name)
        while mimic and (before := linkage.ratios.get(mimic.of)):
            # A joint mimics one that mimics none.
            offset = mimic.offset + mimic.ratio * before.offset
            mimic = Ratio(before.of, mimic.ratio * before.ratio, offset)
        computed = write_limits(element, joint.limits, -FARTHEST, FARTHEST, mimic)
        told = 'input' if name in linkage.driven else 'joint'
        self._starts[name] = ET.Element(told, name=name, value=format_number(joint.value))
        ET.SubElement(self._starts[name], 'computed', computed)

    def _add_loop(self, name: str, kind: str, links: tuple[str, str], place: Vector) -> None:
        """Write that two links meet at a place, which is given in the pose."""
        loop = ET.SubElement(self._robot, 'loop_joint', name=name, type=kind)
        one = self._frames[links[0]]
        for tag, link in zip(('link1', 'link2'), links, strict=True):
            frame = self._frames[link]
            rpy = format_numbers(*_roll_pitch_yaw(*map(frame.resolve, one[:3])))
            xyz = format_numbers(*frame.locate(place))
            ET.SubElement(loop, tag, link=link, xyz=xyz, rpy=rpy)


def _roll_pitch_yaw(x: Vector, y: Vector, z: Vector) -> Vector:
    """Return the angles about fixed axes that turn the ground's axes to these."""
    cosine = hypot(x[0], x[1])
    pitch = atan2(-x[2], cosine)
    if cosine < _FLAT:  # Roll and yaw turn about one axis.
        return atan2(-z[1], y[1]), pitch, 0.0
    return atan2(y[2], z[2]), pitch, atan2(x[1], x[0])
