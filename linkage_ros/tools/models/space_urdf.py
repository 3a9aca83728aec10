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
from xml.etree import ElementTree as ET

from linkage_ros.description import roll_pitch_yaw
from linkage_ros.kinematics import (
    direction_of,
    GROUND,
    GROUND_FRAME,
    minus,
    scale,
    SpaceFrame,
    SpaceLinkage,
    SpatialJoint,
    turn_about,
    turned_tensor,
    Vector,
    with_rod_joints,
)
from linkage_ros.names import free_name
from linkage_ros.tools.models.orientation import ROUND
from linkage_ros.tools.models.part import PrefixedNames
from linkage_ros.tools.models.urdf_elements import (
    add_inertial,
    add_joint,
    add_start,
    mimic_of,
    WrittenJoint,
)
from linkage_ros.tools.models.xml import format_numbers

SPACE_HEAD = """\
A spatial linkage, cut open to a tree. Names, axes, signs and zeroes of the joints are as in the
published joint states. Lengths in [m], angles in [rad]. Limits that the linkage does not give are
made up. Each loop_joint says where two links meet."""


class SpaceTree:
    """A spatial linkage, to be written as URDF; its names are as in `PrefixedNames`."""

    def __init__(self, linkage: SpaceLinkage, names: PrefixedNames, wrapped: bool) -> None:
        self.names = names
        self._linkage = with_rod_joints(linkage)
        self._wrapped = wrapped
        self._computed: dict[str, dict[str, str]] = {}
        self._frames = {GROUND: GROUND_FRAME}
        """Frames in the pose of the links that are written."""

    def write(self, robot: ET.Element) -> None:
        """Add the tree and the loop joints to a robot."""
        self._robot = robot
        self._add_link(GROUND)
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
        own_name, linkage = self.names.own_name, self._linkage
        order = dict.fromkeys((*linkage.driven, *self._computed))
        values = {own_name(name): linkage.pose_value(name) for name in order}
        computed = {own_name(name): made_up for name, made_up in self._computed.items()}
        add_start(robot, [*map(own_name, linkage.driven)], values, computed)

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
        self._add_link(child)
        own_name = self.names.own_name
        placed = WrittenJoint(
            own_name(name),
            'prismatic' if slides else 'revolute',
            own_name(parent),
            own_name(child),
            on.locate(at),
            axis=on.resolve(axis),
        )
        # URDF has no sums.
        mimic = mimic_of(linkage.ratios, name)
        if mimic:
            mimic = replace(mimic, of=own_name(mimic.of))
        self._computed[name] = add_joint(
            self._robot, placed, joint.limits, ROUND, mimic, wrapped=self._wrapped
        )

    def _add_link(self, link: str) -> None:
        """Write a link, with its mass if it has some."""
        element = ET.SubElement(self._robot, 'link', name=self.names.own_name(link))
        body, frame = self._linkage.masses.get(link), self._frames[link]
        if body and body.mass:
            axes = [frame.resolve(axis) for axis in GROUND_FRAME[:3]]
            tensor = turned_tensor(axes, body.inertia)
            add_inertial(element, body.mass, frame.locate(body.center), tensor)

    def _add_loop(self, name: str, kind: str, links: tuple[str, str], place: Vector) -> None:
        """Write that two links meet at a place, which is given in the pose."""
        own_name = self.names.own_name
        loop = ET.SubElement(self._robot, 'loop_joint', name=own_name(name), type=kind)
        one = self._frames[links[0]]
        for tag, link in zip(('link1', 'link2'), links, strict=True):
            frame = self._frames[link]
            rpy = format_numbers(*roll_pitch_yaw(*map(frame.resolve, one[:3])))
            xyz = format_numbers(*frame.locate(place))
            ET.SubElement(loop, tag, link=own_name(link), xyz=xyz, rpy=rpy)
