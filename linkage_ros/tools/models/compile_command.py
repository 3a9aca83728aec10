# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Write a linkage as source that stands alone: C, a C header, JavaScript, Python, or a ROS package.

The source holds one function that solves the linkage as this package does: position for
--derivatives 0, velocity for 1, motion for 2. It returns a status, and the joints where there are
any; its head says what it takes and gives. With --arrays it is a Python module for arrays of
NumPy, PyTorch, JAX and CuPy, with all of these functions and the Jacobian. --ros2-control writes a
package with a transmission, whose actuators are the inputs.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
import re
from threading import Event
from typing import Any

from linkage_ros.cli import add_file, add_output, add_robot, bounded_number, robot_of
from linkage_ros.description import (
    atomic_write,
    linkage_content,
    read_any_closure,
    write_folder,
)
from linkage_ros.errors import DefinitionError, LinkageError, list_names, quote
from linkage_ros.resources import named_file
from linkage_ros.tools.models.ros2_control import commanded_joints, write_package
from linkage_ros.tools.models.source_code import (
    C_NAME,
    c_name,
    LANGUAGES,
    Subject,
    write_arrays,
    write_source,
)

EXAMPLE = 'linkage compile four_bar -o four_bar.c'

_PACKAGE = re.compile('[a-z](_?[a-z0-9])+')
"""The names of packages that REP 144 allows."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_file(parser)
    add_robot(parser)
    add_output(parser, LANGUAGES, '--ros2-control writes a package')
    parser.add_argument(
        '--ros2-control',
        type=Path,
        metavar='FOLDER',
        help='write a package with a transmission of ros2_control; the name of the folder is that '
        'of the package',
    )
    parser.add_argument(
        '--driven-by',
        action='append',
        default=[],
        metavar='JOINT',
        help='what is given instead of an input: a joint, a coordinate P.x, a distance A-B of two '
        'points, the angle LINK.angle of a link; in a transmission it is commanded; may be '
        'repeated: as many as inputs',
    )
    parser.add_argument(
        '--branch',
        type=bounded_number(1, 1000, int),
        metavar='N',
        help='with --driven-by and one input, the branch of the crank, as in linkage check '
        '--branches',
    )
    parser.add_argument(
        '--derivatives', type=int, choices=(0, 1, 2), default=2,
        help='0: positions; 1: rates too; 2: accelerations too (default)',
    )  # fmt: skip
    parser.add_argument(
        '--joints',
        metavar='NAMES',
        help='only these joints, or coordinates and so on, with commas between them',
    )
    parser.add_argument(
        '--arrays',
        action='store_true',
        help='OUTPUT.py for arrays of NumPy, PyTorch, JAX or CuPy: many states at once, gradients',
    )
    parser.add_argument(
        '--name', help="prefix of the names in C (default: the linkage file's name)"
    )


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """Write the source."""
    file = named_file(arguments.file, 'linkages')
    content = linkage_content(file, robot_of(arguments))
    closure: Any = read_any_closure(content)
    if arguments.branch is not None and not arguments.driven_by:
        raise LinkageError('--branch', 'is for --driven-by', 'name the joint, or leave it out')
    try:
        if arguments.ros2_control is not None:
            return _write_transmission(arguments, closure, file)
        return _write_source(arguments, closure, file)
    except DefinitionError as error:
        raise content.error(error.where, error.reason, error.remedy) from None


def _write_source(arguments: argparse.Namespace, closure: Any, file: Path) -> int:
    output: Path | None = arguments.output
    if output is None:
        raise LinkageError('-o', 'names no file', 'write -o NAME.h, or --ros2-control FOLDER')
    if arguments.arrays and output.suffix.lower() != '.py':
        raise LinkageError('--arrays', f'{output.name} is not a Python module', 'name it x.py')
    language = LANGUAGES[output.suffix.lower()]
    in_c = output.suffix.lower() in ('.c', '.h')
    if arguments.driven_by:
        closure = closure.driven_by(*arguments.driven_by, branch=arguments.branch)
    closure, joints = _requested_joints(closure, arguments.joints)
    subject = Subject(
        closure,
        _source_name(file, arguments.name) if in_c else file.stem,
        file.name,
        arguments.derivatives,
        joints,
    )
    text = write_arrays(subject) if arguments.arrays else write_source(subject, language(subject))
    atomic_write(output, text.encode())
    print(output)
    return 0


def _write_transmission(arguments: argparse.Namespace, closure: Any, file: Path) -> int:
    folder: Path = arguments.ros2_control
    for option, is_set in (('-o', arguments.output), ('--arrays', arguments.arrays)):
        if is_set:
            remedy = f'leave out {option} or --ros2-control'
            raise LinkageError(option, 'is for one source', remedy)
    name = folder.resolve().name
    if not _PACKAGE.fullmatch(name):
        raise LinkageError(
            folder, f'{quote(name)} is not a name of a ROS package',
            'use lower-case letters, digits and _, as in gripper_transmission',
        )  # fmt: skip
    if os.path.lexists(folder) and not (arguments.force and folder.is_dir()):
        raise LinkageError(
            folder, 'exists already', 'name another, or add --force to write into it'
        )
    commanded = commanded_joints(closure, arguments.driven_by)
    inverse = closure.driven_by(*commanded, branch=arguments.branch)
    closure, joints = _requested_joints(closure, arguments.joints)
    closure = closure.measuring(*commanded)
    joints = tuple(dict.fromkeys((*commanded, *joints)))
    write_folder(folder, write_package(closure, inverse, name, file.name, joints))
    print(folder)
    return 0


def _source_name(file: Path, typed: str | None) -> str:
    """Return an identifier: the typed one, or one made from the file's name."""
    name = c_name(file.stem) if typed is None else typed
    if not C_NAME.fullmatch(name):
        where, wrong = (str(file), file.stem) if typed is None else ('--name', typed)
        raise LinkageError(
            where, f'{quote(wrong)} cannot be a name in C', 'write one, as --name four_bar'
        )
    return name


def _requested_joints(closure: Any, typed: str | None) -> tuple[Any, tuple[str, ...]]:
    """Return the closure with the requested joints, and these joints, each once."""
    if typed is None:
        return closure, closure.joint_names
    names = tuple(dict.fromkeys(name.strip() for name in typed.split(',')))
    for name in names:
        if name in closure.input_names:
            raise LinkageError(
                '--joints', f'{quote(name)} is an input, which is given',
                f'name some of {list_names(closure.joint_names)}',
            )  # fmt: skip
    try:
        return closure.measuring(*names), names
    except DefinitionError as error:
        raise LinkageError('--joints', f'{error.where}: {error.reason}', error.remedy) from None
