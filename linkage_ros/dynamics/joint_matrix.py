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


"""
What a unit of each joint's force and of each drive's effort does to each link: a square matrix.

Three rows for each link that moves: both components of force and the moment about its centre; two
columns for each joint: a pin's components of force, or a slider's force across its line and its
moment; one column for each drive. A force f at p is (f, (p − c) × f) to the link that it acts on
and the opposite to the other one. Moments are divided by the closure's scale, so that all entries
are of one size.

The same matrix, transposed, says what small displacements of the links open in each joint, since
a joint's force does no work: its row is the displacement of the one link's point from the other's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

from linkage_ros.kinematics.arithmetic import called, facing
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import GROUND
from linkage_ros.kinematics.structure import Joint
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Side(NamedTuple):
    """A link that takes part in a joint: its first row, its centre among the places, its sign."""

    row: int
    center: int
    sign: float


class Line(NamedTuple):
    """
    The line of a slider.

    ``unit``, turned by a coordinate of the closure, is its direction in the frame of the ground.
    """

    coordinate: int
    unit: complex

    def direction(self, coordinates: Sequence[float]) -> complex:
        """Return its direction in the frame of the ground, a unit vector."""
        return facing(coordinates[self.coordinate]) * self.unit


class JointMatrix:
    """
    The matrix of a linkage.

    Parameters
    ----------
    closure
        The linkage.
    centers
        For each link that moves the index, among the places given to `at`, of the point that its
        moments are about.
    places
        For each joint of the structure the index of its place: of a slider, that of its point.

    Attributes
    ----------
    size
        Of the matrix.
    rows
        For each link that moves its first row.
    sides
        For each joint the links in it that move, ``joint.link`` with the sign +1 first.
    lines
        For each slider, by the number of its joint, its line.

    """

    def __init__(
        self, closure: Closure, centers: Mapping[str, int], places: Sequence[int]
    ) -> None:
        linkage, joints = closure.linkage, closure.structure.joints
        self.rows = {link: 3 * i for i, link in enumerate(centers)}
        self.size = 3 * len(centers)
        self._scale = closure.scale
        self._centers = centers
        self.sides = tuple(self._sides(joint.link, joint.to) for joint in joints)
        self.lines: dict[int, Line] = {}
        self._matrix = np.zeros((self.size, self.size))
        where: list[int] = []
        self._pins = self._plan_pins(joints, places, where)
        for number, joint in enumerate(joints):
            if joint.kind == 'P':
                along = closure.angles[joint.to]
                direction = complex(*linkage.sliders[joint.name].direction)
                unit = along.unit * direction / abs(direction)
                self.lines[number] = Line(along.coordinate, unit)
        sliders = {joint.name: n for n, joint in enumerate(joints) if joint.kind == 'P'}
        self._thrusts = [
            self._plan_thrust(number, 1j, 2 * number, places[number], where)
            for number in sliders.values()
        ]
        for column, given in enumerate(linkage.inputs, 2 * len(joints)):
            if given.slider:
                number = sliders[given.slider]
                self._thrusts.append(
                    self._plan_thrust(number, 1 + 0j, column, places[number], where)
                )
            else:
                self._fill_moment(self._sides(given.child, given.parent), column)
        self._fill = partial(_filled, self._matrix, np.array(where, dtype=np.intp))

    def at(self, coordinates: Sequence[float], places: Sequence[complex]) -> Array:
        """
        Return the matrix at a position.

        Parameters
        ----------
        coordinates
            As the closure has found them.
        places
            In the frame of the ground, in [m].

        """
        values: list[float] = []
        for place, center, factor in self._pins:
            lever = places[place] - places[center]
            values += (-factor * lever.imag, factor * lever.real)
        for line, turn, place, sides in self._thrusts:
            force = turn * line.direction(coordinates)
            for _, center, sign in sides:
                lever = (places[place] - places[center]) / self._scale
                moment = lever.real * force.imag - lever.imag * force.real
                values += (sign * force.real, sign * force.imag, sign * moment)
        matrix: Array = called(self._fill, *values)
        return matrix

    def _plan_pins(
        self, joints: Sequence[Joint], places: Sequence[int], where: list[int]
    ) -> list[tuple[int, int, float]]:
        """Fill in what is constant of the pins; return, for the rest, places, centres, factors."""
        pins = []
        for number, (joint, sides) in enumerate(zip(joints, self.sides, strict=True)):
            column = 2 * number
            if joint.kind == 'P':
                self._fill_moment(sides, column + 1)
                continue
            for row, center, sign in sides:
                self._matrix[row, column] = self._matrix[row + 1, column + 1] = sign
                where += (self._entry(row + 2, column), self._entry(row + 2, column + 1))
                pins.append((places[number], center, sign / self._scale))
        return pins

    def _plan_thrust(
        self, number: int, turn: complex, column: int, place: int, where: list[int]
    ) -> tuple[Line, complex, int, tuple[Side, ...]]:
        """Plan a force on a slider: along its line, turned by a constant."""
        sides = self.sides[number]
        for row, _, _ in sides:
            where += (self._entry(row + i, column) for i in range(3))
        return self.lines[number], turn, place, sides

    def _fill_moment(self, sides: tuple[Side, ...], column: int) -> None:
        for row, _, sign in sides:
            self._matrix[row + 2, column] = sign

    def _sides(self, link: str, to: str) -> tuple[Side, ...]:
        return tuple(
            Side(self.rows[name], self._centers[name], sign)
            for name, sign in ((link, 1.0), (to, -1.0))
            if name != GROUND
        )

    def _entry(self, row: int, column: int) -> int:
        return row * self.size + column


def _filled(constant: Array, where: NDArray[np.intp], *values: float) -> Array:
    """Return a matrix with values in certain places, counted along its rows."""
    matrix = constant.copy()  # the diagnostics ask for forces from another thread than the ticks
    matrix.reshape(-1)[where] = values
    return matrix
