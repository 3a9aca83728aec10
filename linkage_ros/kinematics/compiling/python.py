# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A path, or a function of numbers, as straight-line Python code."""

from __future__ import annotations

import cmath
from collections.abc import Callable, Sequence
import math
from typing import Any, NamedTuple

from linkage_ros.generated_code import define_function
from linkage_ros.kinematics.compiling.tape import Operation, Tape
from linkage_ros.kinematics.compiling.trace import number_of, Path
from linkage_ros.kinematics.compiling.writer import TextWriter
from linkage_ros.kinematics.doubles import HUGE

Values = tuple[tuple[float, ...], ...]

_FUNCTIONS: dict[str, Callable[..., Any]] = {
    'sin': math.sin,
    'cos': math.cos,
    'sqrt': math.sqrt,
    'atan2': math.atan2,
    'copysign': math.copysign,
    'remainder': math.remainder,
    'phase': cmath.phase,
    'rect': cmath.rect,
    'abs': abs,
    'complex': complex,
    # The root that abs() of a complex number gives; the last digits of math.hypot() differ.
    'hypot': lambda x, y: abs(complex(x, y)),
}
_ATTRIBUTES = frozenset(('real', 'imag'))


class PythonBody(NamedTuple):
    """A path as lines of Python."""

    lines: list[str]  # The lines; they use the inputs by their names in the path
    outputs: list[list[str]]  # The expressions of the outputs, in groups; they follow the lines
    bound: dict[str, Any]  # The names that the lines and expressions use, with their values


def python_source(path: Path) -> tuple[str, dict[str, Any]]:
    """
    Return a path as the source of a Python function, and the names that it uses.

    The function takes the inputs and returns the outputs, in groups; None if the path is not
    valid.
    """
    lines, outputs, bound = python_body(path, 'return None')
    groups = [f'({", ".join(group)},)' if group else '()' for group in outputs]
    parameters = ', '.join(driven.name for driven in path.inputs)
    text = [f'def solve({parameters}):', *(f'    {line}' for line in lines)]
    returned = f'{", ".join(groups)},' if groups else '()'
    return '\n'.join([*text, f'    return {returned}', '']), bound


def python_body(path: Path, bail_out: str, prefix: str = 'k') -> PythonBody:
    """
    Return a path as lines of Python; ``bail_out`` is the statement if it is not valid.

    ``prefix`` begins the names of constants.
    """
    constants: dict[str, Any] = {}
    conditions = [decision.condition for decision in path.decisions]
    outputs = [number for group in path.outputs for number in group]

    def write_constant(value: Any) -> str:
        if isinstance(value, int | float) and math.isfinite(value):
            # The repr of a NumPy number includes its type.
            return repr(float(value) if isinstance(value, float) else value)
        known = f'{prefix}{len(constants)}'
        constants[known] = value
        return known

    def write_call(operation: Operation, parts: list[str]) -> str:
        if operation.name in _ATTRIBUTES:
            return f'{_bracket_text(parts[0])}.{operation.name}'
        if operation.name == 'conjugate':
            return f'{_bracket_text(parts[0])}.conjugate()'
        if operation.name == 'facing':
            return f'rect(1.0, {parts[0]})'
        if operation.name == 'vector':
            return f'complex({parts[0]}, {parts[1]})'
        if operation.name == '**':
            return f'({parts[0]}) ** {parts[1]}'
        if operation.name == 'item':
            return f'{_bracket_text(parts[0])}[{parts[1]}]'
        if operation.name == 'finite':
            return (
                '('
                + ' and '.join(f'{_bracket_text(p)} - {_bracket_text(p)} == 0.0' for p in parts)
                + ')'
            )
        if operation.name == 'found':
            return f'({parts[0]} is not None)'
        if operation.name == 'call':
            return f'{parts[0]}({", ".join(parts[1:])})'
        return f'{operation.name}({", ".join(parts)})'

    writer = TextWriter(
        [*conditions, *outputs],
        write_constant,
        write_call,
        lambda condition, first, second: f'{first} if {condition} else {second}',
        lambda known, text, _: f'{known} = {text}',
    )
    for driven in path.inputs:
        writer.name_operation(driven, driven.name)
    if any(map(_of_inputs, conditions)):
        # 0 for finite numbers, otherwise NaN; a sum that overflows leaves the path, too, and so
        # do huge rates, whose squares might.
        large = f'{2.0**512 / HUGE * 2.0**512!r} * '
        names = [driven.name for driven in path.inputs]
        total = ' + '.join(name if name[0] == 'q' else large + name for name in names)
        writer.lines += [f'total = {total}', 'if total - total != 0.0:', f'    {bail_out}']
    for condition, held in path.decisions:
        if not _of_inputs(condition):
            text = writer.write(condition)
            writer.lines += [f'if not ({text}):' if held else f'if {text}:', f'    {bail_out}']
    groups = [[writer.write(number) for number in group] for group in path.outputs]
    return PythonBody(writer.lines, groups, {**_FUNCTIONS, **constants})


def python_function(path: Path) -> Callable[..., Values | None]:
    """Return a path as a function from its inputs to its outputs; None if it is not valid."""
    source, bound = python_source(path)
    solve: Callable[..., Values | None] = define_function(source, 'solve', bound)
    return solve


def _of_inputs(condition: Operation) -> bool:
    """Return whether a condition says that inputs are finite numbers."""
    return condition.name == 'finite' and all(operand.is_input for operand in condition.operands())


def _bracket_text(text: str) -> str:
    return text if text.isidentifier() else f'({text})'


def compile_line(
    function: Callable[..., Sequence[float]], values: Sequence[complex]
) -> Callable[..., Values | None]:
    """
    Return a function as straight-line code, with the same bits, without loops, lists and calls.

    The function takes numbers and returns numbers, which are the only group of the code; None
    where it decides otherwise than at ``values``. These are real or complex as in all later calls.
    """
    tape = Tape()
    symbols = [tape.add_input(f'x{i}', value) for i, value in enumerate(values)]
    results = tuple(number_of(number) for number in function(*symbols))
    inputs = tuple(symbol.operation for symbol in symbols)
    return python_function(Path(inputs, tuple(tape.decisions), (results,), tape))
