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


"""The crank from a topic: the newest measured sample, carried forward by its rate."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import NamedTuple

from linkage_ros.joint_state import CrankSample, Rejection
from linkage_ros.tuples import new

LARGEST = 1e10
"""Angles beyond this, in [rad], are 2e-6 rad apart as doubles: none of a machine. So for rates."""


@dataclass(frozen=True, slots=True)
class TopicParameters:
    """
    How samples of the crank are used.

    Attributes
    ----------
    carry_forward
        Whether the crank is carried to the tick's time by its rate, or held as measured.
    max_age
        Age of the newest sample beyond which there is no crank, in [ns].
    max_lead
        How far ahead of the clock a stamp may be, in [ns].

    """

    carry_forward: bool
    max_age: int
    max_lead: int


class CrankState(NamedTuple):
    """
    The crank at a tick.

    Attributes
    ----------
    angle
        In [rad].
    rate
        In [rad/s].
    age
        Time of the tick less that of the sample, in [ns].

    """

    angle: float
    rate: float
    age: int


class TopicDrive:
    """
    The newest good sample, and nothing else.

    Parameters
    ----------
    use
        How samples are used.
    needs_rate
        Whether something beyond carrying forward needs the crank's rate. Where nothing does,
        messages without velocities are good enough.

    """

    __slots__ = ('_carry_forward', '_max_age', '_max_lead', '_needs_rate', '_sample')

    def __init__(self, use: TopicParameters, needs_rate: bool) -> None:
        self._carry_forward = use.carry_forward
        self._max_age = use.max_age
        self._max_lead = use.max_lead
        self._needs_rate = needs_rate or use.carry_forward
        self._sample: tuple[int, float, float] | None = None

    @property
    def stamp(self) -> int:
        """Stamp of the newest good sample, in [ns]; 0 before the first."""
        return self._sample[0] if self._sample else 0

    def offer(self, sample: CrankSample, now: int) -> Rejection | None:
        """
        Take a sample, or say why not; a sample that is not taken changes nothing.

        Parameters
        ----------
        sample
            The sample.
        now
            The time, in [ns].

        """
        stamp, angle, rate = sample
        if rate is None:
            if self._needs_rate:
                return Rejection.NO_RATE
            rate = 0.0
        if not (isfinite(angle) and isfinite(rate)):
            return Rejection.NOT_FINITE
        if abs(angle) > LARGEST or abs(rate) > LARGEST:
            return Rejection.TOO_LARGE
        if stamp == 0:
            return Rejection.STAMP_ZERO
        if stamp > now + self._max_lead:
            return Rejection.STAMP_FUTURE
        if self._sample is not None and stamp < self._sample[0]:
            return Rejection.STAMP_OLD
        self._sample = (stamp, angle, rate)
        return None

    def state(self, now: int) -> CrankState | None:
        """Return the crank at a time, in [ns]; nothing where the newest sample is too old."""
        if self._sample is None:
            return None
        stamp, angle, rate = self._sample
        age = now - stamp
        if age > self._max_age:
            return None
        if self._carry_forward:
            angle += rate * (age * 1e-9)
        return new(CrankState, (angle, rate, age))
