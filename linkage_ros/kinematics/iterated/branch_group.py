# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Links that close only together by one input: they follow their branch.

The `Branch` is followed once, so that a state depends only on its input and not on where the
linkage was before. Newton's method starts from a table of it, and two steps end within the
rounding: a straight line without a library, which a tape records. Only next to a toggle numpy
iterates, until no step is shorter; a solution farther from the branch than its cell allows is
rejected.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from math import inf, tau
from typing import NamedTuple

from linkage_ros.kinematics.arithmetic import UndecidedError
from linkage_ros.kinematics.batch import Array, Mask
from linkage_ros.kinematics.built_once import BuiltProperty
from linkage_ros.kinematics.iterated.branch import Branch, Continuation, is_repeated
from linkage_ros.kinematics.iterated.group import (
    compile_later,
    Equations,
    GroupMotion,
    GroupPose,
    IteratedGroup,
    require_state,
)
from linkage_ros.kinematics.iterated.newton_system import NewtonSystem, solve_newton
from linkage_ros.kinematics.iterated.start_table import make_start_table, StartTable
from linkage_ros.kinematics.iterated.steps_before import StepsBefore
from linkage_ros.kinematics.iterated.straight_line import StraightLine
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState
import numpy as np

_LAST_STEP = 2.0**-28
"""
Sum of the last changes by Newton's method, in [rad] and lengths: the next is below the rounding.

Near a toggle the method converges more slowly by the same factor by which the rounding is greater.
"""


class FollowedInput(NamedTuple):
    """The input that a branch is followed by."""

    number: int  # Among all inputs
    is_angle: bool
    far: float  # No slide needs to be longer to stretch a link, in lengths
    repeated_turns: int  # Whole turns after which the equations are the same; 0 if none are known


