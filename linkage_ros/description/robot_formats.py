# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.


"""The formats of robots: URDF, SDF, MJCF, and a YAML file of closings beside a URDF."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

from linkage_ros.description.closings_file import add_closings, urdf_beside
from linkage_ros.description.file_kinds import CLOSINGS, YAML
from linkage_ros.description.robot_graph import urdf_of
from linkage_ros.description.urdf_file import parse_robot, read_urdf_file
from linkage_ros.description.yaml_file import parse_yaml
from linkage_ros.errors import FileError


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
        remedy = f'write the URDF beside it as {file.with_suffix(".urdf").name}'
        raise FileError(file, CLOSINGS, 'closes loops of no URDF', remedy)
    root = parse_robot(read_urdf_file(urdf), str(urdf))
    add_closings(root, parse_yaml(data, str(file)))
    return bytes(ET.tostring(root, 'utf-8'))
