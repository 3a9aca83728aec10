# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Friction that grows with the force in its joint, and the forces that it changes.

The friction is T = µ·ρ·|F| in a pin of radius ρ, and T = µ·|F| in a slider, against the motion;
the moment that keeps a slider from turning does not count. By the balance of all links, the force
F in a joint is linear in the input's acceleration q̈ and in all these frictions::

    F = F₀ + q̈·F₁ + Σ T_k·P_k

If q̈ follows from them, as q̈ = p − Σ T_k·|ψ'_k|·sign(q̇)/I, it is found with them. Newton's
method finds the T_k from 0 on. Where there are none, the linkage jams (R. L. Norton, Design of
Machinery, ch. 11, on the friction circle; on self-locking F. Reuleaux, Theoretische Kinematik,
1875).

With several inputs F is linear in the acceleration of each, and in the friction of every joint,
which is then known by sticking or sliding (`linkage_ros.dynamics.several_freedoms`).

Both the balance and a Newton step are straight lines by an elimination of our own, so they have
the same bits on every machine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial, reduce
from itertools import islice
from math import hypot
from operator import add, mul, sub
from typing import Any, NamedTuple

from linkage_ros.dynamics.joint_matrix import compile_function, JointMatrix, split_numbers
from linkage_ros.kinematics import make_vector, where

_MOST_STEPS = 48
"""Most steps of Newton's method."""

_STAYS = 4e-15
"""Change at which a friction stays, as a fraction of what it is made of."""

Unknown = tuple[int, bool, float]
"""Of a joint: its first unknown, whether the next one presses too, and its factor."""


