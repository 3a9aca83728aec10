# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""What is asked of equations that close only together, and what they answer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import prod
from typing import Any, NamedTuple, TypeVar

from linkage_ros.kinematics.arithmetic import SMALLEST, UndecidedError
from linkage_ros.kinematics.built_once import BUILD_LOCK
from linkage_ros.kinematics.compiling import Tape
from linkage_ros.kinematics.iterated.elimination import Elimination, is_zero
from linkage_ros.kinematics.iterated.steps_before import StepsBefore
from linkage_ros.kinematics.iterated.straight_line import StraightLine
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState

T = TypeVar('T')
Solve = Callable[[Sequence[Any]], list[Any]]

_REMEMBERED = 1024
"""Most states that are kept, of those that straight lines do not lead to."""


class GroupPose(NamedTuple):
    """The unknowns at a state, and what they gain by the turns before; nothing if it is open."""

    status: Status
    unknowns: Sequence[Any]
    gained: Sequence[Any]
    gap: float = 0.0  # If they do not close, in lengths


class GroupMotion(NamedTuple):
    """
    The unknowns and the links solved before them, their rates, and their accelerations if wanted.

    The highest derivatives of the unknowns may be 0: the constraints then tell what these lack.
    """

    unknowns: Sequence[Any]
    solved: LinkState
    rates: Sequence[Any]
    solved_rates: LinkState
    accelerations: Sequence[Any] = ()
    solved_accelerations: LinkState | None = None

    @property
    def highest(self) -> tuple[Sequence[Any], LinkState]:
        """Return the highest derivatives by time."""
        if self.solved_accelerations is None:
            return self.rates, self.solved_rates
        return self.accelerations, self.solved_accelerations


class Equations:
    """
    As many equations as unknowns, for numbers and symbols; ``known`` has the steps before.

    The ``closing`` equations are solved for the ``free`` unknowns; ``unit_pivots`` of the matrix,
    as `Elimination` takes them, give the others.
    """

    closing: Sequence[int]
    free: Sequence[int]
    angles: Sequence[bool]
    """For each unknown whether it is an angle."""
    unit_pivots: Sequence[tuple[int, int]] = ()

    # The equations by all unknowns

    def evaluate(
        self, known: LinkState, unknowns: Sequence[Any]
    ) -> tuple[list[Any], list[list[Any]]]:
        """Return the errors, and their derivatives by the unknowns, as rows."""
        raise NotImplementedError

    def drift(self, motion: GroupMotion) -> list[Any]:
        """Return the highest derivative of the errors, of a motion that has 0 for the unknowns."""
        raise NotImplementedError

    def bound_changes(
        self, known: LinkState, unknowns: Sequence[float]
    ) -> Callable[[Sequence[float]], Sequence[Sequence[float]]]:
        """
        Return a function that bounds the change of the derivatives by unknowns, entry by entry.

        It takes the largest change of each unknown, in either direction.
        """
        raise NotImplementedError

    def is_meshed(self, _off: Sequence[float], _part: float) -> bool:
        """Return whether the errors of ratios are off by less than a part of their periods."""
        return True

    def error_units(self, _known: LinkState) -> Sequence[float]:
        """Return for each error by what it is divided to be a length, in lengths."""
        return [1.0] * len(self.angles)

    def shortfalls(self, _known: LinkState) -> list[Any]:
        """Return lengths by which parts are known to be too short to close, where positive."""
        return []

    def missing_length(self, _known: LinkState) -> float | None:
        """Return by how much a part has no length; None if all have some."""
        return None

    def eliminate(self, known: LinkState, unknowns: Sequence[Any]) -> Elimination:
        """Return the matrix of all motions of a state."""
        return Elimination(self.evaluate(known, unknowns)[1], self.unit_pivots)

    def solve_motion(self, motion: GroupMotion, matrix: Elimination) -> list[Any]:
        """Return the highest derivatives of the unknowns, of a motion that has 0 for them."""
        drift = self.drift(motion)
        return matrix.solve([0.0 if is_zero(row) else -row for row in drift])

    # The closing equations by the free unknowns

    def complete(self, values: Sequence[Any], _known: LinkState) -> list[Any]:
        """Return all unknowns, from those that are free."""
        return [*values]

    def errors(self, known: LinkState, values: Sequence[Any]) -> list[Any]:
        """Return how far each equation is from being met."""
        errors, _ = self.evaluate(known, self.complete(values, known))
        return [errors[row] for row in self.closing]

    def linearize(self, known: LinkState, values: Sequence[Any]) -> tuple[list[Any], Solve]:
        """
        Return the errors, and a function that solves with the matrix of their derivatives.

        An UndecidedError is raised if that is singular.
        """
        errors, rows = self.evaluate(known, self.complete(values, known))
        matrix = Elimination(rows, self.unit_pivots)
        divisors = matrix.divisors
        if divisors and not abs(prod(divisors[1:], start=divisors[0])) > SMALLEST:
            raise UndecidedError

        def solve(right: Sequence[Any]) -> list[Any]:
            whole = [0.0] * len(errors)
            for row, value in zip(self.closing, right, strict=True):
                whole[row] = value
            solution = matrix.solve(whole)
            return [solution[k] for k in self.free]

        return [errors[row] for row in self.closing], solve

    def bound_bends(self, number: int, known: LinkState, values: Sequence[Any]) -> list[Any]:
        """Return bounds of an equation's second derivatives, by all pairs of unknowns."""
        raise NotImplementedError

    # The links, as coordinates and pins

    def place(self, known: LinkState, unknowns: Sequence[Any], gained: Sequence[Any]) -> LinkState:
        """Return the links; ``gained`` is added to the unknowns."""
        raise NotImplementedError

    def move(self, motion: GroupMotion) -> LinkState:
        """Return the highest derivative of the links."""
        raise NotImplementedError

    def list_places(self, known: LinkState, unknowns: Sequence[float]) -> list[complex]:
        """Return numbers in which two solutions differ if a link lies elsewhere, in lengths."""
        raise NotImplementedError


