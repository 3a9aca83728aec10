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
All ways that a linkage's position can take, as one tree of conditions in real numbers.

A leaf says which status the linkage has there, and holds the numbers where it has any. The tree
follows the ways that are taken at closed states of the linkage, and the change points beside them.
Other ways that the conditions leave open are taken at no state, as far as is known: they end in
None, and what is written from the tree gives no numbers there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TYPE_CHECKING, TypeAlias

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.compiling.linkage import Compiled
from linkage_ros.kinematics.compiling.real_program import Lowering
from linkage_ros.kinematics.compiling.tape import Operation, Tape
from linkage_ros.kinematics.compiling.trace import moved, Number, number_of, Wanted
from linkage_ros.kinematics.ranges import iterated
from linkage_ros.kinematics.status import Status

if TYPE_CHECKING:
    from linkage_ros.kinematics.closure import Closure

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


def program(closure: Closure, derivatives: int, wanted: Wanted) -> Program:
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
        closure: Closure,
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
