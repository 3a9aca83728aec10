# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
The joints of two links in space, between which one of them moves: hinges and slides.

A joint has a seat on its parent: the frame of the child where the joint is 0, with the z axis
along the joint's axis. A hinge turns the child about that axis, a slide moves it along.
"""

from __future__ import annotations

from dataclasses import dataclass

from linkage_ros.kinematics.arithmetic import cos, sin
from linkage_ros.kinematics.space.vectors import (
    cross,
    minus,
    plus,
    scale,
    SpaceFrame,
    Twist,
    Vector,
)
from linkage_ros.kinematics.step import LinkState


@dataclass(frozen=True, slots=True)
class LowerPair:
    """A joint on a link whose frame is ``pins[parent]``; the seat is in that frame."""

    parent: int
    seat: SpaceFrame

    def base(self, solved: LinkState) -> SpaceFrame:
        """Return the frame of the child where the joint is 0."""
        on: SpaceFrame = solved.pins[self.parent]
        return on.compose(self.seat)

    def child_frame(self, base: SpaceFrame, value: float) -> SpaceFrame:
        """Return the frame of the child at a value of the joint."""
        raise NotImplementedError

    def slope(self, axis: Vector, arm: Vector) -> Vector:
        """Return the velocity of a point of the child at a rate of 1; the parent stands."""
        raise NotImplementedError

    def motion(
        self, solved: LinkState, velocities: LinkState, frame: SpaceFrame, rate: float
    ) -> Twist:
        """Return the motion of the child, whose frame is given, at a rate of the joint."""
        on = velocities.pins[self.parent]
        arm = minus(frame.origin, solved.pins[self.parent].origin)
        return self._add_rate(Twist(on.spin, on.velocity(arm)), frame.z, rate)

    def change(
        self,
        solved: LinkState,
        velocities: LinkState,
        accelerations: LinkState,
        frame: SpaceFrame,
        rate: float,
        acceleration: float,
    ) -> Twist:
        """Return the derivative of the motion of the child."""
        on, change = velocities.pins[self.parent], accelerations.pins[self.parent]
        arm = minus(frame.origin, solved.pins[self.parent].origin)
        carried = Twist(change.spin, on.acceleration(change, arm))
        turned = self._turned_rate(cross(on.spin, scale(rate, frame.z)))
        carried = Twist(plus(carried.spin, turned.spin), plus(carried.origin, turned.origin))
        return self._add_rate(carried, frame.z, acceleration)

    def _add_rate(self, motion: Twist, axis: Vector, rate: float) -> Twist:
        raise NotImplementedError

    def _turned_rate(self, change: Vector) -> Twist:
        """Return what the parent's turning adds: ``change`` is that of the rate's vector."""
        raise NotImplementedError


class HingePair(LowerPair):
    """A joint that turns the child, by an angle in [rad]."""

    __slots__ = ()

    def child_frame(self, base: SpaceFrame, value: float) -> SpaceFrame:
        x, y, z, origin = base
        c, s = cos(value), sin(value)
        return SpaceFrame(
            plus(scale(c, x), scale(s, y)), minus(scale(c, y), scale(s, x)), z, origin
        )

    def slope(self, axis: Vector, arm: Vector) -> Vector:
        return cross(axis, arm)

    def _add_rate(self, motion: Twist, axis: Vector, rate: float) -> Twist:
        return Twist(plus(motion.spin, scale(rate, axis)), motion.origin)

    def _turned_rate(self, change: Vector) -> Twist:
        return Twist(change, (0.0, 0.0, 0.0))


class SlidePair(LowerPair):
    """A joint that moves the child along, by a length."""

    __slots__ = ()

    def child_frame(self, base: SpaceFrame, value: float) -> SpaceFrame:
        x, y, z, origin = base
        return SpaceFrame(x, y, z, plus(origin, scale(value, z)))

    def slope(self, axis: Vector, arm: Vector) -> Vector:
        return axis

    def _add_rate(self, motion: Twist, axis: Vector, rate: float) -> Twist:
        return Twist(motion.spin, plus(motion.origin, scale(rate, axis)))

    def _turned_rate(self, change: Vector) -> Twist:
        # Twice: the axis turns, and the arm of the child's origin grows.
        return Twist((0.0, 0.0, 0.0), scale(2.0, change))
