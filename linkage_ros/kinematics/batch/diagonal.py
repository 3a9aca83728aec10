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
The diagonal of a dyad over arrays.

The rates and accelerations of a `FreeDiagonal` take arrays as they are.
"""

from __future__ import annotations

from math import inf
from typing import Any

from linkage_ros.kinematics.batch.arrays import (
    Array,
    CHANGE_POINT,
    codes_of,
    Complex,
    Mask,
    passes_zeros,
    phases,
    reaches,
    roots_of,
    sine_cosine,
    States,
    TOGGLE,
)
from linkage_ros.kinematics.crank_diagonal import CrankDiagonal, UnsignedDiagonal
from linkage_ros.kinematics.diagonal import Diagonal
from linkage_ros.kinematics.free_diagonal import FreeDiagonal
from linkage_ros.kinematics.rounding import SMALLEST
from linkage_ros.kinematics.status import Status
from linkage_ros.tuples import new
import numpy as np


class CrankDiagonalArrays(CrankDiagonal):
    """The diagonal between two links that are pinned together."""

    __slots__ = ()

    def at(self, known: States) -> Diagonal:
        """Return the diagonals."""
        x = known[0]
        a, difference, least, root, quad, fold, stretch, short_pair, whole = self._constants
        first, second, offset = self.arms
        base = x[second]
        # Of links that never turn there is one number for all states.
        half = 0.5 * np.atleast_1d(x[first] - base)
        half_sine, half_cosine = half_angle(half, offset, self.half_turn, stretch == 0.0)
        near, far = root * half_sine, root * half_cosine
        excess, rest = quad * half_sine * half_sine, quad * half_cosine * half_cosine
        square = least + excess
        lower, upper, span = self.limits
        met = square < SMALLEST
        direction = base + np.arctan2(
            -2.0 * a * half_sine * half_cosine, difference + 2.0 * a * half_sine * half_sine
        )
        root_fold, missing = reaches(fold, near, excess)
        gap = missing / (np.sqrt(square) + lower)
        root_stretch: Any = 1.0
        toggle = (root_fold == 0.0) & bool(fold)
        flat: Any = False
        if upper != inf:
            if short_pair:
                root_stretch, missing = roots_of(whole - excess, abs(whole) + excess)
            else:
                root_stretch, missing = reaches(stretch, far, rest)
            gap = np.where(gap > 0.0, gap, missing / (np.sqrt(square) + upper))
            toggle |= (root_stretch == 0.0) & bool(stretch)
            folding, stretching = fold + excess, stretch + rest
            if short_pair:
                stretching = whole - excess
            greater = folding < stretching
            if stretch:
                root_stretch = _complement(root_stretch, span - folding, greater & ~toggle)
            if fold:
                root_fold = _complement(root_fold, span - stretching, ~greater & ~toggle)
        if not fold and difference:
            flat = flat | passes_zeros(half_sine, half)
        if not stretch:
            flat = flat | passes_zeros(half_cosine, half)
        gap = np.where(met, lower, gap)
        square = np.where(met, 0.0, square)
        codes = codes_of(gap, met, toggle, flat)
        if self._at_change_point is Status.TOGGLE:
            codes = np.where(codes == CHANGE_POINT, np.uint8(TOGGLE), codes)
        return new(
            Diagonal,
            (square, direction, root_fold, root_stretch, gap, near, far, excess, codes),
        )


class UnsignedDiagonalArrays(UnsignedDiagonal, CrankDiagonalArrays):
    """A `CrankDiagonal` whose angle is known but for whole turns."""

    __slots__ = ()


class FreeDiagonalArrays(FreeDiagonal):
    """The diagonal between two pins, from their coordinates."""

    __slots__ = ()

    def at(self, known: States) -> Diagonal:
        """Return the diagonals."""
        pins = known[1]
        first, second = self._ends
        start, end = pins[first], pins[second]
        return free_diagonals(end - start, np.abs(start) + np.abs(end), *self._limits)


def _complement(root: Array, square: Array, where: Mask) -> Array:
    """Return a root, in some places as that of a square."""
    found: Array = np.where(where & (square > 0.0), np.sqrt(np.abs(square)), root)
    return found


def half_angle(
    half: Array, offset: float, half_turn: tuple[float, float], exactly: bool
) -> tuple[Array, Array]:
    """Return sine and cosine, turned by half the offset; the cosine may be asked for exactly."""
    if exactly:
        sines, cosines = np.sin(half), np.cos(half)
    else:
        sines, cosines, spare = np.empty((3, *half.shape))
        sine_cosine(half, sines, cosines, spare, 1.0)
        np.add(sines, sines, out=sines)
    if offset:
        sine, cosine = half_turn
        return sines * cosine + cosines * sine, cosines * cosine - sines * sine
    return sines, cosines


def free_diagonals(
    vector: Complex,
    size: Array,
    lower: Array | float,
    upper: Array | float,
    span: Array | float,
) -> Diagonal:
    """Return the diagonals of vectors whose ends have coordinates of a size."""
    s = np.abs(vector)
    square = s * s
    met = square < SMALLEST
    folding = (s - lower) * (s + lower)
    root_fold, missing = roots_of(folding, (size + lower) * (s + lower))
    gap = missing / (s + lower)
    root_stretch: Any = 1.0
    if not (isinstance(upper, float) and upper == inf):
        stretching = (upper - s) * (upper + s)
        root_stretch, missing = roots_of(stretching, (size + upper) * (upper + s))
        gap = np.where(gap > 0.0, gap, missing / (upper + s))
        inside = (root_fold > 0.0) & (root_stretch > 0.0)
        greater = folding < stretching
        root_stretch = _complement(root_stretch, span - folding, inside & greater)
        root_fold = _complement(root_fold, span - stretching, inside & ~greater)
    gap = np.where(met, lower, gap)
    square = np.where(met, 0.0, square)
    codes = codes_of(gap, met, (root_fold == 0.0) | (root_stretch == 0.0))
    return new(
        Diagonal,
        (square, phases(vector), root_fold, root_stretch, gap, 0.0, 0.0, square, codes),
    )
