# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Laws of forces: tables, stops with a spring and a damper, and friction at low rates.

A law is a force as a function of a joint's value x, its rate ẋ and the time. It is smooth in
segments: from one row of a table to the next, and within or beyond a stop. `force` continues a
segment smoothly beyond its ends, so that an integrator can find the instant at which the segment
is left and cut its step there (`linkage_ros.dynamics.motion`).
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from math import e, exp, inf, sqrt, tau
from typing import NamedTuple, Protocol

_LOW, _FREE, _HIGH = -1, 0, 1


class Law(Protocol):
    """
    A force in segments.

    The value is in [rad] or [m], the rate in [rad/s] or [m/s], the time since the first tick in
    [s]; the force in [N·m] or [N].
    """

    def segment(self, value: float, rate: float, time: float) -> int:
        """Return the segment of a state."""

    def margin(self, segment: int, value: float, rate: float, time: float) -> float:
        """Return how far a state is within a segment; negative outside."""

    def force(self, segment: int, value: float, rate: float, time: float) -> float:
        """Return the force by the law of a segment."""


@dataclass(frozen=True, slots=True)
class TorqueTable:
    """A force that is linear between the rows of a table, and constant before and after them."""

    over: str  # What the first column is: 'time', 'position' or 'rate'
    rows: tuple[tuple[float, float], ...]  # Pairs of it and the force; the first column increases
    # Of the positions of a joint that turns: whole turns are left out so that its angle is nearest
    # to this one, in [rad]. None if turns count, and for the others.
    middle: float | None = None

    def segment(self, value: float, rate: float, time: float) -> int:
        """Return how many rows a state has passed."""
        return bisect_right(self.rows, (self._force_at(value, rate, time), inf))

    def margin(self, segment: int, value: float, rate: float, time: float) -> float:
        """Return the distance from the nearer of both rows, in the unit of the first column."""
        at, rows = self._force_at(value, rate, time), self.rows
        below = at - rows[segment - 1][0] if segment else inf
        above = rows[segment][0] - at if segment < len(rows) else inf
        return min(below, above)

    def force(self, segment: int, value: float, rate: float, time: float) -> float:
        """Return the force on the line through both rows."""
        rows = self.rows
        if not segment:
            return rows[0][1]
        begin, force = rows[segment - 1]
        if segment == len(rows):
            return force
        end, next_force = rows[segment]
        return force + (self._force_at(value, rate, time) - begin) / (end - begin) * (
            next_force - force
        )

    def _force_at(self, value: float, rate: float, time: float) -> float:
        if self.over == 'time':
            return time
        if self.over == 'rate':
            return rate
        return value if self.middle is None else nearest_turn(value, self.middle)


class LawTerm(NamedTuple):
    """A load by a law, at one value of the only input."""

    lever: float  # λ of the load
    value: float  # x of the law, in [rad] or [m]
    factor: float  # ẋ at a rate of the input of 1


@dataclass(frozen=True, slots=True)
class Contact:
    """
    A stop at either limit of a joint: a spring with a parallel damper, which pushes only.

    At the depth p beyond a limit the force is k·p + c·ṗ, and 0 where this would pull: a joint
    that leaves the stop faster than the damper follows is free (P. Flores, H. M. Lankarani,
    Contact Force Models for Multibody Dynamics, 2016, ch. 3, on the Kelvin-Voigt model and its
    pull at the end of a contact).
    """

    # The limits, in [rad] or [m]; infinite for none.
    low: float
    high: float
    stiffness: float  # k, in [N·m/rad] or [N/m]
    damping: float  # c, in [N·m·s/rad] or [N·s/m]
    middle: float | None = None  # As in `TorqueTable`

    def segment(self, value: float, rate: float, _time: float) -> int:
        """Return -1 at the lower stop, 1 at the upper one, or 0."""
        for side in (_LOW, _HIGH):
            if self._push_margin(side, value, rate) > 0.0:
                return side
        return _FREE

    def margin(self, segment: int, value: float, rate: float, _time: float) -> float:
        """Return the depth or the force of a contact, the smaller; without, the opposite."""
        if segment:
            return self._push_margin(segment, value, rate)
        return -max(self._push_margin(_LOW, value, rate), self._push_margin(_HIGH, value, rate))

    def force(self, segment: int, value: float, rate: float, _time: float) -> float:
        """Return the force of a contact, towards the range; 0 without."""
        if not segment:
            return 0.0
        return -segment * (
            self.stiffness * self.depth(segment, value) + segment * self.damping * rate
        )

    def depth(self, side: int, value: float) -> float:
        """Return how far a value is beyond the limit on a side, -1 or 1; negative within."""
        if self.middle is not None:
            value = nearest_turn(value, self.middle)
        return value - self.high if side == _HIGH else self.low - value

    def _push_margin(self, side: int, value: float, rate: float) -> float:
        """Return a number that is positive where the stop pushes, and 0 where that changes."""
        depth = self.depth(side, value)
        return min(depth, self.stiffness * depth + side * self.damping * rate)


@dataclass(frozen=True, slots=True)
class Stribeck:
    """
    The excess of friction at low rates: −e·sign(ẋ)·exp(−(ẋ/s)²).

    Its segments are the directions of motion. The value x does not matter.
    """

    excess: float  # e, in [N·m] or [N]
    rate: float  # s, in [rad/s] or [m/s]

    def segment(self, _value: float, rate: float, _time: float) -> int:
        """Return the sign of the rate."""
        return (rate > 0.0) - (rate < 0.0)

    def margin(self, segment: int, _value: float, rate: float, _time: float) -> float:
        """Return the rate in the direction of the segment; infinity for a joint that stands."""
        return segment * rate if segment else inf

    def force(self, segment: int, _value: float, rate: float, _time: float) -> float:
        """Return the force in the direction of the segment."""
        return -segment * self.excess * exp(-((rate / self.rate) ** 2))

    @property
    def steepest_slope(self) -> float:
        """Return the greatest fall of the friction over the rate, at s/√2, in [N·m·s/rad]."""
        return self.excess / self.rate * sqrt(2.0 / e)

    def force_at(self, rate: float) -> tuple[float]:
        """Return the force at a rate, for `linkage_ros.kinematics.arithmetic.call`."""
        return (self.force(self.segment(0.0, rate, 0.0), 0.0, rate, 0.0),)


def nearest_turn(angle: float, middle: float) -> float:
    """Return an angle plus the whole turns that bring it nearest to another one, in [rad]."""
    return angle - tau * round((angle - middle) / tau)
