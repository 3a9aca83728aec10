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
which a fixed loop joint welds to the link. Balls are loop joints too, in the form of Isaac Sim,
which robot_state_publisher passes over and `linkage check` reads. Links that no joint leads to
hang on joints of their own, see `with_rod_joints`.
"""

from __future__ import annotations

from dataclasses import replace
from math import atan2, hypot, isfinite
from xml.etree import ElementTree as ET

from linkage_ros.kinematics import (
    direction_of,
    GROUND,
    GROUND_FRAME,
    minus,
    Ratio,
    scale,
    SpaceFrame,
    SpaceLinkage,
    SpatialJoint,
    turn_about,
    Vector,
    with_rod_joints,
)
from linkage_ros.names import free_name
from linkage_ros.tools.models.joint_limits import FARTHEST, write_limits
from linkage_ros.tools.models.orientation import AngleSpan
from linkage_ros.tools.models.part import PrefixedNames
from linkage_ros.tools.models.xml import format_number, format_numbers

SPACE_HEAD = """\
A spatial linkage, cut open to a tree. Names, axes, signs and zeroes of the joints are as in the
published joint states. Lengths in [m], angles in [rad]. Limits that the linkage does not give are
made up. Each loop_joint says where two links meet."""

_UPRIGHT = 1e-3
"""Cosine of the pitch below which roll and yaw are one angle."""


class SpaceTree:
    """A spatial linkage, to be written as URDF; its names are as in `PrefixedNames`."""

    def __init__(self, linkage: SpaceLinkage, names: PrefixedNames, wrapped: bool) -> None:
        self.names = names
        self._linkage = with_rod_joints(linkage)
        self._wrapped = wrapped
        self._starts: dict[str, ET.Element] = {}
        self._frames = {GROUND: GROUND_FRAME}
        """Frames in the pose of the links that are written."""

    def write(self, robot: ET.Element) -> None:
        """Add the tree and the loop joints to a robot."""
        self._robot = robot
        ET.SubElement(robot, 'link', name=self.names.own_name(GROUND))
        links, names = self._linkage.links, self._linkage.link_names
        left = dict(self._linkage.pair_joints)
        while any(self._grow(name, joint, left) for name, joint in [*left.items()]):
            pass
        for name, joint in left.items():
            frame = free_name(f'{name}_frame', {*names, *self._frames})
            self._add_joint(name, joint, joint.parent, frame)
            self._add_loop(name, 'fixed', (frame, joint.child), self._frames[frame].origin)
        for point, place in self._linkage.points.items():
            on = [link for link, points in links.items() if point in points]
            for number, link in enumerate(on[1:]):
                name = f'{point}_{number + 1}' if number else point
                self._add_loop(name, 'spherical', (on[0], link), place)
        start = ET.SubElement(robot, 'linkage_start')
        order = dict.fromkeys((*self._linkage.driven, *self._starts))
        start.extend(map(self._starts.__getitem__, order))

    def _grow(self, name: str, joint: SpatialJoint, left: dict[str, SpatialJoint]) -> bool:
        """Write a joint that leads from the tree to another link."""
        ends = sorted((joint.parent, joint.child), key=lambda link: link not in self._frames)
        if ends[0] not in self._frames or ends[1] in self._frames:
            return False
        del left[name]
        self._add_joint(name, joint, *ends)
        return True

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
        own_name = self.names.own_name
        ET.SubElement(self._robot, 'link', name=own_name(child))
        low, high = joint.limits.low, joint.limits.high
        # A wrapped angle that passes π is on both sides.
        passing = self._wrapped and AngleSpan(low, high).passes_pi
        kind = 'revolute' if isfinite(low) and not passing else 'continuous'
        element = ET.SubElement(
            self._robot, 'joint', name=own_name(name), type='prismatic' if slides else kind
        )
        ET.SubElement(element, 'origin', xyz=format_numbers(*on.locate(at)), rpy='0 0 0')
        ET.SubElement(element, 'parent', link=own_name(parent))
        ET.SubElement(element, 'child', link=own_name(child))
        ET.SubElement(element, 'axis', xyz=format_numbers(*on.resolve(axis)))
        mimic = linkage.ratios.get(name)
        while mimic and not mimic.also and (before := linkage.ratios.get(mimic.of)):
            # A joint mimics one that mimics none.
            if before.also:
                break
            offset = mimic.offset + mimic.ratio * before.offset
            mimic = Ratio(before.of, mimic.ratio * before.ratio, offset)
        # URDF has no sums.
        mimic = replace(mimic, of=own_name(mimic.of)) if mimic and not mimic.also else None
        computed = write_limits(element, joint.limits, -FARTHEST, FARTHEST, mimic)
        told = 'input' if name in linkage.driven else 'joint'
        value = format_number(joint.value)
        self._starts[name] = ET.Element(told, name=own_name(name), value=value)
        ET.SubElement(self._starts[name], 'computed', computed)

    def _add_loop(self, name: str, kind: str, links: tuple[str, str], place: Vector) -> None:
        """Write that two links meet at a place, which is given in the pose."""
        own_name = self.names.own_name
        loop = ET.SubElement(self._robot, 'loop_joint', name=own_name(name), type=kind)
        one = self._frames[links[0]]
        for tag, link in zip(('link1', 'link2'), links, strict=True):
            frame = self._frames[link]
            rpy = format_numbers(*_roll_pitch_yaw(*map(frame.resolve, one[:3])))
            xyz = format_numbers(*frame.locate(place))
            ET.SubElement(loop, tag, link=own_name(link), xyz=xyz, rpy=rpy)


def _roll_pitch_yaw(x: Vector, y: Vector, z: Vector) -> Vector:
    """Return the angles about fixed axes that turn the ground's axes to these."""
    cosine = hypot(x[0], x[1])
    pitch = atan2(-x[2], cosine)
    if cosine < _UPRIGHT:  # Roll and yaw turn about one axis.
        return atan2(-z[1], y[1]), pitch, 0.0
    return atan2(y[2], z[2]), pitch, atan2(x[1], x[0])
