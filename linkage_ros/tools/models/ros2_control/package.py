# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage as an ament_cmake package with a transmission of ros2_control.

The files next to this one are copied; ``linkage.hpp`` and two headers in C are written: from the
inputs to joints and their derivatives, and from the commanded joints to the inputs. Actuators are
the inputs, and the velocities and efforts follow from the derivatives: power in is power out.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, quoteattr

from linkage_ros import __version__
from linkage_ros.errors import DefinitionError, list_names
from linkage_ros.kinematics import Status
from linkage_ros.names import c_string, comment_text
from linkage_ros.tools.models.source_code import C, STATUSES, Subject, write_source

_HERE = Path(__file__).parent
_COPIED = {
    'CMakeLists.txt': 'CMakeLists.txt',
    'package.xml': 'package.xml',
    'plugins.xml': 'plugins.xml',
    'transmission.cpp': 'src/transmission.cpp',
}
"""The files next to this one, and where they go."""


def write_package(
    closure: Any, inverse: Any, name: str, file: str, joints: Sequence[str]
) -> dict[str, bytes]:
    """
    Return the files of a package, by their paths in it.

    Parameters
    ----------
    closure
        The linkage with the actuators as its inputs.
    inverse
        The same with the commanded joints as its inputs.
    name
        Name of the package, an identifier of C++ too.
    file
        Name of the file of the linkage.
    joints
        The published joints, the commanded ones among them.

    Raises
    ------
    DefinitionError
        If the linkage cannot be compiled.

    """
    forward = Subject(closure, name, file, 0, tuple(joints), jacobian=True)
    inputs = closure.input_names  # An actuator that is commanded as a joint, too, stays an input.
    back = Subject(inverse.measuring(*inputs), f'{name}_inverse', file, 0, inputs)
    words = {'PACKAGE': name, 'VERSION': __version__, 'FILE': comment_text(file)}
    files = {}
    for source, path in _COPIED.items():
        text = (_HERE / source).read_text('utf-8')
        for word, value in words.items():
            text = text.replace(f'@{word}@', escape(value) if path.endswith('.xml') else value)
        files[path] = text
    for subject in (forward, back):
        language = C(subject.name, header=True, jacobian=subject.jacobian)
        files[f'src/{subject.name}.h'] = write_source(subject, language)
    files['src/linkage.hpp'] = _constants(forward, back)
    files['transmission.urdf'] = _transmission_element(forward)
    return {path: text.encode() for path, text in files.items()}


def commanded_joints(closure: Any, typed: Sequence[str]) -> tuple[str, ...]:
    """Return the joints that are commanded: the typed ones, or all if there is one per input."""
    if typed or len(closure.joint_names) == len(closure.input_names):
        return tuple(typed or closure.joint_names)
    count = len(closure.input_names)
    raise DefinitionError(
        'joints',
        f'{len(closure.joint_names)} are published, of which {count} can be commanded',
        f'name {count} of {list_names(closure.joint_names)}, each by --driven-by',
    )


def _constants(forward: Subject, back: Subject) -> str:
    """Return the header with names, counts and the two functions."""
    inputs, joints = forward.closure.input_names, forward.joints
    commanded = back.closure.linkage.inputs
    places = ', '.join(str(joints.index(driven.joint)) for driven in commanded)
    turns = ', '.join('false' if driven.slider else 'true' for driven in commanded)
    names = list(STATUSES)
    return f"""\
// Names of {comment_text(forward.file)}, and its functions, for transmission.cpp.

#pragma once

#include <array>
#include <cstddef>

#include "{forward.name}.h"
#include "{back.name}.h"

namespace {forward.name}_plugin
{{

constexpr std::size_t INPUTS = {len(inputs)}, JOINTS = {len(joints)};
constexpr std::array<const char *, INPUTS> INPUT_NAMES{{{_literals(inputs)}}};
constexpr std::array<const char *, JOINTS> JOINT_NAMES{{{_literals(joints)}}};
// Numbers of the joints that are commanded, and which of them turn
constexpr std::array<std::size_t, INPUTS> COMMANDED{{{places}}};
constexpr std::array<bool, INPUTS> TURNS{{{turns}}};

constexpr std::array<const char *, {len(names)}> STATUS_NAMES{{{_literals(names)}}};
constexpr int LAST_VALID = {names.index(Status.CHANGE_POINT.name)};
constexpr int LAST_WITH_VALUES = {names.index(Status.LIMITED.name)};
constexpr int OPEN = {names.index(Status.OPEN.name)};

inline int to_joints(const double * inputs, double * joints, double * jacobian)
{{
  return {forward.name}_jacobian(inputs, joints, jacobian);
}}

inline int to_inputs(const double * commanded, double * inputs)
{{
  return {back.name}_position(commanded, inputs);
}}

}}  // namespace {forward.name}_plugin
"""


def _literals(names: Sequence[str]) -> str:
    return ', '.join(map(c_string, names))


def _transmission_element(forward: Subject) -> str:
    """Return the element that the URDF needs."""
    parts = [
        f'  <{kind} name={quoteattr(name)} role={quoteattr(name)}/>'
        for kind, names in (('actuator', forward.closure.input_names), ('joint', forward.joints))
        for name in names
    ]
    lines = [
        '<!-- For <ros2_control type="system">: names are yours, roles those of the linkage -->',
        f'<transmission name="{forward.name}">',
        f'  <plugin>{forward.name}/Transmission</plugin>',
        *parts,
        '</transmission>',
    ]
    return '\n'.join([*lines, ''])
