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
from collections.abc import Iterator, Sequence
from math import hypot, tau
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.arithmetic import make_vector, remainder, unit_vector
from linkage_ros.kinematics.elimination import add, multiply, subtract
from linkage_ros.kinematics.linkage import Linkage, Ratio, RevoluteJoint, SlideJoint
from linkage_ros.kinematics.solved_links import count_turns
from linkage_ros.kinematics.step import LinkState
from linkage_ros.kinematics.topology import Joint
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from linkage_ros.kinematics.solved_links import SolvedLinks

Array = NDArray[np.floating[Any]]


class End(NamedTuple):
    """A point at ``arm`` from the point of the body ``body``; or the known pin ``pin``."""

    body: int
    arm: complex
    pin: int = -1


class BodyDirection(NamedTuple):
    """A direction: the angle of ``body``, or a coordinate, plus a constant, in [rad]."""

    body: int
    coordinate: int
    direction: float


class CoincidentPoints(NamedTuple):
    """Two points coincide."""

    one: End
    other: End


class Parallel(NamedTuple):
    """An angle between two links: a constant plus the input with index ``turn``, if not 0."""

    one: BodyDirection
    other: BodyDirection
    angle: float
    turn: int = 0


class OnLine(NamedTuple):
    """A point on a line through another one; at the distance of the input ``slide``, if not 0."""

    point: End
    through: End
    line: BodyDirection
    slide: int = 0


class Geared(NamedTuple):
    """A sum of factors times angles or slides, and a constant, is a multiple of the period."""

    terms: tuple[tuple[float, BodyDirection | OnLine], ...]
    constant: float
    period: float  # Infinite if the sum is 0


Constraint = CoincidentPoints | Parallel | OnLine | Geared


def evaluate_constraints(
    constraints: Sequence[Constraint], unknowns: Sequence[float], solved: LinkState
) -> tuple[list[float], list[list[float]]]:
    """Return the residuals of the constraints, and their derivatives by the unknowns, as rows."""
    n = len(unknowns)
    errors: list[float] = []
    rows: list[list[float]] = []
    x = solved.coordinates
    for constraint in constraints:
        if isinstance(constraint, CoincidentPoints):
            (one, turn), (other, back) = (point_and_arm(e, unknowns, solved) for e in constraint)
            apart = one - other
            errors += [apart.real, apart.imag]
            across, along = [0.0] * n, [0.0] * n
            if constraint.one.body >= 0:
                k, end = 3 * constraint.one.body, 3 * constraint.one.body + 3
                across[k:end] = -turn.imag, 1.0, 0.0
                along[k:end] = turn.real, 0.0, 1.0
            if constraint.other.body >= 0:
                k, end = 3 * constraint.other.body, 3 * constraint.other.body + 3
                across[k:end] = back.imag, -1.0, 0.0
                along[k:end] = -back.real, 0.0, -1.0
            rows += [across, along]
        elif isinstance(constraint, Parallel):
            turned = x[constraint.turn] if constraint.turn else 0.0
            angle = _direction_angle(constraint.one, unknowns, x) - _direction_angle(
                constraint.other, unknowns, x
            )
            errors.append(remainder(angle - constraint.angle - turned, tau))
            row = [0.0] * n
            for end_facing, sign in ((constraint.one, 1.0), (constraint.other, -1.0)):
                if end_facing.body >= 0:
                    row[3 * end_facing.body] += sign
            rows.append(row)
        elif isinstance(constraint, Geared):
            total, row = constraint.constant, [0.0] * n
            for factor, of in constraint.terms:
                if isinstance(of, BodyDirection):
                    total += factor * _direction_angle(of, unknowns, x)
                    slopes = {3 * of.body: 1.0 + 0j} if of.body >= 0 else {}
                else:
                    place, slopes = _line_slopes(of, unknowns, solved)
                    total += factor * place.real
                for column, slope in slopes.items():
                    row[column] += factor * slope.real
            errors.append(remainder(total, constraint.period) if constraint.period else total)
            rows.append(row)
        else:
            place, slopes = _line_slopes(constraint, unknowns, solved)
            row = [0.0] * n
            for column, slope in slopes.items():
                row[column] = slope.real if constraint.slide else slope.imag
            driven = constraint.slide
            errors.append(place.real - x[driven] if driven else place.imag)
            rows.append(row)
    return errors, rows


def is_meshed(constraints: Sequence[Constraint], off: Sequence[float], part: float) -> bool:
    """Return whether the residuals of ratios are off by less than a part of their periods."""
    row = 0
    for constraint in constraints:
        period = constraint.period if isinstance(constraint, Geared) else 0.0
        if period and not off[row] < part * period:
            return False
        row += 2 if isinstance(constraint, CoincidentPoints) else 1
    return True


