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
How a linkage of one freedom moves under a force: sticking, slipping, and stopped at its ends.

The equation of motion is that of `linkage_ros.dynamics.mechanics`::

    I(q)·q̈ + ½·I'(q)·q̇² + V'(q) + C(q)·q̇ + (F(q) + B)·sign(q̇) = τ

with a brake B beside the friction F of the joints. Within a step the sign is that of the rate
at its start: what is integrated is smooth. Where the rate then changes its sign, the instant is
found at which it is zero: the mechanism stands there, until |τ − V'| exceeds F + B, or goes on
the other way at once. For one freedom this is Coulomb's law itself, with no rate below which the
friction would be rounded off. Where there is no friction nothing is looked for.

F(q) = Σ T·|ψ'(q)| has a kink where the slip ψ' of a joint turns, as in the pin of a rocker at
either end of its swing. A step across it is of order 2, whatever the method. So within a step the
signs of the slips too are those at its start; where one has turned at its end, the instant is
found and the step is cut there. Both pieces are smooth, and the order is that of the method
(`test/dynamics/test_kinks.py`). Where no joint has Coulomb friction nothing is looked for.

A stop is hard: the instant is found at which it is met, the rate becomes −e·q̇, and the rest of
the step goes on from there. A mechanism that is pushed against a stop rests at it.

Equations of motion with dry friction are treated so as differential inclusions: D. E. Stewart,
Rigid-Body Dynamics with Friction and Impact, SIAM Review 42, 2000.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from math import copysign, inf
from typing import NamedTuple, TypeVar

from linkage_ros.dynamics.integrators.method import Step
from linkage_ros.dynamics.mechanics import Terms

# When something happens within a step: the instant at which a margin is used up.

_NARROWINGS = 80
NARROW = 1e-14
"""How exactly an instant is found, as a share of the step."""

State = TypeVar('State')


def last_before(
    reach: Callable[[float], State | None],
    margin: Callable[[State], float],
    start: State,
    end: float,
    beyond: State,
) -> tuple[float, State, bool]:
    """
    Return the instant at which the margin is 0, the last state before it, and whether it is that.

    Where there is no state it is not known what happens; then the instant is the end of what there
    is. By the Illinois form of regula falsi (M. Dowell, P. Jarratt, A modified regula falsi method
    for computing the root of an equation, BIT 11, 1971), and by halving where it has no two
    values: where the margin is 0 at the start too, or there is no state at the end.

    Parameters
    ----------
    reach
        The state after some seconds; None where there is none.
    margin
        Of a state, 0 or more before the instant.
    start
        The state at 0.
    end
        A time beyond the instant, in [s].
    beyond
        The state then, its margin below 0.

    """
    before, last, after, known = 0.0, start, end, True
    low, high = margin(start), margin(beyond)
    stays, narrow = 0, NARROW * end
    for _ in range(_NARROWINGS):
        if after - before <= narrow:
            break
        at = 0.5 * (before + after)
        if low > 0.0 and known:
            guess = before + (after - before) * low / (low - high)
            # Not nearer to an end than matters: so the last looks close in from both sides.
            at = min(max(guess, before + 0.5 * narrow), after - 0.5 * narrow)
        found = reach(at)
        if found is None:
            after, known = at, False
            continue
        now = margin(found)
        if now < 0.0:
            low *= 0.5 if stays > 0 else 1.0
            after, high, known, stays = at, now, True, 1
        else:
            high *= 0.5 if stays < 0 else 1.0
            before, last, low, stays = at, found, now, -1
            if now == 0.0:
                return at, found, True
    return after, last, known


LARGEST = 1e10
"""
Values and rates beyond this are no motion, in [rad], [m] or either a second.

As doubles, angles are 2e-6 rad apart there.
"""

_LEAST = 1e-100
"""Less inertia than this is none, in [kg·m²] or [kg]: accelerations are not beyond a double."""

