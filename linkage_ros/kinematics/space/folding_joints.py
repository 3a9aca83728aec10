# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Closed joints that pass change points: where a linkage folds flat, its motion goes on smoothly.

A rod closes a joint of the link P. If a single joint moves the rod's other end B past P, then B
turns about an axis of P, or moves along a line. In the seat of the closed joint the coordinates of
B are forms of degree 2 in two numbers: in C = cos(φ/2) and S = sin(φ/2) of an angle φ, in C = 1
and S = t of a slide t. So is r·d·cos θ, and the square of the lever, from which the closed joint
follows by a root, is a form of degree 4::

    hinge: (r·d·sin θ)² = r²·(x² + y²) − (r·d·cos θ)²    slide: lever² = L² − x² − y²

At a change point it has a double root. The root of the square of that factor is the factor itself,
which changes its sign there: the lever is ``passing``·√``under``. With two change points no root
is left. If B comes to the axis of a hinge, as in a kite, x, y and r·d·cos θ have a common factor,
which is taken out of all: the direction of B is that from which it comes and to which it goes on.

A form of degree n is the tuple of its n + 1 coefficients, of Cⁿ first.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
import math
from math import pi
from typing import Any, NamedTuple

from linkage_ros.kinematics.arithmetic import (
    acute_angle,
    atan2,
    cos,
    passes_zero,
    root_of,
    ROUNDING,
    sin,
    sqrt,
)
from linkage_ros.kinematics.space.steps import ClosedHinge, ClosedJoint
from linkage_ros.kinematics.space.vectors import (
    add,
    cross,
    dot,
    minus,
    multiply,
    plus,
    scale,
    subtract,
    Vector,
)
from linkage_ros.kinematics.status import Status
from linkage_ros.kinematics.step import LinkState, Step

Form = tuple[float, ...]

_FOLDED = 1e-9
"""Greatest square of the sine of the transmission angle at which a fold is a change point."""

_NEAR = 1e-6
"""Least cosine of the angle of (1, t), with t in sizes of the linkage; beyond it t is infinite."""

_ROUNDING = 2.0**-50
"""A coefficient below this is rounding, where the greatest is 1."""

_SAMPLES, _HALVINGS = 180, 52
"""Samples of a form of degree 4, which has four extremes at most, and of a part between two."""


def _times(first: Form, second: Form) -> Form:
    """Return the product of two forms."""
    total = [0.0] * (len(first) + len(second) - 1)
    for i, a in enumerate(first):
        for k, b in enumerate(second):
            total[i + k] += a * b
    return tuple(total)


def _sum_of(*terms: tuple[float, Form]) -> Form:
    """Return a sum of forms of one degree, each with a factor."""
    return tuple(math.fsum(factor * form[k] for factor, form in terms)
                 for k in range(len(terms[0][1])))  # fmt: skip


def _turn_form(form: Form, angle: float) -> Form:
    """Return the form of c and s, where C = c·cos − s·sin and S = c·sin + s·cos of an angle."""
    c, s = math.cos(angle), math.sin(angle)
    degree, total = len(form) - 1, [0.0] * len(form)
    for k, factor in enumerate(form):
        term: Form = (factor,)
        for line in [(c, -s)] * (degree - k) + [(s, c)] * k:
            term = _times(term, line)
        total = [a + b for a, b in zip(total, term, strict=True)]
    return tuple(total)


def _line_through(angle: float) -> Form:
    """Return the form of degree 1 that is 0 at an angle of (C, S)."""
    line = -math.sin(angle), math.cos(angle)
    return tuple(0.0 if abs(part) < _ROUNDING else part for part in line)


def _divide_out(form: Form, angle: float, times: int) -> Form:
    """Return a form without a factor, which is 0 at an angle of (C, S), once or twice."""
    rest = _turn_form(_turn_form(form, angle)[times:], -angle)
    size = max(map(abs, rest), default=0.0)
    return tuple(0.0 if abs(part) < _ROUNDING * size else part for part in rest)


