# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The diagonal of a dyad: the vector from its first outer pin A to its second outer pin D.

If A and D lie on two links that are pinned together, at O, they are like the crank pin and the
ground pivot of a four-bar: `CrankDiagonal`. Its half-angle form loses nothing where OA lies along
OD (a change point), where the coordinates of A and D cancel. All other diagonals are computed from
the coordinates: `FreeDiagonal`.
"""

from __future__ import annotations

from fractions import Fraction
import math
from math import fsum, inf, pi
from typing import NamedTuple, Protocol

from linkage_ros.kinematics.arithmetic import (
    atan2,
    copysign,
    cos,
    passes_zero,
    phase,
    Root,
    root_of,
    signed_root,
    sin,
    SMALLEST,
    sqrt,
    where,
)
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, Span


class Diagonal(NamedTuple):
    """The vector from A to D at one state of the linkage."""

    square: float  # s² = |AD|²; 0 where the direction is undefined
    direction: float  # Direction of AD, in [rad]
    # √(s² − lower²) and √(upper² − s²): the distance of the dyad from its limits. Signed at a
    # change point; stretch is 1 if the dyad has no upper limit.
    fold: float
    stretch: float
    gap: float  # Length by which A and D are too near or too far; 0 where the dyad closes
    # 2·√(ad)·sin(φ/2) and 2·√(ad)·cos(φ/2) of a `CrankDiagonal`, else 0.
    near_root: float
    far_root: float
    excess: float  # s² minus its constant part, ``least``
    status: Status  # Status of the dyad, as far as the diagonal decides it


class DiagonalRate(NamedTuple):
    """
    The rates of a diagonal: ṡ/s = w·g, and its direction changes at the rate b + w·h.

    g and h may be huge where A is next to D. A dyad multiplies them by factors that are as small
    there, and forms that product first.
    """

    log_length_rate: float  # g
    direction_rate: float  # h
    relative_rate: float  # w
    base_rate: float  # b
    growth_over_height: float  # g/(fold·stretch); at a change point all three are 0, this is not


class DiagonalAcceleration(NamedTuple):
    """
    The derivative of a `DiagonalRate`, with ṡ²/s² added to the derivative of ṡ/s.

    With its symbols, s̈/s = ẇ·g + w²·k, which avoids a difference of large numbers where A is next
    to D; the second derivative of the direction is ḃ + ẇ·h + w²·m.

    ``curvature_over_height`` is k minus a term of the dyad (e in its derivation is ġ + g² minus
    that term), divided by fold·stretch. Near a change point it would be a difference of large
    numbers, so a `CrankDiagonal` gives it in closed form; for all others it is None and the dyad
    computes it.
    """

    length_curvature: float  # k
    direction_curvature: float  # m
    relative_acceleration: float  # ẇ
    base_acceleration: float  # ḃ
    curvature_over_height: float | None


class AnyDiagonal(Span, Protocol):
    """The interface of a diagonal to a dyad; ``least`` is a constant lower bound of s²."""

    least: Fraction

    def diagonal_at(self, solved: LinkState, /) -> Diagonal:
        """Return the diagonal."""

    def rates(
        self, diagonal: Diagonal, solved: LinkState, velocities: LinkState, /
    ) -> DiagonalRate:
        """Return the rates of the diagonal's length and direction."""

    def accelerations(
        self,
        diagonal: Diagonal,
        rate: DiagonalRate,
        solved: LinkState,
        velocities: LinkState,
        accelerations: LinkState,
        /,
    ) -> DiagonalAcceleration:
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

    If a + d > 2·upper, s cannot come near a + d, and the second form of the last line is used: the
    first would cancel a + d. The brackets are constants of the linkage, and so is the sum of both
    differences, span = upper² − lower². It gives the greater difference from the smaller: where
    they are alike, a rounding error of one makes the other as much smaller, and their product,
    which has its extreme there, loses nothing. Computed each from its own bracket, it lost
    147 u·κ.

    A difference cancels if its constant is negative, and in the second form of the last line. So
    the start is not the smaller of both, but the one with the smaller sum of its value and its
    absolute terms: from F the relative errors of F and of S = span − F add up to
    u·span·(F + terms of F)/(F·S), and alike from S. Chosen by their values alone, a needle lost
    8 u·κ where the transmission angle was near 90°.

    a and d are in one unit; at best near 1. ``fold`` and ``stretch`` are the margins |d − a| −
    lower and upper − a − d, correctly rounded; stretch is infinite where the dyad has no upper
    limit. ``limits`` are lower, upper and span; upper and span may be infinite. ``arms`` are the
    indices, among the coordinates, of the directions of OA and OD. ``offset`` is φ minus their
    difference, in (−π, π] rad. The attributes along, quad and root are a·(d − a), 4ad and 2·√(ad),
    correctly rounded.
    """

    __slots__ = (
        '_apart_square', '_cancelled', '_half_turn', '_whole', 'along', 'arms', 'brackets',
        'fold_margin', 'least', 'limits', 'offset', 'quad', 'root', 'short_pair', 'sides',
        'stretch_margin',
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
        self._apart_square = float(self.least)
        self.sides = (a, d)
        self.along = float(Fraction(a) * (Fraction(d) - Fraction(a)))
        self.limits = limits
        self.fold_margin, self.stretch_margin = fold, stretch
        self.brackets = (fold * (least + lower), stretch * (upper + a + d))
        self.short_pair = a + d > 2.0 * upper
        self._whole = fsum((upper, -max(a, d), min(a, d))) * (upper + least)
        # Half of what the terms of one difference and its value add up to more than twice it.
        fold_bracket, stretch_bracket = self.brackets
        self._cancelled = max(0.0, -fold_bracket)
        if not self.short_pair:
            self._cancelled -= max(0.0, -stretch_bracket)
        self.root, self.quad = mean_root(a, d), float(4 * Fraction(a) * Fraction(d))
        self.arms = arms
        self.offset = offset
        self._half_turn = (math.sin(0.5 * offset), math.cos(0.5 * offset))

    def diagonal_at(self, solved: LinkState) -> Diagonal:
        first, second = self.arms
        base = solved.coordinates[second]
        half = 0.5 * (solved.coordinates[first] - base)
        half_sine, half_cosine = sin(half), cos(half)
        if self.offset:
            # The offset is not added to the angle, which may have turned a thousand times.
            sine, cosine = self._half_turn
            half_sine, half_cosine = (
                half_sine * cosine + half_cosine * sine,
                half_cosine * cosine - half_sine * sine,
            )
        near, far = self.root * half_sine, self.root * half_cosine
        # From the half angles, since the roots are rounded once more.
        excess, rest = self.quad * half_sine * half_sine, self.quad * half_cosine * half_cosine
        square = self._apart_square + excess
        lower, upper, span = self.limits
        if square < SMALLEST:
            status = Status.OPEN if lower else Status.INDETERMINATE
            return Diagonal(0.0, 0.0, 0.0, 0.0, lower, near, far, 0.0, status)
        a, d = self.sides
        direction = base + atan2(
            -2.0 * a * half_sine * half_cosine, d - a + 2.0 * a * half_sine * half_sine
        )
        fold_bracket, stretch_bracket = self.brackets
        fold, stretch = signed_root(fold_bracket, near, excess), Root(1.0)
        if fold.status is Status.OPEN:
            gap = fold.missing / (sqrt(square) + lower)
            return Diagonal(square, direction, 0.0, 0.0, gap, near, far, 0.0, Status.OPEN)
        if self.short_pair:
            stretch = root_of(self._whole - excess, abs(self._whole) + excess)
        elif upper != inf:
            stretch = signed_root(stretch_bracket, far, rest)
        if stretch.status is Status.OPEN:
            gap = stretch.missing / (sqrt(square) + upper)
            return Diagonal(square, direction, 0.0, 0.0, gap, near, far, 0.0, Status.OPEN)
        root_fold, root_stretch = fold.root, stretch.root
        status = Status.CLOSED
        if Status.TOGGLE in (fold.status, stretch.status):
            status = Status.TOGGLE
        else:
            if upper != inf:
                # One is computed from the other, unless it is signed.
                folding = fold_bracket + excess
                if self.short_pair:
                    stretching = self._whole - excess
                    folds = folding + self._cancelled < self._whole
                else:
                    stretching = stretch_bracket + rest
                    folds = folding + self._cancelled < stretching
                if fold_bracket:
                    root_fold = sqrt(where(folds, folding, span - stretching))
                if stretch_bracket:
                    root_stretch = sqrt(where(folds, span - folding, stretching))
            if (not fold_bracket and d != a and passes_zero(half_sine, half)) or (
                not stretch_bracket and passes_zero(half_cosine, half)
            ):
                status = self._at_change_point
        return Diagonal(square, direction, root_fold, root_stretch, 0.0, near, far, excess, status)

    def rates(self, diagonal: Diagonal, _solved: LinkState, velocities: LinkState) -> DiagonalRate:
        """
        Return g = q and h = −p for w = φ̇, and the rate of OD as b.

        With n̂ the diagonal's direction turned left::

            p = OA·AD/s² = −d(direction)/dφ = (a·(d − a) − near²/2)/s²
            q = OA·n̂/s   = (ds/dφ)/s        = near·far/(2s²)

        ``growth_over_height`` is q/(fold·stretch); at a change point fold equals near, or stretch
        equals far, and their ratio is 1.
        """
        first, second = self.arms
        square, near, far = diagonal.square, diagonal.near_root, diagonal.far_root
        p = (self.along - 0.5 * diagonal.excess) / square
        q = 0.5 * near * far / square
        fold_ratio, stretch_ratio = self.root_ratios(diagonal)
        base = velocities.coordinates[second]
        lean = 0.5 * fold_ratio * stretch_ratio / square
        return DiagonalRate(q, -p, velocities.coordinates[first] - base, base, lean)

    def root_ratios(self, diagonal: Diagonal) -> tuple[float, float]:
        """Return near/fold and far/stretch; the ratio is 1 where its bracket is 0."""
        fold_bracket, stretch_bracket = self.brackets
        return (
            diagonal.near_root / diagonal.fold if fold_bracket else 1.0,
            diagonal.far_root / diagonal.stretch if stretch_bracket else 1.0,
        )

    def accelerations(
        self,
        diagonal: Diagonal,
        rate: DiagonalRate,
        _solved: LinkState,
        _velocities: LinkState,
        accelerations: LinkState,
    ) -> DiagonalAcceleration:
        """
        Return the derivative of `rates`.

        The derivatives by φ are p' = −q·(1 + 2p) with 1 + 2p = (d² − a²)/s², and q' = p + p² − q².
        ``curvature_over_height`` is::

            ((d − a)² − lower²)·far²/(s² − lower²)/(4s²)
              − (upper² − (a + d)²)·near²/(upper² − s²)/(4s²)

        divided by fold·stretch. It equals q' + q² − q²·cot(σβ)·cot(σγ') of an RRR dyad, and
        q' + q²·(1 − c²) of an RPR dyad, without the cancellation: at a change point one of the
        brackets is 0, and near/fold or far/stretch is 1.
        """
        first, second = self.arms
        a, d = self.sides
        swirl = rate.log_length_rate * ((d - a) * (d + a) / diagonal.square)
        pull = -rate.direction_rate * (1.0 - rate.direction_rate)
        base = accelerations.coordinates[second]
        change = accelerations.coordinates[first] - base
        return DiagonalAcceleration(
            pull, swirl, change, base, self.curvature_over_height(diagonal)
        )

    def curvature_over_height(self, diagonal: Diagonal) -> float:
        """Return ``curvature_over_height``, as `accelerations` defines it."""
        near, far, fold, stretch = (
            diagonal.near_root,
            diagonal.far_root,
            diagonal.fold,
            diagonal.stretch,
        )
        fold_bracket, stretch_bracket = self.brackets
        fold_ratio, stretch_ratio = self.root_ratios(diagonal)
        bend = 0.0
        if fold_bracket:
            bend = fold_bracket * (far / fold) / fold * (stretch_ratio / fold)
        if self.limits[1] == inf:
            bend -= near * fold_ratio
        elif stretch_bracket:
            bend -= stretch_bracket * (near / stretch) / stretch * (fold_ratio / stretch)
        return 0.25 * bend / diagonal.square

    @property
    def crosses(self) -> tuple[bool, bool]:
        """Whether the dyad changes its side where it folds, and where it stretches."""
        return self.fold_margin == 0.0, self.stretch_margin == 0.0

    @property
    def singular_angles(self) -> tuple[float, ...]:
        """Differences of the two coordinates at which all links are collinear, in [rad]."""
        margins = ((self.fold_margin, 0.0), (self.stretch_margin, pi))
        return tuple(phi - self.offset for margin, phi in margins if margin == 0.0)


def mean_root(a: float, d: float) -> float:
    """Return 2·√(ad), correctly rounded."""
    # Two roots, since a·d may underflow if the lengths differ by many decades.
    root = 2.0 * math.sqrt(a) * math.sqrt(d)
    if not root:
        return root
    exact = Fraction(root)
    return float(exact - (exact - 4 * Fraction(a) * Fraction(d) / exact) / 2)


class UnsignedDiagonal(CrankDiagonal):
    """
    The diagonal between two pinned links neither of which an input turns against the ground.

    Their angles are known only modulo a turn, and so the sign of a half angle is unknown. A change
    point is therefore not passed: the assembly stays the named one, and the links turn back there
    as at a toggle.
    """

    __slots__ = ()

    _at_change_point = Status.TOGGLE

    @property
    def crosses(self) -> tuple[bool, bool]:
        return False, False

    def diagonal_at(self, solved: LinkState) -> Diagonal:
        signed = super().diagonal_at(solved)
        return signed._replace(fold=abs(signed.fold), stretch=abs(signed.stretch))

    def root_ratios(self, diagonal: Diagonal) -> tuple[float, float]:
        return diagonal.near_root / diagonal.fold, diagonal.far_root / diagonal.stretch


class NearlyCrossingDiagonal(CrankDiagonal):
    """
    The diagonal of a dyad whose lengths nearly make a change point.

    Its roots have the sign of the half angle, as at a change point. So the dyad stays
    next to the one without deviations, where a side alone would leave it.

    ``crosses``: whether the dyad without deviations changes its side where it folds and where it
    stretches.
    """

    __slots__ = ('_crosses',)

    def __init__(
        self,
        a: float,
        d: float,
        fold: float,
        stretch: float,
        limits: tuple[float, float, float],
        arms: tuple[int, int],
        offset: float,
        crosses: tuple[bool, bool],
    ) -> None:
        super().__init__(a, d, fold, stretch, limits, arms, offset)
        self._crosses = crosses

    @property
    def crosses(self) -> tuple[bool, bool]:
        return self._crosses

    def diagonal_at(self, solved: LinkState) -> Diagonal:
        diagonal = super().diagonal_at(solved)
        folds, stretches = self._crosses
        return diagonal._replace(
            fold=copysign(diagonal.fold, diagonal.near_root) if folds else diagonal.fold,
            stretch=copysign(diagonal.stretch, diagonal.far_root)
            if stretches
            else diagonal.stretch,
        )


def crank_diagonal_of(
    a: float,
    d: float,
    margins: tuple[float, float],
    limits: tuple[float, float, float],
    hinge: tuple[tuple[int, int], float],
    turns_matter: bool,
    crosses: tuple[bool, bool] | None,
) -> CrankDiagonal:
    """
    Return the diagonal between two pinned links, by the change points that it passes.

    ``margins`` are its fold and stretch, ``hinge`` its arms and its offset, as in `CrankDiagonal`.
    ``turns_matter``: whether a whole turn may lead to another pose, and the whole turns are
    unknown. ``crosses`` are the change points of the linkage without deviations; None for the
    change points of these lengths.
    """
    fold, stretch = margins
    if turns_matter:
        return UnsignedDiagonal(a, d, fold, stretch, limits, *hinge)
    if crosses is None or crosses == (fold == 0.0, stretch == 0.0):
        return CrankDiagonal(a, d, fold, stretch, limits, *hinge)
    return NearlyCrossingDiagonal(a, d, fold, stretch, limits, *hinge, crosses)


class FreeDiagonal:
    """
    The diagonal between two pins, from their coordinates.

    ``ends`` are the indices of A and D among the pins. ``limits`` are lower and upper of s, and
    upper² − lower², as in `CrankDiagonal`.
    """

    __slots__ = ('_ends', '_limits')

    least = Fraction(0)
    arms, crosses, singular_angles = (), (False, False), ()

    def __init__(self, ends: tuple[int, int], limits: tuple[float, float, float]) -> None:
        self._ends = ends
        self._limits = (*limits, limits[1] != inf)

    def diagonal_at(self, solved: LinkState) -> Diagonal:
        start, end = (solved.pins[i] for i in self._ends)
        return free_diagonal(end - start, abs(start) + abs(end), *self._limits)

    def rates(self, diagonal: Diagonal, solved: LinkState, velocities: LinkState) -> DiagonalRate:
        """Return the velocity of D against A, divided by AD."""
        first, second = self._ends
        vector = solved.pins[second] - solved.pins[first]
        return free_diagonal_rate(
            diagonal, vector, velocities.pins[second] - velocities.pins[first]
        )

    def accelerations(
        self,
        _diagonal: Diagonal,
        rate: DiagonalRate,
        solved: LinkState,
        _velocities: LinkState,
        accelerations: LinkState,
    ) -> DiagonalAcceleration:
        first, second = self._ends
        vector = solved.pins[second] - solved.pins[first]
        return free_diagonal_acceleration(
            rate, vector, accelerations.pins[second] - accelerations.pins[first]
        )


def free_diagonal(
    vector: complex, size: float, lower: float, upper: float, span: float, bounded: bool = True
) -> Diagonal:
    """Return the diagonal of a vector; ``size`` bounds the coordinates of its ends."""
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


def free_diagonal_rate(diagonal: Diagonal, vector: complex, velocity: complex) -> DiagonalRate:
    """Return the rates of a diagonal whose vector changes at a velocity."""
    unit = velocity / vector
    return DiagonalRate(
        unit.real, unit.imag, 1.0, 0.0, unit.real / diagonal.fold / diagonal.stretch
    )


def free_diagonal_acceleration(
    rate: DiagonalRate, vector: complex, acceleration: complex
) -> DiagonalAcceleration:
    """Return the derivative of `free_diagonal_rate`, given the acceleration of the vector."""
    square = acceleration / vector
    square += rate.direction_rate * (rate.direction_rate - 2j * rate.log_length_rate)
    return DiagonalAcceleration(square.real, square.imag, 0.0, 0.0, None)
