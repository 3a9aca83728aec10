# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Solve a linkage at some inputs, over its range, or for a value of a dependent joint.

Angles are in (-π, π] rad. They are typed, and shown in the table, in degrees unless --radians is
given. Slides are typed and shown in the unit of lengths of the linkage file. A table in a file has
the units of the linkage file; JSON has SI units.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
import sys
from threading import Event
from typing import Any, NamedTuple

from linkage_ros.cli.arguments import (
    add_at,
    add_file,
    add_radians,
    add_robot,
    bounded_number,
    DisplayUnits,
    read_input,
    read_inputs,
    read_joint_value,
    robot_of,
)
from linkage_ros.cli.result import add_result, Result, show_result
from linkage_ros.cli.table import Column, Table
from linkage_ros.cli.terminal import show_progress
from linkage_ros.description import linkage_content, read_any_closure
from linkage_ros.errors import did_you_mean, LinkageError, list_names
from linkage_ros.kinematics import (
    Closure,
    InputSweep,
    PlanarClosure,
    Position,
    search_inputs,
    Status,
    turn_to_pose,
    usual_inputs,
    wrap_angle,
)
from linkage_ros.resources import named_file

_STEPS = 36
_MOST = 1e300
_DIGITS = 6
_TOLD = 1000
"""States between two reports of the progress."""

_ORDERS = ('', ' rate', ' acceleration')
_PER = ('', '/s', '/s²')

EXAMPLE = 'linkage solve four_bar --at 40 --at 90'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_file(parser)
    add_robot(parser)
    add_at(parser, 'an input to solve for; may be repeated')
    parser.add_argument(
        '--joint',
        action='append',
        type=partial(read_joint_value, example='NAME=40'),
        default=[],
        metavar='NAME=VALUE',
        help='solve for every input at which a joint, a coordinate P.x, a distance A-B of two '
        'points or the angle LINK.angle of a link has a value; --rate and --acceleration are then '
        'for it; may be repeated: with several inputs name as many as inputs, which become the '
        'inputs',
    )
    parser.add_argument(
        '--sweep', action='store_true', help='solve over the range; the default without --at'
    )
    parser.add_argument(
        '--over',
        metavar='INPUT',
        help='input of a sweep, of several; the others are held as in the last --at, else as they '
        'are drawn',
    )
    parser.add_argument(
        '--from',
        dest='first',
        type=bounded_number(-_MOST, _MOST),
        metavar='VALUE',
        help='first input of a sweep',
    )
    parser.add_argument(
        '--to',
        dest='last',
        type=bounded_number(-_MOST, _MOST),
        metavar='VALUE',
        help='last input of a sweep',
    )
    parser.add_argument(
        '--steps',
        type=bounded_number(1, 1_000_000, int),
        default=_STEPS,
        metavar='N',
        help=f'steps of a sweep (default: {_STEPS})',
    )
    add_radians(parser, 'type angles, and show them in the table,')
    parser.add_argument(
        '--rate',
        nargs='+',
        type=read_input,
        metavar='VALUE',
        help='rate of the input, per second: adds rates',
    )
    parser.add_argument(
        '--acceleration', nargs='+', type=read_input, metavar='VALUE',
        help='acceleration of the input, per second squared: adds rates and accelerations',
    )  # fmt: skip
    parser.add_argument(
        '--points', action='store_true', help='add the traced points, in the frame of the ground'
    )
    parser.add_argument(
        '--jacobian',
        action='store_true',
        help='add the derivative of each joint by each input, in SI; its transpose turns efforts '
        'of the joints into those of the inputs (without masses)',
    )
    add_result(parser)


def run(arguments: argparse.Namespace, _stop: Event) -> int:
    """Solve the linkage."""
    file = named_file(arguments.file, 'linkages')
    content = linkage_content(file, robot_of(arguments))
    closure = read_any_closure(content, file.stem)
    arguments.angles = arguments.angles.of_file(content.units)
    if arguments.joint:
        _check_alone(arguments)
        if len(closure.input_names) == 1:
            columns, rows = _inverse_table(closure, arguments)
        else:
            columns, rows = _exchanged_table(closure, arguments)
    else:
        columns, rows = _forward_table(closure, arguments)
    account = {
        'units': {column.key: column.unit for column in columns if column.unit},
        'states': [
            {column.key: value for column, value in zip(columns, row, strict=True)} for row in rows
        ],
    }
    show_result(Result(account, [Table('', columns, rows, 'states')]), arguments, arguments.angles)
    return 0