class FrictionSolver:
    """
    Finds the friction in joints by their forces.

    ``unknowns`` are the joints; their factor is µ·ρ, in [m], or µ. ``sides`` is the number of
    right sides of `forces_in`, and ``steps`` that of Newton's steps from one test to the next:
    three are usual.
    """

    def __init__(
        self, unknowns: Sequence[Unknown], matrix: JointMatrix, sides: int, steps: int
    ) -> None:
        self._unknowns, self._steps = unknowns, steps
        self._matrix = matrix
        self._sides = sides
        self._count = len(unknowns)

    @cached_property
    def _improve(self) -> Callable[..., Sequence[Sequence[float]] | None]:
        count = self._count
        return compile_function(self._improve_frictions, count * (3 + 2 * count))

    @cached_property
    def forces_in(self) -> Callable[..., Sequence[float] | None]:
        """
        Return a function that returns the force in each joint, x and y, for each right side.

        These follow the numbers of the matrix that vary: without this friction, by the
        acceleration of each input, and by a unit of each friction.
        """
        return self._matrix.compile_solver(self._sides, select=self._joint_forces)

    @cached_property
    def _solve_sides(self) -> Callable[..., Sequence[float] | None]:
        return self._matrix.compile_solver(1 + self._count)

    def _joint_forces(self, solutions: Sequence[Sequence[Any]]) -> list[Any]:
        forces: list[Any] = []
        for first, both, _ in self._unknowns:
            for solution in solutions:
                forces += (solution[first], solution[first + 1] if both else 0.0)
        return forces

    def solve_pressed(self, *numbers: float) -> list[float] | None:
        """
        Return the solution of the system with such friction, and the friction in each joint.

        The right sides in ``numbers`` are first without this friction, then of a unit of each.
        """
        flat = self._solve_sides(*numbers)
        if flat is None:
            return None
        free, *units = split_numbers(flat, len(self._matrix.columns))
        frictions = self.solve_by_forces(self._joint_forces([free, *units]))
        if frictions is None:
            return None
        for friction, unit in zip(frictions, units, strict=True):
            free = [force + friction * more for force, more in zip(free, unit, strict=True)]
        return [*free, *frictions]

    def improve_sliding(
        self,
        forces: Sequence[Any],
        levers: Sequence[Any],
        motion: Sequence[Any],
        frictions: Sequence[Any],
    ) -> list[list[Any]]:
        """
        Return better frictions where the only input slides, to be tested by `find_sliding`.

        ``forces`` are as in `forces_in`, for F₀, F₁ and the P_k; ``levers`` are |ψ'| of each
        joint. ``motion`` is the pull and the mobility: q̈ without this friction, in [rad/s²] or
        [m/s²], and how much it falls with a unit of this friction at the input: sign(q̇)/I; 0 if
        q̈ is given. ``frictions`` are the frictions of the step before.
        """
        numbers, count = self._begin_forces(*forces, *levers, *motion), self._count
        improved = self._improve_frictions(*frictions, *numbers[count:])
        if not improved:
            return []
        effort = _sum_products(levers, improved)
        return [improved[:count], improved[count:], numbers[:count], [effort]]

    def find_sliding(
        self, improve: Callable[[Sequence[float]], Sequence[Sequence[float]] | None]
    ) -> float | None:
        """
        Return the friction effort at the only input, in [N·m] or [N]; None if the linkage jams.

        ``improve`` returns the results of `improve_sliding` from the frictions of a step before.
        """
        frictions: Sequence[float] = (0.0,) * self._count
        for _ in range(_MOST_STEPS // self._steps):
            improved = improve(frictions)
            if not improved:
                return None
            frictions, missing, sizes, (effort,) = improved
            if _stays(frictions, missing, sizes):
                return effort
        return None

    @property
    def factors(self) -> list[float]:
        """Return the friction of each joint for a force of 1."""
        return [factor for _, _, factor in self._unknowns]

    def solve_by_forces(self, forces: Sequence[float]) -> Sequence[float] | None:
        """
        Return the friction in each joint, in [N·m] or [N]; None if the linkage jams.

        ``forces`` are of each joint x and y of the force without, then by a unit of each friction.
        """
        pieces = split_numbers(forces, 2 * (self._count + 1))
        sizes = [
            _STAYS * factor * hypot(x, y)
            for factor, (x, y, *_) in zip(self.factors, pieces, strict=True)
        ]
        return self._iterate(sizes, forces)

    def compile_sliding(
        self, joints: Sequence[int], inputs: int, dry: int
    ) -> Callable[..., Sequence[float] | None]:
        """
        Return a function that gives the friction in each joint where all of several inputs slide.

        ``joints`` are these joints among all ``dry`` ones. It takes the numbers of `forces_in` one
        joint after the other, then the inverse inertia, row by row, the slip of each dry joint for
        a rate of 1 of each input, its direction, the forces on the inputs without these joints,
        and what resists beside this friction along the positive slip of each dry joint.
        """
        sides, count = self._sides, self._count

        def begin_sliding(*numbers: Any) -> list[Any]:
            parts = iter(numbers)
            presses = [[*islice(parts, 2 * sides)] for _ in range(count)]
            mobility = [[*islice(parts, inputs)] for _ in range(inputs)]
            levers = [[*islice(parts, inputs)] for _ in range(dry)]
            senses, force = [*islice(parts, dry)], [*islice(parts, inputs)]
            resisted = [*parts]
            pushes = zip(force, zip(*levers, strict=True), strict=True)
            pushed = [push + _sum_products(way, resisted) for push, way in pushes]
            change = [_sum_products(row, pushed) for row in mobility]
            moved = [[_sum_products(row, levers[j]) for row in mobility] for j in joints]
            sizes, forces = [], []
            first = 1 + inputs
            for (_, _, factor), piece in zip(self._unknowns, presses, strict=True):
                x, y = piece[::2], piece[1::2]
                pair = [of[0] + _sum_products(of[1:], [*change, *resisted]) for of in (x, y)]
                sizes.append(_STAYS * factor * abs(make_vector(*pair)))
                forces += pair
                for j, way in zip(joints, moved, strict=True):
                    of_unit = (_sum_products(of[1:], way) + of[first + j] for of in (x, y))
                    forces += [-senses[j] * part for part in of_unit]
            return [*sizes, *forces]

        length = 2 * count * sides + inputs * (inputs + dry + 1) + 2 * dry
        begin = compile_function(begin_sliding, length)

        def solve_sliding(*numbers: float) -> Sequence[float] | None:
            (values,) = begin(*numbers)
            return self._iterate(values[:count], values[count:])

        return solve_sliding

    def _iterate(self, sizes: Sequence[float], moved: Sequence[float]) -> Sequence[float] | None:
        """Return frictions, of which what is small is given, by forces without and by them."""
        count = self._count
        frictions: Sequence[float] = (0.0,) * count
        for _ in range(_MOST_STEPS // self._steps):
            improved = self._improve(*frictions, *moved)
            if improved is None:
                return None
            (numbers,) = improved
            frictions, missing = numbers[:count], numbers[count:]
            if _stays(frictions, missing, sizes):
                return frictions
        return None

    def _begin_forces(self, *numbers: Any) -> list[Any]:
        """Return what is small for each friction, and each force without and by frictions."""
        count = self._count
        begin = 2 * count * (count + 2)
        *levers, pull, mobility = numbers[begin:]
        sizes: list[Any] = []
        forces: list[Any] = []
        pieces = split_numbers(numbers[:begin], 2 * (count + 2))
        for (_, _, factor), piece in zip(self._unknowns, pieces, strict=True):
            x, y, by_x, by_y, *units = piece
            size = abs(make_vector(x, y)) + abs(make_vector(pull * by_x, pull * by_y))
            sizes.append(_STAYS * factor * size)
            forces += (x + pull * by_x, y + pull * by_y)
            for k, lever in enumerate(levers):
                falls = mobility * lever
                forces += (units[2 * k] - falls * by_x, units[2 * k + 1] - falls * by_y)
        return [*sizes, *forces]

    def _improve_frictions(self, *numbers: Any) -> list[Any]:
        """Return frictions after some Newton steps, and what of each is missing then."""
        count = self._count
        frictions, forces = [*numbers[:count]], numbers[count:]
        for _ in range(self._steps):
            missing, slopes = self._missing(frictions, forces)
            steps = _solve_dominant(slopes, missing)
            if not steps:
                return []
            frictions = [now + step for now, step in zip(frictions, steps, strict=True)]
        missing, _ = self._missing(frictions, forces)
        return [*frictions, *missing]

    def _missing(
        self, frictions: Sequence[Any], forces: Sequence[Any]
    ) -> tuple[list[Any], list[list[Any]]]:
        """Return what is missing of each friction, and how it falls with each of them."""
        count = self._count
        missing, slopes = [], []
        for i, piece in enumerate(split_numbers(forces, 2 * (count + 1))):
            _, _, factor = self._unknowns[i]
            x, y, *units = piece
            for k, friction in enumerate(frictions):
                x, y = x + friction * units[2 * k], y + friction * units[2 * k + 1]
            size = abs(make_vector(x, y))
            along = factor / where(size > 0.0, size, 1.0)
            missing.append(factor * size - frictions[i])
            falls = [along * (x * units[2 * k] + y * units[2 * k + 1]) for k in range(count)]
            slopes.append([float(i == k) - fall for k, fall in enumerate(falls)])
        return missing, slopes


def _stays(frictions: Sequence[float], missing: Sequence[float], sizes: Sequence[float]) -> bool:
    """Return whether what is missing of frictions is rounding."""
    for friction, left, size in zip(frictions, missing, sizes, strict=True):
        # Not a number: no force is that great.
        if not abs(left) <= size + _STAYS * abs(friction):
            return False
    return True


def _solve_dominant(matrix: Sequence[Sequence[Any]], right: Sequence[Any]) -> list[Any]:
    """
    Return the solution of equations whose diagonal dominates; none if a divisor is 0.

    No rows are exchanged: frictions are small beside the forces that cause them, and where
    they are not, the next Newton step corrects what digits are lost.
    """
    rows = [[*row, side] for row, side in zip(matrix, right, strict=True)]
    for k, row in enumerate(rows):
        if row[k] == 0.0:
            return []
        after = k + 1
        for other in rows[after:]:
            factor = other[k] / row[k]
            other[after:] = [
                entry - factor * pivot
                for entry, pivot in zip(other[after:], row[after:], strict=True)
            ]
    solution: list[Any] = []
    for k, row in reversed([*enumerate(rows)]):
        after = k + 1
        *entries, side = row[after:]
        total = reduce(sub, map(mul, entries, solution), side)
        solution.insert(0, total / row[k])
    return solution


def _sum_products(first: Sequence[Any], second: Sequence[Any]) -> Any:
    """Return the scalar product, as far as both go."""
    return reduce(add, map(mul, first, second))


class Pressing(NamedTuple):
    """What of several inputs makes friction grow with the forces in joints."""

    joints: tuple[int, ...]  # The joints, by number among those with dry friction
    inputs: int  # The number of inputs
    solver: FrictionSolver
    # As `linkage_ros.dynamics.reactions.Reactions.joint_presses`.
    forces_at: Callable[[Sequence[float], Sequence[float], float], Sequence[float]]
    solve_sliding: Callable[..., Sequence[float] | None]  # Of `FrictionSolver.compile_sliding`

    def mount_on(self, terms: Callable[..., Any]) -> Callable[..., Any]:
        """Return an equation of motion of several inputs with the forces in these joints."""

        def equation_with_presses(values: Sequence[float], rates: Sequence[float]) -> Any:
            there = terms(values, rates)
            if there is None:
                return None
            return there._replace(presses=partial(self.forces_at, values, rates))

        return equation_with_presses

    def forces_by(
        self, presses: Sequence[float], weights: Sequence[Sequence[float]]
    ) -> list[list[tuple[float, float]]]:
        """
        Return the force in each joint, x and y, in [N], for each of some sums.

        ``presses`` are of `forces_at`, and the weights are 1 or 0, the acceleration of each input,
        and the friction along the positive slip of each dry joint and of each with a stop.
        """
        forces = []
        for piece in split_numbers(presses, len(presses) // len(self.joints)):
            x, y = piece[::2], piece[1::2]
            forces.append([(sum(map(mul, x, of)), sum(map(mul, y, of))) for of in weights])
        return forces
