# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The exact motion of a torque drive, by another integrator than the drive's.

The forces are from the scene's own equation of motion. What integrates them is scipy's DOP853
(E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993,
II.5) at a tolerance of 1e-13, from one jump of a force to the next: it begins anew where a command
comes, where a rate with friction becomes 0, at an impact, and where motor and crank meet or part.

At rest with friction the mechanism stays until the force passes what friction holds. An impact on
a stop turns the rate w into −e·w, one of motor and crank (of the inertias J and I, with the rates
ν and w) keeps J·ν + I·w and turns ν − w into −e·(ν − w) (D. E. Stewart, Rigid-Body Dynamics with
Friction and Impact, SIAM Review 42, 2000).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import copysign, inf, ulp
from typing import Any, NamedTuple

from linkage_ros.dynamics import Motion, SingleDofMechanism
import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

TOLERANCE = 1e-13

_TINY = 1e-200
"""A rate that has a direction and no size."""

_BRIEF = 1e-7
"""Bounces that follow each other faster, in [s], end in contact."""

_LOOKS = 4
"""Places in a step at which events are looked for, so that two in one step are seen."""

_HELD = 1e-3
"""Interval, in [s], at which a force that changes with the time is compared with friction."""

_PULL = 1e-12
"""Pulls apart below this, in [rad/s²] or [m/s²], are none."""

_MOST_PIECES = 100_000
"""Most pieces of a motion, so that its work is bounded."""

_FASTEST = 1e10
"""Values and rates beyond this, per [s], are not a motion any more."""

State = tuple[float, float]
"""Value and rate."""

Margin = Callable[[float, Any], float]
"""A function of time and state that is 0 or more before an event, and negative after it."""


class NoMotionError(Exception):
    """The exact motion does not go on: a toggle, or rates without bound."""

    def __init__(self, time: float) -> None:
        super().__init__(time)
        self.time = time


class AppliedEffort(NamedTuple):
    """What acts from a time on, in [s]: a mechanism, the force on its input, and a brake."""

    time: float
    mechanism: Any
    force: float
    brake: float


class _MovingMass:
    """A mass of one freedom, at one moment: the crank, the motor, or both as one."""

    def __init__(
        self, of: SingleDofMechanism, force: float, brake: float, value: float, rate: float
    ):
        self.of, self.force, self.brake = of, force, brake
        self.value, self.rate = value, rate
        self.sense = 0.0
        self.rests = False

    def find_direction(self, time: float) -> None:
        """Find out whether it rests, and else in which direction it sets out."""
        terms = self._terms_at(self.value, time)
        dry = terms.coulomb + terms.breakaway + self.brake > 0.0
        jumps = dry or self.of.friction_effort is not None or bool(self.of.laws)
        if self.rate:
            self.rests, self.sense = False, copysign(1.0, self.rate) if jumps else 0.0
            return
        pushed = self.acceleration(self.value, 0.0, time)
        self.rests, self.sense = pushed == 0.0 and self._is_held(terms), 0.0
        if not self.rests and jumps and pushed:
            self.sense = copysign(1.0, pushed)

    def acceleration(self, value: float, rate: float, time: float) -> float:
        """Return q̈ by the scene's own equation of motion, of a rate in the present direction."""
        if self.sense and rate * self.sense <= 0.0:
            rate = self.sense * _TINY
        motion = Motion(value, rate, self._terms_at(value, time))
        return self.of.acceleration(motion, self.force, self.brake, time)

    def _is_held(self, terms: Any) -> bool:
        """Return whether something holds it, so that it does not just stand for a moment."""
        dry = terms.coulomb + terms.breakaway + self.brake > 0.0
        return dry or self.of.friction_effort is not None or self.value in self.of.stops

    def _terms_at(self, value: float, time: float) -> Any:
        terms = self.of.terms(value)
        if terms is None or not abs(value) < _FASTEST:
            raise NoMotionError(time)
        return terms


def exact_motion(
    start: Any,
    acting: Sequence[AppliedEffort],
    times: Sequence[float],
    tolerance: float = TOLERANCE,
) -> list[State]:
    """
    Return values and rates of the input at some times, in [s] and in order.

    ``start`` is the state of the mechanism at 0, a `Motion` or a `PlayMotion`; ``acting`` are the
    efforts from 0 on; ``tolerance`` is the relative and absolute tolerance of a step. A
    NoMotionError is raised if the motion ends before the last time.
    """
    states: list[State] = []
    run = _ExactRun(start, tolerance)
    ends = [*(change.time for change in acting[1:]), inf]
    for now, end in zip(acting, ends, strict=True):
        until = min(end, times[-1])
        begin = len(states)
        wanted = [time for time in times[begin:] if time < end or end == inf]
        states += run.advance_until(now, until, wanted)
        if end >= times[-1] and len(states) == len(times):
            break
    return states


