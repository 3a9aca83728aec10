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

from linkage_ros.kinematics.arithmetic import facing, remainder, vector
from linkage_ros.kinematics.known_links import count_turns
from linkage_ros.kinematics.linkage import Linkage, Ratio, RevoluteJoint, SlideJoint
from linkage_ros.kinematics.step import State
from linkage_ros.kinematics.topology import Joint
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from linkage_ros.kinematics.known_links import KnownLinks

Array = NDArray[np.floating[Any]]


class End(NamedTuple):
    """A point at ``arm`` from the point of the body ``body``; or the known pin ``pin``."""

    body: int
    arm: complex
    pin: int = -1


class Facing(NamedTuple):
    """A direction: the angle of ``body``, or a coordinate, plus a constant, in [rad]."""

    body: int
    coordinate: int
    direction: float


class Meeting(NamedTuple):
    """Two points coincide."""

    one: End
    other: End


class Parallel(NamedTuple):
    """An angle between two links: a constant plus the input with index ``turn``, if not 0."""

    one: Facing
    other: Facing
    angle: float
    turn: int = 0


class OnLine(NamedTuple):
    """A point on a line through another one; at the distance of the input ``slide``, if not 0."""

    point: End
    through: End
    line: Facing
    slide: int = 0


class Geared(NamedTuple):
    """A sum of factors times angles or slides, and a constant, is a multiple of the period."""

    terms: tuple[tuple[float, Facing | OnLine], ...]
    constant: float
    period: float  # Infinite if the sum is 0


Constraint = Meeting | Parallel | OnLine | Geared


def equations(
    constraints: Sequence[Constraint], unknowns: Sequence[float], known: State
) -> tuple[list[float], list[list[float]]]:
    """Return the residuals of the constraints, and their derivatives by the unknowns, as rows."""
    n = len(unknowns)
    errors: list[float] = []
    rows: list[list[float]] = []
    x = known.coordinates
    for constraint in constraints:
        if isinstance(constraint, Meeting):
            (one, turn), (other, back) = (_place(e, unknowns, known) for e in constraint)
            errors += [one.real - other.real, one.imag - other.imag]
            across, along = [0.0] * n, [0.0] * n
            for end, arm, sign in (
                (constraint.one, turn, 1.0),
                (constraint.other, back, -1.0),
            ):
                if end.body >= 0:
                    k = 3 * end.body
                    across[k] -= sign * arm.imag
                    across[k + 1] += sign
                    along[k] += sign * arm.real
                    along[k + 2] += sign
            rows += [across, along]
        elif isinstance(constraint, Parallel):
            turned = x[constraint.turn] if constraint.turn else 0.0
            angle = _angle(constraint.one, unknowns, x) - _angle(constraint.other, unknowns, x)
            errors.append(remainder(angle - constraint.angle - turned, tau))
            row = [0.0] * n
            for end_facing, sign in ((constraint.one, 1.0), (constraint.other, -1.0)):
                if end_facing.body >= 0:
                    row[3 * end_facing.body] += sign
            rows.append(row)
        elif isinstance(constraint, Geared):
            total, row = constraint.constant, [0.0] * n
            for factor, of in constraint.terms:
                if isinstance(of, Facing):
                    total += factor * _angle(of, unknowns, x)
                    slopes = {3 * of.body: 1.0 + 0j} if of.body >= 0 else {}
                else:
                    place, slopes = _line_slopes(of, unknowns, known)
                    total += factor * place.real
                for column, slope in slopes.items():
                    row[column] += factor * slope.real
            errors.append(remainder(total, constraint.period) if constraint.period else total)
            rows.append(row)
        else:
            place, slopes = _line_slopes(constraint, unknowns, known)
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
        row += 2 if isinstance(constraint, Meeting) else 1
    return True


def spread(
    constraints: Sequence[Constraint],
    unknowns: Array,
    known: State,
    moved: Array,
    known_moved: State,
) -> Array:
    """
    Return a bound of the change of the derivatives by the unknowns, entry by entry.

    Parameters
    ----------
    constraints, unknowns, known
        As in `equations`.
    moved
        Largest change of each unknown, in either direction.
    known_moved
        Largest change of each known coordinate and pin.

    """
    n = len(unknowns)
    rows = []
    values, ways = unknowns.tolist(), moved.tolist()
    for constraint in constraints:
        if isinstance(constraint, Meeting):
            across, along = [0.0] * n, [0.0] * n
            for end in constraint:
                if end.body >= 0:
                    k = 3 * end.body
                    turn, arm = ways[k], _place(end, values, known)[1]
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
                        _line_spread(of, values, known, ways, known_moved)
                    )
            rows.append(row.tolist())
        else:
            rows.append(_line_spread(constraint, values, known, ways, known_moved))
    return np.array(rows)


