# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
RPP: a link pinned at A slides along a second one, which slides on a known line; the Scotch yoke.

Both links keep their angles to the link that carries the known line. In the frame of that link,
A is at z, v̂ and û are the directions of the second and the known line, κ is a constant, and × the
z component of the cross product::

    z = κ + s2·û + s1·v̂        s1 = (z − κ) × û/(v̂ × û)        s2 = (z − κ) × v̂/(û × v̂)

s2 is the slide along the known line, s1 that of the pinned link along the second. The same
equations hold for the rates and the accelerations. There is one solution at every state, and no
toggle.
"""

from __future__ import annotations

from math import asin
from typing import NamedTuple

from linkage_ros.kinematics.arithmetic import cross
from linkage_ros.kinematics.rail import PinOnRail, Rail
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import State

_STILL = (0.0, 0.0)


class RPPPose(NamedTuple):
    """The dyad at one state of the linkage."""

    # Closed, 0.
    status: Status
    gap: float
    # s1 and s2, in the unit of the lengths.
    first: float
    second: float
    sight: PinOnRail  # A in the frame of the link that carries the known line


class RPPDyad:
    """
    A link pinned at A on a link that slides on a line.

    Parameters
    ----------
    rail
        The start of the known line, along the x axis of the link that carries it.
    inner, outer
        v̂ and û, not parallel.
    offsets
        κ × û and κ × v̂, in the unit of the lengths: subtracting κ from z first would lose
        accuracy where κ is long along a line.

    """

    __slots__ = ('_across', '_inner', '_offsets', '_outer', 'rail')

    def __init__(
        self, rail: Rail, inner: complex, outer: complex, offsets: tuple[float, float]
    ) -> None:
        self.rail = rail
        self._inner = inner
        self._outer = outer
        self._offsets = offsets
        self._across = cross(inner, outer)

    def close(self, known: State) -> RPPPose:
        """Append both slides."""
        sight = self.rail.at(known)
        first, second = self._slides(sight.place, self._offsets, known)
        return RPPPose(Status.CLOSED, 0.0, first, second, sight)

    def rates(self, pose: RPPPose, known: State, speeds: State) -> tuple[complex, float]:
        """Append the rates of both slides."""
        rates = self.rail.rates(pose.sight, known, speeds)
        velocity, _ = rates
        self._slides(velocity, _STILL, speeds)
        return rates

    def accelerations(
        self,
        pose: RPPPose,
        rates: tuple[complex, float],
        known: State,
        speeds: State,
        changes: State,
    ) -> None:
        """Append the accelerations of both slides."""
        pull, _ = self.rail.accelerations(pose.sight, rates, known, speeds, changes)
        self._slides(pull, _STILL, changes)

    def transmission_angle(self, _pose: RPPPose) -> float:
        """Return the angle between the two lines, in [0, π/2], in [rad]."""
        return asin(min(abs(self._across), 1.0))

    def _slides(
        self, place: complex, offsets: tuple[float, float], state: State
    ) -> tuple[float, float]:
        """Resolve a vector along both lines, and append its components."""
        along_outer, along_inner = offsets
        first = (cross(place, self._outer) - along_outer) / self._across
        second = (along_inner - cross(place, self._inner)) / self._across
        state.coordinates.append(first)
        state.coordinates.append(second)
        return first, second