def _value(form: Form, at: Sequence[float]) -> float:
    """Return the value of a form."""
    c, s = at
    total = 0.0
    for k, factor in enumerate(form):
        term = factor
        for power in (c,) * (len(form) - 1 - k) + (s,) * k:
            term = multiply(term, power)
        total = add(total, term)
    return total


def _angles_of_valleys(form: Form, *, turns: bool) -> Iterator[float]:
    """Yield the angles of (C, S) at which a form is least, but that of an endless slide."""
    slope = _slope(form, turns=True)
    angles = [pi * (k + 0.37) / _SAMPLES for k in range(_SAMPLES + 1)]
    falls = [_value(slope, _unit(angle)) < 0.0 for angle in angles]
    for (low, high), (before, after) in zip(pairwise(angles), pairwise(falls), strict=True):
        if before and not after:
            angle = _end_of_fall(slope, low, high)
            if turns or abs(math.cos(angle)) > _NEAR:
                yield angle


def _end_of_fall(slope: Form, low: float, high: float) -> float:
    """Return the angle between two at which a slope is no longer negative."""
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if _value(slope, _unit(middle)) < 0.0:
            low = middle
        else:
            high = middle
    return high


def _unit(angle: float) -> tuple[float, float]:
    """Return C and S at their angle."""
    return math.cos(angle), math.sin(angle)


def _slope(form: Form, *, turns: bool) -> Form:
    """Return the derivative of a form by the angle, or by the slide."""
    degree = len(form) - 1
    total = [0.0] * len(form)
    for k, factor in enumerate(form):
        if turns and k < degree:
            total[k + 1] -= 0.5 * (degree - k) * factor
        if k:
            total[k - 1] += (0.5 if turns else 1.0) * k * factor
    return tuple(total)


class FormWithSlopes(NamedTuple):
    """A form with its first and second derivative."""

    form: Form
    slope: Form
    bend: Form

    @classmethod
    def along(cls, form: Form, *, turns: bool) -> FormWithSlopes:
        """Return a form with its derivatives by the angle or the slide."""
        slope = _slope(form, turns=turns)
        return cls(form, slope, _slope(slope, turns=turns))

    def motion_at(self, at: Sequence[float]) -> ValueWithSlopes:
        """Return value and derivatives."""
        return ValueWithSlopes(*(_value(form, at) for form in self))


class ValueWithSlopes(NamedTuple):
    """A number that depends on the joint that moves the rod, with its derivatives by it."""

    value: float
    slope: float
    bend: float


class Course(NamedTuple):
    """How the joint that moves the end of the rod moves it past the seat of the closed joint."""

    coordinate: int  # Index of the joint's value among the coordinates
    turns: bool  # Whether it is an angle
    place: tuple[Form, Form, Form]  # Coordinates of the end in the seat

    @classmethod
    def about(cls, coordinate: int, value: float, axis: Vector, at: Vector, end: Vector) -> Course:
        """Return the course about an axis through a place; ``end`` is there at the value."""
        arm = minus(end, at)
        centre = plus(at, scale(dot(axis, arm), axis))
        ahead = minus(end, centre)
        beside = cross(axis, ahead)
        c, s = math.cos(value), math.sin(value)
        x, y, z = (
            (o + (u * c - v * s), 2.0 * (u * s + v * c), o - (u * c - v * s))
            for o, u, v in zip(centre, ahead, beside, strict=True)
        )
        return cls(coordinate, True, (x, y, z))

    @classmethod
    def along(cls, coordinate: int, value: float, axis: Vector, end: Vector) -> Course:
        """Return the course along an axis; ``end`` is there at the value."""
        x, y, z = ((e - a * value, a, 0.0) for e, a in zip(end, axis, strict=True))
        return cls(coordinate, False, (x, y, z))

    def square_from(self, start: Vector) -> Form:
        """Return the form of degree 2 of the square of the distance from a place of the seat."""
        x, y, z = self.place
        first, both, second = ((x[k], y[k], z[k]) for k in range(3))
        if not self.turns:
            arm = minus(first, start)
            return dot(arm, arm), 2.0 * dot(arm, both), dot(both, both)
        centre, ahead = scale(0.5, plus(first, second)), scale(0.5, minus(first, second))
        arm = minus(centre, start)
        size, change = dot(arm, arm) + dot(ahead, ahead), 2.0 * dot(arm, ahead)
        return size + change, 2.0 * dot(arm, both), size - change

    @property
    def unit_form(self) -> Form:
        """Return the form of degree 2 that is 1."""
        return (1.0, 0.0, 1.0) if self.turns else (1.0, 0.0, 0.0)

    def numbers_at(self, solved: LinkState) -> tuple[float, float]:
        """Return C and S."""
        value = solved.coordinates[self.coordinate]
        return (cos(0.5 * value), sin(0.5 * value)) if self.turns else (1.0, value)


