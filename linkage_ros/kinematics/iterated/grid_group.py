# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
A group of links that close only together, as a function of its inputs.

What a `Grid` asks for is here: the proof that a start leads to one solution, the solution, and its
derivatives by the inputs. Each is straight-line code, with the steps before the group in it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from itertools import combinations_with_replacement
from math import inf
from typing import Any

from linkage_ros.kinematics.arithmetic import SMALLEST, UndecidedError, where
from linkage_ros.kinematics.built_once import BuiltProperty
from linkage_ros.kinematics.iterated.elimination import add, Elimination, multiply, subtract
from linkage_ros.kinematics.iterated.grid import Grid, GridInput, LineForms
from linkage_ros.kinematics.iterated.group import (
    Equations,
    GroupMotion,
    GroupPose,
    IteratedGroup,
    require_state,
)
from linkage_ros.kinematics.iterated.newton_system import NewtonSystem
from linkage_ros.kinematics.iterated.steps_before import StepsBefore
from linkage_ros.kinematics.iterated.straight_line import StraightLine
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState

_SECOND = 8.0
"""How often the next step at most is in the unit of an unknown."""

_LAST_STEP = 2.0**-36
"""Sum of the last changes by Newton's method, in [rad] and lengths: the next is a rounding."""

_LEAST_STEP = 2.0**-20
"""The same of a solution next to a singularity, where the rounding is greater."""

_SHORT = 2.0**-30
"""Links that are too short by less may close, as lengths are rounded."""

_SINGULAR = 1e-11
"""Least ratio of smallest to largest singular value at which rates exist."""

_TOGGLE = 2.0**-43
"""How far a toggle may be from where the way to its inputs ends, relative to their size."""

_HALFWAY, _MOST_STEPS = 2.0**-21, 6
"""Sum of the last changes but one, whose square is a rounding; and most steps of the method."""


