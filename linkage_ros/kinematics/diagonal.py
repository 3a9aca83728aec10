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
from math import atan2, cos, fsum, hypot, inf, pi, remainder, sin, sqrt
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


def reach(constant: float, part: float, span: float) -> tuple[float, float]:
    """
    Return the root of ``constant + part²/span``, and the gap where that is negative.

    A dyad that folds or stretches does so where such a sum, its reach, goes to zero. The constant
    is a margin of the linkage; the part is signed by the half angle. Where the constant is zero,
    the root is part/√span and has its sign. The span is negative where the square is to be taken
    away; there is no change point then. A sum within its own rounding error of zero is zero: those
    are the last few floats on either side of a toggle, where the rate has no correct digit.

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
    return root_of(constant + square, abs(constant) + abs(square))


def root_of(total: float, size: float) -> tuple[float, float]:
    """Return root and gap as `reach` does, of a sum whose terms are of a size."""
    rounding = ROUNDING * size
    if total > rounding:
        return sqrt(total), 0.0
    return 0.0, (0.0 if total >= -rounding else -total)


def folded(angle: float) -> float:
    """Return the acute angle between two lines, of an angle between them, in [rad]."""
    return abs(remainder(angle, pi))


class Diagonal(NamedTuple):
    """
    The vector from A to D at one state of the linkage.

    Attributes
    ----------
    length
        s = |AD|.
    direction
        Of AD, in [rad].
    fold, stretch
        √(s − lower) and √(upper − s): how far the dyad is from its limits. Signed at a change
        point.
    gap
        What A and D are too near or too far by; 0 where the dyad closes.
    half_sine, half_cosine
        sin(φ/2) and cos(φ/2) of a `CrankDiagonal`.

    """

    length: float
    direction: float
    fold: float
    stretch: float
    gap: float
    half_sine: float
    half_cosine: float


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
    """What a dyad asks of a diagonal."""

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

    With a = OA, d = OD and φ the angle from OD to OA::

        s   = hypot(d − a, 2·√(ad)·sin(φ/2))
        dir = dir(OD) + atan2(−a·sin φ, (d − a) + 2a·sin²(φ/2))

    and, with near = 2·√(ad)·sin(φ/2) and far = 2·√(ad)·cos(φ/2), s exceeds its least value |d − a|
    by near²/(s + |d − a|) and falls short of its greatest, a + d, by far²/(s + a + d)::

        s − lower = (|d − a| − lower) + near²/(s + |d − a|)
        upper − s = (upper − a − d) + far²/(s + a + d)
                  = (upper − |d − a|) − near²/(s + |d − a|)

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
        '_constants', '_reaches', 'arms', 'brackets', 'fold_margin', 'half_turn', 'limits',
        'sides', 'stretch_margin',
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
        self.sides = (a, d)
        self.limits = limits
        self.brackets = (fold * (least + lower), stretch * (upper + a + d))
        self.fold_margin, self.stretch_margin = fold, stretch
        # Two roots, since a·d may underflow where the lengths differ by many decades.
        self._constants = (a, d, d - a, 2.0 * sqrt(a) * sqrt(d), lower)
        short_pair = a + d > 2.0 * upper
        if short_pair:
            stretch = fsum((upper, -max(a, d), min(a, d)))
        self._reaches = (fold, stretch, short_pair, stretch == inf, least, a + d)
        self.arms = (*arms, offset)
        self.half_turn = (sin(0.5 * offset), cos(0.5 * offset))

    def at(self, known: State) -> Diagonal:
        """Return the diagonal."""
        x = known[0]
        a, _, difference, root, lower = self._constants
        fold, stretch, short_pair, endless, least, greatest = self._reaches
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
        near = root * half_sine
        s = hypot(difference, near)
        if s < SMALLEST:
            return Diagonal(0.0, 0.0, 0.0, 0.0, lower, half_sine, half_cosine)
        direction = base + atan2(
            -2.0 * a * half_sine * half_cosine, difference + 2.0 * a * half_sine * half_sine
        )
        root_fold, gap = reach(fold, near, s + least)
        if gap or endless:
            root_stretch = inf
        elif short_pair:
            root_stretch, gap = reach(stretch, near, -(s + least))
        else:
            root_stretch, gap = reach(stretch, root * half_cosine, s + greatest)
        return new(Diagonal, (s, direction, root_fold, root_stretch, gap, half_sine, half_cosine))

    def rates(self, diagonal: Diagonal, _known: State, speeds: State) -> Growth:
        """Return φ̇·(q − i·p), and what OD turns by."""
        v = speeds[0]
        first, second, _ = self.arms
        base = v[second]
        p, q = self.swing(diagonal)
        return new(Growth, (complex(q, -p), v[first] - base, base))

    def accelerations(
        self, diagonal: Diagonal, growth: Growth, _known: State, _speeds: State, changes: State
    ) -> GrowthChange:
        """
        Return the derivative of `rates`.

        From p' = −q·(1 + 2p) and q' = p + p² − q², the derivatives by φ. With near and far as
        above, q = near·far/(2s²), and the bend is::

            (((d − a)² − lower²)·(far/s)²/(s² − lower²)
             − (upper² − (a + d)²)·(near/s)²/(upper² − s²))/4

        which is q' + q²·(1 − cot(σβ)·cot(σγ')) of an RRR dyad, and q' + q²·(1 − c²) of an RPR one,
        with what cancels there taken out: at a change point one of the brackets is 0.
        """
        a = changes[0]
        first, second, _ = self.arms
        q, p = growth.unit.real, -growth.unit.imag
        a_length, d, difference, root, _ = self._constants
        s, _, fold, stretch, _, half_sine, half_cosine = diagonal
        lower, upper = self.limits
        # 1 + 2p = (d² − a²)/s², which is exactly 0 where a = d.
        square = complex(p + (p - q) * (p + q), q * (difference / s) * ((a_length + d) / s))
        near, far = root * (half_sine / s), root * (half_cosine / s)
        bend = 0.0
        if self.brackets[0]:
            bend = self.brackets[0] * (far / fold) * (far / fold) / (s + lower)
        if upper == inf:
            bend -= near * near
        elif self.brackets[1]:
            bend -= self.brackets[1] * (near / stretch) * (near / stretch) / (s + upper)
        return new(GrowthChange, (square, a[first] - a[second], a[second], 0.25 * bend))

    def swing(self, diagonal: Diagonal) -> tuple[float, float]:
        """
        Return p and q: how the diagonal turns and grows with φ.

        With n̂ the diagonal's direction turned left::

            p = OA·AD/s² = −d(direction)/dφ = a·((d − a)/s² − 2d·(sin(φ/2)/s)²)
            q = OA·n̂/s   = (ds/dφ)/s        = 2ad·sin(φ/2)·cos(φ/2)/s²

        Where A meets D, OA·AD and s² vanish together; written with the half angle, p does not.
        """
        a, d, difference, _, _ = self._constants
        s = diagonal.length
        half_sine = diagonal.half_sine / s
        p = a * (difference / s / s - 2.0 * d * half_sine * half_sine)
        return p, 2.0 * a * d * half_sine * (diagonal.half_cosine / s)


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
    if s < SMALLEST:
        return Diagonal(0.0, 0.0, 0.0, 0.0, lower, 0.0, 0.0)
    root_fold, gap = root_of(s - lower, size + lower)
    if gap or upper == inf:
        root_stretch = inf
    else:
        root_stretch, gap = root_of(upper - s, size + upper)
    return new(Diagonal, (s, phase(vector), root_fold, root_stretch, gap, 0.0, 0.0))
