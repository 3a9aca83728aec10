# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""Newton's method on equations for numbers, and how near they come where they do not close."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import inf, isnan, nan
from operator import add, sub

from linkage_ros.kinematics.arithmetic import UNIT_ROUNDOFF
from linkage_ros.kinematics.batch import Array
from linkage_ros.kinematics.iterated.group import Equations
from linkage_ros.kinematics.iterated.steps_before import StepsBefore
from linkage_ros.kinematics.iterated.straight_line import StraightLine
from linkage_ros.kinematics.step import LinkState
import numpy as np

_ACCEPTED = 256.0 * UNIT_ROUNDOFF
"""Largest residual of a constraint at a solution, relative to the size of the coordinates."""

_MOVED = 2.0**-20
"""A gap that shrinks to less, relative to itself, is closed by another assembly."""


class NewtonSystem:
    """Equations whose known links have ``sizes``: the numbers of their coordinates and pins."""

    def __init__(self, equations: Equations, sizes: tuple[int, int]) -> None:
        self._equations, self._sizes = equations, sizes
        self._line = StraightLine(self._list_system, lambda: None)

    def known_part(self, state: LinkState) -> LinkState:
        """Return what a state has of the links before."""
        coordinates, pins = self._sizes
        return LinkState(state.coordinates[:coordinates], state.pins[:pins])

    def evaluate(self, known: LinkState, unknowns: Array) -> tuple[Array, Array]:
        """Return the residuals, and their derivatives by the unknowns."""
        errors, jacobian = self._evaluate_lists(known, unknowns.tolist())
        return np.array(errors), jacobian

    def _evaluate_lists(
        self, known: LinkState, unknowns: Sequence[float]
    ) -> tuple[list[float], Array]:
        n = len(unknowns)
        numbers = self._line(self.known_part(known), LinkState([*unknowns], []))
        if numbers is None:
            return [inf] * n, np.full((n, n), inf)
        return numbers[:n], np.array(numbers[n:]).reshape(n, n)

    def _list_system(self, known: LinkState, pose: LinkState) -> list[float]:
        errors, rows = self._equations.evaluate(known, pose.coordinates)
        return [*errors, *(slope for row in rows for slope in row)]

    def solve(self, known: LinkState, start: Array, farthest: float) -> Array | None:
        """Return the solution within a distance of a start, in [rad] or lengths."""
        return solve_newton(partial(self._evaluate_lists, known), start, farthest)

    def solution_in_pose(self, before: StepsBefore, start: Array) -> Array | None:
        """Return the solution in the pose, near a start."""
        known = before.known_at(before.inputs)
        return None if known is None else self.solve(known, start, inf)

    def conditioning(self, known: LinkState, unknowns: Sequence[float]) -> float:
        """Return the ratio of the Jacobian's smallest singular value to its largest."""
        return _reciprocal_condition(self._evaluate_lists(known, unknowns)[1])

    def nearest(self, known: LinkState, start: Sequence[float]) -> tuple[list[float], float]:
        """
        Return how near the links come, descending from the end of their assembly.

        If they would close, but in another assembly or after another number of turns, the closure
        error is the one at that end.
        """
        units = np.array(self._equations.error_units(known))

        def system(values: Array) -> tuple[Array, Array]:
            errors, jacobian = self.evaluate(known, values)
            return errors / units, jacobian / units[:, None]

        begin = np.array(start)
        first = float(np.abs(system(begin)[0]).max())
        unknowns, gap = _descend(system, begin)
        return unknowns.tolist(), gap if gap > _MOVED * first else first


def solve_newton(
    evaluate: Callable[[list[float]], tuple[list[float], Array]], start: Array, farthest: float
) -> Array | None:
    """
    Return the solution that Newton's method leads to, within a distance of a start.

    ``evaluate`` gives the residuals and their derivatives by the unknowns.
    """
    # Lists: for so few numbers the overhead of an array exceeds the arithmetic.
    begin = start.tolist()
    unknowns, last = begin, inf
    size = 1.0 + _greatest_magnitude(begin)
    for _ in range(30):
        errors, jacobian = evaluate(unknowns)
        try:
            step = np.linalg.solve(jacobian, np.negative(errors)).tolist()
        except np.linalg.LinAlgError:
            return None
        length = _greatest_magnitude(step)
        if length >= last or length <= 4.0 * UNIT_ROUNDOFF * size:
            good = _greatest_magnitude(errors) <= _ACCEPTED * size
            return np.array(unknowns) if good else None
        unknowns, last = list(map(add, unknowns, step)), length
        if not _greatest_magnitude(list(map(sub, unknowns, begin))) <= farthest:
            return None
    return None


def _greatest_magnitude(values: Sequence[float]) -> float:
    """Return the greatest absolute value; NaN if any value is NaN."""
    return nan if isnan(sum(values)) else max(map(abs, values))


def _descend(
    system: Callable[[Array], tuple[Array, Array]], unknowns: Array
) -> tuple[Array, float]:
    """
    Return the unknowns of the least residual near some, and the greatest of it.

    It is infinite where numbers overflow.
    """
    errors, jacobian = system(unknowns)
    for _ in range(20):
        if not (np.isfinite(errors).all() and np.isfinite(jacobian).all()):
            return unknowns, inf
        step = np.linalg.lstsq(jacobian, -errors, rcond=1e-6)[0]
        step *= min(1.0, 0.1 / max(float(np.abs(step).max()), 1e-300))
        trial, slope = system(unknowns + step)
        if np.abs(trial).max() >= np.abs(errors).max():
            break
        unknowns, errors, jacobian = unknowns + step, trial, slope
    return unknowns, float(np.abs(errors).max())


def _reciprocal_condition(jacobian: Array) -> float:
    """Return the ratio of the smallest singular value to the largest; 0 if numbers overflow."""
    if not np.isfinite(jacobian).all():
        return 0.0
    values = np.linalg.svd(jacobian, compute_uv=False)
    return float(values[-1] / values[0])
