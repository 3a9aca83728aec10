# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The motion of a linkage of one freedom under a force: sticking, slipping, and stopped at its ends.

The equation of motion (`linkage_ros.dynamics.equation`)::

    I(q)·q̈ + ½·I'(q)·q̇² + V'(q) + C(q)·q̇ + (F(q) + B)·sign(q̇) = τ

with a brake B in addition to the friction F of the joints. Within a step the sign of the rate
at its start is kept, so the integrand is smooth. If the rate changes its sign, the integrator
finds the instant at which it is zero: the mechanism stays there until |τ − V'| exceeds F + B, or
reverses at once. For one freedom this is Coulomb's law itself, without a threshold rate below
which friction is smoothed. Without friction no instant is searched for.

F(q) = Σ T·|ψ'(q)| has a kink where the slip ψ' of a joint reverses, as in the pin of a rocker at
either end of its swing. A step across it is of order 2, whatever the method. So within a step the
signs of the slips at its start are kept, too; if one has changed at the end, the integrator
finds the instant and cuts the step there. Both pieces are smooth, and have the order of the
method (`test/dynamics/test_kinks.py`). Without Coulomb friction no instant is searched for.

A law of an applied force (`linkage_ros.dynamics.laws`) is smooth in segments. Within a step each
law stays in the segment of the step's start; if a segment has been left at the end, the
integrator finds the instant and cuts the step there, too. Without laws no instant is searched for.

Friction by the forces in the joints (`linkage_ros.dynamics.load_dependent_friction`) depends on
q̈, and is found with it. Where the linkage jams, it is held as by a stop. A step across a kink of
this friction is of order 2.

A stop is hard: the integrator finds the instant of the impact, the rate becomes −e·q̇, and the
rest of the step continues from there. A mechanism that is pushed against a stop rests at it.

Such a treatment of dry friction is a differential inclusion: D. E. Stewart, Rigid-Body Dynamics
with Friction and Impact, SIAM Review 42, 2000.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from math import copysign, inf, ulp
from typing import Any, NamedTuple, TYPE_CHECKING, TypeVar

from linkage_ros.dynamics.equation import Terms
from linkage_ros.dynamics.integrators import Step

if TYPE_CHECKING:
    from linkage_ros.dynamics.laws import Law

_NARROWINGS = 80
NARROW = 1e-14
"""Precision of an instant, as a fraction of the step."""

State = TypeVar('State')

LARGEST = 1e10
"""
Values and rates beyond this are not a valid motion, in [rad], [m] or either per second.

As doubles, angles are 2e-6 rad apart there.
"""

_LEAST = 1e-100
"""Smaller inertias count as zero, in [kg·m²] or [kg]: so accelerations cannot overflow."""

PIECES = 20
"""
Most pieces of a step: at stops, where it sticks, and where it is too long.

After these the mechanism rests: with so many bounces in one step it comes to rest anyway.
"""

_KINKS = 20
"""Most cuts of a step at slips and segments; the rest of the step is integrated without cuts."""

BEGINNING = 1e-200
"""A rate that has a direction and no size."""

SHORTEST = 0.5**30
"""Smallest fraction of a step that is integrated."""