class Folds(NamedTuple):
    """The square of a lever, taken apart into factors of degree 1 and what is left."""

    common: tuple[Form, ...]  # Factors of x, y and r·d·cos θ, taken out of all
    passed: tuple[Form, ...]  # Factors whose square is in that of the lever
    under: Form

    @property
    def turns_matter(self) -> bool:
        """Whether a whole turn of the angle leads to the other assembly."""
        return (len(self.common) + len(self.passed)) % 2 == 1


def _divide_by(form: Form, lines: Sequence[Form]) -> Form:
    """Return a form without factors of degree 1."""
    for across, along in lines:
        form = _divide_out(form, math.atan2(-across, along), 1)
    return form


def find_folds(square: Form, size: Form, *ways: Form, turns: bool) -> Folds:
    """
    Take the square of a lever apart.

    ``size`` is the square that it has across the rod, and ``ways`` are what vanishes where the end
    of the rod comes to the axis of a hinge.
    """
    greatest = max(map(abs, size))
    common = [
        angle
        for angle in (_angles_of_valleys(size, turns=turns) if ways else ())
        if sum(_value(way, _unit(angle)) ** 2 for way in ways) <= _FOLDED**2 * greatest
    ]
    for angle in common:
        square, size = _divide_out(square, angle, 2), _divide_out(size, angle, 2)
    passed = [
        angle
        for angle in _angles_of_valleys(square, turns=turns)
        if abs(_value(square, _unit(angle))) <= _FOLDED * _value(size, _unit(angle))
    ]
    for angle in passed:
        square = _divide_out(square, angle, 2)
    common_lines, lines = (tuple(map(_line_through, angles)) for angles in (common, passed))
    return Folds(common_lines, lines, square)


class FoldedPose(NamedTuple):
    """The pose of a step."""

    status: Status
    gap: float = 0.0
    at: tuple[float, float] = (1.0, 0.0)  # C and S
    lever: float = 0.0
    root: float = 0.0  # Of what is under the root
    angle: float = 0.0  # From a toggle, in [rad]


