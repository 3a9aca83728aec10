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
a triangle with the sides s = |AD|, b = |AB| and c = |DB|. With σ = +1 where B lies left of A→D::

    K = σ·√((s² − (b − c)²)·((b + c)² − s²)) = 2·AB × DB
    θ3 = dir(AD) + atan2(K, (b² − c²) + s²)
    θ4 = dir(AD) + atan2(K, (b² − c²) − s²)

Both factors of K come from the diagonal, where what cancels as the dyad folds or stretches is a
constant of the linkage. At a change point their roots are signed, so that the motion passes it as
the linkage itself does, at any step and with no memory.

Rates, from the closing equation multiplied by DB and by AB, where the diagonal grows by g = ṡ/s
and turns by t. With β = θ3 − dir(AD) and γ' = θ4 − dir(AD) let M = (b² − c²) + s² = K·cot(β) and
L = (b² − c²) − s² = K·cot(γ')::

    ω3 = t + L·(g/K)        ω4 = t + M·(g/K)

Since ω3 − t and ω4 − t are the rates of β and γ', these differentiate into::

    α3 = ṫ + L·(e/K) − 2g·(g/K)·(b² − c²)
    α4 = ṫ + M·(e/K) − 2g·(g/K)·(b² − c²)        e = ġ + g² − L·M·(g/K)²

At a change point g, e and K are 0: the diagonal gives both quotients.

OA × DB = a·c·sin(θ4 − φ) says the same of a four-bar, but where crank and rocker are nearly
parallel it takes the difference of two angles that were rounded at the size of a half-turn: 6,500
u·κ was measured.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

from linkage_ros.kinematics.arithmetic import atan2
from linkage_ros.kinematics.diagonal import AnyDiagonal, Diagonal, Growth, GrowthChange
from linkage_ros.kinematics.diagonals import CrankDiagonal, UnsignedDiagonal
from linkage_ros.kinematics.plane import folded
from linkage_ros.kinematics.rounding import margin, SMALLEST
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import State


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
        K = 2·AB × DB, signed; 0 at a toggle.
    diagonal
        From A to D.
    more, less
        (b² − c²) ± s².

    """

    status: Status
    gap: float
    first: float
    second: float
    cross: float
    diagonal: Diagonal
    more: float
    less: float


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

    __slots__ = ('_difference', '_sign', '_sums', 'diagonal')

    def __init__(self, diagonal: AnyDiagonal, b: float, c: float, sign: int) -> None:
        self.diagonal = diagonal
        self._sums = sums(b, c, diagonal.least)
        self._sign = float(sign)
        self._difference = (b - c) * (b + c)

    def close(self, known: State) -> RRRPose:
        """Append the directions of both links."""
        pose = close_triangle(self.diagonal.at(known), *self._sums, self._sign)
        known.coordinates.append(pose.first)
        known.coordinates.append(pose.second)
        return pose

    def rates(self, pose: RRRPose, known: State, speeds: State) -> Growth:
        """Append the rates of both links."""
        growth = self.diagonal.rates(pose.diagonal, known, speeds)
        triangle_rates(pose, self._sign, growth, speeds)
        return growth

    def accelerations(
        self, pose: RRRPose, growth: Growth, known: State, speeds: State, changes: State
    ) -> None:
        """Append the accelerations of both links."""
        change = self.diagonal.accelerations(pose.diagonal, growth, known, speeds, changes)
        triangle_accelerations(pose, self._sign, self._difference, growth, change, changes)

    def side_of(self, pose: RRRPose) -> float:
        """Return a number whose sign tells the side of the assembly; 0 where it is singular."""
        return pose.cross

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
    return kind(a, d, fold, stretch, (abs(b - c), b + c, 4.0 * b * c), arms, offset)


def sums(b: float, c: float, least: Fraction) -> tuple[float, float]:
    """Return (b² − c²) ± the constant part of s², correctly rounded."""
    difference = Fraction(b) ** 2 - Fraction(c) ** 2
    return float(difference + least), float(difference - least)


def close_triangle(diagonal: Diagonal, more: float, less: float, sign: float) -> RRRPose:
    """Return the pose over a diagonal; more and less are the two `sums`."""
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


def triangle_rates(pose: RRRPose, sign: float, growth: Growth, speeds: State) -> None:
    """Append ω3 and ω4 of a closed pose."""
    lean = sign * growth.lean
    for part in (pose.less, pose.more):
        speeds.coordinates.append(growth.base + growth.swing * (part * lean + growth.turn))


def triangle_accelerations(
    pose: RRRPose,
    sign: float,
    difference: float,
    growth: Growth,
    change: GrowthChange,
    changes: State,
) -> None:
    """Append α3 and α4."""
    lean = sign * growth.lean
    if change.bend is None:
        bend = (change.pull - pose.more * lean * (pose.less * lean)) / pose.cross
    else:
        bend = sign * change.bend
    swirl = change.swirl - 2.0 * growth.growth * (lean * difference)
    whirl = growth.swing * growth.swing
    for part in (pose.less, pose.more):
        first = part * lean + growth.turn
        changes.coordinates.append(
            change.base + change.change * first + whirl * (swirl + part * bend)
        )
