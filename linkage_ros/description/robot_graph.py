# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""
Robots of other formats as URDFs, which is what this package reads and what bags keep.

`RobotGraph` holds links and joints where they are in a pose, in any order and with loops. A URDF
is a tree: of the joints that lead to a link the first is its joint there, and the others close
loops. The frame of each link lies at its joint, and has in the pose the axes of the world.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isinf
from typing import NamedTuple
from xml.etree import ElementTree as ET

from linkage_ros.description.robot_pose import roll_pitch_yaw
from linkage_ros.description.urdf_file import MOST_JOINTS, UNREAD
from linkage_ros.errors import FileError, list_names
from linkage_ros.kinematics import (
    Limits,
    minus,
    NO_LIMITS,
    scale,
    SpatialMass,
    turn_about,
    Vector,
    ZERO,
)

WORLD = 'world'

_AXES: tuple[Vector, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_LOOPS = {
    'revolute': 'revolute', 'continuous': 'revolute', 'prismatic': 'prismatic', 'fixed': 'fixed',
    'ball': 'spherical', 'universal': 'universal',
}  # fmt: skip
"""What closes a loop, by the kind of a joint."""


class GraphJoint(NamedTuple):
    """A joint between two links: places and directions in the pose, in the frame of the world."""

    name: str
    kind: str  # A key of _LOOPS
    parent: str
    child: str
    place: Vector
    axis: Vector = (0.0, 0.0, 1.0)  # The first of a universal joint
    second_axis: Vector = (1.0, 0.0, 0.0)  # Of a universal joint
    limits: Limits = NO_LIMITS
    second_place: Vector | None = None  # The place on the child, where it is another
    follows: tuple[str, float, float] | None = None  # Another joint, with factor and offset
    is_driven: bool = False
    value: float = 0.0  # In the pose of the places, in [rad] or [m]


class RobotGraph(NamedTuple):
    """A robot of any format."""

    file: str
    name: str
    links: dict[str, SpatialMass | None]  # What they weigh; `WORLD` stands still
    joints: Sequence[GraphJoint]
    unread: Sequence[str] = ()  # What may close loops, or drive, and is not read, in words


def urdf_of(graph: RobotGraph) -> bytes:
    """Return a robot as a URDF; a FileError says which links nothing carries."""
    root = ET.Element('robot', name=graph.name)
    tree, loops, places = _find_tree(graph)
    for name in (WORLD, *graph.links):
        mass = graph.links.get(name)
        link = ET.SubElement(root, 'link', name=name)
        if mass is not None:
            _add_inertial(link, mass, places[name])
    for joint in tree:
        _add_joint(root, joint, minus(joint.place, places[joint.parent]))
    for joint in loops:
        loop = ET.SubElement(root, 'loop_joint', name=joint.name, type=_LOOPS[joint.kind])
        ends = ((joint.parent, joint.place), (joint.child, joint.second_place or joint.place))
        for tag, (end, place) in zip(('link1', 'link2'), ends, strict=True):
            ET.SubElement(loop, tag, link=end, xyz=_text(minus(place, places[end])))
        if joint.kind != 'ball':
            ET.SubElement(loop, 'parent_axis', xyz=_text(joint.axis))
        if joint.kind == 'universal':
            ET.SubElement(loop, 'child_axis', xyz=_text(joint.second_axis))
    start = ET.Element('linkage_start')
    for joint in tree:
        if joint.value:
            told = ET.SubElement(start, 'joint', name=joint.name, value=repr(joint.value))
            ET.SubElement(told, 'computed')
    if len(start):
        root.append(start)
    for words in graph.unread:
        ET.SubElement(root, UNREAD, of=words)
    ET.indent(root)
    return bytes(ET.tostring(root, 'utf-8'))


def _find_tree(
    graph: RobotGraph,
) -> tuple[list[GraphJoint], list[GraphJoint], dict[str, Vector]]:
    """Return the joints of the tree, those that close loops, and where the links' frames lie."""
    places = {WORLD: ZERO}
    tree: list[GraphJoint] = []
    # A ball rather closes a loop: in a tree it is three hinges.
    joints = sorted(graph.joints, key=lambda joint: joint.kind == 'ball')
    if len(joints) > MOST_JOINTS:
        reason = f'has {len(joints)} joints'
        raise FileError(graph.file, '', reason, f'keep the part with the loops: {MOST_JOINTS}')
    while len(places) <= len(graph.links):
        left = [joint for joint in joints if not {joint.parent, joint.child} <= places.keys()]
        joint = next((candidate for candidate in left if candidate.parent in places), None)
        if joint is None:
            # A joint may be written from its child to its parent.
            back = next((candidate for candidate in left if candidate.child in places), None)
            joint = back and _reverse(back)
        if joint is None:
            loose = [link for link in graph.links if link not in places]
            reason = f'no joint leads from {WORLD} to {list_names(loose)}'
            raise FileError(graph.file, '', reason, 'write a joint of type fixed')
        tree.append(joint)
        places[joint.child] = joint.place
    names = {joint.name for joint in tree}
    return tree, [joint for joint in graph.joints if joint.name not in names], places


def _reverse(joint: GraphJoint) -> GraphJoint:
    """Return a joint from its child to its parent: with the opposite axis it has its value."""
    axis, second = scale(-1.0, joint.axis), scale(-1.0, joint.second_axis)
    if joint.kind == 'universal':
        axis, second = second, axis
    return joint._replace(parent=joint.child, child=joint.parent, axis=axis, second_axis=second)


def _add_joint(root: ET.Element, joint: GraphJoint, origin: Vector) -> None:
    """Add a joint of the tree: one, or hinges through one point with links between them."""
    axes = {'ball': _AXES, 'universal': (joint.axis, joint.second_axis)}.get(joint.kind)
    if axes is None:
        _add_one(root, joint, origin)
        return
    parent = joint.parent
    for number, axis in enumerate(axes, 1):
        child = joint.child if number == len(axes) else f'{joint.name}_{number}_link'
        if child != joint.child:
            ET.SubElement(root, 'link', name=child)
        hinge = GraphJoint(
            f'{joint.name}_{number}', 'continuous', parent, child, joint.place, axis
        )
        _add_one(root, hinge, origin if number == 1 else ZERO)
        parent = child


def _add_one(root: ET.Element, joint: GraphJoint, origin: Vector) -> None:
    made = ET.SubElement(root, 'joint', name=joint.name, type=joint.kind)
    if joint.is_driven:
        made.set('independent', 'true')
    ET.SubElement(made, 'parent', link=joint.parent)
    ET.SubElement(made, 'child', link=joint.child)
    turned = ZERO
    if joint.value and joint.kind == 'prismatic':
        origin = minus(origin, scale(joint.value, joint.axis))
    elif joint.value:
        turned = roll_pitch_yaw(*(turn_about(joint.axis, -joint.value, axis) for axis in _AXES))
    ET.SubElement(made, 'origin', xyz=_text(origin), rpy=_text(turned))
    if joint.kind != 'fixed':
        ET.SubElement(made, 'axis', xyz=_text(joint.axis))
    if joint.limits != NO_LIMITS:
        limits = joint.limits
        bounds = {
            'lower': limits.low, 'upper': limits.high, 'velocity': limits.velocity,
            'effort': limits.effort,
        }  # fmt: skip
        told = {key: repr(value) for key, value in bounds.items() if not isinf(value)}
        ET.SubElement(made, 'limit', told)
    if joint.follows is not None:
        of, factor, offset = joint.follows
        ET.SubElement(made, 'mimic', joint=of, multiplier=repr(factor), offset=repr(offset))


def _add_inertial(link: ET.Element, mass: SpatialMass, place: Vector) -> None:
    inertial = ET.SubElement(link, 'inertial')
    ET.SubElement(inertial, 'origin', xyz=_text(minus(mass.center, place)))
    ET.SubElement(inertial, 'mass', value=repr(mass.mass))
    keys = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
    ET.SubElement(
        inertial,
        'inertia',
        {key: repr(value) for key, value in zip(keys, mass.inertia, strict=True)},
    )


def _text(vector: Vector) -> str:
    return ' '.join(map(repr, vector))
