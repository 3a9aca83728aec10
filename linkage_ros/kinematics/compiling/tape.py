# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The tape of a compiled linkage: a record of the operations on symbols.

A symbol stands for a number that is not known yet. The steps of a linkage turn it into operations,
each recorded once. If the steps decide by a symbol, they follow the decision at one state of the
linkage, and the tape records it: the compiled code is valid where all decisions are the same.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import math
import operator
from typing import Any, Final, Literal, NamedTuple, TypeAlias

Kind: TypeAlias = Literal['real', 'complex', 'truth', 'other']

_VALUES: Final[dict[str, Callable[..., Any]]] = {
    '+': operator.add,
    '-': operator.sub,
    '*': operator.mul,
    '/': operator.truediv,
    '**': operator.pow,
    'negative': operator.neg,
    'abs': abs,
    'sin': math.sin,
    'cos': math.cos,
    'sqrt': math.sqrt,
    'atan2': math.atan2,
    'copysign': math.copysign,
    'hypot': math.hypot,
    'remainder': math.remainder,
    'round': round,
    'facing': lambda angle: cmath.rect(1.0, angle),
    'phase': cmath.phase,
    'vector': complex,
    'real': lambda vector: vector.real,
    'imag': lambda vector: vector.imag,
    'conjugate': lambda vector: vector.conjugate(),
    'where': lambda condition, first, second: first if condition else second,
    'item': operator.getitem,
    '<': operator.lt,
    '<=': operator.le,
    '>': operator.gt,
    '>=': operator.ge,
    '==': operator.eq,
    '!=': operator.ne,
    'finite': lambda *numbers: all(map(math.isfinite, numbers)),
    'found': lambda result: result is not None,
}

_TRUTHS = frozenset(('<', '<=', '>', '>=', '==', '!=', 'finite', 'found'))
_COMPLEX = frozenset(('facing', 'vector', 'conjugate'))
_OF_EITHER = frozenset(('+', '-', '*', '/', '**', 'negative', 'where'))
_REALS = frozenset(_VALUES) - _TRUTHS - _COMPLEX - _OF_EITHER


@dataclass(frozen=True, slots=True, eq=False)
class Operation:
    """A number of the tape."""

    # The operation: the name of an input, ``+``, ``sin``, ``where``, ``call``, and so on.
    name: str
    arguments: tuple[Any, ...]  # Other operations, and constants
    kind: Kind  # Type of the result
    number: int  # Index on the tape
    value: Any  # Value at the state of the linkage at which the tape is recorded

    @property
    def is_input(self) -> bool:
        """Whether it is an input."""
        return not self.arguments

    def operands(self) -> list[Operation]:
        """Return the operations among the arguments."""
        return [argument for argument in self.arguments if isinstance(argument, Operation)]


def rewrite_operations(
    root: Any, known: dict[Operation, Any], write: Callable[[Operation], Any]
) -> Any:
    """Return what an operation is rewritten as, after its operands; others are kept as known."""
    waiting = [root]
    while waiting:
        operation = waiting[-1]
        needed = [operand for operand in operation.operands() if operand not in known]
        if needed:
            waiting += needed
            continue
        waiting.pop()
        if operation not in known:
            known[operation] = write(operation)
    return known[root]


class Decision(NamedTuple):
    """A decision of the steps: a condition, and whether it held."""

    condition: Operation
    held: bool


