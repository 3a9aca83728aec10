# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A path in real numbers only, for languages and arrays without complex numbers.

A complex number becomes its two components, by the formulas of Python's complex numbers: the bits
are the same, also the sign of a zero, which a product with the 0.0 of a real number can decide.
"""

from __future__ import annotations

from collections.abc import Callable
import operator
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.arithmetic import atan2, cos, sin, sqrt, UndecidedError, where
from linkage_ros.kinematics.compiling.linkage import Compiled
from linkage_ros.kinematics.compiling.tape import (
    Decision,
    Operation,
    rewrite_operations,
    Symbol,
    Tape,
)
from linkage_ros.kinematics.compiling.trace import (
    DecisionBranch,
    motion_at,
    Number,
    number_of,
    OutputSelection,
    Path,
    SolvedLeaf,
    Tree,
    tree_below,
)
from linkage_ros.kinematics.status import Status

if TYPE_CHECKING:
    from linkage_ros.kinematics.closure import Closure

_MAKES_PARTS = frozenset(('facing', 'vector'))

_MOST_SOLVED = 32
"""Largest number of leaves with numbers: change points of several dyads multiply."""


class _Parts(NamedTuple):
    """The components of a complex number along x and y."""

    x: Any
    y: Any


class Lowered(NamedTuple):
    """A path in real numbers, and its fallback statuses."""

    path: Path
    fallback_statuses: tuple[Tree, ...]


def lower_path(
    path: Path, fallback_statuses: tuple[Tree, ...] = (), by_squares: bool = False
) -> Lowered:
    """
    Return a path in real numbers only; links iterated with several inputs have no such form.

    ``fallback_statuses`` has the status of the linkage where each decision differs. ``by_squares``
    computes lengths and quotients by squares, which is fastest for arrays: the last digits differ,
    lengths below 1e-154 are lost, and so is the sign of a zero.
    """
    lower = Lowering(by_squares)
    inputs = tuple(lower.lower_operation(driven) for driven in path.inputs)
    decisions = tuple(
        Decision(lower.lower_operation(condition), held) for condition, held in path.decisions
    )
    outputs = tuple(tuple(map(lower.lower_operation, group)) for group in path.outputs)
    return Lowered(
        Path(inputs, decisions, outputs, lower.tape),
        tuple(map(lower.lower_tree, fallback_statuses)),
    )


class Lowering:
    """Rewrites the operations of one tape on another one."""

    def __init__(self, by_squares: bool = False) -> None:
        self.tape = Tape()
        self.times, self.plus, self.minus = _SHORT if by_squares else _EXACT
        self._formulas = _BY_SQUARES if by_squares else _FORMULAS
        self._known: dict[Operation, Any] = {}

    def lower_operation(self, root: Number) -> Any:
        """Return a real number on the new tape, or the constant that it reduces to."""
        number = self._lower_number(root)
        return number.operation if isinstance(number, Symbol) else number

    def lower_tree(self, tree: Tree) -> Tree:
        """Return a tree with conditions and numbers on the new tape."""
        if isinstance(tree, DecisionBranch):
            condition = self.lower_operation(tree.condition)
            if isinstance(condition, bool):
                return self.lower_tree(tree.held if condition else tree.failed)
            return DecisionBranch(
                condition, self.lower_tree(tree.held), self.lower_tree(tree.failed), tree.usual
            )
        if isinstance(tree, SolvedLeaf):
            return SolvedLeaf(
                tree.status,
                tuple(tuple(map(self.lower_operation, group)) for group in tree.outputs),
            )
        return tree

    def _lower_number(self, root: Any) -> Any:
        """Return a symbol, its components, or a constant."""
        if isinstance(root, complex):
            return _Parts(root.real, root.imag)
        if not isinstance(root, Operation):
            return root
        return rewrite_operations(root, self._known, self._write_operation)

    def _write_operation(self, operation: Operation) -> Any:
        name = operation.name
        if operation.is_input:
            return self.tape.add_input(name, operation.value)
        arguments: list[Any] = [
            self._known.get(a) if isinstance(a, Operation) else self._lower_number(a)
            for a in operation.arguments
        ]
        if name == 'call':
            function, *numbers = arguments
            return self.tape.call(function, *numbers)
        if name == 'item':
            # As text: the number could get the name of an equal length.
            return self.tape.write(name, arguments[0], str(arguments[1]))
        if (
            not any(isinstance(argument, _Parts) for argument in arguments)
            and name not in _MAKES_PARTS
        ):
            return self.tape.write(name, *arguments)
        return self._formulas[name](self, *arguments)


def _short_product(first: Any, second: Any) -> Any:
    """Return a product; 0 if one factor is a constant 0."""
    if not _are_constants(first, second) and (_is_zero(first) or _is_zero(second)):
        return 0.0
    return first * second


def _is_zero(number: Any) -> bool:
    return isinstance(number, int | float) and number == 0.0


def _are_constants(first: Any, second: Any) -> bool:
    """Return whether both are constants; then a zero has its correct sign too."""
    return isinstance(first, int | float) and isinstance(second, int | float)


def _short_sum(first: Any, second: Any) -> Any:
    if _are_constants(first, second):
        return first + second
    return second if _is_zero(first) else first if _is_zero(second) else first + second


def _short_difference(first: Any, second: Any) -> Any:
    if _are_constants(first, second):
        return first - second
    return -second if _is_zero(first) else first if _is_zero(second) else first - second


_EXACT = (operator.mul, operator.add, operator.sub)
_SHORT = (_short_product, _short_sum, _short_difference)
"""Arithmetic of components, with every zero or without products with a constant 0."""


def _to_parts(number: Any) -> _Parts:
    return number if isinstance(number, _Parts) else _Parts(number, 0.0)


def _add_parts(lower: Lowering, first: Any, second: Any) -> _Parts:
    a, b = _to_parts(first), _to_parts(second)
    return _Parts(lower.plus(a.x, b.x), lower.plus(a.y, b.y))


def _subtract_parts(lower: Lowering, first: Any, second: Any) -> _Parts:
    a, b = _to_parts(first), _to_parts(second)
    return _Parts(lower.minus(a.x, b.x), lower.minus(a.y, b.y))


def _multiply_parts(lower: Lowering, first: Any, second: Any) -> _Parts:
    a, b = _to_parts(first), _to_parts(second)
    times = lower.times
    return _Parts(
        lower.minus(times(a.x, b.x), times(a.y, b.y)),
        lower.plus(times(a.x, b.y), times(a.y, b.x)),
    )


def _divide_parts(lower: Lowering, one: Any, other: Any) -> _Parts:
    """Return a quotient by Smith's method: R. L. Smith, Algorithm 116, CACM 5 (1962)."""
    a = _to_parts(one)
    if not isinstance(other, _Parts):
        ratio = 0.0 / other
        x = lower.plus(a.x, lower.times(a.y, ratio))
        y = lower.minus(a.y, lower.times(a.x, ratio))
        return _Parts(x / other, y / other)
    along_x = abs(other.x) >= abs(other.y)
    great, small = where(along_x, other.x, other.y), where(along_x, other.y, other.x)
    ratio = small / great
    scale = great + small * ratio
    first, second = where(along_x, a.x, a.y), where(along_x, a.y, a.x)
    across = where(along_x, second - first * ratio, first * ratio - second)
    return _Parts((first + second * ratio) / scale, across / scale)


