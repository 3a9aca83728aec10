# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Arguments that several commands share: outputs, keys of a scene, numbers, units of angles."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from math import degrees, isfinite, nan, radians
from pathlib import Path
import re
from typing import Any, NamedTuple

from linkage_ros.description import (
    check_kind,
    check_new,
    check_output_name,
    TABLE_KINDS,
    Units,
)
from linkage_ros.errors import decimal_comma, FileError, LinkageError, list_names, quote
from linkage_ros.kinematics import Linkage

PICTURES = ('.png', '.svg', '.pdf')
"""Suffixes of the pictures that matplotlib writes."""

RESULTS = (*TABLE_KINDS, '.json', '.txt')
"""Suffixes of the files that a result is written to."""

LINKAGES = ('.yaml', '.yml')
"""Suffixes of linkage and scene files."""

SCENE_HELP = 'scene file or linkage file, or a name of linkage gallery'

_WRITTEN = ('output', 'draw')
"""Arguments that name a file to write."""

_ALL_DIGITS = 1e15
"""From here on a double has no decimals."""

_IN_DEGREES = re.compile(r'([-+]?(?:nan|inf|\d[\d.]*(?:e[-+]?\d+)?))°')


def add_file(parser: argparse.ArgumentParser) -> None:
    """Declare the linkage file."""
    parser.add_argument('file', metavar='FILE', help='linkage file, or a name of linkage gallery')


def add_robot(parser: argparse.ArgumentParser) -> None:
    """Declare what may be told of a robot, if the linkage file is a URDF; see `robot_of`."""
    robot = parser.add_argument_group(
        'of a robot', 'FILE is a URDF, SDF or MJCF; more in docs/how_to/loops.md'
    )
    close = 'links whose origins meet, or places LINK.x,y,z in metres: by a ball, :hinge or :fixed'
    start = 'value of a joint, if not 0, at which the loops close, in radians or metres'
    for option, name, kind, text in (
        ('--input', 'JOINT', str, 'joint that is driven; may be repeated, as the next two'),
        ('--close', 'FRAME=FRAME', str, close),
        ('--start', 'JOINT=VALUE', read_joint_value, start),
    ):
        settings: dict[str, Any] = {'type': kind, 'default': [], 'metavar': name, 'help': text}
        robot.add_argument(option, action='append', **settings)
    near = 'take a pose near it in which the loops close'
    robot.add_argument('--near', action='store_true', help=near)


