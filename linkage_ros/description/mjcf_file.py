# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""
Robots in MJCF, MuJoCo's format: bodies, joints and masses, and what `equality` closes.

The library mujoco reads the file, with its defaults and angles, after what is only seen, touched
or measured is gone: no file that it names is opened.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from math import inf
from types import ModuleType
from typing import Any
from xml.etree import ElementTree as ET

from linkage_ros.description.robot_graph import GraphJoint, RobotGraph, WORLD
from linkage_ros.errors import FileError
from linkage_ros.kinematics import (
    Limits,
    NO_LIMITS,
    SpatialMass,
    turned_tensor,
    Vector,
)

_NOT_PLAIN = (
    'include', 'model', 'attach', 'replicate', 'composite', 'flexcomp',
)  # fmt: skip
"""Elements that read files or stand for many others."""

_NOT_READ = (
    'asset', 'sensor', 'contact', 'plugin', 'extension', 'visual', 'statistic', 'actuator',
    'deformable', 'custom', 'size', 'option', 'geom', 'camera', 'light', 'skin', 'mesh', 'hfield',
    'texture', 'material', 'spatial', 'pair', 'motor', 'position', 'velocity',
    'general', 'damper', 'cylinder', 'muscle', 'adhesion', 'intvelocity', 'equality',
)  # fmt: skip
"""Elements, also in defaults, without which bodies, joints and sites are the same."""

_WELDED = 1e-6
"""Largest error of a weld in the pose, in [m] and [rad]."""

_LEAST_MASS, _LEAST_INERTIA = '1e-6', '1e-9'
"""What MuJoCo gives to bodies whose geometry is gone, in [kg] and [kg·m²]."""


def read_mjcf(root: ET.Element, file: str) -> RobotGraph:
    """Read a model of MuJoCo; a FileError has file, element and remedy."""
    try:
        import mujoco  # local import: an extra
    except ModuleNotFoundError:
        remedy = "pip install 'linkage_ros[mjcf]'"
        raise FileError(file, '', 'is a model of MuJoCo, whose library reads it', remedy) from None
    for tag in _NOT_PLAIN:
        if root.find(f'.//{tag}') is not None:
            remedy = 'write a plain file: mj_saveLastXML'
            raise FileError(file, '', f'has an element <{tag}>', remedy)
    equality = [*root.findall('equality/*')]
    driven = {
        str(actuator.get(key))
        for actuator in root.findall('actuator/*')
        for key in ('joint', 'jointinparent')
    }
    pulled = {actuator.get('tendon') for actuator in root.findall('actuator/*[@tendon]')}
    followers = {of.get('joint1') for of in equality}
    for tendon in root.findall('tendon/fixed'):
        # What a tendon moves together has one motor.
        joints = [str(of.get('joint')) for of in tendon if of.get('joint') not in followers]
        driven |= {*joints[:1]} if tendon.get('name') in pulled else set()
    weighed = {body.get('name') for body in root.iter('body') if body.find('inertial') is not None}
    kept = [of for of in equality if of.tag in ('connect', 'weld', 'joint', 'tendon')]
    _remove(root, _NOT_READ)
    ET.SubElement(root, 'equality').extend(kept)
    compiler = root.find('compiler')
    if compiler is None:
        compiler = ET.SubElement(root, 'compiler')
    for key in ('meshdir', 'texturedir', 'assetdir', 'balanceinertia'):
        compiler.attrib.pop(key, None)
    compiler.attrib |= {'boundmass': _LEAST_MASS, 'boundinertia': _LEAST_INERTIA,
                        'fusestatic': 'false', 'inertiafromgeom': 'false'}  # fmt: skip
    try:
        model = mujoco.MjModel.from_xml_string(ET.tostring(root, 'unicode'))
    except ValueError as error:
        reason = f'is refused by MuJoCo ({str(error).splitlines()[0]})'
        raise FileError(file, '', reason, 'correct the file') from None
    unread = [f'{of.tag} {of.get("name", "")}' for of in equality if of not in kept]
    return _ModelReader(mujoco, model, file, driven, weighed, unread).read(root.get('model', ''))


