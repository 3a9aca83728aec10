# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The steps of a solution, the state that they pass on, and the steps that place points.

A linkage is solved by a sequence of steps. Each step starts from the known coordinates and pins
and appends its own; velocities and accelerations are computed by the same sequence again, in lists
of the same layout. Coordinate 0 is the angle of the ground, always 0; the inputs follow, then the
coordinates that the steps append. Lengths are in the unit of the closure's scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import tau
from typing import Any, ClassVar, NamedTuple, Protocol

from linkage_ros.kinematics.arithmetic import atan2, cos, sin, unit_vector
from linkage_ros.kinematics.status import Status


class LinkState(NamedTuple):
    """
    The known coordinates and pins; or their rates; or their accelerations.

    Angles are in [rad]; pins have their places in the frame of the ground. In space the pins are
    vectors of points, and frames or motions of links.
    """

    coordinates: list[float]
    pins: list[Any]


class StepPose(Protocol):
    """The result of a step, from which its rates are computed."""

    @property
    def status(self) -> Status:
        """Return whether it closes."""

    @property
    def gap(self) -> float:
        """Return the closure error, or 0 if the step closes, in the unit of the lengths."""


class PlacedPose(NamedTuple):
    """The pose of a step that cannot fail."""

    status: Status = Status.CLOSED
    gap: float = 0.0


PLACED = PlacedPose()


class Span(Protocol):
    """What says where a dyad folds and stretches: its diagonal, its rail, or its two lines."""

    @property
    def arms(self) -> tuple[int, ...]:
        """Return the two coordinates whose difference is its angle, and others; or none."""

    @property
    def crosses(self) -> tuple[bool, bool]:
        """Return whether the dyad changes its side where it folds, and where it stretches."""

    @property
    def singular_angles(self) -> tuple[float, ...]:
        """Return the angles at which the dyad is singular, in [rad]."""


class Step:
    """
    A part of a linkage that is solved from the coordinates and pins before it.

    What only some steps can has a default here; a class that can it says so.
    """

    __slots__ = ()

    has_transmission_angle: ClassVar[bool] = False
    """Whether it toggles, and `transmission_angle` says how far it is from there."""
    iterates: ClassVar[bool] = False
    """Whether Newton's method solves it, and it has a `conditioning`."""
    follows_branch: ClassVar[bool] = False
    """Whether it follows the ``branch`` of a single input."""

    def close(self, solved: LinkState, /) -> StepPose:
        """Append to the known state; if that is impossible, return a status that says why."""
        raise NotImplementedError

    def rates(self, pose: Any, solved: LinkState, velocities: LinkState, /) -> Any:
        """Append to the rates; return the intermediate values that `accelerations` needs."""
        raise NotImplementedError

    def accelerations(
        self,
        pose: Any,
        rates: Any,
        solved: LinkState,
        velocities: LinkState,
        accelerations: LinkState,
        /,
    ) -> None:
        """Append to the accelerations."""
        raise NotImplementedError

    def transmission_angle(self, pose: Any, /) -> float:
        """Return the angle from a toggle, in [0, π/2] rad."""
        raise NotImplementedError

    def side_of(self, pose: Any, /) -> float:
        """Return a number with the sign of the assembly; 0 where it is singular."""
        raise NotImplementedError

    def conditioning(self, pose: Any, /) -> float:
        """Return the ratio of the smallest singular value of its Jacobian to the largest."""
        raise NotImplementedError

    def iterate_by(self, steps: int, halvings: int) -> None:
        """
        Let it take so many steps of Newton's method, from cells halved so often, if it iterates.

        That is for measurements: by itself it takes as many as end within the rounding.
        """

    @property
    def equation_count(self) -> int:
        """Return the number of equations that it solves at once."""
        return 0

    @property
    def grid(self) -> Any:
        """Return the `Grid` of several inputs; None if it has none."""
        return None

    @property
    def span(self) -> Span | None:
        """Return what says where it folds and stretches, if it is a dyad that has it."""
        return None

    @property
    def crosses(self) -> tuple[bool, bool]:
        """Return whether it changes its side where it folds, and where it stretches."""
        return self.span.crosses if self.span else (False, False)


