# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""
What holds links that are iterated: pins, sliders and driven joints as equations.

The unknowns are the angle of each body and the place of one point of it, three numbers a body.
Each constraint tells what it is off by, its slopes by the unknowns, and its first and second
derivative by time for given rates and accelerations.
"""

from __future__ import annotations

from cmath import rect
from collections.abc import Sequence
from math import hypot, remainder, tau
from typing import Any, NamedTuple

from linkage_ros.kinematics.step import State
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]


class End(NamedTuple):
    """A point: of the body ``body`` at ``arm`` from its own point, or the pin ``pin``."""

    body: int
    arm: complex
    pin: int = -1


class Facing(NamedTuple):
    """A direction: the angle of ``body``, or a coordinate, plus a constant, in [rad]."""

    body: int
    coordinate: int
    direction: float


class Meeting(NamedTuple):
    """Two points meet."""

    one: End
    other: End


class Parallel(NamedTuple):
    """One link is at an angle to another: constant, or the input ``turn``, where that is not 0."""

    one: Facing
    other: Facing
    angle: float
    turn: int = 0


class OnLine(NamedTuple):
    """A point is on a line through another; with a ``slide``, an input, it is that far along."""

    point: End
    through: End
    line: Facing
    slide: int = 0


Constraint = Meeting | Parallel | OnLine


def equations(
    constraints: Sequence[Constraint], unknowns: Array, known: State
) -> tuple[Array, Array]:
    """Return what the constraints are off by, and their derivatives by the unknowns."""
    n = len(unknowns)
    errors, rows = [], []
    x = known[0]
    values = unknowns.tolist()
    for constraint in constraints:
        if isinstance(constraint, Meeting):
            (one, turn), (other, back) = (_place(e, values, known) for e in constraint)
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
            angle = _angle(constraint.one, values, x) - _angle(constraint.other, values, x)
            errors.append(remainder(angle - constraint.angle - turned, tau))
            row = [0.0] * n
            for facing, sign in ((constraint.one, 1.0), (constraint.other, -1.0)):
                if facing.body >= 0:
                    row[3 * facing.body] += sign
            rows.append(row)
        else:
            error, row = _line_equation(constraint, values, known, n)
            errors.append(error)
            rows.append(row)
    return np.array(errors), np.array(rows)


def spread(
    constraints: Sequence[Constraint],
    unknowns: Array,
    known: State,
    moved: Array,
    known_moved: State,
) -> Array:
    """
    Return a bound of how much the derivatives by the unknowns change, entry by entry.

    Parameters
    ----------
    constraints, unknowns, known
        As of `equations`.
    moved
        How far each unknown moves from its value, in either direction.
    known_moved
        How far each coordinate and each pin moves that is known before.

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
        else:
            rows.append(_line_spread(constraint, values, known, ways, known_moved))
    return np.array(rows)


def _line_spread(
    line: OnLine, values: Sequence[float], known: State, ways: Sequence[float], moved: State
) -> list[float]:
    row = [0.0] * len(values)
    facing = line.line
    turn = ways[3 * facing.body] if facing.body >= 0 else moved[0][facing.coordinate]
    far = 0.0
    for end in (line.point, line.through):
        if end.body < 0:
            far += float(abs(moved[1][end.pin]))
            continue
        k = 3 * end.body
        reach = abs(end.arm)
        far += hypot(ways[k + 1], ways[k + 2]) + reach * ways[k]
        row[k] += reach * (ways[k] + turn)
        row[k + 1] += turn
        row[k + 2] += turn
    if facing.body >= 0:
        row[3 * facing.body] += abs(along(line, known, values)) * turn + far
    return row