def last_before(
    reach: Callable[[float], State | None],
    margin: Callable[[State], float],
    start: State,
    end: float,
    beyond: State,
) -> tuple[float, State, bool]:
    """
    Return the instant at which the margin is 0, the last state before it, and whether it is that.

    If no state exists beyond some instant, that instant is returned, and False. The method is the
    Illinois form of regula falsi (M. Dowell, P. Jarratt, A modified regula falsi method for
    computing the root of an equation, BIT 11, 1971), and bisection if it lacks two values: if the
    margin is 0 at the start too, or there is no state at the end.

    ``reach`` returns the state after some seconds, None if there is none. ``margin`` is 0 or more
    before the instant. ``end`` is a time beyond it, in [s], and ``beyond`` the state then, with a
    margin below 0.
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
            # Keep a distance from both ends, so that the last steps close in from both sides.
            at = min(max(guess, before + 0.5 * narrow), after - 0.5 * narrow)
        state = reach(at)
        if state is None:
            after, known = at, False
            continue
        now = margin(state)
        if now < 0.0:
            low *= 0.5 if stays > 0 else 1.0
            after, high, known, stays = at, now, True, 1
        else:
            high *= 0.5 if stays < 0 else 1.0
            before, last, low, stays = at, state, now, -1
            if now == 0.0:
                return at, state, True
    return after, last, known


def end_of_piece(
    moving: Any,
    piece: Any,
    reach: Callable[[float], State | None],
    begin: State,
    left: float,
    shortest: float,
) -> tuple[float, State, Any] | None:
    """
    Return the length of the next piece of a step, its end, and the event that ends it, if any.

    A piece that leads to where no motion exists is halved until it succeeds; None if it would then
    be shorter than ``shortest``, in [s]. ``moving.find_event`` returns an event that has happened
    before a state, or None, and ``moving.margin_to`` the margin of states to it. For ``reach`` see
    `last_before`.
    """
    length, reached = left, reach(left)
    while reached is None:
        length *= 0.5
        if length < shortest:
            return None
        reached = reach(length)
    event = None
    # At the last state before one event, another event may have happened already.
    while happened := moving.find_event(piece, reached):
        margin = moving.margin_to(piece, happened)
        length, last, known = last_before(reach, margin, begin, length, reached)
        reached, event = last, happened if known else None
    return length, reached, event


class Motion(NamedTuple):
    """A state of one freedom."""

    value: float  # Value of the input, in [rad] or [m]
    rate: float  # Its rate, in [rad/s] or [m/s]
    terms: Terms  # The equation of motion at the value
    ahead: float = 0.0  # The time since the start of the step in which it was found, in [s]


class _Event(Enum):
    """The event that ends a piece of a step."""

    LOW = 'lower stop'
    HIGH = 'upper stop'
    TURN = 'rate zero'
    KINK = 'slip zero'
    SEGMENT = 'segment left'


_Piece = tuple[float, float, bool, tuple[float, ...], tuple[int, ...]]
"""
What stays the same within a piece of a step.

