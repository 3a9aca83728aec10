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

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TYPE_CHECKING, TypeAlias

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.arithmetic import atan2, cos, sin, sqrt, where
from linkage_ros.kinematics.compiling.linkage import Compiled
from linkage_ros.kinematics.compiling.tape import Decision, Operation, Symbol, Tape
from linkage_ros.kinematics.compiling.trace import (
    Fate,
    Fork,
    moved,
    Number,
    number_of,
    Path,
    Wanted,
)
from linkage_ros.kinematics.ranges import iterated
from linkage_ros.kinematics.status import Status

if TYPE_CHECKING:
    from linkage_ros.kinematics.results import LoopClosure


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


# All ways that a linkage's position can take, as one tree of conditions in real numbers.
#
# A leaf says which status the linkage has there, and holds the numbers where it has any. The tree
# follows the ways that are taken at closed states of the linkage, and the change points beside
# them. Other ways that the conditions leave open are taken at no state, as far as is known: they
# end in None, and what is written from the tree gives no numbers there.

_MOST_SOLVED = 32
"""So many leaves have numbers at most: change points of several dyads multiply."""


class Solved(NamedTuple):
    """A leaf with numbers: in groups, as they were asked for."""

    status: Status
    outputs: tuple[tuple[Number, ...], ...]


class Branch(NamedTuple):
    """A condition, what follows where it holds and where not, and which of these is usual."""

    condition: Operation
    held: Tree
    failed: Tree
    usual: bool


Tree: TypeAlias = Branch | Solved | Status | None


class Program(NamedTuple):
    """
    A linkage as a tree in real numbers.

    Attributes
    ----------
    inputs
        The driven joints' values, then their rates and their accelerations, as far as asked for.
    tree
        What is to be decided, and what is known then, for finite inputs.

    """

    inputs: tuple[Operation, ...]
    tree: Tree


def program(closure: LoopClosure, derivatives: int, wanted: Wanted) -> Program:
    """
    Return the tree of a linkage, whatever its limits.

    Parameters
    ----------
    closure
        The linkage.
    derivatives
        What is worked out: positions (0), velocities too (1), and accelerations (2).
    wanted
        What the leaves hold.

    Raises
    ------
    DefinitionError
        Where links are solved by iteration, or no state is found at which the linkage is closed.

    """
    if iterated(closure):
        raise DefinitionError(
            'links',
            'some are only solved by iteration, which is no straight line',
            'compile a linkage of dyads',
        )
    paths = Compiled(closure, derivatives, wanted, within_limits=False).paths
    if not paths:
        raise DefinitionError(
            'pose',
            'no state is found at which the linkage is closed',
            'write one at which it is: pose: {inputs: [VALUE, VALUE]}',
        )
    tape = Tape()
    count = len(closure.linkage.inputs)
    given = [tape.given(one.name, one.value) for one in paths[0].inputs]
    groups = [given[start:][:count] for start in range(0, len(given), count)]
    taken = [tuple(decision.held for decision in path.decisions) for path in paths]
    tree = _Growth(closure, tape, groups, wanted, taken).below(())
    lowering = Lowering()
    inputs = tuple(lowering.operation(one.operation) for one in given)
    return Program(inputs, _lowered(tree, lowering))


class _Growth:
    """
    Runs the steps on symbols, once for each way.

    Parameters
    ----------
    closure, wanted
        As of `program`.
    tape, given
        What is written on, and the inputs, rates and accelerations on it.
    taken
        What is decided at closed states.

    """

    def __init__(
        self,
        closure: LoopClosure,
        tape: Tape,
        given: Sequence[Sequence[Any]],
        wanted: Wanted,
        taken: Sequence[tuple[bool, ...]],
    ) -> None:
        self._closure = closure
        self._tape = tape
        self._given = given
        self._wanted = wanted
        self._taken = taken
        self._solved = 0

    def below(self, decided: tuple[bool, ...]) -> Tree:
        """Return what follows where the first decisions fall as is said."""
        tape, count = self._tape, len(decided)
        ahead = next((way for way in self._taken if way[:count] == decided), None)
        leaf = self._leaf(decided if ahead is None else ahead, count, ahead is not None)
        made = tape.decisions[:]
        tree: Tree = leaf
        for number in reversed(range(count, len(made))):
            condition, held = made[number]
            if condition.name == 'finite':
                continue
            other = self.below((*(each.held for each in made[:number]), not held))
            if tree != other:
                tree = Branch(condition, *((tree, other) if held else (other, tree)), held)
        return tree

    def _leaf(self, ahead: Sequence[bool], count: int, known: bool) -> Tree:
        """Run the steps; the last of so many decisions is one that is made in another way."""
        tape, closure = self._tape, self._closure
        tape.begin(ahead)
        known_state = closure.known(*self._given[0])
        for step in closure.steps:
            before = len(tape.decisions)
            status = step.close(known_state).status
            if not status.has_rates:
                return status
            turned = before < count <= len(tape.decisions)
            if turned and status is Status.CLOSED and not known:
                return None
        if self._solved == _MOST_SOLVED:
            return None
        self._solved += 1
        tape.begin(ahead)
        motion = moved(closure, self._given, within_limits=False)
        numbers = tuple(tuple(map(number_of, group)) for group in self._wanted(motion))
        return Solved(motion.position.status, numbers)


def _lowered(tree: Tree, lowering: Lowering) -> Tree:
    """Return a tree in real numbers."""
    if isinstance(tree, Branch):
        condition = lowering.operation(tree.condition)
        if isinstance(condition, bool):
            return _lowered(tree.held if condition else tree.failed, lowering)
        held, failed = _lowered(tree.held, lowering), _lowered(tree.failed, lowering)
        return Branch(condition, held, failed, tree.usual)
    if isinstance(tree, Solved):
        return Solved(
            tree.status,
            tuple(tuple(map(lowering.operation, group)) for group in tree.outputs),
        )
    return tree