class Tape:
    """All operations on symbols, and the decisions by them."""

    def __init__(self) -> None:
        self._known: dict[tuple[Any, ...], Operation] = {}
        # The decisions in the order in which the steps made them, each condition once.
        self.decisions: list[Decision] = []
        self._decided: dict[int, bool] = {}
        self._settled: Mapping[int, bool] = {}
        self._ahead: Sequence[bool | None] = ()

    def add_input(self, name: str, value: complex) -> Symbol:
        """Return the symbol of an input, real or complex like its value."""
        kind: Kind = 'complex' if isinstance(value, complex) else 'real'
        return Symbol(self, self._new_operation(name, (), kind, value))

    def reset_decisions(
        self, ahead: Sequence[bool | None] = (), settled: Mapping[int, bool] | None = None
    ) -> None:
        """
        Forget all decisions but the settled ones, by the numbers of their conditions.

        The next ones follow ``ahead``, and then the values.
        """
        self.decisions, self._decided, self._ahead = [], {}, ahead
        self._settled = settled or {}

    def decide(self, condition: Operation) -> bool:
        """Return whether a condition holds, and record the decision."""
        held = self._decided.get(condition.number, self._settled.get(condition.number))
        if held is None:
            number = len(self.decisions)
            ahead = self._ahead[number] if number < len(self._ahead) else None
            held = bool(condition.value) if ahead is None else ahead
            self._decided[condition.number] = held
            self.decisions.append(Decision(condition, held))
        return held

    def write(self, name: str, *arguments: Any) -> Any:
        """Return the symbol of an operation on symbols and constants."""
        operands = tuple(a.operation if isinstance(a, Symbol) else a for a in arguments)
        simple = _simplify(name, operands)
        if simple is not None:
            return Symbol(self, simple) if isinstance(simple, Operation) else simple
        if name == '+' and (back := _negated_operand(operands[1])) is not None:
            name, operands = '-', (operands[0], back)
        elif name == '+' and (back := _negated_operand(operands[0])) is not None:
            name, operands = '-', (operands[1], back)
        elif name == '-' and (back := _negated_operand(operands[1])) is not None:
            name, operands = '+', (operands[0], back)
        elif name in ('*', '/') and (rest := _without_negation(name, operands)) is not None:
            # Out of the product: a sum takes it in.
            return -self.write(name, *rest)
        return Symbol(
            self, self._new_operation(name, operands, _result_kind(name, operands), None)
        )

    def call(self, function: Callable[..., Any], *arguments: Any) -> Symbol:
        """Return the symbol of a function's result; the function cannot take symbols."""
        operands = tuple(a.operation if isinstance(a, Symbol) else a for a in arguments)
        return Symbol(self, self._new_operation('call', (function, *operands), 'other', None))

    def _new_operation(
        self, name: str, arguments: tuple[Any, ...], kind: Kind, value: Any
    ) -> Operation:
        key = (name, *(_argument_key(argument) for argument in arguments))
        operation = self._known.get(key)
        if operation is None and name in ('+', '*') and kind == 'real':
            # The same number, whichever comes first.
            operation = self._known.get((name, *key[:0:-1]))
        if operation is None:
            if value is None:
                value = _operation_value(name, arguments)
            operation = Operation(name, arguments, kind, len(self._known), value)
            self._known[key] = operation
        return operation