def _divide_by_squares(lower: Lowering, first: Any, second: Any) -> _Parts:
    if isinstance(second, _Parts):
        first = _multiply_parts(lower, first, _Parts(second.x, -second.y))
        second = _squared_length(second)
    a = _to_parts(first)
    return _Parts(a.x / second, a.y / second)


def _length_by_squares(_: Lowering, vector: _Parts) -> Any:
    return sqrt(_squared_length(vector))


def _squared_length(vector: _Parts) -> Any:
    return _short_sum(_short_product(vector.x, vector.x), _short_product(vector.y, vector.y))


def _negate_parts(_: Lowering, vector: _Parts) -> _Parts:
    return _Parts(-vector.x, -vector.y)


_FORMULAS: dict[str, Callable[..., Any]] = {
    '+': _add_parts,
    '-': _subtract_parts,
    '*': _multiply_parts,
    '/': _divide_parts,
    'negative': _negate_parts,
    'conjugate': lambda _, vector: _Parts(vector.x, -vector.y),
    'real': lambda _, vector: vector.x,
    'imag': lambda _, vector: vector.y,
    'abs': lambda lower, vector: lower.tape.write('hypot', vector.x, vector.y),
    'phase': lambda _, vector: atan2(vector.y, vector.x),
    'facing': lambda _, angle: _Parts(cos(angle), sin(angle)),
    'vector': lambda _, x, y: _Parts(x, y),
}