def _forward_table(
    closure: Closure, arguments: argparse.Namespace
) -> tuple[list[Column], list[list[Any]]]:
    question = _read_question(closure, arguments)
    rows = []
    with show_progress('states solved') as advance:
        for index, inputs in enumerate(question.inputs):
            if index % _TOLD == 0:
                advance(index, len(question.inputs))
            rows.append(_state_row(closure, question, inputs))
    _show_reach(closure, question.inputs[: len(arguments.at)], arguments.angles)
    return list(_output_columns(closure, question)), rows


def _is_swept(arguments: argparse.Namespace) -> bool:
    ends = arguments.over, arguments.first, arguments.last
    return arguments.sweep or any(end is not None for end in ends)


def _swept_input(closure: Closure, named: str | None) -> int:
    """Return the number of the input of a sweep."""
    names = closure.input_names
    if named is None:
        if len(names) > 1:
            reason = f'there are {len(names)} inputs'
            remedy = f'name one, as --over {names[0]}, or each state with --at'
            raise LinkageError('--sweep', reason, remedy)
        return 0
    if named not in names:
        remedy = did_you_mean(named, names, f'name {list_names(names)}')
        raise LinkageError(f'--over {named}', 'is not an input', remedy)
    return names.index(named)


def _check_alone(arguments: argparse.Namespace) -> None:
    """Refuse other options that say which states to solve, besides ``--joint``."""
    swept = _is_swept(arguments)
    for option, is_set in (('--at', arguments.at), ('--sweep', swept)):
        if is_set:
            where = f'--joint {arguments.joint[0][0]}'
            raise LinkageError(where, f'{option} is given too', 'leave one of them out')


def _exchanged_table(
    closure: Closure, arguments: argparse.Namespace
) -> tuple[list[Column], list[list[Any]]]:
    """Return a row for every state that is found in which the joints have the typed values."""
    names = [name for name, _ in arguments.joint]
    count = len(closure.input_names)
    if len(names) != count or len({*names}) != count:
        reason = f'{len(names)} for {count} inputs'
        raise LinkageError(', '.join(names), reason, f'name {count} different joints')
    closure = closure.measuring(*names)
    joints = closure.linkage.joints
    values = {
        name: arguments.angles.to_si(typed, joints[name].unit) for name, typed in arguments.joint
    }
    searched = search_inputs(closure, values)
    within = [
        inputs
        for inputs in searched.inputs
        if closure.position(*inputs).status is not Status.LIMITED
    ]
    option = ' '.join(f'--joint {name}={typed:g}' for name, typed in arguments.joint)
    if searched.inputs and not within:
        raise _beyond_error(option, closure, searched.inputs)
    if not within:
        reach = []
        for name, ends in searched.reach.items():
            turning = joints[name].unit == 'rad'
            low, high = (arguments.angles.value_text(end, turning) for end in ends)
            reach.append(f'{name} goes from {low} to {high}')
        reason = f'is not reached by a search from {searched.starts} states'
        raise LinkageError(option, reason, ', '.join(reach) or 'draw another pose')
    columns, rows = [], []
    for inputs in within:
        inverse = closure.driven_by(*names, near=inputs)
        found_inputs = turn_to_pose(inverse, [*values.values()])
        question = _read_question(inverse, arguments, [found_inputs])
        columns = list(_output_columns(inverse, question))
        rows += [_state_row(inverse, question, found_inputs)]
    _note(f'{len(rows)} found by a search from {searched.starts} states; there may be others')
    return columns, rows


def _note(text: str) -> None:
    print(f'linkage solve: note: {text}', file=sys.stderr)


def _inverse_table(
    closure: Closure, arguments: argparse.Namespace
) -> tuple[list[Column], list[list[Any]]]:
    """Return a row for every input at which the joint has one of the typed values."""
    name = arguments.joint[0][0]
    columns, rows = [], []
    for joint, typed in arguments.joint:
        option = f'--joint {joint}={typed:g}'
        if joint != name:
            raise LinkageError(option, f'{name} is asked for too', 'ask for one joint at a time')
        if joint in closure.input_names:
            raise LinkageError(option, 'is an input', f'write --at {typed:g}')
        turning = closure.branches(joint)[0].turning
        value = arguments.angles.to_si(typed, 'rad' if turning else 'm')
        cranks = closure.cranks(joint, value)
        if not cranks:
            raise _unreached_error(closure, joint, value, option, arguments.angles)
        for number, _ in cranks:
            inverse = closure.driven_by(joint, branch=number)
            question = _read_question(inverse, arguments, [(value,)])
            (row,) = (_state_row(inverse, question, inputs) for inputs in question.inputs)
            columns = list(_output_columns(inverse, question))
            crank = inverse.position(value).joints[0]
            # The branch and its crank come first; the gap is 0.
            rows.append([number, crank, row[1], value, *row[4:]])
    if not isinstance(closure, PlanarClosure):
        _note(f'cranks are those that a search over {closure.input_names[0]} finds')
    own, status, _, crank_column, *others = columns
    columns = [Column('branch', 'branch'), crank_column, status, own, *others]
    if own in others:  # A point's coordinate, of which --points shows all.
        del columns[3]
        for row in rows:
            del row[3]
    return columns, rows