class Symbol:
    """Symbolic number: result of a recorded operation."""

    __slots__ = ('operation', 'tape')

    def __init__(self, tape: Tape, operation: Operation) -> None:
        self.tape = tape
        self.operation = operation

    def apply(self, name: str, *arguments: Any) -> Any:
        """Return the result of a function of `arithmetic`."""
        return self.tape.write(name, *arguments)

    def __add__(self, other: Any) -> Any:
        return self.tape.write('+', self, other)

    def __radd__(self, other: Any) -> Any:
        return self.tape.write('+', other, self)

    def __sub__(self, other: Any) -> Any:
        return self.tape.write('-', self, other)

    def __rsub__(self, other: Any) -> Any:
        return self.tape.write('-', other, self)

    def __mul__(self, other: Any) -> Any:
        return self.tape.write('*', self, other)

    def __rmul__(self, other: Any) -> Any:
        return self.tape.write('*', other, self)

    def __truediv__(self, other: Any) -> Any:
        return self.tape.write('/', self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return self.tape.write('/', other, self)

    def __pow__(self, power: int) -> Any:
        return self.tape.write('**', self, power)

    def __neg__(self) -> Any:
        return self.tape.write('negative', self)

    def __abs__(self) -> Any:
        return self.tape.write('abs', self)

    def __round__(self) -> Any:
        return self.tape.write('round', self)

    def __lt__(self, other: Any) -> Any:
        return self.tape.write('<', self, other)

    def __le__(self, other: Any) -> Any:
        return self.tape.write('<=', self, other)

    def __gt__(self, other: Any) -> Any:
        return self.tape.write('>', self, other)

    def __ge__(self, other: Any) -> Any:
        return self.tape.write('>=', self, other)

    def __eq__(self, other: object) -> Any:
        return self.tape.write('==', self, other)

    def __ne__(self, other: object) -> Any:
        return self.tape.write('!=', self, other)

    __hash__ = None  # type: ignore[assignment]

    def __getitem__(self, index: int) -> Any:
        return self.tape.write('item', self, index)

    def __bool__(self) -> bool:
        """Decide; a number is true if it is not 0."""
        if self.operation.kind == 'truth':
            return self.tape.decide(self.operation)
        return bool(self != 0.0)

    @property
    def real(self) -> Any:
        """Return the part along x; a real number is its own real part."""
        return self if self.operation.kind == 'real' else self.tape.write('real', self)

    @property
    def imag(self) -> Any:
        """Return the part along y."""
        return 0.0 if self.operation.kind == 'real' else self.tape.write('imag', self)

    def conjugate(self) -> Any:
        """Return the complex conjugate."""
        return self if self.operation.kind == 'real' else self.tape.write('conjugate', self)


def never_minus_zero(number: Any) -> bool:
    """Return whether a real number is certainly not −0.0, which adding 0.0 would change."""
    if not isinstance(number, Operation):
        return isinstance(number, float) and math.copysign(1.0, number) > 0.0
    if number.kind != 'real':
        return False
    if number.name == '+':
        return any(map(never_minus_zero, number.arguments))
    if number.name == '-':
        return never_minus_zero(number.arguments[0])
    return number.name == 'abs'


def _simplify(name: str, operands: tuple[Any, ...]) -> Any:
    """Return an operation in a simpler form with the same bits, or None if there is none."""
    if name in ('+', '-', '*', '/') and not any(
        isinstance(a, complex) or (isinstance(a, Operation) and a.kind == 'complex')
        for a in operands
    ):
        first, second = operands
        if name == '-' and _is_exactly(second, 0.0):
            return first
        if name in ('*', '/') and _is_exactly(second, 1.0):
            return first
        if name == '*' and _is_exactly(first, 1.0):
            return second
        if name == '+' and _is_exactly(second, -0.0):
            return first
        if name == '+' and _is_exactly(first, 0.0) and never_minus_zero(second):
            return second
        if name == '+' and _is_exactly(second, 0.0) and never_minus_zero(first):
            return first
    if name == 'negative':
        (first,) = operands
        return _negated_operand(first)
    if name == 'vector' and all(isinstance(operand, Operation) for operand in operands):
        x, y = operands
        if (x.name, y.name, x.arguments) == ('real', 'imag', y.arguments):
            return x.arguments[0]
    if name == 'abs':
        (first,) = operands
        if isinstance(first, Operation) and first.name == 'abs':
            return first
    return None


def _is_exactly(operand: Any, value: float) -> bool:
    return (
        isinstance(operand, (int, float))
        and operand == value
        and math.copysign(1.0, operand) == math.copysign(1.0, value)
    )


def _negated_operand(operand: Any) -> Any:
    """Return the operand of a negation, or None."""
    if isinstance(operand, Operation) and operand.name == 'negative' and operand.kind == 'real':
        return operand.arguments[0]
    return None


def _without_negation(name: str, operands: tuple[Any, ...]) -> tuple[Any, ...] | None:
    """Return what a real product or quotient is the negation of, or None."""
    first, second = operands
    if any(isinstance(a, complex) or getattr(a, 'kind', 'real') != 'real' for a in operands):
        return None
    if (back := _negated_operand(first)) is not None:
        return back, second
    if (back := _negated_operand(second)) is not None:
        return first, back
    if name == '*' and _is_exactly(first, -1.0):
        return 1.0, second
    return (first, 1.0) if _is_exactly(second, -1.0) else None


def _result_kind(name: str, operands: tuple[Any, ...]) -> Kind:
    if name in _TRUTHS:
        return 'truth'
    if name in _REALS:
        return 'real'
    if name in _COMPLEX:
        return 'complex'
    numbers = operands[1:] if name == 'where' else operands
    if any(isinstance(a, complex) or getattr(a, 'kind', '') == 'complex' for a in numbers):
        return 'complex'
    if any(getattr(a, 'kind', '') == 'truth' for a in numbers):
        return 'truth'
    return 'real'


def _argument_key(argument: Any) -> Any:
    if isinstance(argument, Operation):
        return argument.number
    return id(argument) if callable(argument) else repr(argument)


def _operation_value(name: str, arguments: tuple[Any, ...]) -> Any:
    """Return the value; NaN if it has none, in branches that the steps do not take."""
    values = [a.value if isinstance(a, Operation) else a for a in arguments]
    try:
        if name == 'call':
            return values[0](*values[1:])
        return _VALUES[name](*values)
    except (ArithmeticError, ValueError, TypeError):
        return math.nan