class IteratedGroup:
    """
    Equations after the steps ``before``, as a function of the inputs with the numbers ``inputs``.

    ``start`` has unknowns in the pose.
    """

    steps: int | None = None
    """Steps of Newton's method; None: as many as end within the rounding."""

    halvings = 0
    """How often the cells are halved that the method starts from."""

    def __init__(
        self,
        equations: Equations,
        before: StepsBefore,
        start: Sequence[float],
        inputs: Sequence[int],
    ) -> None:
        self._equations, self._before, self._start = equations, before, tuple(start)
        self.inputs = tuple(inputs)
        self._slow: dict[tuple[float, ...], GroupPose] = {}

    def close_straight(self, known: LinkState) -> GroupPose:
        """
        Return the links as straight lines: without unknowns where they do not close.

        All decisions are by symbols. Where they leave it open how the links lie, `UndecidedError`
        is raised.
        """
        raise NotImplementedError

    def remembered_pose(self, solved: LinkState) -> GroupPose | None:
        """Return the links of a state that straight lines did not lead to before."""
        return self._slow.get(self._key_of(solved))

    def close_slowly(self, solved: LinkState) -> GroupPose:
        """
        Return the links where straight lines do not lead to them, as next to a toggle.

        What is found is kept: a command beyond reach may last.
        """
        pose = self._find_slowly(solved)
        with BUILD_LOCK:
            if len(self._slow) >= _REMEMBERED:
                del self._slow[next(iter(self._slow))]
            self._slow[self._key_of(solved)] = pose
        return pose

    def _find_slowly(self, solved: LinkState) -> GroupPose:
        raise NotImplementedError

    def _key_of(self, solved: LinkState) -> tuple[float, ...]:
        return tuple([solved.coordinates[1 + k] for k in self.inputs])


def find_inputs(
    equations: Equations, before: StepsBefore, start: Sequence[float]
) -> tuple[int, ...]:
    """Return the numbers of the inputs that equations depend on; ``start`` is free unknowns."""
    tape, count = Tape(), len(before.inputs)
    symbols: list[Any] = [tape.add_input(f'q{k}', x) for k, x in enumerate(before.inputs)]
    try:
        waiting: list[Any] = equations.errors(require_state(before.known_at(symbols)), start)
    except UndecidedError:
        return tuple(range(count))
    waiting = [number.operation for number in waiting if hasattr(number, 'operation')]
    seen: set[Any] = set()
    while waiting:
        operation = waiting.pop()
        if operation not in seen:
            seen.add(operation)
            waiting += operation.operands()
    return tuple(k for k in range(count) if symbols[k].operation in seen)


def compile_later(function: Callable[..., list[float]], *kinds: LinkState) -> StraightLine:
    """Return a function as straight-line code, compiled at its first call for such states."""
    return StraightLine(function, lambda: kinds)


def require_state(state: T | None) -> T:
    """Return what the steps before have; UndecidedError is raised where they have none."""
    if state is None:
        raise UndecidedError
    return state
