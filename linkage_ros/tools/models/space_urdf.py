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
"""

from __future__ import annotations

from math import atan2, hypot, isfinite
from xml.etree import ElementTree as ET

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import (
    cross,
    direction_of,
    GROUND,
    GROUND_FRAME,
    length,
    minus,
    NO_LIMITS,
    scale,
    SpaceClosure,
    SpaceFrame,
    SpaceLinkage,
    SpatialJoint,
    turn_about,
)
from linkage_ros.tools.models.part import free_name
from linkage_ros.tools.models.urdf import EFFORT, FARTHEST, VELOCITY
from linkage_ros.tools.models.xml import format_number, format_numbers, xml_comment, xml_document

_HEAD = """\
A spatial linkage, cut open to a tree. Names, axes, signs and zeroes of the joints are as in the
published joint states. Lengths in [m], angles in [rad]. Efforts and velocities that the linkage
does not give are made up. Each loop_joint says which frames of two links meet."""

_FLAT = 1e-3
"""Sine of an angle below which directions are one."""


def space_urdf(name: str, closure: SpaceClosure) -> bytes:
    """Return a robot model of a spatial linkage; a DefinitionError says that there is none."""
    return _Writer(name, closure.linkage).write()


class _Writer:
    def __init__(self, name: str, linkage: SpaceLinkage) -> None:
        for strut in linkage.struts:
            raise DefinitionError(
                f'struts.{strut}', 'is a length, for which a URDF has no joint',
                'write a linkage without struts',
            )  # fmt: skip
        self._linkage = linkage
        self._robot = ET.Element('robot', name=name)
        self._robot.append(xml_comment(_HEAD.splitlines()))
        self._starts: dict[str, ET.Element] = {}
        self._frames = {GROUND: GROUND_FRAME}
        """Frames in the pose of the links that are written."""
        self._joints = set(linkage.pair_joints)
        self._hung: set[tuple[str, str]] = set()
        """Points with the links that hang by them."""
        ET.SubElement(self._robot, 'link', name=GROUND)

    def write(self) -> bytes:
        left = dict(self._linkage.pair_joints)
        while any(self._grow(name, joint, left) for name, joint in [*left.items()]) or any(
            map(self._hang, self._linkage.links)
        ):
            pass
        for name, joint in left.items():
            frame = free_name(f'{name}_frame', {*self._linkage.link_names, *self._frames})
            self._add_joint(name, joint, joint.parent, frame)
            self._add_loop(name, 'fixed', (frame, joint.child), self._frames[frame])
        for point, place in self._linkage.points.items():
            on = [link for link, points in self._linkage.links.items() if point in points]
            apart = [link for link in on if (point, link) not in self._hung]
            for number, link in enumerate(apart[1:]):
                ball = f'{point}_{number + 1}' if number else point
                self._add_loop(
                    ball, 'spherical', (apart[0], link), GROUND_FRAME._replace(origin=place)
                )
        start = ET.SubElement(self._robot, 'linkage_start')
        driven = self._linkage.driven
        start.extend(self._starts[name] for name in dict.fromkeys((*driven, *self._starts)))
        return xml_document(self._robot)

    def _grow(self, name: str, joint: SpatialJoint, left: dict[str, SpatialJoint]) -> bool:
        """Write a joint that leads from the tree to another link."""
        ends = [end for end in (joint.parent, joint.child) if end in self._frames]
        if len(ends) != 1:
            return False
        del left[name]
        (parent,) = ends
        self._add_joint(
            name, joint, parent, joint.child if parent == joint.parent else joint.parent
        )
        return True

    def _hang(self, link: str) -> bool:
        """Hang a link by a ball on the tree."""
        links, places = self._linkage.links, self._linkage.points
        if link in self._frames:
            return False
        for point in links[link]:
            on = [one for one, points in links.items() if point in points and one in self._frames]
            arms = [minus(places[other], places[point]) for other in links[link]]
            arms = [arm for arm in arms if length(arm)]
            if not on or not arms:
                continue
            way = direction_of(arms[0])
            across = direction_of(max((cross(way, one) for one in GROUND_FRAME[:3]), key=length))
            axes = [across, cross(way, across)]
            if any(length(cross(way, arm)) > _FLAT * length(arm) for arm in arms):
                axes.append(way)
            self._hung.add((point, link))
            parent = on[0]
            for number, axis in enumerate(axes):
                child = f'{link}_{number + 1}' if number + 1 < len(axes) else link
                child = child if child == link else free_name(child, self._linkage.link_names)
                name = free_name(f'{link}_joint{number + 1}', self._joints)
                self._joints.add(name)
                joint = SpatialJoint(parent, child, axis, places[point])
                self._add_joint(name, joint, parent, child)
                parent = child
            return True
        return False

    def _add_joint(self, name: str, joint: SpatialJoint, parent: str, child: str) -> None:
        linkage, on = self._linkage, self._frames[parent]
        axis = direction_of(joint.axis)
        if parent == joint.child:  # The tree leads the other way.
            axis = scale(-1.0, axis)
        ET.SubElement(self._robot, 'link', name=child)
        slides = name in linkage.slides
        if slides:
            places = [linkage.points[point] for point in linkage.links.get(child, ())]
            at = places[0] if places else on.origin
            self._frames[child] = on._replace(origin=at)
            at = minus(at, scale(joint.value, axis))
        else:
            at = joint.at
            x, y, z = (turn_about(axis, joint.value, way) for way in on[:3])
            self._frames[child] = SpaceFrame(x, y, z, at)
        limits, computed = joint.limits, {}
        kind = 'prismatic' if slides else 'revolute' if isfinite(limits.low) else 'continuous'
        element = ET.SubElement(self._robot, 'joint', name=name, type=kind)
        ET.SubElement(element, 'origin', xyz=format_numbers(*on.locate(at)), rpy='0 0 0')
        ET.SubElement(element, 'parent', link=parent)
        ET.SubElement(element, 'child', link=child)
        ET.SubElement(element, 'axis', xyz=format_numbers(*on.resolve(axis)))
        if kind != 'continuous' or limits != NO_LIMITS:
            known = {'lower': (limits.low, -FARTHEST), 'upper': (limits.high, FARTHEST)}
            known = {} if kind == 'continuous' else known
            known |= {'effort': (limits.effort, EFFORT), 'velocity': (limits.velocity, VELOCITY)}
            written = {
                key: format_number(given if isfinite(given) else ours)
                for key, (given, ours) in known.items()
            }
            computed = {k: written[k] for k, (given, _) in known.items() if not isfinite(given)}
            ET.SubElement(element, 'limit', written)
        if name in linkage.ratios:
            of, ratio, offset = name, 1.0, 0.0
            while of in linkage.ratios:  # A joint mimics one that mimics none.
                one = linkage.ratios[of]
                of, ratio, offset = one.of, ratio * one.ratio, offset + ratio * one.offset
            numbers = {'multiplier': format_number(ratio), 'offset': format_number(offset)}
            ET.SubElement(element, 'mimic', {'joint': of, **numbers})
        told = 'input' if name in linkage.driven else 'joint'
        self._starts[name] = ET.Element(told, name=name, value=format_number(joint.value))
        ET.SubElement(self._starts[name], 'computed', computed)

    def _add_loop(self, name: str, kind: str, links: tuple[str, str], at: SpaceFrame) -> None:
        """Write that a frame, which is given in the pose, is on two links."""
        loop = ET.SubElement(self._robot, 'loop_joint', name=name, type=kind)
        for tag, link in zip(('link1', 'link2'), links, strict=True):
            on = self._frames[link]
            x, y, z = map(on.resolve, at[:3]) if kind == 'fixed' else GROUND_FRAME[:3]
            level = hypot(x[0], x[1])
            if level > _FLAT:
                rpy = atan2(y[2], z[2]), atan2(-x[2], level), atan2(x[1], x[0])
            else:  # The x axis is upright, and yaw is roll.
                rpy = atan2(-z[1], y[1]), atan2(-x[2], level), 0.0
            xyz = format_numbers(*on.locate(at.origin))
            ET.SubElement(loop, tag, link=link, xyz=xyz, rpy=format_numbers(*rpy))
