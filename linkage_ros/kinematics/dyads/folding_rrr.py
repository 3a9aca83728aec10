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
RRR on two links that are pinned together, with a change point where they lie folded.

There |d − a| = |b − c|, and of `RRRDyad` over a `CrankDiagonal` one root is near itself. Where A
passes D closely, s is small, and of ω = (σρ·((b² − c²) ± s²) − 2a(d − a) + near²)/(2s²), with
ρ = far/stretch, all but a little cancels. With A = a + d, B = b + c, R = stretch and
N = B² − A², its bracket::

    ρ² = (A² − s²)/(B² − s²)        B·ρ = A − s²·w        w = N/(R·(B·far + A·R))

Put in, s² divides all but a constant, which is 0 on one side (σ = +1 where b − c = d − a)::

    ω3 = (1 − σρ − σ·(b − c)·w)/2 − k/(2s²)
    ω4 = (1 + σρ − σ·(b − c)·w)/2 − k/(2s²)        k = A·((d − a) − σ·(b − c))

and 1 − ρ = N/R²/(1 + ρ). Of a parallelogram N = 0 and ω4 = 1. By φ, of which s² has the
derivative near·far, and with H = B·(R² + far²)/(2R) + A·far::

    α3 = σ·N·near/2·(+1/(2R³) − (b − c)·H/G²) + k·near·far/(2s⁴)
    α4 = σ·N·near/2·(−1/(2R³) − (b − c)·H/G²) + k·near·far/(2s⁴)        G = N/w

Where far is below 0, ρ is, too: σ and near change their signs, and far is taken positive. Without
this 4,000 u·κ of a velocity and 10⁶ u·κ of an acceleration were lost, κ being that of lengths
which change together, so that the change point stays one.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

from linkage_ros.kinematics.arithmetic import copysign
from linkage_ros.kinematics.diagonal import AnyDiagonal
from linkage_ros.kinematics.diagonals import CrankDiagonal
from linkage_ros.kinematics.dyads.rrr import RRRDyad, RRRPose
from linkage_ros.kinematics.rounding import margin
from linkage_ros.kinematics.step import State


class FoldingRRRRates(NamedTuple):
    """
    What the accelerations start from.

    Attributes
    ----------
    swing
        φ̇.
    first, second
        ω3 and ω4 of φ̇ = 1, against OD.
    side
        σ, and its sign changed where far is below 0.
    constant
        k.

    """

    swing: float
    first: float
    second: float
    side: float
    constant: float


class FoldingRRRDyad(RRRDyad):
    """
    Two links pinned together, on two links that are, which can lie folded along each other.

    Parameters
    ----------
    diagonal
        From A to D; it `fits`.
    b, c, sign
        As in `RRRDyad`.

    """

    __slots__ = ('_constants',)

    diagonal: CrankDiagonal

    def __init__(self, diagonal: CrankDiagonal, b: float, c: float, sign: int) -> None:
        super().__init__(diagonal, b, c, sign)
        a, d = diagonal.sides
        whole = Fraction(a) + Fraction(d)
        apart = Fraction(d) - Fraction(a)
        left, right = (
            float(whole * (apart - Fraction(one) + Fraction(other)))
            if margin(d, -a, -one, other)
            else 0.0
            for one, other in ((b, c), (c, b))
        )
        self._constants = (float(whole), b + c, b - c, diagonal.brackets[1], left, right)

    @staticmethod
    def fits(diagonal: AnyDiagonal) -> bool:
        """Return whether a diagonal passes such a change point."""
        return isinstance(diagonal, CrankDiagonal) and not diagonal.brackets[0]

    def rates(  # type: ignore[override]  # other ones
        self, pose: RRRPose, _known: State, speeds: State
    ) -> FoldingRRRRates:
        """Append the rates of both links."""
        outer, inner, apart, bracket, left, right = self._constants
        stretch, far = pose.diagonal.stretch, pose.diagonal.far
        fold_ratio, stretch_ratio = self.diagonal.ratios(pose.diagonal)
        ratio = self._sign * fold_ratio * stretch_ratio
        side = copysign(1.0, ratio)
        # 1 on one side and 0 on the other one.
        same, other = 0.5 + 0.5 * side, 0.5 - 0.5 * side
        constant = same * left + other * right
        more, less, bent = 1.0 + abs(ratio), 0.0, 0.0
        if bracket:
            less = bracket / stretch / stretch / more
            bent = side * apart * (bracket / (stretch * (inner * abs(far) + outer * stretch)))
        rest = 0.5 * bent + 0.5 * constant / pose.diagonal.square
        v = speeds.coordinates
        i, j = self.diagonal.arms
        base = v[j]
        swing = v[i] - base
        first = 0.5 * (same * less + other * more) - rest
        second = 0.5 * (same * more + other * less) - rest
        v.append(base + swing * first)
        v.append(base + swing * second)
        return FoldingRRRRates(swing, first, second, side, constant)

    def accelerations(  # type: ignore[override]  # of its own rates
        self,
        pose: RRRPose,
        rates: FoldingRRRRates,
        _known: State,
        _speeds: State,
        changes: State,
    ) -> None:
        """Append the accelerations of both links."""
        outer, inner, apart, bracket, _, _ = self._constants
        square, stretch = pose.diagonal.square, pose.diagonal.stretch
        near, far = pose.diagonal.near, pose.diagonal.far
        whirl = 0.5 * rates.constant * (near / square) * (far / square)
        turn = 0.0
        if bracket:
            size = abs(far)
            part = inner * size + outer * stretch
            push = 0.5 * rates.side * bracket * near * copysign(1.0, far)
            turn = 0.5 * push / stretch / stretch / stretch
            slope = 0.5 * inner * (stretch + size * (size / stretch)) + outer * size
            whirl -= push * apart * (slope / stretch / part) / stretch / part
        a = changes.coordinates
        i, j = self.diagonal.arms
        base = a[j]
        pull, square_rate = a[i] - base, rates.swing * rates.swing
        a.append(base + pull * rates.first + square_rate * (whirl + turn))
        a.append(base + pull * rates.second + square_rate * (whirl - turn))
