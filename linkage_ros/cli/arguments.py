# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Arguments that several commands share: values of the inputs of a linkage, files, output."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from math import degrees, isfinite, pi, radians, remainder, tau
from pathlib import Path
import sys

from linkage_ros.errors import LinkageError
from linkage_ros.files.atomic_write import atomic_write
from linkage_ros.files.linkage_file import read_closure
from linkage_ros.files.yaml_file import read_yaml
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.robot_models.part import Part, PartError
from linkage_ros.scene.load import kind_of
from linkage_ros.scene.robot_model import scene_model, Write


def add_at(parser: argparse.ArgumentParser, text: str) -> None:
    """Declare ``--at``."""
    parser.add_argument(
        '--at',
        action='append',
        type=values,
        default=[],
        metavar='VALUE',
        help=f'{text}; several inputs with commas: --at 40,20; --at=-40,20 where it begins with a '
        'minus',
    )


def values(text: str) -> tuple[float, ...]:
    """Read numbers separated by commas."""
    try:
        numbers = tuple(float(part) for part in text.split(','))
    except ValueError:
        numbers = ()
    if not numbers or not all(map(isfinite, numbers)):
        raise argparse.ArgumentTypeError(f'{text!r} is no number; write 40, or 40,20')
    return numbers


def inputs(
    linkage: Linkage, typed: Sequence[float], option: str, *, in_degrees: bool = True
) -> tuple[float, ...]:
    """
    Return the typed values of the inputs, in [rad] and [m].

    Raises
    ------
    LinkageError
        If there are more or fewer values than inputs.

    """
    given = linkage.inputs
    if len(typed) != len(given):
        raise LinkageError(
            f'{option} {",".join(f"{value:g}" for value in typed)}',
            f'{len(typed)} value(s) for {len(given)} input(s)',
            f'write {option} {",".join(driven.joint.upper() for driven in given)}',
        )
    return tuple(
        radians(value) if in_degrees and not driven.slider else value
        for value, driven in zip(typed, given, strict=True)
    )


def wrapped(angle: float) -> float:
    """Return an angle without its full turns, in (−π, π] rad."""
    rest = remainder(angle, tau)
    return pi if rest <= -pi else rest


def fixed(value: float, digits: int) -> str:
    """Return a number with fixed decimals; never a negative zero."""
    written = f'{value:.{digits}f}'
    return written.lstrip('-') if float(written) == 0.0 else written


def angle_text(angle: float, digits: int = 3) -> str:
    """Return an angle in degrees."""
    return f'{fixed(degrees(angle), digits)}°'


def value_text(value: float, turning: bool) -> str:
    """Return the value of an input for a reader: degrees and radians, or metres."""
    if turning:
        return f'{angle_text(value)} ({value + 0.0:.6g} rad)'
    return f'{value + 0.0:.6g} m'


# Shared by the commands that write robot models: a linkage or scene file, and the output.


def add_files(parser: argparse.ArgumentParser, kind: str) -> None:
    """Declare the input file, and ``-o``."""
    parser.add_argument('file', help='the linkage file or the scene file')
    add_output(parser, kind)


def add_output(parser: argparse.ArgumentParser, kind: str) -> None:
    """Declare ``-o``."""
    parser.add_argument(
        '-o', '--output', type=Path, metavar='FILE', help=f'{kind} to write; else it is printed'
    )


def model_of(file: str, write: Write) -> bytes:
    """
    Return the model of a linkage or scene file.

    Linkages of a scene are those that the node would solve, with the deviations of their parts.
    """
    content, _ = read_yaml(file)
    if kind_of(content) == 'scene':
        from linkage_ros.pipeline.pipeline import Pipeline
        from linkage_ros.scene.load import load_scene

        scene = load_scene(file)
        return scene_model(scene, Pipeline(scene).closures, write)
    try:
        return write(Path(file).stem, [Part(read_closure(content))])
    except PartError as error:
        raise content.error(error.where, error.reason, error.remedy) from None


def put(data: bytes, output: Path | None) -> None:
    """Write a model to a file and say so, or print it."""
    if output is None:
        sys.stdout.write(data.decode())
    else:
        atomic_write(output, data)
        print(output)
