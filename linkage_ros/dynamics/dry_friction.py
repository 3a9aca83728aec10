# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Dry friction in joints whose rates depend on several inputs: which of them stick, and which slide.

A joint j slips with the rate w_j·q̇. While it slides, its friction is its limit against the slip.
Joints at rest together take what holds them, as far as their limits go: the friction forces φ
with |φ_j| ≤ c_j, under which the accelerations s_j = w_j·q̈ + ẇ_j·q̇ of the slips obey::

    |φ_j| < c_j: s_j = 0        φ_j = c_j: s_j ≤ 0        φ_j = −c_j: s_j ≥ 0

This is a convex complementarity: q̈ is unique, even where the forces of many joints that stick are
not (J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, 1988; F.
Pfeiffer, C. Glocker, Multibody Dynamics with Unilateral Contacts, 1996). Each force in turn is
moved to where its own slip accelerates least, until none moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp
from typing import NamedTuple

_ROUNDS = 2000
"""Most rounds in which each force is moved once."""

_SETTLED = 1e-15
"""Change of a force below which it stays, as a fraction of its limit."""

_STILL = 1e-9
"""An acceleration of a slip below this fraction of its terms is rounding, and so is a slip."""


@dataclass(frozen=True, slots=True)
class DryFriction:
    """The dry friction of a joint, in [N·m] or [N]."""

    coulomb: float
    excess: float = 0.0  # What is more at rest
    stribeck: float = 0.0  # The rate at which the excess has fallen to 1/e; 0: none if it slides

    @property
    def holding(self) -> float:
        """Return what it holds at rest."""
        return self.coulomb + self.excess

    def sliding(self, slip: float) -> float:
        """Return what it resists at a slip."""
        if not self.stribeck:
            return self.coulomb
        return self.coulomb + self.excess * exp(-((slip / self.stribeck) ** 2))


class Slip(NamedTuple):
    """The slip of a joint with dry friction, or the motion of one with a stop."""

    levers: tuple[float, ...]  # w, its rate for a rate of 1 of each input
    rate: float  # In [rad/s] or [m/s]
    bias: float  # ẇ·q̇, its acceleration at q̈ = 0
    value: float = 0.0  # Of a joint with a stop, in [rad] or [m]

    def is_still(self, rates: Sequence[float]) -> bool:
        """Return whether it is 0 within the rounding of the rates of the inputs."""
        parts = sum(abs(lever * rate) for lever, rate in zip(self.levers, rates, strict=True))
        return abs(self.rate) <= _STILL * parts


class JointStop(NamedTuple):
    """The hard stops of a joint, in [rad] or [m]."""

    low: float
    high: float
    middle: float | None = None  # The angle nearest to which a value is meant, if any
    # Ratio of its rates after and before an impact, 0 to 1; None for that of the mechanism.
    restitution: float | None = None


def settle_forces(
    matrix: Sequence[Sequence[float]],
    begin: Sequence[float],
    bounds: Sequence[tuple[float, float]],
) -> tuple[list[float], list[float]]:
    """
    Return the friction of joints at rest, and the accelerations of their slips; 0 of what sticks.

    The accelerations are ``begin`` plus ``matrix`` times the forces, each within its bounds: ± its
    limit; of a stop, which only pushes, one of them is 0 and the other infinite.
    """
    count = len(bounds)
    forces = [0.0] * count
    for _ in range(_ROUNDS):
        moved = False
        for j in range(count):
            own = matrix[j][j]
            if not own > 0.0:
                continue
            slip = begin[j] + sum(matrix[j][k] * forces[k] for k in range(count))
            low, high = bounds[j]
            new = min(max(forces[j] - slip / own, low), high)
            moved = moved or abs(new - forces[j]) > _SETTLED * min(max(-low, high), abs(new))
            forces[j] = new
        if not moved:
            break
    slips = []
    for j in range(count):
        parts = [begin[j], *(matrix[j][k] * forces[k] for k in range(count))]
        total = sum(parts)
        low, high = bounds[j]
        is_still = abs(total) <= _STILL * sum(map(abs, parts)) or low < forces[j] < high
        slips.append(0.0 if is_still or not matrix[j][j] > 0.0 else total)
    return forces, slips


def independent_slips(matrix: Sequence[Sequence[float]], numbers: Sequence[int]) -> list[int]:
    """Return those of some joints whose slips determine those of all of them."""
    left = {i: {j: matrix[i][j] for j in numbers} for i in numbers}
    least = _STILL * max((matrix[i][i] for i in numbers), default=0.0)
    pivots = []
    while left:
        pivot = max(left, key=lambda i: left[i][i])
        if not left[pivot][pivot] > least:
            break
        pivots.append(pivot)
        row = left.pop(pivot)
        for lower_row in left.values():
            factor = lower_row[pivot] / row[pivot]
            for j in left:
                lower_row[j] -= factor * row[j]
    return sorted(pivots)
