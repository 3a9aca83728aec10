# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The crank of the torque drive: it takes commands, and integrates the motion in steps.

Time is divided into equal steps from the first tick on. A step is divided again where a command
or a wrench arrives or expires, since the force changes there. So the motion depends only on the
messages and their times, not on when the state is read: the state between two steps comes from a
shorter step of the same method, which is then discarded.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Sequence
from math import inf, isfinite
from operator import itemgetter
from typing import Any, TYPE_CHECKING

from linkage_ros.dynamics import LARGEST, Motion
from linkage_ros.errors import LinkageError
from linkage_ros.messages import EffortCommand, NANOSECONDS, Rejection
from linkage_ros.stages.drives.drive import Context, Crank, CrankAtRest, CrankState

if TYPE_CHECKING:
    from linkage_ros.dynamics import HeldWrench, Motor, Winding
    from linkage_ros.stages.drives.torque import TorqueDrive

_MADE_UP = NANOSECONDS
"""Time that one tick integrates at most, in [ns]; two periods if these are longer."""

_HURRIED = NANOSECONDS // 50
"""The same while motor and crank meet and part too often: each step then costs several."""

_FEW_TRIALS = 50
"""Fewer trials than this are left of `linkage_ros.dynamics.two_masses.SAVED` then."""

NEVER = 1 << 63
"""A time after all others, in [ns]."""

PUSHES = {1: (0.0, inf), 0: (0.0, 0.0), -1: (-inf, 0.0)}
"""What passes through the play, by the side on which the motor touches the crank."""

_Acting = tuple[Any, Any, Any]
"""What acts by a command: the mechanism, and of its input or inputs the force and the brake."""


def without_winding(motion: Any) -> Any:
    """Return the motion of motor and mechanism, without the current of a winding."""
    return getattr(motion, 'moved', motion)


