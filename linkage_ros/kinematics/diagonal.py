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
The diagonal of a dyad: from its first outer pin A to its second outer pin D.

Two pins that lie on links which are themselves pinned together, at O, are as crank pin and ground
pivot of a four-bar: `CrankDiagonal`. Its half-angle form loses nothing where OA lies along OD (a
change point), where the coordinates of A and D cancel. For all others there are the coordinates:
`FreeDiagonal`.
"""

from __future__ import annotations

from cmath import phase
from fractions import Fraction
from math import atan2, cos, fsum, inf, pi, remainder, sin, sqrt
from typing import NamedTuple, Protocol

from linkage_ros.kinematics.step import State
from linkage_ros.tuples import new

UNIT_ROUNDOFF = 2.0**-53

SMALLEST = 2.0**-1020
"""What is smaller is taken for zero: its inverse would not be a number any more."""

ROUNDING = 16.0 * UNIT_ROUNDOFF
"""Bound of the error of a reach, relative to the size of its terms."""


def margin(*lengths: float) -> float:
    """
    Return a sum of signed lengths that is a constant of a linkage, correctly rounded.

    Lengths come from files, in decimals: what cancels but for their rounding was meant to cancel,
    and is 0.
    """
    total = fsum(lengths)
    return 0.0 if abs(total) <= 4.0 * UNIT_ROUNDOFF * fsum(map(abs, lengths)) else total


def reach(constant: float, part: float) -> tuple[float, float]:
    """
    Return the root of ``constant + part²``, and that sum where it is negative.

    A dyad that folds or stretches does so where such a sum, its reach, goes to zero. The constant
    is a bracket of the linkage; the part is signed by the half angle. Where the constant is zero,
    the root is the part and has its sign. A sum within its own rounding error of zero is zero:
    those are the last few floats on either side of a toggle, where the rate has no correct digit.

    Returns
    -------
    root : float
        0 at a toggle.
    missing : float
        0 where the dyad closes, else what is missing of the sum.

    """
    if constant == 0.0:
        return part, 0.0
    square = part * part
    return root_of(constant + square, abs(constant) + square)


def root_of(total: float, size: float) -> tuple[float, float]:
    """Return root and what is missing as `reach` does, of a sum whose terms are of a size."""
    rounding = ROUNDING * size
    if total > rounding:
        return sqrt(total), 0.0
    return 0.0, (0.0 if total >= -rounding else -total)


def cross(one: complex, other: complex) -> float:
    """Return the z component of the cross product of two vectors."""
    return one.real * other.imag - one.imag * other.real


def folded(angle: float) -> float:
    """Return the acute angle between two lines, of an angle between them, in [rad]."""
    return abs(remainder(angle, pi))


class Diagonal(NamedTuple):
    """
    The vector from A to D at one state of the linkage.

    Attributes
    ----------
    square
        s² = |AD|²; 0 where no direction can be told.
    direction
        Of AD, in [rad].
    fold, stretch
        √(s² − lower²) and √(upper² − s²): how far the dyad is from its limits. Signed at a change
        point; the latter is infinite where the dyad has no upper limit.
    gap
        What A and D are too near or too far by; 0 where the dyad closes.
    near, far
        2·√(ad)·sin(φ/2) and 2·√(ad)·cos(φ/2) of a `CrankDiagonal`, else 0.
    excess
        What s² has beyond the diagonal's ``least``, its constant part.

    """

    square: float
    direction: float
    fold: float
    stretch: float
    gap: float
    near: float
    far: float
    excess: float


class Growth(NamedTuple):
    """
    The rates of a diagonal: ṡ/s + i·(rate of the direction) = swing·unit + i·base.

    The unit may be huge where A is next to D. What it is multiplied by in a dyad is as small then:
    that product comes first.
    """

    unit: complex
    swing: float
    base: float


class GrowthChange(NamedTuple):
    """
    The derivative of a `Growth`: change·unit + swing²·square + i·base.

    The bend is what the square's real part leaves of a dyad's own second derivative (each dyad
    says what): near a change point a difference of large numbers, so a `CrankDiagonal` tells it,
    where all others leave it to the dyad.
    """

    square: complex
    change: float
    base: float
    bend: float | None


class AnyDiagonal(Protocol):
    """
    What a dyad asks of a diagonal.

    Attributes
    ----------
    least
        A constant that s² is never below.

    """

    least: Fraction

    def at(self, known: State, /) -> Diagonal:
        """Return the diagonal."""

    def rates(self, diagonal: Diagonal, known: State, speeds: State, /) -> Growth:
        """Return how the diagonal grows and turns."""

    def accelerations(
        self, diagonal: Diagonal, growth: Growth, known: State, speeds: State, changes: State, /
    ) -> GrowthChange:
        """Return the derivative of `rates`."""


class CrankDiagonal:
    """
    The diagonal between two links that are pinned together at O.

    With a = OA, d = OD and φ the angle from OD to OA, near = 2·√(ad)·sin(φ/2) and far =
    2·√(ad)·cos(φ/2)::

        s²  = (d − a)² + near²
        dir = dir(OD) + atan2(−a·sin φ, (d − a) + 2a·sin²(φ/2))

        s² − lower² = ((d − a)² − lower²) + near²
        upper² − s² = (upper² − (a + d)²) + far² = (upper² − (d − a)²) − near²

    Where a and d are long beside upper, so that no stretch can be near s = a + d, the last line is
    taken: the one before it would cancel a + d. The brackets are constants of the linkage.

    Parameters
    ----------
    a, d
        Lengths of OA and OD, in one unit; at best near 1.
    fold, stretch
        The margins |d − a| − lower and upper − a − d, correctly rounded; stretch is infinite where
        the dyad has no upper limit.
    limits
        lower and upper.
    arms
        Indices, among the coordinates, of the directions of OA and OD.
    offset
        φ less the difference of those two coordinates, in (−π, π] rad.

    """

    __slots__ = (
        '_constants', 'arms', 'brackets', 'fold_margin', 'half_turn', 'least', 'limits', 'sides',
        'stretch_margin',
    )  # fmt: skip

    def __init__(
        self,
        a: float,
        d: float,
        fold: float,
        stretch: float,
        limits: tuple[float, float],
        arms: tuple[int, int] = (1, 0),
        offset: float = 0.0,
    ) -> None:
        lower, upper = limits
        least = abs(d - a)
        self.least = (Fraction(d) - Fraction(a)) ** 2
        self.sides = (a, d)
        self.limits = limits
        self.fold_margin, self.stretch_margin = fold, stretch
        self.brackets = (fold * (least + lower), stretch * (upper + a + d))
        short_pair = a + d > 2.0 * upper
        whole = (fsum((upper, -max(a, d), min(a, d)))) * (upper + least) if short_pair else 0.0
        # Two roots, since a·d may underflow where the lengths differ by many decades.
        self._constants = (a, d - a, 2.0 * sqrt(a) * sqrt(d), *self.brackets, short_pair, whole)
        self.arms = (*arms, offset)
        self.half_turn = (sin(0.5 * offset), cos(0.5 * offset))

    def at(self, known: State) -> Diagonal:
        """Return the diagonal."""
        x = known[0]
        a, difference, root, fold, stretch, short_pair, whole = self._constants
        first, second, offset = self.arms
        base = x[second]
        half = 0.5 * (x[first] - base)
        half_sine, half_cosine = sin(half), cos(half)
        if offset:
            # Not added to an angle that may have turned a thousand times.
            sine, cosine = self.half_turn
            half_sine, half_cosine = (
                half_sine * cosine + half_cosine * sine,
                half_cosine * cosine - half_sine * sine,
            )
        near, far = root * half_sine, root * half_cosine
        excess = near * near
        square = difference * difference + excess
        lower, upper = self.limits
        if square < SMALLEST:
            return Diagonal(0.0, 0.0, 0.0, 0.0, lower, near, far, 0.0)
        direction = base + atan2(
            -2.0 * a * half_sine * half_cosine, difference + 2.0 * a * half_sine * half_sine
        )
        root_fold, missing = reach(fold, near)
        if missing:
            gap = missing / (sqrt(square) + lower)
            return Diagonal(square, direction, 0.0, 0.0, gap, near, far, 0.0)
        if upper == inf:
            return new(Diagonal, (square, direction, root_fold, inf, 0.0, near, far, excess))
        if short_pair:
            root_stretch, missing = root_of(whole - near * near, abs(whole) + near * near)
        else:
            root_stretch, missing = reach(stretch, far)
        gap = missing / (sqrt(square) + upper) if missing else 0.0
        return new(
            Diagonal,
            (square, direction, root_fold, root_stretch, gap, near, far, excess),
        )

    def rates(self, diagonal: Diagonal, _known: State, speeds: State) -> Growth:
        """
        Return φ̇·(q − i·p), and what OD turns by.

        With n̂ the diagonal's direction turned left::

            p = OA·AD/s² = −d(direction)/dφ = (a·(d − a) − near²/2)/s²
            q = OA·n̂/s   = (ds/dφ)/s        = near·far/(2s²)
        """
        v = speeds[0]
        first, second, _ = self.arms
        square, _, _, _, _, near, far, _ = diagonal
        a, difference = self._constants[:2]
        p = (a * difference - 0.5 * near * near) / square
        q = 0.5 * near * far / square
        base = v[second]
        return new(Growth, (q - 1j * p, v[first] - base, base))

    def accelerations(
        self, diagonal: Diagonal, growth: Growth, _known: State, _speeds: State, changes: State
    ) -> GrowthChange:
        """
        Return the derivative of `rates`.

        By φ, p' = −q·(1 + 2p) with 1 + 2p = (d² − a²)/s², and q' = p + p² − q². The bend is::

            ((d − a)² − lower²)·far²/(s² − lower²)/(4s²)
              − (upper² − (a + d)²)·near²/(upper² − s²)/(4s²)

        which is q' + q² − q²·cot(σβ)·cot(σγ') of an RRR dyad, and q' + q²·(1 − c²) of an RPR one,
        with what cancels there taken out: at a change point one of the brackets is 0.
        """
        a = changes[0]
        first, second, _ = self.arms
        q, p = growth.unit.real, -growth.unit.imag
        square, _, fold, stretch, _, near, far, _ = diagonal
        (short, long), (fold_bracket, stretch_bracket) = self.sides, self.brackets
        turn = p + (p - q) * (p + q) + 1j * (q * ((long - short) * (long + short) / square))
        bend = 0.0
        if fold_bracket:
            bend = fold_bracket * (far / fold) * (far / fold)
        if self.limits[1] == inf:
            bend -= near * near
        elif stretch_bracket:
            bend -= stretch_bracket * (near / stretch) * (near / stretch)
        return new(GrowthChange, (turn, a[first] - a[second], a[second], 0.25 * bend / square))


class UnsignedDiagonal(CrankDiagonal):
    """
    The diagonal between two links neither of which an input turns against the ground.

    Their angles are known but for whole turns, and with them the sign of a half angle. So a change
    point is not passed: the assembly stays the one that is named.
    """

    __slots__ = ()

    def at(self, known: State) -> Diagonal:
        """Return the diagonal."""
        found = super().at(known)
        return found._replace(fold=abs(found.fold), stretch=abs(found.stretch))


class FreeDiagonal:
    """
    The diagonal between two pins, from their coordinates.

    Parameters
    ----------
    ends
        Indices of A and D among the pins.
    limits
        lower and upper of s.

    """

    __slots__ = ('_ends', '_limits')

    least = Fraction(0)

    def __init__(self, ends: tuple[int, int], limits: tuple[float, float]) -> None:
        self._ends = ends
        self._limits = limits

    def at(self, known: State) -> Diagonal:
        """Return the diagonal."""
        pins = known[1]
        first, second = self._ends
        start, end = pins[first], pins[second]
        return free_diagonal(end - start, abs(start) + abs(end), *self._limits)

    def rates(self, _diagonal: Diagonal, known: State, speeds: State) -> Growth:
        """Return the velocity of D against A, divided by AD."""
        first, second = self._ends
        pins, velocities = known[1], speeds[1]
        unit = (velocities[second] - velocities[first]) / (pins[second] - pins[first])
        return new(Growth, (unit, 1.0, 0.0))

    def accelerations(
        self, _diagonal: Diagonal, growth: Growth, known: State, _speeds: State, changes: State
    ) -> GrowthChange:
        """Return the derivative of `rates`."""
        first, second = self._ends
        pins, pulls = known[1], changes[1]
        unit = growth.unit
        square = (pulls[second] - pulls[first]) / (pins[second] - pins[first]) - unit * unit
        return new(GrowthChange, (square, 0.0, 0.0, None))


def free_diagonal(vector: complex, size: float, lower: float, upper: float) -> Diagonal:
    """Return the diagonal of a vector whose ends have coordinates of a size."""
    s = abs(vector)
    square = s * s
    if square < SMALLEST:
        return Diagonal(0.0, 0.0, 0.0, 0.0, lower, 0.0, 0.0, 0.0)
    root_fold, missing = root_of((s - lower) * (s + lower), (size + lower) * (s + lower))
    if missing:
        return Diagonal(square, 0.0, 0.0, 0.0, missing / (s + lower), 0.0, 0.0, 0.0)
    root_stretch, gap = inf, 0.0
    if upper != inf:
        root_stretch, missing = root_of((upper - s) * (upper + s), (size + upper) * (upper + s))
        gap = missing / (upper + s)
    direction = phase(vector)
    return new(Diagonal, (square, direction, root_fold, root_stretch, gap, 0.0, 0.0, square))