class GroupDescription(NamedTuple):
    """What a few steps find together, in words."""

    kind: str
    links: Sequence[str]
    method: str
    assembly: str = ''


class LinearStep(Step):
    """A step that appends to rates as to accelerations: it is linear, with constant factors."""

    __slots__ = ()

    def append_derivative(self, state: LinkState) -> None:
        """Append to rates or to accelerations."""
        raise NotImplementedError

    def rates(self, _pose: StepPose, _solved: LinkState, velocities: LinkState) -> None:
        """Append to the rates."""
        self.append_derivative(velocities)

    def accelerations(
        self,
        _pose: StepPose,
        _rates: None,
        _solved: LinkState,
        _velocities: LinkState,
        accelerations: LinkState,
    ) -> None:
        """Append to the accelerations."""
        self.append_derivative(accelerations)


@dataclass(frozen=True, slots=True)
class FixedPoint(LinearStep):
    """A point of the ground, at ``place`` in the frame of the ground."""

    place: complex

    def close(self, solved: LinkState) -> StepPose:
        """Append the point."""
        solved.pins.append(self.place)
        return PLACED

    def append_derivative(self, state: LinkState) -> None:
        """Append 0."""
        state.pins.append(0j)


@dataclass(frozen=True, slots=True)
class PointOnLink(Step):
    """A point at a constant distance from a pin of the same link."""

    pin: int  # Index of that pin
    arm: int  # Index, among the coordinates, of the angle of the link
    vector: complex  # Vector from the pin to the point at a coordinate of 0

    def close(self, solved: LinkState) -> StepPose:
        """Append the point."""
        arm = unit_vector(solved.coordinates[self.arm]) * self.vector
        solved.pins.append(solved.pins[self.pin] + arm)
        return PLACED

    def rates(self, _pose: StepPose, solved: LinkState, velocities: LinkState) -> complex:
        """Append its velocity; return the vector from the pin."""
        # Not the difference of the two places, which has few digits far from the origin.
        arm = unit_vector(solved.coordinates[self.arm]) * self.vector
        turn = velocities.coordinates[self.arm]
        velocities.pins.append(velocities.pins[self.pin] + 1j * turn * arm)
        return arm

    def accelerations(
        self,
        _pose: StepPose,
        arm: complex,
        _solved: LinkState,
        velocities: LinkState,
        accelerations: LinkState,
    ) -> None:
        """Append its acceleration."""
        turn, change = velocities.coordinates[self.arm], accelerations.coordinates[self.arm]
        accelerations.pins.append(accelerations.pins[self.pin] + (1j * change - turn * turn) * arm)


@dataclass(frozen=True, slots=True)
class PointOnRail(Step):
    """A point that travels along a line of a link."""

    pin: int  # Index of the pin that the line starts from
    arm: int  # Index, among the coordinates, of the angle of the link that carries the line
    slide: int  # Index, among the coordinates, of the slide along the line
    unit: complex  # Direction in which the point travels with the slide, at a link coordinate of 0

    def close(self, solved: LinkState) -> StepPose:
        """Append the point."""
        unit = unit_vector(solved.coordinates[self.arm]) * self.unit
        slide = solved.coordinates[self.slide]
        solved.pins.append(solved.pins[self.pin] + slide * unit)
        return PLACED

    def rates(self, _pose: StepPose, solved: LinkState, velocities: LinkState) -> None:
        """Append its velocity."""
        x, v = solved.coordinates, velocities.coordinates
        unit = unit_vector(x[self.arm]) * self.unit
        moved = v[self.slide] + 1j * (v[self.arm] * x[self.slide])
        velocities.pins.append(velocities.pins[self.pin] + moved * unit)

    def accelerations(
        self,
        _pose: StepPose,
        _rates: None,
        solved: LinkState,
        velocities: LinkState,
        accelerations: LinkState,
    ) -> None:
        """Append its acceleration."""
        x, v, a = solved.coordinates, velocities.coordinates, accelerations.coordinates
        unit = unit_vector(x[self.arm]) * self.unit
        slide, turn = x[self.slide], v[self.arm]
        across = a[self.arm] * slide + 2.0 * turn * v[self.slide]
        moved = a[self.slide] - turn * turn * slide + 1j * across
        accelerations.pins.append(accelerations.pins[self.pin] + moved * unit)


