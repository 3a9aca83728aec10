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


"""
Solve a linkage at some inputs or over its range.

Angles are in degrees and in (-180, 180], unless --radians is given; slides are in metres.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
import csv
import io
import json
from math import degrees, radians
from pathlib import Path
import sys
from threading import Event
from typing import Any, NamedTuple

from linkage_ros.cli.arguments import add_at, fixed, inputs, values, wrapped
from linkage_ros.cli.terminal import show, Table, text
from linkage_ros.errors import LinkageError
from linkage_ros.files.atomic_write import atomic_write
from linkage_ros.files.linkage_file import load
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.sweep_analysis import InputSweep

_STEPS = 36
_DIGITS = 6
_ORDERS = ('', ' rate', ' acceleration')
_PER = ('', '/s', '/s²')


class Column(NamedTuple):
    """
    A column of the result.

    Attributes
    ----------
    name
        Joint or coordinate, and its quantity.
    unit
        '' for a text.

    """

    name: str
    unit: str

    def __str__(self) -> str:
        return f'{self.name} [{self.unit}]' if self.unit else self.name


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument('file', help='the linkage file')
    add_at(parser, 'an input to solve for; may be repeated')
    parser.add_argument(
        '--sweep', action='store_true', help='solve over the range; the default where no --at is'
    )
    parser.add_argument('--from', dest='first', type=_number, help='where a sweep begins')
    parser.add_argument('--to', dest='last', type=_number, help='where a sweep ends')
    parser.add_argument(
        '--steps', type=_count, default=_STEPS, help=f'steps of a sweep (default: {_STEPS})'
    )
    unit = parser.add_mutually_exclusive_group()
    unit.add_argument(
        '--degrees', action='store_true', help='angles in degrees, typed and told; the default'
    )
    unit.add_argument('--radians', action='store_true', help='angles in radians, typed and told')
    parser.add_argument(
        '--rate', type=values, metavar='VALUE', help='rate of the input, per second: adds rates'
    )
    parser.add_argument(
        '--acceleration', type=values, metavar='VALUE',
        help='acceleration of the input, per second squared: adds rates and accelerations',
    )  # fmt: skip
    parser.add_argument(
        '--points', action='store_true', help='add the traced points, in the frame of the ground'
    )
    parser.add_argument(
        '--format', choices=('table', 'csv', 'json'), help='default: by the name of -o, else table'
    )
    parser.add_argument('-o', '--output', type=Path, help='file to write to')


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """Solve the linkage."""
    closure = load(arguments.file)
    question = _question(closure, arguments)
    columns = list(_columns(closure, question))
    rows = [_row(closure, question, state) for state in question.states]
    ending = arguments.output.suffix[1:].lower() if arguments.output else ''
    kind = arguments.format or (ending if ending in ('csv', 'json') else 'table')
    table = _table(columns, rows)
    if kind == 'table':
        if arguments.output is None:
            show(table)
            return 0
        answer = text(table) + '\n'
    elif kind == 'csv':
        answer = _csv(columns, rows)
    else:
        answer = _json(columns, rows)
    if arguments.output is None:
        sys.stdout.write(answer)
        return 0
    atomic_write(arguments.output, answer.encode())
    print(arguments.output)
    return 0


class State(NamedTuple):
    """Inputs as the user reads them, and in [rad] and [m]."""

    told: tuple[float, ...]
    inputs: tuple[float, ...]


class Question(NamedTuple):
    """
    The requested computation.

    Attributes
    ----------
    states
        The inputs to solve for.
    rates, accelerations
        Of the inputs; empty if not requested.
    degrees
        Whether angles are shown in degrees.
    points
        For each traced point, a link that carries it.

    """

    states: list[State]
    rates: tuple[float, ...] | None
    accelerations: tuple[float, ...] | None
    degrees: bool
    points: dict[str, str]


def _question(closure: Closure, arguments: argparse.Namespace) -> Question:
    linkage = closure.linkage
    in_degrees = not arguments.radians

    def read(typed: Sequence[float] | None, option: str) -> tuple[float, ...] | None:
        if typed is None:
            return None
        return inputs(linkage, typed, option, in_degrees=in_degrees)

    asked = [State(at, inputs(linkage, at, '--at', in_degrees=in_degrees)) for at in arguments.at]
    swept = arguments.sweep or arguments.first is not None or arguments.last is not None
    if swept or not asked:
        if len(linkage.inputs) > 1:
            raise LinkageError(
                '--sweep', f'there are {len(linkage.inputs)} inputs', 'name each state with --at'
            )
        in_turns = in_degrees and not linkage.inputs[0].slider
        asked += _sweep(
            InputSweep(closure),
            arguments.first,
            arguments.last,
            arguments.steps,
            in_degrees=in_turns,
        )
    acceleration = read(arguments.acceleration, '--acceleration')
    rate = read(arguments.rate, '--rate')
    if rate is None and acceleration is not None:
        rate = (0.0,) * len(linkage.inputs)
    carriers = {
        point: next(link for link, points in linkage.links.items() if point in points)
        for point in linkage.traced
    }
    if arguments.points and not carriers:
        raise LinkageError(
            '--points', 'the linkage traces none', 'name them in the file: traced: [P]'
        )
    return Question(asked, rate, acceleration, in_degrees, carriers if arguments.points else {})


def _sweep(
    way: InputSweep, first: float | None, last: float | None, steps: int, *, in_degrees: bool
) -> Iterator[State]:
    """
    Yield inputs from end to end at equal steps; without ends, over every range.

    The ends of a range are solved with all their digits: shown in degrees they are rounded, and
    the rounded end may miss a toggle.
    """
    ranges = list(way.ranges)
    if first is not None or last is not None:
        reached = way.widest_range
        assert reached is not None, 'reading the file has proved that it closes somewhere'
        ranges = [reached]
    told, read = (degrees, radians) if in_degrees else (float, float)
    for interval in ranges:
        low = told(interval.lowest) if first is None else first
        high = told(interval.highest) if last is None else last
        for i in range(steps + 1):
            shown = low + (high - low) * i / steps if i < steps else high
            value = read(shown)
            if i == 0 and first is None:
                value = interval.lowest
            elif i == steps and last is None:
                value = interval.highest
            yield State((shown,), (value,))


def _columns(closure: Closure, question: Question) -> Iterator[Column]:
    linkage = closure.linkage
    angle = '°' if question.degrees else 'rad'
    for given in linkage.inputs:
        yield Column(given.joint, 'm' if given.slider else angle)
    yield Column('status', '')
    yield Column('gap', 'm')
    for order in _orders(question):
        for name, turning in zip(linkage.joints, closure.turning, strict=True):
            unit = angle if turning else 'm'
            yield Column(f'{name}{_ORDERS[order]}', f'{unit}{_PER[order]}')
        for point in question.points:
            for axis in 'xy':
                yield Column(f'{point}.{axis}{_ORDERS[order]}', f'm{_PER[order]}')


def _orders(question: Question) -> range:
    return range(1 + (question.rates is not None) + (question.accelerations is not None))


def _row(closure: Closure, question: Question, state: State) -> list[Any]:
    """Return the cells of a state; empty cells where there is no value."""
    unit = degrees if question.degrees else float
    given = state.inputs
    row: list[Any] = [*state.told]
    position = closure.position(*given)
    row += [position.status.value, position.gap]
    count = len(closure.turning) + 2 * len(question.points)
    if not position.joints:
        return row + [None] * (count * len(_orders(question)))
    row += [
        unit(wrapped(value)) if turning else value
        for value, turning in zip(position.joints, closure.turning, strict=True)
    ]
    points = closure.points(position) if question.points else {}
    for point, link in question.points.items():
        row += _xy(points[link, point])
    if question.rates is None:
        return row
    if not position.status.has_rates:
        return row + [None] * (count * (len(_orders(question)) - 1))
    velocity = closure.velocity(position, *question.rates)
    # Rates of points come together with accelerations; unknown accelerations count as 0.
    changes = question.accelerations or (0.0,) * len(given)
    acceleration = closure.acceleration(position, velocity, *changes)
    motion = closure.point_motion(position, velocity, acceleration) if question.points else {}
    told = (velocity.joints, acceleration.joints)[: len(_orders(question)) - 1]
    for order, joints in enumerate(told, start=1):
        row += [
            unit(value) if turning else value
            for value, turning in zip(joints, closure.turning, strict=True)
        ]
        for point, link in question.points.items():
            row += _xy(motion[link, point][order])
    return row


def _xy(place: complex) -> tuple[float, float]:
    return place.real, place.imag


def _table(columns: Sequence[Column], rows: Sequence[Sequence[Any]]) -> Table:
    heads = [str(column) if not column.unit else f'>{column}' for column in columns]
    cells = [
        [
            value
            if isinstance(value, str)
            else ''
            if value is None
            else (f'{value:.3g}' if column.name == 'gap' else fixed(value, _DIGITS))
            for column, value in zip(columns, row, strict=True)
        ]
        for row in rows
    ]
    return Table('', heads, cells)


def _csv(columns: Sequence[Column], rows: Sequence[Sequence[Any]]) -> str:
    written = io.StringIO()
    writer = csv.writer(written, lineterminator='\n')
    writer.writerow(map(str, columns))
    writer.writerows(
        [repr(value) if isinstance(value, float) else value for value in row] for row in rows
    )
    return written.getvalue()


def _json(columns: Sequence[Column], rows: Sequence[Sequence[Any]]) -> str:
    answer = {
        'units': {column.name: column.unit for column in columns if column.unit},
        'states': [
            {column.name: value for column, value in zip(columns, row, strict=True)}
            for row in rows
        ],
    }
    return json.dumps(answer, indent=1, ensure_ascii=False, allow_nan=False) + '\n'


def _number(written: str) -> float:
    number = values(written)
    if len(number) > 1:
        raise argparse.ArgumentTypeError(f'{written} is no number')
    return number[0]


def _count(written: str) -> int:
    try:
        count = int(written)
    except ValueError:
        count = 0
    if not 1 <= count <= 1_000_000:
        raise argparse.ArgumentTypeError(f'{written} is no number of steps; write 1 to 1000000')
    return count
