# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""A point at known distances from three known points, as the end of three rods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import dist
from typing import Any, NamedTuple

from linkage_ros.kinematics.arithmetic import acute_angle, atan2, sqrt, where
from linkage_ros.kinematics.space.steps import (
    meet_circle,
    missing_length,
    reach_between,
    Rod,
)
from linkage_ros.kinematics.space.vectors import (
    add,
    cross,
    dot,
    minus,
    plus,
    scale,
    subtract,
    Vector,
    ZERO,
)
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, Step


def order_ends(place: Vector, ends: Sequence[Vector]) -> list[int]:
    """
    Return three ends of rods in the order in which the fewest digits cancel, by their numbers.

    The one that is nearest to the point is the first, and the one farther from that the second.
    """
    first = min(range(3), key=lambda k: dist(place, ends[k]))
    rest = (k for k in range(3) if k != first)
    return [first, *sorted(rest, key=lambda k: -dist(ends[k], ends[first]))]


class MetPose(NamedTuple):
    """
    The pose of a point at three distances.

    The ways are P0 P1, upwards × P0 P1, and upwards, which is P0 P1 × P0 P2.
    """

    status: Status
    gap: float = 0.0
    lever: float = 0.0  # Its sign is the assembly
    angle: float = 0.0  # From a toggle, in [rad]
    ways: tuple[Vector, ...] = ()
    squares: tuple[float, ...] = ()  # Of P0 P1, and of the way upwards
    along: float = 0.0  # P0 P1 · P0 P2
    place: Vector = ZERO  # Of the point, from P0: multiples of the ways
    rods: tuple[Vector, ...] = ()  # To the point from P1 and P2

    def solve(self, sides: Sequence[float]) -> Vector:
        """Return the vector whose scalar products with P0 P1, P0 P2 and P0 X are given."""
        square, area_square = self.squares
        x, y, z = self.place
        along = sides[0] / square
        beside = subtract(sides[1], along * self.along)
        up = subtract(sides[2], add(x * sides[0], y * square * beside)) / z
        first, second, last = self.ways
        across = plus(scale(beside / area_square, second), scale(up / area_square, last))
        return plus(scale(along, first), across)


@dataclass(frozen=True, slots=True)
class ThreeDistances(Step):
    """
    A point at known distances from three known points P0, P1, P2.

    It lies on a circle about the line P0 P1, which the third rod meets. The assembly is the sign
    of ((P1 − P0) × (P2 − P0))·(X − P0).
    """

    has_transmission_angle = True

    to: tuple[int, ...]
    rods: tuple[Rod, ...]
    sign: float
    point: int

    def close(self, solved: LinkState) -> MetPose:
        """Append the point."""
        missing = missing_length(self.rods, solved)
        if missing is not None:
            return MetPose(Status.OPEN, missing)
        start, end, third = (solved.pins[index] for index in self.to)
        first, second, rod = (rod.length(solved) for rod in self.rods)
        line, across, beyond = minus(end, start), minus(third, start), minus(third, end)
        square, twice = dot(line, line), dot(plus(across, beyond), line)
        size = sqrt(square)
        for reach in (reach_between(first + second, size), reach_between(size, first - second)):
            if reach.status is not Status.CLOSED:
                # On the line P0 P1 the point has no side, and the third rod hardly ever fits.
                return MetPose(Status.OPEN, reach.missing)
        # The cross product of the shorter edge: of both it is the same.
        nearer = twice < 0.0
        edge = [where(nearer, a, b) for a, b in zip(across, beyond, strict=True)]
        up = cross(line, (edge[0], edge[1], edge[2]))
        area_square = dot(up, up)
        area = sqrt(area_square)
        distance = area / size
        # In units of P0 P1, along it from its middle: of P1 and a P2 next to it nothing cancels.
        off = 0.5 * ((first - second) * (first + second)) / square
        height = subtract(0.5 * twice / square, off)
        foot, rest = 0.5 + off, off - 0.5
        # By the shorter rod: so what is rounded is the place on its sphere.
        short = first < second
        reach = reach_between(where(short, first, second), size * abs(where(short, foot, rest)))
        if reach.status is not Status.CLOSED:
            return MetPose(Status.OPEN, reach.missing)
        radius = sqrt(reach.square)
        met = meet_circle(radius, distance, size * height, rod)
        if not met.status.has_pose:
            return MetPose(met.status, met.gap)
        # Its coordinates in the circle, r·cos θ and r·sin θ.
        x = met.part_along()
        lever = self.sign * met.lever
        y = lever / distance
        beside, over = cross(up, line), 1.0 / (area * size)
        place = (foot, x * over, y / area)
        round_line = plus(scale(place[1], beside), scale(place[2], up))
        arm = plus(scale(foot, line), round_line)
        solved.pins.append(plus(start, arm))
        return MetPose(
            met.status,
            0.0,
            lever * size,
            atan2(lever, distance * x),
            (line, beside, up),
            (square, area_square),
            dot(across, line),
            place,
            (minus(arm, line), minus(arm, across)),
        )

    def rates(
        self, pose: MetPose, solved: LinkState, velocities: LinkState
    ) -> tuple[Vector, tuple[Vector, ...]]:
        """
        Append the velocity: (X − Pᵢ)·(Ẋ − Ṗᵢ) = L·L̇ for each rod.

        Relative to P0, the differences of these equations have the edges as their rows. Return
        the velocities of X, and of P1 and P2, relative to P0.
        """
        start, ends = self._edges(velocities)
        own, *powers = (rod.power(solved, velocities) for rod in self.rods)
        sides = [
            subtract(subtract(own, power), dot(rod, end))
            for power, rod, end in zip(powers, pose.rods, ends, strict=True)
        ]
        moved = pose.solve([*sides, own])
        velocities.pins.append(plus(start, moved))
        return moved, ends

    def accelerations(
        self, pose: Any, rates: Any, solved: LinkState, velocities: LinkState, changes: LinkState
    ) -> None:
        """Append the acceleration: (X − Pᵢ)·(Ẍ − P̈ᵢ) + |Ẋ − Ṗᵢ|² = L·L̈ + L̇² for each rod."""
        moved, slips = rates
        start, ends = self._edges(changes)
        own, *bends = (rod.bend(solved, velocities, changes) for rod in self.rods)
        sides = [
            subtract(
                add(subtract(own, bend), dot(slip, minus(slip, scale(2.0, moved)))), dot(rod, end)
            )
            for bend, rod, slip, end in zip(bends, pose.rods, slips, ends, strict=True)
        ]
        sides.append(subtract(own, dot(moved, moved)))
        changes.pins.append(plus(start, pose.solve(sides)))

    def _edges(self, state: LinkState) -> tuple[Vector, tuple[Vector, ...]]:
        """Return what P0 has, and what P1 and P2 have relative to it."""
        start, *ends = (state.pins[index] for index in self.to)
        return start, tuple(minus(end, start) for end in ends)

    def transmission_angle(self, pose: MetPose) -> float:
        """Return the angle from a toggle, in [0, π/2] rad."""
        return acute_angle(pose.angle)

    def side_of(self, pose: MetPose) -> float:
        """Return a number whose sign is the assembly."""
        return pose.lever
