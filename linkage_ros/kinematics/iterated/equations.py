# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Pins, sliders and driven joints as equations, for the links that are iterated.

The unknowns are the angle of each body and the place of one point of it, three numbers a body.
Each constraint gives its residual, its derivatives by the unknowns, and its first and second
derivative by time for given rates and accelerations.
"""

from __future__ import annotations

from cmath import phase
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import chain
from math import hypot, tau
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.arithmetic import make_vector, remainder, unit_vector
from linkage_ros.kinematics.iterated.elimination import add, multiply, subtract
from linkage_ros.kinematics.iterated.group import GroupMotion
from linkage_ros.kinematics.plane.linkage import Linkage, Ratio, RevoluteJoint, SlideJoint
from linkage_ros.kinematics.plane.solved_links import count_turns
from linkage_ros.kinematics.plane.topology import Joint
from linkage_ros.kinematics.step import LinkState

if TYPE_CHECKING:
    from linkage_ros.kinematics.plane.solved_links import SolvedLinks

_WHOLE = 1e-9
"""Farthest that a number of turns, which comes from decimals, is from a whole one."""


class End(NamedTuple):
    """A point at ``arm`` from the point of the body ``body``; or the known pin ``pin``."""

    body: int
    arm: complex
    pin: int = -1

    def rotated_arm(self, unknowns: Sequence[float]) -> complex:
        """Return the arm on a body, in the frame of the ground."""
        return self.arm * unit_vector(unknowns[3 * self.body]) if self.arm else 0j

    def place_and_arm(
        self, unknowns: Sequence[float], solved: LinkState
    ) -> tuple[complex, complex]:
        """Return the point, and its arm in the frame of the ground."""
        if self.body < 0:
            return solved.pins[self.pin], 0j
        k = 3 * self.body
        arm = self.rotated_arm(unknowns)
        return add(make_vector(unknowns[k + 1], unknowns[k + 2]), arm), arm

    def differentiate(self, motion: GroupMotion) -> tuple[complex, ...]:
        """Return the point, its velocity, and its acceleration if the motion has some."""
        if self.body < 0:
            states = motion.solved, motion.solved_rates, motion.solved_accelerations
            return tuple(state.pins[self.pin] for state in states if state is not None)
        k = 3 * self.body
        place, arm = self.place_and_arm(motion.unknowns, motion.solved)
        turn = motion.rates[k]
        velocity = make_vector(motion.rates[k + 1], motion.rates[k + 2])
        # Where the links stand still, or the point is that of the link, nothing is to be computed.
        velocity = add(velocity, multiply(make_vector(0.0, turn), arm))
        if motion.solved_accelerations is None:
            return place, velocity
        change, *pull = (motion.accelerations[k + i] for i in range(3))
        swirl = multiply(make_vector(-turn * turn, change), arm)
        return place, velocity, add(make_vector(*pull), swirl)


class BodyDirection(NamedTuple):
    """A direction: the angle of ``body``, or a coordinate, plus a constant, in [rad]."""

    body: int
    coordinate: int
    direction: float

    def angle(self, unknowns: Sequence[float], solved: LinkState) -> float:
        """Return the angle of the direction."""
        return self.rate(unknowns, solved) + self.direction

    def rate(self, values: Sequence[float], state: LinkState) -> float:
        """Return its derivative, from derivatives of the unknowns and of the solved links."""
        return values[3 * self.body] if self.body >= 0 else state.coordinates[self.coordinate]

    def measure(
        self, unknowns: Sequence[float], solved: LinkState
    ) -> tuple[float, dict[int, float]]:
        """Return the angle, and its derivatives by the unknowns."""
        slopes = {3 * self.body: 1.0} if self.body >= 0 else {}
        return self.angle(unknowns, solved), slopes

    def measured_change(self, motion: GroupMotion) -> float:
        """Return the highest derivative of the angle by time."""
        return self.rate(*motion.highest)


class CoincidentPoints(NamedTuple):
    """Two points coincide."""

    one: End
    other: End

    def evaluate(
        self, unknowns: Sequence[float], solved: LinkState
    ) -> tuple[list[float], list[list[float]]]:
        """Return the residuals, and the rows of their derivatives by the unknowns."""
        across, along = [0.0] * len(unknowns), [0.0] * len(unknowns)
        (first, turn), (second, back) = (end.place_and_arm(unknowns, solved) for end in self)
        apart = first - second
        if self.one.body >= 0:
            k, end = 3 * self.one.body, 3 * self.one.body + 3
            across[k:end] = -turn.imag, 1.0, 0.0
            along[k:end] = turn.real, 0.0, 1.0
        if self.other.body >= 0:
            k, end = 3 * self.other.body, 3 * self.other.body + 3
            across[k:end] = back.imag, -1.0, 0.0
            along[k:end] = -back.real, 0.0, -1.0
        return [apart.real, apart.imag], [across, along]

    def differentiate(self, motion: GroupMotion) -> list[float]:
        """Return the highest derivative of the residuals by time."""
        first, second = (end.differentiate(motion)[-1] for end in self)
        apart = subtract(first, second)
        return [apart.real, apart.imag]

    def bound_change(
        self,
        unknowns: Sequence[float],
        solved: LinkState,
        moved: Sequence[float],
    ) -> list[list[float]]:
        """Return a bound of the change of the rows; see `bound_jacobian_change`."""
        across, along = [0.0] * len(unknowns), [0.0] * len(unknowns)
        for end in self:
            if end.body >= 0:
                k = 3 * end.body
                turn, arm = moved[k], end.place_and_arm(unknowns, solved)[1]
                # |d(r·sin)| ≤ |r·cos|·|dφ| + |r|·dφ²/2, and likewise for the cosine.
                curved = 0.5 * abs(end.arm) * turn * turn
                across[k] += abs(arm.real) * turn + curved
                along[k] += abs(arm.imag) * turn + curved
        return [across, along]


class Parallel(NamedTuple):
    """An angle between two links: a constant plus the input with index ``turn``, if not 0."""

    one: BodyDirection
    other: BodyDirection
    angle: float
    turn: int = 0

    def evaluate(
        self, unknowns: Sequence[float], solved: LinkState
    ) -> tuple[list[float], list[list[float]]]:
        """Return the residual, and the row of its derivatives by the unknowns."""
        turned = solved.coordinates[self.turn] if self.turn else 0.0
        angle = self.one.angle(unknowns, solved) - self.other.angle(unknowns, solved)
        row = [0.0] * len(unknowns)
        for direction, sign in ((self.one, 1.0), (self.other, -1.0)):
            if direction.body >= 0:
                row[3 * direction.body] += sign
        return [remainder(angle - self.angle - turned, tau)], [row]

    def differentiate(self, motion: GroupMotion) -> list[float]:
        """Return the highest derivative of the residual by time."""
        values, state = motion.highest
        driven = state.coordinates[self.turn] if self.turn else 0.0
        return [self.one.rate(values, state) - self.other.rate(values, state) - driven]

    def bound_change(
        self, unknowns: Sequence[float], *_: Sequence[float] | LinkState
    ) -> list[list[float]]:
        """Return a bound of the change of the row: it is constant."""
        return [[0.0] * len(unknowns)]


class OnLine(NamedTuple):
    """A point on a line through another one; at the distance of the input ``slide``, if not 0."""

    point: End
    through: End
    line: BodyDirection
    slide: int = 0

    def place(self, unknowns: Any, solved: LinkState) -> complex:
        """Return the point in the frame of the line."""
        point, through = (e.place_and_arm(unknowns, solved)[0] for e in (self.point, self.through))
        return (point - through) * unit_vector(-self.line.angle(unknowns, solved))

    def slopes(
        self, unknowns: Sequence[float], solved: LinkState
    ) -> tuple[complex, dict[int, complex]]:
        """Return the point in the frame of the line, and its derivatives by the unknowns."""
        back = unit_vector(-self.line.angle(unknowns, solved))
        place = self.place(unknowns, solved)
        columns: dict[int, complex] = {}
        for end, sign in ((self.point, 1.0), (self.through, -1.0)):
            if end.body >= 0:
                k = 3 * end.body
                arm = end.place_and_arm(unknowns, solved)[1]
                for column, slope in ((k, 1j * arm), (k + 1, 1.0 + 0j), (k + 2, 1j)):
                    columns[column] = columns.get(column, 0j) + sign * slope * back
        if self.line.body >= 0:
            k = 3 * self.line.body
            columns[k] = columns.get(k, 0j) - 1j * place
        return place, columns

    def move(self, motion: GroupMotion) -> tuple[complex, ...]:
        """Return the derivatives of the point by time, in the frame of the line, from the 0th."""
        ends = (end.differentiate(motion) for end in (self.point, self.through))
        back = unit_vector(-self.line.angle(motion.unknowns, motion.solved))
        place, velocity, *pull = (
            (first - second) * back for first, second in zip(*ends, strict=True)
        )
        turn = self.line.rate(motion.rates, motion.solved_rates)
        velocity -= make_vector(0.0, turn) * place
        if motion.solved_accelerations is None:
            return place, velocity
        change = self.line.rate(*motion.highest)
        swirl = make_vector(0.0, 2.0 * turn) * velocity + make_vector(-turn * turn, change) * place
        return place, velocity, pull[0] - swirl

    def measure(
        self, unknowns: Sequence[float], solved: LinkState
    ) -> tuple[float, dict[int, float]]:
        """Return the slide, and its derivatives by the unknowns."""
        place, slopes = self.slopes(unknowns, solved)
        return place.real, {column: slope.real for column, slope in slopes.items()}

    def measured_change(self, motion: GroupMotion) -> float:
        """Return the highest derivative of the slide by time."""
        return self.move(motion)[-1].real

    def evaluate(
        self, unknowns: Sequence[float], solved: LinkState
    ) -> tuple[list[float], list[list[float]]]:
        """Return the residual, and the row of its derivatives by the unknowns."""
        place, slopes = self.slopes(unknowns, solved)
        row = [0.0] * len(unknowns)
        for column, slope in slopes.items():
            row[column] = slope.real if self.slide else slope.imag
        return [place.real - solved.coordinates[self.slide] if self.slide else place.imag], [row]

    def differentiate(self, motion: GroupMotion) -> list[float]:
        """Return the highest derivative of the residual by time."""
        moved = self.move(motion)[-1]
        if not self.slide:
            return [moved.imag]
        return [moved.real - motion.highest[1].coordinates[self.slide]]

    def bound_change(
        self,
        unknowns: Sequence[float],
        solved: LinkState,
        moved: Sequence[float],
    ) -> list[list[float]]:
        """Return a bound of the change of the row; see `bound_jacobian_change`."""
        row = [0.0] * len(unknowns)
        turn = moved[3 * self.line.body] if self.line.body >= 0 else 0.0
        far = 0.0
        for end in (self.point, self.through):
            if end.body < 0:
                continue
            k = 3 * end.body
            reach = abs(end.arm)
            far += hypot(moved[k + 1], moved[k + 2]) + reach * moved[k]
            row[k] += reach * (moved[k] + turn)
            row[k + 1] += turn
            row[k + 2] += turn
        if self.line.body >= 0:
            row[3 * self.line.body] += abs(self.place(unknowns, solved)) * turn + far
        return [row]


class Geared(NamedTuple):
    """A sum of factors times angles or slides, and a constant, is a multiple of the period."""

    terms: tuple[tuple[float, BodyDirection | OnLine], ...]
    constant: float
    period: float  # Infinite if the sum is 0

    def evaluate(
        self, unknowns: Sequence[float], solved: LinkState
    ) -> tuple[list[float], list[list[float]]]:
        """Return the residual, and the row of its derivatives by the unknowns."""
        total, row = self.constant, [0.0] * len(unknowns)
        for factor, of in self.terms:
            value, slopes = of.measure(unknowns, solved)
            total += factor * value
            for column, slope in slopes.items():
                row[column] += factor * slope
        return [remainder(total, self.period) if self.period else total], [row]

    def differentiate(self, motion: GroupMotion) -> list[float]:
        """Return the highest derivative of the residual by time."""
        return [sum(factor * of.measured_change(motion) for factor, of in self.terms)]

    def bound_change(self, unknowns: Sequence[float], *states: Any) -> list[list[float]]:
        """Return a bound of the change of the row; see `bound_jacobian_change`."""
        row = [0.0] * len(unknowns)
        for factor, of in self.terms:
            if isinstance(of, OnLine):
                (own,) = of.bound_change(unknowns, *states)
                row = [a + abs(factor) * b for a, b in zip(row, own, strict=True)]
        return [row]


Constraint = CoincidentPoints | Parallel | OnLine | Geared


def evaluate_constraints(
    constraints: Sequence[Constraint], unknowns: Sequence[float], solved: LinkState
) -> tuple[list[float], list[list[float]]]:
    """Return the residuals of the constraints, and their derivatives by the unknowns, as rows."""
    parts = [constraint.evaluate(unknowns, solved) for constraint in constraints]
    return [e for errors, _ in parts for e in errors], [row for _, rows in parts for row in rows]


def differentiate_constraints(
    constraints: Sequence[Constraint], motion: GroupMotion
) -> list[float]:
    """Return the highest derivative of the constraints by time."""
    return [value for constraint in constraints for value in constraint.differentiate(motion)]


def bound_jacobian_change(
    constraints: Sequence[Constraint],
    unknowns: Sequence[float],
    solved: LinkState,
    moved: Sequence[float],
) -> list[list[float]]:
    """
    Return a bound of the change of the derivatives by the unknowns, entry by entry.

    ``moved`` is the largest change of each unknown, in either direction.
    """
    states = unknowns, solved, moved
    return [row for constraint in constraints for row in constraint.bound_change(*states)]


def is_meshed(constraints: Sequence[Constraint], off: Sequence[float], part: float) -> bool:
    """Return whether the residuals of ratios are off by less than a part of their periods."""
    row = 0
    for constraint in constraints:
        period = constraint.period if isinstance(constraint, Geared) else 0.0
        if period and not off[row] < part * period:
            return False
        row += 2 if isinstance(constraint, CoincidentPoints) else 1
    return True


class Constraints:
    """
    The joints of a group of links, as constraints.

    ``planner`` gives and places the links solved before the group. ``ratios`` names the joints
    whose ratios are solved with the group.
    """

    def __init__(
        self,
        linkage: Linkage,
        joints: Sequence[Joint],
        links: Sequence[str],
        planner: SolvedLinks,
        ratios: Sequence[str] = (),
    ) -> None:
        self._linkage = linkage
        self._planner = planner
        self._links = links
        self._bodies = {link: i for i, link in enumerate(links)}
        self.constraints: list[
            Constraint
        ] = []  # The constraints: as many equations as there are unknowns
        # Indices of the pins that links solved before the group have in it, by name.
        self.known_pins: dict[str, int] = {}
        self.slides: dict[str, OnLine] = {}  # The sliders of the group, by name
        for joint in joints:
            self._add_joint(joint)
        self._add_drives()
        for name in ratios:
            self._add_ratio(name, linkage.ratios[name])

    def _add_joint(self, joint: Joint) -> None:
        if joint.kind == 'R':
            self.constraints.append(
                CoincidentPoints(
                    self._end_point(joint.link, joint.name), self._end_point(joint.to, joint.name)
                )
            )
            return
        slider = self._linkage.sliders[joint.name]
        block, rail = self._body_direction(joint.link, 0.0), self._body_direction(joint.to, 0.0)
        self.constraints.append(Parallel(block, rail, slider.angle))
        self.slides[joint.name] = OnLine(
            self._end_point(joint.link, slider.point),
            self._end_point(joint.to, slider.through),
            self._body_direction(joint.to, phase(complex(*slider.direction))),
        )
        self.constraints.append(self.slides[joint.name])

    def _add_drives(self) -> None:
        for i, driven in enumerate(self._linkage.driven_joints):
            if not self._planner.has_drive(i):
                continue
            if driven.slider in self.slides:
                line = self.slides[driven.slider]
                self.constraints.append(line._replace(slide=self._planner.drive_coordinate(i)))
            elif driven.child in self._bodies or driven.parent in self._bodies:
                child, parent = (
                    self._body_direction(end, 0.0) for end in (driven.child, driven.parent)
                )
                self.constraints.append(
                    Parallel(child, parent, 0.0, self._planner.drive_coordinate(i))
                )

    def _add_ratio(self, name: str, follower: Ratio) -> None:
        joints = self._linkage.joints[name], self._linkage.joints[follower.of]
        slides = [isinstance(joint, SlideJoint) for joint in joints]
        # The constraint is in the unit of the joint that follows.
        unit = self._planner.scale if slides[0] else 1.0
        ratio = follower.ratio * (self._planner.scale if slides[1] else 1.0) / unit
        # Without the turns of its links, an angle determines the other one modulo this.
        turns = count_turns(follower.ratio)
        period = tau if slides[1] else abs(ratio) * tau if slides[0] else tau / max(turns, 1)
        if all(slides) or not turns:
            period = 0.0
        terms = (*self._ratio_terms(joints[0], 1.0), *self._ratio_terms(joints[1], -ratio))
        self.constraints.append(Geared(terms, -follower.offset / unit, period))

    @property
    def turns(self) -> int:
        """
        Return the whole turns of a single input that change nothing; 0 if none are known.

        Where a ratio gains by the turns of the input, whole turns of a link that no other ratio
        has must make up for them: with a ratio of 3/2 one turn leads to another tooth.
        """
        turns, turns_with = self._planner.ratio_turns, self._planner.turns_with
        geared = [
            [(factor, of) for factor, of in constraint.terms if isinstance(of, BodyDirection)]
            for constraint in self.constraints
            if isinstance(constraint, Geared)
        ]
        met = Counter(chain.from_iterable({of.body for _, of in terms} for terms in geared))
        for terms in geared:
            gained, factors = 0.0, dict.fromkeys(met, 0.0)
            for factor, of in terms:
                if of.body >= 0:
                    factors[of.body] += factor
                else:
                    gained += factor * turns * turns_with.get(of.coordinate, (0.0,))[0]
            own = [factor for body, factor in factors.items() if factor and met[body] == 1]
            if gained and not any(_is_whole(gained / factor) for factor in own):
                return 0
        return turns

    def _ratio_terms(
        self, joint: RevoluteJoint | SlideJoint, factor: float
    ) -> Iterator[tuple[float, BodyDirection | OnLine]]:
        if isinstance(joint, RevoluteJoint):
            yield factor, self._body_direction(joint.child, 0.0)
            yield -factor, self._body_direction(joint.parent, 0.0)
        elif joint.slider in self.slides:
            yield factor, self.slides[joint.slider]
        else:
            coordinate, _, sign, constant = self._planner.joint_term(joint)
            yield factor * sign, BodyDirection(-1, coordinate, sign * constant)

    def _end_point(self, link: str, name: str) -> End:
        points = self._planner.points[link]
        if link in self._bodies:
            return End(self._bodies[link], points[name] - next(iter(points.values())))
        self.known_pins[name] = self._planner.place_point(link, points[name])
        return End(-1, 0j, self.known_pins[name])

    def _body_direction(self, link: str, direction: float) -> BodyDirection:
        if link in self._bodies:
            return BodyDirection(self._bodies[link], 0, direction)
        angle = self._planner.angles[link].rotate_by(direction)
        return BodyDirection(-1, angle.coordinate, angle.constant)


def _is_whole(number: float) -> bool:
    return abs(number - round(number)) <= _WHOLE
