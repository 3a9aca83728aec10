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

"""A linkage's steps, run on symbols along one path of decisions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TYPE_CHECKING, TypeAlias

from linkage_ros.kinematics.compiling.tape import Decision, Operation, Symbol, Tape
from linkage_ros.kinematics.status import Status

if TYPE_CHECKING:
    from linkage_ros.kinematics.results import Acceleration, LoopClosure, Position, Velocity


Number = Operation | float
"""What a program returns: an operation, or a constant."""


class Motion(NamedTuple):
    """A linkage on symbols, as far as it was asked for."""

    position: Position
    velocity: Velocity | None
    acceleration: Acceleration | None


Wanted = Callable[[Motion], Sequence[Sequence[float]]]
"""Picks out of a motion the numbers that a program returns, in groups."""


class Path(NamedTuple):
    """
    What the steps do as long as they decide alike.

    Attributes
    ----------
    inputs
        The driven joints' values, then their rates and their accelerations, as far as asked for.
    decisions
        In order. Where one falls otherwise the path does not hold.
    outputs
        What it returns, in groups.
    tape
        What it is written on.

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
        What is worked out: positions (0), velocities too (1), and accelerations (2).
    wanted
        What of it the path returns.
    within_limits
        Whether the path ends where a joint is beyond its limits.

    Raises
    ------
    ValueError
        Where the linkage is not closed at that state.

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
    # What is wanted may decide, too.
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


def number_of(found: Any) -> Number:
    """Return the operation of a symbol, or the constant that a number is."""
    return found.operation if isinstance(found, Symbol) else found


# What becomes of a linkage where it leaves a path: which status it has there.


class Fork(NamedTuple):
    """A condition, and what becomes of the linkage where it holds and where it does not."""

    condition: Operation
    held: Fate
    failed: Fate


Fate: TypeAlias = Status | Fork | None
"""A status; or nothing, where the steps go on in another way and only they can tell."""


def fates(closure: LoopClosure, path: Path) -> tuple[Fate, ...]:
    """
    Return for each decision of a path what becomes of the linkage where it falls otherwise.

    The status is that of the first step that is not closed. Where that has a pose, as at a toggle,
    a later step may have a worse one.

    Parameters
    ----------
    closure
        The linkage.
    path
        As it was traced, without limits.

    """
    found: list[Fate] = []
    held: list[bool] = []
    for decision in path.decisions:
        if decision.condition.name == 'finite':
            found.append(Status.INDETERMINATE)
        else:
            found.append(_fate(closure, path, [*held, not decision.held]))
            held.append(decision.held)
    return tuple(found)


def _fate(closure: LoopClosure, path: Path, decided: Sequence[bool]) -> Fate:
    """Return the fate of a linkage whose first decisions fall as is said."""
    tape = path.tape
    tape.begin()
    inputs = path.inputs[: len(closure.linkage.inputs)]
    symbols: list[Any] = [Symbol(tape, given) for given in inputs]
    known = closure.known(*symbols)
    # The inputs are finite: what is decided begins with the first step.
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
