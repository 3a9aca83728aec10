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
RPR: a rail pinned at A along which a block slides that is pinned at D; the inverted slider-crank.

The rail's direction is û, n̂ is û turned left by 90°, and the line along which D travels passes A
at the offset h: AD = r·û + h·n̂. With s = |AD|::

    r = σ·√(s² − h²)        ψ = dir(û) = dir(AD) − atan2(h, r)

σ = +1 where D lies ahead of A along û, −1 where it lies behind. For a straight rail h = 0 and r =
±s. Where |d − a| = |h| (a straight rod: the crank as long as the distance to the swivel), r passes
zero with the sign of the half angle, as the rod itself does. At r = 0 a straight rod has no
direction that could be told: the pose is indeterminate, not zero. A bent one (h ≠ 0) is at a
toggle.

Rates, where the diagonal grows by g = ṡ/s and turns by t, and with c = h/r, so that 1 + c² =
s²/r²::

    ψ̇ = t + g·c                            ṙ = g·(r + h·c)
    ψ̈ = ṫ + c·(e − 2g²)                    r̈ = (r + h·c)·e        e = ġ + g²·(1 − c²)
"""

from __future__ import annotations

from math import atan2, inf
from typing import NamedTuple

from linkage_ros.kinematics.crank_diagonal import CrankDiagonal, UnsignedDiagonal
from linkage_ros.kinematics.diagonal import AnyDiagonal, Diagonal, Growth
from linkage_ros.kinematics.rounding import margin
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import State
from linkage_ros.tuples import new

_CLOSED, _TOGGLE = Status.CLOSED, Status.TOGGLE


class RPRPose(NamedTuple):
    """
    The dyad at one state of the linkage.

    Attributes
    ----------
    status
        Whether it closes.
    gap
        What the rail's line misses D by where it does not, else 0, in the unit of the lengths.
    rail
        ψ, direction of the rail's line, in [rad].
    slide
        r, from the foot of A on the line to D, along the line, in the unit of the lengths.
    diagonal
        From A to D.

    """

    status: Status
    gap: float
    rail: float
    slide: float
    diagonal: Diagonal


class RPRDyad:
    """
    A rail pinned at A, a block on it pinned at D.

    Parameters
    ----------
    diagonal
        From A to D, with the limits |h| and ∞.
    offset
        h, from A to the line, positive where the line lies left of A, in the unit of the lengths.
    sign
        The assembly: +1 where D lies ahead of A along the rail, −1 where it lies behind. Where the
        diagonal passes a change point: for 0 < φ < 2π.

    """

    __slots__ = ('_constants', 'diagonal')

    def __init__(self, diagonal: AnyDiagonal, offset: float, sign: int) -> None:
        self.diagonal = diagonal
        self._constants = (offset, float(sign))

    def close(self, known: State) -> RPRPose:
        """Append the direction of the rail, and the slide."""
        offset, sign = self._constants
        diagonal = self.diagonal.at(known)
        square, direction, fold, _, gap, *_ = diagonal
        if gap:
            return RPRPose(Status.OPEN, gap, 0.0, 0.0, diagonal)
        if not square:
            return RPRPose(Status.INDETERMINATE, 0.0, 0.0, 0.0, diagonal)
        slide = sign * fold
        rail = direction - atan2(offset, slide)
        known[0].append(rail)
        known[0].append(slide)
        return new(RPRPose, (_CLOSED if slide else _TOGGLE, 0.0, rail, slide, diagonal))

    def rates(self, pose: RPRPose, known: State, speeds: State) -> Growth:
        """Append the rates of rail and slide."""
        offset = self._constants[0]
        growth = self.diagonal.rates(pose.diagonal, known, speeds)
        unit, swing, base = growth
        slope = offset / pose.slide
        speeds[0].append(base + swing * (unit.imag + unit.real * slope))
        speeds[0].append(swing * (unit.real * (pose.slide + offset * slope)))
        return growth

    def accelerations(
        self, pose: RPRPose, growth: Growth, known: State, speeds: State, changes: State
    ) -> None:
        """Append the accelerations of rail and slide."""
        offset = self._constants[0]
        square, pull, base, bend = self.diagonal.accelerations(
            pose.diagonal, growth, known, speeds, changes
        )
        (unit, swing, _), slope = growth, offset / pose.slide
        grown = unit.real * unit.real
        if bend is None:
            bend = square.real + grown * (1.0 - slope) * (1.0 + slope)
        bent = square.imag + slope * (bend - 2.0 * grown)
        changes[0].append(base + pull * (unit.imag + unit.real * slope) + swing * swing * bent)
        changes[0].append(
            (pose.slide + offset * slope) * (pull * unit.real + swing * swing * bend)
        )

    def transmission_angle(self, pose: RPRPose) -> float:
        """Return the angle between AD and the normal of the rail, in [0, π/2], in [rad]."""
        return atan2(abs(pose.slide), abs(self._constants[0]))


def swivel_diagonal(
    a: float,
    d: float,
    offset: float,
    arms: tuple[int, int] = (1, 0),
    angle: float = 0.0,
    turns_known: bool = True,
) -> CrankDiagonal:
    """Return the diagonal of the inverted slider-crank with crank a on ground d."""
    fold = margin(max(a, d), -min(a, d), -abs(offset))
    kind = CrankDiagonal if turns_known else UnsignedDiagonal
    return kind(a, d, fold, inf, (abs(offset), inf), arms, angle)