class GridGroup(IteratedGroup):
    """
    Equations after the steps ``before``.

    ``start`` has the free unknowns in the pose, ``given_inputs`` are all inputs.
    """

    def __init__(
        self,
        equations: Equations,
        before: StepsBefore,
        start: Sequence[float],
        inputs: Sequence[int],
        given_inputs: Sequence[GridInput],
        system: NewtonSystem,
    ) -> None:
        super().__init__(equations, before, start, inputs)
        self._given_inputs, self._system = given_inputs, system
        self._shortfalls_line = self._compile_later(self._list_shortfalls)
        self._proof_line = self._compile_later(self._list_proof)
        self._step_line = self._compile_later(self._list_step)
        self._forms_line = self._compile_later(self._list_forms)
        self._line_forms_line = self._compile_later(self._list_line_forms, self.inputs)

    def _compile_later(
        self, function: Callable[..., list[Any]], moving: Sequence[int] = ()
    ) -> StraightLine:
        """
        Return a function of all inputs, the unknowns and the rates of inputs as a straight line.

        It takes the inputs of the group, and rates of those that are ``moving``; those on which
        nothing depends are as in the pose.
        """

        def compute(inputs: Sequence[Any], unknowns: Sequence[Any], *rates: Any) -> list[Any]:
            values: list[Any] = [*self._before.inputs]
            for k, value in zip(self.inputs, inputs, strict=True):
                values[k] = value
            return function(LinkState(values, []), LinkState([*unknowns], []), *rates)

        home = [self._before.inputs[k] for k in self.inputs]
        rates = [[1.0] * len(moving)] if moving else []
        return StraightLine(compute, lambda: (home, [*self._start], *rates))

    @BuiltProperty
    def grid(self) -> Grid:
        """Return the cells from which the equations are solved."""
        inputs = [self._given_inputs[k] for k in self.inputs]
        return Grid(self, inputs, self.inputs, self._start, self.halvings)

    @BuiltProperty
    def _step_count(self) -> int:
        """Return how many steps of Newton's method suffice at the corners about the pose."""
        most = 2
        for inputs, unknowns in self.grid.home_corners():
            count, size, values = 0, inf, unknowns
            while size > _HALFWAY and count < _MOST_STEPS:
                step = self._step_line(inputs, values)
                if step is None:
                    break
                size, count = sum(map(abs, step)), count + 1
                values = [a - b for a, b in zip(values, step, strict=True)]
            most = max(most, count)
        return most

    def close_straight(self, known: LinkState) -> GroupPose:
        """Return the links as straight lines; an UndecidedError is raised where none is."""
        return self._pose_at(known, self._straight_solution(known))

    def _straight_solution(self, known: LinkState) -> list[Any]:
        """
        Return the unknowns: steps of Newton's method, and one more with the last slopes.

        An UndecidedError is raised where no cell is, or where the last step is more than rounding.
        """
        values = self.grid.find_start([known.coordinates[1 + k] for k in self.inputs])
        if values is None:
            raise UndecidedError
        step: Sequence[Any] = ()
        for _ in range(self._step_count if self.steps is None else self.steps):
            errors, solve = self._equations.linearize(known, values)
            step = solve(errors)
            values = [subtract(value, change) for value, change in zip(values, step, strict=True)]
        if self.steps is not None:
            return values
        step = solve(self._equations.errors(known, values))
        if not sum(map(abs, step[1:]), abs(step[0])) <= _LAST_STEP:
            raise UndecidedError
        return [subtract(value, change) for value, change in zip(values, step, strict=True)]

    def _find_slowly(self, solved: LinkState) -> GroupPose:
        """Return the links where no straight line leads to them, as next to a singularity."""
        inputs = [solved.coordinates[1 + k] for k in self.inputs]
        short = self.shortfall(inputs)
        if short:
            unknowns = self._equations.complete(self._start, solved)
            return GroupPose(Status.OPEN, unknowns, (), short)
        start = self.grid.find_start(inputs)
        if start is not None and (solution := self.solve_from(inputs, start)) is not None:
            return self._pose_at(solved, solution)
        turned, gains = self.grid.turn_back(inputs)
        cell, left = self.grid.reach(turned)
        values = [value + gain for value, gain in zip(cell.unknowns, gains, strict=True)]
        unknowns = self._equations.complete(values, solved)
        if not left and self._system.conditioning(solved, unknowns) > _SINGULAR:
            return self._pose_at(solved, values)
        nearest, gap = self._system.nearest(solved, unknowns)
        if left <= _TOGGLE * (1.0 + max(map(abs, turned))):
            return GroupPose(Status.TOGGLE, nearest, [0.0] * len(nearest))
        return GroupPose(Status.OPEN, nearest, (), gap)

    def _pose_at(self, solved: LinkState, values: Sequence[Any]) -> GroupPose:
        unknowns = self._equations.complete(values, solved)
        return GroupPose(Status.CLOSED, unknowns, [0.0] * len(unknowns))

    # What the grid asks for; inputs on which nothing depends are as in the pose

    def shortfall(self, inputs: Sequence[float]) -> float:
        """Return by how much links are too short to close by any unknowns; 0 if none is known."""
        short = max(self._shortfalls_line(inputs, self._start) or (), default=0.0)
        return short if short > _SHORT else 0.0

    def proof(self, inputs: Sequence[float], unknowns: Sequence[float]) -> float:
        """
        Return η·ω of Kantorovich's theorem; infinite where there is none.

        The norm is the largest change of an unknown: all in one unit, the largest step; or each in
        its own, its step and some times what the next may be at most. The better one counts.
        """
        numbers = self._proof_line(inputs, unknowns)
        return numbers[0] if numbers else inf

    def solve_from(
        self, inputs: Sequence[float], unknowns: Sequence[float]
    ) -> Sequence[float] | None:
        """Return the solution that Newton's method leads to, until no step is shorter."""
        values, last = [*unknowns], inf
        while True:
            step = self._step_line(inputs, values)
            size = sum(map(abs, step)) if step else inf
            if step is None or not size < last:
                return values if last <= _LEAST_STEP else None
            values, last = [a - b for a, b in zip(values, step, strict=True)], size

    def forms_at(
        self, inputs: Sequence[float], unknowns: Sequence[float]
    ) -> tuple[list[Sequence[float]], list[Sequence[float]]] | None:
        """Return slopes and bends at a solution, as a cell has them."""
        numbers = self._forms_line(inputs, unknowns)
        if numbers is None:
            return None
        size = len(unknowns)
        rows: list[Sequence[float]] = [*zip(*[iter(numbers)] * size, strict=True)]
        count = len(inputs)
        return rows[:count], rows[count:]

    def forms_along(
        self, inputs: Sequence[float], unknowns: Sequence[float], direction: Sequence[float]
    ) -> LineForms | None:
        """Return slopes and bends at a solution while the inputs go in a direction."""
        numbers, count = self._line_forms_line(inputs, unknowns, direction), len(unknowns)
        return None if numbers is None else (numbers[:count], numbers[count:])

    # The functions of the straight lines

    def _list_shortfalls(self, at: LinkState, _pose: LinkState) -> list[Any]:
        return self._equations.shortfalls(require_state(self._before.known_at(at.coordinates)))

    def _list_step(self, at: LinkState, pose: LinkState) -> list[Any]:
        """Return a step of Newton's method."""
        known = require_state(self._before.known_at(at.coordinates))
        errors, solve = self._equations.linearize(known, pose.coordinates)
        return solve(errors)

    def _list_proof(self, at: LinkState, pose: LinkState) -> list[Any]:
        """Return η·ω, by the size of a step of Newton's method, of the inverse and of bends."""
        known = require_state(self._before.known_at(at.coordinates))
        unknowns, count = pose.coordinates, len(pose.coordinates)
        errors, solve = self._equations.linearize(known, unknowns)
        steps = [abs(step) + SMALLEST for step in solve(errors)]
        inverse = [
            [abs(entry) for entry in solve([float(i == k) for i in range(count)])]
            for k in range(count)
        ]
        bounds = [
            [abs(bend) for bend in self._equations.bound_bends(k, known, unknowns)]
            for k in range(count)
        ]

        def changes_by(bends: Sequence[Any]) -> list[Any]:
            """Return how much a step changes if the equations bend by so much."""
            return [_sum_products(row, bends) for row in zip(*inverse, strict=True)]

        def ratios_within(units: Sequence[Any]) -> list[Any]:
            """Return how much the matrix, and so the step, may change by these changes."""
            squares = [a * b for a, b in combinations_with_replacement(units, 2)]
            return changes_by([_sum_products(bound, squares) for bound in bounds])

        even = _greatest(steps) * _greatest(changes_by([reduce(add, bound) for bound in bounds]))
        units = [a + _SECOND * b for a, b in zip(steps, ratios_within(steps), strict=True)]
        fitted = _greatest([a / b for a, b in zip(ratios_within(units), units, strict=True)])
        return [where(fitted < even, fitted, even)]

    def _list_line_forms(
        self, at: LinkState, pose: LinkState, direction: Sequence[Any]
    ) -> list[Any]:
        rates = LinkState([0.0] * len(at.coordinates), [])
        for k, rate in zip(self.inputs, direction, strict=True):
            rates.coordinates[k] = rate
        matrix = self._eliminate(at, pose)
        slopes = self._list_rates(at, pose, rates, matrix)
        bends = self._list_bends(at, pose, rates, slopes, matrix)
        return [*self._free_of(slopes), *(0.5 * bend for bend in bends)]

    def _free_of(self, values: Sequence[Any]) -> list[Any]:
        return [values[k] for k in self._equations.free]

    def _eliminate(self, at: LinkState, pose: LinkState) -> Elimination:
        known = require_state(self._before.known_at(at.coordinates))
        return self._equations.eliminate(known, self._equations.complete(pose.coordinates, known))

    def _list_rates(
        self, at: LinkState, pose: LinkState, rates: LinkState, matrix: Elimination
    ) -> list[Any]:
        """Return the rates of all unknowns at rates of the inputs."""
        states = self._before.states_at(at.coordinates, rates.coordinates)
        known, velocities = require_state(states)
        unknowns = self._equations.complete(pose.coordinates, known)
        still = [0.0] * len(unknowns)
        motion = GroupMotion(unknowns, known, still, velocities)
        return self._equations.solve_motion(motion, matrix)

    def _list_bends(
        self,
        at: LinkState,
        pose: LinkState,
        rates: LinkState,
        slopes: Sequence[Any],
        matrix: Elimination,
    ) -> list[Any]:
        """Return the accelerations of the free unknowns at steady rates of the inputs."""
        steady = [0.0] * len(at.coordinates)
        states = self._before.states_at(at.coordinates, rates.coordinates, steady)
        known, velocities, changes = require_state(states)
        unknowns = self._equations.complete(pose.coordinates, known)
        still = [0.0] * len(unknowns)
        motion = GroupMotion(unknowns, known, slopes, velocities, still, changes)
        return self._free_of(self._equations.solve_motion(motion, matrix))

    def _list_forms(self, at: LinkState, pose: LinkState) -> list[Any]:
        """Return slopes and bends: rates and accelerations along one input, or along two."""
        # One matrix for all inputs: their number squared is how often it would be eliminated.
        matrix, slopes = self._eliminate(at, pose), list[Any]()
        squares: dict[tuple[int, int], list[Any]] = {}
        alone: dict[int, list[Any]] = {}

        def rates_along(*inputs: int) -> LinkState:
            return LinkState([float(k in inputs) for k in range(len(at.coordinates))], [])

        for first in self.inputs:
            alone[first] = self._list_rates(at, pose, rates_along(first), matrix)
            slopes += self._free_of(alone[first])
        for first, second in combinations_with_replacement(self.inputs, 2):
            along, slope = rates_along(first, second), alone[first]
            if first != second:
                slope = [a + b for a, b in zip(slope, alone[second], strict=True)]
            squares[first, second] = self._list_bends(at, pose, along, slope, matrix)
        bends = []
        for (first, second), both in squares.items():
            if first == second:
                bends += [0.5 * value for value in both]
            else:
                # Along both inputs at once: twice what is mixed, and what each has alone.
                squares_of_pair = zip(
                    both, squares[first, first], squares[second, second], strict=True
                )
                bends += [0.5 * (value - a - b) for value, a, b in squares_of_pair]
        return [*slopes, *bends]


def _sum_products(first: Sequence[Any], second: Sequence[Any]) -> Any:
    return reduce(add, map(multiply, first, second))


def _greatest(values: Sequence[Any]) -> Any:
    """Return the greatest of numbers, without a decision."""
    return reduce(lambda most, value: where(value > most, value, most), values)
