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
The diagonal of a crank-driven loop: from the crank pin A to the ground pivot D.

In the frame of the loop the crank pivot O is the origin and D lies on the positive x axis; φ is
the crank's direction there. The half-angle form loses nothing where the crank lies along the
ground (a change point), where the coordinates of A and D cancel.
"""

from __future__ import annotations

from math import atan2, cos, fsum, hypot, sin, sqrt
from typing import NamedTuple

from linkage_ros.tuples import new

UNIT_ROUNDOFF = 2.0**-53

SMALLEST = 2.0**-1020
"""What is smaller is taken for zero: its inverse would not be a number any more."""

_ROUNDING = 16.0 * UNIT_ROUNDOFF
"""Bound of the error of a reach, relative to the size of its two terms."""


def margin(*lengths: float) -> float:
    """
    Return a sum of signed lengths that is a constant of a linkage, correctly rounded.

    Lengths come from files, in decimals: what cancels but for their rounding was meant to cancel,
    and is 0.
    """
    total = fsum(lengths)
    return 0.0 if abs(total) <= 4.0 * UNIT_ROUNDOFF * fsum(map(abs, lengths)) else total


def reach(constant: float, part: float, span: float) -> tuple[float, float]:
    """
    Return the root of ``constant + part²/span``, and the gap where that is negative.

    A dyad that folds or stretches does so where such a sum, its reach, goes to zero. The constant
    is a margin of the linkage; part is `Diagonal.near` or `Diagonal.far`. Where the constant is
    zero, the root is part/√span and has its sign. The span is negative where the square is to be
    taken away; there is no change point then. A sum within its own rounding error of zero is zero:
    those are the last few floats on either side of a toggle, where the rate has no correct digit.

    Returns
    -------
    root : float
        0 at a toggle.
    gap : float
        0 where the dyad closes, else what it misses by, in the unit of the lengths.

    """
    if constant == 0.0 and span > 0.0:
        return part / sqrt(span), 0.0
    square = part * part / span
    total = constant + square
    rounding = _ROUNDING * (abs(constant) + abs(square))
    if total > rounding:
        return sqrt(total), 0.0
    return 0.0, (0.0 if total >= -rounding else -total)


class Diagonal(NamedTuple):
    """
    The vector from A to D for one crank direction.

    Attributes
    ----------
    length
        s = |AD| = hypot(d − a, 2·√(ad)·sin(φ/2)).
    direction
        Direction of AD, in [rad]: atan2(−a·sin φ, (d − a) + 2a·sin²(φ/2)).
    near
        2·√(ad)·sin(φ/2), signed. Its square is s² − (d − a)²: what s exceeds its least value by.
    far
        2·√(ad)·cos(φ/2), signed. Its square is (a + d)² − s²: what s falls short of its greatest
        value by.
    half_sine, half_cosine
        sin(φ/2) and cos(φ/2).

    """

    length: float
    direction: float
    near: float
    far: float
    half_sine: float
    half_cosine: float


class CrankDiagonal:
    """
    The lengths that fix the diagonal, prepared once.

    Parameters
    ----------
    a
        Length of the crank, O to A.
    d
        Length of the ground, O to D, in the same unit.

    """

    __slots__ = ('_constants', 'greatest', 'least')

    def __init__(self, a: float, d: float) -> None:
        self.least = abs(d - a)
        self.greatest = a + d
        # Two roots, since a·d may underflow where the lengths differ by many decades.
        self._constants = (a, d, d - a, 2.0 * sqrt(a) * sqrt(d))

    def at(self, phi: float) -> Diagonal:
        """Return the diagonal for the crank direction φ, in [rad] from the x axis of the loop."""
        a, _, difference, root = self._constants
        half = 0.5 * phi
        half_sine = sin(half)
        half_cosine = cos(half)
        near = root * half_sine
        x = difference + 2.0 * a * half_sine * half_sine
        y = -2.0 * a * half_sine * half_cosine
        far = root * half_cosine
        length = hypot(difference, near)
        return new(Diagonal, (length, atan2(y, x), near, far, half_sine, half_cosine))

    def swing(self, diagonal: Diagonal) -> tuple[float, float]:
        """
        Return p and q: how the diagonal turns and grows with the crank.

        With OA the crank and n̂ the diagonal's direction turned left::

            p = OA·AD/s² = −d(direction)/dφ = a·((d − a)/s² − 2d·(sin(φ/2)/s)²)
            q = OA·n̂/s   = (ds/dφ)/s        = 2ad·sin(φ/2)·cos(φ/2)/s²

        Where A meets D, OA·AD and s² vanish together; written with the half angle, p does not.
        """
        a, d, difference, _ = self._constants
        s = diagonal.length
        half_sine = diagonal.half_sine / s
        p = a * (difference / s / s - 2.0 * d * half_sine * half_sine)
        return p, 2.0 * a * d * half_sine * (diagonal.half_cosine / s)
