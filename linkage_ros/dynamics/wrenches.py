# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Wrenches that messages give: a force and a torque on a link, held until they expire.

A wrench counts from the time at which it is taken, constant until the next one or until it is too
old; then it is 0. So its laws have one segment, and no integrator cuts a step for them: the torque
drive divides its steps where a wrench changes (`linkage_ros.stages.drives.torque`).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from linkage_ros.messages import NANOSECONDS

NEVER = 1 << 63
"""A time after all others, in [ns]."""


class HeldWrench:
    """
    The wrench on a link; a message is valid for ``max_age``, in [s].

    ``numbers`` are the indices of those numbers of a message that move the linkage, of force.x, y,
    z in [N] and torque.x, y, z in [N·m]; the wrench has these alone.
    """

    __slots__ = ('_none', 'max_age', 'numbers', 'stamp', 'until', 'wrench')

    def __init__(self, max_age: float, numbers: tuple[int, ...]) -> None:
        self.max_age = round(max_age * NANOSECONDS)
        self.numbers = numbers
        self._none = (0.0,) * len(numbers)
        # What acts now, the time at which it ends, and the time of the newest message, in [ns].
        self.wrench, self.until, self.stamp = self._none, NEVER, 0

    def set_wrench(self, wrench: tuple[float, ...], now: int) -> None:
        """Let a wrench act from a time on, in [ns]."""
        self.wrench, self.until, self.stamp = wrench, now + self.max_age, now

    def expire(self, now: int) -> None:
        """End the wrench if it is too old at a time, in [ns]."""
        if now >= self.until:
            self.wrench, self.until = self._none, NEVER


@dataclass(frozen=True, slots=True)
class Component:
    """One number of a held wrench, as a law (`linkage_ros.dynamics.laws`)."""

    held_wrench: HeldWrench  # The wrench
    number: int  # Index of the number in the held wrench

    def segment(self, _value: float, _rate: float, _time: float) -> int:
        """Return the only segment."""
        return 0

    def margin(self, _segment: int, _value: float, _rate: float, _time: float) -> float:
        """Return infinity: nothing of the motion ends the segment."""
        return inf

    def force(self, _segment: int, _value: float, _rate: float, _time: float) -> float:
        """Return the force or the torque that acts now, in [N] or [N·m]."""
        return self.held_wrench.wrench[self.number]
