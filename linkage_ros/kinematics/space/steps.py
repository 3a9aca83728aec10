# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
The steps of a linkage in space: joints that are given, closed or measured, and points.

Each step appends to the coordinates (joints) and pins (points and frames of links) as in the
plane. The one formula of a closed loop: a circle of radius r about an axis comes as near to a
point B, at the distance d from the axis and the height h above the circle, as ``near``, and as far
as ``far``::

    near = hypot(h, d − r)    far = hypot(h, d + r)    tan(θ/2) = √((L² − near²)/(far² − L²))

A point of the circle has the distance L from B at the angle ±θ from the direction of B. No term
cancels that the reach itself does not cancel. The rate divides by r·d·sin θ, which is half the
product of both roots. A planar dyad of two pinned links is h = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from linkage_ros.kinematics.arithmetic import acute_angle, atan2, ROUNDING, sqrt, where
from linkage_ros.kinematics.space.joints import HingePair, LowerPair
from linkage_ros.kinematics.space.vectors import (
    add,
    cross,
    dot,
    GROUND_FRAME,
    hypotenuse,
    length,
    minus,
    multiply,
    plus,
    scale,
    SpaceFrame,
    STILL,
    subtract,
    Twist,
    Vector,
    ZERO,
)
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinearStep, LinkState, PLACED, Step, StepPose


class Rod(NamedTuple):
    """
    The distance of two points: a constant, a strut, or that of points which a slide joins.

    ``moved_by`` is the coordinate of the strut or slide, 0 if there is none. The constant is added
    to it, and ``beside`` is the distance across a slide.
    """

    constant: float
    moved_by: int = 0
    beside: float | None = None

    def length(self, solved: LinkState) -> float:
        """Return the distance; that of a strut may be negative, and then is none."""
        along = self._along(solved)
        return along if self.beside is None else hypotenuse(along, self.beside)

    def _along(self, solved: LinkState) -> float:
        if not self.moved_by:
            return self.constant
        return add(solved.coordinates[self.moved_by], self.constant)

    def power(self, solved: LinkState, velocities: LinkState) -> float:
        """Return the derivative of half the square of the distance."""
        if not self.moved_by:
            return 0.0
        return self._along(solved) * velocities.coordinates[self.moved_by]

    def bend(self, solved: LinkState, velocities: LinkState, changes: LinkState) -> float:
        """Return its second derivative."""
        if not self.moved_by:
            return 0.0
        rate = velocities.coordinates[self.moved_by]
        return rate * rate + self._along(solved) * changes.coordinates[self.moved_by]


class ClosedPose(NamedTuple):
    """The pose of a closed step."""

    status: Status
    gap: float = 0.0
    lever: float = 0.0  # What the rate divides by; its sign is the assembly
    angle: float = 0.0  # From a toggle, in [rad]
    arm: Vector = ZERO  # From the origin of the child to its point, of a joint
    rod: Vector = ZERO  # From the known point to the carried one
    bend: float = 0.0  # Of a hinge: second derivative of half the rod's square by the joint


class ClosedRates(NamedTuple):
    """What the accelerations of a closed joint need."""

    rate: float
    still: Twist  # Motion of the child at a rate of 0
    slope: Vector  # Velocity of the point at a rate of 1
    slip: Vector  # Velocity of the point relative to the other end of the rod, at a rate of 0


def missing_length(rods: Sequence[Rod], solved: LinkState) -> float | None:
    """Return by how much a strut is shorter than 0; None if none is."""
    for rod in rods:
        if rod.moved_by and not (size := rod.length(solved)) > 0.0:
            return -size
    return None


class Reach(NamedTuple):
    """What two lengths leave to a toggle, where they are the same."""

    square: float  # Of the longer one, less that of the shorter one
    missing: float = 0.0  # By how much the longer one is too short
    status: Status = Status.CLOSED


