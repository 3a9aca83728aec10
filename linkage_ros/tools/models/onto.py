# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage back onto the robot whose URDF it was imported from: only what the robot lacks is added.

The robot's tree stays as it is, to the last byte: its links, joints, names and frames. Added are
frames where pins and sliders close its loops, frames of traced points, published joints that the
robot does not have, and a pose in which the loops close. The frames of a pin lie at one height
above the plane, so that they meet in space.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import atan2, cos, hypot, sin
from typing import Any
from xml.etree import ElementTree as ET

from linkage_ros.description import MOVING, UrdfFile
from linkage_ros.errors import FileError, list_names, quote
from linkage_ros.kinematics import GROUND, links_by_point, NO_LIMITS, SlideJoint
from linkage_ros.names import free_name
from linkage_ros.tools.models.orientation import joint_spans, named_joints
from linkage_ros.tools.models.part import (
    ModelNames,
    ModelPart,
    prefix_names,
    PrefixedNames,
)
from linkage_ros.tools.models.planar import lay_flat, PlanarJoint, UrdfLoops
from linkage_ros.tools.models.tree import Tree, TreeJoint
from linkage_ros.tools.models.urdf import add_frames, add_joint, LoopJoint, start_element
from linkage_ros.tools.models.urdf_topology import Chain, find_chains
from linkage_ros.tools.models.xml import format_numbers
import numpy as np

_SAME = 1e-6
"""Largest distance between a pin of the linkage and the robot's joint, in parts of its size."""

_ROUNDED = 1e-15
"""What rotations leave of a 0, in [m] or [rad]."""

_END = b'</robot>'
_REMEDY = 'name the robot that the linkage was imported from'


def urdf_onto(robot: UrdfFile, data: bytes, parts: Sequence[ModelPart]) -> bytes:
    """
    Return a robot's URDF, with what closes the loops of linkages added at its end.

    ``data`` is the content of the robot's file; the linkages have joint names of the robot. A
    FileError names the joint if the robot is not the one that a linkage came from.
    """
    end = data.rfind(_END)
    if end < 0:
        raise FileError(robot.file, '', 'is not written in UTF-8', 'save it in UTF-8')
    names, prefixes = prefix_names([(part.prefix, part.closure.linkage) for part in parts])
    added: list[ET.Element] = []
    for part, own in zip(parts, prefixes, strict=True):
        added += _Onto(robot, part, _RobotNames(own.prefix, names)).missing_elements()
    if not added:
        return data
    lines = [b'  <!-- Added by linkage urdf: what closes the loops. -->']
    for element in added:
        ET.indent(element, level=1)
        lines.append(b'  ' + ET.tostring(element).strip())
    return data[:end] + b'\n'.join(lines) + b'\n' + data[end:]


class _RobotNames(PrefixedNames):
    """Names of a linkage on a robot, where its ground is a link of the robot."""

    def __init__(self, prefix: str, names: ModelNames) -> None:
        super().__init__(prefix, names)
        self.links: dict[str, str] = {}  # Links of the linkage, and the robot's links

    def own_name(self, name: str) -> str:
        return self.links.get(name) or super().own_name(name)

    def text_on(self, name: str, link: str) -> str:
        return f'{self.prefix}{name}_on_{self.own_name(link)}'

    def frame_on(self, name: str, body: str) -> str:
        """Return a free name for a frame on a link of the robot."""
        return self._names.free_frame(f'{self.prefix}{name}_on_{body}')