def derivative(
    constraints: Sequence[Constraint],
    unknowns: Array,
    known: State,
    speeds: State,
    rates: Array,
    changes: State | None,
    accelerations: Array,
) -> Array:
    """Return the first derivative of the constraints; the second, where changes are given."""
    order = 1 if changes is None else 2
    found: list[float] = []
    for constraint in constraints:
        if isinstance(constraint, Meeting):
            one, other = (
                _point_motion(e, unknowns, known, speeds, rates, changes, accelerations)[order]
                for e in constraint
            )
            found += [one.real - other.real, one.imag - other.imag]
        elif isinstance(constraint, Parallel):
            state = speeds if changes is None else changes
            values = rates if changes is None else accelerations
            one, other = (_turn(f, values, state) for f in (constraint.one, constraint.other))
            driven = state[0][constraint.turn] if constraint.turn else 0.0
            found.append(one - other - driven)
        else:
            moved = line_motion(
                constraint, unknowns, known, speeds, rates, changes, accelerations
            )[order]
            if constraint.slide:
                state = speeds if changes is None else changes
                found.append(moved.real - state[0][constraint.slide])
            else:
                found.append(moved.imag)
    return np.array(found)


def _angle(facing: Facing, unknowns: Sequence[float], x: Sequence[float]) -> float:
    base = unknowns[3 * facing.body] if facing.body >= 0 else x[facing.coordinate]
    return float(base + facing.direction)


def _turn(facing: Facing, values: Any, state: State) -> float:
    return float(values[3 * facing.body] if facing.body >= 0 else state[0][facing.coordinate])


def _place(end: End, unknowns: Sequence[float], known: State) -> tuple[complex, complex]:
    """Return a point, and its arm as it lies now."""
    if end.body < 0:
        return known[1][end.pin], 0j
    k = 3 * end.body
    arm = end.arm * rect(1.0, unknowns[k])
    return complex(unknowns[k + 1], unknowns[k + 2]) + arm, arm


def along(line: OnLine, known: State, unknowns: Any) -> complex:
    """Return a point in the frame of the line that it is to be on."""
    point, through = (_place(e, unknowns, known)[0] for e in (line.point, line.through))
    return (point - through) * rect(1.0, -_angle(line.line, unknowns, known[0]))


def _line_equation(
    line: OnLine, unknowns: Sequence[float], known: State, n: int
) -> tuple[float, list[float]]:
    back = rect(1.0, -_angle(line.line, unknowns, known[0]))
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
    row = [0.0] * n
    for column, slope in columns.items():
        row[column] = slope.real if line.slide else slope.imag
    error = place.real - known[0][line.slide] if line.slide else place.imag
    return error, row


def _point_motion(
    end: End,
    unknowns: Array,
    known: State,
    speeds: State,
    rates: Array,
    changes: State | None,
    accelerations: Array,
) -> tuple[complex, complex, complex]:
    """Return place, velocity and acceleration of a point."""
    if end.body < 0:
        pull = changes[1][end.pin] if changes is not None else 0j
        return known[1][end.pin], speeds[1][end.pin], pull
    k = 3 * end.body
    place, arm = _place(end, unknowns.tolist(), known)
    turn = float(rates[k])
    velocity = complex(rates[k + 1], rates[k + 2]) + complex(0.0, turn) * arm
    pull = complex(accelerations[k + 1], accelerations[k + 2])
    return place, velocity, pull + complex(-turn * turn, float(accelerations[k])) * arm


def line_motion(
    line: OnLine,
    unknowns: Array,
    known: State,
    speeds: State,
    rates: Array,
    changes: State | None,
    accelerations: Array,
) -> tuple[complex, complex, complex]:
    """Return place, velocity and acceleration of a point in the frame of its line."""
    point, through = (
        _point_motion(e, unknowns, known, speeds, rates, changes, accelerations)
        for e in (line.point, line.through)
    )
    back = rect(1.0, -_angle(line.line, unknowns.tolist(), known[0]))
    turn = _turn(line.line, rates, speeds)
    change = _turn(line.line, accelerations, changes) if changes is not None else 0.0
    place = (point[0] - through[0]) * back
    velocity = (point[1] - through[1]) * back - complex(0.0, turn) * place
    pull = (point[2] - through[2]) * back
    pull -= complex(0.0, 2.0 * turn) * velocity + complex(-turn * turn, change) * place
    return place, velocity, pull