@dataclass(frozen=True, slots=True)
class FoldingJoint(Step):
    """A joint that a rod closes, as a function of the single joint that moves the rod's end."""

    has_transmission_angle = True

    closed: ClosedJoint  # The same without change points
    course: Course
    folds: Folds
    passing: FormWithSlopes  # The lever but for its root
    under: FormWithSlopes

    def close(self, solved: LinkState) -> FoldedPose:
        """Append the joint and the frame of its child."""
        at = self.course.numbers_at(solved)
        if any(self._is_zero(line, at, solved) for line in self.folds.common):
            return FoldedPose(Status.INDETERMINATE)
        size = math.fsum(map(abs, self.under.form))
        root, _, status = root_of(_value(self.under.form, at), size)
        if status is Status.OPEN:
            trial = LinkState([*solved.coordinates], [*solved.pins])
            # Where both differ by rounding, the other one closes.
            return FoldedPose(status, max(self.closed.close(trial).gap, ROUNDING))
        lever = _value(self.passing.form, at) * root
        value, angle = self._follow(at, lever)
        solved.coordinates.append(value)
        joint = self.closed.joint
        solved.pins.append(joint.child_frame(joint.base(solved), value))
        if status is Status.CLOSED:
            passes = any(self._is_zero(line, at, solved) for line in self.folds.passed)
            status = Status.CHANGE_POINT if passes else status
        return FoldedPose(status, 0.0, at, lever, root, angle)

    def _is_zero(self, line: Form, at: Sequence[float], solved: LinkState) -> bool:
        """Return whether a factor is 0 but for the rounding of the joint that moves the rod."""
        value = solved.coordinates[self.course.coordinate]
        return passes_zero(_value(line, at), 0.5 * value if self.course.turns else value)

    def _follow(self, at: Sequence[float], lever: float) -> tuple[float, float]:
        """Return the value of the joint, and the angle from a toggle."""
        raise NotImplementedError

    def _derivatives(self, at: Sequence[float], lever: ValueWithSlopes) -> tuple[float, float]:
        """Return the first and second derivative of the value."""
        raise NotImplementedError

    def rates(self, pose: FoldedPose, solved: LinkState, velocities: LinkState) -> Any:
        """Append the rates of the joint and of its child; return rate, and slope and bend."""
        p, p1, p2 = self.passing.motion_at(pose.at)
        _, u1, u2 = self.under.motion_at(pose.at)
        w = pose.root
        # Of the root of what is under it: w' = u'/(2w), w'' = (u''/2 − w'²)/w.
        w1 = 0.5 * u1 / w
        w2 = subtract(0.5 * u2, multiply(w1, w1)) / w
        lever = ValueWithSlopes(
            pose.lever,
            add(p1 * w, multiply(p, w1)),
            add(p2 * w, add(multiply(2.0 * p1, w1), multiply(p, w2))),
        )
        slope, bend = self._derivatives(pose.at, lever)
        rate = slope * velocities.coordinates[self.course.coordinate]
        frame, joint = solved.pins[self.closed.child], self.closed.joint
        velocities.coordinates.append(rate)
        velocities.pins.append(joint.motion(solved, velocities, frame, rate))
        return rate, slope, bend

    def accelerations(
        self,
        _pose: FoldedPose,
        rates: Any,
        solved: LinkState,
        velocities: LinkState,
        changes: LinkState,
    ) -> None:
        """Append the accelerations of the joint and of its child."""
        rate, slope, bend = rates
        moved = velocities.coordinates[self.course.coordinate]
        change = add(slope * changes.coordinates[self.course.coordinate], bend * (moved * moved))
        frame, joint = solved.pins[self.closed.child], self.closed.joint
        changes.coordinates.append(change)
        changes.pins.append(joint.change(solved, velocities, changes, frame, rate, change))

    def transmission_angle(self, pose: FoldedPose) -> float:
        """Return the angle from a toggle, in [0, π/2] rad; 0 where the direction is undefined."""
        meeting = (abs(_value(line, pose.at)) for line in self.folds.common)
        return min(acute_angle(pose.angle), *meeting, 0.5 * pi)

    @property
    def span(self) -> FoldingJoint | None:
        """Return itself, if an angle moves the rod: it knows its singular angles."""
        return self if self.course.turns else None

    @property
    def arms(self) -> tuple[int, int]:
        """Return the coordinate of that angle, and that of the ground."""
        return self.course.coordinate, 0

    @property
    def singular_angles(self) -> tuple[float, ...]:
        """Return the angles at which it passes a change point, or has no direction, in [rad]."""
        lines = (*self.folds.common, *self.folds.passed)
        return tuple(2.0 * math.atan2(-across, along) for across, along in lines)

    @property
    def crosses(self) -> tuple[bool, bool]:
        """Return whether it changes its side at one change point, and at a second."""
        return True, not self.folds.turns_matter

    def side_of(self, pose: FoldedPose) -> float:
        """Return a number whose sign is the assembly."""
        return pose.lever


class Ways(NamedTuple):
    """What the direction of a hinge follows from, without common factors."""

    x: FormWithSlopes
    y: FormWithSlopes
    along: FormWithSlopes  # r·d·cos θ