def reach_between(long: float, short: float) -> Reach:
    """Return long² − short²; within the rounding of the two lengths it is a toggle."""
    total, size = long - short, long + short
    rounding = ROUNDING * size
    if total > rounding:
        return Reach(total * size)
    if total >= -rounding:
        return Reach(0.0, 0.0, Status.TOGGLE)
    return Reach(0.0, -total, Status.OPEN)


class CircleMeeting(NamedTuple):
    """Where a rod meets a circle of radius r, at a distance d from its axis."""

    status: Status
    gap: float
    radius: float = 0.0
    turn: float = 0.0  # By how much r·cos θ is less than r, or more than −r
    sense: float = 1.0  # 1 if it is less than r, −1 if it is more than −r
    lever: float = 0.0  # r·d·sin θ

    def part_along(self, start: float = 0.0) -> float:
        """Return r·cos θ, less a start."""
        part = subtract(self.radius, multiply(self.sense, start))
        return self.sense * (part - self.turn)


def meet_circle(radius: float, distance: float, height: float, rod: float) -> CircleMeeting:
    """
    Return how a circle and a rod meet, by the roots in the formula of the module.

    Their squares add up to 4·r·d. The greater one is what the smaller one leaves of it: so what is
    rounded is the place on the circle, and no point off the circle is found.
    """
    low = reach_between(rod, hypotenuse(height, subtract(distance, radius)))
    high = reach_between(hypotenuse(height, add(distance, radius)), rod)
    status, gap = status_between(low, high)
    if not status.has_pose:
        return CircleMeeting(status, gap)
    folds = low.square < high.square
    square = where(folds, low.square, high.square)
    lever = 0.5 * sqrt(square * (4.0 * (radius * distance) - square))
    sense = where(folds, 1.0, -1.0)
    return CircleMeeting(status, gap, radius, 0.5 * square / distance, sense, lever)


def status_between(low: Reach, high: Reach) -> tuple[Status, float]:
    """Return the status of two reaches, and the gap; two toggles leave the pose undefined."""
    for reach in (low, high):
        if reach.status is Status.OPEN:
            return Status.OPEN, reach.missing
    if low.status is Status.TOGGLE and high.status is Status.TOGGLE:
        return Status.INDETERMINATE, 0.0
    return (Status.TOGGLE if Status.TOGGLE in (low.status, high.status) else Status.CLOSED), 0.0


class GroundStep(LinearStep):
    """The ground, whose frame is the first pin."""

    __slots__ = ()

    def close(self, solved: LinkState) -> StepPose:
        """Append the frame."""
        solved.pins.append(GROUND_FRAME)
        return PLACED

    def append_derivative(self, state: LinkState) -> None:
        """Append the motion of the ground."""
        state.pins.append(STILL)


@dataclass(frozen=True, slots=True)
class GivenJoint(Step):
    """A joint whose value is known; its child is placed."""

    joint: LowerPair
    coordinate: int  # Index of its value among the coordinates
    child: int  # Index of the child's frame among the pins

    def close(self, solved: LinkState) -> StepPose:
        """Append the frame of the child."""
        base = self.joint.base(solved)
        solved.pins.append(self.joint.child_frame(base, solved.coordinates[self.coordinate]))
        return PLACED

    def rates(self, _pose: StepPose, solved: LinkState, velocities: LinkState) -> None:
        """Append the motion of the child."""
        rate = velocities.coordinates[self.coordinate]
        frame = solved.pins[self.child]
        velocities.pins.append(self.joint.motion(solved, velocities, frame, rate))

    def accelerations(
        self, _pose: Any, _rates: Any, solved: LinkState, velocities: LinkState, changes: LinkState
    ) -> None:
        """Append the derivative of the motion."""
        rate = velocities.coordinates[self.coordinate]
        change = changes.coordinates[self.coordinate]
        frame = solved.pins[self.child]
        changes.pins.append(self.joint.change(solved, velocities, changes, frame, rate, change))


