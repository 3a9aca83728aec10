# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The steps of a linkage, run on symbols along one path of decisions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import chain, repeat
from typing import Any, NamedTuple, TYPE_CHECKING, TypeAlias

from linkage_ros.kinematics.arithmetic import UndecidedError
from linkage_ros.kinematics.compiling.tape import Decision, Operation, Symbol, Tape
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, Step

if TYPE_CHECKING:
    from linkage_ros.kinematics.closure import Closure
    from linkage_ros.kinematics.results import Acceleration, Position, Velocity

Number = Operation | float
"""A result of a program: an operation, or a constant."""


class TracedMotion(NamedTuple):
    """The motion of a linkage on symbols, as far as requested."""

    position: Position
    velocity: Velocity | None
    acceleration: Acceleration | None


OutputSelection = Callable[..., Sequence[Sequence[float]]]
"""Selects the numbers of a motion, and of numbers given with it, that a program returns."""


class Path(NamedTuple):
    """The operations of the steps while their decisions are the same."""

    # The values of the driven joints, then their rates and accelerations, if requested; then
    # numbers given with the motion.
    inputs: tuple[Operation, ...]
    # The decisions in order. If one of them differs, the path is not valid.
    decisions: tuple[Decision, ...]
    outputs: tuple[tuple[Number, ...], ...]  # The returned numbers, in groups
    tape: Tape  # The tape of the operations


def published_joints(motion: TracedMotion) -> Sequence[Sequence[float]]:
    """Return the published joints of a motion, with their rates and accelerations."""
    return [part.joints for part in motion if part is not None]


def trace_path(
    closure: Closure,
    at: Sequence[float],
    derivatives: int,
    wanted: OutputSelection = published_joints,
    within_limits: bool = True,
    given_count: int = 0,
) -> Path:
    """
    Return the path that the steps take at one state.

    ``at`` has values of the inputs, in [rad] or [m], at which the linkage is closed; else
    ValueError is raised. ``derivatives``: 0 for positions, 1 for velocities too, 2 for
    accelerations too. If ``within_limits``, the path ends where a joint is beyond its limits.
    ``given_count`` numbers and the motion are given to ``wanted``.
    """
    tape = Tape()
    symbols = [
        [tape.add_input(f'{letter}{i}', value) for i, value in enumerate(values)]
        for letter, values in zip('qwa', (at, [1.25] * len(at), [0.75] * len(at)), strict=True)
    ][: 1 + derivatives]
    beside = [tape.add_input(f'g{i}', 0.5 + i) for i in range(given_count)]
    tape.reset_decisions()
    motion = motion_at(closure, symbols, within_limits)
    if motion.position.status is not Status.CLOSED:
        raise ValueError(f'{list(at)}: the linkage is {motion.position.status.value} there')
    # The selection may make decisions, too.
    outputs = tuple(tuple(number_of(n) for n in group) for group in wanted(motion, *beside))
    inputs = tuple(symbol.operation for group in (*symbols, beside) for symbol in group)
    return Path(inputs, tuple(tape.decisions), outputs, tape)


def motion_at(
    closure: Closure, columns: Sequence[Sequence[Any]], within_limits: bool = True
) -> TracedMotion:
    """Return the motion of a closure at inputs, rates and accelerations, as far as given."""
    inputs, *more = columns
    position = closure.position(*inputs) if within_limits else closure.close_unlimited(*inputs)
    velocity = acceleration = None
    if more and position.status.has_rates:
        velocity = closure.velocity(position, *more[0])
        if len(more) > 1:
            acceleration = closure.acceleration(position, velocity, *more[1])
    return TracedMotion(position, velocity, acceleration)


def number_of(number: Any) -> Number:
    """Return the operation of a symbol, or a constant as it is."""
    return number.operation if isinstance(number, Symbol) else number


class SolvedLeaf(NamedTuple):
    """A leaf with numbers, in the requested groups."""

    status: Status
    outputs: tuple[tuple[Number, ...], ...]


class DecisionBranch(NamedTuple):
    """A condition, the trees where it holds and where it fails, and the usual outcome."""

    condition: Operation
    held: Tree
    failed: Tree
    usual: bool


Tree: TypeAlias = DecisionBranch | SolvedLeaf | Status | None
"""What the steps come to, by their decisions; None where that is not followed."""


def tree_below(
    tape: Tape, decided: tuple[bool, ...], leaf: Callable[[tuple[bool, ...]], Tree]
) -> Tree:
    """
    Return the tree below the first decisions of the steps that run on a tape.

    ``leaf`` runs the steps with given first decisions, and returns their result.
    """
    tree = leaf(decided)
    made = tape.decisions[:]
    for number in reversed(range(len(decided), len(made))):
        condition, held = made[number]
        if condition.name == 'finite':
            continue
        opposite = tree_below(
            tape, (*(decision.held for decision in made[:number]), not held), leaf
        )
        if tree != opposite:
            tree = DecisionBranch(
                condition, *((tree, opposite) if held else (opposite, tree)), held
            )
    return tree


def fallback_statuses(closure: Closure, path: Path) -> tuple[Tree, ...]:
    """
    Return, for each decision of a path, the status of the linkage if the decision differs.

    The first step that is not closed gives the status. If that step has a pose, as at a toggle,
    a later step may have a worse status. None if the steps continue on another path, and
    only they give the status. The path is traced without limits.
    """
    tape = path.tape
    inputs: list[Any] = [
        Symbol(tape, driven) for driven in path.inputs[: len(closure.linkage.inputs)]
    ]
    tape.reset_decisions()
    known = closure.initial_state(*inputs)
    settled: dict[int, bool] = {}
    of_steps: list[Tree] = []
    for step in closure.steps:
        leaf = partial(
            _status_of, step, known, (len(known.coordinates), len(known.pins)), tape, settled
        )
        leaf(())
        made = tape.decisions
        held: tuple[bool, ...] = ()
        for decision in made:
            # Where cells do not lead to the links, only an iteration that takes its time decides.
            undecided = step.grid is not None
            of_steps.append(
                None if undecided else tree_below(tape, (*held, not decision.held), leaf)
            )
            held = (*held, decision.held)
        # Each step starts from the ones before it, which are not run again.
        leaf(())
        settled |= {condition.number: holds for condition, holds in made}
    # The rates begin where the links are closed.
    fallback = chain(of_steps, repeat(None))
    return tuple(
        Status.INDETERMINATE if condition.name == 'finite' else next(fallback)
        for condition, _ in path.decisions
    )


def _status_of(
    step: Step,
    solved: LinkState,
    count: tuple[int, int],
    tape: Tape,
    settled: dict[int, bool],
    decided: tuple[bool, ...],
) -> Status | None:
    """Return the status of a step with given first decisions; None if it is closed."""
    # What the step appended before.
    coordinates, pins = count
    del solved.coordinates[coordinates:]
    del solved.pins[pins:]
    tape.reset_decisions(decided, settled)
    try:
        status = step.close(solved).status
    except UndecidedError:
        return None
    return None if status is Status.CLOSED else status
