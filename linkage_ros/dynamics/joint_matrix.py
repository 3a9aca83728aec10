# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The linear system of the forces in the joints of a linkage, as a straight line of code.

It is solved by an elimination of our own: numpy's library chooses its code by the processor, and
the last bits of its solutions differ from machine to machine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain
from math import isfinite, sin
from typing import Any, NamedTuple

from linkage_ros.dynamics.bodies import Vectors
from linkage_ros.dynamics.joint_forms import Action, JointForms
from linkage_ros.kinematics import Elimination, GROUND, Position
from linkage_ros.kinematics.compiling import compile_line

Column = Sequence[tuple[Action, float]]
"""What an unknown of 1 does: actions, each with a factor."""


class ActionSide(NamedTuple):
    """A link of an action: its first row, the index of its pivot among the places, its sign."""

    row: int
    pivot: int
    sign: float


class JointMatrix:
    """
    The matrix of what a unit of each unknown does to each link.

    The unknowns are the forces and moments of each joint, the effort of each drive, the force
    between the wheels of each ratio, and what holds the spin of rods. Each link that moves has a
    row for each component of force, and of moment about its pivot: in the plane three, in space
    six. A force f at p is (f, (p − c) × f) on one link and the opposite on the other. Moments are
    divided by the closure's scale, so that all entries are of one size.

    The transposed matrix gives what small displacements of the links open in each joint, since a
    joint's force does no work: a row is the displacement between the points of the two links.

    ``places`` has for each joint the index of its place among those given to `varying_at`; the
    pivot of a link is the place of its first joint: about a far point, moments lose digits.
    """

    def __init__(
        self,
        forms: JointForms,
        vectors: Vectors,
        places: Sequence[int],
        scale: float,
        columns: Sequence[Column],
    ) -> None:
        self._vectors, self._places, self._scale = vectors, places, scale
        self.force_rows = len(vectors.coordinates(vectors.zero))
        self.moment_rows = len(vectors.unit_moments[0](vectors.zero))
        rows_of_link = self.force_rows + self.moment_rows
        # For each link that moves its first row.
        self.rows = {link: rows_of_link * i for i, link in enumerate(forms.links)}
        self.size = rows_of_link * len(self.rows)
        # For each link the index of the place about which its moments are.
        self.pivots: dict[str, int] = {}
        for joint, place in zip(forms.joints, places, strict=True):
            self.pivots = {joint.link: place, joint.to: place} | self.pivots
        self.columns = columns
        self.kept = tuple(range(len(columns)))
        """The columns that are solved for; the unknowns of the others are 0."""
        self._rows = [[0.0] * len(columns) for _ in range(self.size)]
        self._where: list[tuple[int, int]] = []  # Entries that vary, by row and column
        self._varying: list[tuple[Action, list[tuple[ActionSide, float]]]] = []
        for number, column in enumerate(columns):
            for action, factor in column:
                sides = [(side, side.sign * factor) for side in self.sides(action)]
                self._varying.append((action, sides))
                for side, signed in sides:
                    self._add_entries(number, action, side, signed)

    def _add_entries(self, column: int, action: Action, side: ActionSide, factor: float) -> None:
        """Add the constant entries of an action on a link, and where the others are."""
        last = side.row + self.force_rows + self.moment_rows
        moments = range(side.row + self.force_rows, last)
        way, force = action.direction, action.joint >= 0
        first = side.row if force else moments.start
        levers: Sequence[Any] = moments
        if isinstance(way, int):
            self._rows[first + way][column] += factor
            lever = self._vectors.from_numbers([1.0] * self.force_rows)
            parts = self._vectors.unit_moments[way](lever) if force else ()
            levers = [row for row, part in zip(moments, parts, strict=False) if part is not None]
        else:
            count = self.force_rows if force else self.moment_rows
            self._where += [(first + k, column) for k in range(count)]
        if force and self._places[action.joint] != side.pivot:
            self._where += [(row, column) for row in levers]

    def varying_at(self, position: Position, places: Sequence[Any]) -> list[float]:
        """Return the numbers of the matrix that vary; the places are in the ground, in [m]."""
        values: list[float] = []
        vectors = self._vectors
        for action, sides in self._varying:
            way = action.direction
            turned = None if isinstance(way, int) else way(position)
            for side, factor in sides:
                if turned is not None:
                    named = vectors.coordinates if action.joint >= 0 else vectors.turn_coordinates
                    values += [factor * part for part in named(turned)]
                if action.joint < 0 or (place := self._places[action.joint]) == side.pivot:
                    continue
                lever = vectors.minus(places[place], places[side.pivot])
                if isinstance(way, int):
                    moment = [
                        part for part in vectors.unit_moments[way](lever) if part is not None
                    ]
                else:
                    moment = [*vectors.turn_coordinates(vectors.cross(lever, turned))]
                values += [factor / self._scale * part for part in moment]
        return values

    def rows_at(self, values: Sequence[Any]) -> list[list[Any]]:
        """Return the rows of the matrix by the numbers of `varying_at`."""
        rows = [[*row] for row in self._rows]
        for (row, column), value in zip(self._where, values, strict=True):
            before = rows[row][column]
            # Wheels of a ratio on one link act on it together.
            rows[row][column] = (
                value if type(before) is float and before == 0.0 else before + value
            )
        return rows

    def sides(self, action: Action) -> tuple[ActionSide, ...]:
        """Return the links of an action that move, ``action.link`` with the sign +1 first."""
        return tuple(
            ActionSide(self.rows[name], self.pivots[name], sign)
            for name, sign in ((action.link, 1.0), (action.to, -1.0))
            if name != GROUND
        )

    def compile_solver(
        self,
        number: int = 1,
        transposed: bool = False,
        select: Callable[[list[list[Any]]], list[Any]] | None = None,
    ) -> Callable[..., Sequence[float] | None]:
        """
        Return a function that solves the system for a number of right sides.

        It takes the numbers of `varying_at`, then the right sides one after the other. It returns
        the solutions, or what ``select`` makes of them, as one sequence; None if the system is
        singular. Given symbols, it becomes part of the program that is traced.
        """
        count = len(self._where)

        def solve(*numbers: Any) -> list[Any]:
            rows = [[row[k] for k in self.kept] for row in self.rows_at(numbers[:count])]
            elimination = Elimination([*zip(*rows, strict=True)] if transposed else rows, ())
            if any(divisor == 0.0 for divisor in elimination.divisors):
                return []
            groups = [
                self._with_others(elimination.solve(side))
                for side in split_numbers(numbers[count:], self.size)
            ]
            return [*chain(*groups)] if select is None else select(groups)

        line = compile_function(solve, count + number * self.size)

        def find_solution(*numbers: float) -> Sequence[float] | None:
            if any(hasattr(number, 'apply') for number in numbers):
                return solve(*numbers)
            solution = line(*numbers)
            return solution[0] if solution and all(map(isfinite, solution[0])) else None

        return find_solution

    def _with_others(self, solution: list[Any]) -> list[Any]:
        """Return a solution with the unknowns that are not solved for."""
        if len(self.kept) == len(self.columns):
            return solution
        unknowns: list[Any] = [0.0] * len(self.columns)
        for column, value in zip(self.kept, solution, strict=True):
            unknowns[column] = value
        return unknowns


def split_numbers(numbers: Sequence[Any], size: int) -> list[list[Any]]:
    """Return numbers in pieces of one size."""
    return [list(piece) for piece in zip(*[iter(numbers)] * size, strict=True)]


def compile_function(function: Callable[..., Sequence[Any]], count: int) -> Callable[..., Any]:
    """Return a function of some numbers as straight-line code."""
    # Numbers without a pattern, so that no decision is made by chance.
    return compile_line(function, [0.1 * sin(1.0 + 1.7 * i * i) for i in range(count)])
