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

from math import atan2, cos, sin, sqrt

from linkage_ros.kinematics.crank_diagonal import CrankDiagonal
from linkage_ros.kinematics.diagonal import Diagonal
from linkage_ros.kinematics.dyads.rrr import RRRDyad, RRRPose, sums
from linkage_ros.kinematics.rounding import ROUNDING, SMALLEST
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import State
from linkage_ros.tuples import new

_CLOSED = Status.CLOSED

_Rates = tuple[float, float, float, float, float]
"""q, φ̇, q/K, and the rates of both links by φ."""


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
        fold, stretch = diagonal.brackets
        self._closing = (
            *diagonal.arms, 2.0 * a, d - a, float(diagonal.least), diagonal.root, diagonal.quad,
            diagonal.limits[2], fold, abs(fold), stretch, abs(stretch),
            *sums(b, c, diagonal.least), float(sign),
        )  # fmt: skip
        self._moving = (*diagonal.arms[:2], diagonal.along)
        self._pulling = (
            *diagonal.arms[:2], fold, stretch, (d - a) * (d + a), (b - c) * (b + c),
        )  # fmt: skip

    @staticmethod
    def fits(diagonal: CrankDiagonal) -> bool:
        """Return whether no change point and no short pair is in the way."""
        a, d = diagonal.sides
        margins = diagonal.fold_margin and diagonal.stretch_margin
        return bool(margins) and a + d <= 2.0 * diagonal.limits[1]

    def close(self, known: State) -> RRRPose:
        """Append the directions of both links."""
        (
            i, j, offset, twice_a, apart, apart_square, root, quad, span,
            fold, fold_size, stretch, stretch_size, more, less, sign,
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
        near_square, far_square = quad * half_sine * half_sine, quad * half_cosine * half_cosine
        square = apart_square + near_square
        folding, stretching = fold + near_square, stretch + far_square
        if (
            folding <= ROUNDING * (fold_size + near_square)
            or stretching <= ROUNDING * (stretch_size + far_square)
            or square < SMALLEST
        ):
            return super().close(known)
        if folding < stretching:
            stretching = span - folding
        else:
            folding = span - stretching
        fold_root, stretch_root = sqrt(folding), sqrt(stretching)
        cross = sign * fold_root * stretch_root
        if -SMALLEST < cross < SMALLEST:
            return super().close(known)
        direction = base + atan2(
            -twice_a * half_sine * half_cosine, apart + twice_a * half_sine * half_sine
        )
        more, less = more + near_square, less - near_square
        first = direction + atan2(cross, more)
        second = direction + atan2(cross, less)
        x += (first, second)
        diagonal = new(
            Diagonal,
            (square, direction, fold_root, stretch_root, 0.0, near, far, near_square, _CLOSED),
        )
        return new(RRRPose, (_CLOSED, 0.0, first, second, cross, diagonal, more, less))

    def rates(  # type: ignore[override]  # more of them
        self, pose: RRRPose, _known: State, speeds: State
    ) -> _Rates:
        """Append the rates of both links."""
        i, j, along = self._moving
        _, _, _, _, _, (square, _, fold, stretch, _, near, far, near_square, _), more, less = pose
        p, q = (along - 0.5 * near_square) / square, 0.5 * near * far / square
        lean = 0.5 * (near / fold) * (far / stretch) / square * self._sign
        v = speeds[0]
        base = v[j]
        swing = v[i] - base
        first, second = less * lean - p, more * lean - p
        v += (base + swing * first, base + swing * second)
        return q, swing, lean, first, second

    def accelerations(  # type: ignore[override]  # of its own rates
        self, pose: RRRPose, rates: _Rates, _known: State, _speeds: State, changes: State
    ) -> None:
        """Append the accelerations of both links."""
        i, j, fold_bracket, stretch_bracket, lengths, difference = self._pulling
        _, _, _, _, _, (square, _, fold, stretch, _, near, far, _, _), more, less = pose
        q, swing, lean, first, second = rates
        bend = fold_bracket * (far / fold) / fold * (far / stretch / fold)
        bend -= stretch_bracket * (near / stretch) / stretch * (near / fold / stretch)
        bend = 0.25 * bend / square * self._sign
        swirl = q * (lengths / square) - 2.0 * q * (lean * difference)
        a = changes[0]
        base = a[j]
        pull, whirl = a[i] - base, swing * swing
        a += (
            base + pull * first + whirl * (swirl + less * bend),
            base + pull * second + whirl * (swirl + more * bend),
        )
