# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
RRR: two links pinned together; the coupler and the rocker of a four-bar.

The first link runs from its outer pin A to B, the second from its outer pin D to B. A, D and B
form a triangle with the sides s = |AD|, b = |AB| and c = |DB|. With σ = +1 if B lies left of A→D::

    K = σ·√((s² − (b − c)²)·((b + c)² − s²)) = 2·AB × DB
    θ3 = dir(AD) + atan2(K, (b² − c²) + s²)
    θ4 = dir(AD) + atan2(K, (b² − c²) − s²)

Both factors of K come from the diagonal, where the terms that cancel as the dyad folds or
stretches are a constant of the linkage. At a change point their roots are signed, so that the
motion passes it as the linkage itself does, at any step and with no memory.

Rates, from the closing equation multiplied by DB and by AB, with g = ṡ/s and t the rate of the
diagonal's direction. With β = θ3 − dir(AD) and γ' = θ4 − dir(AD) let
M = (b² − c²) + s² = K·cot(β) and L = (b² − c²) − s² = K·cot(γ')::

    ω3 = t + L·(g/K)        ω4 = t + M·(g/K)

Since ω3 − t and ω4 − t are the rates of β and γ', the derivatives are::

    α3 = ṫ + L·(e/K) − 2g·(g/K)·(b² − c²)
    α4 = ṫ + M·(e/K) − 2g·(g/K)·(b² − c²)        e = ġ + g² − L·M·(g/K)²

At a change point g, e and K are 0: the diagonal gives both quotients.

For a four-bar OA × DB = a·c·sin(θ4 − φ) is an alternative, but where crank and rocker are nearly
parallel it is the difference of two angles that were rounded at the size of a half-turn: 6,500 u·κ
were measured.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

from linkage_ros.kinematics.arithmetic import (
    acute_angle,
    atan2,
    copysign,
    exact_sum,
    phase,
    SMALLEST,
    unit_vector,
)
from linkage_ros.kinematics.plane.diagonals import (
    AnyDiagonal,
    crank_diagonal_of,
    CrankDiagonal,
    Diagonal,
    DiagonalAcceleration,
    DiagonalRate,
    free_diagonal,
    free_diagonal_acceleration,
    free_diagonal_rate,
    NearlyCrossingDiagonal,
)
from linkage_ros.kinematics.plane.dyads.two_sided import TwoSided
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState


class RRRPose(NamedTuple):
    """The dyad at one state of the linkage."""

    status: Status  # Whether it closes
    gap: float  # Distance by which the links miss each other, or 0, in the unit of the lengths
    # θ3 and θ4, directions of A→B and D→B, in [rad].
    first: float
    second: float
    cross: float  # K = 2·AB × DB, signed; 0 at a toggle
    diagonal: Diagonal  # From A to D
    # (b² − c²) ± s².
    more: float
    less: float


class RRRDyad(TwoSided):
    """
    Two links pinned together.

    The diagonal goes from A to D, with the limits |b − c| and b + c. b and c are the lengths of
    the first and the second link, in one unit; at best near 1. The sign is +1 if B lies left of
    A→D, −1 if it lies right; if the diagonal passes a change point, this holds for 0 < φ < π.
    """

    __slots__ = ('_difference', '_sums', 'diagonal')

    def __init__(self, diagonal: AnyDiagonal, b: float, c: float, sign: int) -> None:
        self.diagonal = diagonal
        self._sums = square_sums(b, c, diagonal.least)
        super().__init__(sign)
        self._difference = (b - c) * (b + c)

    def close(self, solved: LinkState) -> RRRPose:
        """Append the directions of both links."""
        pose = close_triangle(self.diagonal.diagonal_at(solved), *self._sums, self._sign)
        solved.coordinates.append(pose.first)
        solved.coordinates.append(pose.second)
        return pose

    def rates(self, pose: RRRPose, solved: LinkState, velocities: LinkState) -> DiagonalRate:
        """Append the rates of both links."""
        rate = self.diagonal.rates(pose.diagonal, solved, velocities)
        triangle_rates(pose, self._sign, rate, velocities)
        return rate

    def accelerations(
        self,
        pose: RRRPose,
        rate: DiagonalRate,
        solved: LinkState,
        velocities: LinkState,
        accelerations: LinkState,
    ) -> None:
        """Append the accelerations of both links."""
        acceleration = self.diagonal.accelerations(
            pose.diagonal, rate, solved, velocities, accelerations
        )
        triangle_accelerations(
            pose, self._sign, self._difference, rate, acceleration, accelerations
        )

    @property
    def span(self) -> AnyDiagonal:
        """Return its diagonal."""
        return self.diagonal

    def side_of(self, pose: RRRPose) -> float:
        """Return a number with the sign of the assembly; 0 where it is singular."""
        return pose.cross

    def transmission_angle(self, pose: RRRPose) -> float:
        """Return the angle between the two links at B, folded into [0, π/2], in [rad]."""
        return acute_angle(pose.second - pose.first)


def crank_diagonal(
    a: float,
    b: float,
    c: float,
    d: float,
    arms: tuple[int, int] = (1, 0),
    offset: float = 0.0,
    turns_known: bool = True,
    crosses: tuple[bool, bool] | None = None,
) -> CrankDiagonal:
    """
    Return the diagonal of the four-bar with crank a, coupler b, rocker c and ground d.

    The whole turns of a parallelogram need not be known: both roots change sign with a turn.
    """
    fold = exact_sum(max(a, d), -min(a, d), -max(b, c), min(b, c))
    stretch = exact_sum(b, c, -a, -d)
    both = fold == stretch == 0.0 if crosses is None else all(crosses)
    limits = (abs(b - c), b + c, 4.0 * b * c)
    turns_matter = not (turns_known or both)
    return crank_diagonal_of(a, d, (fold, stretch), limits, (arms, offset), turns_matter, crosses)


def square_sums(b: float, c: float, least: Fraction) -> tuple[float, float]:
    """Return (b² − c²) ± the constant part of s², correctly rounded."""
    difference = Fraction(b) ** 2 - Fraction(c) ** 2
    return float(difference + least), float(difference - least)


def close_triangle(diagonal: Diagonal, more: float, less: float, sign: float) -> RRRPose:
    """Return the pose over a diagonal; more and less are the two `square_sums`."""
    status = diagonal.status
    if not status.has_pose:
        return RRRPose(status, diagonal.gap, 0.0, 0.0, 0.0, diagonal, 0.0, 0.0)
    cross = sign * diagonal.fold * diagonal.stretch
    if status is Status.CLOSED and abs(cross) < SMALLEST:
        cross, status = 0.0, Status.TOGGLE
    more, less = more + diagonal.excess, less - diagonal.excess
    first = diagonal.direction + atan2(cross, more)
    second = diagonal.direction + atan2(cross, less)
    return RRRPose(status, 0.0, first, second, cross, diagonal, more, less)


def triangle_rates(pose: RRRPose, sign: float, rate: DiagonalRate, velocities: LinkState) -> None:
    """Append ω3 and ω4 of a closed pose."""
    lean = sign * rate.growth_over_height
    for part in (pose.less, pose.more):
        velocities.coordinates.append(
            rate.base_rate + rate.relative_rate * (part * lean + rate.direction_rate)
        )


def triangle_accelerations(
    pose: RRRPose,
    sign: float,
    difference: float,
    rate: DiagonalRate,
    acceleration: DiagonalAcceleration,
    accelerations: LinkState,
) -> None:
    """Append α3 and α4."""
    lean = sign * rate.growth_over_height
    if acceleration.curvature_over_height is None:
        bend = (acceleration.length_curvature - pose.more * lean * (pose.less * lean)) / pose.cross
    else:
        bend = sign * acceleration.curvature_over_height
    swirl = acceleration.direction_curvature - 2.0 * rate.log_length_rate * (lean * difference)
    whirl = rate.relative_rate * rate.relative_rate
    for part in (pose.less, pose.more):
        first = part * lean + rate.direction_rate
        accelerations.coordinates.append(
            acceleration.base_acceleration
            + acceleration.relative_acceleration * first
            + whirl * (swirl + part * bend)
        )


class FoldingRRRRates(NamedTuple):
    """The rates, and the terms that the accelerations start from."""

    relative_rate: float  # φ̇
    # ω3 and ω4 for φ̇ = 1, relative to OD.
    first: float
    second: float
    side: float  # σ, with the opposite sign if far is below 0
    constant: float  # k


class FoldingRRRDyad(RRRDyad):
    """
    Two links pinned together, on two pinned links, that can lie folded along each other.

    At that change point |d − a| = |b − c|, and one root of `RRRDyad` over a `CrankDiagonal` is
    near itself. Where A passes D closely, s is small, and nearly all cancels in
    ω = (σρ·((b² − c²) ± s²) − 2a(d − a) + near²)/(2s²) with ρ = far/stretch. With A = a + d,
    B = b + c, R = stretch and its bracket N = B² − A²::

        ρ² = (A² − s²)/(B² − s²)        B·ρ = A − s²·w        w = N/(R·(B·far + A·R))

    Inserted, s² divides all but a constant, which is 0 on one side (σ = +1 if b − c = d − a)::

        ω3 = (1 − σρ − σ·(b − c)·w)/2 − k/(2s²)
        ω4 = (1 + σρ − σ·(b − c)·w)/2 − k/(2s²)        k = A·((d − a) − σ·(b − c))

    and 1 − ρ = N/R²/(1 + ρ). A parallelogram has N = 0 and ω4 = 1. The derivative of s² by φ is
    near·far; with H = B·(R² + far²)/(2R) + A·far::

        α3 = σ·N·near/2·(+1/(2R³) − (b − c)·H/G²) + k·near·far/(2s⁴)
        α4 = σ·N·near/2·(−1/(2R³) − (b − c)·H/G²) + k·near·far/(2s⁴)        G = N/w

    If far is below 0, so is ρ: σ and near change their signs, and far is taken positive. Without
    this form 4,000 u·κ of a velocity and 10⁶ u·κ of an acceleration were lost, where κ is the
    condition of lengths which change together, so that the change point remains one.

    The diagonal is one that `passes_fold`.
    """

    __slots__ = ('_constants',)

    diagonal: CrankDiagonal

    def __init__(self, diagonal: CrankDiagonal, b: float, c: float, sign: int) -> None:
        super().__init__(diagonal, b, c, sign)
        a, d = diagonal.sides
        whole = Fraction(a) + Fraction(d)
        apart = Fraction(d) - Fraction(a)
        left, right = (
            float(whole * (apart - Fraction(first) + Fraction(second)))
            if exact_sum(d, -a, -first, second)
            else 0.0
            for first, second in ((b, c), (c, b))
        )
        self._constants = (float(whole), b + c, b - c, diagonal.brackets[1], left, right)

    @staticmethod
    def passes_fold(diagonal: AnyDiagonal) -> bool:
        """Return whether a diagonal passes a change point where the links fold."""
        return (
            isinstance(diagonal, CrankDiagonal)
            and not isinstance(diagonal, NearlyCrossingDiagonal)
            and not diagonal.brackets[0]
        )

    def rates(  # type: ignore[override]  # other ones
        self, pose: RRRPose, _solved: LinkState, velocities: LinkState
    ) -> FoldingRRRRates:
        """Append the rates of both links."""
        outer, inner, apart, bracket, left, right = self._constants
        stretch, far = pose.diagonal.stretch, pose.diagonal.far_root
        fold_ratio, stretch_ratio = self.diagonal.root_ratios(pose.diagonal)
        ratio = self._sign * fold_ratio * stretch_ratio
        side = copysign(1.0, ratio)
        # 1 on one side and 0 on the other.
        same, opposite = 0.5 + 0.5 * side, 0.5 - 0.5 * side
        constant = same * left + opposite * right
        more, less, bent = 1.0 + abs(ratio), 0.0, 0.0
        if bracket:
            less = bracket / stretch / stretch / more
            bent = side * apart * (bracket / (stretch * (inner * abs(far) + outer * stretch)))
        rest = 0.5 * bent + 0.5 * constant / pose.diagonal.square
        v = velocities.coordinates
        i, j = self.diagonal.arms
        base = v[j]
        swing = v[i] - base
        first = 0.5 * (same * less + opposite * more) - rest
        second = 0.5 * (same * more + opposite * less) - rest
        v.append(base + swing * first)
        v.append(base + swing * second)
        return FoldingRRRRates(swing, first, second, side, constant)

    def accelerations(  # type: ignore[override]  # of its own rates
        self,
        pose: RRRPose,
        rates: FoldingRRRRates,
        _solved: LinkState,
        _velocities: LinkState,
        accelerations: LinkState,
    ) -> None:
        """Append the accelerations of both links."""
        outer, inner, apart, bracket, _, _ = self._constants
        square, stretch = pose.diagonal.square, pose.diagonal.stretch
        near, far = pose.diagonal.near_root, pose.diagonal.far_root
        whirl = 0.5 * rates.constant * (near / square) * (far / square)
        turn = 0.0
        if bracket:
            size = abs(far)
            part = inner * size + outer * stretch
            push = 0.5 * rates.side * bracket * near * copysign(1.0, far)
            turn = 0.5 * push / stretch / stretch / stretch
            slope = 0.5 * inner * (stretch + size * (size / stretch)) + outer * size
            whirl -= push * apart * (slope / stretch / part) / stretch / part
        a = accelerations.coordinates
        i, j = self.diagonal.arms
        base = a[j]
        pull, square_rate = a[i] - base, rates.relative_rate * rates.relative_rate
        a.append(base + pull * rates.first + square_rate * (whirl + turn))
        a.append(base + pull * rates.second + square_rate * (whirl - turn))


class DrivenOffset(NamedTuple):
    """
    The transformation from the frame of one link to the frame of a link it is driven against.

    A point z becomes origin + e^{i·(angle + sign·x[turn])}·(z − inner) + sign·x[slide]·unit; turn
    or slide is the index of the input, and the other is −1.
    """

    origin: complex
    inner: complex
    angle: float
    turn: int
    slide: int
    sign: float
    unit: complex


@dataclass(frozen=True, slots=True)
class DyadSide:
    """A vector between two points of a group of links, in the frame of the first one's link."""

    start: complex  # In the frame of its own link; so is the end
    end: complex
    transforms: tuple[DrivenOffset, ...]  # From the link of the end to the link of the start

    def vector_at(self, x: list[float]) -> complex:
        """Return the vector."""
        z = self.end
        for origin, inner, angle, turn, slide, sign, unit in self.transforms:
            if turn >= 0:
                z = origin + unit_vector(angle + sign * x[turn]) * (z - inner)
            else:
                z = origin + unit_vector(angle) * (z - inner) + sign * x[slide] * unit
        return z - self.start

    def vector_derivatives(
        self, x: list[float], v: list[float], a: list[float] | None = None
    ) -> tuple[complex, complex]:
        """Return the first derivative, and the second if accelerations are given."""
        z, rate, change = self.end, 0j, 0j
        for origin, inner, angle, turn, slide, sign, unit in self.transforms:
            if turn >= 0:
                turned = unit_vector(angle + sign * x[turn])
                w = sign * v[turn]
                arm = z - inner
                if a is not None:
                    pull = (1j * (sign * a[turn]) - w * w) * arm
                    change = turned * (change + 2j * w * rate + pull)
                rate = turned * (rate + 1j * w * arm)
                z = origin + turned * arm
            else:
                held = unit_vector(angle)
                if a is not None:
                    change = held * change + sign * a[slide] * unit
                rate = held * rate + sign * v[slide] * unit
                z = origin + held * (z - inner) + sign * x[slide] * unit
        return rate, change


class DrivenRRRPose(NamedTuple):
    """The triangle, and both sides in the frames of their first links."""

    status: Status
    gap: float
    triangle: RRRPose
    sides: tuple[complex, complex]


class DrivenRRRRates(NamedTuple):
    """The rates of the diagonal and of both sides."""

    diagonal_rate: DiagonalRate
    sides: tuple[complex, complex]


class DrivenRRRDyad(TwoSided):
    """
    RRR whose sides change their length: cylinders, and links with a motor in them.

    A side of the triangle runs through links that driven joints hold together, so its vector z in
    the frame of its first link is a function of the inputs. At one state it is a triangle like any
    other. For the rates, ż·e^{iθ}, the velocity of the end of a side that does not turn, is added
    to the velocity of its outer pin; this gives the velocity equation of a dyad of constant sides.
    Likewise (z̈ + 2i·θ̇·ż)·e^{iθ} for the accelerations.

    ``ends`` are the indices of the outer pins A and D among the pins. The sides go from A to B,
    and from D to B. The sign is +1 if B lies left of A→D, −1 if it lies right.
    """

    __slots__ = ('_ends', '_sides')

    def __init__(self, ends: tuple[int, int], sides: tuple[DyadSide, DyadSide], sign: int) -> None:
        self._ends = ends
        self._sides = sides
        super().__init__(sign)

    def close(self, solved: LinkState) -> DrivenRRRPose:
        """Append the angles of the first link of each group."""
        x = solved.coordinates
        start, end = (solved.pins[i] for i in self._ends)
        first, second = (side.vector_at(x) for side in self._sides)
        b, c = abs(first), abs(second)
        diagonal = free_diagonal(
            end - start, abs(start) + abs(end), abs(b - c), b + c, 4.0 * b * c
        )
        difference = (b - c) * (b + c)
        pose = close_triangle(diagonal, difference, difference, self._sign)
        x.append(pose.first - phase(first))
        x.append(pose.second - phase(second))
        return DrivenRRRPose(pose.status, pose.gap, pose, (first, second))

    def rates(
        self, pose: DrivenRRRPose, solved: LinkState, velocities: LinkState
    ) -> DrivenRRRRates:
        """Append the rates of the first link of each group."""
        start, end = self._ends
        (first, _), (second, _) = (
            side.vector_derivatives(solved.coordinates, velocities.coordinates)
            for side in self._sides
        )
        unit, other_unit = self._unit_vectors(pose)
        between = (
            velocities.pins[end] + second * other_unit - velocities.pins[start] - first * unit
        )
        vector = solved.pins[end] - solved.pins[start]
        rate = free_diagonal_rate(pose.triangle.diagonal, vector, between)
        triangle_rates(pose.triangle, self._sign, rate, velocities)
        return DrivenRRRRates(rate, (first, second))

    def accelerations(
        self,
        pose: DrivenRRRPose,
        rates: DrivenRRRRates,
        solved: LinkState,
        velocities: LinkState,
        accelerations: LinkState,
    ) -> None:
        """Append the accelerations of the first link of each group."""
        x, v, a = solved.coordinates, velocities.coordinates, accelerations.coordinates
        start, end = self._ends
        growth, triangle = rates.diagonal_rate, pose.triangle
        lean = self._sign * growth.growth_over_height
        # The rates of the links of this dyad, as `rates` has appended them.
        turns = (
            growth.direction_rate + triangle.less * lean,
            growth.direction_rate + triangle.more * lean,
        )
        pulls = []
        for side, turn, rate, unit in zip(
            self._sides, turns, rates.sides, self._unit_vectors(pose), strict=True
        ):
            _, change = side.vector_derivatives(x, v, a)
            pulls.append((change + 2j * turn * rate) * unit)
        first, second = pulls
        between = accelerations.pins[end] + second - accelerations.pins[start] - first
        growth_change = free_diagonal_acceleration(
            growth, solved.pins[end] - solved.pins[start], between
        )
        b, c = map(abs, pose.sides)
        difference = (b - c) * (b + c)
        triangle_accelerations(
            triangle, self._sign, difference, growth, growth_change, accelerations
        )

    def side_of(self, pose: DrivenRRRPose) -> float:
        """Return a number with the sign of the assembly; 0 where it is singular."""
        return pose.triangle.cross

    def transmission_angle(self, pose: DrivenRRRPose) -> float:
        """Return the angle between the two sides at B, folded into [0, π/2], in [rad]."""
        return acute_angle(pose.triangle.second - pose.triangle.first)

    def _unit_vectors(self, pose: DrivenRRRPose) -> tuple[complex, complex]:
        """Return e^{iθ} of the first link of each group."""
        triangle, (first, second) = pose.triangle, pose.sides
        return (
            unit_vector(triangle.first - phase(first)),
            unit_vector(triangle.second - phase(second)),
        )


class InvertedRRRPose(NamedTuple):
    """The triangle in the frame of the driving link, and the coordinates that it closes from."""

    status: Status
    gap: float
    triangle: RRRPose
    within: LinkState


class InvertedRRRDyad(TwoSided):
    """
    A four-bar whose input is the angle between its coupler and a crank: its kinematic inversion.

    Both outer pins A and D are on one link, and A is on the first of two links that the input
    turns against each other at P. In the frame of that first link the input is the angle of a
    crank PB, and AD is the coupler: `RRRDyad` over a `CrankDiagonal` from B to A closes it, and
    passes its change points. With the directions δ₁ of B→D and δ₂ of A→D there, measured from
    P→A, and ψ of A→D on its own link, P→A has the direction ψ − δ₂, and B→D the direction
    ψ + δ₁ − δ₂. If the input turns the other way, all is mirrored.

    ``base`` is the coordinate of the link that carries A and D, ``inner`` that of the input.
    ``mirror`` is −1 if the input is the angle of the first link against the second; ``flip`` is
    the sign of the triangle where this dyad has the sign +1.
    """

    __slots__ = ('_base', '_dyad', '_flip', '_inner', '_mirror')

    def __init__(self, dyad: RRRDyad, base: int, inner: int, mirror: float, flip: int) -> None:
        self._dyad = dyad
        self._base, self._inner = base, inner
        self._mirror, self._flip = mirror, flip
        super().__init__(dyad.sign * flip)

    def with_sign(self, sign: int) -> InvertedRRRDyad:
        """Return the same dyad in the assembly of a sign."""
        dyad: RRRDyad = self._dyad.with_sign(sign * self._flip)
        return InvertedRRRDyad(dyad, self._base, self._inner, self._mirror, self._flip)

    def close(self, solved: LinkState) -> InvertedRRRPose:
        """Append the directions of P→A and of B→D."""
        within = LinkState(solved.coordinates[: self._inner + 1], [])
        pose = self._dyad.close(within)
        if pose.status.has_pose:
            self._append(solved.coordinates, within.coordinates)
        return InvertedRRRPose(pose.status, pose.gap, pose, within)

    def rates(
        self, pose: InvertedRRRPose, _solved: LinkState, velocities: LinkState
    ) -> tuple[DiagonalRate, LinkState]:
        """Append the rates of both."""
        within = LinkState(velocities.coordinates[: self._inner + 1], [])
        rate = self._dyad.rates(pose.triangle, pose.within, within)
        self._append(velocities.coordinates, within.coordinates)
        return rate, within

    def accelerations(
        self,
        pose: InvertedRRRPose,
        rates: tuple[DiagonalRate, LinkState],
        _solved: LinkState,
        _velocities: LinkState,
        accelerations: LinkState,
    ) -> None:
        """Append the accelerations of both."""
        rate, velocities = rates
        within = LinkState(accelerations.coordinates[: self._inner + 1], [])
        self._dyad.accelerations(pose.triangle, rate, pose.within, velocities, within)
        self._append(accelerations.coordinates, within.coordinates)

    def _append(self, into: list[float], within: list[float]) -> None:
        base, (first, second) = into[self._base], within[-2:]
        into.append(base - self._mirror * second)
        into.append(base + self._mirror * (first - second))

    @property
    def span(self) -> AnyDiagonal:
        """Return its diagonal."""
        return self._dyad.diagonal

    def side_of(self, pose: InvertedRRRPose) -> float:
        """Return a number with the sign of the assembly; 0 where it is singular."""
        return self._flip * pose.triangle.cross

    def transmission_angle(self, pose: InvertedRRRPose) -> float:
        """Return the angle between the two sides at B, folded into [0, π/2], in [rad]."""
        return acute_angle(pose.triangle.first - pose.triangle.diagonal.direction)
