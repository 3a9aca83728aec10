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
RRR: two links pinned together; the coupler and the rocker of a four-bar.

The first link runs from its outer pin A to B, the second from its outer pin D to B. A, D and B are
a triangle with the sides s = |AD|, b = |AB| and c = |DB|, and everything follows from what its
sides fail to cancel::

    P  = b + c + s        Fs = b + c − s        Fb = c + s − b        Fc = b + s − c
    tan(β/2)  = √(Fb·Fs / (P·Fc))        β  = the angle at A from AD to AB
    tan(γ'/2) = √(P·Fb / (Fc·Fs))        γ' = the angle from AD to DB (π less the triangle's at D)
    AB × DB   = ½·√(P·Fs·Fb·Fc)          twice the area

(W. Kahan, Miscalculating Area and Angles of a Needle-like Triangle, 2014.) Taking γ' and not π −
γ' keeps small angles small. With σ = +1 where B lies left of A→D, the directions are

    θ3 = dir(AD) + σ·β        θ4 = dir(AD) + σ·γ'

Where the dyad folds (s → |b − c|) or stretches (s → b + c), the smaller of Fb and Fc, or Fs, goes
to zero; the diagonal gives their roots, signed at a change point, so that the motion passes it as
the linkage itself does, at any step and with no memory.

Rates, from the closing equation multiplied by DB and by AB, where the diagonal grows by g = ṡ/s
and turns by t::

    ω3 = t + g·cot(σ·γ')        cot(σ·γ') = (Fc·Fs − P·Fb)/(4·AB × DB) = (b² − c² − s²)/(2·AB × DB)
    ω4 = t + g·cot(σ·β)         cot(σ·β)  = (P·Fc − Fb·Fs)/(4·AB × DB) = (b² − c² + s²)/(2·AB × DB)

The first form of the cotangents is good for needles, where b or c is small. Where s is small, as
where A meets D, the products of the first are nearly equal, and the second is taken. Since ω3 − t
and ω4 − t are the rates of σ·β and σ·γ', these differentiate into::

    α3 = ṫ + cot(σ·γ')·e − g²·cot(σ·β)        e = ġ − g²·cot(σ·β)·cot(σ·γ')
    α4 = ṫ + cot(σ·β)·e − g²·cot(σ·γ')

At a change point the cotangents are infinite and e is zero; `CrankDiagonal` gives what remains of
it without the difference.

OA × DB = a·c·sin(θ4 − φ) says the same of a four-bar, but where crank and rocker are nearly
parallel it takes the difference of two angles that were rounded at the size of a half-turn: 6,500
u·κ was measured.
"""

from __future__ import annotations

from math import atan2, sqrt
from typing import NamedTuple

from linkage_ros.kinematics.diagonal import (
    AnyDiagonal,
    CrankDiagonal,
    Diagonal,
    folded,
    Growth,
    GrowthChange,
    margin,
    SMALLEST,
    UnsignedDiagonal,
)
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import State
from linkage_ros.tuples import new

_CLOSED, _TOGGLE = Status.CLOSED, Status.TOGGLE


class RRRPose(NamedTuple):
    """
    The dyad at one state of the linkage.

    Attributes
    ----------
    status
        Whether it closes.
    gap
        What the links miss each other by where it does not, else 0, in the unit of the lengths.
    first, second
        θ3 and θ4, directions of A→B and D→B, in [rad].
    cross
        AB × DB, signed; 0 at a toggle.
    diagonal
        From A to D.
    halves
        Numerator and denominator of tan(β/2), then of tan(γ'/2).

    """

    status: Status
    gap: float
    first: float
    second: float
    cross: float
    diagonal: Diagonal
    halves: tuple[float, float, float, float]


class RRRRates(NamedTuple):
    """The growth of the diagonal, and the cotangents of σ·β and σ·γ'."""

    growth: Growth
    cot_beta: float
    cot_gamma: float


_NO_HALVES = (0.0, 0.0, 0.0, 0.0)


class RRRDyad:
    """
    Two links pinned together.

    Parameters
    ----------
    diagonal
        From A to D, with the limits |b − c| and b + c.
    b, c
        Lengths of the first and the second link, in one unit; at best near 1.
    sign
        The assembly: +1 where B lies left of A→D, −1 where it lies right of it. Where the diagonal
        passes a change point: for 0 < φ < π.

    """

    __slots__ = ('_constants', '_sides', 'diagonal')

    def __init__(self, diagonal: AnyDiagonal, b: float, c: float, sign: int) -> None:
        self.diagonal = diagonal
        self._sides = (b, c)
        self._constants = (b, c, abs(b - c), float(sign))

    def close(self, known: State) -> RRRPose:
        """Append the directions of both links."""
        pose = close_triangle(self.diagonal.at(known), *self._constants)
        known[0].append(pose[2])
        known[0].append(pose[3])
        return pose

    def rates(self, pose: RRRPose, known: State, speeds: State) -> RRRRates:
        """Append the rates of both links."""
        growth = self.diagonal.rates(pose.diagonal, known, speeds)
        return triangle_rates(pose, *self._sides, growth, speeds)

    def accelerations(
        self, pose: RRRPose, rates: RRRRates, known: State, speeds: State, changes: State
    ) -> None:
        """Append the accelerations of both links."""
        change = self.diagonal.accelerations(pose.diagonal, rates.growth, known, speeds, changes)
        triangle_accelerations(rates, change, changes)

    def transmission_angle(self, pose: RRRPose) -> float:
        """Return the angle between the two links at B, folded into [0, π/2], in [rad]."""
        return folded(pose.second - pose.first)


def crank_diagonal(
    a: float,
    b: float,
    c: float,
    d: float,
    arms: tuple[int, int] = (1, 0),
    offset: float = 0.0,
    turns_known: bool = True,
) -> CrankDiagonal:
    """
    Return the diagonal of the four-bar with crank a, coupler b, rocker c and ground d.

    Of a parallelogram whole turns need not be known: both roots change their sign with one.
    """
    fold = margin(max(a, d), -min(a, d), -max(b, c), min(b, c))
    stretch = margin(b, c, -a, -d)
    kind = CrankDiagonal if turns_known or fold == stretch == 0.0 else UnsignedDiagonal
    return kind(a, d, fold, stretch, (abs(b - c), b + c), arms, offset)


def close_triangle(
    diagonal: Diagonal, b: float, c: float, side_difference: float, sign: float
) -> RRRPose:
    """Return the pose over a diagonal."""
    s, direction, root_fold, root_stretch, gap, _, _ = diagonal
    if gap:
        return RRRPose(Status.OPEN, gap, 0.0, 0.0, 0.0, diagonal, _NO_HALVES)
    if not s:
        return RRRPose(Status.INDETERMINATE, 0.0, 0.0, 0.0, 0.0, diagonal, _NO_HALVES)
    root_perimeter = sqrt(b + c + s)
    root_wide = sqrt(s + side_difference)
    if b >= c:  # Fb is the one that goes to zero
        beta_y, beta_x = root_fold * root_stretch, root_perimeter * root_wide
        gamma_y, gamma_x = root_perimeter * root_fold, root_wide * root_stretch
    else:
        beta_y, beta_x = root_wide * root_stretch, root_perimeter * root_fold
        gamma_y, gamma_x = root_perimeter * root_wide, root_fold * root_stretch
    cross = 0.5 * sign * beta_y * beta_x
    if -SMALLEST < cross < SMALLEST:
        cross = 0.0
    first = direction + 2.0 * sign * atan2(beta_y, beta_x)
    second = direction + 2.0 * sign * atan2(gamma_y, gamma_x)
    halves = (beta_y, beta_x, gamma_y, gamma_x)
    status = _CLOSED if cross else _TOGGLE
    return new(RRRPose, (status, 0.0, first, second, cross, diagonal, halves))


def triangle_rates(pose: RRRPose, b: float, c: float, growth: Growth, speeds: State) -> RRRRates:
    """Append ω3 and ω4 of a closed pose; return the cotangents."""
    s, cross = pose.diagonal.length, pose.cross
    if s < min(b, c):
        square, difference = s * (s / cross), (b - c) * ((b + c) / cross)
        cot_beta, cot_gamma = 0.5 * (difference + square), 0.5 * (difference - square)
    else:
        beta_y, beta_x, gamma_y, gamma_x = pose.halves
        area = 4.0 * cross
        cot_beta = (beta_x * beta_x - beta_y * beta_y) / area
        cot_gamma = (gamma_x * gamma_x - gamma_y * gamma_y) / area
    unit, swing, base = growth
    grown, turned = unit.real, unit.imag
    speeds[0].append(base + swing * (turned + grown * cot_gamma))
    speeds[0].append(base + swing * (turned + grown * cot_beta))
    return new(RRRRates, (growth, cot_beta, cot_gamma))


def triangle_accelerations(rates: RRRRates, change: GrowthChange, changes: State) -> None:
    """Append α3 and α4."""
    (unit, swing, _), cot_beta, cot_gamma = rates
    square, pull, base, bend = change
    q = unit.real
    bend = square.real - q * cot_beta * (q * cot_gamma) if bend is None else bend - q * q
    for cot, other in ((cot_gamma, cot_beta), (cot_beta, cot_gamma)):
        bent = square.imag + cot * bend - q * (q * other)
        changes[0].append(base + pull * (unit.imag + q * cot) + swing * swing * bent)
