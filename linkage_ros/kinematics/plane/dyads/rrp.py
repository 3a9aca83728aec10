# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
RRP: a link pinned at A whose other pin B travels along a known line; the slider-crank.

In the frame of the rail A lies at (x, y), and the link has the length b. With σ = +1 if B lies
ahead of A along the line, −1 if it lies behind::

    w = σ·√((b − y)·(b + y))        λ = atan2(−y, w)        r = x + w

λ is the direction of the link in the frame of the rail, r the place of B along the line. If the
link stands across the line, w = 0: a toggle, or a change point, where ẏ is 0 as well and the rail
gives quotients such as ẏ/w. Rates::

    λ̇ = −ẏ/w                        ṙ = ẋ + y·λ̇
    λ̈ = −(ÿ + y·λ̇²)/w               r̈ = ẍ + ẏ·λ̇ + y·λ̈
"""

from __future__ import annotations

from typing import NamedTuple

from linkage_ros.kinematics.arithmetic import atan2, SMALLEST
from linkage_ros.kinematics.plane.dyads.two_sided import TwoSided
from linkage_ros.kinematics.plane.rail import PinOnRail, Rail
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState


class RRPPose(NamedTuple):
    """The dyad at one state of the linkage."""

    status: Status  # Whether it closes
    gap: float  # Distance by which the link misses the line, or 0, in the unit of the lengths
    link: float  # Direction of A→B, in [rad]
    slide: float  # r, in the unit of the lengths
    along: float  # w, from A to B along the line
    pin_on_rail: PinOnRail  # A in the frame of the rail


class RRPRates(NamedTuple):
    """The rates of the rail (A's velocity in its frame, and the frame's rate), and λ̇."""

    rail: tuple[complex, float]
    link: float


class RRPDyad(TwoSided):
    """
    A link pinned at A, and a pin of it on a line.

    The rail is for a link of length b. The sign is +1 if B lies ahead of A, −1 if it lies behind;
    if the rail passes a change point, this holds for −π/2 < ψ < π/2.
    """

    __slots__ = ('rail',)

    def __init__(self, rail: Rail, sign: int) -> None:
        self.rail = rail
        super().__init__(sign)

    def close(self, solved: LinkState) -> RRPPose:
        """Append the direction of the link, in the rail's coordinates, and the slide."""
        pin_on_rail = self.rail.pin_at(solved)
        status, place = pin_on_rail.status, pin_on_rail.place
        if status is Status.OPEN:
            return RRPPose(status, pin_on_rail.gap, 0.0, 0.0, 0.0, pin_on_rail)
        along = self._sign * pin_on_rail.below * pin_on_rail.above
        if status is Status.CLOSED and abs(along) < SMALLEST:
            along, status = 0.0, Status.TOGGLE
        link = pin_on_rail.base + atan2(-place.imag, along)
        slide = place.real + along
        solved.coordinates.append(link)
        solved.coordinates.append(slide)
        return RRPPose(status, 0.0, link, slide, along, pin_on_rail)

    def rates(self, pose: RRPPose, solved: LinkState, velocities: LinkState) -> RRPRates:
        """Append the rates of link and slide."""
        rail = self.rail.rates(pose.pin_on_rail, solved, velocities)
        velocity, turn = rail
        link = -self._sign * self.rail.unsigned_link_rate(
            pose.pin_on_rail, velocity.imag, velocities
        )
        velocities.coordinates.append(turn + link)
        velocities.coordinates.append(velocity.real + pose.pin_on_rail.place.imag * link)
        return RRPRates(rail, link)

    def accelerations(
        self,
        pose: RRPPose,
        rates: RRPRates,
        solved: LinkState,
        velocities: LinkState,
        accelerations: LinkState,
    ) -> None:
        """Append the accelerations of link and slide."""
        (velocity, _), link = rates
        pull, turn = self.rail.accelerations(
            pose.pin_on_rail, rates.rail, solved, velocities, accelerations
        )
        y = pose.pin_on_rail.place.imag
        change = -self._sign * self.rail.unsigned_link_acceleration(
            pose.pin_on_rail, pull, link, velocities, accelerations
        )
        accelerations.coordinates.append(turn + change)
        accelerations.coordinates.append(pull.real + velocity.imag * link + y * change)

    @property
    def span(self) -> Rail:
        """Return its rail."""
        return self.rail

    def side_of(self, pose: RRPPose) -> float:
        """Return a number with the sign of the assembly; 0 where it is singular."""
        return pose.along

    def transmission_angle(self, pose: RRPPose) -> float:
        """Return the angle between the link and the normal of the line, in [0, π/2], in [rad]."""
        return atan2(abs(pose.along), abs(pose.pin_on_rail.place.imag))
