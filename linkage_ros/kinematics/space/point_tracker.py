# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Places, velocities and accelerations of certain points of links in space, and turns of links.

With the spin ω of a link and the arm r from the origin of its frame, a point has the velocity
v + ω × r and the acceleration v̇ + ω̇ × r + ω × (ω × r). A rod that may spin has no frame: its
points divide the way between two of them, which other links or steps place.

The turn of a link is its spin in its own axes. That of a rod that may spin is the velocity of its
last point minus that of its first one: the rod turns with it, and its spin about itself does not
matter.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import dist
from typing import NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.space.vectors import (
    cross,
    dot,
    GROUND_FRAME,
    length,
    minus,
    plus,
    scale,
    SpaceFrame,
    Twist,
    Vector,
)

if TYPE_CHECKING:
    from linkage_ros.kinematics.results import Acceleration, Position, Velocity
    from linkage_ros.kinematics.space.plan import SpacePlan


class _Anchor(NamedTuple):
    """A point that the state has, or that a link carries: its pin, or the frame and the arm."""

    pin: int
    arm: Vector | None = None

    def place(self, pins: list[SpaceFrame]) -> Vector:
        pin = pins[self.pin]
        return pin if self.arm is None else pin.place(self.arm)  # type: ignore[return-value]

    def velocity(self, pins: list[SpaceFrame], rates: list[Twist]) -> Vector:
        rate = rates[self.pin]
        if self.arm is None:
            return rate  # type: ignore[return-value]
        return rate.velocity(pins[self.pin].turn(self.arm))

    def acceleration(
        self, pins: list[SpaceFrame], rates: list[Twist], changes: list[Twist]
    ) -> Vector:
        change = changes[self.pin]
        if self.arm is None:
            return change  # type: ignore[return-value]
        return rates[self.pin].acceleration(change, pins[self.pin].turn(self.arm))


class RodAxis(NamedTuple):
    """The two points of a rod that are farthest from each other, by name, and their places."""

    ends: tuple[str, str]
    start: Vector
    end: Vector

    def share(self, place: Vector) -> float:
        """Return how far along the rod a place is: 0 at its first point, 1 at its last one."""
        along = minus(self.end, self.start)
        return dot(minus(place, self.start), along) / dot(along, along)

    def distance(self, place: Vector) -> float:
        """Return how far a place is from the axis, in the unit of the places."""
        along = scale(self.share(place), minus(self.end, self.start))
        return length(minus(place, plus(self.start, along)))