_PIECES = 20
"""
Into how many pieces a step may fall, at stops, where it sticks, and where it is too long.

Then it rests: bounces that are so many within one step come to their end.
"""

_KINKS = 20
"""How many times a step is cut where slips turn; what comes then is integrated as it is."""

_SHORTEST = 0.5**30
"""Share of a step, below which a piece of it is none."""


class Motion(NamedTuple):
    """
    A state of one freedom.

    Attributes
    ----------
    value
        Of the input, in [rad] or [m].
    rate
        In [rad/s] or [m/s].
    terms
        The equation of motion at the value.

    """

    value: float
    rate: float
    terms: Terms


class _Event(Enum):
    """What ends a piece of a step."""

    LOW = 'lower stop'
    HIGH = 'upper stop'
    TURN = 'rate zero'
    KINK = 'slip zero'


class OneFreedom:
    """
    A mechanism with one input that a force moves.

    Parameters
    ----------
    terms
        The equation of motion at a value of the input; None where there is none.
    step
        The method of integration.
    stops
        Where it is stopped, in [rad] or [m].
    restitution
        Rate behind an impact by that before, 0 to 1.

    """

    __slots__ = ('_restitution', '_step', '_stops', '_terms')

    def __init__(
        self,
        terms: Callable[[float], Terms | None],
        step: Step,
        stops: tuple[float, float] = (-inf, inf),
        restitution: float = 0.0,
    ) -> None:
        self._terms = terms
        self._step = step
        self._stops = stops
        self._restitution = restitution

    def at(self, value: float, rate: float) -> Motion | None:
        """Return a state; nothing where it cannot move so."""
        low, high = self._stops
        return self._reached(value, rate) if low <= value <= high else None

    def acceleration(self, motion: Motion, force: float, brake: float = 0.0) -> float:
        """Return q̈, in [rad/s²] or [m/s²]; the parameters are those of `advance`."""
        sense = self._sense(motion, force, brake)
        return _acceleration(motion.terms, motion.rate, force, sense * brake, sense)

    def advance(self, motion: Motion, seconds: float, force: float, brake: float = 0.0) -> Motion:
        """
        Carry a state on by one step.

        A step that cannot be done in one, since it leads to where there is no motion, is halved
        until it can; where nothing of it can be done, or it falls into too many pieces, the
        mechanism is held as by a stop. So the work is bounded, whatever the force.

        Parameters
        ----------
        motion
            The state.
        seconds
            Length of the step, in [s].
        force
            τ on the input, in [N·m] or [N].
        brake
            B, what a brake on the input holds, in [N·m] or [N].

        """
        left = seconds
        pieces = kinks = 0
        while pieces < _PIECES:
            sense = self._sense(motion, force, brake)
            if sense == 0.0:
                return motion
            sticks = motion.terms.coulomb + brake > 0.0
            slips = motion.terms.slips if kinks < _KINKS else ()
            reach = self._reach(motion, force, sense * brake, sense, slips)
            length = left
            reached = reach(length)
            while reached is None:
                length *= 0.5
                if length < seconds * _SHORTEST:
                    return self._bounced(motion)
                reached = reach(length)
            event = None
            # At the last state before one thing another may have happened already.
            while (found := self._event(reached, sense, sticks, slips)) is not None:
                margin = self._margin(found, sense, slips)
                length, last, known = last_before(reach, margin, motion, length, reached)
                reached, event = last, found if known else None
            motion = reached
            if event is _Event.KINK:
                kinks += 1
            else:
                pieces += 1
            if event is _Event.TURN:
                motion = _at_rest(motion)
            elif event in (_Event.LOW, _Event.HIGH):
                motion = self._stopped(motion, event)
            left -= length
            if left <= seconds * NARROW:
                return motion
        return _at_rest(motion)

    def _sense(self, motion: Motion, force: float, brake: float) -> float:
        """Return which way it moves, 1 or -1, or 0 where it stays."""
        value, rate, terms = motion
        if rate:
            return copysign(1.0, rate)
        push = force - terms.potential_slope
        low, high = self._stops
        held = abs(push) <= terms.coulomb + brake
        if held or (value >= high and push > 0.0) or (value <= low and push < 0.0):
            return 0.0
        return copysign(1.0, push)

    def _reach(
        self,
        motion: Motion,
        force: float,
        braking: float,
        sense: float,
        slips: tuple[float, ...],
    ) -> Callable[[float], Motion | None]:
        """Return what gives the state after some seconds of one step."""
        value, rate, here = motion
        terms, step, reached = self._terms, self._step, self._reached
        start = _acceleration(here, rate, force, braking, sense)

        def field(q: float, w: float) -> float | None:
            if not (-LARGEST <= q <= LARGEST and -LARGEST <= w <= LARGEST):
                return None
            found = terms(q)
            if found is None or found.inertia < _LEAST:
                return None
            return _acceleration(
                found, w, force, braking, sense, _turned(found, slips) if slips else 0.0
            )

        def reach(seconds: float) -> Motion | None:
            found = step(field, value, rate, start, seconds)
            return None if found is None else reached(*found)

        return reach

    def _reached(self, value: float, rate: float) -> Motion | None:
        if not (-LARGEST <= value <= LARGEST and -LARGEST <= rate <= LARGEST):
            return None
        terms = self._terms(value)
        if terms is None or terms.inertia < _LEAST:
            return None
        return Motion(value, rate, terms)

    def _event(
        self, motion: Motion, sense: float, sticks: bool, slips: tuple[float, ...]
    ) -> _Event | None:
        """Return what has happened on the way to a state."""
        value, rate, terms = motion
        low, high = self._stops
        if sticks and sense * rate < 0.0:
            return _Event.TURN
        if value > high:
            return _Event.HIGH
        if value < low:
            return _Event.LOW
        return _Event.KINK if slips and _turned(terms, slips) else None

    def _margin(
        self, event: _Event, sense: float, slips: tuple[float, ...]
    ) -> Callable[[Motion], float]:
        """Return what says how far a state is from an event."""
        low, high = self._stops
        if event is _Event.TURN:
            return lambda motion: sense * motion.rate
        if event is _Event.HIGH:
            return lambda motion: high - motion.value
        if event is _Event.LOW:
            return lambda motion: motion.value - low
        return lambda motion: min(
            copysign(1.0, before) * now
            for before, now in zip(slips, motion.terms.slips, strict=True)
            if before
        )

    def _stopped(self, motion: Motion, event: _Event) -> Motion:
        """Return the state behind an impact."""
        low, high = self._stops
        stop, outward = (high, 1.0) if event is _Event.HIGH else (low, -1.0)
        at_stop = self._reached(stop, motion.rate) or motion
        return self._bounced(at_stop) if outward * motion.rate > 0.0 else _at_rest(at_stop)

    def _bounced(self, motion: Motion) -> Motion:
        value, rate, terms = motion
        return Motion(value, 0.0 - self._restitution * rate, terms)


def _at_rest(motion: Motion) -> Motion:
    return Motion(motion.value, 0.0, motion.terms)


def _turned(terms: Terms, before: tuple[float, ...]) -> float:
    """Return the Coulomb friction of the joints whose slip has turned since, in [N·m] or [N]."""
    turned = 0.0
    for slip, earlier in zip(terms.slips, before, strict=True):
        if slip * earlier < 0.0:
            turned += abs(slip)
    return turned


def _acceleration(
    terms: Terms, rate: float, force: float, braking: float, sense: float, turned: float = 0.0
) -> float:
    """
    Return q̈ of the equation of motion, friction and brake against ``sense``; 0 where it is.

    The friction ``turned`` of some joints counts the other way, as it would go on without a kink.
    """
    if sense == 0.0:
        return 0.0
    inertia, half_slope, slope, viscous, coulomb, _ = terms
    resisted = viscous * rate + (coulomb - 2.0 * turned) * sense + braking
    return (force - slope - resisted - half_slope * rate * rate) / inertia
