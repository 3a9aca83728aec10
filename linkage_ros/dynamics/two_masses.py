# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A motor and a crank with play between them, each with its own inertia.

The motor, at the angle φ, and the crank, at q, move apart within the play: |φ − q| ≤ p/2. The
motor has the inertia J, the drive's force and its brake; the crank has the rest of the mechanism::

    J·φ̈ = τ − B·sign(φ̇)          I(q)·q̈ + ½·I'(q)·q̇² + … = 0          within the play
    (I(q) + J)·q̈ + ½·I'(q)·q̇² + … = τ − B·sign(q̇)                       where they touch

At an end of the play they meet. Newton's law of impact with the restitution e keeps the momentum
J·φ̇ + I·q̇ and turns the relative rate r = φ̇ − q̇ into −e·r. If they stay together they move as
one, as long as each alone would press on the other: on the side s = ±1 while s·(φ̈ − q̈) ≥ 0, both
as if they were apart. The integrator finds the instants of meeting and of parting and cuts its
step there (M. Nordin, P.-O. Gutman, Controlling mechanical systems with backlash - a survey,
Automatica 38, 2002; for impacts D. E. Stewart, Rigid-Body Dynamics with Friction and Impact, SIAM
Review 42, 2000).

A stop bears the crank, not the motor: where the crank comes to its stop, the motor goes on alone,
or meets the crank. To a motor that pushes it against the stop a crank at rest is a wall. Friction
in the joints takes no part in an impact.

To find an instant takes trials: motions from the start of the step to a guess. Each step may
take some, and what it leaves over may be used later, so a run of bounces fits in. A motion that
asks for more, as one that is far too fast for its step, goes on as time-stepping does: what is
left of a step is one piece; they do not part in it, and they meet at its end, without a bounce
(J. J. Moreau, Numerical aspects of the sweeping process, Comput. Methods Appl. Mech. Eng. 177,
1999). So the work is bounded, and it depends on nothing but the motion.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import copysign, ulp
from typing import NamedTuple

from linkage_ros.dynamics.equation import Terms
from linkage_ros.dynamics.motion import last_before, Motion, NARROW, SingleDofMechanism

TRIALS = 3
"""Trials that each step may take to find the instants of meetings and partings."""

SAVED = 200
"""Most trials that are saved for a step: enough for two runs of bounces."""

_BOUNCES = 20
"""Most bounces in a step: with more they come to rest against each other anyway."""

_BRIEF = 1e-4
"""
Flights from one meeting to the next that are shorter, as a fraction of the step, are the last.

A further one would move them by less than this squared times what the step does.
"""

_SLOW = 1e-9
"""Slower meetings, as a fraction of both rates, are without a bounce."""


class PlayMotion(NamedTuple):
    """A state of motor and crank."""

    # Their states, each with its own equation of motion.
    crank: Motion
    motor: Motion
    # 1 if the motor touches the crank so that it pushes it forward, -1 backward, 0 in between.
    side: int = 0
    ahead: float = 0.0  # The time since the start of the step, in [s]
    trials: int = SAVED  # Trials that are left; negative if the last search took more than that
    coarse: int = 0  # Steps so far that were finished without them

    @property
    def value(self) -> float:
        """Return the crank's value, in [rad] or [m]."""
        return self.crank.value

    @property
    def rate(self) -> float:
        """Return the crank's rate, in [rad/s] or [m/s]."""
        return self.crank.rate


