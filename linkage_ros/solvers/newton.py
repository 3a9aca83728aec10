# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Newton's method on the loop of each dyad, instead of the closed form.

A dyad's two unknowns p and q, angles or slides, close one loop of vectors, F(p, q) = 0, which is
two real equations. With × for the z component of the cross product::

    F_p·δp + F_q·δq = −F      δp = F_q × F/(F_p × F_q)      δq = F × F_p/(F_p × F_q)

until both corrections are below the tolerance, in [rad] or [m]; the remaining error has the size
of their square. Rates and accelerations solve the same equations for the change of F while p and
q, or their rates, are held. F_p × F_q is 0 where the dyad folds or stretches, and its sign is the
assembly. The closed form gives the state instead where the sign differs from the sign of the
closed form nearby (near a toggle or a change point), where the method does not converge, and where
the loops do not close. Groups that no dyad covers are iterated in any case, here to the tolerance.

The method starts from the closed form at a knot, extrapolated by the rates there. An input has 256
knots to a turn, or to the unit of length, and a state uses the nearest. A knot is valid only if
the loops close there and at its neighbours in the same assembly, so that no change point lies
between a state and its knot. Knots are computed on demand and depend on nothing else, so a state
depends on the inputs alone. The method may also start from its last state (``warm``); then a state
depends, within the tolerance, on the states before it.
"""

from __future__ import annotations

from cmath import rect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import copysign, inf, tau
from typing import Any, NamedTuple

from linkage_ros.description import number
from linkage_ros.kinematics import (
    Acceleration,
    BUILD_LOCK,
    Closure,
    cross_product,
    Dyad,
    FixedPoint,
    HUGE,
    Iterated,
    Linkage,
    LinkState,
    PLACED,
    PointOnLink,
    PointOnRail,
    Position,
    RelativeAngle,
    Status,
    Step,
    UNIT_ROUNDOFF,
    usual_inputs,
    Velocity,
)
from linkage_ros.solvers.loops import LoopFinder, Loops, Vector
from linkage_ros.solvers.solver import refuse_ratios, Solver

_PER_TURN = 256
_MOST = 2**16
"""Number of knots that are kept; beyond it they are computed again."""

_STEPS = 12
"""Largest number of Newton steps; a cold start takes up to ten."""

LEAST_SINE = 0.05
"""Sine of the angle between F_p and F_q below which the dyad is too near to folding."""

_ROUNDING = 16.0 * UNIT_ROUNDOFF

PLACING = (FixedPoint, PointOnLink, PointOnRail)
"""Steps that place a pin and add no coordinate."""

_CLOSED = Status.CLOSED


class Knot(NamedTuple):
    """
    The closed form at a knot: all coordinates, and for each input the derivatives of all.

    The sign of a dyad is its assembly: +1 or −1.
    """

    inputs: tuple[float, ...]
    coordinates: list[float]
    slopes: tuple[list[float], ...]
    signs: tuple[float, ...]


class Knots:
    """
    Knots of a linkage.

    ``orientations`` returns the orientation (a sign) of each dyad at the coordinates of a closed
    position. ``repeats``: whether all poses repeat after two turns of an input.
    """

    def __init__(
        self,
        closed: Closure,
        orientations: Callable[[list[float]], tuple[float, ...]],
        repeats: bool,
    ) -> None:
        self._closed = closed
        self._orientations = orientations
        self._spacing = [
            (1.0 if given.slider else tau) / _PER_TURN for given in closed.linkage.inputs
        ]
        self._period = [
            2 * _PER_TURN if repeats and not given.slider else 0 for given in closed.linkage.inputs
        ]
        self._units = [closed.scale if given.slider else 1.0 for given in closed.linkage.inputs]
        self._knots: dict[tuple[int, ...], Knot | None] = {}
        self._signs: dict[tuple[int, ...], tuple[float, ...] | None] = {}

    def nearest_knot(self, inputs: Sequence[float]) -> tuple[Knot | None, list[float]]:
        """Return the knot nearest to inputs, given as coordinates, and their offsets from it."""
        numbers, offsets = [], []
        for value, spacing, period in zip(inputs, self._spacing, self._period, strict=True):
            number = round(value / spacing)
            offsets.append(value - number * spacing)
            numbers.append(number % period if period else number)
        key = tuple(numbers)
        try:
            return self._knots[key], offsets
        except KeyError:
            return self._add_knot(key), offsets

    def _add_knot(self, key: tuple[int, ...]) -> Knot | None:
        with BUILD_LOCK:
            if len(self._knots) >= _MOST:
                self._knots.clear()
                self._signs.clear()
            self._knots[key] = knot = self._solve_knot(key)
            return knot

    def _solve_knot(self, key: tuple[int, ...]) -> Knot | None:
        signs = self._signs_at(key)
        around = [
            tuple(number + step * (k == i) for k, number in enumerate(key))
            for i in range(len(key))
            for step in (-1, 1)
        ]
        if signs is None or any(self._signs_at(other) != signs for other in around):
            return None
        given = self._given_coordinates(key)
        closed = self._closed
        position = closed.position(*given)
        slopes = []
        for i in range(len(key)):
            rates = [self._units[i] if k == i else 0.0 for k in range(len(key))]
            slopes.append(closed.velocity(position, *rates).state.coordinates)
        coordinates, count = position.state.coordinates, len(key)
        return Knot(tuple(coordinates[1:][:count]), coordinates, tuple(slopes), signs)

    def _signs_at(self, key: tuple[int, ...]) -> tuple[float, ...] | None:
        """Return the assembly of each dyad, or None if a loop is not closed."""
        if key not in self._signs:
            position = self._closed.position(*self._given_coordinates(key))
            closed = position.status in (Status.CLOSED, Status.LIMITED)
            self._signs[key] = self._orientations(position.state.coordinates) if closed else None
        return self._signs[key]

    def _given_coordinates(self, key: tuple[int, ...]) -> list[float]:
        return [
            number * spacing * unit
            for number, spacing, unit in zip(key, self._spacing, self._units, strict=True)
        ]


class NewtonDyad:
    """
    Newton's method on one dyad with its loop.

    The tolerances bound the last correction: of an angle in [rad], of a slide in the unit of the
    lengths.
    """

    __slots__ = ('_arms', '_constant', '_first', '_known', '_new', '_tolerances', '_two_arms')

    def __init__(self, loops: Loops, tolerance: float, slide_tolerance: float) -> None:
        self._first, second = loops.coordinates
        (vectors,) = loops.equations
        new = tuple(v for v in vectors if {self._first, second} & {*dict(v.turns), v.slide})
        known = [v for v in vectors if v not in new]
        self._new = new
        self._constant = sum((v.factor for v in known if not v.turns and v.slide < 0), 0j)
        single = [v for v in known if v.slide < 0 and len(v.turns) == 1 and v.turns[0][1] > 0.0]
        self._arms = tuple((v.factor, v.turns[0][0]) for v in single)
        self._known = tuple(
            v for v in known if v not in single and (v.turns or v.slide >= 0 or v.pin >= 0)
        )
        sliding = {v.slide for v in new}
        self._tolerances = tuple(
            max(slide_tolerance if k in sliding else tolerance, _ROUNDING)
            for k in (self._first, second)
        )
        by_turns = {v.turns: v.factor for v in new if v.slide < 0}
        turns = ((self._first, 1.0),), ((second, 1.0),)
        self._two_arms = None
        if len(new) == 2 and set(by_turns) == set(turns):
            self._two_arms = by_turns[turns[0]], by_turns[turns[1]]

    def close(self, x: list[float], pins: list[complex], p: float, q: float, sign: float) -> bool:
        """
        Append p and q to the coordinates, or return False if there is no solution.

        x are the known coordinates, and ``pins`` the pins that iterations have placed. p and q are
        the start; ``sign`` is the required sign of F_p × F_q.
        """
        known = self._constant
        for factor, arm in self._arms:
            known += factor * rect(1.0, x[arm])
        for vector in self._known:
            known += _vector_value(vector, x, pins)
        if self._two_arms is None:
            return self._close_any(x, pins, known, p, q, sign)
        first, second = self._two_arms
        p_least, q_least = self._tolerances
        for _ in range(_STEPS):
            one, other = first * rect(1.0, p), second * rect(1.0, q)
            off = known + one + other
            # F_p = i·one, F_q = i·other.
            across = one.real * other.imag - one.imag * other.real
            if not across:
                return False
            dp = -(other.real * off.real + other.imag * off.imag) / across
            dq = (one.real * off.real + one.imag * off.imag) / across
            p += dp
            q += dq
            if -p_least <= dp <= p_least and -q_least <= dq <= q_least:
                x += (p, q)
                return across * sign >= LEAST_SINE * abs(one) * abs(other)
        return False

    def _close_any(
        self, x: list[float], pins: list[complex], known: complex, p: float, q: float, sign: float
    ) -> bool:
        first = self._first
        x += (p, q)
        p_least, q_least = self._tolerances
        for _ in range(_STEPS):
            off = known
            for vector in self._new:
                off += _vector_value(vector, x, pins)
            by_p, by_q = self._partial_derivatives(x)
            across = cross_product(by_p, by_q)
            if not across:
                break
            dp, dq = cross_product(by_q, off) / across, cross_product(off, by_p) / across
            x[first] += dp
            x[first + 1] += dq
            if -p_least <= dp <= p_least and -q_least <= dq <= q_least:
                return across * sign >= LEAST_SINE * abs(by_p) * abs(by_q)
        del x[first:]
        return False

    def orientation(self, x: list[float]) -> float:
        """Return the sine of the angle from F_p to F_q."""
        by_p, by_q = self._partial_derivatives(x)
        return cross_product(by_p, by_q) / (abs(by_p) * abs(by_q))

    def append_rates(
        self, x: list[float], pins: list[complex], v: list[float], speeds: list[complex]
    ) -> None:
        """Append the rates of p and q, given the rates of the known coordinates."""
        v += (0.0, 0.0)
        drift = 0j
        for factor, arm in self._arms:
            drift += 1j * (v[arm] * (factor * rect(1.0, x[arm])))
        for vector in (*self._known, *self._new):
            drift += _vector_rate(vector, x, pins, v, speeds)
        self._solve_drift(x, drift, v)

    def append_accelerations(
        self,
        x: list[float],
        v: list[float],
        a: list[float],
        pulls: list[complex],
    ) -> None:
        """Append the accelerations of p and q; the known coordinates have theirs."""
        a += (0.0, 0.0)
        drift = 0j
        for factor, arm in self._arms:
            drift += complex(-v[arm] * v[arm], a[arm]) * (factor * rect(1.0, x[arm]))
        for vector in (*self._known, *self._new):
            drift += _vector_acceleration(vector, x, v, a, pulls)
        self._solve_drift(x, drift, a)

    def _solve_drift(self, x: list[float], drift: complex, into: list[float]) -> None:
        by_p, by_q = self._partial_derivatives(x)
        across = cross_product(by_p, by_q)
        into[self._first] = cross_product(by_q, drift) / across
        into[self._first + 1] = cross_product(drift, by_p) / across

    def _partial_derivatives(self, x: list[float]) -> tuple[complex, complex]:
        """Return F_p and F_q."""
        first = self._first
        slopes = [0j, 0j]
        for factor, turns, slide, _ in self._new:
            unit = factor * rect(1.0, sum([sign * x[k] for k, sign in turns]))
            if slide >= first:
                slopes[slide - first] += unit
            if slide >= 0:
                unit *= x[slide]
            for k, sign in turns:
                if k >= first:
                    slopes[k - first] += sign * 1j * unit
        return slopes[0], slopes[1]


def _vector_value(vector: Vector, x: list[float], pins: list[complex]) -> complex:
    factor, turns, slide, pin = vector
    if pin >= 0:
        return factor * pins[pin]
    unit = factor * rect(1.0, sum([sign * x[k] for k, sign in turns]))
    return unit if slide < 0 else unit * x[slide]


def _vector_rate(
    vector: Vector, x: list[float], pins: list[complex], v: list[float], speeds: list[complex]
) -> complex:
    """Return the derivative: e^{iφ}·(ṡ + iφ̇·s)."""
    factor, turns, slide, pin = vector
    if pin >= 0:
        return factor * speeds[pin]
    unit = factor * rect(1.0, sum([sign * x[k] for k, sign in turns]))
    turn = sum([sign * v[k] for k, sign in turns])
    if slide < 0:
        return 1j * turn * unit
    return complex(v[slide], turn * x[slide]) * unit


def _vector_acceleration(
    vector: Vector, x: list[float], v: list[float], a: list[float], pulls: list[complex]
) -> complex:
    """Return the second derivative: e^{iφ}·(s̈ − φ̇²·s + i(φ̈·s + 2φ̇·ṡ))."""
    factor, turns, slide, pin = vector
    if pin >= 0:
        return factor * pulls[pin]
    unit = factor * rect(1.0, sum([sign * x[k] for k, sign in turns]))
    turn = sum([sign * v[k] for k, sign in turns])
    change = sum([sign * a[k] for k, sign in turns])
    if slide < 0:
        return complex(-turn * turn, change) * unit
    s, way = x[slide], v[slide]
    return complex(a[slide] - turn * turn * s, change * s + 2.0 * turn * way) * unit


@dataclass(frozen=True, slots=True)
class NewtonParameters:
    """Newton's method on the loops of each dyad."""

    tolerance: float = number(
        'bound of the last correction', unit='rad and m', least=1e-15, most=1e-2
    )