_BY_SQUARES: dict[str, Callable[..., Any]] = {
    **_FORMULAS,
    '/': _divide_by_squares,
    'abs': _length_by_squares,
}

# All paths of a linkage's position, as one tree of conditions in real numbers.
#
# A leaf gives the status of the linkage, and its numbers if there are any. The tree follows the
# paths taken at closed states of the linkage, and the change points beside them. No state is known
# to take one of the other paths: these end in None, and code generated from the tree gives no
# numbers there.


class Program(NamedTuple):
    """A linkage as a tree in real numbers."""

    # The values of the driven joints, then their rates and accelerations, if requested.
    inputs: tuple[Operation, ...]
    tree: Tree  # The decisions and results for finite inputs


def compile_program(closure: Closure, derivatives: int, wanted: OutputSelection) -> Program:
    """
    Return the tree of a linkage, ignoring its limits.

    ``wanted`` selects the numbers of the leaves. Derivatives are 0 for positions, 1 with
    velocities, 2 with accelerations. A DefinitionError says that no closed state is found.
    """
    paths = Compiled(closure, derivatives, wanted, within_limits=False).paths
    if not paths:
        pose = closure.linkage.pose
        if pose is not None and closure.close_unlimited(*pose.inputs).status is Status.CLOSED:
            raise DefinitionError(
                'pose',
                'is too near a singularity of links that close only together to be compiled',
                'draw another pose, or name other inputs',
            )
        raise DefinitionError(
            'pose',
            'no state is found at which the linkage is closed',
            'write one at which it is: pose: {inputs: [VALUE, VALUE]}',
        )
    tape = Tape()
    count = len(closure.linkage.inputs)
    symbols: list[Any] = [tape.add_input(symbol.name, symbol.value) for symbol in paths[0].inputs]
    groups = [symbols[start:][:count] for start in range(0, len(symbols), count)]
    taken = [tuple(decision.held for decision in path.decisions) for path in paths]
    solved = 0

    def run_leaf(decided: tuple[bool, ...]) -> Tree:
        """Run the steps; the last of the first decisions is the one that differs."""
        nonlocal solved
        first = len(decided)
        known = next((way for way in taken if way[:first] == decided), None)
        ahead = decided if known is None else known
        tape.reset_decisions(ahead)
        state = closure.initial_state(*groups[0])
        for step in closure.steps:
            before = len(tape.decisions)
            try:
                status = step.close(state).status
            except UndecidedError:
                return None
            if not status.has_rates:
                return status
            turned = before < first <= len(tape.decisions)
            if turned and status is Status.CLOSED and known is None:
                return None
        if solved == _MOST_SOLVED:
            return None
        solved += 1
        tape.reset_decisions(ahead)
        motion = motion_at(closure, groups, within_limits=False)
        numbers = tuple(tuple(map(number_of, group)) for group in wanted(motion))
        return SolvedLeaf(motion.position.status, numbers)

    tree = tree_below(tape, (), run_leaf)
    lowering = Lowering()
    inputs = tuple(lowering.lower_operation(symbol.operation) for symbol in symbols)
    return Program(inputs, lowering.lower_tree(tree))