def _unreached_error(
    closure: Closure, joint: str, value: float, option: str, angles: DisplayUnits
) -> LinkageError:
    """Return the error for a value of a joint that no input within the limits reaches."""
    free = closure.branches(joint, limited=False)
    cranks = [branch.find_crank(value)[0] for branch in free if not branch.distance_beyond(value)]
    if cranks:
        return _beyond_error(option, closure, [(crank,) for crank in cranks])
    within = closure.branches(joint)
    ends = min(branch.low for branch in within), max(branch.high for branch in within)
    low, high = (angles.value_text(end, free[0].turning) for end in ends)
    return LinkageError(option, 'is not reached', f'{joint} goes from {low} to {high}')


def _beyond_error(
    option: str, closure: Closure, states: Iterable[tuple[float, ...]]
) -> LinkageError:
    """Return the error for joints whose values are reached at inputs beyond limits only."""
    beyond = dict.fromkeys(closure.limit_exceeded(closure.position(*inputs)) for inputs in states)
    reason = f'is reached only beyond limits: {" or ".join(beyond)}'
    return LinkageError(option, reason, 'ask for another value, or widen the limits')


def _show_reach(
    closure: Closure, typed: Sequence[tuple[float, ...]], angles: DisplayUnits
) -> None:
    """Say once where the linkage closes, if it does not at an input that was typed."""
    for inputs in typed:
        reach = '' if closure.position(*inputs).joints else _reach_text(closure, inputs, angles)
        if reach:
            _note(reach)
            return


def _reach_text(closure: Closure, inputs: tuple[float, ...], angles: DisplayUnits) -> str:
    """Return where a linkage closes by its first input; '' if nowhere."""
    ends = [
        [angles.value_text(end, interval.turning) for end in (interval.lowest, interval.highest)]
        for interval in InputSweep(closure, inputs).ranges
    ]
    text = ' and '.join(f'from {low} to {high}' for low, high in ends)
    return f'{closure.linkage.inputs[0].joint} closes {text}' if ends else ''


class Question(NamedTuple):
    """The requested computation."""

    inputs: list[tuple[float, ...]]  # The values of the inputs to solve for, in [rad] and [m]
    # Of the inputs; empty if not requested.
    rates: tuple[float, ...] | None
    accelerations: tuple[float, ...] | None
    points: tuple[str, ...]  # The traced points
    jacobian: bool


def _read_question(
    closure: Closure,
    arguments: argparse.Namespace,
    asked: Sequence[tuple[float, ...]] = (),
) -> Question:
    linkage = closure.linkage

    def read_typed(typed: Sequence[float] | None, option: str) -> tuple[float, ...] | None:
        if typed is None:
            return None
        return read_inputs(linkage, typed, option, arguments.angles)

    asked = [
        *asked,
        *(read_inputs(linkage, at, '--at', arguments.angles) for at in arguments.at),
    ]
    if _is_swept(arguments) or not asked:
        held = asked[-1] if asked else usual_inputs(closure)
        asked += _sweep_inputs(
            InputSweep(closure, held, _swept_input(closure, arguments.over)),
            arguments.first,
            arguments.last,
            arguments.steps,
            arguments.angles,
        )
    acceleration = read_typed(arguments.acceleration, '--acceleration')
    rate = read_typed(arguments.rate, '--rate')
    if rate is None and acceleration is not None:
        rate = (0.0,) * len(linkage.inputs)
    if arguments.points and not linkage.traced:
        raise LinkageError(
            '--points', 'the linkage traces none', 'name them in the file: traced: [P]'
        )
    points = linkage.traced if arguments.points else ()
    return Question(asked, rate, acceleration, points, arguments.jacobian)


