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
How a published angle runs: on beyond a turn, or wrapped.

The closure knows an angle up to whole turns. `Continuous` adds the turns that bring it nearest to
what came last, so it takes steps of less than half a turn. It stands before the sensors, which may
then mix and quantise what they get without a thought of wrapping; `Wrapped` stands behind them.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, remainder, tau

from linkage_ros.effects.stage import Reading
from linkage_ros.tuples import new


class Continuous:
    """
    Angles without jumps; the first lies in (−π, π].

    Parameters
    ----------
    turning
        For each joint whether it is an angle.

    """

    __slots__ = ('_raw', '_turning', '_turns')

    def __init__(self, turning: Sequence[bool]) -> None:
        self._turning = tuple(i for i, turns in enumerate(turning) if turns)
        self._raw: tuple[float, ...] | None = None
        """The angles as they came last."""
        self._turns: list[int] | None = None
        """What was added to them, in turns; nothing where it is 0 for all."""

    def __call__(self, _now: int, reading: Reading) -> Reading:
        """Return the reading with the turns added."""
        stamp, joints, rates, accelerations, efforts = reading
        raw, self._raw = self._raw, joints
        if raw is None:
            first = list(joints)
            for i in self._turning:
                first[i] = wrapped(joints[i])
            self._add([round((w - v) / tau) for w, v in zip(first, joints, strict=True)])
            return new(Reading, (stamp, tuple(first), rates, accelerations, efforts))
        for i in self._turning:
            if not -pi < raw[i] - joints[i] < pi:
                self._follow(raw, joints)
                break
        turns = self._turns
        if turns is None:
            return reading
        added = tuple([v + n * tau if n else v for v, n in zip(joints, turns, strict=True)])
        return new(Reading, (stamp, added, rates, accelerations, efforts))

    def _follow(self, raw: tuple[float, ...], joints: tuple[float, ...]) -> None:
        """Add the turns that take back the jumps since the last reading."""
        turns = self._turns or [0] * len(joints)
        for i in self._turning:
            if not -pi < raw[i] - joints[i] < pi:
                turns[i] += round((raw[i] - joints[i]) / tau)
        self._add(turns)

    def _add(self, turns: list[int]) -> None:
        self._turns = turns if any(turns) else None


class Wrapped:
    """
    Angles in (−π, π].

    Parameters
    ----------
    turning
        For each joint whether it is an angle.

    """

    __slots__ = ('_turning',)

    def __init__(self, turning: Sequence[bool]) -> None:
        self._turning = tuple(turning)

    def __call__(self, _now: int, reading: Reading) -> Reading:
        """Return the reading with whole turns left out."""
        stamp, joints, rates, accelerations, efforts = reading
        now = [wrapped(v) if turns else v for v, turns in zip(joints, self._turning, strict=True)]
        return new(Reading, (stamp, tuple(now), rates, accelerations, efforts))


def wrapped(angle: float) -> float:
    """Return an angle less its whole turns, in (−π, π] rad."""
    rest = remainder(angle, tau)
    return pi if rest <= -pi else rest
