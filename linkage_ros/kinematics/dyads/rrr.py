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

In the frame of the loop (`diagonal`) the coupler runs from the crank pin A to B, the rocker from
the ground pivot D to B. A, D and B are a triangle with the sides s = |AD|, b = |AB| and c = |DB|,
and everything follows from what its sides fail to cancel::

    P  = b + c + s        Fs = b + c − s        Fb = c + s − b        Fc = b + s − c
    tan(β/2)  = √(Fb·Fs / (P·Fc))        β  = the angle at A from AD to AB
    tan(γ'/2) = √(P·Fb / (Fc·Fs))        γ' = the angle from AD to DB (π less the triangle's at D)
    AB × DB   = ½·√(P·Fs·Fb·Fc)          twice the area

(W. Kahan, Miscalculating Area and Angles of a Needle-like Triangle, 2014.) Taking γ' and not π −
γ' keeps small angles small. With σ = +1 where B lies left of A→D, the directions are

    θ3 = dir(AD) + σ·β        θ4 = dir(AD) + σ·γ'

Where the dyad folds (s → |b − c|) or stretches (s → b + c), the smaller of Fb and Fc, or Fs, goes
to zero. Neither is taken as a difference of s, which has lost the digits by then, but from the
diagonal::

    s − |b − c| = (|d − a| − |b − c|) + near²/(s + |d − a|)
    b + c − s   = (b + c − a − d) + far²/(s + a + d)
                = (b + c − |d − a|) − near²/(s + |d − a|)

Where crank and ground are long beside coupler and rocker, so that no stretch can be near s = a +
d, the last line is taken: the one before it would cancel a + d. The brackets are constants of the
linkage. Where one of them is zero (a change point), the root of the difference is near/√(s + |d −
a|), or far/√(s + a + d), which changes sign with the half angle: the motion passes the change
point as the linkage itself does, at any step and with no memory (`reach`).

Rates, with OA the crank, from the loop's velocity equation multiplied by DB and by AB, and with OA
taken along the diagonal and across it (p and q of `CrankDiagonal.swing`)::

    ω3 = −ω2·(OA × DB)/(AB × DB) = −ω2·(p − q·cot(σ·γ'))
    ω4 = −ω2·(OA × AB)/(AB × DB) = −ω2·(p − q·cot(σ·β))
    cot(σ·β)  = (P·Fc − Fb·Fs)/(4·AB × DB) = (b² − c² + s²)/(2·AB × DB)
    cot(σ·γ') = (Fc·Fs − P·Fb)/(4·AB × DB) = (b² − c² − s²)/(2·AB × DB)

The first form is good for needles, where b or c is small. Where s is small, as where A meets D,
the products of the first are nearly equal, and the second is taken.

OA × DB = a·c·sin(θ4 − φ) says the same, but where crank and rocker are nearly parallel it takes
the difference of two angles that were rounded at the size of a half-turn: 6,500 u·κ was measured.
"""

from __future__ import annotations

from math import atan2, fsum, sqrt
from typing import NamedTuple

from linkage_ros.kinematics.diagonal import (
    CrankDiagonal,
    Diagonal,
    margin,
    reach,
    SMALLEST,
)
from linkage_ros.kinematics.status import Status
from linkage_ros.tuples import new

_CLOSED, _TOGGLE = Status.CLOSED, Status.TOGGLE


class RRRPose(NamedTuple):
    """
    The dyad at one crank direction, angles in the frame of the loop.

    Attributes
    ----------
    status
        Whether the loop closes.
    gap
        What the links miss each other by where it is open, else 0, in the unit of the lengths.
    coupler, rocker
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
    coupler: float
    rocker: float
    cross: float
    diagonal: Diagonal
    halves: tuple[float, float, float, float]


_NO_HALVES = (0.0, 0.0, 0.0, 0.0)


class RRRDyad:
    """
    The dyad of a four-bar.

    Parameters
    ----------
    a, b, c, d
        Lengths of crank, coupler, rocker and ground, in one unit; at best near 1.
    sign
        The assembly: +1 where B lies left of A→D, −1 where it lies right of it. In a change-point
        linkage: for 0 < φ < π.

    """

    __slots__ = ('_constants', '_diagonal', 'fold_margin', 'sides', 'stretch_margin')

    def __init__(self, a: float, b: float, c: float, d: float, sign: int) -> None:
        self._diagonal = CrankDiagonal(a, d)
        self.sides = (a, b, c, d)
        self.fold_margin = margin(max(a, d), -min(a, d), -max(b, c), min(b, c))
        self.stretch_margin = margin(b, c, -a, -d)
        short_pair = a + d > 2.0 * (b + c)
        self._constants = (
            b, c, abs(b - c), float(sign), self.fold_margin,
            fsum((b, c, -max(a, d), min(a, d))) if short_pair else self.stretch_margin, short_pair,
            self._diagonal.least, self._diagonal.greatest,
        )  # fmt: skip

    def close(self, phi: float) -> RRRPose:
        """Return the pose for the crank direction φ, in [rad] in the frame of the loop."""
        b, c, side_difference, sign, fold, stretch, short_pair, least, greatest = self._constants
        diagonal = self._diagonal.at(phi)
        s, direction, near, far, _, _ = diagonal
        if s == 0.0:
            status = Status.OPEN if fold < 0.0 else Status.INDETERMINATE
            return RRRPose(status, -fold, 0.0, 0.0, 0.0, diagonal, _NO_HALVES)
        root_fold, gap = reach(fold, near, s + least)
        if gap:
            return RRRPose(Status.OPEN, gap, 0.0, 0.0, 0.0, diagonal, _NO_HALVES)
        if short_pair:
            root_stretch, gap = reach(stretch, near, -(s + least))
        else:
            root_stretch, gap = reach(stretch, far, s + greatest)
        if gap:
            return RRRPose(Status.OPEN, gap, 0.0, 0.0, 0.0, diagonal, _NO_HALVES)

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
        coupler = direction + 2.0 * sign * atan2(beta_y, beta_x)
        rocker = direction + 2.0 * sign * atan2(gamma_y, gamma_x)
        halves = (beta_y, beta_x, gamma_y, gamma_x)
        status = _CLOSED if cross else _TOGGLE
        return new(RRRPose, (status, 0.0, coupler, rocker, cross, diagonal, halves))

    def rates(self, pose: RRRPose, crank_rate: float) -> tuple[float, float]:
        """Return ω3 and ω4, in [rad/s], of a closed pose at the crank rate ω2, in [rad/s]."""
        _, b, c, _ = self.sides
        s = pose.diagonal.length
        p, q = self._diagonal.swing(pose.diagonal)
        beta_y, beta_x, gamma_y, gamma_x = pose.halves
        if s < min(b, c):
            square, difference = s * (s / pose.cross), (b - c) * ((b + c) / pose.cross)
            cot_beta, cot_gamma = 0.5 * (difference + square), 0.5 * (difference - square)
        else:
            area = 4.0 * pose.cross
            cot_beta = (beta_x * beta_x - beta_y * beta_y) / area
            cot_gamma = (gamma_x * gamma_x - gamma_y * gamma_y) / area
        return -crank_rate * (p - q * cot_gamma), -crank_rate * (p - q * cot_beta)