@dataclass(frozen=True, slots=True)
class TwoMasses:
    """A motor that drives a mechanism of one input through play."""

    crank: SingleDofMechanism  # The mechanism without its motor
    motor: SingleDofMechanism  # The motor alone
    joined: SingleDofMechanism  # Both as one; it comes to rest at the crank's stops
    half: float  # Half of the play, in [rad] or [m]
    restitution: float  # Ratio of the relative rates after and before a meeting, 0 to 1

    @classmethod
    def from_motor(
        cls, crank: SingleDofMechanism, inertia: float, play: float, restitution: float
    ) -> TwoMasses:
        """Return a mechanism behind the play of a motor of this inertia, in [kg·m²] or [kg]."""
        alone = Terms(inertia, 0.0, 0.0, 0.0, 0.0)

        def joined_terms(value: float) -> Terms | None:
            terms = crank.terms(value)
            return None if terms is None else terms._replace(inertia=terms.inertia + inertia)

        motor = SingleDofMechanism(lambda _value: alone, crank.step)
        joined = replace(crank, terms=joined_terms, restitution=0.0)
        return cls(crank, motor, joined, 0.5 * play, restitution)

    @property
    def stops(self) -> tuple[float, float]:
        """Lower and upper stop of the crank, in [rad] or [m]."""
        return self.crank.stops

    def driven_by(self, change: Callable[[SingleDofMechanism], SingleDofMechanism]) -> TwoMasses:
        """Return it with a change of what its motor moves: itself, and both as one."""
        return replace(self, motor=change(self.motor), joined=change(self.joined))

    def state_at(self, value: float, rate: float) -> PlayMotion | None:
        """Return a state with the motor in the middle of the play, or None if there is none."""
        crank, motor = self.crank.state_at(value, rate), self.motor.state_at(value, rate)
        return None if crank is None or motor is None else PlayMotion(crank, motor)

    def acceleration(
        self, motion: PlayMotion, force: float, brake: float = 0.0, time: float = 0.0
    ) -> float:
        """Return q̈ of the crank; the parameters are as in `SingleDofMechanism.advance`."""
        # Under another force than before they may have to part.
        if not motion.side or self._pressing_rate(motion, force, brake, time) < 0.0:
            return self.crank.acceleration(motion.crank, 0.0, 0.0, time)
        return self.joined.acceleration(self._as_one(motion.crank), force, brake, time)

    def advance(
        self,
        motion: PlayMotion,
        seconds: float,
        force: float,
        brake: float = 0.0,
        time: float = 0.0,
    ) -> PlayMotion:
        """Advance a state by one step; the parameters are as in `SingleDofMechanism.advance`."""
        left, bounces = seconds, 0
        motion = motion._replace(trials=min(motion.trials + TRIALS, SAVED))
        while True:
            now = time + (seconds - left)
            motion = motion._replace(ahead=0.0)
            if motion.side and self._pressing_rate(motion, force, brake, now) < 0.0:
                motion = motion._replace(side=0)
            begin, side, trials = motion, motion.side, motion.trials

            def state_after(
                ahead: float, begin: PlayMotion = begin, now: float = now
            ) -> PlayMotion:
                nonlocal trials
                trials -= 1
                return self._move_freely(begin, ahead, force, brake, now)

            opening = 0.0 if side else self._opening_rate(begin)
            margin = self._event_margin(begin, opening, force, brake, now)
            length, end = left, state_after(left)
            stopped = side and self._at_stop(end.crank) and not self._at_stop(begin.crank)
            ends = margin(end) < 0.0
            if not (ends or stopped):
                return end._replace(trials=begin.trials)
            if trials < 0:
                if stopped:
                    end = self._stop_crank(end, False)
                elif not side:
                    end = self._meet(end, False)
                return end._replace(trials=begin.trials, coarse=begin.coarse + 1)
            if stopped:
                length, end, _ = last_before(state_after, self._before_stop, begin, left, end)
                ends = margin(end) < 0.0
            if ends:
                length, _, _ = last_before(state_after, margin, begin, length, end)
                end = state_after(length)
            left -= length
            if not ends:
                motion = self._stop_crank(end, bounces < _BOUNCES)
                bounces += not motion.side
            elif side:
                motion = end._replace(side=0)
            else:
                last = opening > 0.0 and length < _BRIEF * seconds
                motion = self._meet(end, bounces < _BOUNCES and not last)
                bounces += not motion.side
            motion = motion._replace(trials=trials)
            if left <= seconds * NARROW:
                return motion

    def _event_margin(
        self, begin: PlayMotion, opening: float, force: float, brake: float, now: float
    ) -> Callable[[PlayMotion], float]:
        """Return a function that is negative after they met or parted, since some state."""
        if begin.side:
            return lambda state: self._pressing_rate(state, force, brake, now + state.ahead)
        if not opening:
            return self._play_gap
        # A flight from one meeting to the next has the gap 0 at both ends. Divided by the time it
        # is nearly a straight line, on which the search ends soon.
        return lambda state: self._play_gap(state) / state.ahead if state.ahead else opening

    def _play_gap(self, state: PlayMotion) -> float:
        """Return how far they are from meeting, in [rad] or [m]; 0 within rounding."""
        motor, crank = state.motor.value, state.crank.value
        gap = self.half - abs(motor - crank)
        return gap if abs(gap) > 4.0 * ulp(abs(motor) + abs(crank)) else 0.0

    def _opening_rate(self, state: PlayMotion) -> float:
        """Return the rate at which they leave each other; 0 if they do not, or are apart."""
        motor, crank = state.motor, state.crank
        if self._play_gap(state):
            return 0.0
        return max(0.0, copysign(1.0, crank.value - motor.value) * (motor.rate - crank.rate))

    def _move_freely(
        self, motion: PlayMotion, seconds: float, force: float, brake: float, now: float
    ) -> PlayMotion:
        """Return the state after some seconds in which they neither meet nor part."""
        side = motion.side
        if not side:
            crank = self.crank.advance(motion.crank, seconds, 0.0, 0.0, now)
            motor = self.motor.advance(motion.motor, seconds, force, brake, now)
            return motion._replace(crank=crank, motor=motor, ahead=seconds)
        end = self.joined.advance(self._as_one(motion.crank), seconds, force, brake, now)
        crank = end._replace(terms=self.crank.terms(end.value) or motion.crank.terms)
        motor = motion.motor._replace(value=end.value + side * self.half, rate=end.rate)
        return motion._replace(crank=crank, motor=motor, ahead=seconds)

    def _as_one(self, crank: Motion) -> Motion:
        """Return the state of both as one."""
        return crank._replace(terms=self.joined.terms(crank.value) or crank.terms)

    def _at_stop(self, crank: Motion) -> bool:
        """Return whether the crank rests at a stop."""
        return crank.rate == 0.0 and crank.value in self.stops

    def _before_stop(self, motion: PlayMotion) -> float:
        return -1.0 if self._at_stop(motion.crank) else 1.0

    def _stop_crank(self, motion: PlayMotion, bounces: bool) -> PlayMotion:
        """Return the state after a crank that touches its motor has come to its stop."""
        low, high = self.stops
        crank, motor, side = motion[:3]
        stop = high if crank.rate > 0.0 else low
        rate = 0.0 - self.crank.restitution * crank.rate
        crank = self.crank.state_at(stop, rate) or crank._replace(value=stop, rate=rate)
        motor = motor._replace(value=stop + side * self.half)
        parted = motion._replace(crank=crank, motor=motor, side=0)
        return self._meet(parted, bounces) if side * (motor.rate - rate) > 0.0 else parted

    def _pressing_rate(self, motion: PlayMotion, force: float, brake: float, time: float) -> float:
        """Return how fast they would press on each other if they were apart."""
        motor = self.motor.acceleration(motion.motor, force, brake, time)
        return motion.side * (motor - self.crank.acceleration(motion.crank, 0.0, 0.0, time))

    def _meet(self, motion: PlayMotion, bounces: bool) -> PlayMotion:
        """Return the state after a meeting."""
        crank, motor = motion.crank, motion.motor
        side = int(copysign(1.0, motor.value - crank.value))
        closing = motor.rate - crank.rate
        low, high = self.stops
        if self._at_stop(crank) and crank.value == (high if side > 0 else low):
            back = self.restitution * motor.rate if bounces else 0.0
            motor = motor._replace(value=crank.value + side * self.half, rate=0.0 - back)
            return motion._replace(crank=crank, motor=motor, side=0 if back else side)
        own, crank_inertia = motor.terms.inertia, crank.terms.inertia
        common = (own * motor.rate + crank_inertia * crank.rate) / (own + crank_inertia)
        slow = side * closing <= _SLOW * (abs(motor.rate) + abs(crank.rate))
        back = self.restitution * closing / (own + crank_inertia) if bounces and not slow else 0.0
        motor = motor._replace(
            value=crank.value + side * self.half, rate=common - crank_inertia * back
        )
        crank = crank._replace(rate=common + own * back)
        return motion._replace(crank=crank, motor=motor, side=0 if back else side)
