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

"""What becomes of a linkage where it leaves a path: which status it has there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TYPE_CHECKING, TypeAlias

from linkage_ros.kinematics.compiling.tape import Operation, Symbol
from linkage_ros.kinematics.compiling.trace import Path
from linkage_ros.kinematics.status import Status

if TYPE_CHECKING:
    from linkage_ros.kinematics.closure import Closure


class Fork(NamedTuple):
    """A condition, and what becomes of the linkage where it holds and where it does not."""

    condition: Operation
    held: Fate
    failed: Fate


Fate: TypeAlias = Status | Fork | None
"""A status; or nothing, where the steps go on in another way and only they can tell."""


def fates(closure: Closure, path: Path) -> tuple[Fate, ...]:
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


def _fate(closure: Closure, path: Path, decided: Sequence[bool]) -> Fate:
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