@dataclass(frozen=True, slots=True)
class CarriedPoint(Step):
    """A point at a place in the frame of a link; or beside another point, which it turns with."""

    link: int
    place: Vector
    point: int  # Index of the point among the pins
    beside: int = 0  # Index of the other point; 0 for the origin of the link

    def close(self, solved: LinkState) -> StepPose:
        """Append the point."""
        solved.pins.append(self._base_of(solved).place(self.place))
        return PLACED

    def rates(self, _pose: StepPose, solved: LinkState, velocities: LinkState) -> None:
        """Append its velocity."""
        velocities.pins.append(self._base_of(velocities).velocity(self._arm(solved)))

    def accelerations(
        self, _pose: Any, _rates: Any, solved: LinkState, velocities: LinkState, changes: LinkState
    ) -> None:
        """Append its acceleration."""
        twist, change = self._base_of(velocities), self._base_of(changes)
        changes.pins.append(twist.acceleration(change, self._arm(solved)))

    def _base_of(self, state: LinkState) -> Any:
        """Return the frame or the twist of the link, at the point that it starts from."""
        of = state.pins[self.link]
        return of._replace(origin=state.pins[self.beside]) if self.beside else of

    def _arm(self, solved: LinkState) -> Vector:
        start = solved.pins[self.beside] if self.beside else solved.pins[self.link].origin
        return minus(solved.pins[self.point], start)


@dataclass(frozen=True, slots=True)
class ClosedJoint(Step):
    """A joint whose child carries a point at a known distance from a known point."""

    has_transmission_angle = True

    joint: LowerPair
    place: Vector  # The carried point in the frame of the child
    to: int  # Index of the known point among the pins
    rod: Rod
    sign: float
    child: int  # Index of the child's frame among the pins

    def close(self, solved: LinkState) -> ClosedPose:
        """Append the joint and the frame of the child."""
        raise NotImplementedError

    def _append(self, solved: LinkState, base: SpaceFrame, value: float) -> None:
        solved.coordinates.append(value)
        solved.pins.append(self.joint.child_frame(base, value))

    def rates(self, pose: ClosedPose, solved: LinkState, velocities: LinkState) -> ClosedRates:
        """
        Append the rates of the joint and of its child.

        The rod keeps its length: (X − B)·(Ẋ − Ḃ) = L·L̇.
        """
        frame = solved.pins[self.child]
        still = self.joint.motion(solved, velocities, frame, 0.0)
        slip = minus(still.velocity(pose.arm), velocities.pins[self.to])
        rate = subtract(self.rod.power(solved, velocities), dot(pose.rod, slip)) / pose.lever
        slope = self.joint.slope(frame.z, pose.arm)
        velocities.coordinates.append(rate)
        velocities.pins.append(self.joint.motion(solved, velocities, frame, rate))
        return ClosedRates(rate, still, slope, slip)

    def accelerations(
        self, pose: Any, rates: Any, solved: LinkState, velocities: LinkState, changes: LinkState
    ) -> None:
        """Append the accelerations: (X − B)·(Ẍ − B̈) + |Ẋ − Ḃ|² = L·L̈ + L̇²."""
        frame = solved.pins[self.child]
        rate, still, slope, _ = rates
        before = self.joint.change(solved, velocities, changes, frame, 0.0, 0.0)
        whirl = scale(2.0 * rate, cross(still.spin, slope))
        pull = minus(plus(still.acceleration(before, pose.arm), whirl), changes.pins[self.to])
        bend = subtract(self.rod.bend(solved, velocities, changes), self._square_of(pose, rates))
        change = subtract(bend, dot(pose.rod, pull)) / pose.lever
        changes.coordinates.append(change)
        changes.pins.append(self.joint.change(solved, velocities, changes, frame, rate, change))

    def _square_of(self, pose: ClosedPose, rates: ClosedRates) -> float:
        """Return |Ẋ − Ḃ|², and what the square of the rate adds to (X − B)·Ẍ."""
        raise NotImplementedError

    def transmission_angle(self, pose: ClosedPose) -> float:
        """Return the angle from a toggle, in [0, π/2] rad."""
        return acute_angle(pose.angle)

    def side_of(self, pose: ClosedPose) -> float:
        """Return a number whose sign is the assembly."""
        return pose.lever