def robot_of(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return what is told of a robot, by the keys of a scene."""
    told = {'input': arguments.input, 'close': arguments.close, 'at': dict(arguments.start)}
    told['near'] = arguments.near
    return {key: value for key, value in told.items() if value}


def read_joint_value(text: str, example: str = 'JOINT=0.5') -> tuple[str, float]:
    """Read JOINT=VALUE, a finite number in the unit of the option."""
    joint, _, value = text.rpartition('=')
    try:
        number = float(value)
    except ValueError:
        number = nan
    if not (joint and isfinite(number)):
        raise argparse.ArgumentTypeError(f'{text!r} is not a joint with a value; write {example}')
    return joint, number


def add_bag(parser: argparse.ArgumentParser) -> None:
    """Declare the bag."""
    parser.add_argument('bag', type=Path, metavar='BAG', help="the bag's folder or its .mcap file")


def add_output(
    parser: argparse._ActionsContainer, suffixes: Collection[str], otherwise: str = ''
) -> None:
    """
    Declare ``-o`` for a file with one of the suffixes, and ``--force``: see `refuse_existing`.

    ``otherwise`` says what happens without ``-o``; '' if it is required.
    """
    kinds = list_names([f'OUTPUT{suffix}' for suffix in suffixes], ' or ')
    parser.add_argument(
        '-o',
        '--output',
        type=output_path(suffixes),
        metavar='OUTPUT',
        required=not otherwise,
        help=f'file to write, {kinds}{otherwise and f"; without it {otherwise}"}',
    )
    add_force(parser)


def add_force(parser: argparse._ActionsContainer) -> None:
    """Declare ``--force``."""
    parser.add_argument(
        '--force',
        action='store_true',
        help='overwrite an existing file or bag, which is refused otherwise',
    )


def refuse_existing(arguments: argparse.Namespace) -> None:
    """Raise if what the user names to write exists, without ``--force``, or cannot be written."""
    for name in _WRITTEN:
        path = getattr(arguments, name, None)
        if isinstance(path, Path):
            check_new(path, force=getattr(arguments, 'force', False))
            if path.suffix.lower() in TABLE_KINDS:
                check_kind(path)
            for option in ('json', 'csv') if path.suffix.lower() in RESULTS else ():
                if getattr(arguments, option, False):
                    remedy = 'leave it out: the suffix of the file selects its format'
                    raise LinkageError(f'--{option}', 'is for a printed result', remedy)
            bag = getattr(arguments, 'bag', None)
            if bag is not None and bag.resolve().is_relative_to(path.resolve()):
                raise LinkageError(path, 'is the bag that is read', 'name another with -o')
            if path.is_file() and any(map(path.samefile, _read_files(arguments))):
                raise LinkageError(path, 'is a file that is read', 'name another with -o')


def _read_files(arguments: argparse.Namespace) -> Iterator[Path]:
    """Yield the files that arguments name to read, and those that scenes among them name."""
    from linkage_ros.description import files_of_scene  # local import: bags are not always there

    for name, value in vars(arguments).items():
        if name in _WRITTEN or not isinstance(value, (str, Path)):
            continue
        with suppress(OSError, ValueError):  # a text that is not the name of a file
            if Path(value).is_file():
                yield Path(value)
                yield from filter(Path.is_file, files_of_scene(Path(value)))


def output_or(arguments: argparse.Namespace, default: Path) -> Path:
    """Return the file to write: ``-o``, or a default, which must be new without ``--force``."""
    if arguments.output is not None:
        return Path(arguments.output)
    check_new(default, force=arguments.force)
    return default


def output_path(suffixes: Collection[str]) -> Callable[[str], Path]:
    """Return a reader of the name of a file to write, which refuses other suffixes."""

    def read_path(text: str) -> Path:
        file = Path(text)
        check_output_name(file, suffixes)
        return file

    return read_path


def add_set(parser: argparse.ArgumentParser) -> None:
    """Declare ``--set``, for `load_scene`."""
    parser.add_argument(
        '--set',
        action='append',
        default=[],
        metavar='KEY=VALUE',
        help='set a key of the scene, as --set rate=500 or --set drive.sine.amplitude=0.3, or '
        'of one of its linkages, as --set linkages.left.prefix=left_; VALUE is YAML; quote a '
        'part with a dot that the scene does not have yet, as '
        '--set \'loads.forces."coupler.P"={direction: [1, 0], constant: 5}\'; may be repeated',
    )


def add_ros_arguments(parser: argparse.ArgumentParser, what: str) -> None:
    """Declare ``--ros-args``, after which all words are for ROS; say what they are."""
    parser.add_argument('--ros-args', nargs=argparse.REMAINDER, default=[], help=what)


def check_no_settings(settings: Sequence[str]) -> None:
    """Raise if keys are set and no scene is named."""
    if settings:
        raise LinkageError(f'--set {settings[0]}', 'is for a scene', 'name one')


def add_at(parser: argparse.ArgumentParser, text: str) -> None:
    """Declare ``--at``."""
    parser.add_argument(
        '--at',
        action='append',
        nargs='+',
        type=read_input,
        default=[],
        metavar='VALUE',
        help=f'{text}; of several inputs, in their order: --at 10 -5',
    )


def read_input(text: str) -> float:
    """Read the value of one input; the next word is that of the next."""
    try:
        number = float(text)
    except ValueError:
        number = nan
    if not isfinite(number):
        remedy = 'write 40, or 10 -5 for two inputs; FILE comes before the option'
        more = decimal_comma(text)
        raise argparse.ArgumentTypeError(f'{quote(text)} is not a number; {remedy}{more}')
    return number


def bounded_number(least: float, most: float, kind: type[float] = float) -> Callable[[str], Any]:
    """Return a reader of a number within bounds, which is an integer if its kind is `int`."""

    def read_number(text: str) -> float:
        value = kind(text)
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f'{text} is not between {least:g} and {most:g}')
        return value

    # argparse shows this name: "invalid number value".
    read_number.__name__ = 'whole number' if kind is int else 'number'
    return read_number


def read_inputs(
    linkage: Linkage, typed: Sequence[float], option: str, units: DisplayUnits
) -> tuple[float, ...]:
    """
    Return the typed values of the inputs, in [rad] and [m].

    A LinkageError is raised if there are more or fewer values than inputs.
    """
    inputs = linkage.inputs
    if len(typed) != len(inputs):
        raise LinkageError(
            f'{option} {" ".join(f"{value:g}" for value in typed)}',
            f'{len(typed)} value(s) for {len(inputs)} input(s)',
            f'write {option} {" ".join(driven.joint.upper() for driven in inputs)}',
        )
    return tuple(
        units.to_si(value, driven.unit) for value, driven in zip(typed, inputs, strict=True)
    )


def finite_or_none(value: float) -> float | None:
    """Return a number as JSON holds it: None stands for infinity and for NaN."""
    return value if isfinite(value) else None


def fixed_text(value: float, digits: int) -> str:
    """Return a number with fixed decimals, a large one with an exponent; never a negative zero."""
    written = f'{value:.{digits}f}' if abs(value) < _ALL_DIGITS else f'{value:.15g}'
    return written.lstrip('-') if float(written) == 0.0 else written


class DisplayUnits(NamedTuple):
    """The units that a person types and reads: of angles ``°`` or ``rad``, and of lengths."""

    angle: str
    file: Units = Units()  # Those of the linkage file

    @property
    def in_degrees(self) -> bool:
        """Return whether angles are in degrees."""
        return self.angle == '°'

    @property
    def length(self) -> str:
        """Return the unit of lengths."""
        return self.file.length

    def of_file(self, file: Units) -> DisplayUnits:
        """Return these units with the lengths of a linkage file."""
        return self._replace(file=file)

    def name_unit(self, unit: str) -> str:
        """Return the name of a unit of SI here: ``°/s`` for ``rad/s``."""
        return self.file.file_unit(unit).replace('deg', 'rad').replace('rad', self.angle)

    def convert(self, value: float, unit: str = 'rad') -> float:
        """Return a value in SI in the unit that is shown."""
        if unit.startswith('rad'):
            return degrees(value) if self.in_degrees else value
        return self.file.to_file_unit(value, unit)

    def to_si(self, typed: float, unit: str) -> float:
        """Return a typed value, or its rate, in SI."""
        if unit.startswith('rad'):
            return self.to_radians(typed)
        return self.file.to_si(typed, unit)

    def to_radians(self, typed: float) -> float:
        """Return a typed angle in [rad]."""
        return radians(typed) if self.in_degrees else typed

    def convert_error(self, error: LinkageError) -> LinkageError:
        """
        Return an error about a linkage whose quantities, such as ``0.2 m``, are in these units.

        An error about a key of a file, a `FileError`, names them in the units of that file.
        """
        if isinstance(error, FileError):
            return error
        shown = Units(self.length, 'degrees' if self.in_degrees else 'radians')
        parts = (error.where, error.reason, error.remedy)
        return LinkageError(
            *(shown.convert_quantities(part).replace(' deg', '°') for part in parts)
        )

    def convert_text(self, text: str) -> str:
        """Return a text whose angles, such as ``-1.5°``, are in this unit."""
        if self.in_degrees:
            return text
        return _IN_DEGREES.sub(lambda match: f'{radians(float(match[1])):.6g} rad', text)

    def format_angle(self, angle: float, digits: int = 3) -> str:
        """Return an angle in [rad] as text; ``digits`` are the decimals of degrees."""
        return angle_text(angle, digits) if self.in_degrees else f'{angle + 0.0:.6g} rad'

    def format_length(self, value: float, form: str = '.6g') -> str:
        """Return a length in [m] as text with its unit."""
        return f'{self.convert(value, "m") + 0.0:{form}} {self.length}'

    def value_text(self, value: float, turning: bool) -> str:
        """Return the value of an input or a joint, in [rad] if it turns, else in [m]."""
        return self.format_angle(value) if turning else self.format_length(value)


DEGREES: DisplayUnits = DisplayUnits('°')
RADIANS: DisplayUnits = DisplayUnits('rad')


def add_radians(parser: argparse.ArgumentParser, what: str = 'show angles') -> None:
    """Declare ``--radians``; the attribute ``angles`` is then a `DisplayUnits`."""
    parser.add_argument(
        '--radians',
        dest='angles',
        action='store_const',
        const=RADIANS,
        default=DEGREES,
        help=f'{what} in radians instead of degrees',
    )


def angle_text(angle: float, digits: int = 3) -> str:
    """Return an angle in degrees."""
    return f'{fixed_text(degrees(angle), digits)}°'