@dataclass(frozen=True, slots=True)
class RelativeAngle(LinearStep):
    """The angle of a link that a driven joint turns against another."""

    # Indices, among the coordinates, of the other link's angle and of the joint.
    arm: int
    joint: int
    sign: float  # +1 if the joint adds to that angle, −1 if it is subtracted

    def close(self, solved: LinkState) -> StepPose:
        """Append the angle."""
        self.append_derivative(solved)
        return PLACED

    def append_derivative(self, state: LinkState) -> None:
        """Append the angle or its derivative."""
        values = state.coordinates
        values.append(values[self.arm] + self.sign * values[self.joint])


@dataclass(frozen=True, slots=True)
class GearedAngle(LinearStep):
    """What ratios turn, a link or a joint: factors times known coordinates, and a constant."""

    factors: tuple[tuple[int, float], ...]  # Indices among the coordinates, and factors
    constant: float

    def close(self, solved: LinkState) -> StepPose:
        """Append the angle."""
        solved.coordinates.append(self._sum(solved) + self.constant)
        return PLACED

    def append_derivative(self, state: LinkState) -> None:
        """Append the derivative of the angle."""
        state.coordinates.append(self._sum(state))

    def _sum(self, state: LinkState) -> float:
        # Not `sum`, which from Python 3.12 on has other bits.
        total = 0.0
        for index, factor in self.factors:
            total = total + factor * state.coordinates[index]
        return total


@dataclass(frozen=True, slots=True)
class FollowerJoint(LinearStep):
    """
    The value of a joint that follows another: ratio·(x[one] − x[other] + constant) + offset.

    Where the turns of the other joint matter and are not known, it is taken within half a turn of
    ``middle``; otherwise that is None.
    """

    joint: str  # Its name
    one: int
    other: int
    constant: float
    ratio: float
    offset: float
    middle: float | None = None

    def close(self, solved: LinkState) -> StepPose:
        """Append the value."""
        x = solved.coordinates
        followed = x[self.one] - x[self.other] + self.constant
        if self.middle is not None:
            # Not `remainder`, which JavaScript does not have.
            off = followed - self.middle
            followed = self.middle + atan2(sin(off), cos(off))
        x.append(self.ratio * followed + self.offset)
        return PLACED

    def append_derivative(self, state: LinkState) -> None:
        """Append the derivative of the value."""
        values = state.coordinates
        values.append(self.ratio * (values[self.one] - values[self.other]))


@dataclass(frozen=True, slots=True)
class TurnsNear(Step):
    """
    Whole turns of a link, such that a joint of it is near a value that is linear in the inputs.

    The joint is sign·(x[arm] − x[other]) + constant, the value constant + Σ factor·input.
    """

    # Indices, among the coordinates, of the angles of this link and of the other one.
    arm: int
    other: int
    sign: float
    constant: float
    near: tuple[float, ...]

    def close(self, solved: LinkState) -> StepPose:
        """Turn the link."""
        x = solved.coordinates
        off = self.sign * (x[self.arm] - x[self.other]) + (self.constant - self.near[0])
        for index, factor in enumerate(self.near[1:], 1):
            off = off - factor * x[index] if factor else off
        # Not −0.0 from the turns of one language, and 0.0 from those of another.
        x[self.arm] = x[self.arm] - self.sign * tau * round(off / tau) + 0.0
        return PLACED

    def rates(self, _pose: StepPose, _solved: LinkState, _velocities: LinkState) -> None:
        """Change no rate."""

    def accelerations(self, *_state: Any) -> None:
        """Change no acceleration."""