PARAMETERS = NewtonParameters


def build(parameters: NewtonParameters, linkage: Linkage) -> NewtonClosure:
    """Build the closure."""
    return NewtonClosure(linkage, parameters.tolerance)


class _NewtonRoot(list[Any]):
    """Poses of a state that Newton's method solved, one for each step that is not a dyad."""


_NO_POSES = _NewtonRoot()


class NewtonClosure(Solver):
    """
    A linkage whose dyads Newton's method closes.

    The tolerance bounds the last corrections, in [rad] or [m]. If ``warm`` is true, each state
    starts from the last one, if false from the pose of the file; if None from the nearest knot, so
    that a state depends on its inputs alone.
    """

    by_steps = False

    def __init__(self, linkage: Linkage, tolerance: float, warm: bool | None = None) -> None:
        refuse_ratios(linkage, 'newton')
        super().__init__(Closure(linkage))
        self.tolerance = tolerance
        self.exact_states = 0  # Number of states that the closed form has solved so far
        self._given_warm = warm
        self._warm = warm is True
        self._last: list[float] | None = None
        self._plan, self._iterates = self._plan_steps(tolerance)
        self._dyads = [one for one in self._plan if isinstance(one, NewtonDyad)]
        self._knots = Knots(self.closed, self._dyad_orientations, repeats=not self._iterates)
        self._pose: list[float] | None = None
        if warm is False:
            pose = self.closed.position(*usual_inputs(self.closed))
            self._pose = pose.state.coordinates

    def _build_arguments(self) -> tuple[Any, ...]:
        return self.linkage, self.tolerance, self._given_warm

    def position(self, *inputs: float) -> Position:
        x = self._input_coordinates('inputs', inputs, 0.0, inf)
        if x is None:
            return self._solve_exactly(inputs)
        knot, offsets = self._knots.nearest_knot(x[1:])
        if knot is None:
            return self._solve_exactly(inputs)
        start = self._pose or self._last
        if start is None:
            start = knot.coordinates
            for offset, slopes in zip(offsets, knot.slopes, strict=True):
                start = [
                    value + offset * slope for value, slope in zip(start, slopes, strict=True)
                ]
        signs = iter(knot.signs)
        pins: list[complex] = []
        state = LinkState(x, pins)
        poses = _NewtonRoot() if self._iterates else _NO_POSES
        for part in self._plan:
            if isinstance(part, NewtonDyad):
                k = len(x)
                if not part.close(x, pins, start[k], start[k + 1], next(signs)):
                    return self._solve_exactly(inputs)
                continue
            pose = part.close(state)
            if pose.status is not _CLOSED:
                return self._solve_exactly(inputs)
            if self._iterates:
                poses.append(pose)
        if self._warm:
            self._last = x.copy()
        joints: tuple[float, ...] = ()
        for i, j, factor, constant in self._terms:
            joints += (factor * (x[i] - x[j]) + constant,)
        return Position(_CLOSED, 0.0, joints, state, poses, self)

    def velocity(self, position: Position, *rates: float) -> Velocity:
        state, poses = position.state, position.poses
        if not isinstance(poses, _NewtonRoot):
            return self.closed.velocity(position, *rates)
        v = self._input_coordinates('rates', rates)
        if v is None:
            return super().velocity(position, *rates)
        x, pins = state
        speeds = LinkState(v, [])
        others = iter(poses)
        part_rates = []
        for part in self._plan:
            if isinstance(part, NewtonDyad):
                part.append_rates(x, pins, v, speeds.pins)
            else:
                part_rates.append(part.rates(next(others, PLACED), state, speeds))
        return Velocity(self._joint_rates(v), speeds, part_rates, self)

    def acceleration(
        self, position: Position, velocity: Velocity, *accelerations: float
    ) -> Acceleration:
        state, poses = position.state, position.poses
        if not isinstance(poses, _NewtonRoot):
            return self.closed.acceleration(position, velocity, *accelerations)
        a = self._input_coordinates('accelerations', accelerations, -0.0, HUGE * HUGE)
        if a is None or velocity.rates is None:
            return super().acceleration(position, velocity, *accelerations)
        speeds, rates = velocity.state, velocity.rates
        changes = LinkState(a, [])
        others, moving = iter(poses), iter(rates)
        for part in self._plan:
            if isinstance(part, NewtonDyad):
                part.append_accelerations(state.coordinates, speeds.coordinates, a, changes.pins)
            else:
                pose, rate = next(others, PLACED), next(moving)
                part.accelerations(pose, rate, state, speeds, changes)
        return Acceleration(self._joint_rates(a), changes, self)

    def place_links(self, position: Position) -> Position:
        if not isinstance(position.poses, _NewtonRoot):
            return position
        if self._iterates:
            return position
        state = LinkState(position.state.coordinates, [])
        for step in self.steps:
            if isinstance(step, PLACING):
                step.close(state)
        return replace(position, state=state)

    def _solve_exactly(self, inputs: tuple[float, ...]) -> Position:
        """Return the state in closed form; with ``warm`` it is the next start."""
        self.exact_states += 1
        position = self.closed.position(*inputs)
        if self._warm and position.status is _CLOSED:
            self._last = position.state.coordinates
        return position

    def _plan_steps(self, tolerance: float) -> tuple[tuple[NewtonDyad | Step, ...], bool]:
        """Return the dyads and other steps, in order, and whether any group is iterated."""
        finder = LoopFinder(self.linkage, self.structure, self._known)
        loops = iter(finder.find_loops())
        groups = self.structure.groups
        iterates = any(isinstance(group, Iterated) for group in groups)
        plan: list[NewtonDyad | Step] = []
        for step, group in zip(self.steps, self.step_groups, strict=True):
            if isinstance(step, PLACING):
                # Without an iterated group no loop needs a pin.
                if iterates:
                    plan.append(step)
            elif isinstance(step, RelativeAngle):
                plan.append(step)
            elif isinstance(groups[group], Dyad):
                plan.append(NewtonDyad(next(loops), tolerance, tolerance / self.scale))
            else:
                next(loops)
                iteration: Any = step
                plan.append(iteration.stopped_at(tolerance))
        return tuple(plan), iterates

    def _dyad_orientations(self, x: list[float]) -> tuple[float, ...]:
        return tuple(copysign(1.0, dyad.orientation(x)) for dyad in self._dyads)
