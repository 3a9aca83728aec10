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
RRR on two links that are pinned together, written out: the coupler and the rocker of a four-bar.

It is `RRRDyad` over a `CrankDiagonal`, to the last bit, without the calls between their parts,
which cost a tick more than the arithmetic. What is rare is left to them: toggles, change points,
open loops, coupler and rocker short beside crank and ground. Formulas and reasons stand there.
"""

from __future__ import annotations

from math import atan2, cos, hypot, sin, sqrt

from linkage_ros.kinematics.diagonal import (
    CrankDiagonal,
    Diagonal,
    Growth,
    ROUNDING,
)
from linkage_ros.kinematics.dyads.rrr import RRRDyad, RRRPose, RRRRates
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import State
from linkage_ros.tuples import new

_CLOSED = Status.CLOSED


class CrankRRRDyad(RRRDyad):
    """
    Two links pinned together, on two links that are.

    Parameters
    ----------
    diagonal
        From A to D; `fits` it.
    b, c, sign
        As in `RRRDyad`.

    """

    __slots__ = ('_closing', '_moving', '_pulling')

    diagonal: CrankDiagonal

    def __init__(self, diagonal: CrankDiagonal, b: float, c: float, sign: int) -> None:
        super().__init__(diagonal, b, c, sign)
        a, d = diagonal.sides
        root = 2.0 * sqrt(a) * sqrt(d)
        fold, stretch = diagonal.fold_margin, diagonal.stretch_margin
        self._closing = (
            *diagonal.arms, 2.0 * a, d - a, root, abs(d - a), a + d,
            fold, abs(fold), stretch, abs(stretch),
            b + c, abs(b - c), b >= c, 2.0 * sign, 0.5 * sign,
        )  # fmt: skip
        self._pulling = (
            *diagonal.arms[:2], root, *diagonal.limits, *diagonal.brackets, d - a, a + d,
        )  # fmt: skip
        self._moving = (*diagonal.arms[:2], a, 2.0 * d, 2.0 * a * d, d - a, b, c, min(b, c))

    @staticmethod
    def fits(diagonal: CrankDiagonal) -> bool:
        """Return whether no change point and no short pair is in the way."""
        a, d = diagonal.sides
        margins = diagonal.fold_margin and diagonal.stretch_margin
        return bool(margins) and a + d <= 2.0 * diagonal.limits[1]

    def close(self, known: State) -> RRRPose:
        """Append the directions of both links."""
        (
            i, j, offset, twice_a, difference, root, least, greatest,
            fold, fold_size, stretch, stretch_size, both, apart, b_longer, twice_sign, half_sign,
        ) = self._closing  # fmt: skip
        x = known[0]
        base = x[j]
        half = 0.5 * (x[i] - base)
        half_sine, half_cosine = sin(half), cos(half)
        if offset:
            sine, cosine = self.diagonal.half_turn
            half_sine, half_cosine = (
                half_sine * cosine + half_cosine * sine,
                half_cosine * cosine - half_sine * sine,
            )
        near, far = root * half_sine, root * half_cosine
        s = hypot(difference, near)
        if not s:
            return super().close(known)
        nearer, farther = near * near / (s + least), far * far / (s + greatest)
        fold_total, stretch_total = fold + nearer, stretch + farther
        if (
            fold_total <= ROUNDING * (fold_size + nearer)
            or stretch_total <= ROUNDING * (stretch_size + farther)
        ):  # fmt: skip
            return super().close(known)
        root_fold, root_stretch = sqrt(fold_total), sqrt(stretch_total)
        root_perimeter, root_wide = sqrt(both + s), sqrt(s + apart)
        if b_longer:
            beta_y, beta_x = root_fold * root_stretch, root_perimeter * root_wide
            gamma_y, gamma_x = root_perimeter * root_fold, root_wide * root_stretch
        else:
            beta_y, beta_x = root_wide * root_stretch, root_perimeter * root_fold
            gamma_y, gamma_x = root_perimeter * root_wide, root_fold * root_stretch
        cross = half_sign * beta_y * beta_x
        if -1e-300 < cross < 1e-300:
            return super().close(known)
        direction = base + atan2(
            -twice_a * half_sine * half_cosine, difference + twice_a * half_sine * half_sine
        )
        first = direction + twice_sign * atan2(beta_y, beta_x)
        second = direction + twice_sign * atan2(gamma_y, gamma_x)
        x += (first, second)
        diagonal = new(
            Diagonal, (s, direction, root_fold, root_stretch, 0.0, half_sine, half_cosine)
        )
        halves = (beta_y, beta_x, gamma_y, gamma_x)
        return new(RRRPose, (_CLOSED, 0.0, first, second, cross, diagonal, halves))

    def rates(self, pose: RRRPose, _known: State, speeds: State) -> RRRRates:
        """Append the rates of both links."""
        i, j, a, twice_d, twice_ad, difference, b, c, short = self._moving
        _, _, _, _, cross, diagonal, (beta_y, beta_x, gamma_y, gamma_x) = pose
        s, _, _, _, _, half_sine, half_cosine = diagonal
        part = half_sine / s
        p = a * (difference / s / s - twice_d * part * part)
        q = twice_ad * part * (half_cosine / s)
        if s < short:
            square, rest = s * (s / cross), (b - c) * ((b + c) / cross)
            cot_beta, cot_gamma = 0.5 * (rest + square), 0.5 * (rest - square)
        else:
            area = 4.0 * cross
            cot_beta = (beta_x * beta_x - beta_y * beta_y) / area
            cot_gamma = (gamma_x * gamma_x - gamma_y * gamma_y) / area
        v = speeds[0]
        base = v[j]
        swing = v[i] - base
        v += (base + swing * (q * cot_gamma - p), base + swing * (q * cot_beta - p))
        growth = new(Growth, (complex(q, -p), swing, base))
        return new(RRRRates, (growth, cot_beta, cot_gamma))

    def accelerations(
        self, pose: RRRPose, rates: RRRRates, _known: State, _speeds: State, changes: State
    ) -> None:
        """Append the accelerations of both links."""
        i, j, root, lower, upper, fold_bracket, stretch_bracket, difference, whole = self._pulling
        s, _, fold, stretch, _, half_sine, half_cosine = pose[5]
        (unit, swing, _), cot_beta, cot_gamma = rates
        q, turned = unit.real, unit.imag
        near, far = root * (half_sine / s), root * (half_cosine / s)
        bend = fold_bracket * (far / fold) * (far / fold) / (s + lower)
        bend -= stretch_bracket * (near / stretch) * (near / stretch) / (s + upper)
        bend = 0.25 * bend - q * q
        a = changes[0]
        base = a[j]
        pull, square = a[i] - base, swing * swing
        swirl = q * (difference / s) * (whole / s)
        first = swirl + cot_gamma * bend - q * (q * cot_beta)
        second = swirl + cot_beta * bend - q * (q * cot_gamma)
        a += (
            base + pull * (turned + q * cot_gamma) + square * first,
            base + pull * (turned + q * cot_beta) + square * second,
        )