def _sweep_inputs(
    input_sweep: InputSweep,
    first: float | None,
    last: float | None,
    steps: int,
    units: DisplayUnits,
) -> Iterator[tuple[float, ...]]:
    """
    Yield inputs from end to end at equal steps; without ends, over every range.

    The ends of a range are solved with all their digits: by way of degrees they are rounded, and
    the rounded end may miss a toggle.
    """
    ranges = list(input_sweep.ranges)
    if first is not None or last is not None:
        reached = input_sweep.widest_range
        ranges = [reached] if reached else []
    if not ranges:
        reason = 'closes nowhere while the other inputs are held'
        raise LinkageError(input_sweep.input.joint, reason, 'hold them elsewhere, by --at')
    unit = 'rad' if input_sweep.turning else 'm'
    for interval in ranges:
        low = units.convert(interval.lowest, unit) if first is None else first
        high = units.convert(interval.highest, unit) if last is None else last
        for i in range(steps + 1):
            value = units.to_si(low + (high - low) * i / steps if i < steps else high, unit)
            if i == 0 and first is None:
                value = interval.lowest
            elif i == steps and last is None:
                value = interval.highest
            yield input_sweep.inputs_at(value)


def _output_columns(closure: Closure, question: Question) -> Iterator[Column]:
    linkage = closure.linkage
    for driven in linkage.inputs:
        yield _state_column(driven.joint, driven.unit)
    yield Column('status', 'status')
    yield Column('>gap', 'gap', 'm', '.3g')
    for order in _derivative_orders(question):
        for name, turning in zip(linkage.joints, closure.turning, strict=True):
            unit = 'rad' if turning else 'm'
            yield _state_column(f'{name}{_ORDERS[order]}', f'{unit}{_PER[order]}')
        for point in question.points:
            for axis in closure.linkage.axes:
                yield _state_column(f'{point}.{axis}{_ORDERS[order]}', f'm{_PER[order]}')

    if question.jacobian:
        for name, joint in linkage.joints.items():
            for driven in linkage.inputs:
                unit = '' if joint.unit == driven.unit else f'{joint.unit}/{driven.unit}'
                slope = f'{name} by {driven.joint}'
                yield Column(f'>{slope}', slope, unit, _slope_text)


def _slope_text(slope: float | None, _units: DisplayUnits) -> str:
    return '' if slope is None else f'{slope:.{_DIGITS}f}'


def _state_column(name: str, unit: str) -> Column:
    return Column(f'>{name}', name, unit, f'.{_DIGITS}f')


def _derivative_orders(question: Question) -> range:
    return range(1 + (question.rates is not None) + (question.accelerations is not None))


def _state_row(closure: Closure, question: Question, inputs: tuple[float, ...]) -> list[Any]:
    """Return the cells of a state; empty cells where there is no value."""
    row: list[Any] = [*inputs]
    position = closure.position(*inputs)
    row += [position.status.value, position.gap]
    count = len(closure.turning) + len(closure.linkage.axes) * len(question.points)
    slopes = len(closure.turning) * len(inputs) if question.jacobian else 0
    if not position.joints:
        return row + [None] * (count * len(_derivative_orders(question)) + slopes)
    row += [
        wrap_angle(value) if turning else value
        for value, turning in zip(position.joints, closure.turning, strict=True)
    ]
    points = closure.named_points(position) if question.points else {}
    for point in question.points:
        row += _coordinates(points[point])
    if not position.status.has_rates:
        return row + [None] * (count * (len(_derivative_orders(question)) - 1) + slopes)
    if question.rates is not None:
        row += _rate_cells(closure, question, position)
    if question.jacobian:
        row += closure.jacobian(position).ravel().tolist()
    return row


def _rate_cells(closure: Closure, question: Question, position: Position) -> Iterator[float]:
    """Yield rates and accelerations, as far as asked for."""
    assert question.rates is not None
    velocity = closure.velocity(position, *question.rates)
    # Rates of points come together with accelerations; unknown accelerations count as 0.
    changes = question.accelerations or (0.0,) * len(question.rates)
    acceleration = closure.acceleration(position, velocity, *changes)
    motion: Mapping[str, Any] = {}
    if question.points:
        motion = closure.named_motion(position, velocity, acceleration)
    rates = (velocity.joints, acceleration.joints)[: len(_derivative_orders(question)) - 1]
    for order, joints in enumerate(rates, start=1):
        yield from joints
        for point in question.points:
            yield from _coordinates(motion[point][order])


def _coordinates(place: complex | tuple[float, ...]) -> tuple[float, ...]:
    return (place.real, place.imag) if isinstance(place, complex) else place