@dataclass(frozen=True, slots=True)
class FoldingHinge(FoldingJoint):
    """A hinge: q = dir(B) − dir(X) + θ, with θ the direction of (r·d·cos θ, lever)."""

    ways: Ways
    direction: float  # That of the carried point where the hinge is 0, in [rad]

    def _follow(self, at: Sequence[float], lever: float) -> tuple[float, float]:
        x, y, along = (_value(curve.form, at) for curve in self.ways)
        angle = atan2(lever, along)
        # Adding 0.0 makes 0.0 of −0.0: otherwise the direction could be −π instead of π.
        return atan2(y + 0.0, x + 0.0) - self.direction + angle, angle

    def _derivatives(self, at: Sequence[float], lever: ValueWithSlopes) -> tuple[float, float]:
        x, y, along = (curve.motion_at(at) for curve in self.ways)
        to_end, to_rod = _turning(x, y), _turning(along, lever)
        return to_end[0] + to_rod[0], to_end[1] + to_rod[1]


@dataclass(frozen=True, slots=True)
class FoldingSlide(FoldingJoint):
    """A slide: q = foot of B + lever."""

    foot: FormWithSlopes

    def _follow(self, at: Sequence[float], lever: float) -> tuple[float, float]:
        rod = self.closed.rod.constant
        across = sqrt(abs((rod - lever) * (rod + lever)))
        return _value(self.foot.form, at) + lever, atan2(lever, across)

    def _derivatives(self, at: Sequence[float], lever: ValueWithSlopes) -> tuple[float, float]:
        foot = self.foot.motion_at(at)
        return foot.slope + lever.slope, foot.bend + lever.bend


def _turning(x: ValueWithSlopes, y: ValueWithSlopes) -> tuple[float, float]:
    """Return the first and second derivative of the direction of a vector."""
    square = x.value * x.value + y.value * y.value
    rate = (x.value * y.slope - y.value * x.slope) / square
    growth = 2.0 * (x.value * x.slope + y.value * y.slope)
    return rate, (x.value * y.bend - y.value * x.bend - rate * growth) / square


def folding_joint(
    closed: ClosedJoint, course: Course, value: float, *, keeps_turns: bool
) -> FoldingJoint | None:
    """
    Return a closed joint that passes its change points; None if it has none.

    ``value`` is that of the joint which moves the end of the rod, in the pose, and ``keeps_turns``
    says whether its whole turns are known.
    """
    x, y, z = course.place
    square_of_rod = closed.rod.constant * closed.rod.constant
    ways: tuple[Form, ...] = ()
    if isinstance(closed, ClosedHinge):
        square_of_arm = closed.radius * closed.radius
        along = _sum_of(
            (0.5, course.square_from((0.0, 0.0, closed.place[2]))),
            (0.5 * (square_of_arm - square_of_rod), course.unit_form),
        )
        size = _sum_of((square_of_arm, _times(x, x)), (square_of_arm, _times(y, y)))
        square = _sum_of((1.0, size), (-1.0, _times(along, along)))
        ways = tuple(tuple(closed.radius * part for part in form) for form in (x, y))
    else:
        x, y, foot = (
            _sum_of((1.0, form), (-at, course.unit_form))
            for form, at in zip((x, y, z), closed.place, strict=True)
        )
        size = tuple(square_of_rod * part for part in _times(course.unit_form, course.unit_form))
        square = _sum_of((1.0, size), (-1.0, _times(x, x)), (-1.0, _times(y, y)))
    folds = find_folds(square, size, *ways, turns=course.turns)
    if not (folds.common or folds.passed) or (
        course.turns and folds.turns_matter and not keeps_turns
    ):
        return None
    at = (math.cos(0.5 * value), math.sin(0.5 * value)) if course.turns else (1.0, value)
    passing: Form = (closed.sign,)
    for line in folds.passed:
        passing = _times(passing, line)
    for line in (*folds.common, *folds.passed):
        passing = tuple(math.copysign(1.0, _value(line, at)) * part for part in passing)
    root = (
        FormWithSlopes.along(passing, turns=course.turns),
        FormWithSlopes.along(folds.under, turns=course.turns),
    )
    if not isinstance(closed, ClosedHinge):
        return FoldingSlide(
            closed, course, folds, *root, FormWithSlopes.along(foot, turns=course.turns)
        )
    x, y, along = (_divide_by(form, folds.common) for form in (x, y, along))
    curves = Ways(*(FormWithSlopes.along(form, turns=course.turns) for form in (x, y, along)))
    return FoldingHinge(closed, course, folds, *root, curves, closed.direction)
