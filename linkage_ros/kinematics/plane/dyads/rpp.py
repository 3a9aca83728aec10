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

s2 is the slide along the known line, s1 the slide of the pinned link on the second. The same
equations hold for the rates and the accelerations. There is one solution at every state, and no
toggle.
"""

from __future__ import annotations

from math import asin
from typing import NamedTuple

from linkage_ros.kinematics.arithmetic import cross_product
from linkage_ros.kinematics.plane.rail import PinOnRail, Rail
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, Step

_STILL = (0.0, 0.0)


class RPPPose(NamedTuple):
    """The dyad at one state of the linkage."""

    # Closed, 0.
    status: Status
    gap: float
    # s1 and s2, in the unit of the lengths.
    first: float
    second: float
    pin_on_rail: PinOnRail  # A in the frame of the link that carries the known line


class RPPDyad(Step):
    """
    A link pinned at A on a link that slides on a line.

    ``rail`` is the start of the known line, along the x axis of the link that carries it.
    ``inner`` and ``outer`` are v̂ and û, not parallel. ``offsets`` are κ × û and κ × v̂, in the
    unit of the lengths: subtracting κ from z first would lose accuracy where κ is long along a
    line.
    """

    __slots__ = ('_across', '_inner', '_offsets', '_outer', 'rail')

    has_transmission_angle = True

    def __init__(
        self, rail: Rail, inner: complex, outer: complex, offsets: tuple[float, float]
    ) -> None:
        self.rail = rail
        self._inner = inner
        self._outer = outer
        self._offsets = offsets
        self._across = cross_product(inner, outer)

    def close(self, solved: LinkState) -> RPPPose:
        """Append both slides."""
        pin_on_rail = self.rail.pin_at(solved)
        first, second = self._append_slides(pin_on_rail.place, self._offsets, solved)
        return RPPPose(Status.CLOSED, 0.0, first, second, pin_on_rail)

    def rates(
        self, pose: RPPPose, solved: LinkState, velocities: LinkState
    ) -> tuple[complex, float]:
        """Append the rates of both slides."""
        rates = self.rail.rates(pose.pin_on_rail, solved, velocities)
        velocity, _ = rates
        self._append_slides(velocity, _STILL, velocities)
        return rates

    def accelerations(
        self,
        pose: RPPPose,
        rates: tuple[complex, float],
        solved: LinkState,
        velocities: LinkState,
        accelerations: LinkState,
    ) -> None:
        """Append the accelerations of both slides."""
        pull, _ = self.rail.accelerations(
            pose.pin_on_rail, rates, solved, velocities, accelerations
        )
        self._append_slides(pull, _STILL, accelerations)

    @property
    def span(self) -> Rail:
        """Return its rail."""
        return self.rail

    def transmission_angle(self, _pose: RPPPose) -> float:
        """Return the angle between the two lines, in [0, π/2], in [rad]."""
        return asin(min(abs(self._across), 1.0))

    def _append_slides(
        self, place: complex, offsets: tuple[float, float], state: LinkState
    ) -> tuple[float, float]:
        """Resolve a vector along both lines, and append its components."""
        along_outer, along_inner = offsets
        first = (cross_product(place, self._outer) - along_outer) / self._across
        second = (along_inner - cross_product(place, self._inner)) / self._across
        state.coordinates.append(first)
        state.coordinates.append(second)
        return first, second
