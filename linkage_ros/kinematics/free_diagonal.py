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

from cmath import phase
from fractions import Fraction
from math import inf, sqrt

from linkage_ros.kinematics.diagonal import Diagonal, Growth, GrowthChange
from linkage_ros.kinematics.rounding import root_of, SMALLEST
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import State
from linkage_ros.tuples import new

_CLOSED = Status.CLOSED


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
        self._limits = limits

    def at(self, known: State) -> Diagonal:
        """Return the diagonal."""
        pins = known[1]
        first, second = self._ends
        start, end = pins[first], pins[second]
        return free_diagonal(end - start, abs(start) + abs(end), *self._limits)

    def rates(self, diagonal: Diagonal, known: State, speeds: State) -> Growth:
        """Return the velocity of D against A, divided by AD."""
        first, second = self._ends
        pins, velocities = known[1], speeds[1]
        unit = (velocities[second] - velocities[first]) / (pins[second] - pins[first])
        return new(Growth, (unit, 1.0, 0.0, unit.real / diagonal.fold / diagonal.stretch))

    def accelerations(
        self, _diagonal: Diagonal, growth: Growth, known: State, _speeds: State, changes: State
    ) -> GrowthChange:
        """Return the derivative of `rates`."""
        first, second = self._ends
        pins, pulls = known[1], changes[1]
        unit = growth.unit
        square = (pulls[second] - pulls[first]) / (pins[second] - pins[first])
        square += unit.imag * (unit.imag - 2j * unit.real)
        return new(GrowthChange, (square, 0.0, 0.0, None))


def free_diagonal(
    vector: complex, size: float, lower: float, upper: float, span: float
) -> Diagonal:
    """Return the diagonal of a vector whose ends have coordinates of a size."""
    s = abs(vector)
    square = s * s
    if square < SMALLEST:
        status = Status.OPEN if lower else Status.INDETERMINATE
        return Diagonal(0.0, 0.0, 0.0, 0.0, lower, 0.0, 0.0, 0.0, status)
    folding = (s - lower) * (s + lower)
    root_fold, missing = root_of(folding, (size + lower) * (s + lower))
    gap, root_stretch = missing / (s + lower), 1.0
    if upper != inf and not gap:
        stretching = (upper - s) * (upper + s)
        root_stretch, missing = root_of(stretching, (size + upper) * (upper + s))
        gap = missing / (upper + s)
        if root_fold and root_stretch:
            if folding < stretching:
                root_stretch = sqrt(span - folding)
            else:
                root_fold = sqrt(span - stretching)
    if gap:
        return Diagonal(square, 0.0, 0.0, 0.0, gap, 0.0, 0.0, 0.0, Status.OPEN)
    status = _CLOSED if root_fold and root_stretch else Status.TOGGLE
    return new(
        Diagonal,
        (square, phase(vector), root_fold, root_stretch, 0.0, 0.0, 0.0, square, status),
    )
