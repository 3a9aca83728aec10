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
RPR: a rod pinned to the crank that slides through a swivel; the inverted slider-crank.

In the frame of the loop (`diagonal`) the rod is pinned to the crank at A and runs through the
swivel D. Its direction is û, n̂ is û turned left by 90°, and the line along which it slides passes
A at the offset h: AD = r·û + h·n̂. With s = |AD|::

    r = σ·√((s − |h|)·(s + |h|))        s − |h| = (|d − a| − |h|) + near²/(s + |d − a|)
    ψ = dir(û) = dir(AD) − atan2(h, r)

σ = +1 where D lies ahead of A along û, −1 where it lies behind. For a straight rod h = 0 and r =
±s. Where |d − a| = |h| (a straight rod: the crank as long as the distance to the swivel), r passes
zero with the sign of the half angle, as the rod itself does. At r = 0 a straight rod has no
direction that could be told: the pose is indeterminate, not zero. A bent one (h ≠ 0) is at a
toggle.

Rates, from the velocity of the rod's point at D, which is along û. With OA the crank, and p and q
of `CrankDiagonal.swing`, which are OA along AD and across it, in parts of s::

    ω3 = −ω2·(OA·û)/r        = −ω2·(p − q·h/r)
    ṙ  = ω3·h + ω2·(OA·n̂)    = ω3·h + ω2·(r·q + h·p) = ω2·q·(r + h²/r)
"""

from __future__ import annotations

from math import atan2, sqrt
from typing import NamedTuple

from linkage_ros.kinematics.diagonal import CrankDiagonal, Diagonal, margin, reach, SMALLEST
from linkage_ros.kinematics.status import Status
from linkage_ros.tuples import new

_CLOSED, _TOGGLE = Status.CLOSED, Status.TOGGLE


class RPRPose(NamedTuple):
    """
    The dyad at one crank direction, angles in the frame of the loop.

    Attributes
    ----------
    status
        Whether the loop closes.
    gap
        What the rod's line misses the swivel by where it is open, else 0, in the unit of the
        lengths.
    rod
        ψ, direction of the rod's line, in [rad].
    slide
        r, from the foot of A on the line to the swivel, along the line, in the unit of the
        lengths.
    diagonal
        From A to D.

    """

    status: Status
    gap: float
    rod: float
    slide: float
    diagonal: Diagonal


class RPRDyad:
    """
    The dyad of an inverted slider-crank.

    Parameters
    ----------
    a, d
        Lengths of the crank and of the ground between crank pivot and swivel, in one unit.
    offset
        h, from A to the rod's line, positive where the line lies left of A, in the same unit.
    sign
        The assembly: +1 where the swivel lies ahead of A along the rod, −1 where it lies behind.
        Where |d − a| = |h|: for 0 < φ < 2π.

    """

    __slots__ = ('_constants', '_diagonal', 'fold_margin', 'sides')

    def __init__(self, a: float, d: float, offset: float, sign: int) -> None:
        self._diagonal = CrankDiagonal(a, d)
        self.sides = (a, d, offset)
        self.fold_margin = margin(max(a, d), -min(a, d), -abs(offset))
        self._constants = (offset, float(sign), self.fold_margin, self._diagonal.least)

    def close(self, phi: float) -> RPRPose:
        """Return the pose for the crank direction φ, in [rad] in the frame of the loop."""
        offset, sign, fold, least = self._constants
        diagonal = self._diagonal.at(phi)
        s, direction, near, _, _, _ = diagonal
        if s < SMALLEST:
            status = Status.OPEN if fold < 0.0 else Status.INDETERMINATE
            return RPRPose(status, -fold, 0.0, 0.0, diagonal)
        root_fold, gap = reach(fold, near, s + least)
        if gap:
            return RPRPose(Status.OPEN, gap, 0.0, 0.0, diagonal)

        slide = sign * root_fold * sqrt(s + abs(offset))
        rod = direction - atan2(offset, slide)
        return new(RPRPose, (_CLOSED if slide else _TOGGLE, 0.0, rod, slide, diagonal))

    def rates(self, pose: RPRPose, crank_rate: float) -> tuple[float, float]:
        """Return ω3, in [rad/s], and ṙ, in lengths a second, at the crank rate ω2, in [rad/s]."""
        _, _, offset = self.sides
        p, q = self._diagonal.swing(pose.diagonal)
        slide = pose.slide
        slope = offset / slide
        # ω3·h and ω2·h·p would cancel: all of ṙ, where the rod's rate is at its extreme.
        return -crank_rate * (p - q * slope), crank_rate * q * (slide + offset * slope)
