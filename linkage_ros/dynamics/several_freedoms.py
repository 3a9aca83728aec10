# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The motion of a linkage of several freedoms under a force on each of its inputs.

The equation of motion (`linkage_ros.dynamics.equation`)::

    M(q)·q̈ + h(q, q̇) = τ + Σ λ·f(x, ẋ, t)

Each law f of an applied force stays in the segment of a step's start; where one is left, the
integrator finds the instant and cuts the step there, as with one freedom
(`linkage_ros.dynamics.motion`).

A stop of an input is hard: at the instant of the impact the impulse L on this input changes all
rates, by M·Δq̇ = L·e, so that its own rate becomes −ε·q̇. An input that is pushed against its stop
stays there: it leaves the equations, and the force that the stop needs comes from its own. Where
that force would pull, the step is cut and the input is free. Of several inputs at their stops
those stay that are pushed (F. Pfeiffer, C. Glocker, Multibody Dynamics with Unilateral Contacts,
1996, ch. 6, without friction).

At a toggle the inertia M grows without bound. With several inputs toggles are no ends of ranges
but surfaces: the motion is held as by a stop where the sum of the inertias is a given multiple of
that at the start.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import copysign, inf, ulp
from operator import add, mul, sub
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.dynamics.equation import InputTerms, solve_positive
from linkage_ros.dynamics.motion import LARGEST, last_before, NARROW

if TYPE_CHECKING:
    from linkage_ros.dynamics.laws import Law

_PIECES = 20
"""
Most pieces of a step with an impact that bounces, or that are too long.

After these no impact bounces; after twice as many the rest of the step is left out.
"""

_CUTS = 20
"""Most cuts of a step at segments and where a stop lets go; then it is integrated without cuts."""

_SHORTEST = 0.5**30
"""Smallest fraction of a step that is integrated."""

_BEGINNING = 1e-200
"""A rate that has a direction and no size."""

_PROBE = 1e-3
"""Fraction of a step after which a motion that is held at a toggle is seen to leave it."""


class InputVector(tuple[float, ...]):
    """A number for each input, with the arithmetic that the methods of integration use."""

    __slots__ = ()

    def __add__(self, other: Sequence[float]) -> InputVector:  # type: ignore[override]
        return InputVector(map(add, self, other))

    def __sub__(self, other: Sequence[float]) -> InputVector:
        return InputVector(map(sub, self, other))

    def __rmul__(self, factor: float) -> InputVector:  # type: ignore[override]
        return InputVector([factor * a for a in self])

    def __abs__(self) -> float:
        """Return the greatest size of a number."""
        return max(map(abs, self))


class SeveralMotion(NamedTuple):
    """A state of several freedoms."""

    value: InputVector  # Values of the inputs, in [rad] or [m]
    rate: InputVector  # Their rates, in [rad/s] or [m/s]
    terms: InputTerms  # The equation of motion there
    ahead: float = 0.0  # The time since the start of the step in which it was found, in [s]


class _StepEnd(NamedTuple):
    """What ends a piece of a step: ``kind`` is 'stop', 'leave', 'toggle' or 'segment'."""

    kind: str
    number: int = 0  # The input, of a stop that is met or left


class _Piece(NamedTuple):
    """What stays the same within a piece of a step."""

    now: float  # The time at its start, in [s]
    force: InputVector  # On the inputs, without the laws
    held: tuple[int, ...]  # The inputs that rest at their stops
    cuts: bool  # Whether it is cut at segments of laws and where a stop lets go
    segments: tuple[int, ...]  # Of the laws; empty without cuts


