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
what was published last, so it takes steps of less than half a turn; it is the only stage with a
memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, remainder, tau

from linkage_ros.effects.stage import Motion
from linkage_ros.tuples import new


class Continuous:
    """
    Angles without jumps; the first lies in (−π, π].

    Parameters
    ----------
    turning
        For each joint whether it is an angle.

    """

    __slots__ = ('_last', '_turning')

    def __init__(self, turning: Sequence[bool]) -> None:
        self._turning = tuple(i for i, turns in enumerate(turning) if turns)
        self._last: list[float] | None = None

    def __call__(self, motion: Motion) -> Motion:
        """Return the motion with the turns added."""
        crank, position, joints, rates, accelerations, velocity = motion
        last = self._last
        if last is None:
            now = [wrapped(v) if i in self._turning else v for i, v in enumerate(joints)]
        else:
            now = list(joints)
            for i in self._turning:
                if not -pi < last[i] - now[i] < pi:
                    now[i] += round((last[i] - now[i]) / tau) * tau
        self._last = now
        return new(Motion, (crank, position, tuple(now), rates, accelerations, velocity))


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

    def __call__(self, motion: Motion) -> Motion:
        """Return the motion with whole turns left out."""
        crank, position, joints, rates, accelerations, velocity = motion
        now = [wrapped(v) if turns else v for v, turns in zip(joints, self._turning, strict=True)]
        return new(Motion, (crank, position, tuple(now), rates, accelerations, velocity))


def wrapped(angle: float) -> float:
    """Return an angle less its whole turns, in (−π, π] rad."""
    rest = remainder(angle, tau)
    return pi if rest <= -pi else rest
