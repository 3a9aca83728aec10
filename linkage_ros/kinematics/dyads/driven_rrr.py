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
RRR whose links change their length: cylinders, and links with a motor in them.

A side of the triangle runs through links that driven joints hold together, so that its vector z in
the frame of its first link is a function of the inputs. At one state it is a triangle like any
other. For the rates, the end of a side that did not turn would move by ż·e^{iθ}: added to the
velocity of its outer pin, this gives the velocity equation of a dyad of constant sides. Likewise
(z̈ + 2i·θ̇·ż)·e^{iθ} for the accelerations.
"""

from __future__ import annotations

from typing import NamedTuple

from linkage_ros.kinematics.arithmetic import facing, phase
from linkage_ros.kinematics.diagonal import Growth
from linkage_ros.kinematics.dyads.rrr import (
    close_triangle,
    RRRPose,
    triangle_accelerations,
    triangle_rates,
)
from linkage_ros.kinematics.free_diagonal import (
    free_diagonal,
    free_growth,
    free_growth_change,
)
from linkage_ros.kinematics.plane import folded
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import State


class Carry(NamedTuple):
    """
    From the frame of one link to that of the one which it is driven against.

    A point z becomes origin + e^{i·(angle + sign·x[turn])}·(z − inner) + sign·x[slide]·unit; turn
    or slide is the input, the other one is −1.
    """

    origin: complex
    inner: complex
    angle: float
    turn: int
    slide: int
    sign: float
    unit: complex


class Side:
    """
    A vector from one point of a group of links to another, in the frame of the first one's link.

    Parameters
    ----------
    start, end
        The points, each in the frame of its own link.
    carries
        From the link of the end to the link of the start, one after the other.

    """

    __slots__ = ('_carries', '_end', '_start')

    def __init__(self, start: complex, end: complex, carries: tuple[Carry, ...]) -> None:
        self._start = start
        self._end = end
        self._carries = carries

    def at(self, x: list[float]) -> complex:
        """Return the vector."""
        z = self._end
        for origin, inner, angle, turn, slide, sign, unit in self._carries:
            if turn >= 0:
                z = origin + facing(angle + sign * x[turn]) * (z - inner)
            else:
                z = origin + facing(angle) * (z - inner) + sign * x[slide] * unit
        return z - self._start

    def changes(
        self, x: list[float], v: list[float], a: list[float] | None = None
    ) -> tuple[complex, complex]:
        """Return its first derivative, and its second one where accelerations are given."""
        z, rate, change = self._end, 0j, 0j
        for origin, inner, angle, turn, slide, sign, unit in self._carries:
            if turn >= 0:
                turned = facing(angle + sign * x[turn])
                w = sign * v[turn]
                arm = z - inner
                if a is not None:
                    pull = (1j * (sign * a[turn]) - w * w) * arm
                    change = turned * (change + 2j * w * rate + pull)
                rate = turned * (rate + 1j * w * arm)
                z = origin + turned * arm
            else:
                held = facing(angle)
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
    """The growth of the diagonal, and the rates of both sides."""

    growth: Growth
    sides: tuple[complex, complex]


class DrivenRRRDyad:
    """
    Two groups of links pinned together.

    Parameters
    ----------
    ends
        Indices of the outer pins A and D among the pins.
    sides
        From A to B, and from D to B.
    sign
        The assembly: +1 where B lies left of A→D, −1 where it lies right of it.

    """

    __slots__ = ('_ends', '_sides', '_sign')

    def __init__(self, ends: tuple[int, int], sides: tuple[Side, Side], sign: int) -> None:
        self._ends = ends
        self._sides = sides
        self._sign = float(sign)

    def close(self, known: State) -> DrivenRRRPose:
        """Append the angles of the first link of each group."""
        x = known.coordinates
        start, end = (known.pins[i] for i in self._ends)
        one, other = (side.at(x) for side in self._sides)
        b, c = abs(one), abs(other)
        diagonal = free_diagonal(
            end - start, abs(start) + abs(end), abs(b - c), b + c, 4.0 * b * c
        )
        difference = (b - c) * (b + c)
        pose = close_triangle(diagonal, difference, difference, self._sign)
        x.append(pose.first - phase(one))
        x.append(pose.second - phase(other))
        return DrivenRRRPose(pose.status, pose.gap, pose, (one, other))

    def rates(self, pose: DrivenRRRPose, known: State, speeds: State) -> DrivenRRRRates:
        """Append the rates of the first link of each group."""
        start, end = self._ends
        (one, _), (other, _) = (
            side.changes(known.coordinates, speeds.coordinates) for side in self._sides
        )
        unit, other_unit = self._units(pose)
        between = speeds.pins[end] + other * other_unit - speeds.pins[start] - one * unit
        vector = known.pins[end] - known.pins[start]
        growth = free_growth(pose.triangle.diagonal, vector, between)
        triangle_rates(pose.triangle, self._sign, growth, speeds)
        return DrivenRRRRates(growth, (one, other))

    def accelerations(
        self,
        pose: DrivenRRRPose,
        rates: DrivenRRRRates,
        known: State,
        speeds: State,
        changes: State,
    ) -> None:
        """Append the accelerations of the first link of each group."""
        x, v, a = known.coordinates, speeds.coordinates, changes.coordinates
        start, end = self._ends
        growth, triangle = rates.growth, pose.triangle
        lean = self._sign * growth.lean
        # The rates of this dyad's own links, as `rates` has appended them.
        turns = growth.turn + triangle.less * lean, growth.turn + triangle.more * lean
        pulls = []
        for side, turn, rate, unit in zip(
            self._sides, turns, rates.sides, self._units(pose), strict=True
        ):
            _, change = side.changes(x, v, a)
            pulls.append((change + 2j * turn * rate) * unit)
        one, other = pulls
        between = changes.pins[end] + other - changes.pins[start] - one
        growth_change = free_growth_change(growth, known.pins[end] - known.pins[start], between)
        b, c = map(abs, pose.sides)
        difference = (b - c) * (b + c)
        triangle_accelerations(triangle, self._sign, difference, growth, growth_change, changes)

    def side_of(self, pose: DrivenRRRPose) -> float:
        """Return a number whose sign tells the side of the assembly; 0 where it is singular."""
        return pose.triangle.cross

    def transmission_angle(self, pose: DrivenRRRPose) -> float:
        """Return the angle between the two sides at B, folded into [0, π/2], in [rad]."""
        return folded(pose.triangle.second - pose.triangle.first)

    def _units(self, pose: DrivenRRRPose) -> tuple[complex, complex]:
        """Return e^{iθ} of the first link of each group."""
        triangle, (one, other) = pose.triangle, pose.sides
        return (
            facing(triangle.first - phase(one)),
            facing(triangle.second - phase(other)),
        )
