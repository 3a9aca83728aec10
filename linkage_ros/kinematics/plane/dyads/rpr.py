# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
RPR: a rail pinned at A and a block on it pinned at D; the inverted slider-crank.

The rail's direction is û, n̂ is û turned left by 90°, and the line along which D travels passes A
at the offset h: AD = r·û + h·n̂. With s = |AD|::

    r = σ·√(s² − h²)        ψ = dir(û) = dir(AD) − atan2(h, r)

σ = +1 if D lies ahead of A along û, −1 if it lies behind. A straight rail has h = 0 and r = ±s.
If |d − a| = |h| (for a straight rod: the crank is as long as the distance to the swivel), r passes
zero with the sign of the half angle, as the rod itself does. At r = 0 a straight rod has no
defined direction: the pose is indeterminate, not zero. A bent one (h ≠ 0) is at a change point if
|d − a| = |h|, otherwise at a toggle.

Rates, with g = ṡ/s and t the rate of the diagonal's direction, and with 1 + h²/r² = s²/r²::

    ψ̇ = t + h·(g/r)                        ṙ = s²·(g/r)
    ψ̈ = ṫ + h·(e/r − 2g·(g/r))             r̈ = s²·(e/r)           e = ġ + g²·(1 − h²/r²)

At a change point g, e and r are 0: the diagonal gives both quotients.
"""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from linkage_ros.kinematics.arithmetic import atan2, exact_sum
from linkage_ros.kinematics.plane.diagonals import (
    AnyDiagonal,
    crank_diagonal_of,
    CrankDiagonal,
    Diagonal,
    DiagonalRate,
)
from linkage_ros.kinematics.plane.dyads.two_sided import TwoSided
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState


class RPRPose(NamedTuple):
    """The dyad at one state of the linkage."""

    status: Status  # Whether it closes
    gap: float  # Distance by which the rail's line misses D, or 0, in the unit of the lengths
    rail: float  # ψ, the direction of the rail's line, in [rad]
    slide: float  # r, along the line from the foot of A on it to D, in the unit of the lengths
    diagonal: Diagonal  # From A to D


class RPRDyad(TwoSided):
    """
    A rail pinned at A, a block on it pinned at D.

    The diagonal goes from A to D, with the limits |h| and ∞. ``offset`` is h, from A to the line,
    positive if the line lies left of A, in the unit of the lengths. The sign is +1 if D lies ahead
    of A along the rail, −1 if it lies behind; if the diagonal passes a change point, this holds
    for 0 < φ < 2π.
    """

    __slots__ = ('diagonal', 'offset')

    def __init__(self, diagonal: AnyDiagonal, offset: float, sign: int) -> None:
        self.diagonal = diagonal
        self.offset = offset
        super().__init__(sign)

    def close(self, solved: LinkState) -> RPRPose:
        """Append the direction of the rail, and the slide."""
        diagonal = self.diagonal.diagonal_at(solved)
        status = diagonal.status
        if not status.has_pose:
            return RPRPose(status, diagonal.gap, 0.0, 0.0, diagonal)
        slide = self._sign * diagonal.fold
        rail = diagonal.direction - atan2(self.offset, slide)
        solved.coordinates.append(rail)
        solved.coordinates.append(slide)
        return RPRPose(status, 0.0, rail, slide, diagonal)

    def rates(self, pose: RPRPose, solved: LinkState, velocities: LinkState) -> DiagonalRate:
        """Append the rates of rail and slide."""
        rate = self.diagonal.rates(pose.diagonal, solved, velocities)
        lean = self._sign * rate.growth_over_height
        turn = rate.direction_rate + self.offset * lean
        velocities.coordinates.append(rate.base_rate + rate.relative_rate * turn)
        velocities.coordinates.append(rate.relative_rate * (pose.diagonal.square * lean))
        return rate

    def accelerations(
        self,
        pose: RPRPose,
        rate: DiagonalRate,
        solved: LinkState,
        velocities: LinkState,
        accelerations: LinkState,
    ) -> None:
        """Append the accelerations of rail and slide."""
        acceleration = self.diagonal.accelerations(
            pose.diagonal, rate, solved, velocities, accelerations
        )
        lean = self._sign * rate.growth_over_height
        if acceleration.curvature_over_height is None:
            slope = rate.log_length_rate * (self.offset / pose.slide)
            bend = (acceleration.length_curvature - slope * slope) / pose.slide
        else:
            bend = self._sign * acceleration.curvature_over_height
        swirl = acceleration.direction_curvature + self.offset * (
            bend - 2.0 * rate.log_length_rate * lean
        )
        turn = rate.direction_rate + self.offset * lean
        whirl = rate.relative_rate * rate.relative_rate
        accelerations.coordinates.append(
            acceleration.base_acceleration
            + acceleration.relative_acceleration * turn
            + whirl * swirl
        )
        accelerations.coordinates.append(
            pose.diagonal.square * (acceleration.relative_acceleration * lean + whirl * bend)
        )

    @property
    def span(self) -> AnyDiagonal:
        """Return its diagonal."""
        return self.diagonal

    def side_of(self, pose: RPRPose) -> float:
        """Return a number with the sign of the assembly; 0 where it is singular."""
        return pose.slide

    def transmission_angle(self, pose: RPRPose) -> float:
        """Return the angle between AD and the normal of the rail, in [0, π/2], in [rad]."""
        return atan2(abs(pose.slide), abs(self.offset))


def swivel_diagonal(
    a: float,
    d: float,
    offset: float,
    arms: tuple[int, int] = (1, 0),
    angle: float = 0.0,
    turns_known: bool = True,
    crosses: tuple[bool, bool] | None = None,
) -> CrankDiagonal:
    """Return the diagonal of the inverted slider-crank with crank a on ground d."""
    fold = exact_sum(max(a, d), -min(a, d), -abs(offset))
    limits = (abs(offset), inf, inf)
    return crank_diagonal_of(a, d, (fold, inf), limits, (arms, angle), not turns_known, crosses)