def bound_jacobian_change(
    constraints: Sequence[Constraint],
    unknowns: Array,
    solved: LinkState,
    moved: Array,
    known_moved: LinkState,
) -> Array:
    """
    Return a bound of the change of the derivatives by the unknowns, entry by entry.

    ``moved`` is the largest change of each unknown, in either direction; ``known_moved`` the
    largest change of each known coordinate and pin.
    """
    n = len(unknowns)
    rows = []
    values, ways = unknowns.tolist(), moved.tolist()
    for constraint in constraints:
        if isinstance(constraint, CoincidentPoints):
            across, along = [0.0] * n, [0.0] * n
            for end in constraint:
                if end.body >= 0:
                    k = 3 * end.body
                    turn, arm = ways[k], point_and_arm(end, values, solved)[1]
                    # |d(r·sin)| ≤ |r·cos|·|dφ| + |r|·dφ²/2, and likewise for the cosine.
                    curved = 0.5 * abs(end.arm) * turn * turn
                    across[k] += abs(arm.real) * turn + curved
                    along[k] += abs(arm.imag) * turn + curved
            rows += [across, along]
        elif isinstance(constraint, Parallel):
            rows.append([0.0] * n)
        elif isinstance(constraint, Geared):
            row = np.zeros(n)
            for factor, of in constraint.terms:
                if isinstance(of, OnLine):
                    row += abs(factor) * np.array(
                        _line_spread(of, values, solved, ways, known_moved)
                    )
            rows.append(row.tolist())
        else:
            rows.append(_line_spread(constraint, values, solved, ways, known_moved))
    return np.array(rows)


def _line_spread(
    line: OnLine,
    values: Sequence[float],
    solved: LinkState,
    ways: Sequence[float],
    moved: LinkState,
) -> list[float]:
    row = [0.0] * len(values)
    rail = line.line
    turn = ways[3 * rail.body] if rail.body >= 0 else moved.coordinates[rail.coordinate]
    far = 0.0
    for end in (line.point, line.through):
        if end.body < 0:
            far += float(abs(moved.pins[end.pin]))
            continue
        k = 3 * end.body
        reach = abs(end.arm)
        far += hypot(ways[k + 1], ways[k + 2]) + reach * ways[k]
        row[k] += reach * (ways[k] + turn)
        row[k + 1] += turn
        row[k + 2] += turn
    if rail.body >= 0:
        row[3 * rail.body] += abs(point_in_line_frame(line, solved, values)) * turn + far
    return row


def differentiate_constraints(
    constraints: Sequence[Constraint],
    unknowns: Sequence[float],
    solved: LinkState,
    solved_velocities: LinkState,
    rates: Sequence[float],
    solved_accelerations: LinkState | None,
    accelerations: Sequence[float],
) -> list[float]:
    """Return the first derivative of the constraints; the second if changes are given."""
    order = 1 if solved_accelerations is None else 2
    derivatives: list[float] = []
    for constraint in constraints:
        if isinstance(constraint, CoincidentPoints):
            one, other = (
                _point_motion(
                    e,
                    unknowns,
                    solved,
                    solved_velocities,
                    rates,
                    solved_accelerations,
                    accelerations,
                )[order]
                for e in constraint
            )
            apart = subtract(one, other)
            derivatives += [apart.real, apart.imag]
        elif isinstance(constraint, Parallel):
            state = solved_velocities if solved_accelerations is None else solved_accelerations
            values = rates if solved_accelerations is None else accelerations
            one, other = (
                _direction_rate(f, values, state) for f in (constraint.one, constraint.other)
            )
            driven = state.coordinates[constraint.turn] if constraint.turn else 0.0
            derivatives.append(one - other - driven)
        elif isinstance(constraint, Geared):
            state = solved_velocities if solved_accelerations is None else solved_accelerations
            values = rates if solved_accelerations is None else accelerations
            given = unknowns, solved, solved_velocities, rates, solved_accelerations, accelerations
            derivatives.append(
                sum(
                    factor
                    * (
                        _direction_rate(of, values, state)
                        if isinstance(of, BodyDirection)
                        else line_motion(of, *given)[order].real
                    )
                    for factor, of in constraint.terms
                )
            )
        else:
            moved = line_motion(
                constraint,
                unknowns,
                solved,
                solved_velocities,
                rates,
                solved_accelerations,
                accelerations,
            )[order]
            if constraint.slide:
                state = solved_velocities if solved_accelerations is None else solved_accelerations
                derivatives.append(moved.real - state.coordinates[constraint.slide])
            else:
                derivatives.append(moved.imag)
    return derivatives


def _direction_angle(of: BodyDirection, unknowns: Sequence[float], x: Sequence[float]) -> float:
    base = unknowns[3 * of.body] if of.body >= 0 else x[of.coordinate]
    return base + of.direction


def _direction_rate(of: BodyDirection, values: Sequence[float], state: LinkState) -> float:
    return values[3 * of.body] if of.body >= 0 else state.coordinates[of.coordinate]


def end_arm(end: End, unknowns: Sequence[float]) -> complex:
    """Return the arm of an end on a body, in the frame of the ground."""
    return end.arm * unit_vector(unknowns[3 * end.body]) if end.arm else 0j