class _Onto:
    """One linkage on a robot."""

    def __init__(self, robot: UrdfFile, part: ModelPart, names: _RobotNames) -> None:
        self._robot, self._part, self._names = robot, part, names
        self._linkage = part.closure.linkage
        self._planar = lay_flat(robot, self._find_loops())
        names.links = {link: self._robot_link(link) for link in self._linkage.links}
        for body in names.links.values():
            if body not in self._planar.heights:
                reason = f'has no link {quote(body)} that its joints move'
                raise self._file_error('', reason, _REMEDY)
        self._near = _SAME * part.closure.scale
        self._spans = joint_spans(part.closure)

    def missing_elements(self) -> Iterator[ET.Element]:
        """Yield what the robot lacks."""
        tree = Tree(self._linkage, origins=dict.fromkeys(self._linkage.links, 0j))
        tree.spare = [
            name
            for name in named_joints(self._linkage)
            if self._names.own_name(name) not in self._robot.joints
        ]
        links = {body: link for link, body in self._names.links.items()}
        cuts = []
        for chain in find_chains(self._planar, links, self._near):
            if chain.parent in links and chain.child in links:
                self._attach_link(tree, chain, links[chain.parent], links[chain.child])
            elif chain.parent in links and chain.sliding_joint is not None:
                cuts.append(self._end_slide(tree, chain.sliding_joint))
        cuts += add_frames(tree, self._names)
        heights = {
            frame: self._frame_height(tree, cut.frames[0]) for cut in cuts for frame in cut.frames
        }
        computed: dict[str, dict[str, str]] = {
            self._names.own_name(name): {} for name in named_joints(self._linkage)
        }
        for joint in tree.joints:
            frame = self._planar.frames.get(joint.child)
            if frame is None:
                yield ET.Element('link', name=joint.child)
                element, computed[joint.name] = self._joint_element(
                    joint, heights.get(joint.child)
                )
                yield element
            elif frame.body != joint.parent or abs(frame.place - joint.place) > self._near:
                raise self._file_error(
                    f'link {joint.child}', 'is elsewhere than the linkage has it', _REMEDY
                )
        start = start_element(self._part.closure, self._names, computed)
        if start is not None and not self._robot.start:
            yield start

    def _file_error(self, where: str, reason: str, remedy: str) -> FileError:
        return FileError(self._robot.file, where, reason, remedy)

    def _find_loops(self) -> UrdfLoops:
        """Return the robot's joints that the linkage names, and the link that they hang on."""
        bodies = {self._robot.root: self._robot.root}
        named = {self._names.own_name(name) for name in named_joints(self._linkage)}
        found: dict[str, str] = {}
        for joint in self._robot.joints.values():
            moves = joint.kind in MOVING
            bodies[joint.child] = joint.child if moves else bodies[joint.parent]
            bare = not self._robot.links[joint.child].bodied
            if moves and (joint.name in named or (bare and joint.mimics in named)):
                found[joint.name] = bodies[joint.parent]
        if not found:
            reason = f'has none of the joints {list_names(sorted(named))}'
            raise self._file_error('', reason, _REMEDY)
        children = {self._robot.joints[name].child for name in found}
        roots = list(dict.fromkeys(body for body in found.values() if body not in children))
        if len(roots) > 1:
            reason = f'has joints of the linkage on {list_names(roots, " and ")}'
            raise self._file_error('', reason, _REMEDY)
        return UrdfLoops(roots[0], frozenset(found), ())

    def _robot_link(self, link: str) -> str:
        """Return the link of the robot that a link of the linkage is."""
        if link == GROUND:
            return self._planar.root
        for name in (self._names.prefix + link, self._names.prefix + link.removesuffix('_link')):
            if name in self._planar.heights:
                return name
        return self._names.prefix + link

    def _attach_link(self, tree: Tree, chain: Chain, parent: str, child: str) -> None:
        """Tell the tree how the robot holds a link."""
        if chain.sliding_joint is not None:
            tree.slides.append(self._find_slider(chain.sliding_joint))
            return
        place = chain.joints[0].place
        links = self._linkage.links
        for pin in links[parent]:
            if pin in links[child] and all(
                abs(complex(*links[link][pin]) - there) <= self._near
                for link, there in ((parent, place), (child, 0j))
            ):
                tree.pins.append((pin, parent, child))
                return
        raise self._file_error(
            f'joint {chain.joints[-1].name}',
            f'is at ({place.real:.6g}, {place.imag:.6g}) m of the plane, where the linkage has no '
            'pin',
            _REMEDY,
        )

    def _end_slide(self, tree: Tree, slide: PlanarJoint) -> LoopJoint:
        """Add the frames that meet where a slide of the robot ends in a link without a shape."""
        name = self._find_slider(slide)
        tree.slides.append(name)
        slider = self._linkage.sliders[name]
        on = links_by_point(self._linkage.links)[slider.point][0]
        place = complex(*self._linkage.links[on][slider.point])
        frames = []
        for link, there in ((slide.child, 0j), (self._names.own_name(on), place)):
            frame = self._names.frame_on(slider.point, link)
            frames.append(frame)
            tree.joints.append(TreeJoint(f'{frame}_fixed', 'fixed', link, frame, there))
        return LoopJoint('slide', name, tuple(frames))

    def _find_slider(self, slide: PlanarJoint) -> str:
        """Return the slider of the linkage that a joint of the robot is."""
        name = slide.name.removeprefix(self._names.prefix)
        joint = named_joints(self._linkage).get(name)
        if not isinstance(joint, SlideJoint):
            reason = 'slides, and not in the linkage'
            raise self._file_error(f'joint {slide.name}', reason, _REMEDY)
        return joint.slider

    def _frame_height(self, tree: Tree, frame: str) -> float:
        """Return the height above the plane of the link that a frame is on, in [m]."""
        return self._planar.heights[next(j.parent for j in tree.joints if j.child == frame)]

    def _joint_element(
        self, joint: TreeJoint, height: float | None
    ) -> tuple[ET.Element, dict[str, str]]:
        """Return a joint in space, from one in the plane; and limits that were made up."""
        own = free_name(joint.name, self._robot.joints) if joint.kind == 'fixed' else joint.name
        holder = ET.Element('robot')
        published = joint.name.removeprefix(self._names.prefix)
        span = self._spans.get(published)
        limits = self._linkage.limits.get(published, NO_LIMITS)
        made_up = add_joint(holder, joint._replace(name=own), span, limits, self._part.wrapped)
        x, y, normal = self._planar.basis
        back = self._planar.turns[joint.parent].T
        rise = 0.0 if height is None else height - self._planar.heights[joint.parent]
        place = back @ (joint.place.real * x + joint.place.imag * y + rise * normal)
        turn = complex(cos(joint.turn), sin(joint.turn))
        ahead = turn.real * x + turn.imag * y
        axes = back @ np.array([ahead, np.cross(normal, ahead), normal]).T
        element = holder[0]
        origin = element.find('origin')
        assert origin is not None
        origin.set('xyz', format_numbers(*map(_round_small, place)))
        origin.set('rpy', format_numbers(*map(_round_small, _roll_pitch_yaw(axes))))
        return element, made_up


def _round_small(value: float) -> float:
    return 0.0 if abs(value) < _ROUNDED else float(value)


def _roll_pitch_yaw(axes: Any) -> tuple[float, float, float]:
    """Return the angles of URDF for a rotation matrix, in [rad]."""
    flat = hypot(axes[0, 0], axes[1, 0])
    pitch = atan2(-axes[2, 0], flat)
    if flat < _ROUNDED:  # roll and yaw turn about one axis
        return atan2(-axes[1, 2], axes[1, 1]), pitch, 0.0
    return atan2(axes[2, 1], axes[2, 2]), pitch, atan2(axes[1, 0], axes[0, 0])
