# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""
Robots in SDF, Gazebo's format, whose joints may close loops.

Read are links, frames, joints and masses of one model; poses may be relative to any of them.
"""

from __future__ import annotations

from math import inf, isfinite, radians, sqrt
from typing import NoReturn
from xml.etree import ElementTree as ET

from linkage_ros.description.robot_graph import GraphJoint, RobotGraph, WORLD
from linkage_ros.description.robot_pose import frame_of
from linkage_ros.errors import did_you_mean, FileError, list_names, quote
from linkage_ros.kinematics import (
    cross,
    direction_of,
    GROUND_FRAME,
    length,
    Limits,
    NO_LIMITS,
    SpaceFrame,
    SpatialMass,
    turned_tensor,
    Vector,
)

_KINDS = {
    'revolute': 'revolute', 'continuous': 'continuous', 'prismatic': 'prismatic', 'ball': 'ball',
    'fixed': 'fixed', 'universal': 'universal', 'revolute2': 'universal',
}  # fmt: skip

_MODEL = '__model__'
_NONE = (0.0, 0.0, 0.0)

_JOINT_AXES_SINCE = 1.5
"""Version since which axes are in the frame of the joint, unless they say otherwise."""

_PARALLEL = 1e-6
"""Sine of the angle between axes that CAD rounds to parallel ones."""

_NO_LIMIT = 1e15
"""Bounds beyond it, in [rad] or [m], are none, as SDF has it."""


def read_sdf(root: ET.Element, file: str) -> RobotGraph:
    """Read the only model of an SDF; a FileError has file, link or joint, and remedy."""
    return _SdfReader(root, file).read()


class _SdfReader:
    def __init__(self, root: ET.Element, file: str) -> None:
        self._file = file
        models = [*root.findall('model'), *root.findall('world/model')]
        if len(models) != 1:
            names = list_names(model.get('name', '') for model in models)
            self._refuse('', f'has {len(models)} models{names and ": "}{names}', 'keep one')
        self._model = model = models[0]
        for tag in ('model', 'include'):
            if model.find(tag) is not None:
                self._refuse(f'model {model.get("name", "")}', f'has a nested <{tag}>',
                             'write one model without others: gz sdf -p FILE')  # fmt: skip
        try:
            self._version = float(root.get('version', '1.7'))
        except ValueError:
            self._version = 1.7
        self._parts: dict[str, ET.Element] = {}
        for part in model:
            if part.tag in ('link', 'joint', 'frame'):
                name = part.get('name', '')
                if not name or name in self._parts or name == WORLD:
                    self._refuse(f'{part.tag} {name}', 'needs a name of its own', 'rename it')
                self._parts[name] = part
        self._frames = {_MODEL: GROUND_FRAME, WORLD: GROUND_FRAME}

    def read(self) -> RobotGraph:
        links = {name: part for name, part in self._parts.items() if part.tag == 'link'}
        joints = [
            self._read_joint(name, part, links)
            for name, part in self._parts.items()
            if part.tag == 'joint'
        ]
        if not links:
            self._refuse('', 'has no link', 'name an SDF model')
        if not any(WORLD in (joint.parent, joint.child) for joint in joints):
            first = self._model.get('canonical_link') or next(iter(links))
            if first not in links:
                self._refuse('', f'canonical_link={quote(first)} is not a link', 'name a link')
            place = self._frame(first).origin
            joints.insert(0, GraphJoint(f'{WORLD}_to_{first}', 'fixed', WORLD, first, place))
        masses = {name: self._read_mass(name, part) for name, part in links.items()}
        return RobotGraph(self._file, self._model.get('name', ''), masses, joints)

    def _refuse(self, where: str, reason: str, remedy: str) -> NoReturn:
        raise FileError(self._file, where, reason, remedy)

    def _numbers(self, text: str | None, where: str, count: int) -> list[float]:
        try:
            values = [float(word) for word in (text or '').split()]
        except ValueError:
            values = []
        if len(values) != count or not all(map(isfinite, values)):
            self._refuse(where, f'{quote((text or "").strip())} is not {count} finite numbers',
                         'correct it')  # fmt: skip
        return values

    def _pose(self, element: ET.Element | None, where: str) -> SpaceFrame:
        """Return the frame of a <pose>."""
        if element is None or not (element.text or '').strip():
            return GROUND_FRAME
        if element.get('rotation_format', 'euler_rpy') == 'quat_xyzw':
            x, y, z, *quaternion = self._numbers(element.text, where, 7)
            return _frame_of_quaternion(quaternion, (x, y, z))
        x, y, z, *turns = self._numbers(element.text, where, 6)
        if element.get('degrees') == 'true':
            turns = [*map(radians, turns)]
        return frame_of((x, y, z), (turns[0], turns[1], turns[2]))

    def _frame(self, name: str) -> SpaceFrame:
        """Return the frame of a link, joint or frame in that of the model."""
        way: dict[str, SpaceFrame] = {}
        base = name
        while base not in self._frames:
            if base in way:
                self._refuse(base, 'its pose is relative to itself', 'name another frame')
            if base not in self._parts:
                remedy = did_you_mean(base, self._parts, 'name a link, a joint or a frame')
                self._refuse('', f'there is no frame {quote(base)}', remedy)
            way[base], base = self._pose_and_base(base)
        frame = self._frames[base]
        for part, pose in reversed(way.items()):
            frame = self._frames[part] = frame.compose(pose)
        return frame

    def _pose_and_base(self, name: str) -> tuple[SpaceFrame, str]:
        """Return the pose of a part, and the frame to which it is relative."""
        part, where = self._parts[name], f'{self._parts[name].tag} {name}'
        pose = part.find('pose')
        base = {
            'link': _MODEL, 'joint': _text(part, 'child'), 'frame': part.get('attached_to', ''),
        }[part.tag]  # fmt: skip
        base = (pose.get('relative_to', '') if pose is not None else '') or base or _MODEL
        return self._pose(pose, where), base

    def _read_joint(self, name: str, part: ET.Element, links: dict[str, ET.Element]) -> GraphJoint:
        where, kind = f'joint {name}', part.get('type', '')
        if kind not in _KINDS:
            self._refuse(where, f'type={quote(kind)} is not read', f'write {list_names(_KINDS)}')
        parent, child = (
            self._link_of(_text(part, end), where, end, links) for end in ('parent', 'child')
        )
        own = self._frame(name)
        axis = part.find('axis')
        first, second = (
            self._read_axis(element, own, where) for element in (axis, part.find('axis2'))
        )
        if _KINDS[kind] == 'universal' and length(cross(first, second)) < _PARALLEL:
            remedy = 'write an <axis2> across the first; it is 0 0 1 where none is written'
            self._refuse(where, 'its two axes are parallel', remedy)
        limits, follows = NO_LIMITS, None
        if _KINDS[kind] in ('revolute', 'continuous', 'prismatic') and axis is not None:
            limits = self._read_limits(axis.find('limit'), where)
            follows = self._read_mimic(axis.find('mimic'), where)
        return GraphJoint(
            name, _KINDS[kind], parent, child, own.origin, first, second, limits, follows=follows
        )

    def _link_of(self, name: str, where: str, end: str, links: dict[str, ET.Element]) -> str:
        """Return the link that a name stands for; a frame stands for the link it hangs on."""
        seen = set()
        while name not in links and name in self._parts and name not in seen:
            seen.add(name)
            part = self._parts[name]
            name = part.get('attached_to', '') if part.tag == 'frame' else _text(part, 'child')
        if name != WORLD and name not in links:
            remedy = did_you_mean(name, links, 'name a link')
            self._refuse(where, f'its {end} {quote(name)} is not a link', remedy)
        return name

    def _read_axis(self, axis: ET.Element | None, own: SpaceFrame, where: str) -> Vector:
        """Return the direction of an axis; as SDFormat has it, z if it is left out."""
        axis = ET.Element('axis') if axis is None else axis
        xyz = axis.find('xyz')
        x, y, z = self._numbers('0 0 1' if xyz is None else xyz.text, where, 3)
        if (x, y, z) == _NONE:
            self._refuse(where, 'its axis is 0 0 0', 'write 0 0 1, for example')
        named = '' if xyz is None else xyz.get('expressed_in', '')
        in_model = _text(axis, 'use_parent_model_frame') in ('1', 'true')
        if in_model or self._version < _JOINT_AXES_SINCE:
            named = named or _MODEL
        frame = self._frame(named) if named else own
        return frame.turn(direction_of((x, y, z)))

    def _read_limits(self, limit: ET.Element | None, where: str) -> Limits:
        if limit is None:
            return NO_LIMITS
        lower, upper, velocity, effort = (
            self._limit(limit, key, where) for key in ('lower', 'upper', 'velocity', 'effort')
        )
        low, high = -inf if lower is None else lower, inf if upper is None else upper
        if low >= high:
            if low > high or low != 0.0:
                reason = f'its limits, {low:g} to {high:g}, leave nothing between them'
                self._refuse(where, reason, 'correct <limit>')
            low, high = -inf, inf
        fastest, strongest = (
            value if value is not None and value > 0.0 else inf for value in (velocity, effort)
        )
        return Limits(low, high, fastest, strongest)

    def _limit(self, limit: ET.Element, key: str, where: str) -> float | None:
        text = _text(limit, key)
        if not text or text.lstrip('+-').lower() in ('inf', 'infinity'):
            return None
        (value,) = self._numbers(text, where, 1)
        return value if abs(value) < _NO_LIMIT else None

    def _read_mimic(self, mimic: ET.Element | None, where: str) -> tuple[str, float, float] | None:
        if mimic is None:
            return None
        named = mimic.get('joint', '')
        part = self._parts.get(named)
        if part is None or part.tag != 'joint':
            remedy = did_you_mean(named, self._parts, 'name a joint')
            self._refuse(where, f'mimics {quote(named)}, which is not a joint', remedy)
        factor, offset, reference = (
            self._numbers(_text(mimic, key) or default, where, 1)[0]
            for key, default in (('multiplier', '1'), ('offset', '0'), ('reference', '0'))
        )
        return named, factor, offset - factor * reference

    def _read_mass(self, name: str, part: ET.Element) -> SpatialMass | None:
        inertial, where = part.find('inertial'), f'link {name}'
        if inertial is None or not _text(inertial, 'mass'):
            return None
        (mass,) = self._numbers(_text(inertial, 'mass'), where, 1)
        if mass <= 0.0:
            return None
        frame = self._frame(name).compose(self._pose(inertial.find('pose'), where))
        keys = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
        xx, xy, xz, yy, yz, zz = (
            self._numbers(_text(inertial, f'inertia/{key}') or '0', where, 1)[0] for key in keys
        )
        tensor = turned_tensor(frame[:3], (xx, xy, xz, yy, yz, zz))
        return SpatialMass(mass, frame.origin, tensor)


def _text(element: ET.Element, path: str) -> str:
    return (element.findtext(path) or '').strip()


def _frame_of_quaternion(quaternion: list[float], origin: Vector) -> SpaceFrame:
    """Return a frame by x, y, z and w of its quaternion, of any length except 0."""
    size = sqrt(sum(part * part for part in quaternion)) or 1.0
    x, y, z, w = (part / size for part in quaternion)
    return SpaceFrame(
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
        (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
        (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
        origin,
    )
