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
rates, by M·Δq̇ = L·e, so that its own rate becomes −ε·q̇. What touches its stop already bears a
part of the blow, by impulses that only push. An input that is pushed against its stop stays
there: it leaves the equations, and the force that the stop needs comes from its own. Where that
force would pull, the step is cut and the input is free. Of several inputs at their stops
those stay that are pushed (F. Pfeiffer, C. Glocker, Multibody Dynamics with Unilateral Contacts,
1996, ch. 6, without friction).

Dry friction, in joints and of the brakes of inputs, is the complementarity of
`linkage_ros.dynamics.dry_friction`: at the start of a piece of a step it says which joints stick
and which slide, and whereto. Within the piece those that slide keep their direction, and those
that stick add equations, w·q̈ + ẇ·q̇ = 0 each, whose multipliers are their friction. Where a slip
comes to 0, or a joint that sticks needs more than it holds, the step is cut. Rates are projected
so that slips at rest stay 0.

The hard stop of another joint is met by an impulse on this joint, w: M·Δq̇ = L·w. While it is
pushed against its stop it is a joint at rest whose friction only pushes, one of that
complementarity.

Friction by the forces in the joints (`linkage_ros.dynamics.load_dependent_friction`) bounds what
holds and is what resists: that of joints that slide is found with the accelerations; where joints
are at rest, forces and complementarity follow each other to a fixed point.

At a toggle the inertia M grows without bound. With several inputs toggles are no ends of ranges
but surfaces: the motion is held as by a stop where the sum of the inertias is a given multiple of
that at the start.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from math import copysign, hypot, inf, ulp
from operator import add, mul, sub
from types import MappingProxyType
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.dynamics.dry_friction import (
    DryFriction,
    independent_slips,
    JointStop,
    settle_forces,
    Slip,
)
from linkage_ros.dynamics.equation import InputTerms, solve_positive
from linkage_ros.dynamics.laws import nearest_turn
from linkage_ros.dynamics.motion import (
    BEGINNING,
    end_of_piece,
    LARGEST,
    NARROW,
    PIECES,
    SHORTEST,
)

if TYPE_CHECKING:
    from linkage_ros.dynamics.laws import Law
    from linkage_ros.dynamics.load_dependent_friction import Pressing

_CUTS = 20
"""Most cuts of a step at segments and where a stop lets go; then it is integrated without cuts."""

_PROBE = 1e-3
"""Fraction of a step after which a motion that is held at a toggle is seen to leave it."""


_SPARE, _EACH = 5 * PIECES, 3
"""Most pieces that are saved for a step, enough for runs of bounces, and how many each brings."""

_FIXED = 1e-13
"""Change of a friction by forces at which it stays, as a fraction of it."""

_FIXED_ROUNDS = 200
"""Most rounds in which frictions at rest and the forces in joints follow each other."""


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
    resting: frozenset[int] = frozenset()  # Joints and brakes that do not slip, by number
    coarse: int = 0  # Steps so far with too many impacts, of which the last ones did not bounce
    spare: int = _SPARE  # Pieces that earlier steps have left over


class _StepEnd(NamedTuple):
    """
    What ends a piece of a step.

    ``kind`` is 'stop', 'leave', 'toggle', 'segment', 'break' where a joint that sticks breaks
    away, or 'halt' where one that slides comes to rest.
    """

    kind: str
    number: int = 0  # The input, of a stop that is met or left; the joint that comes to rest


class _Piece(NamedTuple):
    """What stays the same within a piece of a step."""

    begin: SeveralMotion  # The state at its start
    now: float  # The time at its start, in [s]
    force: InputVector  # On the inputs, without the laws
    held: tuple[int, ...]  # The inputs that rest at their stops
    cuts: bool  # Whether it is cut at segments of laws and where a stop lets go
    segments: tuple[int, ...]  # Of the laws; empty without cuts
    brakes: tuple[float, ...] = ()  # What the brake of each input holds; empty without brakes
    # Of joints with dry friction and of brakes, by number, the direction in which they slide or 0.
    senses: Mapping[int, float] = MappingProxyType({})
    sticking: tuple[int, ...] = ()  # Of those that stick as many as say that all do
    # Joints that lean on their stops, by number among these: 1 on the upper one, −1 on the lower.
    leaning: Mapping[int, int] = MappingProxyType({})


