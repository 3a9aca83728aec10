# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
XML for robot models: numbers that read back as the same floats, and comments of any text.

``-p robot_description:="$(cat leg.urdf)"`` and a substitution in a launch file are read as YAML.
Therefore a whole file is also a plain YAML scalar: no colon before a blank, and no hash after one
(https://yaml.org/spec/1.1/, ns-plain-char).

Below are elements of MJCF that planar and spatial linkages both have.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
import re
from typing import Any
from xml.etree import ElementTree as ET

from linkage_ros.kinematics import Limits

_STRUCTURE = re.compile(r':(?=\s)|(?<=\s)#')
"""Text that ends a plain scalar. In our files only names and comments can contain it."""

_UNREADABLE = re.compile('[^\\n -~\xa0-\u2027\u202a-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]')
"""Characters that XML or YAML does not allow; of all names only a file's can contain them."""

DENSITY = 7850.0
"""Density of links without a given mass: steel, in [kg/m³]."""

DIFFERENCE = 1e-4
"""Step of the finite differences, in [rad] or as a fraction of a length."""

LEAST_INERTIA = 1e-12
"""The engine needs an inertia; a body without extent gets this, in [kg·m²]."""

_FARTHEST = 1e9
"""Stands for the missing limit of a joint that has one limit only, in [rad] or [m]."""


def format_number(value: float) -> str:
    """Return the shortest text that reads back as the same float; never a negative zero."""
    value = float(value) + 0.0
    return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)


def format_numbers(*values: float) -> str:
    """Return numbers separated by blanks."""
    return ' '.join(map(format_number, values))


def format_rough(*values: float) -> str:
    """Return numbers to six digits, for sizes that are only displayed."""
    return ' '.join(f'{value:.6g}' for value in values)


def xml_comment(lines: Sequence[str]) -> Any:
    """Return a comment; XML forbids two adjacent hyphens in it."""
    text = '\n'.join(f'  {line}'.rstrip() for line in lines)
    while '--' in text:
        text = text.replace('--', '- -')
    return ET.Comment(f'\n{text}\n')


def xml_document(root: ET.Element) -> bytes:
    """Return a whole file; the same content gives the same bytes."""
    ET.indent(root)
    text = _UNREADABLE.sub('\ufffd', ET.tostring(root, 'unicode'))
    text = _STRUCTURE.sub(lambda match: f'&#{ord(match[0])};', text)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{text}\n'.encode()


def write_limits(joint: ET.Element, limits: Limits) -> None:
    """Write the limits of a joint that MJCF can express: it has none for rates."""
    if limits.is_bounded:
        joint.set(
            'range', format_numbers(max(limits.low, -_FARTHEST), min(limits.high, _FARTHEST))
        )
    if limits.effort < inf:
        joint.set('actuatorfrcrange', format_numbers(-limits.effort, limits.effort))