@dataclass(frozen=True, slots=True)
class ClosedHinge(ClosedJoint):
    """A hinge closed by a rod: q = dir(B) − dir(X) ± θ."""

    radius: float
    direction: float  # That of the carried point where the hinge is 0, in [rad]; with whole turns

    def close(self, solved: LinkState) -> ClosedPose:
        """Append the hinge and the frame of the child."""
        missing = missing_length((self.rod,), solved)
        if missing is not None:
            return ClosedPose(Status.OPEN, missing)
        base = self.joint.base(solved)
        x, y, z = base.locate(solved.pins[self.to])
        radius, distance, height = self.radius, hypotenuse(x, y), subtract(z, self.place[2])
        met = meet_circle(radius, distance, height, self.rod.length(solved))
        if not met.status.has_pose:
            return ClosedPose(met.status, met.gap)
        # Arm and rod in the triangle of the roots. By the angle of the hinge they would have its
        # error, and next to a long arm the rod would be the difference of two places.
        lever = self.sign * met.lever
        along = met.part_along()
        bend = distance * along
        angle = atan2(lever, bend)
        # Adding 0.0 makes 0.0 of −0.0: otherwise the direction could be −π instead of π.
        turn = atan2(y + 0.0, x + 0.0) - self.direction
        self._append(solved, base, turn + angle)
        unit = 1.0 / distance
        out = scale(unit, (x, y, 0.0))
        beside = scale(unit * lever, (subtract(0.0, out[1]), out[0], 0.0))
        arm = plus(plus(scale(along, out), beside), (0.0, 0.0, self.place[2]))
        away = met.part_along(distance)
        rod = plus(plus(scale(away, out), beside), (0.0, 0.0, subtract(0.0, height)))
        return ClosedPose(met.status, 0.0, lever, angle, base.turn(arm), base.turn(rod), bend)

    def _square_of(self, pose: ClosedPose, rates: ClosedRates) -> float:
        # The square of the rate has one factor, r·d·cos θ: both its terms have r², which cancels.
        rate, _, slope, slip = rates
        own = rate * add(2.0 * dot(slip, slope), multiply(rate, pose.bend))
        return add(dot(slip, slip), own)


@dataclass(frozen=True, slots=True)
class ClosedSlide(ClosedJoint):
    """A slide closed by a rod: q = foot of B ± √(L² − d²)."""

    def close(self, solved: LinkState) -> ClosedPose:
        """Append the slide and the frame of the child."""
        missing = missing_length((self.rod,), solved)
        if missing is not None:
            return ClosedPose(Status.OPEN, missing)
        base = self.joint.base(solved)
        x, y, z = minus(base.locate(solved.pins[self.to]), self.place)
        distance = hypotenuse(x, y)
        square, gap, status = reach_between(self.rod.length(solved), distance)
        if status is Status.OPEN:
            return ClosedPose(status, gap)
        root = sqrt(square)
        lever = self.sign * root
        self._append(solved, base, z + lever)
        rod = base.turn((subtract(0.0, x), subtract(0.0, y), lever))
        return ClosedPose(status, 0.0, lever, atan2(root, distance), base.turn(self.place), rod)

    def _square_of(self, _pose: ClosedPose, rates: ClosedRates) -> float:
        # Whole: where the slide follows the point, its terms would cancel.
        rate, _, slope, slip = rates
        whole = plus(slip, scale(rate, slope))
        return dot(whole, whole)


