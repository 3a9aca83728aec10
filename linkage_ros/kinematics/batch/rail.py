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


"""A pin seen from a rail, over arrays."""

from __future__ import annotations

from math import inf
from typing import Any

from linkage_ros.kinematics.batch.arrays import (
    Array,
    CLOSED,
    codes_of,
    joined,
    passes_zeros,
    reaches,
    roots_of,
    States,
    turned,
)
from linkage_ros.kinematics.rail import CrankRail, FreeRail, Sight, UnsignedRail
from linkage_ros.kinematics.status import Status
from linkage_ros.tuples import new
import numpy as np


class CrankRailArrays(CrankRail):
    """A rail on a link to which the link of A is pinned."""

    __slots__ = ()

    def at(self, known: States) -> Sight:
        """Return the pins in the frame of the rail."""
        a, pivot, below, above, root, changes_over = self._constants
        first, second = self.arms
        x, link = known[0], self._link
        base = x[second]
        swing = x[first] - base
        arm = turned(swing) * self._arm
        place = pivot + arm
        if link == inf:
            return new(Sight, (place, inf, inf, 0.0, base, arm, 0.0, CLOSED))
        eta = turned(-0.5 * swing) * self._half_turn
        sine, cosine = eta.imag, eta.real
        root_below, gap = self._roots(below, root * sine, 2.0 * a * sine * sine, -place.imag)
        part, square = root * cosine, 2.0 * a * cosine * cosine
        root_above, missing = self._roots(above, part, square, place.imag)
        gap = np.where(gap > 0.0, gap, missing)
        lean: Any = 0.0
        flat: Any = False
        if changes_over:
            arm = joined(2.0 * a * sine * cosine, arm.imag)
            lean = np.ones_like(sine)
            if above:
                lean = root * cosine / root_above
            elif below:
                lean = root * sine / root_below
            if not below:
                flat = flat | passes_zeros(sine, 0.5 * swing)
            if not above:
                flat = flat | passes_zeros(cosine, 0.5 * swing)
        at_change_point = self._at_change_point is Status.CHANGE_POINT
        codes = codes_of(gap, False, False if at_change_point else flat, flat)
        return new(Sight, (place, root_below, root_above, gap, base, arm, lean, codes))

    def _roots(self, bracket: float, part: Array, square: Array, side: Array) -> tuple[Any, Any]:
        """Return the roots of the link's length less what it has to reach, and the gaps."""
        if bracket == 0.0:
            return reaches(bracket, part, square)
        link = self._link
        total, size = link + side, link + np.abs(side)
        shorter = 4.0 * (abs(bracket) + square) < size
        return roots_of(
            np.where(shorter, bracket + square, total),
            np.where(shorter, abs(bracket) + square, size),
        )

    def across(
        self, sight: Sight, pull: Any, link_rate: Any, speeds: States, changes: States
    ) -> Any:
        """Return ÿ + y·λ̇² by below and above."""
        first, second = self.arms
        v, changed = speeds[0], changes[0]
        _, pivot, _, _, _, changes_over = self._constants
        if changes_over:
            return super().across(sight, pull, link_rate, speeds, changes)
        e = pivot.imag
        y: Any = sight.place.imag
        along = sight.below * sight.above
        swing = v[first] - v[second]
        left = y > 0.0
        square = np.where(left, sight.below, sight.above)
        square = square * square
        term = e * square * square
        other = y * np.where(left, *self._products)
        parts = -swing * swing * sight.arm.imag, y * link_rate * link_rate
        square = (swing / along) ** 2
        closed_form = (np.abs(term) + np.abs(other)) * square < abs(parts[0]) + abs(parts[1])
        rest = np.where(closed_form, (term - other) * square, parts[0] + parts[1])
        return ((changed[first] - changed[second]) * sight.arm.real + rest) / along


class UnsignedRailArrays(UnsignedRail, CrankRailArrays):
    """A `CrankRail` whose angle is known but for whole turns."""

    __slots__ = ()


class FreeRailArrays(FreeRail):
    """A rail and a pin, from their coordinates."""

    __slots__ = ()

    _facing = staticmethod(turned)

    def at(self, known: States) -> Sight:
        """Return the pins in the frame of the rail."""
        x, pins = known
        base = x[self._arm]
        start, end = (pins[i] for i in self._ends)
        place = (end - start) * (turned(-base) * self._back)
        link = self._link
        if link == inf:
            return new(Sight, (place, inf, inf, 0.0, base, 0j, 0.0, CLOSED))
        size = np.abs(start) + np.abs(end) + link
        below, gap = roots_of(link - place.imag, size)
        above, missing = roots_of(link + place.imag, size)
        gap = np.where(gap > 0.0, gap, missing)
        codes = codes_of(gap, False, False)
        return new(Sight, (place, below, above, gap, base, 0j, 0.0, codes))
