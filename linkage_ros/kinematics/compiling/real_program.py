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
A path in real numbers alone, for languages and arrays that have no complex ones.

A complex number becomes its two parts, by the formulas of Python's own complex numbers: the bits
are the same, but for the sign of a zero.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from linkage_ros.kinematics.arithmetic import atan2, cos, sin, sqrt, where
from linkage_ros.kinematics.compiling.fates import Fate, Fork
from linkage_ros.kinematics.compiling.tape import Decision, Operation, Symbol, Tape
from linkage_ros.kinematics.compiling.trace import Number, Path


class _Parts(NamedTuple):
    """The parts of a complex number along x and y."""

    x: Any
    y: Any


class Lowered(NamedTuple):
    """A path in real numbers, and the fates beside it."""

    path: Path
    fates: tuple[Fate, ...]


def lowered(path: Path, fates: tuple[Fate, ...] = (), by_squares: bool = False) -> Lowered:
    """
    Return a path in real numbers alone; links that are iterated have none.

    Parameters
    ----------
    path
        The path.
    fates
        What becomes of the linkage where its decisions fall otherwise.
    by_squares
        Whether lengths and quotients are found by squares, which arrays pass through fastest: the
        last digits are others, and lengths below 1e-154 are lost.

    """
    lower = Lowering(by_squares)
    inputs = tuple(lower.operation(given) for given in path.inputs)
    decisions = tuple(
        Decision(lower.operation(condition), held) for condition, held in path.decisions
    )
    outputs = tuple(tuple(map(lower.operation, group)) for group in path.outputs)
    return Lowered(
        Path(inputs, decisions, outputs, lower.tape), tuple(lower.fate(fate) for fate in fates)
    )


class Lowering:
    """Writes the operations of one tape on another."""

    def __init__(self, by_squares: bool = False) -> None:
        self.tape = Tape()
        self._formulas = _BY_SQUARES if by_squares else _FORMULAS
        self._known: dict[Operation, Any] = {}

    def operation(self, root: Number) -> Any:
        """Return a real number on the new tape, or a constant that it is or has become."""
        found = self._number(root)
        return found.operation if isinstance(found, Symbol) else found

    def fate(self, fate: Fate) -> Fate:
        """Return a fate by conditions on the new tape."""
        if isinstance(fate, Fork):
            held, failed = self.fate(fate.held), self.fate(fate.failed)
            return Fork(self.operation(fate.condition), held, failed)
        return fate

    def _number(self, root: Any) -> Any:
        """Return a symbol, the parts of one, or a constant."""
        if isinstance(root, complex):
            return _Parts(root.real, root.imag)
        if not isinstance(root, Operation):
            return root
        waiting = [root]
        while waiting:
            operation = waiting[-1]
            needed = [one for one in operation.operands() if one not in self._known]
            if needed:
                waiting += needed
                continue
            waiting.pop()
            if operation not in self._known:
                self._known[operation] = self._written(operation)
        return self._known[root]

    def _written(self, operation: Operation) -> Any:
        name = operation.name
        if operation.is_input:
            return self.tape.given(name, operation.value)
        given = [self._known.get(a) if isinstance(a, Operation) else self._number(a)
                 for a in operation.arguments]  # fmt: skip
        if not any(isinstance(one, _Parts) for one in given) and name not in _MAKES_PARTS:
            return self.tape.write(name, *given)
        return self._formulas[name](self.tape, *given)


_MAKES_PARTS = frozenset(('facing', 'vector'))


def _times(one: Any, other: Any) -> Any:
    """Return a product; 0 where a constant is."""
    if not _constants(one, other) and (_zero(one) or _zero(other)):
        return 0.0
    return one * other


def _zero(number: Any) -> bool:
    return isinstance(number, int | float) and number == 0.0


def _constants(one: Any, other: Any) -> bool:
    """Return whether both are constants, of which a zero has its right sign, too."""
    return isinstance(one, int | float) and isinstance(other, int | float)


def _sum(one: Any, other: Any) -> Any:
    if _constants(one, other):
        return one + other
    return other if _zero(one) else one if _zero(other) else one + other


def _difference(one: Any, other: Any) -> Any:
    if _constants(one, other):
        return one - other
    return -other if _zero(one) else one if _zero(other) else one - other


def _both(number: Any) -> _Parts:
    return number if isinstance(number, _Parts) else _Parts(number, 0.0)


def _add(_: Tape, one: Any, other: Any) -> _Parts:
    a, b = _both(one), _both(other)
    return _Parts(_sum(a.x, b.x), _sum(a.y, b.y))


def _subtract(_: Tape, one: Any, other: Any) -> _Parts:
    a, b = _both(one), _both(other)
    return _Parts(_difference(a.x, b.x), _difference(a.y, b.y))


def _multiply(_: Tape, one: Any, other: Any) -> _Parts:
    a, b = _both(one), _both(other)
    return _Parts(
        _difference(_times(a.x, b.x), _times(a.y, b.y)), _sum(_times(a.x, b.y), _times(a.y, b.x))
    )


def _divide(_: Tape, one: Any, other: Any) -> _Parts:
    """Return a quotient by Smith's method: R. L. Smith, Algorithm 116, CACM 5 (1962)."""
    a = _both(one)
    if not isinstance(other, _Parts):
        return _Parts(a.x / other, a.y / other)
    along_x = abs(other.x) >= abs(other.y)
    great, small = where(along_x, other.x, other.y), where(along_x, other.y, other.x)
    ratio = small / great
    scale = great + small * ratio
    first, second = where(along_x, a.x, a.y), where(along_x, a.y, a.x)
    across = where(along_x, second - first * ratio, first * ratio - second)
    return _Parts((first + second * ratio) / scale, across / scale)


def _divide_by_squares(tape: Tape, one: Any, other: Any) -> _Parts:
    if isinstance(other, _Parts):
        one = _multiply(tape, one, _Parts(other.x, -other.y))
        other = _square(other)
    return _divide(tape, one, other)


def _length_by_squares(_: Tape, one: _Parts) -> Any:
    return sqrt(_square(one))


def _square(one: _Parts) -> Any:
    return _sum(_times(one.x, one.x), _times(one.y, one.y))


def _negative(_: Tape, one: _Parts) -> _Parts:
    return _Parts(-one.x, -one.y)


_FORMULAS: dict[str, Callable[..., Any]] = {
    '+': _add,
    '-': _subtract,
    '*': _multiply,
    '/': _divide,
    'negative': _negative,
    'conjugate': lambda _, one: _Parts(one.x, -one.y),
    'real': lambda _, one: one.x,
    'imag': lambda _, one: one.y,
    'abs': lambda tape, one: tape.write('hypot', one.x, one.y),
    'phase': lambda _, one: atan2(one.y, one.x),
    'facing': lambda _, angle: _Parts(cos(angle), sin(angle)),
    'vector': lambda _, x, y: _Parts(x, y),
}

_BY_SQUARES: dict[str, Callable[..., Any]] = {
    **_FORMULAS,
    '/': _divide_by_squares,
    'abs': _length_by_squares,
}