def point_and_arm(
    end: End, unknowns: Sequence[float], solved: LinkState
) -> tuple[complex, complex]:
    """Return a point, and its arm in the frame of the ground."""
    if end.body < 0:
        return solved.pins[end.pin], 0j
    k = 3 * end.body
    arm = end_arm(end, unknowns)
    return add(make_vector(unknowns[k + 1], unknowns[k + 2]), arm), arm


def point_in_line_frame(line: OnLine, solved: LinkState, unknowns: Any) -> complex:
    """Return a point in the frame of its line."""
    point, through = (point_and_arm(e, unknowns, solved)[0] for e in (line.point, line.through))
    return (point - through) * unit_vector(
        -_direction_angle(line.line, unknowns, solved.coordinates)
    )


def _line_slopes(
    line: OnLine, unknowns: Sequence[float], solved: LinkState
) -> tuple[complex, dict[int, complex]]:
    """Return a point in the frame of its line, and its derivatives by the unknowns."""
    back = unit_vector(-_direction_angle(line.line, unknowns, solved.coordinates))
    place = point_in_line_frame(line, solved, unknowns)
    columns: dict[int, complex] = {}
    for end, sign in ((line.point, 1.0), (line.through, -1.0)):
        if end.body >= 0:
            k = 3 * end.body
            arm = point_and_arm(end, unknowns, solved)[1]
            for column, slope in ((k, 1j * arm), (k + 1, 1.0 + 0j), (k + 2, 1j)):
                columns[column] = columns.get(column, 0j) + sign * slope * back
    if line.line.body >= 0:
        k = 3 * line.line.body
        columns[k] = columns.get(k, 0j) - 1j * place
    return place, columns


def _point_motion(
    end: End,
    unknowns: Sequence[float],
    solved: LinkState,
    solved_velocities: LinkState,
    rates: Sequence[float],
    solved_accelerations: LinkState | None,
    accelerations: Sequence[float],
) -> tuple[complex, complex, complex]:
    """Return place, velocity and acceleration of a point."""
    if end.body < 0:
        pull = solved_accelerations.pins[end.pin] if solved_accelerations is not None else 0j
        return solved.pins[end.pin], solved_velocities.pins[end.pin], pull
    k = 3 * end.body
    place, arm = point_and_arm(end, unknowns, solved)
    turn = rates[k]
    velocity = make_vector(rates[k + 1], rates[k + 2])
    pull = make_vector(accelerations[k + 1], accelerations[k + 2])
    # Where the links stand still, or the point is that of the link, nothing is to be computed.
    return (
        place,
        add(velocity, multiply(make_vector(0.0, turn), arm)),
        add(pull, multiply(make_vector(-turn * turn, accelerations[k]), arm)),
    )


def line_motion(
    line: OnLine,
    unknowns: Sequence[float],
    solved: LinkState,
    solved_velocities: LinkState,
    rates: Sequence[float],
    solved_accelerations: LinkState | None,
    accelerations: Sequence[float],
) -> tuple[complex, complex, complex]:
    """Return place, velocity and acceleration of a point in the frame of its line."""
    point, through = (
        _point_motion(
            e, unknowns, solved, solved_velocities, rates, solved_accelerations, accelerations
        )
        for e in (line.point, line.through)
    )
    back = unit_vector(-_direction_angle(line.line, unknowns, solved.coordinates))
    turn = _direction_rate(line.line, rates, solved_velocities)
    change = (
        _direction_rate(line.line, accelerations, solved_accelerations)
        if solved_accelerations is not None
        else 0.0
    )
    place = (point[0] - through[0]) * back
    velocity = (point[1] - through[1]) * back - make_vector(0.0, turn) * place
    pull = (point[2] - through[2]) * back
    pull -= make_vector(0.0, 2.0 * turn) * velocity + make_vector(-turn * turn, change) * place
    return place, velocity, pull


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
        for i, given in enumerate(self._linkage.driven_joints):
            if not self._planner.has_drive(i):
                continue
            if given.slider in self.slides:
                line = self.slides[given.slider]
                self.constraints.append(line._replace(slide=self._planner.drive_coordinate(i)))
            elif given.child in self._bodies or given.parent in self._bodies:
                child, parent = (
                    self._body_direction(end, 0.0) for end in (given.child, given.parent)
                )
                self.constraints.append(
                    Parallel(child, parent, 0.0, self._planner.drive_coordinate(i))
                )

    def _add_ratio(self, name: str, given: Ratio) -> None:
        joints = self._linkage.joints[name], self._linkage.joints[given.of]
        slides = [isinstance(joint, SlideJoint) for joint in joints]
        # The constraint is in the unit of the joint that follows.
        unit = self._planner.scale if slides[0] else 1.0
        ratio = given.ratio * (self._planner.scale if slides[1] else 1.0) / unit
        # Without the turns of its links, an angle determines the other one modulo this.
        turns = count_turns(given.ratio)
        period = tau if slides[1] else abs(ratio) * tau if slides[0] else tau / max(turns, 1)
        if all(slides) or not turns:
            period = 0.0
        terms = (*self._ratio_terms(joints[0], 1.0), *self._ratio_terms(joints[1], -ratio))
        self.constraints.append(Geared(terms, -given.offset / unit, period))

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
