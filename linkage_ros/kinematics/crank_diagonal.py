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


"""The diagonal between two links that are pinned together: crank pin to ground pivot."""

from __future__ import annotations

from fractions import Fraction
from math import atan2, cos, fsum, inf, pi, sin, sqrt

from linkage_ros.kinematics.diagonal import Diagonal, Growth, GrowthChange
from linkage_ros.kinematics.rounding import passes_zero, reach, root_of, SMALLEST
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import State
from linkage_ros.tuples import new

_CLOSED = Status.CLOSED


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
    taken: the one before it would cancel a + d. The brackets are constants of the linkage, and so
    is the sum of both, span = upper² − lower². It gives the greater one from the smaller: where
    they are alike, what rounds the one then makes the other as much smaller, and their product,
    which has its extreme there, loses nothing. Each from its own bracket, it lost 147 u·κ.

    Parameters
    ----------
    a, d
        Lengths of OA and OD, in one unit; at best near 1.
    fold, stretch
        The margins |d − a| − lower and upper − a − d, correctly rounded; stretch is infinite where
        the dyad has no upper limit.
    limits
        lower and upper, and the span, which their difference would cancel; infinite likewise.
    arms
        Indices, among the coordinates, of the directions of OA and OD.
    offset
        φ less the difference of those two coordinates, in (−π, π] rad.

    Attributes
    ----------
    along, quad, root
        a·(d − a), 4ad and 2·√(ad), correctly rounded.

    """

    __slots__ = (
        '_constants', 'along', 'arms', 'brackets', 'fold_margin', 'half_turn', 'least', 'limits',
        'quad', 'root', 'sides', 'stretch_margin',
    )  # fmt: skip

    _at_change_point = Status.CHANGE_POINT

    def __init__(
        self,
        a: float,
        d: float,
        fold: float,
        stretch: float,
        limits: tuple[float, float, float],
        arms: tuple[int, int] = (1, 0),
        offset: float = 0.0,
    ) -> None:
        lower, upper, _ = limits
        least = abs(d - a)
        self.least = (Fraction(d) - Fraction(a)) ** 2
        self.sides = (a, d)
        self.along = float(Fraction(a) * (Fraction(d) - Fraction(a)))
        self.limits = limits
        self.fold_margin, self.stretch_margin = fold, stretch
        self.brackets = (fold * (least + lower), stretch * (upper + a + d))
        short_pair = a + d > 2.0 * upper
        whole = (fsum((upper, -max(a, d), min(a, d)))) * (upper + least) if short_pair else 0.0
        self.root, self.quad = mean_root(a, d), float(4 * Fraction(a) * Fraction(d))
        self._constants = (
            a, d - a, float(self.least), self.root, self.quad, *self.brackets, short_pair, whole,
        )  # fmt: skip
        self.arms = (*arms, offset)
        self.half_turn = (sin(0.5 * offset), cos(0.5 * offset))

    def at(self, known: State) -> Diagonal:
        """Return the diagonal."""
        x = known[0]
        a, difference, least, root, quad, fold, stretch, short_pair, whole = self._constants
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
        # Not of the roots, which are rounded once more.
        excess, rest = quad * half_sine * half_sine, quad * half_cosine * half_cosine
        square = least + excess
        lower, upper, _ = self.limits
        if square < SMALLEST:
            status = Status.OPEN if lower else Status.INDETERMINATE
            return Diagonal(0.0, 0.0, 0.0, 0.0, lower, near, far, 0.0, status)
        direction = base + atan2(
            -2.0 * a * half_sine * half_cosine, difference + 2.0 * a * half_sine * half_sine
        )
        root_fold, missing = reach(fold, near, excess)
        if missing:
            gap = missing / (sqrt(square) + lower)
            return Diagonal(square, direction, 0.0, 0.0, gap, near, far, 0.0, Status.OPEN)
        root_stretch = 1.0
        if short_pair:
            root_stretch, missing = root_of(whole - excess, abs(whole) + excess)
        elif upper != inf:
            root_stretch, missing = reach(stretch, far, rest)
        if missing:
            gap = missing / (sqrt(square) + upper)
            return Diagonal(square, direction, 0.0, 0.0, gap, near, far, 0.0, Status.OPEN)
        if upper != inf:
            root_fold, root_stretch = self._complemented(excess, rest, root_fold, root_stretch)
        status = _CLOSED
        if (root_fold == 0.0 and fold) or (root_stretch == 0.0 and stretch):
            status = Status.TOGGLE
        elif (not fold and difference and passes_zero(half_sine, half)) or (
            not stretch and passes_zero(half_cosine, half)
        ):
            status = self._at_change_point
        return new(
            Diagonal,
            (square, direction, root_fold, root_stretch, 0.0, near, far, excess, status),
        )

    def _complemented(
        self, excess: float, rest: float, root_fold: float, root_stretch: float
    ) -> tuple[float, float]:
        """Return both roots; the greater is made of the smaller, where it is not signed."""
        _, _, _, _, _, fold, stretch, short_pair, whole = self._constants
        folding, stretching = fold + excess, whole - excess if short_pair else stretch + rest
        if (fold and not root_fold) or (stretch and not root_stretch):
            return root_fold, root_stretch
        if folding < stretching and stretch:
            root_stretch = sqrt(self.limits[2] - folding)
        elif folding >= stretching and fold:
            root_fold = sqrt(self.limits[2] - stretching)
        return root_fold, root_stretch

    def rates(self, diagonal: Diagonal, _known: State, speeds: State) -> Growth:
        """
        Return φ̇·(q − i·p), and what OD turns by.

        With n̂ the diagonal's direction turned left::

            p = OA·AD/s² = −d(direction)/dφ = (a·(d − a) − near²/2)/s²
            q = OA·n̂/s   = (ds/dφ)/s        = near·far/(2s²)

        The lean is q by the roots fold and stretch, of which at a change point one is near or far
        itself.
        """
        v = speeds[0]
        first, second, _ = self.arms
        square, _, fold, stretch, _, near, far, excess, _ = diagonal
        p = (self.along - 0.5 * excess) / square
        q = 0.5 * near * far / square
        fold_ratio, stretch_ratio = self.ratios(near, far, fold, stretch)
        base = v[second]
        lean = 0.5 * fold_ratio * stretch_ratio / square
        return new(Growth, (q - 1j * p, v[first] - base, base, lean))

    def ratios(self, near: float, far: float, fold: float, stretch: float) -> tuple[float, float]:
        """Return near by fold and far by stretch; where one is the other the ratio is 1."""
        fold_bracket, stretch_bracket = self.brackets
        return (
            near / fold if fold_bracket else 1.0,
            far / stretch if stretch_bracket else 1.0,
        )

    def accelerations(
        self, diagonal: Diagonal, growth: Growth, _known: State, _speeds: State, changes: State
    ) -> GrowthChange:
        """
        Return the derivative of `rates`.

        By φ, p' = −q·(1 + 2p) with 1 + 2p = (d² − a²)/s², and q' = p + p² − q². The bend is::

            ((d − a)² − lower²)·far²/(s² − lower²)/(4s²)
              − (upper² − (a + d)²)·near²/(upper² − s²)/(4s²)

        by fold and stretch, which is q' + q² − q²·cot(σβ)·cot(σγ') of an RRR dyad, and
        q' + q²·(1 − c²) of an RPR one, with what cancels there taken out: at a change point one of
        the brackets is 0, and near by fold, or far by stretch, is 1.
        """
        a = changes[0]
        first, second, _ = self.arms
        q, p = growth.unit.real, -growth.unit.imag
        short, long = self.sides
        turn = p * (1.0 + p) + 1j * (q * ((long - short) * (long + short) / diagonal.square))
        bend = self.bend(diagonal)
        return new(GrowthChange, (turn, a[first] - a[second], a[second], bend))

    def bend(self, diagonal: Diagonal) -> float:
        """Return the bend that `accelerations` tells of."""
        square, _, fold, stretch, _, near, far, _, _ = diagonal
        fold_bracket, stretch_bracket = self.brackets
        fold_ratio, stretch_ratio = self.ratios(near, far, fold, stretch)
        bend = 0.0
        if fold_bracket:
            bend = fold_bracket * (far / fold) / fold * (stretch_ratio / fold)
        if self.limits[1] == inf:
            bend -= near * fold_ratio
        elif stretch_bracket:
            bend -= stretch_bracket * (near / stretch) / stretch * (fold_ratio / stretch)
        return 0.25 * bend / square

    @property
    def singular_angles(self) -> tuple[float, ...]:
        """Differences of the two coordinates at which all links lie in one line, in [rad]."""
        margins = ((self.fold_margin, 0.0), (self.stretch_margin, pi))
        return tuple(phi - self.arms[2] for margin, phi in margins if margin == 0.0)


def mean_root(a: float, d: float) -> float:
    """Return 2·√(ad), correctly rounded."""
    # Two roots, since a·d may underflow where the lengths differ by many decades.
    root = 2.0 * sqrt(a) * sqrt(d)
    if not root:
        return root
    exact = Fraction(root)
    return float(exact - (exact - 4 * Fraction(a) * Fraction(d) / exact) / 2)


class UnsignedDiagonal(CrankDiagonal):
    """
    The diagonal between two links neither of which an input turns against the ground.

    Their angles are known but for whole turns, and with them the sign of a half angle. So a change
    point is not passed: the assembly stays the one that is named, and the links turn back there as
    at a toggle.
    """

    __slots__ = ()

    _at_change_point = Status.TOGGLE

    def at(self, known: State) -> Diagonal:
        """Return the diagonal."""
        found = super().at(known)
        return found._replace(fold=abs(found.fold), stretch=abs(found.stretch))

    def ratios(self, near: float, far: float, fold: float, stretch: float) -> tuple[float, float]:
        """Return near by fold and far by stretch."""
        return near / fold, far / stretch
