# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A path as numpy, in the form that is fastest for arrays.

Each operation is a pass over an array. Therefore constants are combined and signs merged, sine and
cosine of an angle are computed from one tangent, and a condition that the bounds of its numbers
decide is left out. Results may differ from the path in their last digits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf, nan, tan
import operator
from typing import Any, Final, NamedTuple

from linkage_ros.generated_code import define_function
from linkage_ros.kinematics.arithmetic import UNIT_ROUNDOFF
from linkage_ros.kinematics.batch import Array, Mask
from linkage_ros.kinematics.compiling.tape import Kind, Operation, rewrite_operations
from linkage_ros.kinematics.compiling.writer import count_uses, needed_operations
import numpy as np

Number = Any
"""An operation, or a constant: a number or a truth value."""

_COMPARED: Final[dict[str, Callable[[float, float], bool]]] = {
    '<': operator.lt,
    '<=': operator.le,
    '>': operator.gt,
    '>=': operator.ge,
    '==': operator.eq,
    '!=': operator.ne,
}

_TRUTHS: Final = frozenset((*_COMPARED, 'and', 'or', 'not', 'found'))

_OF_TABLES: Final = frozenset(('call', 'item', 'found'))
"""Operations of the tables in which iterations have their starts."""

_CLEAR: Final = 1e-9
"""Numbers with this relative distance are different however they are rounded."""

_FUNCTIONS: Final[dict[str, Any]] = {
    '+': np.add,
    '-': np.subtract,
    '*': np.multiply,
    '/': np.divide,
    'abs': np.abs,
    'sin': np.sin,
    'cos': np.cos,
    'tan': np.tan,
    'sqrt': np.sqrt,
    'atan2': np.arctan2,
    'copysign': np.copysign,
    'round': np.rint,
    'maximum': np.maximum,
    'minimum': np.minimum,
    '<': np.less,
    '<=': np.less_equal,
    '>': np.greater,
    '>=': np.greater_equal,
    '==': np.equal,
    '!=': np.not_equal,
    'and': np.logical_and,
    'or': np.logical_or,
    'not': np.logical_not,
    'where': np.where,
}


class BlockBounds(NamedTuple):
    """The range of a number, up to its rounding."""

    low: float = -inf
    high: float = inf


_ANY = BlockBounds()


def _tangent_is_close() -> bool:
    """
    Return whether numpy's tangent is right to its last digit on this machine.

    Some vectorised tangents are 3 ulp off; sine and cosine, which take longer, never are.
    """
    angles = np.linspace(-1.5, 1.5, 1000)
    return all(
        abs(tangent - exact) <= 2.5 * UNIT_ROUNDOFF * abs(exact)
        for tangent, exact in zip(np.tan(angles).tolist(), map(tan, angles.tolist()), strict=True)
    )


_BY_TANGENT = _tangent_is_close()


