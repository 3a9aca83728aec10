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

"""The steps of a linkage, run on symbols along one path of decisions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TYPE_CHECKING, TypeAlias

from linkage_ros.kinematics.compiling.tape import Decision, Operation, Symbol, Tape
from linkage_ros.kinematics.status import Status

if TYPE_CHECKING:
    from linkage_ros.kinematics.results import Acceleration, LoopClosure, Position, Velocity


Number = Operation | float
"""A result of a program: an operation, or a constant."""


class Motion(NamedTuple):
    """The motion of a linkage on symbols, as far as requested."""

    position: Position
    velocity: Velocity | None
    acceleration: Acceleration | None


Wanted = Callable[[Motion], Sequence[Sequence[float]]]
"""Selects the numbers of a motion that a program returns, in groups."""


class Path(NamedTuple):
    """
    The operations of the steps while their decisions are the same.

    Attributes
    ----------
    inputs
        The values of the driven joints, then their rates and accelerations, if requested.
    decisions
        The decisions in order. If one of them differs, the path is not valid.
    outputs
        The returned numbers, in groups.
    tape
        The tape of the operations.

    """

    inputs: tuple[Operation, ...]
    decisions: tuple[Decision, ...]
    outputs: tuple[tuple[Number, ...], ...]
    tape: Tape


def joints(motion: Motion) -> Sequence[Sequence[float]]:
    """Return the published joints of a motion, with their rates and accelerations."""
    return [part.joints for part in motion if part is not None]


def traced(
    closure: LoopClosure,
    at: Sequence[float],
    derivatives: int,
    wanted: Wanted = joints,
    within_limits: bool = True,
) -> Path:
    """
    Return the path that the steps take at one state.

    Parameters
    ----------
    closure
        The linkage.
    at
        Values of its inputs, in [rad] or [m], at which it is closed.
    derivatives
        0: positions; 1: velocities too; 2: accelerations too.
    wanted
        Selects the numbers that the path returns.
    within_limits
        Whether the path ends if a joint is beyond its limits.

    Raises
    ------
    ValueError
        If the linkage is not closed at that state.

    """
    tape = Tape()
    given = [
        [tape.given(f'{letter}{i}', value) for i, value in enumerate(values)]
        for letter, values in zip('qwa', (at, [1.25] * len(at), [0.75] * len(at)), strict=True)
    ][: 1 + derivatives]
    tape.begin()
    motion = moved(closure, given, within_limits)
    if motion.position.status is not Status.CLOSED:
        raise ValueError(f'{list(at)}: the linkage is {motion.position.status.value} there')
    # The selection may make decisions, too.
    outputs = tuple(tuple(number_of(n) for n in group) for group in wanted(motion))
    inputs = tuple(symbol.operation for group in given for symbol in group)
    return Path(inputs, tuple(tape.decisions), outputs, tape)


def moved(
    closure: LoopClosure, given: Sequence[Sequence[Any]], within_limits: bool = True
) -> Motion:
    """Return the motion of a closure at inputs, rates and accelerations, as far as given."""
    inputs, *more = given
    position = closure.position(*inputs) if within_limits else closure.posed(*inputs)
    velocity = acceleration = None
    if more and position.status.has_rates:
        velocity = closure.velocity(position, *more[0])
        if len(more) > 1:
            acceleration = closure.acceleration(position, velocity, *more[1])
    return Motion(position, velocity, acceleration)


def number_of(number: Any) -> Number:
    """Return the operation of a symbol, or a constant as it is."""
    return number.operation if isinstance(number, Symbol) else number


# The fates of a path: the status of the linkage where it leaves the path.


class Fork(NamedTuple):
    """A condition, and the fates where it holds and where it fails."""

    condition: Operation
    held: Fate
    failed: Fate


Fate: TypeAlias = Status | Fork | None
"""A status; or None if the steps continue on another path, and only they give the status."""


def fates(closure: LoopClosure, path: Path) -> tuple[Fate, ...]:
    """
    Return, for each decision of a path, the fate of the linkage if the decision differs.

    The status is that of the first step that is not closed. If that step has a pose, as at a
    toggle, a later step may have a worse status.

    Parameters
    ----------
    closure
        The linkage.
    path
        The path, traced without limits.

    """
    result: list[Fate] = []
    held: list[bool] = []
    for decision in path.decisions:
        if decision.condition.name == 'finite':
            result.append(Status.INDETERMINATE)
        else:
            result.append(_fate(closure, path, [*held, not decision.held]))
            held.append(decision.held)
    return tuple(result)


def _fate(closure: LoopClosure, path: Path, decided: Sequence[bool]) -> Fate:
    """Return the fate of a linkage for its first decisions."""
    tape = path.tape
    tape.begin()
    inputs = path.inputs[: len(closure.linkage.inputs)]
    symbols: list[Any] = [Symbol(tape, given) for given in inputs]
    known = closure.known(*symbols)
    # The inputs are finite: the first decision is that of the first step.
    tape.begin(decided)
    fate: Fate = None
    for step in closure.steps:
        status = step.close(known).status
        if status is not Status.CLOSED:
            fate = status
            break
        if len(tape.decisions) >= len(decided):
            break
    count = len(decided)
    made = tape.decisions[count:]
    for number in reversed(range(len(made))):
        before = [*decided, *(decision.held for decision in made[:number])]
        other = _fate(closure, path, [*before, not made[number].held])
        condition, held = made[number]
        fate = Fork(condition, fate, other) if held else Fork(condition, other, fate)
    return fate
