# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Write a linkage as source that stands alone: C, a C header, JavaScript or Python.

The source holds one function that solves the linkage as this package does: position for
--derivatives 0, velocity for 1, motion for 2. It returns a status, and the joints where there are
any; its head says what it takes and gives.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from threading import Event
from typing import Any

from linkage_ros.cli import add_file, add_output, add_robot, robot_of
from linkage_ros.description import atomic_write, linkage_content, read_any_closure
from linkage_ros.errors import DefinitionError, did_you_mean, LinkageError, quote
from linkage_ros.kinematics import Closure
from linkage_ros.resources import named_file
from linkage_ros.tools.models.source_code import C_NAME, c_name, LANGUAGES, Subject, write_source

EXAMPLE = 'linkage compile four_bar -o four_bar.c'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_file(parser)
    add_robot(parser)
    add_output(parser, LANGUAGES)
    parser.add_argument(
        '--derivatives', type=int, choices=(0, 1, 2), default=2,
        help='0: positions; 1: rates too; 2: accelerations too (default)',
    )  # fmt: skip
    parser.add_argument(
        '--joints', metavar='NAMES', help='only these joints, with commas between them'
    )
    parser.add_argument(
        '--name', help="prefix of the names in C (default: the linkage file's name)"
    )


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """Write the source."""
    output: Path = arguments.output
    language = LANGUAGES[output.suffix.lower()]
    file = named_file(arguments.file, 'linkages')
    content = linkage_content(file, robot_of(arguments))
    closure: Any = read_any_closure(content)
    in_c = output.suffix.lower() in ('.c', '.h')
    subject = Subject(
        closure,
        _source_name(file, arguments.name) if in_c else file.stem,
        file.name,
        arguments.derivatives,
        _requested_joints(closure, arguments.joints),
    )
    try:
        text = write_source(subject, language(subject))
    except DefinitionError as error:
        raise content.error(error.where, error.reason, error.remedy) from None
    atomic_write(output, text.encode())
    print(output)
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


def _requested_joints(closure: Closure, typed: str | None) -> tuple[str, ...]:
    """Return the requested joints, each once."""
    published = closure.linkage.joints
    if typed is None:
        return tuple(published)
    names = tuple(dict.fromkeys(name.strip() for name in typed.split(',')))
    for name in names:
        if name not in published:
            raise LinkageError(
                '--joints',
                f'{quote(name)} is not a published joint',
                did_you_mean(name, published, f'name some of {", ".join(published)}'),
            )
    return names
