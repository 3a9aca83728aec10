# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Read a URDF: links, joints, and what closes loops, checked against the rules of URDF.

URDF has no loops. These tags outside of it close some:

- ``<loop_joint>`` with ``<link1 link xyz rpy>`` and ``<link2 …>``, of Isaac Sim's importer, whose
  manual and followers write ``link1`` twice
- ``<loop_joint>`` with ``<parent>``, ``<child>``, ``<parent_origin>``, ``<child_origin>`` and
  ``<axis frame="parent">``, of exporters of Fusion 360
- ``<constraint>`` with the same and ``<parent_axis>``, ``<child_axis>`` (ros/urdfdom#264); its
  type ``link`` is a rod between two balls
- ``<loop>`` of URDF+, with ``<origin>`` in ``<predecessor>`` and ``<successor>``; ``<coupling>``,
  where q of the successor is ``<ratio>`` times q of the predecessor; and the older
  ``<loop_constraint>``, a pin (M. Chignoli et al., arXiv:2411.19753; generalized_rbda)

An axis is in the frame of the first end, and in that of the second if that says none. As in URDF
it is 1 0 0 if it is not written. An end without ``rpy`` and axis says a place, and no direction.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import inf, isfinite
from pathlib import Path
import re
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET
from xml.parsers.expat import ErrorString

from linkage_ros.description.file_access import read_regular
from linkage_ros.description.file_kinds import kind_of_bytes, kind_of_folder
from linkage_ros.errors import did_you_mean, FileError, LinkageError, list_names, quote
from linkage_ros.kinematics import Limits, NO_LIMITS

# The content of a URDF: links and joints by name.

Vector = tuple[float, float, float]

MOVING = ('revolute', 'continuous', 'prismatic')

_KINDS = (*MOVING, 'fixed', 'floating', 'planar')
_FARTHEST = 1e9

_CLOSING = re.compile('closing_.+_1')
"""The first of two frames that meet."""

_LOOP_TAGS = ('loop_joint', 'loop_constraint', 'constraint', 'loop')
"""Tags outside of URDF that close loops."""

_LOOP_ENDS = (('link1', 'link2'), ('parent', 'child'), ('predecessor', 'successor'))
"""Tags of the two ends of a loop."""

LOOP_KINDS = {
    '': 'ball', 'ball': 'ball', 'spherical': 'ball', 'hinge': 'hinge', 'revolute': 'hinge',
    'continuous': 'hinge', 'prismatic': 'slide', 'fixed': 'fixed', 'universal': 'universal',
    'link': 'rod',
}  # fmt: skip
"""What closes a loop, by its type; without a type it is a ball, a pin in the plane."""

UNREAD = 'unread'
"""Tag of what is not read of a robot in another format, in words."""

_USUAL_TAGS = (
    'link', 'joint', 'material', 'gazebo', 'transmission', 'ros2_control', 'linkage_start',
    'coupling', *_LOOP_TAGS,
)  # fmt: skip

_NUMBER = r'[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?'
PLACE = re.compile(rf'(.+?)\.({_NUMBER}),({_NUMBER}),({_NUMBER})')
"""A place on a link: LINK.x,y,z."""

_LARGEST_FILE = 10_000_000
MOST_JOINTS = 2000
_MOST_LOOPS = 200


class Inertial(NamedTuple):
    """Mass [kg], its centre [m], rotation of its axes [rad], and ixx ixy ixz iyy iyz izz."""

    mass: float
    xyz: Vector
    rpy: Vector
    tensor: tuple[float, float, float, float, float, float]


class UrdfJoint(NamedTuple):
    """A joint."""

    # As in the file.
    name: str
    kind: str
    # Links.
    parent: str
    child: str
    # Child's frame in the parent's with the joint at 0, in [m] and [rad].
    xyz: Vector
    rpy: Vector
    axis: Vector  # In the child's frame, of any length except 0
    # The joint that it follows, '' if none, with factor and offset.
    mimics: str
    multiplier: float
    offset: float
    limits: Limits  # As in ``<limit>``, without those that ``linkage urdf`` made up


class LoopEnd(NamedTuple):
    """An end of what closes a loop: a frame on a link, in [m] and [rad], and an axis in it."""

    link: str
    xyz: Vector
    rpy: Vector = (0.0, 0.0, 0.0)
    axis: Vector = (1.0, 0.0, 0.0)  # Of any length except 0
    is_directed: bool = True  # Whether it says how its frame lies, and not a place alone


class UrdfLoop(NamedTuple):
    """What closes a loop: a joint outside of the tree."""

    name: str
    kind: str  # A value of LOOP_KINDS, or a type that is not known
    ends: tuple[LoopEnd, LoopEnd]


class UrdfFile(NamedTuple):
    """A robot."""

    file: str  # Name of the file, for messages
    name: str  # Name of the robot
    root: str  # The link that is not a child
    links: Mapping[str, Inertial | None]  # What links weigh, by name
    joints: Mapping[str, UrdfJoint]  # Joints by name, parents first
    order: tuple[str, ...]  # Names of the joints in the order of the file
    inputs: tuple[str, ...]  # Names of driven joints, if ``linkage urdf`` wrote the file
    actuated: tuple[str, ...]  # Names of joints that the file says motors move
    # Values of joints in a pose in which all loops close, if ``linkage urdf`` wrote the file.
    start: Mapping[str, float]
    loops: tuple[UrdfLoop, ...]  # What closes loops, as tags say; of two at one place the first
    # Ratios of two chains of joints, which lead from their common ancestor to two links: name,
    # predecessor, successor, ratio.
    couplings: tuple[tuple[str, str, str, float], ...]
    # Links and those that they meet where they are with all joints at 0, as Gazebo says: at a
    # place on the first, by a ball or fixed.
    pinned: tuple[tuple[str, str, Vector, str], ...]
    unread: tuple[str, ...]  # Tags that may close loops and are not read, in words


def pin_frames(urdf: UrdfFile) -> dict[str, list[str]]:
    """
    Return the links that are called PIN_on_LINK and hang on LINK, by pin.

    Frames closing_NAME_1 and closing_NAME_2, of onshape-to-robot, are alike.
    """
    firsts = (link for link in urdf.links if _CLOSING.fullmatch(link))
    pairs = {first[:-2]: [first, f'{first[:-1]}2'] for first in firsts}
    frames = {name: ends for name, ends in pairs.items() if ends[1] in urdf.links}
    for joint in urdf.joints.values():
        name, on, parent = joint.child.rpartition(f'_on_{joint.parent}')
        if on and name and not parent:
            frames.setdefault(name, []).append(joint.child)
    return frames


def read_urdf_file(file: Path) -> bytes:
    """Return the content of a URDF; a LinkageError has the reason why it cannot be read."""
    try:
        data = read_regular(file, _LARGEST_FILE)
    except IsADirectoryError:
        reason = f'is {kind_of_folder(file).noun}, not a URDF'
        raise LinkageError(file, reason, 'name a URDF file') from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise LinkageError(file, f'cannot be read ({reason})', 'name a URDF file') from None
    if len(data) > _LARGEST_FILE:
        raise LinkageError(file, f'is larger than {_LARGEST_FILE} bytes', 'name a URDF file')
    return data


def read_urdf(data: bytes, file: str) -> UrdfFile:
    """Read a URDF; a FileError has file, link or joint, and remedy."""
    return _UrdfReader(file).read(parse_robot(data, file))


def parse_robot(data: bytes, file: str) -> ET.Element:
    """Return the root of a robot's XML; a FileError says why it cannot be read."""
    if b'<!DOCTYPE' in data.replace(b'\0', b''):  # also in UTF-16
        reason = 'declares a document type, which a robot does not need'
        raise FileError(file, '', reason, 'remove <!DOCTYPE …> and its entities')
    try:
        return ET.fromstring(data)
    except ET.ParseError as error:
        noun = kind_of_bytes(data).noun
        if noun not in ('a URDF', 'an XML file'):
            raise FileError(file, '', f'is {noun}, not a URDF', 'name a URDF file') from None
        line, _ = error.position
        reason = f'is not XML ({ErrorString(error.code)})'  # repeats nothing of the file
        raise FileError(file, '', reason, 'name a URDF file', line) from None
    except (ValueError, LookupError) as error:  # unknown encoding in the XML declaration
        raise FileError(file, '', f'is not XML ({error})', 'name a URDF file') from None


class _UrdfReader:
    def __init__(self, file: str) -> None:
        self._file = file

    def read(self, root: ET.Element) -> UrdfFile:
        if root.tag != 'robot':
            raise self._file_error('', 'is XML, and not a <robot>', 'name a URDF file')
        for element in root.iter():
            if 'ros.org/wiki/xacro' in element.tag or '${' in ''.join(element.attrib.values()):
                raise self._file_error(
                    '', 'is written in xacro', 'run first: xacro FILE > FILE.urdf'
                )
        links: dict[str, Inertial | None] = {}
        for element in root.findall('link'):
            name = self._checked_name(element, links, 'link')
            links[name] = self._read_link(element, f'link {name}')
        if not links:
            raise self._file_error('', 'has no link', 'name a URDF file')
        start = root.find('linkage_start')
        made_up = (
            {}
            if start is None
            else {element.get('name', ''): _made_up(element) for element in start}
        )
        joints: dict[str, UrdfJoint] = {}
        for element in root.findall('joint'):
            name = self._checked_name(element, joints, 'joint')
            limits = NO_LIMITS
            if name not in made_up or made_up[name] is not None:
                limits = self._read_limits(element, name, made_up.get(name))
            joints[name] = self._read_joint(element, name, links)._replace(limits=limits)
        if len(joints) > MOST_JOINTS:
            reason = f'has {len(joints)} joints'
            raise self._file_error('', reason, f'keep the part with the loops: {MOST_JOINTS}')
        self._check_mimics(joints)
        base, ordered = self._order_joints(links, joints)
        said = (
            []
            if start is None
            else [element for element in start if element.get('name') in joints]
        )
        return UrdfFile(
            self._file,
            root.get('name', ''),
            base,
            links,
            {joint.name: joint for joint in ordered},
            tuple(joints),
            tuple(element.get('name', '') for element in said if element.tag == 'input'),
            tuple(_actuated_joints(root, joints)),
            {
                element.get('name', ''): self._read_value(element, 'value', 'linkage_start')
                for element in said
            },
            tuple(self._read_loops(root, links)),
            tuple(self._read_couplings(root, links)),
            tuple(self._pinned_places(root, links)),
            tuple(dict.fromkeys(_unread_tags(root))),
        )

    def _read_loops(self, root: ET.Element, links: Mapping[str, object]) -> Iterator[UrdfLoop]:
        """Yield what closes loops; of two at one place the first."""
        there = set()
        loops = [element for element in root if element.tag in _LOOP_TAGS]
        if len(loops) > _MOST_LOOPS:
            reason = f'has {len(loops)} loops'
            raise self._file_error('', reason, f'keep those that are needed: {_MOST_LOOPS}')
        for number, element in enumerate(loops):
            name = element.get('name') or f'{element.tag}{number + 1}'
            where, kind = f'{element.tag} {name}', element.get('type', '').removesuffix('_joint')
            ends = self._read_loop_ends(element, where, links)
            places = frozenset(end[:2] for end in ends)
            if places not in there:
                yield UrdfLoop(name, LOOP_KINDS.get(kind, kind), ends)
            there.add(places)

    def _read_loop_ends(
        self, element: ET.Element, where: str, links: Mapping[str, object]
    ) -> tuple[LoopEnd, LoopEnd]:
        for tags in _LOOP_ENDS:
            # Some write link1 twice.
            ends_found = [part for part in element if part.tag in tags]
            if len(ends_found) == 2:
                break
        else:
            raise self._file_error(where, 'has no two ends', 'write <parent> and <child>')
        ends: list[LoopEnd] = []
        for end, axes in zip(ends_found, (('parent_axis', 'axis'), ('child_axis',)), strict=True):
            link = self._checked_link(end.get('link', ''), end.tag, where, links)
            own = (end.find('origin'), element.find(f'{end.tag}_origin'))
            origin = next((place for place in own if place is not None), end)
            axis = next((line for line in map(element.find, axes) if line is not None), None)
            way = ends[0].axis if ends else (1.0, 0.0, 0.0)
            way = way if axis is None else self._read_vector(axis, 'xyz', where, '1 0 0')
            if way == (0.0, 0.0, 0.0):
                raise self._file_error(where, 'its axis is 0 0 0', 'write 0 0 1, for example')
            xyz, rpy = (self._read_vector(origin, key, where, '0 0 0') for key in ('xyz', 'rpy'))
            is_directed = axis is not None or 'rpy' in origin.attrib
            ends.append(LoopEnd(link, xyz, rpy, way, is_directed))
        return ends[0], ends[1]

    def _read_couplings(self, root: ET.Element, links: Mapping[str, object]) -> Iterator[Any]:
        for element in root.findall('coupling'):
            where, ratio = f'coupling {element.get("name", "")}', element.find('ratio')
            ends = [self._read_end(element, end, where, links) for end in _LOOP_ENDS[2]]
            yield where, *ends, self._read_values(ratio, 'value', where, 1, '1')[0]

    def _pinned_places(
        self, root: ET.Element, links: Mapping[str, object]
    ) -> Iterator[tuple[str, str, Vector, str]]:
        """Yield links, and the links that joints of <gazebo> pin them to, with place and kind."""
        for joint in filter(_is_pin_of_gazebo, root.findall('gazebo/joint')):
            where = f'joint {joint.get("name", "")} of <gazebo>'
            parent, child = ((joint.findtext(end) or '').strip() for end in ('parent', 'child'))
            for end, link in (('parent', parent), ('child', child)):
                self._checked_link(link, end, where, links)
            pose = {'pose': joint.findtext('pose') or '0 0 0 0 0 0'}
            x, y, z, *_ = self._read_values(ET.Element('joint', pose), 'pose', where, 6, '')
            kind = 'fixed' if joint.get('type') == 'fixed' else 'ball'
            yield child, parent, (x, y, z), kind

    def _file_error(self, key: str, reason: str, remedy: str) -> FileError:
        return FileError(self._file, key, reason, remedy)

    def _checked_name(self, element: ET.Element, taken: Mapping[str, object], kind: str) -> str:
        name = element.get('name', '')
        if not name or not name.isprintable():
            raise self._file_error('', f'a {kind} has the name {quote(name)}', 'give it a name')
        if name in taken:
            raise self._file_error(f'{kind} {name}', 'is a duplicate name', 'rename one')
        return name

    def _read_value(self, element: ET.Element, key: str, where: str, default: str = '') -> float:
        (value,) = self._read_values(element, key, where, 1, default)
        return value

    def _read_values(
        self, element: ET.Element | None, key: str, where: str, count: int, default: str
    ) -> tuple[float, ...]:
        text = default if element is None else element.get(key, default)
        try:
            values = tuple(map(float, text.split()))
        except ValueError:
            values = ()
        if len(values) != count or not all(isfinite(v) and abs(v) <= _FARTHEST for v in values):
            numbers = 'a finite number' if count == 1 else f'{count} finite numbers'
            raise self._file_error(where, f'{key}={quote(text)} is not {numbers}', 'correct it')
        return values

    def _read_vector(
        self, element: ET.Element | None, key: str, where: str, default: str
    ) -> Vector:
        x, y, z = self._read_values(element, key, where, 3, default)
        return x, y, z

    def _read_link(self, element: ET.Element, where: str) -> Inertial | None:
        inertial = element.find('inertial')
        return None if inertial is None else self._read_inertial(inertial, where)

    def _read_inertial(self, element: ET.Element, where: str) -> Inertial | None:
        mass = element.find('mass')
        if mass is None:
            return None
        weight = self._read_value(mass, 'value', where)
        origin, tensor = element.find('origin'), element.find('inertia')
        keys = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
        ixx, ixy, ixz, iyy, iyz, izz = (
            self._read_values(tensor, key, where, 1, '0')[0] for key in keys
        )
        if weight <= 0.0:
            return None  # some exporters write frames this way
        return Inertial(
            weight,
            self._read_vector(origin, 'xyz', where, '0 0 0'),
            self._read_vector(origin, 'rpy', where, '0 0 0'),
            (ixx, ixy, ixz, iyy, iyz, izz),
        )

    def _read_joint(
        self, element: ET.Element, name: str, links: Mapping[str, object]
    ) -> UrdfJoint:
        where, kind = f'joint {name}', element.get('type', '')
        if kind not in _KINDS:
            raise self._file_error(
                where,
                f'type={quote(kind)} is not a joint type',
                f'write {list_names(MOVING)} or fixed',
            )
        parent, child = (self._read_end(element, end, where, links) for end in ('parent', 'child'))
        axis = self._read_vector(element.find('axis'), 'xyz', where, '1 0 0')
        if kind in MOVING and axis == (0.0, 0.0, 0.0):
            raise self._file_error(where, 'its axis is 0 0 0', 'write 0 0 1, for example')
        origin, mimic = element.find('origin'), element.find('mimic')
        return UrdfJoint(
            name,
            kind,
            parent,
            child,
            xyz=self._read_vector(origin, 'xyz', where, '0 0 0'),
            rpy=self._read_vector(origin, 'rpy', where, '0 0 0'),
            axis=axis,
            mimics='' if mimic is None else mimic.get('joint', ''),
            multiplier=self._read_values(mimic, 'multiplier', where, 1, '1')[0],
            offset=self._read_values(mimic, 'offset', where, 1, '0')[0],
            limits=NO_LIMITS,
        )

    def _read_limits(
        self, joint: ET.Element, name: str, made_up: Mapping[str, str] | None
    ) -> Limits:
        """
        Return the usable limits of ``<limit>``.

        Not used are numbers that ``linkage urdf`` made up, bounds of a continuous joint, two
        bounds of 0, and a velocity or an effort of 0, which some exporters write for unknown.
        """
        limit, where = joint.find('limit'), f'joint {name}'
        if limit is None or joint.get('type') not in MOVING:
            return NO_LIMITS
        told = {
            key: self._read_value(limit, key, where, default='0')
            for key in ('lower', 'upper', 'velocity', 'effort')
        }
        book = dict(made_up or {})
        if any(book.get(key, limit.get(key)) != limit.get(key) for key in ('lower', 'upper')):
            # A user has corrected one of the two and left the other.
            book = {key: text for key, text in book.items() if key not in ('lower', 'upper')}
        for key, text in book.items():
            if key in told and text == limit.get(key):
                del told[key]
        low, high = told.get('lower', -inf), told.get('upper', inf)
        if joint.get('type') == 'continuous' or low == high == 0.0:
            low, high = -inf, inf
        if low >= high:
            raise self._file_error(
                where,
                f'its limits, {low:g} to {high:g}, leave nothing between them',
                'correct <limit>, or leave lower and upper out',
            )
        rates = [told.get(key, 0.0) for key in ('velocity', 'effort')]
        velocity, effort = (value if value > 0.0 else inf for value in rates)
        return Limits(low, high, velocity, effort)

    def _read_end(
        self, element: ET.Element, end: str, where: str, links: Mapping[str, object]
    ) -> str:
        closing = element.find(end)
        link = closing.get('link', '') if closing is not None else ''
        return self._checked_link(link, end, where, links)

    def _checked_link(self, link: str, end: str, where: str, links: Mapping[str, object]) -> str:
        if link not in links:
            remedy = did_you_mean(link, links, 'name a link')
            raise self._file_error(where, f'its {end} {quote(link)} is not a link', remedy)
        return link

    def _check_mimics(self, joints: Mapping[str, UrdfJoint]) -> None:
        for joint in joints.values():
            if not joint.mimics:
                continue
            if joint.mimics not in joints:
                raise self._file_error(
                    f'joint {joint.name}',
                    f'mimics {quote(joint.mimics)}, which is not a joint',
                    'name a joint',
                )
            if joints[joint.mimics].mimics or joints[joint.mimics].kind not in MOVING:
                raise self._file_error(
                    f'joint {joint.name}',
                    f'mimics {quote(joint.mimics)}, which does not move by itself',
                    'name the joint that it follows in the end',
                )

    def _order_joints(
        self, links: Mapping[str, object], joints: Mapping[str, UrdfJoint]
    ) -> tuple[str, list[UrdfJoint]]:
        held: dict[str, UrdfJoint] = {}
        for joint in joints.values():
            if joint.child in held:
                raise self._file_error(
                    f'link {joint.child}',
                    f'is the child of two joints, {held[joint.child].name} and {joint.name}',
                    'let one end in its own frame, and close it by --close',
                )
            held[joint.child] = joint
        roots = [link for link in links if link not in held]
        if len(roots) != 1:
            reason = f'has {len(roots)} roots ({list_names(roots)})' if roots else 'has no root'
            raise self._file_error('', reason, 'join all links by joints to one root link')
        ordered = list(_joints_below(roots[0], joints))
        for joint in joints.values():
            if joint not in ordered:
                raise self._file_error(
                    f'joint {joint.name}',
                    'is in a ring of joints',
                    'close it by --close instead',
                )
        return roots[0], ordered


def _made_up(joint: ET.Element) -> Mapping[str, str] | None:
    """Return the limits of a joint that ``linkage urdf`` made up; None if it noted none."""
    computed = joint.find('computed')
    return None if computed is None else computed.attrib


def _is_pin_of_gazebo(joint: ET.Element) -> bool:
    """Return whether a joint of SDF is a pin or weld whose pose is in the frame of its child."""
    pose = joint.find('pose')
    relative = '' if pose is None else pose.get('relative_to', '')
    in_child = relative in ('', joint.get('name'), (joint.findtext('child') or '').strip())
    return in_child and joint.get('type', '') in ('revolute', 'continuous', 'ball', 'fixed')


def _unread_tags(root: ET.Element) -> Iterator[str]:
    """Yield the tags that may close loops and are not read, in words."""
    for joint in root.findall('gazebo/joint'):
        if _is_pin_of_gazebo(joint):
            continue
        ends = f'{joint.findtext("parent", "")} and {joint.findtext("child", "")}'
        yield f'joint {joint.get("name", "")} of <gazebo>, between {ends}'
    for element in root:
        if element.tag == UNREAD:
            yield element.get('of', '')
        elif isinstance(element.tag, str) and element.tag not in _USUAL_TAGS:
            yield f'<{element.tag}>'


def _joints_below(root: str, joints: Mapping[str, UrdfJoint]) -> Iterator[UrdfJoint]:
    """Yield joints, parents before children."""
    reached = [root]
    for link in reached:
        for joint in joints.values():
            if joint.parent == link:
                yield joint
                reached.append(joint.child)


def _actuated_joints(root: ET.Element, joints: Mapping[str, UrdfJoint]) -> list[str]:
    """Return the joints that ros2_control commands, else transmissions, else URDF+ says."""
    commanded = [
        joint.get('name', '')
        for joint in root.iterfind('ros2_control/joint')
        if joint.find('command_interface') is not None
    ]
    transmitted = [joint.get('name', '') for joint in root.iterfind('transmission/joint')]
    independent = [
        joint.get('name', '')
        for joint in root.findall('joint')
        if joint.get('independent') == 'true'
    ]
    for names in (commanded, transmitted, independent):
        moving = [
            name
            for name in dict.fromkeys(names)
            if name in joints and joints[name].kind in MOVING and not joints[name].mimics
        ]
        if moving:
            return moving
    return []