class TorqueCrank(Crank):
    """
    A mechanism moved by commanded efforts.

    A tick integrates a limited time, so that a late tick does not become later still: beyond the
    limit whole steps are skipped, as if the mechanism had stood still.

    The mechanism is a `SingleDofMechanism` or `linkage_ros.dynamics.two_masses.TwoMasses`.
    ``uses`` has the parameters of the drive for each input. Commands are clipped to the effort
    limit of their input, in [N·m] or [N]; in [A] or [V] to ±`LARGEST`. A message commands the
    inputs that it names; the commands of the others go on, each for the same time from its own
    arrival.
    """

    __slots__ = (
        '_acting',
        '_begun',
        '_boundary',
        '_brake',
        '_commands',
        '_delays',
        '_due',
        '_least_made_up',
        '_loaded_until',
        '_made_up',
        '_mechanism',
        '_most',
        '_most_made_up',
        '_motion',
        '_motor',
        '_newest_inputs',
        '_play',
        '_quanta',
        '_shown',
        '_stamps',
        '_step',
        '_time',
        '_until',
        '_untils',
        '_waiting',
        '_wrenches',
        'exerts_effort',
        'lost',
        'max_age',
        'saturated',
        'stamp',
    )

    exerts_effort: bool
    """Whether its crank state says what it exerts on an input at rest."""
    stamp: int
    """Arrival of the newest good command, in [ns]; 0 before the first."""
    max_age: int
    """Validity of a command, in [ns]."""
    lost: int
    """Skipped time, in [ns]."""
    saturated: int
    """Number of commands clipped to the effort limit."""

    def __init__(
        self,
        mechanism: Any,
        start: Any,
        uses: Sequence[TorqueDrive],
        context: Context,
        motor: Motor | Winding | None = None,
    ) -> None:
        # An effect of the user's may ask for it.
        self.exerts_effort = any(name == 'effort' or '.' in name for name in context.effects)
        self._mechanism = mechanism
        self._motion = self._shown = start
        use = uses[0]
        self._step = round(use.step * NANOSECONDS)
        # A scene with slow ticks must not skip time between them.
        period = round(NANOSECONDS / context.rate) if context.rate else 0
        self._made_up = self._most_made_up = max(_MADE_UP, 2 * period)
        self._time = self._boundary = self._begun = -1
        self._until = self._due = self._loaded_until = NEVER
        applied = context.mechanics.applied
        self._wrenches: tuple[HeldWrench, ...] = (
            tuple(applied.wrenches.values()) if applied else ()
        )
        self._motor, self._brake = motor, use.brake
        motors = [use.motor for use in uses]
        self._delays = [round(motor.delay * NANOSECONDS) if motor else 0 for motor in motors]
        self._quanta = [motor.quantum if motor else 0.0 for motor in motors]
        # The commands that wait: when they act, their inputs, and themselves.
        self._waiting: list[tuple[int, int, float]] = []
        self._commands: list[float | None] = [None] * len(uses)
        self._untils = [NEVER] * len(uses)
        self._stamps = [0] * len(uses)
        self._newest_inputs: tuple[int, ...] = (0,)
        plays = [use.play for use in uses if use.play]
        self._play = max(plays, key=lambda play: play.on_chatter == 'end', default=None)
        self._least_made_up = max(_HURRIED, 2 * period)
        self.max_age = round(use.timeout * NANOSECONDS)
        self._most = [
            LARGEST
            if use.motor and use.motor.command != 'effort'
            else min(driven.limits.effort, LARGEST)
            for use, driven in zip(uses, context.closure.linkage.inputs, strict=True)
        ]
        self.stamp = self.lost = self.saturated = 0
        self._acting = self.actuation_for(*self._commands)

    @property
    def stamps(self) -> tuple[int, ...]:
        """Arrival of the newest good command of each input, in [ns]; 0 before the first."""
        return tuple(self._stamps)

    @property
    def newest_inputs(self) -> tuple[int, ...]:
        """Numbers of the inputs that the last good message commands."""
        return self._newest_inputs

    def offer(self, command: EffortCommand, now: int) -> Rejection | None:
        """Take commands at a time [ns], or return why they are rejected; then nothing changes."""
        named = [(n, effort) for n, effort in enumerate(command.efforts) if effort is not None]
        for _, effort in named:
            if not -LARGEST <= effort <= LARGEST:
                if isfinite(effort):
                    return Rejection.EFFORT_TOO_LARGE
                return Rejection.EFFORT_NOT_FINITE
        self.stamp = now
        self._newest_inputs = tuple([number for number, _ in named])
        if self._time >= 0 and not all(self._delays[number] for number, _ in named):
            self._advance(now)
        for number, effort in named:
            most = self._most[number]
            self.saturated += not -most <= effort <= most
            clipped = min(max(effort, -most), most)
            self._stamps[number] = now
            if self._delays[number]:
                due = now + self._delays[number]
                insort(self._waiting, (due, number, clipped), key=itemgetter(0))
                self._due = self._waiting[0][0]
            else:
                self._commands[number] = clipped
                self._untils[number] = now + self.max_age
        acting = self.actuation_for(*self._commands)
        if self._time >= 0 and acting != self._acting and now > self._time:
            self._go_to(now)
        self._acting, self._until = acting, min(self._untils)
        return None

    def actuation_for(self, *commands: float | None) -> _Acting:
        """Return mechanism, force on its input and brake under a command; None: without one."""
        rounded = []
        for command, quantum in zip(commands, self._quanta, strict=True):
            if command is None or not quantum:
                rounded.append(command)
            else:
                rounded.append(round(command / quantum) * quantum)
        return self._drive_by(rounded)

    def _drive_by(self, commands: Sequence[float | None]) -> _Acting:
        """Return what acts by commands that are within their limits."""
        (command,) = commands
        if command is None:
            return self._mechanism, 0.0, self._brake
        if self._motor is None:
            return self._mechanism, command, 0.0
        return self._motor.drive_by(self._mechanism, command)

    @property
    def motion(self) -> Any:
        """Return the state of the mechanism at the last boundary of a step."""
        return self._motion

    def load(self, held: HeldWrench, wrench: tuple[float, ...], now: int) -> None:
        """Let a wrench act on its link from a time on, in [ns]."""
        if self._time >= 0:
            self._advance(now)
            if wrench != held.wrench and now > self._time:
                self._go_to(now)
        held.set_wrench(wrench, now)
        self._loaded_until = min(wrench.until for wrench in self._wrenches)

    def state(self, now: int) -> CrankState:
        """
        Return the crank state at a time, in [ns]; for an earlier time, the last state.

        Raise `LinkageError` if motor and crank meet and part too often, and the scene ends the run
        then.
        """
        if self._time < 0:
            self._time = self._begun = now
            self._boundary = now + self._step
        self._advance(now)
        motion, time = self._motion, (self._time - self._begun) * 1e-9
        mechanism, force, brake = self._acting
        if now > self._time:
            seconds = (now - self._time) * 1e-9
            motion = mechanism.advance(motion, seconds, force, brake, time)
            time += seconds
        acceleration = mechanism.acceleration(motion, force, brake, time)
        self._shown = motion
        if self._play:
            self._watch_chatter(self._play)
        return self._crank_state(motion, acceleration)

    def _crank_state(self, motion: Any, acceleration: Any) -> CrankState:
        """Return the crank state at a state of the mechanism."""
        if motion.rate or not self.exerts_effort:
            return CrankState((motion.value,), (motion.rate,), (acceleration,), 0)
        standing = CrankAtRest((motion.value,), (motion.rate,), (acceleration,), 0)
        standing.bearing = self._resting_efforts(motion, acceleration)
        return standing

    def _watch_chatter(self, play: Any) -> None:
        """Let a late tick integrate less while motor and crank meet too often, or end the run."""
        if self.chatter_count and play.on_chatter == 'end':
            raise LinkageError(
                'drive.torque.play',
                f'motor and crank meet and part too often for a step of {self._step * 1e-9:g} s, '
                f'at a rate of {abs(self._motion.rate):.4g}',
                'shorten the step, look at the controller, or write on_chatter: close',
            )
        self._made_up = self._least_made_up if self._hurries() else self._most_made_up

    def _hurries(self) -> bool:
        """Return whether motor and crank meet and part too often."""
        trials: int = without_winding(self._motion).trials
        return trials < _FEW_TRIALS

    def _resting_efforts(self, motion: Any, acceleration: float) -> tuple[float, float]:
        """Return the least and the greatest effort that acts on the input at rest."""
        mechanism, force, holding = self._acting
        if self._motor:
            resting, within = self._motor.at_rest(mechanism, motion)
            force, holding = force + resting, holding + within
        least, most = force - holding, force + holding
        behind_play = without_winding(motion)
        if not isinstance(behind_play, Motion):
            # Through the play passes what is left after the motor's own inertia, as a push.
            own = behind_play.motor.terms.inertia * acceleration
            low, high = PUSHES[behind_play.side]
            least, most = (min(max(end - own, low), high) for end in (least, most))
        return least, most

    @property
    def chatter_count(self) -> int:
        """Return the number of steps in which motor and crank met and parted too often."""
        coarse: int = getattr(without_winding(self._motion), 'coarse', 0)
        return coarse

    @property
    def motor(self) -> tuple[float, float, float | None]:
        """Angle, rate and torque before the gear at the last state; None without `motor`."""
        moved, mechanism = getattr(self._shown, 'motor', self._shown), self._acting[0]
        if self._motor is None:
            return moved.value, moved.rate, None
        ratio, torque = self._motor.ratio, self._motor.torque(mechanism, self._shown)
        return ratio * moved.value, ratio * moved.rate, torque

    @property
    def motors(self) -> Sequence[tuple[float, float, float | None]]:
        """Return the same of the motor of each input."""
        return [self.motor]

    def _advance(self, now: int) -> None:
        """Integrate all steps that end by a time, in [ns]."""
        late = now - self._time - self._made_up
        if late > 0:
            left_out = -(-late // self._step) * self._step
            self._time += left_out
            self._boundary += left_out
            self.lost += left_out
        while (end := min(self._boundary, self._until, self._due, self._loaded_until)) <= now:
            self._go_to(end)
            if end == self._loaded_until:
                for held in self._wrenches:
                    held.expire(end)
                self._loaded_until = min(held.until for held in self._wrenches)
            if end == self._until:
                self._expire(end)
            if end == self._boundary:
                self._boundary += self._step
            if end == self._due:
                self._take_due(end)
                self._due = self._waiting[0][0] if self._waiting else NEVER

    def _expire(self, end: int) -> None:
        """End the commands that are too old."""
        for number, until in enumerate(self._untils):
            if until == end:
                self._commands[number], self._untils[number] = None, NEVER
        self._acting, self._until = self.actuation_for(*self._commands), min(self._untils)

    def _take_due(self, end: int) -> None:
        """Let the first command that waits act from a time on, in [ns]."""
        _, number, self._commands[number] = self._waiting.pop(0)
        self._untils[number] = end + self.max_age
        self._acting, self._until = self.actuation_for(*self._commands), min(self._untils)

    def _go_to(self, end: int) -> None:
        """Integrate a step, or the rest of one."""
        if end > self._time:
            seconds, time = (end - self._time) * 1e-9, (self._time - self._begun) * 1e-9
            mechanism, force, brake = self._acting
            self._motion = mechanism.advance(self._motion, seconds, force, brake, time)
            self._time = end
