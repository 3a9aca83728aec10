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


"""The diagonal between any two pins, from their coordinates."""

from __future__ import annotations

from fractions import Fraction
from math import inf

from linkage_ros.kinematics.arithmetic import phase, sqrt, where
from linkage_ros.kinematics.diagonal import Diagonal, Growth, GrowthChange
from linkage_ros.kinematics.rounding import Root, root_of, SMALLEST
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import State


class FreeDiagonal:
    """
    The diagonal between two pins, from their coordinates.

    Parameters
    ----------
    ends
        Indices of A and D among the pins.
    limits
        lower and upper of s, and upper² − lower², as of a `CrankDiagonal`.

    """

    __slots__ = ('_ends', '_limits')

    least = Fraction(0)

    def __init__(self, ends: tuple[int, int], limits: tuple[float, float, float]) -> None:
        self._ends = ends
        self._limits = (*limits, limits[1] != inf)

    def at(self, known: State) -> Diagonal:
        """Return the diagonal."""
        start, end = (known.pins[i] for i in self._ends)
        return free_diagonal(end - start, abs(start) + abs(end), *self._limits)

    def rates(self, diagonal: Diagonal, known: State, speeds: State) -> Growth:
        """Return the velocity of D against A, divided by AD."""
        first, second = self._ends
        vector = known.pins[second] - known.pins[first]
        return free_growth(diagonal, vector, speeds.pins[second] - speeds.pins[first])

    def accelerations(
        self, _diagonal: Diagonal, growth: Growth, known: State, _speeds: State, changes: State
    ) -> GrowthChange:
        """Return the derivative of `rates`."""
        first, second = self._ends
        vector = known.pins[second] - known.pins[first]
        return free_growth_change(growth, vector, changes.pins[second] - changes.pins[first])


def free_diagonal(
    vector: complex, size: float, lower: float, upper: float, span: float, bounded: bool = True
) -> Diagonal:
    """Return the diagonal of a vector whose ends have coordinates of a size."""
    s = abs(vector)
    square = s * s
    if square < SMALLEST:
        status = Status.OPEN if lower else Status.INDETERMINATE
        return Diagonal(0.0, 0.0, 0.0, 0.0, lower, 0.0, 0.0, 0.0, status)
    folding, stretching = (s - lower) * (s + lower), 1.0
    fold, stretch = root_of(folding, (size + lower) * (s + lower)), Root(1.0)
    if fold.status is Status.OPEN:
        gap = fold.missing / (s + lower)
        return Diagonal(square, 0.0, 0.0, 0.0, gap, 0.0, 0.0, 0.0, Status.OPEN)
    if bounded:
        stretching = (upper - s) * (upper + s)
        stretch = root_of(stretching, (size + upper) * (upper + s))
    if stretch.status is Status.OPEN:
        gap = stretch.missing / (upper + s)
        return Diagonal(square, 0.0, 0.0, 0.0, gap, 0.0, 0.0, 0.0, Status.OPEN)
    root_fold, root_stretch, status = fold.root, stretch.root, Status.CLOSED
    if Status.TOGGLE in (fold.status, stretch.status):
        status = Status.TOGGLE
    elif bounded:
        folds = folding < stretching
        root_fold = sqrt(where(folds, folding, span - stretching))
        root_stretch = sqrt(where(folds, span - folding, stretching))
    return Diagonal(square, phase(vector), root_fold, root_stretch, 0.0, 0.0, 0.0, square, status)


def free_growth(diagonal: Diagonal, vector: complex, velocity: complex) -> Growth:
    """Return how a diagonal grows that changes at a velocity."""
    unit = velocity / vector
    return Growth(unit.real, unit.imag, 1.0, 0.0, unit.real / diagonal.fold / diagonal.stretch)


def free_growth_change(growth: Growth, vector: complex, pull: complex) -> GrowthChange:
    """Return the derivative of `free_growth`, of a diagonal that changes at an acceleration."""
    square = pull / vector
    square += growth.turn * (growth.turn - 2j * growth.growth)
    return GrowthChange(square.real, square.imag, 0.0, 0.0, None)