@dataclass(frozen=True, slots=True)
class SeveralDofMechanism:
    """A mechanism with several inputs that are moved by forces."""

    # The equation of motion at values and rates of the inputs; None if there is none.
    terms: Callable[[Sequence[float], Sequence[float]], InputTerms | None]
    step: Any  # The method of integration, on an `InputVector`
    stops: tuple[tuple[float, float], ...]  # Lower and upper stop of each input, in [rad] or [m]
    restitution: float = 0.0  # Ratio of the rates after and before an impact, 0 to 1
    laws: tuple[Law, ...] = ()  # The laws of the applied forces, as in ``InputTerms.laws``
    most_inertia: float = inf  # Sum of the inertias at which a toggle holds the motion

    def state_at(self, value: Sequence[float], rate: Sequence[float]) -> SeveralMotion | None:
        """Return a state, or None if it cannot exist."""
        if any(not low <= at <= high for at, (low, high) in zip(value, self.stops, strict=True)):
            return None
        return self._reach(InputVector(value), InputVector(rate))

    def acceleration(
        self, motion: SeveralMotion, force: Sequence[float], _brake: float = 0.0, time: float = 0.0
    ) -> InputVector:
        """Return q̈, in [rad/s²] or [m/s²]; the parameters are as in `advance`."""
        piece = self._begin_piece(motion, InputVector(force), time, cuts=False)
        found = self._accelerate(motion.terms, time, piece)
        return InputVector([0.0] * len(motion.value)) if found is None else found

    def advance(
        self,
        motion: SeveralMotion,
        seconds: float,
        force: Sequence[float],
        _brake: float = 0.0,
        time: float = 0.0,
    ) -> SeveralMotion:
        """
        Advance a state by one step.

        A step that leads to where no motion exists is halved until it succeeds. If no part of it
        succeeds, the mechanism is held as by a stop. So the work is bounded, whatever the force.

        ``seconds`` is the length of the step, ``force`` has τ on each input, in [N·m] or [N], and
        ``time`` is the time of the state since the first tick, in [s].
        """
        left, pieces, cuts = seconds, 0, 0
        while pieces < 2 * _PIECES:
            now = time + (seconds - left)
            piece = self._begin_piece(motion, InputVector(force), now, cuts=cuts < _CUTS)
            reach = self._step_function(motion, piece)
            if self._is_held_at_toggle(motion, reach, left):
                return _at_rest(motion)
            length, reached = left, reach(left)
            while reached is None:
                length *= 0.5
                if length < seconds * _SHORTEST:
                    return self._bounce(motion)
                reached = reach(length)
            event = None
            # At the last state before one event, another event may have happened already.
            while happened := self._find_event(motion, reached, piece):
                margin = self._event_margin(happened, piece)
                length, last, known = last_before(reach, margin, motion, length, reached)
                reached, event = last, happened if known else None
            if event and event.kind in ('leave', 'segment'):
                cuts += 1
                # The next piece begins just beyond, at a time that differs when it is rounded.
                length = min(length + 2.0 * ulp(time + seconds), left)
                reached = reach(length) or reached
            else:
                pieces += 1
            motion = reached
            if event and event.kind == 'toggle':
                motion = self._bounce(motion)
            elif event and event.kind == 'stop':
                back = self.restitution if pieces < _PIECES else 0.0
                motion = self._meet_stop(motion, event.number, back)
            left -= length
            if left <= seconds * NARROW:
                return motion
        return _at_rest(motion)

    def _begin_piece(
        self, motion: SeveralMotion, force: InputVector, now: float, *, cuts: bool
    ) -> _Piece:
        """Return what stays the same from a state on."""
        begin = motion._replace(ahead=0.0)
        segments = self._law_segments(motion, force, now) if cuts else ()
        held = [n for n in self._inputs_at_stops(motion) if motion.rate[n] == 0.0]
        # Those that would be pulled are free; the worst of them first.
        while held:
            piece = _Piece(now, force, tuple(held), cuts, segments)
            pulls = {n: self._stop_pull(begin, n, piece) for n in held}
            worst = max(held, key=pulls.__getitem__)
            if pulls[worst] <= 0.0:
                return piece
            held.remove(worst)
        return _Piece(now, force, (), cuts, segments)

    def _law_segments(
        self, motion: SeveralMotion, force: InputVector, now: float
    ) -> tuple[int, ...]:
        """Return the segment of each law for a motion, or for the direction in which it begins."""
        laws = motion.terms.laws
        change: InputVector | None = None
        if any(at.rate == 0.0 for at in laws):
            change = self._accelerate(motion.terms, now, _Piece(now, force, (), False, ()))
        segments: tuple[int, ...] = ()
        for law, at in zip(self.laws, laws, strict=True):
            rate = at.rate
            if rate == 0.0 and change is not None:
                began = sum(map(mul, at.levers, change))
                rate = copysign(_BEGINNING, began) if began else 0.0
            segments += (law.segment(at.value, rate, now),)
        return segments

    def _inputs_at_stops(self, motion: SeveralMotion) -> list[int]:
        places = zip(motion.value, self.stops, strict=True)
        return [n for n, (at, (low, high)) in enumerate(places) if at <= low or at >= high]

    def _stop_pull(self, motion: SeveralMotion, number: int, piece: _Piece) -> float:
        """Return the force with which a stop would have to pull an input to hold it."""
        terms = motion.terms
        change = self._accelerate(terms, piece.now + motion.ahead, piece)
        if change is None:
            return 0.0
        needed = sum(terms.inertia(number, j) * change[j] for j in range(len(change)))
        needed -= self._force(terms, piece.now + motion.ahead, piece)[number]
        return needed if motion.value[number] >= self.stops[number][1] else -needed

    def _force(self, terms: InputTerms, time: float, piece: _Piece) -> InputVector:
        """Return the force on each input, without what inertia and stops need."""
        total = piece.force - terms.bias
        for index, (law, at) in enumerate(zip(self.laws, terms.laws, strict=True)):
            segments = piece.segments
            segment = segments[index] if segments else law.segment(at.value, at.rate, time)
            total += law.force(segment, at.value, at.rate, time) * InputVector(at.levers)
        return total

    def _accelerate(self, terms: InputTerms, time: float, piece: _Piece) -> InputVector | None:
        """Return q̈ of the equation of motion; 0 of inputs that are held at their stops."""
        force = self._force(terms, time, piece)
        if not piece.held:
            return InputVector([sum(map(mul, row, force)) for row in terms.mobility])
        free = [n for n in range(len(force)) if n not in piece.held]
        rows = [[terms.inertia(i, j) for j in free[: k + 1]] for k, i in enumerate(free)]
        solved = solve_positive(rows, [force[n] for n in free])
        if solved is None:
            return None
        change = [0.0] * len(force)
        for n, found in zip(free, solved, strict=True):
            change[n] = found
        return InputVector(change)

    def _step_function(
        self, motion: SeveralMotion, piece: _Piece
    ) -> Callable[[float], SeveralMotion | None]:
        """Return a function that gives the state after some seconds of one step."""
        value, rate = motion.value, motion.rate
        start = self._accelerate(motion.terms, piece.now, piece)

        def acceleration_at(q: InputVector, w: InputVector, ahead: float) -> InputVector | None:
            there = self._terms_at(q, w)
            return None if there is None else self._accelerate(there, piece.now + ahead, piece)

        def state_after(seconds: float) -> SeveralMotion | None:
            if start is None:
                return None
            end = self.step(acceleration_at, value, rate, start, seconds)
            if end is None:
                return None
            reached, at_rate = end
            return self._reach(reached, at_rate, seconds)

        return state_after

    def _terms_at(self, value: InputVector, rate: InputVector) -> InputTerms | None:
        if not (abs(value) <= LARGEST and abs(rate) <= LARGEST):
            return None
        return self.terms(value, rate)

    def _reach(
        self, value: InputVector, rate: InputVector, ahead: float = 0.0
    ) -> SeveralMotion | None:
        terms = self._terms_at(value, rate)
        return None if terms is None else SeveralMotion(value, rate, terms, ahead)

    def _is_held_at_toggle(
        self, motion: SeveralMotion, reach: Callable[[float], SeveralMotion | None], seconds: float
    ) -> bool:
        """Return whether a motion at rest, next to a toggle, is pushed further towards it."""
        if any(motion.rate) or motion.terms.total_inertia < self.most_inertia * (1.0 - 1e-6):
            return False
        probe = reach(_PROBE * seconds)
        return probe is None or probe.terms.total_inertia >= motion.terms.total_inertia

    def _find_event(
        self, begin: SeveralMotion, motion: SeveralMotion, piece: _Piece
    ) -> _StepEnd | None:
        """Return an event that has happened before a state, or None."""
        for n, (at, (low, high)) in enumerate(zip(motion.value, self.stops, strict=True)):
            if not low <= at <= high and n not in piece.held:
                return _StepEnd('stop', n)
        inertia = motion.terms.total_inertia
        if inertia > self.most_inertia and inertia > begin.terms.total_inertia:
            return _StepEnd('toggle')
        if piece.cuts:
            if self._segment_margin(motion, piece) < 0.0:
                return _StepEnd('segment')
            for n in piece.held:
                if self._stop_pull(motion, n, piece) > 0.0:
                    return _StepEnd('leave', n)
        return None

    def _event_margin(self, event: _StepEnd, piece: _Piece) -> Callable[[SeveralMotion], float]:
        """Return a function that gives the margin of a state to an event."""
        kind, n = event
        if kind == 'stop':
            low, high = self.stops[n]
            return lambda motion: min(motion.value[n] - low, high - motion.value[n])
        if kind == 'toggle':
            return lambda motion: self.most_inertia - motion.terms.total_inertia
        if kind == 'segment':
            return lambda motion: self._segment_margin(motion, piece)
        return lambda motion: -self._stop_pull(motion, n, piece)

    def _segment_margin(self, motion: SeveralMotion, piece: _Piece) -> float:
        """Return the least margin of the laws to the ends of their segments."""
        time = piece.now + motion.ahead
        return min(
            (
                law.margin(segment, at.value, at.rate, time)
                for law, segment, at in zip(
                    self.laws, piece.segments, motion.terms.laws, strict=True
                )
            ),
            default=inf,
        )

    def _meet_stop(self, motion: SeveralMotion, number: int, restitution: float) -> SeveralMotion:
        """Return the state after an input's impact on the nearer stop."""
        low, high = self.stops[number]
        at, rate = motion.value[number], motion.rate[number]
        upper = abs(at - high) <= abs(at - low)
        value = list(motion.value)
        value[number] = high if upper else low
        met = self._reach(InputVector(value), motion.rate) or motion
        if (rate > 0.0) is not upper or not rate:
            return met
        way = met.terms.mobility[number]
        impulse = (1.0 + restitution) * rate / way[number]
        rates = [w - impulse * by for w, by in zip(motion.rate, way, strict=True)]
        rates[number] = 0.0 - restitution * rate
        return self._reach(met.value, InputVector(rates)) or _at_rest(met)

    def _bounce(self, motion: SeveralMotion) -> SeveralMotion:
        """Return a state whose rates are reversed, as far as an impact returns them."""
        back = InputVector([0.0 - self.restitution * rate for rate in motion.rate])
        return self._reach(motion.value, back) or _at_rest(motion)


def _at_rest(motion: SeveralMotion) -> SeveralMotion:
    return motion._replace(rate=InputVector([0.0] * len(motion.rate)))
