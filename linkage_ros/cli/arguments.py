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

"""What the commands that look at one linkage share: values of its inputs, typed and told."""

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
    """Read numbers with commas between them."""
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
    Return what was typed for the inputs, in [rad] and [m].

    Raises
    ------
    LinkageError
        Where there are more or fewer values than inputs.

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
    """Return an angle less its whole turns, in (−π, π] rad."""
    rest = remainder(angle, tau)
    return pi if rest <= -pi else rest


def fixed(value: float, digits: int) -> str:
    """Return a number with decimals, and without a minus before a zero."""
    written = f'{value:.{digits}f}'
    return written.lstrip('-') if float(written) == 0.0 else written


def angle_text(angle: float, digits: int = 3) -> str:
    """Return an angle in degrees."""
    return f'{fixed(degrees(angle), digits)}°'


def value_text(value: float, turning: bool) -> str:
    """Return the value of an input as it is read: degrees and radians, or metres."""
    if turning:
        return f'{angle_text(value)} ({value + 0.0:.6g} rad)'
    return f'{value + 0.0:.6g} m'


# What the commands that write robot models share: a linkage or scene file, and where it goes.


def add_files(parser: argparse.ArgumentParser, kind: str) -> None:
    """Declare the file that is read, and ``-o``."""
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

    The linkages of a scene are as the node would solve them, deviations of their parts included.
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