class SpatialTracker:
    """
    Certain points of links, and turns of links, tracked through the states of a closure.

    Each point is the name of its link and its place in the pose, in [m], in the frame of the
    ground; of a rod that may spin it is the place on the axis that is nearest.
    """

    __slots__ = ('_points', '_scale', '_turns', 'axes', 'indices')

    def __init__(
        self,
        plan: SpacePlan,
        points: Sequence[tuple[str, Vector]],
        links: Sequence[str] = (),
    ) -> None:
        self._scale = plan.scale
        unit = 1.0 / plan.scale
        self._points = tuple(_divide(plan, link, scale(unit, place)) for link, place in points)
        self._turns = tuple(
            plan.frames[link] if link in plan.frames else _ends(plan, rod_axis(plan, link))
            for link in links
        )
        # For each requested point its index in the lists.
        self.indices = tuple(range(len(self._points)))
        # For each link the axes of its turn, in the pose; a rod turns about those of the ground.
        self.axes = tuple(plan.pose_frames.get(link, GROUND_FRAME)[:3] for link in links)

    def places(self, position: Position) -> list[Vector]:
        """Return the places of the points in the frame of the ground, in [m]."""
        pins = position.state.pins
        return [
            scale(self._scale, _interpolate(share, *(anchor.place(pins) for anchor in anchors)))
            for share, anchors in self._points
        ]

    def velocities(
        self, position: Position, velocity: Velocity, _places: Sequence[Vector] = ()
    ) -> list[Vector]:
        """Return the velocities of the points, in [m/s]."""
        pins, rates = position.state.pins, velocity.state.pins
        return [
            scale(
                self._scale,
                _interpolate(share, *(anchor.velocity(pins, rates) for anchor in anchors)),
            )
            for share, anchors in self._points
        ]

    def accelerations(
        self,
        position: Position,
        velocity: Velocity,
        acceleration: Acceleration,
        _places: Sequence[Vector] = (),
    ) -> list[Vector]:
        """Return the accelerations of the points, in [m/s²]."""
        states = position.state.pins, velocity.state.pins, acceleration.state.pins
        return [
            scale(
                self._scale,
                _interpolate(share, *(anchor.acceleration(*states) for anchor in anchors)),
            )
            for share, anchors in self._points
        ]

    def turn_rates(self, position: Position, velocity: Velocity) -> list[Vector]:
        """Return the turn of each link, in [rad/s]; of a rod that may spin in [m/s]."""
        pins, rates = position.state.pins, velocity.state.pins
        return [
            pins[turn].resolve(rates[turn].spin)
            if isinstance(turn, int)
            else self._apart(*(end.velocity(pins, rates) for end in turn))
            for turn in self._turns
        ]

    def turn_changes(
        self, position: Position, velocity: Velocity, acceleration: Acceleration
    ) -> list[Vector]:
        """Return the derivatives of `turn_rates`."""
        states = position.state.pins, velocity.state.pins, acceleration.state.pins
        pins, _, changes = states
        # The axes of a link turn with the spin, which does not change the spin in them: ω × ω = 0.
        return [
            pins[turn].resolve(changes[turn].spin)
            if isinstance(turn, int)
            else self._apart(*(end.acceleration(*states) for end in turn))
            for turn in self._turns
        ]

    def moments_in_ground(self, position: Position, moments: Sequence[Vector]) -> list[Vector]:
        """
        Return moments that work on the turn of each link, in the frame of the ground.

        What works on the turn of a rod that may spin are forces at its ends, one against the
        other: theirs is a couple.
        """
        pins = position.state.pins
        return [
            pins[turn].turn(moment)
            if isinstance(turn, int)
            else cross(self._apart(*(end.place(pins) for end in turn)), moment)
            for turn, moment in zip(self._turns, moments, strict=True)
        ]

    def _apart(self, start: Vector, end: Vector) -> Vector:
        return scale(self._scale, minus(end, start))


def rod_axis(plan: SpacePlan, link: str) -> RodAxis:
    """Return the axis of a rod that may spin, in the pose and in the unit of the plan."""
    places = plan.places
    first, second = max(
        combinations(plan.carried[link], 2), key=lambda ends: dist(*(places[end] for end in ends))
    )
    return RodAxis((first, second), places[first], places[second])


def _divide(
    plan: SpacePlan, link: str, place: Vector
) -> tuple[float, tuple[_Anchor, _Anchor] | tuple[_Anchor]]:
    """Return a point as a share of the way between two anchors, or as one anchor."""
    if link in plan.frames:
        return 0.0, (_Anchor(plan.frames[link], plan.pose_frames[link].locate(place)),)
    axis = rod_axis(plan, link)
    return axis.share(place), _ends(plan, axis)


def _ends(plan: SpacePlan, axis: RodAxis) -> tuple[_Anchor, _Anchor]:
    first, second = (_anchor(plan, end) for end in axis.ends)
    return first, second


def _anchor(plan: SpacePlan, point: str) -> _Anchor:
    if point in plan.points:
        return _Anchor(plan.points[point])
    link = next(link for link in plan.carriers[point] if link in plan.frames)
    return _Anchor(plan.frames[link], plan.pose_frames[link].locate(plan.places[point]))


def _interpolate(share: float, first: Vector, second: Vector | None = None) -> Vector:
    """Return a vector that is a share of the way from one to another; one if it is alone."""
    if second is None:
        return first
    return plus(scale(1.0 - share, first), scale(share, second))
