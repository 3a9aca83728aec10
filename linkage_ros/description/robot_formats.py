# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""
The formats of robots: URDF, SDF, MJCF, and a YAML file of closings next to a URDF.

Such a file, as example-parallel-robots writes them, names pairs of frames that meet, what joints
of the URDF really are, and the motors. It becomes a URDF that says all of this itself, which is
what bags keep.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from linkage_ros.description.file_kinds import CLOSINGS, YAML
from linkage_ros.description.robot_graph import urdf_of
from linkage_ros.description.section import Section
from linkage_ros.description.urdf_file import parse_robot, read_urdf_file, UNREAD
from linkage_ros.description.yaml_file import parse_yaml
from linkage_ros.errors import did_you_mean, FileError, list_names, quote

_LOOPS = {'3d': 'spherical', '6d': 'fixed'}
_HINGES = {
    'SPHERICAL': 'XYZ',
    **{f'UJOINT_{first}{second}': first + second for first in 'XYZ' for second in 'XYZ'},
}
"""Axes of the hinges through one point that a joint stands for."""

_FIXED = 'FIXED'


def read_as_urdf(file: Path) -> bytes:
    """
    Return a robot as the content of a URDF.

    A LinkageError has file, line or element, and remedy.
    """
    data = read_urdf_file(file)
    if file.suffix.lower() in YAML and CLOSINGS.encode() in data:
        return _with_closings(file, data)
    name = str(file)
    root = parse_robot(data, name) if file.suffix.lower() != '.urdf' else None
    try:
        return data if root is None else _convert(root, name) or data
    except RecursionError:
        raise FileError(name, '', 'is nested too deeply', 'use fewer levels') from None


def _convert(root: ET.Element, name: str) -> bytes:
    """Return a robot in another format as a URDF; b'' if it is in none."""
    if root.tag == 'sdf':
        from linkage_ros.description.sdf_file import read_sdf  # local import: few robots

        return urdf_of(read_sdf(root, name))
    if root.tag == 'mujoco':
        from linkage_ros.description.mjcf_file import read_mjcf  # local import: few robots

        return urdf_of(read_mjcf(root, name))
    return b''


def _with_closings(file: Path, data: bytes) -> bytes:
    urdf = urdf_beside(file)
    if urdf is None:
        remedy = f'write the URDF next to it as {file.with_suffix(".urdf").name}'
        raise FileError(file, CLOSINGS, 'closes loops of no URDF', remedy)
    root = parse_robot(read_urdf_file(urdf), str(urdf))
    add_closings(root, parse_yaml(data, str(file)))
    return bytes(ET.tostring(root, 'utf-8'))


def urdf_beside(file: Path) -> Path | None:
    """
    Return the URDF that a file of closings is about: of its name, or the only one there.

    A link to a file in another folder is none: who may read the one may not read all others.
    """
    named = file.with_suffix('.urdf')
    urdfs = [named] if named.is_file() else [*file.parent.glob('*.urdf')]
    folder = file.resolve().parent
    return urdfs[0] if len(urdfs) == 1 and urdfs[0].resolve().parent == folder else None


def add_closings(robot: ET.Element, content: Section) -> None:
    """
    Add what a file of closings says to the robot of a URDF.

    A FileError names a key of that file.
    """
    joints = {joint.get('name', ''): joint for joint in robot.findall('joint')}
    frames = {link.get('name', ''): link.get('name', '') for link in robot.findall('link')}
    for name, joint in joints.items():
        child = joint.find('child')
        frames.setdefault(name, '' if child is None else child.get('link', ''))
    pairs = _read_list(content, CLOSINGS)
    types = _read_list(content, 'type') or ['6d'] * len(pairs)
    changed = _read_list(content, 'joint_name')
    kinds = _read_list(content, 'joint_type')
    motors = _read_list(content, 'name_mot')
    content.finish()
    for key, names, of in (('type', types, pairs), ('joint_type', kinds, changed)):
        if len(names) != len(of):
            raise content.error(key, f'has {len(names)} entries', f'write {len(of)} of them')
    for name in motors:
        _check_choice(content, 'name_mot', name, joints)
    for number, (pair, kind) in enumerate(zip(pairs, types, strict=True), 1):
        if not isinstance(pair, list) or len(pair) != 2:
            raise content.error(CLOSINGS, f'{quote(pair)} is not a pair', 'write [FRAME, FRAME]')
        for frame in pair:
            _check_choice(content, CLOSINGS, frame, frames)
        _check_choice(content, 'type', str(kind).lower(), _LOOPS)
        loop = ET.SubElement(
            robot, 'loop_joint', name=f'closing_{number}', type=_LOOPS[str(kind).lower()]
        )
        for tag, frame in zip(('link1', 'link2'), pair, strict=True):
            ET.SubElement(loop, tag, link=frames[frame], rpy='0 0 0')
    for name, kind in zip(changed, kinds, strict=True):
        if name not in joints:
            if near := did_you_mean(str(name), [*joints.keys() - {*changed}], ''):
                raise content.error('joint_name', f'there is no joint {quote(name)}', near)
            ET.SubElement(robot, UNREAD, of=f'{kind} of {name}, which is not a joint')
        elif kind == _FIXED:
            joints[name].set('type', 'fixed')
        else:
            _check_choice(content, 'joint_type', kind, [*_HINGES, _FIXED])
            for element in _hinges(joints[name], _HINGES[kind]):
                robot.append(element)
    for name in motors:
        joints[name].set('independent', 'true')


def _read_list(content: Section, key: str) -> list[Any]:
    """Return a list, empty if it is absent."""
    content.remove_key(key)
    items = content.mapping.get(key, [])
    if not isinstance(items, list):
        raise content.error(key, f'{quote(items)} is not a list', 'write [A, B]')
    return items


def _check_choice(
    content: Section, key: str, name: Any, known: Sequence[str] | Mapping[str, object]
) -> None:
    if name not in known:
        remedy = did_you_mean(str(name), known, f'name one of {list_names(known)}')
        raise content.error(key, f'there is no {quote(name)}', remedy)


def _hinges(joint: ET.Element, axes: str) -> Iterator[ET.Element]:
    """Make a joint the last of hinges through one point, and yield the others with their links."""
    name = joint.get('name', '')
    parent, origin = joint.find('parent'), joint.find('origin')
    for axis in axes[:-1]:
        made = ET.Element('joint', name=f'{name}_{axis}', type='continuous')
        if origin is not None:
            made.append(origin)
            joint.remove(origin)
            origin = None
        if parent is not None:
            made.append(ET.Element('parent', parent.attrib))
            parent.set('link', f'{name}_{axis}_link')
        ET.SubElement(made, 'child', link=f'{name}_{axis}_link')
        _set_axis(made, axis)
        yield ET.Element('link', name=f'{name}_{axis}_link')
        yield made
    joint.set('name', f'{name}_{axes[-1]}')
    joint.set('type', 'continuous')
    _set_axis(joint, axes[-1])


def _set_axis(joint: ET.Element, axis: str) -> None:
    for old in joint.findall('axis'):
        joint.remove(old)
    ET.SubElement(joint, 'axis', xyz=' '.join('1' if axis == letter else '0' for letter in 'XYZ'))