class _ExactRun:
    """The bodies as they move from one event to the next."""

    def __init__(self, start: Any, tolerance: float) -> None:
        self._tolerance = tolerance
        self._first: float | None = None
        self._time = 0.0
        self._pieces = 0
        self._bounced = self._met = -inf
        self._crank = start.value, start.rate
        # Only with play: the motor, and 1 where it pushes the crank forward, -1 backward, or 0.
        motor = getattr(start, 'motor', None)
        self._motor = (motor.value, motor.rate) if motor else None
        self._side = 0

    def advance_until(
        self, acting: AppliedEffort, until: float, times: Sequence[float]
    ) -> list[State]:
        """Move on under what acts; return the crank at some times up to the end."""
        states: list[State] = []
        while self._time < until:
            self._pieces += 1
            if self._pieces > _MOST_PIECES:
                raise NoMotionError(self._time)
            bodies = self._moving_masses(acting)
            for body in bodies:
                body.find_direction(self._time)
            begin = len(states)
            states += self._integrate_piece(bodies, acting, until, times[begin:])
        return states + [self._crank] * (len(times) - len(states))

    def _moving_masses(self, acting: AppliedEffort) -> list[_MovingMass]:
        """Return what moves: the crank, crank and motor apart, or both as one."""
        mechanism, force, brake = acting[1:]
        if self._motor is None:
            return [_MovingMass(mechanism, force, brake, *self._crank)]
        if self._side:
            joined = _MovingMass(mechanism.joined, force, brake, *self._crank)
            joined.find_direction(self._time)
            if self._pressing_acceleration(acting, joined, self._time, *self._crank) >= 0.0:
                return [joined]
            self._side = 0
        return [
            _MovingMass(mechanism.crank, 0.0, 0.0, *self._crank),
            _MovingMass(mechanism.motor, force, brake, *self._motor),
        ]

    def _pressing_acceleration(
        self, acting: AppliedEffort, joined: _MovingMass, time: float, value: float, rate: float
    ) -> float:
        """Return how much faster the motor alone would go than the crank alone."""
        masses, force, brake = acting[1:]
        crank = _MovingMass(masses.crank, 0.0, 0.0, value, rate)
        motor = _MovingMass(masses.motor, force, brake, value + self._side * masses.half, rate)
        crank.sense = motor.sense = joined.sense
        pulled = [body.acceleration(body.value, rate, time) for body in (motor, crank)]
        return self._side * (pulled[0] - pulled[1])

    def _integrate_piece(
        self,
        bodies: list[_MovingMass],
        acting: AppliedEffort,
        until: float,
        times: Sequence[float],
    ) -> list[State]:
        """Integrate up to the next event, or to the end; return the crank at the times passed."""
        if all(body.rests for body in bodies):
            self._wait_at_rest(bodies, until)
            return [self._crank] * sum(time <= self._time for time in times)

        def state_derivative(time: float, state: Any) -> list[float]:
            slopes: list[float] = []
            numbers = state.tolist()
            for k, body in enumerate(bodies):
                value, rate = numbers[2 * k], numbers[2 * k + 1]
                moves = not body.rests
                slopes += [rate, body.acceleration(value, rate, time)] if moves else [0.0, 0.0]
            return slopes

        events = [*self._possible_events(bodies, acting)]
        begin = np.array([number for body in bodies for number in (body.value, body.rate)])
        first = min(self._first, until - self._time) if self._first else None
        solver = DOP853(
            state_derivative, self._time, begin, until, rtol=self._tolerance, atol=self._tolerance,
            first_step=first,
        )  # fmt: skip
        states: list[State] = []
        armed = [margin(self._time, begin) > 0.0 for margin, _ in events]
        while solver.status == 'running':
            solver.step()
            if solver.status == 'failed' or not np.all(np.abs(solver.y) < _FASTEST):
                raise NoMotionError(float(solver.t))
            before, now = float(solver.t_old), float(solver.t)
            if now < until:
                self._first = now - before
            dense = solver.dense_output()
            event = _first_event(events, armed, dense, before, now) if events else None
            stop = event[0] if event else now
            while len(states) < len(times) and times[len(states)] <= stop:
                value, rate = dense(times[len(states)])[:2]
                states.append((float(value), float(rate)))
            if event:
                self._store_state(bodies, dense(stop), stop, acting)
                events[event[1]][1]()
                return states
        self._store_state(bodies, solver.y, until, acting)
        return states

    def _wait_at_rest(self, bodies: list[_MovingMass], until: float) -> None:
        """Let the time pass while nothing moves."""
        timed = any(body.of.laws for body in bodies)
        if not timed:
            self._time = until
        while self._time < until:
            self._time = min(self._time + _HELD, until)
            if any(body.acceleration(body.value, 0.0, self._time) for body in bodies):
                break

    def _store_state(
        self, bodies: list[_MovingMass], state: Any, time: float, acting: AppliedEffort
    ) -> None:
        """Hold the state at a time."""
        self._time = time
        numbers = state.tolist()
        self._crank = numbers[0], numbers[1]
        if len(bodies) == 2:
            self._motor = numbers[2], numbers[3]
        elif self._motor:
            self._motor = numbers[0] + self._side * acting.mechanism.half, numbers[1]

    def _possible_events(
        self, bodies: list[_MovingMass], acting: AppliedEffort
    ) -> Iterator[tuple[Margin, Callable[[], None]]]:
        """Yield what may happen, each with what it does."""
        for index, body in enumerate(bodies):
            if body.sense and not body.rests:
                yield self._reversal_event(body.sense, index)
        # Only the crank has stops, and it comes first.
        low, high = bodies[0].of.stops
        if not bodies[0].rests:
            if high < inf:
                yield (lambda _, y: high - y[0]), self._impact_effect(acting, high, 1.0)
            if low > -inf:
                yield (lambda _, y: y[0] - low), self._impact_effect(acting, low, -1.0)
        if self._motor is None:
            return
        if len(bodies) == 2:
            half = acting.mechanism.half
            yield (
                (lambda _, y: half - abs(y[2] - y[0]) + 8.0 * ulp(abs(y[0]) + half)),
                lambda: self._collide_masses(acting),
            )
            return
        (joined,) = bodies

        def separate_masses() -> None:
            self._side = 0

        yield (
            (
                lambda t, y: (
                    self._pressing_acceleration(acting, joined, t, float(y[0]), float(y[1]))
                    + _PULL
                )
            ),
            separate_masses,
        )

    def _reversal_event(self, sense: float, number: int) -> tuple[Margin, Callable[[], None]]:
        """Return the margin of a rate to 0, and what happens there."""
        at = 2 * number + 1

        def stop_body() -> None:
            if number:
                self._motor = self._motor[0], 0.0  # type: ignore[index]
                return
            self._crank = self._crank[0], 0.0
            if self._side and self._motor:
                self._motor = self._motor[0], 0.0

        return (lambda _, y: sense * y[at]), stop_body

    def _impact_effect(
        self, acting: AppliedEffort, stop: float, outward: float
    ) -> Callable[[], None]:
        """Return what an impact of the crank on a stop does."""
        of = acting.mechanism if self._motor is None else acting.mechanism.crank

        def bounce_crank() -> None:
            rate = self._crank[1]
            brief = self._time - self._bounced < _BRIEF
            back = 0.0 if brief or outward * rate <= 0.0 else 0.0 - of.restitution * rate
            self._bounced = self._time
            self._crank = stop, back
            side, self._side = self._side, 0
            if side and self._motor and side * (self._motor[1] - back) > 0.0:
                self._collide_masses(acting)

        return bounce_crank

    def _collide_masses(self, acting: AppliedEffort) -> None:
        """Let motor and crank meet."""
        masses = acting.mechanism
        assert self._motor is not None, 'only with play'
        (q, w), (phi, nu) = self._crank, self._motor
        side = 1 if phi > q else -1
        brief = self._time - self._met < _BRIEF
        self._met = self._time
        e = 0.0 if brief else masses.restitution
        low, high = masses.crank.stops
        if w == 0.0 and q == (high if side > 0 else low):
            own, wall = 0.0, 1.0  # A crank at its stop is a wall.
        else:
            own, wall = masses.motor.terms(phi).inertia, masses.crank.terms(q).inertia
        common = (own * nu + wall * w) / (own + wall)
        bounce = e * (nu - w) / (own + wall)
        self._crank = q, common + own * bounce
        self._motor = q + side * masses.half, common - wall * bounce
        self._side = 0 if bounce else side


def _first_event(
    events: Sequence[tuple[Margin, Any]],
    armed: list[bool],
    dense: Callable[[float], Any],
    before: float,
    now: float,
) -> tuple[float, int] | None:
    """Return time and number of the first event within a step, or None."""
    low = before
    for part in range(1, _LOOKS + 1):
        at = before + (now - before) * part / _LOOKS
        state = dense(at)
        passed: list[tuple[float, int]] = []
        for index, (margin, _) in enumerate(events):
            value = margin(at, state)
            if value >= 0.0:
                armed[index] |= value > 0.0
            elif armed[index] and margin(low, dense(low)) > 0.0:
                root = brentq(lambda t, m=margin: m(t, dense(t)), low, at, xtol=1e-15, rtol=1e-14)
                passed.append((root, index))
            else:
                passed.append((low, index))
        if passed:
            return min(passed)
        low = at
    return None