class _Resolved(NamedTuple):
    """The forces at one state."""

    force: InputVector  # On each input, with that of joints that stick and slide
    parts: Mapping[int, float] = MappingProxyType({})  # Of each joint that sticks
    pressed: Mapping[int, float] = MappingProxyType({})  # What friction by forces resists or holds


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
    frictions: tuple[DryFriction, ...] = ()  # As in ``InputTerms.slips``
    joint_stops: tuple[JointStop, ...] = ()  # As in ``InputTerms.limited``
    pressing: Pressing | None = None  # What makes friction grow with forces, as in its terms

    def state_at(self, value: Sequence[float], rate: Sequence[float]) -> SeveralMotion | None:
        """Return a state, or None if it cannot exist."""
        if any(not low <= at <= high for at, (low, high) in zip(value, self.stops, strict=True)):
            return None
        begin = self._reach(InputVector(value), InputVector(rate))
        return None if begin and self._passed_stop(begin.terms) is not None else begin

    def acceleration(
        self,
        motion: SeveralMotion,
        force: Sequence[float],
        brakes: Sequence[float] = (),
        time: float = 0.0,
    ) -> InputVector:
        """Return q̈, in [rad/s²] or [m/s²]; the parameters are as in `advance`."""
        piece = self._begin_piece(motion, InputVector(force), tuple(brakes), time, cuts=False)
        acceleration = self._accelerate(motion.terms, motion.rate, time, piece)
        return InputVector([0.0] * len(motion.value)) if acceleration is None else acceleration

    def advance(
        self,
        motion: SeveralMotion,
        seconds: float,
        force: Sequence[float],
        brakes: Sequence[float] = (),
        time: float = 0.0,
    ) -> SeveralMotion:
        """
        Advance a state by one step.

        A step that leads to where no motion exists is halved until it succeeds. If no part of it
        succeeds, the mechanism is held as by a stop. Impacts are bounded by a count that is saved
        from step to step. So the work is bounded, whatever the force.

        ``seconds`` is the length of the step, ``force`` has τ on each input and ``brakes`` what
        the brake of each holds, in [N·m] or [N]. ``time`` is the time of the state since the first
        tick, in [s].
        """
        # With more than so many pieces no impact bounces; with many more the rest is left out.
        left, pieces, cuts, coarse = seconds, 0, 0, motion.coarse
        saved = motion.spare + _EACH
        most = min(PIECES, saved)
        while pieces < most + PIECES:
            now = time + (seconds - left)
            piece = self._begin_piece(
                motion, InputVector(force), tuple(brakes), now, cuts=cuts < _CUTS
            )
            reach = self._step_function(motion, piece)
            if self._is_held_at_toggle(motion, reach, left):
                return _at_rest(motion)._replace(coarse=coarse, spare=min(saved, _SPARE))
            end = end_of_piece(self, piece, reach, motion, left, seconds * SHORTEST)
            if end is None:
                return self._bounce(motion)._replace(coarse=coarse, spare=min(saved, _SPARE))
            length, reached, event = end
            if event and event.kind in ('leave', 'segment', 'break', 'halt'):
                cuts += 1
                # The next piece begins just beyond, at a time that differs when it is rounded.
                length = min(length + 2.0 * ulp(time + seconds), left)
                reached = reach(length) or reached
            else:
                pieces += 1
            halted = event.number if event and event.kind == 'halt' else None
            motion = self._rest_slips(reached, piece, halted)
            if event and event.kind == 'toggle':
                motion = self._bounce(motion)
            elif event and event.kind == 'stop':
                motion = self._meet_stop(motion, event.number, bounces=pieces < most)
            left -= length
            if left <= seconds * NARROW:
                break
        else:
            motion = _at_rest(motion)
        coarse += pieces >= most
        spare = min(max(0, saved - pieces), _SPARE)
        return motion._replace(coarse=coarse, spare=spare)

    def leaning_sides(self, motion: SeveralMotion) -> dict[int, int]:
        """Return the joints that lean on their stops: 1 on the upper one, −1 on the lower."""
        return {
            k: self._nearer_stop(k, motion.terms)
            for k in range(len(self.joint_stops))
            if self._first_stop + k in motion.resting
        }

    def _begin_piece(
        self,
        motion: SeveralMotion,
        force: InputVector,
        brakes: tuple[float, ...],
        now: float,
        *,
        cuts: bool,
    ) -> _Piece:
        """Return what stays the same from a state on."""
        begin = motion._replace(ahead=0.0)
        segments = self._law_segments(motion, force, now) if cuts else ()
        held = [n for n in self._inputs_at_stops(motion) if motion.rate[n] == 0.0]
        brakes = brakes if any(brakes) else ()
        # Those that would be pulled are free; the worst of them first.
        leaning = self.leaning_sides(motion) if motion.resting else {}
        while True:
            piece = _Piece(begin, now, force, tuple(held), cuts, segments, brakes, leaning=leaning)
            if self.frictions or brakes or leaning:
                piece = self._with_frictions(begin, piece)
            pulls = {n: self._stop_pull(begin, n, piece) for n in held}
            worst = max(held, key=pulls.__getitem__, default=None)
            if worst is None or pulls[worst] <= 0.0:
                return piece
            held.remove(worst)

    def _slips(self, terms: InputTerms, rate: InputVector, piece: _Piece) -> dict[int, Slip]:
        """Return the slips of joints by number, then those of inputs that a brake holds."""
        slips = dict(enumerate(terms.slips))
        for n, brake in enumerate(piece.brakes):
            if brake:
                levers = tuple(float(i == n) for i in range(len(rate)))
                slips[len(self.frictions) + n] = Slip(levers, rate[n], 0.0)
        return slips | {self._first_stop + k: terms.limited[k] for k in piece.leaning}

    @property
    def _first_stop(self) -> int:
        """Return the number of the first joint with a stop, after frictions and brakes."""
        return len(self.frictions) + len(self.stops)

    def _friction_of(self, number: int, piece: _Piece) -> DryFriction:
        joints = len(self.frictions)
        if number < joints:
            return self.frictions[number]
        return DryFriction(piece.brakes[number - joints])

    def _bounds_of(
        self, number: int, piece: _Piece, pressed: Mapping[int, float]
    ) -> tuple[float, float]:
        """Return the least and the greatest force that holds a joint at rest."""
        if number >= self._first_stop:
            return (-inf, 0.0) if piece.leaning[number - self._first_stop] > 0 else (0.0, inf)
        holding = self._friction_of(number, piece).holding + pressed.get(number, 0.0)
        return -holding, holding

    def _joint_value(self, number: int, terms: InputTerms) -> float:
        """Return the value of a joint with a stop."""
        value, middle = terms.limited[number].value, self.joint_stops[number].middle
        return value if middle is None else nearest_turn(value, middle)

    def _nearer_stop(self, number: int, terms: InputTerms) -> int:
        low, high = self.joint_stops[number][:2]
        return 1 if 2.0 * self._joint_value(number, terms) >= low + high else -1

    def _passed_stop(self, terms: InputTerms, leaning: Collection[int] = ()) -> int | None:
        """Return the number of a joint beyond a stop on which it does not lean, or None."""
        for number in range(len(self.joint_stops)):
            if number not in leaning and self._stop_margin(number, terms) < 0.0:
                return number
        return None

    def _stop_margin(self, number: int, terms: InputTerms) -> float:
        (low, high), value = self.joint_stops[number][:2], self._joint_value(number, terms)
        return min(value - low, high - value)

    def _with_frictions(self, motion: SeveralMotion, piece: _Piece) -> _Piece:
        """Return a piece with the joints that slide from a state on, and those that stick."""
        slips = self._slips(motion.terms, motion.rate, piece)
        senses = {
            j: 0.0
            if j in motion.resting or slip.is_still(motion.rate)
            else copysign(1.0, slip.rate)
            for j, slip in slips.items()
        }
        while True:
            piece = piece._replace(senses=senses)
            slipping = self._find_slipping(motion, piece)
            if not slipping:
                break
            # Once they slide they resist less, and others may break away; stops only let go.
            free = {j - self._first_stop for j in slipping}
            leaning = {k: side for k, side in piece.leaning.items() if k not in free}
            piece = piece._replace(leaning=leaning)
            slips = self._slips(motion.terms, motion.rate, piece)
            senses = {j: {**senses, **slipping}[j] for j in slips}
        matrix, resting = self._couple_slips(motion.terms, slips, piece)
        sticking = independent_slips(matrix, range(len(resting)))
        return piece._replace(sticking=tuple([resting[k] for k in sticking]))

    def _couple_slips(
        self, terms: InputTerms, slips: dict[int, Slip], piece: _Piece
    ) -> tuple[list[list[float]], list[int]]:
        """Return how slips at rest accelerate by units of their friction, and their numbers."""
        resting = [j for j, sense in piece.senses.items() if not sense]
        rows = [InputVector(slips[j].levers) for j in resting]
        moved = [self._move(terms, row, piece) for row in rows]
        return [[sum(map(mul, row, way)) for way in moved] for row in rows], resting

    def _find_slipping(self, motion: SeveralMotion, piece: _Piece) -> dict[int, float]:
        """Return which joints at rest break away, and in which direction."""
        terms, slips = motion.terms, self._slips(motion.terms, motion.rate, piece)
        matrix, resting = self._couple_slips(terms, slips, piece)
        if not resting:
            return {}
        now = piece.now + motion.ahead
        force, rows = self._force(terms, motion.rate, now, piece), self._rows(slips)
        bound: dict[int, float] = {}
        for _ in range(_FIXED_ROUNDS):
            pushed = force
            for j, friction in bound.items():
                pushed -= (piece.senses[j] * friction) * rows[j]
            change = self._move(terms, pushed, piece)
            borne, accelerations = settle_forces(
                matrix,
                [sum(map(mul, rows[j], change)) + slips[j].bias for j in resting],
                [self._bounds_of(j, piece, bound) for j in resting],
            )
            if terms.presses is None:
                break
            for j, part in zip(resting, borne, strict=True):
                pushed += part * rows[j]
            resisted = self._sliding_frictions(slips, piece, bound) | dict(
                zip(resting, borne, strict=True)
            )
            change = self._move(terms, pushed, piece)
            before, bound = bound, self._press_frictions(terms.presses(now), change, resisted)
            if all(
                abs(new - before.get(j, 0.0)) <= _FIXED * min(new, LARGEST)
                for j, new in bound.items()
            ):
                break
        accelerated = zip(resting, accelerations, strict=True)
        return {j: copysign(1.0, slipping) for j, slipping in accelerated if slipping}

    @staticmethod
    def _rows(slips: Mapping[int, Slip]) -> dict[int, InputVector]:
        return {j: InputVector(slip.levers) for j, slip in slips.items()}

    def _sliding_frictions(
        self, slips: Mapping[int, Slip], piece: _Piece, pressed: Mapping[int, float]
    ) -> dict[int, float]:
        """Return the friction of joints that slide along their positive slips."""
        return {
            j: -sense * (self._friction_of(j, piece).sliding(slips[j].rate) + pressed.get(j, 0.0))
            for j, sense in piece.senses.items()
            if sense
        }

    def _weights(
        self, weight: float, change: InputVector, resisted: Mapping[int, float]
    ) -> list[float]:
        """Return the weights of `Pressing.forces_by`."""
        assert self.pressing is not None
        stops = [self._first_stop + k for k in range(len(self.joint_stops))]
        numbers = [*range(len(self.frictions)), *stops]
        return [weight, *change[: self.pressing.inputs], *[resisted.get(j, 0.0) for j in numbers]]

    def _press_frictions(
        self, presses: Sequence[float], change: InputVector, resisted: Mapping[int, float]
    ) -> dict[int, float]:
        """Return the friction by the forces in joints, from accelerations and all friction."""
        assert self.pressing
        if not presses:
            return {}
        forces = self.pressing.forces_by(presses, [self._weights(1.0, change, resisted)])
        frictions = zip(self.pressing.solver.factors, forces, strict=True)
        return {
            j: min(factor * hypot(*force), LARGEST)
            for j, (factor, (force,)) in zip(self.pressing.joints, frictions, strict=True)
        }

    def _resolve(
        self, terms: InputTerms, rate: InputVector, time: float, piece: _Piece
    ) -> _Resolved | None:
        """Return the forces with those of joints that stick and slide; None where it jams."""
        if terms.presses and not (piece.sticking or piece.held) and all(piece.senses.values()):
            return self._resolve_sliding(terms, rate, time, piece)
        force = self._force(terms, rate, time, piece)
        if not piece.sticking and self.pressing is None:
            return _Resolved(force)
        slips = self._slips(terms, rate, piece)
        rows = self._rows(slips)
        stuck = [rows[j] for j in piece.sticking]
        moved = [self._move(terms, row, piece) for row in stuck]

        def with_sticking(force: InputVector, biases: Sequence[float]) -> _Resolved:
            change = self._move(terms, force, piece)
            needed = [
                -sum(map(mul, row, change)) - bias for row, bias in zip(stuck, biases, strict=True)
            ]
            parts = _solve_coupled(stuck, moved, needed) if stuck else []
            for row, part in zip(stuck, parts, strict=True):
                force += part * row
            return _Resolved(force, dict(zip(piece.sticking, parts, strict=True)))

        whole = with_sticking(force, [slips[j].bias for j in piece.sticking])
        if self.pressing is None or terms.presses is None:
            return whole
        presses = terms.presses(time)
        if not presses:
            return None
        joints, senses = self.pressing.joints, piece.senses
        units = {
            j: with_sticking(-senses[j] * rows[j], [0.0] * len(stuck))
            for j in joints
            if senses.get(j)
        }
        sliding = self._sliding_frictions(slips, piece, {})
        weights = [
            self._weights(1.0, self._move(terms, whole.force, piece), {**sliding, **whole.parts})
        ]
        for j, unit in units.items():
            change = self._move(terms, unit.force, piece)
            weights.append(self._weights(0.0, change, {j: -senses[j], **unit.parts}))
        numbers: list[float] = []
        forces = self.pressing.forces_by(presses, weights)
        for j, (without, *by_unit) in zip(joints, forces, strict=True):
            # The friction of what sticks is among the forces already.
            of = dict(zip(units, by_unit, strict=True))
            for pair in (without, *(of.get(k, (0.0, 0.0)) for k in joints)):
                numbers += pair if j in units else (0.0, 0.0)
        frictions_found = self.pressing.solver.solve_by_forces(numbers)
        if frictions_found is None:
            return None
        frictions = dict(zip(joints, frictions_found, strict=True))
        force, parts = whole.force, dict(whole.parts)
        for j, unit in units.items():
            force += frictions[j] * unit.force
            parts = {k: part + frictions[j] * unit.parts[k] for k, part in parts.items()}
        if parts.keys().isdisjoint(joints):
            return _Resolved(force, parts)
        resisted = self._sliding_frictions(slips, piece, frictions) | parts
        change = self._move(terms, force, piece)
        return _Resolved(force, parts, self._press_frictions(presses, change, resisted))

    def _resolve_sliding(
        self, terms: InputTerms, rate: InputVector, time: float, piece: _Piece
    ) -> _Resolved | None:
        """Return the forces where every joint slides."""
        assert self.pressing is not None
        assert terms.presses is not None
        presses, slips = terms.presses(time), terms.slips
        if not presses:
            return None
        force = self._force(terms, rate, time, piece._replace(senses={}))
        for n, brake in enumerate(piece.brakes):
            if brake:
                own = [float(n == k) for k in range(len(force))]
                force -= (piece.senses[len(slips) + n] * brake) * InputVector(own)
        senses = [piece.senses[j] for j in range(len(slips))]
        resisted = [
            -sense * friction.sliding(slip.rate)
            for sense, friction, slip in zip(senses, self.frictions, slips, strict=True)
        ]
        rows = [slip.levers for slip in slips]
        frictions_found = self.pressing.solve_sliding(
            *presses, *chain(*terms.mobility), *chain(*rows), *senses, *force, *resisted
        )
        if frictions_found is None:
            return None
        for j, friction in zip(self.pressing.joints, frictions_found, strict=True):
            resisted[j] -= senses[j] * friction
        return _Resolved(
            InputVector(
                [
                    push + sum(map(mul, levers, resisted))
                    for push, levers in zip(force, zip(*rows, strict=True), strict=True)
                ]
            )
        )

    def _break_margin(self, motion: SeveralMotion, piece: _Piece) -> float:
        """Return how much more the joints hold that stick; negative where one breaks away."""
        if sum(not sense for sense in piece.senses.values()) > len(piece.sticking):
            # What each of them bears is not certain, but whether they hold is.
            return -1.0 if self._find_slipping(motion, piece) else 1.0
        resolved = self._resolve(motion.terms, motion.rate, piece.now + motion.ahead, piece)
        if resolved is None:
            return inf
        margins = []
        for j, part in resolved.parts.items():
            low, high = self._bounds_of(j, piece, resolved.pressed)
            margins.append(min(part - low, high - part))
        return min(margins, default=inf)

    def _rest_slips(
        self, motion: SeveralMotion, piece: _Piece, halted: int | None
    ) -> SeveralMotion:
        """Return the end of a piece, with rates at which nothing slips that sticks."""
        resting = frozenset(j for j, sense in piece.senses.items() if not sense or j == halted)
        if not resting:
            return motion
        if piece.sticking:
            motion = (
                self._reach(motion.value, self._stuck_rates(motion, piece), motion.ahead) or motion
            )
        return motion._replace(resting=resting)

    def _stuck_rates(self, motion: SeveralMotion, piece: _Piece) -> InputVector:
        """Return the rates nearest to those of a motion at which sticking joints do not slip."""
        terms, rate = motion.terms, motion.rate
        if len(piece.sticking) + len(piece.held) >= len(rate):
            return InputVector([0.0] * len(rate))
        slips = self._slips(terms, rate, piece)
        rows = [InputVector(slips[j].levers) for j in piece.sticking]
        moved = [self._move(terms, row, piece) for row in rows]
        parts = _solve_coupled(rows, moved, [slips[j].rate for j in piece.sticking])
        for way, part in zip(moved, parts, strict=True):
            rate -= part * way
        return self._without_braked(rate, piece)

    def _law_segments(
        self, motion: SeveralMotion, force: InputVector, now: float
    ) -> tuple[int, ...]:
        """Return the segment of each law for a motion, or for the direction in which it begins."""
        laws = motion.terms.laws
        change: InputVector | None = None
        if any(at.rate == 0.0 for at in laws):
            piece = _Piece(motion, now, force, (), False, ())
            change = self._accelerate(motion.terms, motion.rate, now, piece)
        segments: tuple[int, ...] = ()
        for law, at in zip(self.laws, laws, strict=True):
            rate = at.rate
            if rate == 0.0 and change is not None:
                began = sum(map(mul, at.levers, change))
                rate = copysign(BEGINNING, began) if began else 0.0
            segments += (law.segment(at.value, rate, now),)
        return segments

    def _inputs_at_stops(self, motion: SeveralMotion) -> list[int]:
        places = zip(motion.value, self.stops, strict=True)
        return [n for n, (at, (low, high)) in enumerate(places) if at <= low or at >= high]

    def _stop_pull(self, motion: SeveralMotion, number: int, piece: _Piece) -> float:
        """Return the force with which a stop would have to pull an input to hold it."""
        terms = motion.terms
        resolved = self._resolve(terms, motion.rate, piece.now + motion.ahead, piece)
        change = resolved and self._free_acceleration(terms, resolved.force, piece)
        if resolved is None or change is None:
            return 0.0
        needed = sum(terms.inertia(number, j) * change[j] for j in range(len(change)))
        needed -= resolved.force[number]
        return needed if motion.value[number] >= self.stops[number][1] else -needed

    def _force(
        self, terms: InputTerms, rate: InputVector, time: float, piece: _Piece
    ) -> InputVector:
        """Return the force on each input, without what inertia, stops and sticking joints need."""
        total = piece.force - terms.bias
        for index, (law, at) in enumerate(zip(self.laws, terms.laws, strict=True)):
            segments = piece.segments
            segment = segments[index] if segments else law.segment(at.value, at.rate, time)
            total += law.force(segment, at.value, at.rate, time) * InputVector(at.levers)
        if piece.senses:
            for j, slip in self._slips(terms, rate, piece).items():
                if sense := piece.senses[j]:
                    resisted = self._friction_of(j, piece).sliding(slip.rate)
                    total -= sense * resisted * InputVector(slip.levers)
        return total

    def _accelerate(
        self, terms: InputTerms, rate: InputVector, time: float, piece: _Piece
    ) -> InputVector | None:
        """Return q̈ of the equation of motion; 0 of inputs that are held at their stops."""
        if piece.sticking and len(piece.sticking) + len(piece.held) >= len(rate):
            return InputVector([0.0] * len(rate))
        if not piece.sticking and self.pressing is None:
            return self._free_acceleration(terms, self._force(terms, rate, time, piece), piece)
        resolved = self._resolve(terms, rate, time, piece)
        acceleration = resolved and self._free_acceleration(terms, resolved.force, piece)
        return None if acceleration is None else self._without_braked(acceleration, piece)

    def _without_braked(self, change: InputVector, piece: _Piece) -> InputVector:
        """Return rates or accelerations of which those are 0, not nearly, that a brake holds."""
        first = len(self.frictions)
        if not piece.brakes or not piece.sticking:
            return change
        return InputVector(
            [0.0 if piece.senses.get(first + n) == 0.0 else part for n, part in enumerate(change)]
        )

    def _move(self, terms: InputTerms, force: InputVector, piece: _Piece) -> InputVector:
        """Return q̈ under a force alone; 0 where there is none."""
        acceleration = self._free_acceleration(terms, force, piece)
        return InputVector([0.0] * len(force)) if acceleration is None else acceleration

    def _free_acceleration(
        self, terms: InputTerms, force: InputVector, piece: _Piece
    ) -> InputVector | None:
        """Return M⁻¹ times a force; 0 of inputs that are held at their stops."""
        if not piece.held:
            return _change_by(terms, force)
        free = [n for n in range(len(force)) if n not in piece.held]
        rows = [[terms.inertia(i, j) for j in free[: k + 1]] for k, i in enumerate(free)]
        solved = solve_positive(rows, [force[n] for n in free])
        if solved is None:
            return None
        change = [0.0] * len(force)
        for n, part in zip(free, solved, strict=True):
            change[n] = part
        return InputVector(change)

    def _step_function(
        self, motion: SeveralMotion, piece: _Piece
    ) -> Callable[[float], SeveralMotion | None]:
        """Return a function that gives the state after some seconds of one step."""
        value, rate = motion.value, motion.rate
        start = self._accelerate(motion.terms, rate, piece.now, piece)

        def acceleration_at(q: InputVector, w: InputVector, ahead: float) -> InputVector | None:
            there = self._terms_at(q, w)
            return None if there is None else self._accelerate(there, w, piece.now + ahead, piece)

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

    def find_event(self, piece: _Piece, motion: SeveralMotion) -> _StepEnd | None:
        """Return an event that has happened before a state, or None."""
        for n, (at, (low, high)) in enumerate(zip(motion.value, self.stops, strict=True)):
            if not low <= at <= high and n not in piece.held:
                return _StepEnd('stop', n)
        passed = self._passed_stop(motion.terms, piece.leaning)
        if passed is not None:
            return _StepEnd('stop', len(self.stops) + passed)
        begin, inertia = piece.begin, motion.terms.total_inertia
        if inertia > self.most_inertia and inertia > begin.terms.total_inertia:
            return _StepEnd('toggle')
        if piece.cuts:
            # What rounding says of the start already is no event.
            for n, margin in self._slip_margins(motion, piece).items():
                if margin < 0.0 <= self._slip_margins(begin, piece)[n]:
                    return _StepEnd('halt', n)
            breaks = piece.sticking and self._break_margin(motion, piece) < 0.0
            if breaks and self._break_margin(begin, piece) >= 0.0:
                return _StepEnd('break')
            if self._segment_margin(motion, piece) < 0.0:
                return _StepEnd('segment')
            for n in piece.held:
                if self._stop_pull(motion, n, piece) > 0.0:
                    return _StepEnd('leave', n)
        return None

    def margin_to(self, piece: _Piece, event: _StepEnd) -> Callable[[SeveralMotion], float]:
        """Return a function that gives the margin of a state to an event."""
        kind, n = event
        if kind == 'stop' and n >= len(self.stops):
            return lambda motion: self._stop_margin(n - len(self.stops), motion.terms)
        if kind == 'stop':
            low, high = self.stops[n]
            return lambda motion: min(motion.value[n] - low, high - motion.value[n])
        if kind == 'toggle':
            return lambda motion: self.most_inertia - motion.terms.total_inertia
        if kind == 'segment':
            return lambda motion: self._segment_margin(motion, piece)
        if kind == 'halt':
            return lambda motion: self._slip_margins(motion, piece)[n]
        if kind == 'break':
            return lambda motion: self._break_margin(motion, piece)
        return lambda motion: -self._stop_pull(motion, n, piece)

    def _slip_margins(self, motion: SeveralMotion, piece: _Piece) -> dict[int, float]:
        """Return the slips of joints that slide, in their directions."""
        if not piece.senses:
            return {}
        slips = self._slips(motion.terms, motion.rate, piece)
        return {j: sense * slips[j].rate for j, sense in piece.senses.items() if sense}

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

    def _meet_stop(self, motion: SeveralMotion, number: int, *, bounces: bool) -> SeveralMotion:
        """
        Return the state after an impact of an input, or of another joint, on its nearer stop.

        What touches its stop already bears a part of the blow, as far as it is pressed against it;
        where nothing ``bounces`` any more, a joint that leans on its stop stays there.
        Friction takes no part: in no time a force with a limit takes no momentum.
        """
        count, met = len(self.stops), motion
        if number < count:
            value, (low, high) = [*motion.value], self.stops[number]
            value[number] = high if abs(value[number] - high) <= abs(value[number] - low) else low
            met = self._reach(InputVector(value), motion.rate) or motion
        terms, before = met.terms, met.rate
        sides = {
            n: 1 if met.value[n] >= self.stops[n][1] else -1 for n in self._inputs_at_stops(met)
        }
        leaning = {count + k: side for k, side in self.leaning_sides(motion).items()}
        sides |= leaning
        glued = () if bounces else leaning.keys() - {number}
        if number >= count:
            sides[number] = self._nearer_stop(number - count, terms)
        rows = {
            c: InputVector(
                terms.limited[c - count].levers
                if c >= count
                else [float(n == c) for n in range(count)]
            )
            for c in sides
        }
        moved = [
            InputVector([sum(map(mul, row, way)) for row in terms.mobility])
            for way in rows.values()
        ]
        closing = {c: sum(map(mul, row, before)) for c, row in rows.items()}
        returned = {
            c: self._restitution_of(c) * rate
            for c, rate in closing.items()
            if bounces and (c == number or c < count) and rate * sides[c] > 0.0
        }
        impulses, _ = settle_forces(
            [[sum(map(mul, row, way)) for way in moved] for row in rows.values()],
            [rate + returned.get(c, 0.0) for c, rate in closing.items()],
            [
                # Two that open each other by ever smaller blows would never lean together.
                (-inf, inf) if c in glued else (-inf, 0.0) if side > 0 else (0.0, inf)
                for c, side in sides.items()
            ],
        )
        rates, borne = before, set()
        for c, way, impulse in zip(sides, moved, impulses, strict=True):
            rates += impulse * way
            if impulse:
                borne.add(c)
        exact = [
            0.0 - returned.get(n, 0.0) if n in borne else rate for n, rate in enumerate(rates)
        ]
        after = self._reach(met.value, InputVector(exact), met.ahead) or _at_rest(met)
        resting = frozenset(
            self._first_stop + c - count
            for c in sides
            if c >= count
            and not returned.get(c)
            and (c in borne or c in glued or after.terms.limited[c - count].is_still(after.rate))
        )
        return after._replace(resting=resting)

    def _restitution_of(self, number: int) -> float:
        """Return the ratio of the rates after and before an impact of an input, or of a joint."""
        own = None
        if number >= len(self.stops):
            own = self.joint_stops[number - len(self.stops)].restitution
        return self.restitution if own is None else own

    def _bounce(self, motion: SeveralMotion) -> SeveralMotion:
        """Return a state whose rates are reversed, as far as an impact returns them."""
        back = InputVector([0.0 - self.restitution * rate for rate in motion.rate])
        return self._reach(motion.value, back) or _at_rest(motion)


def _solve_coupled(
    rows: Sequence[InputVector], moved: Sequence[InputVector], right: Sequence[float]
) -> Sequence[float]:
    """Return the forces of joints that give their slips the right accelerations, or rates."""
    matrix = [[sum(map(mul, row, way)) for way in moved[: k + 1]] for k, row in enumerate(rows)]
    return solve_positive(matrix, right) or [0.0] * len(rows)


def _change_by(terms: InputTerms, force: InputVector) -> InputVector:
    """Return M⁻¹ times a force."""
    return InputVector([sum(map(mul, row, force)) for row in terms.mobility])


def _at_rest(motion: SeveralMotion) -> SeveralMotion:
    return motion._replace(rate=InputVector([0.0] * len(motion.rate)))
