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
from typing import Any, NamedTuple

from linkage_ros.kinematics.arithmetic import acute_angle, atan2
from linkage_ros.kinematics.space.steps import (
    meet_circle,
    missing_length,
    Rod,
    root_between,
    status_of_roots,
)
from linkage_ros.kinematics.space.vectors import (
    add,
    cross,
    dot,
    length,
    minus,
    multiply,
    plus,
    scale,
    subtract,
    Vector,
    ZERO,
)
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState


class MetPose(NamedTuple):
    """
    The pose of a point at three distances.

    In the frame of the ways along P0 P1, beside it in the plane of the three points, and up.
    """

    status: Status
    gap: float = 0.0
    lever: float = 0.0  # Its sign is the assembly
    angle: float = 0.0  # From a toggle, in [rad]
    ways: tuple[Vector, ...] = ()
    place: Vector = ZERO  # Of the point, from P0
    third: tuple[float, float] = (0.0, 0.0)  # Place of P2, from P0
    rods: tuple[Vector, ...] = ()  # To the point from P1 and P2
    line: float = 0.0  # |P0 P1|

    def solve(self, sides: Sequence[float]) -> Vector:
        """Return the vector whose scalar products with P0 P1, P0 P2 and P0 X are given."""
        x, y, z = self.place
        along = sides[0] / self.line
        beside = subtract(sides[1], multiply(self.third[0], along)) / self.third[1]
        up = subtract(sides[2], add(x * along, y * beside)) / z
        parts = (
            scale(part, way) for part, way in zip((along, beside, up), self.ways, strict=True)
        )
        one, other, last = parts
        return plus(plus(one, other), last)


@dataclass(frozen=True, slots=True)
class ThreeDistances:
    """
    A point at known distances from three known points P0, P1, P2.

    It lies on a circle about the line P0 P1, which the third rod meets. The assembly is the sign
    of ((P1 − P0) × (P2 − P0))·(X − P0).
    """

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
        one, other, rod = (each.length(solved) for each in self.rods)
        line, across = minus(end, start), minus(third, start)
        up = cross(line, across)
        size, area = length(line), length(up)
        distance = area / size
        # 16·area² of the triangle P0 P1 X, by factors (Kahan).
        reach = root_between(one + other, size)
        apart = root_between(size, one - other)
        for root in (reach, apart):
            if root.status is not Status.CLOSED:
                return MetPose(root.status, root.missing)
        radius = 0.5 * (reach.root * apart.root) / size
        foot = 0.5 * (size + (one - other) * (one + other) / size)
        met = meet_circle(radius, distance, dot(across, line) / size - foot, rod)
        low, high = met.low, met.high
        status, gap = status_of_roots(low, high)
        if not status.has_pose:
            return MetPose(status, gap)
        # Its coordinates in the circle, r·cos θ and r·sin θ.
        half = 0.5 / distance
        x = met.part_along(half, radius, radius)
        y = half * self.sign * (low.root * high.root)
        along, normal = scale(1.0 / size, line), scale(1.0 / area, up)
        beside = scale(1.0 / (area * size), cross(up, line))
        round_line = plus(scale(x, beside), scale(y, normal))
        arm = plus(scale(foot, along), round_line)
        solved.pins.append(plus(start, arm))
        return MetPose(
            status,
            0.0,
            0.5 * self.sign * (low.root * high.root) * size,
            2.0 * atan2(low.root, high.root),
            (along, beside, normal),
            (foot, x, y),
            (dot(across, along), distance),
            (plus(scale(foot - size, along), round_line), minus(arm, across)),
            size,
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