class ArrayForm:
    """Rewrites the operations of a path; ``kinds`` has the rates and accelerations of 0 or 1."""

    def __init__(self, kinds: Mapping[str, int]) -> None:
        self._given = kinds
        self._known: dict[tuple[Any, ...], Operation] = {}
        self._bounds: dict[Operation, BlockBounds] = {}
        self._written: dict[Operation, Number] = {}

    def rewrite_number(self, root: Number) -> Number:
        """Return an operation of a path in its new form, or the constant that it reduces to."""
        return (
            root
            if _is_constant(root)
            else rewrite_operations(root, self._written, self._rewrite_operation)
        )

    def logical_not(self, condition: Number) -> Number:
        """Return the negation of a condition."""
        return (
            (not condition) if _is_constant(condition) else self._new_operation('not', condition)
        )

    def logical_and(self, one: Number, other: Number) -> Number:
        """Return the conjunction of two conditions."""
        for first, second in ((one, other), (other, one)):
            if _is_constant(first):
                return second if first else False
        return self._new_operation('and', one, other)

    def logical_or(self, one: Number, other: Number) -> Number:
        """Return the disjunction of two conditions."""
        for first, second in ((one, other), (other, one)):
            if _is_constant(first):
                return True if first else second
        return self._new_operation('or', one, other)

    def where(self, condition: Number, first: Number, second: Number) -> Number:
        """Return ``first`` if a condition holds, otherwise ``second``."""
        if _is_constant(condition):
            return first if condition else second
        if first is second:
            return first
        greater = condition.name in ('>', '>=')
        if greater or condition.name in ('<', '<='):
            if condition.arguments == (first, second):
                return self._new_operation('maximum' if greater else 'minimum', first, second)
            if condition.arguments == (second, first):
                return self._new_operation('minimum' if greater else 'maximum', first, second)
        (low, high), (other_low, other_high) = self._bounds_of(first), self._bounds_of(second)
        return self._new_operation(
            'where', condition, first, second,
            bounds=BlockBounds(min(low, other_low), max(high, other_high)),
        )  # fmt: skip

    def _rewrite_operation(self, operation: Operation) -> Number:
        name = operation.name
        if operation.is_input:
            known = self._given.get(name)
            return self._new_operation(name) if known is None else known
        numbers = [
            self._written[a] if isinstance(a, Operation) else a for a in operation.arguments
        ]
        match name:
            case '+':
                return self._add(*numbers)
            case '-':
                return self._subtract(*numbers)
            case '*':
                return self._multiply(*numbers)
            case '/':
                return self._divide(*numbers)
            case '**':
                return self._power(*numbers)
            case 'negative':
                return self._negate(*numbers)
            case 'sin' | 'cos':
                return self._sine_cosine(*numbers)[name == 'cos']
            case 'where':
                return self.where(*numbers)
            case 'abs':
                return self._absolute_value(*numbers)
            case 'sqrt':
                return self._square_root(*numbers)
            case 'remainder':
                return self._remainder(*numbers)
        if name in _COMPARED:
            return self._compare(name, *numbers)
        return self._new_operation(name, *numbers)

    def _add(self, one: Number, other: Number) -> Number:
        if _is_constant(one) and _is_constant(other):
            return one + other
        for first, second in ((one, other), (other, one)):
            if _is_constant(first) and first == 0.0:
                return second
            if (positive := _negated_operand(second)) is not None:
                return self._subtract(first, positive)
        (low, high), (other_low, other_high) = self._bounds_of(one), self._bounds_of(other)
        return self._new_operation(
            '+', *_order_pair(one, other), bounds=BlockBounds(low + other_low, high + other_high)
        )

    def _subtract(self, first: Number, second: Number) -> Number:
        if _is_constant(first) and _is_constant(second):
            return first - second
        if _is_constant(second) and second == 0.0:
            return first
        if _is_constant(first) and first == 0.0:
            return self._negate(second)
        if (positive := _negated_operand(second)) is not None:
            return self._add(first, positive)
        if (positive := _negated_operand(first)) is not None:
            return self._negate(self._add(positive, second))
        (low, high), (other_low, other_high) = self._bounds_of(first), self._bounds_of(second)
        return self._new_operation(
            '-', first, second, bounds=BlockBounds(low - other_high, high - other_low)
        )

    def _negate(self, number: Number) -> Number:
        if _is_constant(number):
            return -number
        if number.name == '-':
            return self._subtract(*reversed(number.arguments))
        return self._multiply(-1.0, number)

    def _multiply(self, first: Number, second: Number) -> Number:
        (factor, first), (more, second) = _split_factor(first), _split_factor(second)
        if _is_given_zero(factor) or _is_given_zero(more):
            return 0
        return self._scale(factor * more, self._multiply_terms(first, second))

    def _multiply_terms(self, first: Number, second: Number) -> Number:
        if first is None or second is None:
            return first if second is None else second
        bounds = _ANY
        ends = [p * q for p in self._bounds_of(first) for q in self._bounds_of(second)]
        if all(abs(end) < inf for end in ends):
            bounds = BlockBounds(min(ends), max(ends))
        if first is second:
            low, high = self._bounds_of(first)
            bounds = bounds._replace(low=max(low, -high, 0.0) ** 2)
        return self._new_operation('*', *_order_pair(first, second), bounds=bounds)

    def _divide(self, first: Number, second: Number) -> Number:
        (factor, first), (divisor, second) = _split_factor(first), _split_factor(second)
        if _is_given_zero(factor):
            return 0
        if divisor == 0.0:
            # Only in branches that the steps do not take.
            return nan
        factor /= divisor
        if second is None:
            return self._scale(factor, first)
        if first is None:
            return self._new_operation('/', factor, second)
        return self._scale(factor, self._new_operation('/', first, second))

    def _scale(self, factor: float, number: Number) -> Number:
        """Return a number without a constant factor, times a factor."""
        if number is None or factor == 1.0:
            return factor if number is None else number
        if factor == -1.0 and number.name == '-':
            return self._subtract(*reversed(number.arguments))
        if number.name == '/' and _is_constant(number.arguments[0]):
            return self._new_operation('/', factor * number.arguments[0], number.arguments[1])
        ends = [factor * end for end in self._bounds_of(number)]
        return self._new_operation('*', factor, number, bounds=BlockBounds(min(ends), max(ends)))

    def _power(self, base: Number, power: int) -> Number:
        """Return an integer power, as products."""
        if power == 1:
            return base
        half = self._power(base, power // 2)
        square = self._multiply(half, half)
        return self._multiply(square, base) if power % 2 else square

    def _sine_cosine(self, angle: Number) -> tuple[Number, Number]:
        """
        Return the sine and the cosine of an angle.

        The cosine is right to the last digit of 1, not of itself. numpy's tangent is vectorised,
        its sine and cosine are not: the tangent takes a tenth of the time of both.
        """
        if not _BY_TANGENT:
            unit = BlockBounds(-1.0, 1.0)
            return self._new_operation('sin', angle, bounds=unit), self._new_operation(
                'cos', angle, bounds=unit
            )
        # With t = tan(angle/2): 2t/(1 + t²) and (1 − t²)/(1 + t²).
        tangent = self._new_operation('tan', self._multiply(0.5, angle))
        square = self._multiply(tangent, tangent)
        more = self._add(1.0, square)
        half_sine = self._new_operation('/', tangent, more, bounds=BlockBounds(-0.5, 0.5))
        cosine = self._new_operation(
            '/', self._subtract(1.0, square), more, bounds=BlockBounds(-1.0, 1.0)
        )
        return self._multiply(2.0, half_sine), cosine

    def _absolute_value(self, number: Number) -> Number:
        if _is_constant(number):
            return abs(number)
        low, high = self._bounds_of(number)
        if low >= 0.0:
            return number
        if high <= 0.0:
            return self._negate(number)
        return self._new_operation('abs', number, bounds=BlockBounds(0.0, max(-low, high)))

    def _square_root(self, base: Number) -> Number:
        if not _is_constant(base) and base.name == '*' and base.arguments[0] is base.arguments[1]:
            return self._absolute_value(base.arguments[0])
        low, high = self._bounds_of(base)
        return self._new_operation(
            'sqrt', base, bounds=BlockBounds(max(low, 0.0) ** 0.5, max(high, 0.0) ** 0.5)
        )

    def _remainder(self, number: Number, period: Number) -> Number:
        """Return the distance from the nearest multiple of a period, which numpy has not."""
        turns = self._new_operation('round', self._divide(number, period))
        return self._subtract(number, self._multiply(period, turns))

    def _compare(self, name: str, first: Number, second: Number) -> Number:
        if _is_constant(first) and _is_constant(second):
            return _COMPARED[name](first, second)
        (low, high), (other_low, other_high) = self._bounds_of(first), self._bounds_of(second)
        if _is_clearly_less(high, other_low):
            return _COMPARED[name](0.0, 1.0)
        if _is_clearly_less(other_high, low):
            return _COMPARED[name](1.0, 0.0)
        return self._new_operation(name, first, second)

    def _bounds_of(self, number: Number) -> BlockBounds:
        if _is_constant(number):
            return BlockBounds(number, number)
        return self._bounds[number]

    def _new_operation(
        self, name: str, *arguments: Number, bounds: BlockBounds = _ANY
    ) -> Operation:
        key = (name, *(a.number if isinstance(a, Operation) else repr(a) for a in arguments))
        operation = self._known.get(key)
        if operation is None:
            kind: Kind = 'truth' if name in _TRUTHS else 'real'
            operation = Operation(name, arguments, kind, len(self._known), None)
            self._known[key] = operation
            self._bounds[operation] = bounds
        return operation


def _is_constant(number: Number) -> bool:
    return not isinstance(number, Operation)


def _is_given_zero(number: Number) -> bool:
    """Return whether a number is a given 0, whose sign does not matter."""
    return isinstance(number, int) and number == 0


def _split_factor(number: Number) -> tuple[float, Number]:
    """Return the constant factor of a number, and the rest, or None if there is none."""
    if _is_constant(number):
        return number, None
    # A 0 stays where it is: a product of the other factors alone may overflow.
    if number.name == '*' and _is_constant(number.arguments[0]) and number.arguments[0] != 0.0:
        factor, rest = number.arguments
        return factor, rest
    return 1.0, number


def _negated_operand(number: Number) -> Number:
    """Return the operand of a negation, or None."""
    if not _is_constant(number) and number.name == '*' and number.arguments[0] == -1.0:
        return number.arguments[1]
    return None


def _order_pair(first: Operation, second: Operation) -> tuple[Number, Number]:
    """Return two terms or factors in their canonical order."""
    if _is_constant(first) or _is_constant(second):
        return (first, second) if _is_constant(first) else (second, first)
    return (first, second) if first.number <= second.number else (second, first)


def _is_clearly_less(less: float, more: float) -> bool:
    """Return whether one number is less than another, however both are rounded."""
    return more - less > _CLEAR * max(abs(less), abs(more)) and less < inf and more > -inf


class BlockFunction:
    """
    Numbers of a path for many states at once, computed in blocks through reused buffers.

    ``inputs`` are the names of the path's inputs; of these ``arrays`` are arrays, and the others
    numbers. ``roots`` are the numbers to compute, valid where ``condition`` holds.
    """

    def __init__(
        self,
        inputs: Sequence[str],
        arrays: Sequence[str],
        roots: Sequence[Number],
        condition: Number = True,
    ) -> None:
        writer = _BlockWriter(arrays, roots, condition)
        # Number of scratch rows of floats, and of truth values.
        self.rows, self.masks = writer.rows.count, writer.masks.count
        names = [
            (inputs, 'given'),
            ([f'o{k}' for k in range(len(roots))], 'out'),
            ([f'r{k}' for k in range(self.rows)], 'rows'),
            ([f'm{k}' for k in range(self.masks)], 'masks'),
        ]
        head = [f'{", ".join(group)}, = {of}' for group, of in names if group]
        lines = '\n'.join(f'    {line}' for line in (*head, *writer.lines))
        self.source = f'def run(given, out, rows, masks):\n{lines}\n'  # The source of the function
        functions = (*_FUNCTIONS.values(), np.copyto, np.count_nonzero)
        namespace: dict[str, Any] = {'inf': inf, 'nan': nan}
        namespace |= {function.__name__: function for function in functions}
        namespace |= writer.tables
        self._run = define_function(self.source, 'run', namespace)

    def __call__(
        self, inputs: Sequence[Array | float], out: Sequence[Array], rows: Array, masks: Mask
    ) -> Mask | None:
        """
        Compute the numbers of a block; return where the condition holds, None if it always does.

        ``out`` has an array for each root; its values are undefined where the condition does not
        hold, and nothing is written if it holds for less than half of the states. ``rows`` and
        ``masks`` are scratch arrays, as long as the block; the result is one of the masks.
        """
        holds: Mask | None = self._run(inputs, out, rows, masks)
        return holds


class _NamePool:
    """A pool of buffer names."""

    def __init__(self, letter: str) -> None:
        self._letter = letter
        self._free: list[str] = []
        self.count = 0

    def take_name(self) -> str:
        """Return a free name."""
        if self._free:
            return self._free.pop()
        self.count += 1
        return f'{self._letter}{self.count - 1}'

    def return_name(self, name: str) -> None:
        """Return a name to the pool."""
        if name.startswith(self._letter):
            self._free.append(name)


class _BlockWriter:
    """Writes operations as passes over arrays, each after its operands."""

    def __init__(self, arrays: Sequence[str], roots: Sequence[Number], condition: Number) -> None:
        self.rows, self.masks = _NamePool('r'), _NamePool('m')
        self.lines: list[str] = []
        self.tables: dict[str, Callable[..., Any]] = {}
        self._arrays = arrays
        self._names: dict[Operation, str] = {}
        self._of_states: set[Operation] = set()
        self._left = count_uses([condition, *roots])
        self._wanted: dict[Operation, str] = {}
        for k, root in enumerate(roots):
            if isinstance(root, Operation) and not root.is_input:
                self._wanted.setdefault(root, f'o{k}')
        self._write_number(condition)
        held = self._number_text(condition) if isinstance(condition, Operation) else None
        if held:
            self.lines.append(f'if 2 * count_nonzero({held}) < {held}.size: return {held}')
        for k, root in enumerate(roots):
            self._write_number(root)
            place = f'o{k}'
            if self._number_text(root) != place:
                self.lines.append(f'copyto({place}, {self._number_text(root)})')
        self.lines.append(f'return {held}')

    def _number_text(self, number: Number) -> str:
        if isinstance(number, Operation):
            return self._names[number]
        # A linkage may hold numpy numbers, whose repr() includes the type.
        return repr(number if isinstance(number, bool) else float(number))

    def _write_number(self, root: Number) -> None:
        """Write a number, after the operations that it needs."""
        for operation in (
            needed_operations(root, self._names) if isinstance(root, Operation) else ()
        ):
            self._write_operation(operation)

    def _write_table(self, operation: Operation) -> None:
        """Write where a start of an iteration comes from: a row of a table for each state."""
        name = f't{operation.number}'
        first, *others = operation.arguments
        if operation.name == 'call':
            self.tables[name] = first.rows_at
            texts = ', '.join(map(self._number_text, others))
            self.lines.append(f'{name}_rows, {name}_found = {name}({texts})')
            self._done_with(operation.operands())
        else:
            part = 'found' if operation.name == 'found' else f'rows[{others[0]}]'
            name = f'{self._names[first]}_{part}'
        self._names[operation] = name
        self._of_states.add(operation)

    def _write_operation(self, operation: Operation) -> None:
        operands = operation.operands()
        if operation.name in _OF_TABLES:
            self._write_table(operation)
            return
        if operation.is_input:
            self._names[operation] = operation.name
            if operation.name in self._arrays:
                self._of_states.add(operation)
            return
        texts = [self._number_text(argument) for argument in operation.arguments]
        if not any(operand in self._of_states for operand in operands):
            # The same number for all states.
            self._names[operation] = f't{operation.number}'
            self.lines.append(
                f't{operation.number} = {_FUNCTIONS[operation.name].__name__}({", ".join(texts)})'
            )
            return
        self._of_states.add(operation)
        if operation.name == 'where':
            self._write_choice(operation, texts)
        else:
            self._done_with(operands)
            into = self._result_buffer(operation)
            self.lines.append(
                f'{_FUNCTIONS[operation.name].__name__}({", ".join(texts)}, out={into})'
            )

    def _result_buffer(self, operation: Operation) -> str:
        """Return the buffer for the result of an operation."""
        wanted = self._wanted.get(operation)
        if wanted is None:
            wanted = (self.masks if operation.kind == 'truth' else self.rows).take_name()
        self._names[operation] = wanted
        return wanted

    def _done_with(self, operands: Sequence[Operation]) -> None:
        """Count the uses of operands, and free the buffers of those that are no longer used."""
        for operand in operands:
            self._left[operand] -= 1
            if not self._left[operand]:
                for room in (self.rows, self.masks):
                    room.return_name(self._names[operand])

    def _write_choice(self, operation: Operation, texts: Sequence[str]) -> None:
        """Write a choice: one number over the other where a condition holds."""
        condition, first, second = texts
        last = operation.arguments[2]
        if self._left.get(last) == 1 and operation not in self._wanted and second[0] == 'r':
            # This is the last use of the other number: it is overwritten in place.
            into = self._names[operation] = second
            self._left[last] += 1
        else:
            into = self._result_buffer(operation)
            self.lines.append(f'copyto({into}, {second})')
        self.lines.append(f'copyto({into}, {first}, where={condition})')
        self._done_with(operation.operands())