@dataclass(frozen=True, slots=True)
class AimedHinge(Step):
    """A hinge whose child carries a point that is known already."""

    joint: HingePair
    direction: float  # Of the point where the hinge is 0, in [rad]; with whole turns
    to: int
    child: int

    def close(self, solved: LinkState) -> StepPose:
        """Append the hinge and the frame of the child."""
        base = self.joint.base(solved)
        x, y, _ = base.locate(solved.pins[self.to])
        value = atan2(y + 0.0, x + 0.0) - self.direction
        solved.coordinates.append(value)
        solved.pins.append(self.joint.child_frame(base, value))
        return PLACED

    def rates(self, _pose: StepPose, solved: LinkState, velocities: LinkState) -> Vector:
        """Append the rates; return the slope of the point and the square of its size."""
        frame = solved.pins[self.child]
        arm = minus(solved.pins[self.to], frame.origin)
        slope = self.joint.slope(frame.z, arm)
        still = self.joint.motion(solved, velocities, frame, 0.0)
        slip = minus(velocities.pins[self.to], still.velocity(arm))
        rate = dot(slope, slip) / dot(slope, slope)
        velocities.coordinates.append(rate)
        velocities.pins.append(self.joint.motion(solved, velocities, frame, rate))
        return slope

    def accelerations(
        self, _pose: Any, slope: Any, solved: LinkState, velocities: LinkState, changes: LinkState
    ) -> None:
        """Append the accelerations."""
        frame, motion = solved.pins[self.child], velocities.pins[self.child]
        arm = minus(solved.pins[self.to], frame.origin)
        rate = velocities.coordinates[len(changes.coordinates)]
        before = self.joint.change(solved, velocities, changes, frame, rate, 0.0)
        pull = minus(changes.pins[self.to], motion.acceleration(before, arm))
        change = dot(slope, pull) / dot(slope, slope)
        changes.coordinates.append(change)
        changes.pins.append(self.joint.change(solved, velocities, changes, frame, rate, change))


@dataclass(frozen=True, slots=True)
class FramedLink(Step):
    """A link with three known points: x leads from the first to the second, y to the third."""

    points: tuple[int, int, int]
    link: int  # Index of the frame among the pins

    def close(self, solved: LinkState) -> StepPose:
        """Append the frame."""
        start, first, second = self._edges(solved)
        solved.pins.append(frame_of(start, first, second))
        return PLACED

    def rates(self, _pose: StepPose, solved: LinkState, velocities: LinkState) -> None:
        """Append the motion."""
        start, first, second = self._edges(velocities)
        velocities.pins.append(Twist(self._spin(solved, first, second), start))

    def accelerations(
        self, _pose: Any, _rates: Any, solved: LinkState, velocities: LinkState, changes: LinkState
    ) -> None:
        """Append the derivative of the motion."""
        start, *edges = self._edges(changes)
        spin = velocities.pins[self.link].spin
        _, first, second = self._edges(velocities)
        turns = (minus(e, cross(spin, v)) for e, v in zip(edges, (first, second), strict=True))
        changes.pins.append(Twist(self._spin(solved, *turns), start))

    def _edges(self, state: LinkState) -> tuple[Vector, Vector, Vector]:
        start, first, second = (state.pins[index] for index in self.points)
        return start, minus(first, start), minus(second, start)

    def _spin(self, solved: LinkState, first: Vector, second: Vector) -> Vector:
        """Return ω from the derivatives ω × a and ω × b of the two edges a and b."""
        _, a, b = self._edges(solved)
        normal = cross(a, b)
        spin = plus(
            minus(scale(dot(second, normal), a), scale(dot(first, normal), b)),
            scale(dot(first, b), normal),
        )
        return scale(1.0 / dot(normal, normal), spin)


def frame_of(origin: Vector, first: Vector, second: Vector) -> SpaceFrame:
    """Return the frame with x along an edge, and y on the side of another."""
    x = scale(1.0 / length(first), first)
    up = cross(x, second)
    z = scale(1.0 / length(up), up)
    return SpaceFrame(x, cross(z, x), z, origin)