def _remove(root: ET.Element, tags: tuple[str, ...]) -> None:
    for element in [*root.iter()]:
        for child in [*element]:
            if child.tag in tags:
                element.remove(child)


class _ModelReader:
    """The parts of a compiled model, in its first keyframe, or else in its own pose."""

    def __init__(
        self,
        mujoco: ModuleType,
        model: Any,
        file: str,
        driven: set[str],
        weighed: set[str | None],
        unread: list[str],
    ) -> None:
        self._mujoco, self._model, self._file = mujoco, model, file
        self._driven, self._weighed, self._unread = driven, weighed, unread
        self._data = mujoco.MjData(model)
        if model.nkey:
            self._data.qpos[:] = model.key_qpos[0]
        mujoco.mj_forward(model, self._data)
        self._links = [WORLD, *(model.body(n).name or f'body_{n}' for n in range(1, model.nbody))]
        self._joints = [model.joint(n).name or f'joint_{n}' for n in range(model.njnt)]

    def read(self, name: str) -> RobotGraph:
        model = self._model
        links: dict[str, SpatialMass | None] = {}
        joints: list[GraphJoint] = []
        for body in range(1, model.nbody):
            parent = self._links[model.body_parentid[body]]
            own = [
                *range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body])
            ]
            for number, joint in enumerate(own, 1):
                is_last = number == len(own)
                child = self._links[body] if is_last else f'{self._joints[joint]}_link'
                links[child] = self._mass(body) if is_last else None
                joints.append(self._joint(joint, parent, child))
                parent = child
            if not own:
                child = self._links[body]
                links[child] = self._mass(body)
                place = _vector(self._data.xpos[body])
                joints.append(GraphJoint(f'{child}_joint', 'fixed', parent, child, place))
        follows = self._find_ratios()
        joints = [joint._replace(follows=_leader_of(joint.name, follows)) for joint in joints]
        joints += self._find_closings()
        return RobotGraph(self._file, name, links, joints, self._unread)

    def _joint(self, joint: int, parent: str, child: str) -> GraphJoint:
        model, name = self._model, self._joints[joint]
        kinds = self._mujoco.mjtJoint
        kind = {
            kinds.mjJNT_HINGE: 'continuous', kinds.mjJNT_SLIDE: 'prismatic',
            kinds.mjJNT_BALL: 'ball', kinds.mjJNT_FREE: 'fixed',  # a base that floats
        }[kinds(model.jnt_type[joint])]  # fmt: skip
        limits, value = NO_LIMITS, 0.0
        if kind in ('continuous', 'prismatic'):
            value = float(self._data.qpos[model.jnt_qposadr[joint]])
            if model.jnt_limited[joint]:
                low, high = map(float, model.jnt_range[joint])
                limits = Limits(low, high, inf, inf)
                kind = kind.replace('continuous', 'revolute')
        return GraphJoint(
            name, kind, parent, child, _vector(self._data.xanchor[joint]),
            _vector(self._data.xaxis[joint]), limits=limits, is_driven=name in self._driven,
            value=value,
        )  # fmt: skip

    def _mass(self, body: int) -> SpatialMass | None:
        if self._model.body(body).name not in self._weighed:
            return None
        axes = self._data.ximat[body].reshape(3, 3).T
        xx, yy, zz = map(float, self._model.body_inertia[body])
        tensor = turned_tensor([*map(_vector, axes)], (xx, 0.0, 0.0, yy, 0.0, zz))
        mass = float(self._model.body_mass[body])
        return SpatialMass(mass, _vector(self._data.xipos[body]), tensor)

    def _find_ratios(self) -> dict[str, tuple[str, float, float]]:
        """Return the joints that follow others by a polynomial of degree 1, or a tendon of two."""
        model, kinds = self._model, self._mujoco.mjtEq
        follows: dict[str, tuple[str, float, float]] = {}
        for number in range(model.neq):
            data = [*map(float, model.eq_data[number])]
            first, second = model.eq_obj1id[number], model.eq_obj2id[number]
            if model.eq_type[number] == kinds.mjEQ_JOINT:
                if second < 0 or any(data[2:5]):
                    self._unread.append(f'equality of joint {self._joints[first]}')
                else:
                    follows[self._joints[first]] = (self._joints[second], data[1], data[0])
            elif model.eq_type[number] == kinds.mjEQ_TENDON:
                start, count = model.tendon_adr[first], model.tendon_num[first]
                wraps = [
                    (self._joints[model.wrap_objid[i]], float(model.wrap_prm[i]))
                    for i in range(start, start + count)
                ]
                if second >= 0 or count != 2 or not all(part for _, part in wraps):
                    self._unread.append(f'equality of tendon {model.tendon(first).name}')
                    continue
                wraps.sort(key=lambda wrap: wrap[0] in {*self._driven, *follows})
                (moved, by), (of, factor) = wraps
                # The tendon keeps the length that it has with all joints at 0.
                follows[moved] = (of, -factor / by, data[0] / by)
        return follows

    def _find_closings(self) -> Iterator[GraphJoint]:
        """Yield what closes loops."""
        model, kinds = self._model, self._mujoco.mjtEq
        for number in range(model.neq):
            kind = {kinds.mjEQ_CONNECT: 'ball', kinds.mjEQ_WELD: 'fixed'}.get(
                kinds(model.eq_type[number])
            )
            if kind is None:
                continue
            name = model.eq(number).name or f'closing_{number + 1}'
            ids = (model.eq_obj1id[number], model.eq_obj2id[number])
            if model.eq_objtype[number] == self._mujoco.mjtObj.mjOBJ_SITE:
                bodies = [int(model.site_bodyid[site]) for site in ids]
                places = [_vector(self._data.site_xpos[site]) for site in ids]
            else:
                bodies = [*map(int, ids)]
                anchors = (model.eq_data[number][:3], model.eq_data[number][3:6])
                places = [
                    _vector(self._data.xpos[body] + self._data.xmat[body].reshape(3, 3) @ anchor)
                    for body, anchor in zip(bodies, anchors, strict=True)
                ]
                if kind == 'fixed':
                    self._check_weld(number, name)
                    # Both bodies are welded as they are in the pose.
                    places = [places[1]] * 2
            yield GraphJoint(
                name, kind, self._links[bodies[0]], self._links[bodies[1]], places[0],
                second_place=places[1],
            )  # fmt: skip

    def _check_weld(self, number: int, name: str) -> None:
        """Refuse a weld whose bodies are not as it says in the pose."""
        data = self._data
        rows = [row for row in range(data.ne) if data.efc_id[row] == number]
        apart = max((abs(float(data.efc_pos[row])) for row in rows), default=0.0)
        if apart > _WELDED:
            reason = f'holds its bodies {apart:.3g} from their pose in the file'
            remedy = 'leave relpose out, or write the pose in which it holds'
            raise FileError(self._file, f'weld {name}', reason, remedy)


def _leader_of(
    name: str, follows: Mapping[str, tuple[str, float, float]]
) -> tuple[str, float, float] | None:
    """Return the joint that a joint follows in the end, with factor and offset."""
    if name not in follows:
        return None
    of, factor, offset = follows[name]
    for _ in follows:
        if of in follows:
            of, inner, shift = follows[of]
            factor, offset = factor * inner, offset + factor * shift
    return of, factor, offset


def _vector(numbers: Any) -> Vector:
    x, y, z = map(float, numbers)
    return x, y, z