def _line_spread(
    line: OnLine, values: Sequence[float], known: State, ways: Sequence[float], moved: State
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
        row[3 * rail.body] += abs(along(line, known, values)) * turn + far
    return row


def derivative(
    constraints: Sequence[Constraint],
    unknowns: Sequence[float],
    known: State,
    speeds: State,
    rates: Sequence[float],
    changes: State | None,
    accelerations: Sequence[float],
) -> list[float]:
    """Return the first derivative of the constraints; the second if changes are given."""
    order = 1 if changes is None else 2
    derivatives: list[float] = []
    for constraint in constraints:
        if isinstance(constraint, Meeting):
            one, other = (
                _point_motion(e, unknowns, known, speeds, rates, changes, accelerations)[order]
                for e in constraint
            )
            derivatives += [one.real - other.real, one.imag - other.imag]
        elif isinstance(constraint, Parallel):
            state = speeds if changes is None else changes
            values = rates if changes is None else accelerations
            one, other = (_turn(f, values, state) for f in (constraint.one, constraint.other))
            driven = state.coordinates[constraint.turn] if constraint.turn else 0.0
            derivatives.append(one - other - driven)
        elif isinstance(constraint, Geared):
            state = speeds if changes is None else changes
            values = rates if changes is None else accelerations
            given = unknowns, known, speeds, rates, changes, accelerations
            derivatives.append(
                sum(
                    factor
                    * (
                        _turn(of, values, state)
                        if isinstance(of, Facing)
                        else line_motion(of, *given)[order].real
                    )
                    for factor, of in constraint.terms
                )
            )
        else:
            moved = line_motion(
                constraint, unknowns, known, speeds, rates, changes, accelerations
            )[order]
            if constraint.slide:
                state = speeds if changes is None else changes
                derivatives.append(moved.real - state.coordinates[constraint.slide])
            else:
                derivatives.append(moved.imag)
    return derivatives


def _angle(of: Facing, unknowns: Sequence[float], x: Sequence[float]) -> float:
    base = unknowns[3 * of.body] if of.body >= 0 else x[of.coordinate]
    return base + of.direction


def _turn(of: Facing, values: Sequence[float], state: State) -> float:
    return values[3 * of.body] if of.body >= 0 else state.coordinates[of.coordinate]


def _place(end: End, unknowns: Sequence[float], known: State) -> tuple[complex, complex]:
    """Return a point, and its arm in the frame of the ground."""
    if end.body < 0:
        return known.pins[end.pin], 0j
    k = 3 * end.body
    arm = end.arm * facing(unknowns[k])
    return vector(unknowns[k + 1], unknowns[k + 2]) + arm, arm


def along(line: OnLine, known: State, unknowns: Any) -> complex:
    """Return a point in the frame of its line."""
    point, through = (_place(e, unknowns, known)[0] for e in (line.point, line.through))
    return (point - through) * facing(-_angle(line.line, unknowns, known.coordinates))


def _line_slopes(
    line: OnLine, unknowns: Sequence[float], known: State
) -> tuple[complex, dict[int, complex]]:
    """Return a point in the frame of its line, and its derivatives by the unknowns."""
    back = facing(-_angle(line.line, unknowns, known.coordinates))
    place = along(line, known, unknowns)
    columns: dict[int, complex] = {}
    for end, sign in ((line.point, 1.0), (line.through, -1.0)):
        if end.body >= 0:
            k = 3 * end.body
            arm = _place(end, unknowns, known)[1]
            for column, slope in ((k, 1j * arm), (k + 1, 1.0 + 0j), (k + 2, 1j)):
                columns[column] = columns.get(column, 0j) + sign * slope * back
    if line.line.body >= 0:
        k = 3 * line.line.body
        columns[k] = columns.get(k, 0j) - 1j * place
    return place, columns


def _point_motion(
    end: End,
    unknowns: Sequence[float],
    known: State,
    speeds: State,
    rates: Sequence[float],
    changes: State | None,
    accelerations: Sequence[float],
) -> tuple[complex, complex, complex]:
    """Return place, velocity and acceleration of a point."""
    if end.body < 0:
        pull = changes.pins[end.pin] if changes is not None else 0j
        return known.pins[end.pin], speeds.pins[end.pin], pull
    k = 3 * end.body
    place, arm = _place(end, unknowns, known)
    turn = rates[k]
    velocity = vector(rates[k + 1], rates[k + 2]) + vector(0.0, turn) * arm
    pull = vector(accelerations[k + 1], accelerations[k + 2])
    return place, velocity, pull + vector(-turn * turn, accelerations[k]) * arm


def line_motion(
    line: OnLine,
    unknowns: Sequence[float],
    known: State,
    speeds: State,
    rates: Sequence[float],
    changes: State | None,
    accelerations: Sequence[float],
) -> tuple[complex, complex, complex]:
    """Return place, velocity and acceleration of a point in the frame of its line."""
    point, through = (
        _point_motion(e, unknowns, known, speeds, rates, changes, accelerations)
        for e in (line.point, line.through)
    )
    back = facing(-_angle(line.line, unknowns, known.coordinates))
    turn = _turn(line.line, rates, speeds)
    change = _turn(line.line, accelerations, changes) if changes is not None else 0.0
    place = (point[0] - through[0]) * back
    velocity = (point[1] - through[1]) * back - vector(0.0, turn) * place
    pull = (point[2] - through[2]) * back
    pull -= vector(0.0, 2.0 * turn) * velocity + vector(-turn * turn, change) * place
    return place, velocity, pull


class Constraints:
    """
    The joints of a group of links, as constraints.

    Parameters
    ----------
    linkage
        The linkage.
    joints
        The joints of the group.
    links
        The links of the group.
    planner
        Gives and places the links solved before the group.
    ratios
        The joints whose ratios are solved with the group.

    """

    def __init__(
        self,
        linkage: Linkage,
        joints: Sequence[Joint],
        links: Sequence[str],
        planner: KnownLinks,
        ratios: Sequence[str] = (),
    ) -> None:
        self._linkage = linkage
        self._planner = planner
        self._links = links
        self._bodies = {link: i for i, link in enumerate(links)}
        self.all: list[Constraint] = []  # The constraints: as many equations as there are unknowns
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
            self.all.append(
                Meeting(self._end(joint.link, joint.name), self._end(joint.to, joint.name))
            )
            return
        slider = self._linkage.sliders[joint.name]
        block, rail = self._facing(joint.link, 0.0), self._facing(joint.to, 0.0)
        self.all.append(Parallel(block, rail, slider.angle))
        self.slides[joint.name] = OnLine(
            self._end(joint.link, slider.point),
            self._end(joint.to, slider.through),
            self._facing(joint.to, phase(complex(*slider.direction))),
        )
        self.all.append(self.slides[joint.name])

    def _add_drives(self) -> None:
        for i, given in enumerate(self._linkage.driven):
            if not self._planner.has_drive(i):
                continue
            if given.slider in self.slides:
                line = self.slides[given.slider]
                self.all.append(line._replace(slide=self._planner.drive_coordinate(i)))
            elif given.child in self._bodies or given.parent in self._bodies:
                child, parent = (self._facing(end, 0.0) for end in (given.child, given.parent))
                self.all.append(Parallel(child, parent, 0.0, self._planner.drive_coordinate(i)))

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
        terms = (*self._terms(joints[0], 1.0), *self._terms(joints[1], -ratio))
        self.all.append(Geared(terms, -given.offset / unit, period))

    def _terms(
        self, joint: RevoluteJoint | SlideJoint, factor: float
    ) -> Iterator[tuple[float, Facing | OnLine]]:
        if isinstance(joint, RevoluteJoint):
            yield factor, self._facing(joint.child, 0.0)
            yield -factor, self._facing(joint.parent, 0.0)
        elif joint.slider in self.slides:
            yield factor, self.slides[joint.slider]
        else:
            coordinate, _, sign, constant = self._planner.term(joint)
            yield factor * sign, Facing(-1, coordinate, sign * constant)

    def _end(self, link: str, name: str) -> End:
        points = self._planner.points[link]
        if link in self._bodies:
            return End(self._bodies[link], points[name] - next(iter(points.values())))
        self.known_pins[name] = self._planner.place(link, points[name])
        return End(-1, 0j, self.known_pins[name])

    def _facing(self, link: str, direction: float) -> Facing:
        if link in self._bodies:
            return Facing(self._bodies[link], 0, direction)
        angle = self._planner.angles[link].plus(direction)
        return Facing(-1, angle.coordinate, angle.constant)