class BranchGroup(IteratedGroup):
    """
    Equations after the steps ``before``, by one input.

    ``start`` has roughly all unknowns in the pose.
    """

    def __init__(
        self,
        equations: Equations,
        before: StepsBefore,
        start: Sequence[float],
        followed: FollowedInput,
        system: NewtonSystem,
    ) -> None:
        super().__init__(equations, before, start, (followed.number,))
        self._followed, self._system = followed, system
        self.angles: Mask = np.array(equations.angles)
        """For each unknown whether it is an angle."""
        input_state, free = LinkState([before.inputs[followed.number]], []), [*equations.free]
        self._place_line = compile_later(self._list_place, input_state, LinkState([*start], []))
        values = LinkState([start[k] for k in free], [])
        self._unknowns_line = compile_later(self._list_unknowns, input_state, values)

    # The curve, as its continuation asks for it

    def known_at(self, x: float) -> LinkState | None:
        """Return the state of the steps before at the input; None where they do not close."""
        return self._before.known_at(self._all_inputs(x))

    def evaluate(self, place: Array) -> tuple[Array, Array] | None:
        """Return the residuals, and their derivatives by unknowns and input, if there are any."""
        *unknowns, x = place.tolist()
        numbers = self._numbers_at(self._place_line, x, unknowns)
        if numbers is None:
            return None
        n = len(unknowns)
        return np.array(numbers[:n]), np.array(numbers[n:]).reshape(n, n + 1)

    def bound_changes(self, place: Array) -> Callable[[Array], Array]:
        """Return a function that bounds the change of the derivatives by unknowns."""
        *unknowns, x = place.tolist()
        known = self.known_at(x)
        if known is None:
            return lambda _: np.full((len(unknowns), len(unknowns)), inf)
        bound = self._equations.bound_changes(known, unknowns)
        return lambda moved: np.array(bound(moved.tolist()))

    def is_meshed(self, off: Array, part: float) -> bool:
        """Return whether the residuals of ratios are off by less than a part of their periods."""
        return self._equations.is_meshed(off.tolist(), part)

    def _numbers_at(
        self, line: StraightLine, x: float, values: Sequence[float]
    ) -> list[float] | None:
        """Return the numbers of a line at an input, or None."""
        states = LinkState([x], []), LinkState([*values], [])
        numbers: list[float] | None = line(*states)
        if numbers is None:
            # The steps before may decide otherwise than in the pose.
            with suppress(UndecidedError):
                return [*line.function(*states)]
        return numbers

    def _list_place(self, input_state: LinkState, pose: LinkState) -> list[float]:
        """Return residuals, and the rows of their derivatives."""
        (x,) = input_state.coordinates
        rates = [float(k == self._followed.number) for k in range(len(self._before.inputs))]
        known, velocities = require_state(self._before.states_at(self._all_inputs(x), rates))
        errors, rows = self._equations.evaluate(known, pose.coordinates)
        still = [0.0] * len(pose.coordinates)
        motion = GroupMotion(pose.coordinates, known, still, velocities)
        drift = self._equations.drift(motion)
        return [*errors, *(x for row, d in zip(rows, drift, strict=True) for x in (*row, d))]

    def _list_unknowns(self, input_state: LinkState, values: LinkState) -> list[float]:
        (x,) = input_state.coordinates
        return self._equations.complete(values.coordinates, require_state(self.known_at(x)))

    def _all_inputs(self, x: float) -> list[float]:
        inputs = [*self._before.inputs]
        inputs[self._followed.number] = x
        return inputs

    # The branch, and where Newton's method starts on it

    @BuiltProperty
    def branch(self) -> Branch | None:
        """Return the branch of the pose; None if the pose leads to no solution."""
        solution = self._system.solution_in_pose(self._before, np.array(self._start))
        if solution is None:
            return None
        number, turning, far, turns = self._followed
        x = self._before.inputs[number]
        if turning and not is_repeated(self.known_at(x), self.known_at(x + tau * turns)):
            turns = 0
        return Branch(
            Continuation(self), solution, x, turning=turning, far=far, repeated_turns=turns
        )

    @BuiltProperty
    def _table(self) -> StartTable | None:
        """Return the table of starts; None if there is no branch."""
        branch = self.branch
        if branch is None:
            return None
        free = list(self._equations.free)

        def solution_at(x: float) -> Array | None:
            start = branch.find_start(x)
            unknowns = (
                start.unknowns if start is not None and start.is_end else self.solution_at(x)
            )
            return None if unknowns is None else unknowns[free]

        def converges(x: float, values: Array) -> bool:
            numbers = self._numbers_at(self._unknowns_line, x, values.tolist())
            if numbers is None:
                return False
            unknowns, length = np.array(numbers), inf
            for _ in range(2):
                errors, jacobian = self._system_at(x, unknowns.tolist())
                try:
                    step = np.linalg.solve(jacobian, errors)
                except np.linalg.LinAlgError:
                    return False
                unknowns, length = unknowns - step, float(np.abs(step[free]).sum())
            return length <= _LAST_STEP / 16.0

        return make_start_table(branch.pieces(), solution_at, converges, self.halvings)

    def solution_at(self, x: float) -> Array | None:
        """Return the unknowns at a value of the input; None outside the branch."""
        start = None if self.branch is None else self.branch.find_start(x)
        if start is None:
            return None
        return solve_newton(partial(self._system_at, x), start.unknowns, start.farthest)

    def _system_at(self, x: float, unknowns: Sequence[float]) -> tuple[list[float], Array]:
        """Return the residuals, and their derivatives by the unknowns; infinite if none."""
        n, numbers = len(unknowns), self._numbers_at(self._place_line, x, unknowns)
        if numbers is None:
            return [inf] * n, np.full((n, n), inf)
        return numbers[:n], np.array(numbers[n:]).reshape(n, n + 1)[:, :n]

    # The links at a state

    def close_straight(self, known: LinkState) -> GroupPose:
        """
        Return the links as straight lines: without unknowns where they do not close.

        All decisions are by symbols. Where they leave it open how the links lie, `UndecidedError`
        is raised.
        """
        branch, table = self.branch, self._table
        if branch is None or table is None:
            raise UndecidedError
        turns, x = branch.unwrap(known.coordinates[1 + self._followed.number])
        status = branch.status_at(x)
        if status is not Status.CLOSED:
            return GroupPose(status, (), ())
        values, farthest = table.find_start(x)
        chosen = self.steps
        for most in (farthest, _LAST_STEP) if chosen is None else [farthest] * chosen:
            errors, solve = self._equations.linearize(known, values)
            step = solve(errors)
            if not sum(map(abs, step[1:]), abs(step[0])) <= most:
                raise UndecidedError
            values = [value - change for value, change in zip(values, step, strict=True)]
        gained = [turns * by if by else 0.0 for by in branch.gained_angles]
        return GroupPose(status, self._equations.complete(values, known), gained)

    def _find_slowly(self, known: LinkState) -> GroupPose:
        """Return the links where straight lines do not lead to them, as next to a toggle."""
        x, branch = known.coordinates[1 + self._followed.number], self.branch
        start = None if branch is None else branch.find_start(x)
        if start is not None:
            gained = start.turned_angles.tolist()
            if start.is_end:
                # The Jacobian is singular here, so Newton's method would come no nearer.
                return GroupPose(Status.TOGGLE, start.unknowns.tolist(), gained)
            solution = self._system.solve(known, start.unknowns, start.farthest)
            if solution is not None:
                return GroupPose(Status.CLOSED, solution.tolist(), gained)
        end = None if branch is None else branch.nearest_end(x)
        nearest, gap = self._system.nearest(known, self._start if end is None else end.tolist())
        return GroupPose(Status.OPEN, nearest, (), gap)
