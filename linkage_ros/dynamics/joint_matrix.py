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

from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from math import isfinite, sin
from typing import Any, NamedTuple

from linkage_ros.kinematics import Closure, cross_product, Elimination, GROUND, unit_vector
from linkage_ros.kinematics.compiling import compile_line


class PinSide(NamedTuple):
    """A link of a joint: its first row, the index of its pivot among the places, its sign."""

    row: int
    pivot: int
    sign: float


class ForceLine(NamedTuple):
    """
    The line of a slider.

    ``unit``, turned by a coordinate of the closure, is its direction in the frame of the ground.
    """

    coordinate: int
    unit: complex

    def direction(self, coordinates: Sequence[float]) -> complex:
        """Return the direction in the frame of the ground, a unit vector."""
        return unit_vector(coordinates[self.coordinate]) * self.unit


class JointMatrix:
    """
    The square matrix of what a unit of each joint's force and drive's effort does to each link.

    Three rows for each link that moves: both components of force and the moment about its pivot.
    Two columns for each joint: the components of force of a pin, or the force of a slider across
    its line and its moment. One column for each drive. A force f at p is (f, (p − c) × f) on one
    link and the opposite on the other. Moments are divided by the closure's scale, so that all
    entries are of one size.

    The transposed matrix gives what small displacements of the links open in each joint, since a
    joint's force does no work: a row is the displacement between the points of the two links.

    ``pivots`` has, for each link that moves, the index of the reference point of its moments
    among the places given to `varying_at`; ``places`` has the index of the place of each joint of
    the structure; of a slider, of its point.
    """

    def __init__(self, closure: Closure, pivots: Mapping[str, int], places: Sequence[int]) -> None:
        linkage, joints = closure.linkage, closure.structure.joints
        # For each link that moves its first row.
        self.rows = {link: 3 * i for i, link in enumerate(pivots)}
        self.size = 3 * len(pivots)
        self._scale, self._pivots, self._places = closure.scale, pivots, places
        # For each joint its links that move, ``joint.link`` with the sign +1 first.
        self.sides = tuple(self._joint_sides(joint.link, joint.to) for joint in joints)
        self.lines: dict[int, ForceLine] = {}  # For each slider, by the number of its joint
        self._rows = [[0.0] * self.size for _ in range(self.size)]
        self._where: list[tuple[int, int]] = []  # Entries that vary, by row and column
        # Of each unit force its joint, its direction, and whether the joint's line turns it.
        self._forces: list[tuple[int, complex, bool]] = []
        for number, joint in enumerate(joints):
            if joint.kind == 'R':
                self._add_force(2 * number, number, 1.0)
                self._add_force(2 * number + 1, number, 1j)
                continue
            along = closure.angles[joint.to]
            direction = complex(*linkage.sliders[joint.name].direction)
            self.lines[number] = ForceLine(
                along.coordinate, along.unit * direction / abs(direction)
            )
            self._add_force(2 * number, number, 1j)
            self._add_moment(2 * number + 1, self.sides[number])
        sliders = {joints[number].name: number for number in self.lines}
        for column, given in enumerate(linkage.inputs, 2 * len(joints)):
            if given.slider:
                self._add_force(column, sliders[given.slider], 1.0)
            else:
                self._add_moment(column, self._joint_sides(given.child, given.parent))

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
        singular.
        """
        count = len(self._where)

        def solve(*numbers: Any) -> list[Any]:
            rows = [[*row] for row in self._rows]
            for (row, column), value in zip(self._where, numbers[:count], strict=True):
                rows[row][column] = value
            elimination = Elimination([*zip(*rows, strict=True)] if transposed else rows, ())
            if any(divisor == 0.0 for divisor in elimination.divisors):
                return []
            found = [elimination.solve(side) for side in split_numbers(numbers[count:], self.size)]
            return [*chain(*found)] if select is None else select(found)

        line = compile_function(solve, count + number * self.size)

        def find_solution(*numbers: float) -> Sequence[float] | None:
            found = line(*numbers)
            return found[0] if found and all(map(isfinite, found[0])) else None

        return find_solution

    def varying_at(self, coordinates: Sequence[float], places: Sequence[complex]) -> list[float]:
        """
        Return the numbers of the matrix that vary.

        The coordinates are the closure's, the places in the frame of the ground, in [m].
        """
        values: list[float] = []
        for number, unit, turns in self._forces:
            place = self._places[number]
            force = unit * self.lines[number].direction(coordinates) if turns else unit
            for _, pivot, sign in self.sides[number]:
                if turns:
                    values += (sign * force.real, sign * force.imag)
                if place != pivot:
                    lever = places[place] - places[pivot]
                    if turns:
                        moment = cross_product(lever, force)
                    else:
                        moment = lever.real if unit == 1j else -lever.imag
                    values.append(sign / self._scale * moment)
        return values

    def _add_force(self, column: int, number: int, unit: complex) -> None:
        """Add the column of a unit force in a joint; that of a slider is turned by its line."""
        turns = number in self.lines
        self._forces.append((number, unit, turns))
        for row, pivot, sign in self.sides[number]:
            if turns:
                self._where += ((row, column), (row + 1, column))
            else:
                self._rows[row + (unit == 1j)][column] = sign
            if self._places[number] != pivot:
                self._where.append((row + 2, column))

    def _add_moment(self, column: int, sides: Sequence[PinSide]) -> None:
        """Add the column of a unit moment."""
        for row, _, sign in sides:
            self._rows[row + 2][column] = sign

    def _joint_sides(self, link: str, to: str) -> tuple[PinSide, ...]:
        return tuple(
            PinSide(self.rows[name], self._pivots[name], sign)
            for name, sign in ((link, 1.0), (to, -1.0))
            if name != GROUND
        )


def split_numbers(numbers: Sequence[Any], size: int) -> list[list[Any]]:
    """Return numbers in pieces of one size."""
    return [list(piece) for piece in zip(*[iter(numbers)] * size, strict=True)]


def compile_function(function: Callable[..., Sequence[Any]], count: int) -> Callable[..., Any]:
    """Return a function of some numbers as straight-line code."""
    # Numbers without a pattern, so that no decision is made by chance.
    return compile_line(function, [0.1 * sin(1.0 + 1.7 * i * i) for i in range(count)])