@dataclass(frozen=True, slots=True)
class MeasuredHinge(Step):
    """A hinge between two links whose frames are known."""

    joint: HingePair
    mark: Vector  # The vector of the child that is the x axis of the seat where the hinge is 0
    child: int

    def close(self, solved: LinkState) -> StepPose:
        """Append the angle."""
        x, y, _ = self.joint.base(solved).resolve(solved.pins[self.child].turn(self.mark))
        solved.coordinates.append(atan2(y + 0.0, x + 0.0))
        return PLACED

    def rates(self, _pose: StepPose, solved: LinkState, velocities: LinkState) -> None:
        """Append the rate."""
        self._append_difference(solved, velocities)

    def accelerations(
        self,
        _pose: Any,
        _rates: Any,
        solved: LinkState,
        _velocities: LinkState,
        changes: LinkState,
    ) -> None:
        """Append the acceleration: the axis turns with both links, which adds nothing."""
        self._append_difference(solved, changes)

    def _append_difference(self, solved: LinkState, state: LinkState) -> None:
        axis = solved.pins[self.joint.parent].turn(self.joint.seat.z)
        child, parent = state.pins[self.child], state.pins[self.joint.parent]
        state.coordinates.append(dot(axis, minus(child.spin, parent.spin)))


@dataclass(frozen=True, slots=True)
class ResolvedSlides(Step):
    """The slides in a row that lead from a link to a known point: its offset, by directions."""

    link: int
    start: Vector  # Where the point lies in the frame of the link if all slides are 0
    directions: tuple[Vector, ...]  # For each slide what the offset is multiplied by, in the frame
    point: int

    def close(self, solved: LinkState) -> StepPose:
        """Append the slides."""
        offset = minus(solved.pins[self.link].locate(solved.pins[self.point]), self.start)
        solved.coordinates.extend(dot(direction, offset) for direction in self.directions)
        return PLACED

    def rates(self, _pose: StepPose, solved: LinkState, velocities: LinkState) -> Vector:
        """Append the rates; return the velocity relative to the link."""
        arm = minus(solved.pins[self.point], solved.pins[self.link].origin)
        slip = minus(velocities.pins[self.point], velocities.pins[self.link].velocity(arm))
        self._append_resolved(solved, velocities, slip)
        return slip

    def accelerations(
        self, _pose: Any, slip: Any, solved: LinkState, velocities: LinkState, changes: LinkState
    ) -> None:
        """Append the accelerations."""
        arm = minus(solved.pins[self.point], solved.pins[self.link].origin)
        motion, change = velocities.pins[self.link], changes.pins[self.link]
        pull = minus(changes.pins[self.point], motion.acceleration(change, arm))
        pull = minus(pull, scale(2.0, cross(motion.spin, slip)))
        self._append_resolved(solved, changes, pull)

    def _append_resolved(self, solved: LinkState, state: LinkState, vector: Vector) -> None:
        turned = solved.pins[self.link].resolve(vector)
        state.coordinates.extend(dot(direction, turned) for direction in self.directions)


@dataclass(frozen=True, slots=True)
class MeasuredStrut(Step):
    """The distance of two known points."""

    points: tuple[int, int]
    coordinate: int  # Its index among the coordinates

    def close(self, solved: LinkState) -> StepPose:
        """Append the length."""
        solved.coordinates.append(length(self._strut_vector(solved)))
        return PLACED

    def rates(self, _pose: StepPose, solved: LinkState, velocities: LinkState) -> None:
        """Append the rate."""
        size = solved.coordinates[self.coordinate]
        rate = dot(self._strut_vector(solved), self._strut_vector(velocities)) / size
        velocities.coordinates.append(rate)

    def accelerations(
        self, _pose: Any, _rates: Any, solved: LinkState, velocities: LinkState, changes: LinkState
    ) -> None:
        """Append the acceleration: what turns across the strut adds v²/L."""
        between, slip = self._strut_vector(solved), self._strut_vector(velocities)
        size = solved.coordinates[self.coordinate]
        across = scale(1.0 / size, cross(between, slip))
        pull = dot(between, self._strut_vector(changes))
        changes.coordinates.append(add(pull, dot(across, across)) / size)

    def _strut_vector(self, state: LinkState) -> Vector:
        first, second = (state.pins[index] for index in self.points)
        return minus(second, first)