The time at its start, in [s], the direction of motion, whether it may come to rest, and the slips
of the joints and the segments of the laws at its start; these are empty without cuts.
"""


@dataclass(frozen=True, slots=True)
class SingleDofMechanism:
    """A mechanism with one input that is moved by a force."""

    # The equation of motion at a value of the input; None if there is none.
    terms: Callable[[float], Terms | None]
    step: Step  # The method of integration
    stops: tuple[float, float] = (-inf, inf)  # Lower and upper stop, in [rad] or [m]
    restitution: float = 0.0  # Ratio of the rates after and before an impact, 0 to 1
    laws: tuple[Law, ...] = ()  # The laws of the applied forces, as in ``Terms.laws``
    # What friction by the forces in the joints resists at a value, rate and time, with the q̈
    # without it and by how much a unit of it lowers q̈; None where it jams. None without any.
    friction_effort: Callable[[float, float, float, float, float], float | None] | None = None

    def driven_by(
        self, change: Callable[[SingleDofMechanism], SingleDofMechanism]
    ) -> SingleDofMechanism:
        """Return it with a change of what its motor moves: all of it."""
        return change(self)

    def state_at(self, value: float, rate: float) -> Motion | None:
        """Return a state, or None if it cannot exist."""
        low, high = self.stops
        return self._reach_value(value, rate) if low <= value <= high else None

    def acceleration(
        self, motion: Motion, force: float, brake: float = 0.0, time: float = 0.0
    ) -> float:
        """Return q̈, in [rad/s²] or [m/s²]; the parameters are as in `advance`."""
        if self.laws:
            force += self._applied_force(motion.terms, motion.rate, time)
        sense = self._motion_direction(motion, force, brake, time)
        if self.laws and not motion.rate:
            force += self._applied_force(motion.terms, sense * BEGINNING, time)
            force -= self._applied_force(motion.terms, 0.0, time)
        value, rate, terms, _ = motion
        free = _solve_acceleration(terms, rate, force, sense * brake, sense)
        return self._rub_by_forces(free, terms, value, rate, sense, time) or 0.0

    def advance(
        self,
        motion: Motion,
        seconds: float,
        force: float,
        brake: float = 0.0,
        time: float = 0.0,
    ) -> Motion:
        """
        Advance a state by one step.

        A step that leads to where no motion exists is halved until it succeeds. If no part of it
        succeeds, or it falls into too many pieces, the mechanism is held as by a stop. So the work
        is bounded, whatever the force.

        ``seconds`` is the length of the step, ``force`` is τ on the input and ``brake`` is B, the
        holding force of a brake on it, both in [N·m] or [N]. ``time`` is the time of the state
        since the first tick, in [s].
        """
        left = seconds
        pieces = kinks = 0
        now, push, laws = time, force, self.laws
        while pieces < PIECES:
            if laws:
                now = time + (seconds - left)
                push = force + self._applied_force(motion.terms, motion.rate, now)
            sense = (
                copysign(1.0, motion.rate)
                if motion.rate
                else self._motion_direction(motion, push, brake, now)
            )
            if sense == 0.0:
                held = self._resting_time(motion, left, force, brake, now) if laws else left
                left -= held
                if left <= seconds * NARROW:
                    return motion
                pieces += 1
                continue
            terms = motion.terms
            sticks = (
                self.friction_effort is not None or terms.coulomb + terms.breakaway + brake > 0.0
            )
            cuts = kinks < _KINKS
            slips = terms.slips if cuts else ()
            segments = self._law_segments(motion, now, sense) if laws and cuts else ()
            reach = self._step_function(motion, now, force, sense * brake, sense, slips, segments)
            piece = now, sense, sticks, slips, segments
            end = end_of_piece(self, piece, reach, motion, left, seconds * SHORTEST)
            if end is None:
                return self._bounce(motion)
            length, reached, event = end
            if event is _Event.SEGMENT:
                # The next segment begins just beyond, at a time that differs when it is rounded.
                length = min(length + 2.0 * ulp(time + seconds), left)
                beyond = reach(length)
                if beyond and not self.find_event((*piece[:4], ()), beyond):
                    reached = beyond
            motion = reached
            if event in (_Event.KINK, _Event.SEGMENT):
                kinks += 1
            else:
                pieces += 1
            if event is _Event.TURN:
                motion = _at_rest(motion)
            elif event in (_Event.LOW, _Event.HIGH):
                motion = self._stop_at(motion, event)
            left -= length
            if left <= seconds * NARROW:
                return motion
        return _at_rest(motion)

    def _motion_direction(self, motion: Motion, force: float, brake: float, time: float) -> float:
        """Return the direction of motion, 1 or -1, or 0 if it stays at rest."""
        value, rate, terms, _ = motion
        if rate:
            return copysign(1.0, rate)
        push = force - terms.potential_slope
        low, high = self.stops
        held = abs(push) <= self._holding_effort(motion, push, brake, time)
        if held or (value >= high and push > 0.0) or (value <= low and push < 0.0):
            return 0.0
        return copysign(1.0, push)

    def _step_function(
        self,
        motion: Motion,
        now: float,
        force: float,
        braking: float,
        sense: float,
        slips: tuple[float, ...],
        segments: tuple[int, ...],
    ) -> Callable[[float], Motion | None]:
        """Return a function that gives the state after some seconds of one step."""
        value, rate, here, _ = motion
        terms, step, reached, laws = self.terms, self.step, self._reach_value, self.laws
        push = force + self._applied_force(here, rate, now, segments) if laws else force
        free = _solve_acceleration(here, rate, push, braking, sense)
        start = self._rub_by_forces(free, here, value, rate, sense, now)

        def acceleration_at(q: float, w: float, ahead: float) -> float | None:
            if not (-LARGEST <= q <= LARGEST and -LARGEST <= w <= LARGEST):
                return None
            there = terms(q)
            if there is None or there.inertia < _LEAST:
                return None
            push = force + self._applied_force(there, w, now + ahead, segments) if laws else force
            turned = _reversed_friction(there, slips) if slips else 0.0
            free = _solve_acceleration(there, w, push, braking, sense, turned)
            return self._rub_by_forces(free, there, q, w, sense, now + ahead)

        def state_after(seconds: float) -> Motion | None:
            if start is None:
                return None
            end = step(acceleration_at, value, rate, start, seconds)
            return None if end is None else reached(*end, seconds)

        return state_after

    def _rub_by_forces(
        self, free: float, terms: Terms, value: float, rate: float, sense: float, time: float
    ) -> float | None:
        """Return q̈ with the friction by forces, from that without it; None if it jams."""
        if self.friction_effort is None or sense == 0.0:
            return free
        # A rate that falls through zero within a step has the direction of the step.
        moving = rate if rate * sense > 0.0 else sense * BEGINNING
        mobility = sense / terms.inertia
        resisted = self.friction_effort(value, moving, time, free, mobility)
        return None if resisted is None else free - mobility * resisted

    def _holding_effort(self, motion: Motion, push: float, brake: float, time: float) -> float:
        """Return what friction and brake hold at rest against a push."""
        value, _, terms, _ = motion
        most = terms.coulomb + terms.breakaway + brake
        if self.friction_effort is None or not push:
            return most
        resisted = self.friction_effort(value, copysign(BEGINNING, push), time, 0.0, 0.0)
        return inf if resisted is None else most + resisted

    def _reach_value(self, value: float, rate: float, ahead: float = 0.0) -> Motion | None:
        if not (-LARGEST <= value <= LARGEST and -LARGEST <= rate <= LARGEST):
            return None
        terms = self.terms(value)
        if terms is None or terms.inertia < _LEAST:
            return None
        return Motion(value, rate, terms, ahead)

    def find_event(self, piece: _Piece, motion: Motion) -> _Event | None:
        """Return the event that has happened before a state, or None."""
        now, sense, sticks, slips, segments = piece
        value, rate, terms, _ = motion
        low, high = self.stops
        if sticks and sense * rate < 0.0:
            return _Event.TURN
        if value > high:
            return _Event.HIGH
        if value < low:
            return _Event.LOW
        if slips and _reversed_friction(terms, slips):
            return _Event.KINK
        return (
            _Event.SEGMENT
            if segments and self._segment_margin(motion, now, segments) < 0.0
            else None
        )

    def margin_to(self, piece: _Piece, event: _Event) -> Callable[[Motion], float]:
        """Return a function that gives the margin of a state to an event."""
        now, sense, _, slips, segments = piece
        low, high = self.stops
        if event is _Event.TURN:
            return lambda motion: sense * motion.rate
        if event is _Event.HIGH:
            return lambda motion: high - motion.value
        if event is _Event.LOW:
            return lambda motion: motion.value - low
        if event is _Event.SEGMENT:
            return lambda motion: self._segment_margin(motion, now, segments)
        return lambda motion: min(
            copysign(1.0, before) * now
            for before, now in zip(slips, motion.terms.slips, strict=True)
            if before
        )

    def _stop_at(self, motion: Motion, event: _Event) -> Motion:
        """Return the state after an impact."""
        low, high = self.stops
        stop, outward = (high, 1.0) if event is _Event.HIGH else (low, -1.0)
        at_stop = self._reach_value(stop, motion.rate) or motion
        return self._bounce(at_stop) if outward * motion.rate > 0.0 else _at_rest(at_stop)

    def _bounce(self, motion: Motion) -> Motion:
        return motion._replace(rate=0.0 - self.restitution * motion.rate)

    def _resting_time(
        self, motion: Motion, seconds: float, force: float, brake: float, now: float
    ) -> float:
        """Return how long a state stays at rest, while the applied forces change with the time."""
        low, high = self.stops
        motion = motion._replace(ahead=0.0)
        value, _, terms, _ = motion

        def holding_margin(ahead: float) -> float:
            push = force - terms.potential_slope + self._applied_force(terms, 0.0, now + ahead)
            held = self._holding_effort(motion, push, brake, now + ahead) - abs(push)
            if value >= high:
                return max(held, push)
            return max(held, -push) if value <= low else held

        # In a segment the push is linear in time: what rests at both ends of it rests in between.
        begin, beyond = 0.0, 2.0 * ulp(now + seconds)
        for cut in range(_KINKS + 1):
            end, segments = seconds, self._law_segments(motion, now + begin, 0.0)

            def segment_margin(ahead: float, segments: tuple[int, ...] = segments) -> float:
                return self._segment_margin(motion, now + ahead, segments)

            if cut < _KINKS and segment_margin(seconds) < 0.0:
                length = seconds - begin
                end = begin + last_before(begin.__add__, segment_margin, begin, length, seconds)[0]
                end = min(end + beyond, seconds)
            if holding_margin(end) < 0.0:
                # By halves, since a push of exactly 0 has a margin of 0 as long as it lasts.
                while end - begin > NARROW * seconds:
                    middle = 0.5 * (begin + end)
                    begin, end = (
                        (middle, end) if holding_margin(middle) >= 0.0 else (begin, middle)
                    )
                return min(end + beyond, seconds)
            if end == seconds:
                break
            begin = end
        return seconds

    def _law_segments(self, motion: Motion, now: float, sense: float) -> tuple[int, ...]:
        """Return the segment of each law for a motion, or for the direction in which it begins."""
        rate = motion.rate or sense * BEGINNING
        return tuple(
            law.segment(at.value, at.factor * rate, now)
            for law, at in zip(self.laws, motion.terms.laws, strict=True)
        )

    def _segment_margin(self, motion: Motion, now: float, segments: tuple[int, ...]) -> float:
        """Return the least margin of the laws to the ends of their segments."""
        rate, time = motion.rate, now + motion.ahead
        return min(
            law.margin(segment, at.value, at.factor * rate, time)
            for law, segment, at in zip(self.laws, segments, motion.terms.laws, strict=True)
        )

    def _applied_force(
        self, terms: Terms, rate: float, time: float, segments: tuple[int, ...] = ()
    ) -> float:
        """Return the force of the laws on the input, in given segments or in the present ones."""
        force = 0.0
        for index, (law, at) in enumerate(zip(self.laws, terms.laws, strict=True)):
            moving = at.factor * rate
            segment = segments[index] if segments else law.segment(at.value, moving, time)
            force += at.lever * law.force(segment, at.value, moving, time)
        return force


def _at_rest(motion: Motion) -> Motion:
    return motion._replace(rate=0.0)


def _reversed_friction(terms: Terms, before: tuple[float, ...]) -> float:
    """Return the Coulomb friction of the joints whose slip has reversed, in [N·m] or [N]."""
    turned = 0.0
    for slip, earlier in zip(terms.slips, before, strict=True):
        if slip * earlier < 0.0:
            turned += abs(slip)
    return turned


def _solve_acceleration(
    terms: Terms, rate: float, force: float, braking: float, sense: float, turned: float = 0.0
) -> float:
    """
    Return q̈ of the equation of motion, friction and brake against ``sense``; 0 if that is 0.

    The friction ``turned`` of some joints has the opposite sign: its form without a kink.
    """
    if sense == 0.0:
        return 0.0
    inertia, half_slope, slope, viscous, coulomb, _, _, _ = terms
    resisted = viscous * rate + (coulomb - 2.0 * turned) * sense + braking
    return (force - slope - resisted - half_slope * rate * rate) / inertia
