# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Hardware in the loop: a controller commands the effort of the input, which moves the linkage.

Time is divided into equal steps from the first tick on. A step is divided again where a command
or a wrench arrives or expires, since the force changes there. So the motion depends only on the
messages and their times, not on when the state is read: the state between two steps comes from a
shorter step of the same method, which is then discarded.

With a motor (`linkage_ros.dynamics.motor`) a command is an effort, a current or a voltage, and the
effort follows from it and the rate. A command that is delayed waits until its time.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from math import copysign, inf, isfinite, pi
from typing import Any, TYPE_CHECKING

from linkage_ros.description import choice, number, optional_section, whole_number
from linkage_ros.dynamics import LARGEST, METHODS, Motion, SingleDofMechanism
from linkage_ros.errors import DefinitionError, LinkageError
from linkage_ros.kinematics import Closure, describe_ranges
from linkage_ros.messages import (
    EffortCommand,
    JOINT_STATE_TYPE,
    JointEffortReader,
    NANOSECONDS,
    Rejection,
)
from linkage_ros.stages.drives.drive import (
    Context,
    Crank,
    CrankAtRest,
    CrankState,
    Drive,
    Reader,
)

if TYPE_CHECKING:
    from linkage_ros.dynamics import HeldWrench, Mechanics, Motor, Winding

_MADE_UP = NANOSECONDS
"""Time that one tick integrates at most, in [ns]; two periods if these are longer."""

_HURRIED = NANOSECONDS // 50
"""The same while motor and crank meet and part too often: each step then costs several."""

_FEW_TRIALS = 50
"""Fewer trials than this are left of `linkage_ros.dynamics.two_masses.SAVED` then."""

_NEVER = 1 << 63

_SAMPLES = 90
"""Intervals of the range over which the least inertia is looked for."""

_LEAST_RESISTANCE = 1e-9
"""Smaller resistances count as none, in [Ω]."""

_PUSHES = {1: (0.0, inf), 0: (0.0, 0.0), -1: (-inf, 0.0)}
"""What passes through the play, by the side on which the motor touches the crank."""

_Acting = tuple[Any, float, float]
"""What acts by a command: the mechanism, the force on its input, and the brake."""


@dataclass(frozen=True, slots=True)
class MotorParameters:
    """A DC motor with a gear drives the input."""

    torque_constant: float = number(
        'of torque over current, and of voltage over rate', unit='N·m/A', least=1e-9, most=1e6
    )
    resistance: float = number('of the winding', 0.0, unit='Ω', least=0.0, most=1e6)
    inductance: float = number(
        'of the winding; 0: the current follows the voltage at once',
        0.0,
        unit='H',
        least=0.0,
        most=1e6,
    )
    ratio: float = number(
        'turns of the motor for one of the input',
        1.0,
        unit='rad/rad or rad/m',
        least=1e-9,
        most=1e6,
    )
    efficiency: float = number(
        'of the gear while the motor drives the input', 1.0, least=1e-3, most=1.0
    )
    back_efficiency: float = number(
        'of the gear while the input drives the motor', 1.0, least=1e-3, most=1.0
    )
    torque: float = number(
        'most that the motor gives, before the gear', LARGEST, unit='N·m', above=0.0, most=LARGEST
    )
    current: float = number('most in the winding', LARGEST, unit='A', above=0.0, most=LARGEST)
    voltage: float = number('of the supply', LARGEST, unit='V', above=0.0, most=LARGEST)
    command: str = choice(
        'the number in the message: torque or force at the input, current or voltage',
        ('effort', 'current', 'voltage'),
        'effort',
    )
    delay: float = number(
        'from the arrival of a command until it acts', 0.0, unit='s', least=0.0, most=1.0
    )
    quantum: float = number(
        'step to which a command is rounded, in its unit; 0: none', 0.0, least=0.0, most=LARGEST
    )


@dataclass(frozen=True, slots=True)
class PlayParameters:
    """Play between the motor and the crank, each with its own inertia."""

    width: float = number(
        'by which the motor turns against the crank', unit='rad or m', above=0.0, most=100.0
    )
    inertia: float = number(
        "the motor's, seen at the input", unit='kg·m² or kg', above=0.0, most=LARGEST
    )
    restitution: float = number(
        'ratio of the relative rates after and before they meet', 0.0, least=0.0, most=1.0
    )
    on_chatter: str = choice(
        'if they meet and part too often for the step: the play closes at the end of the step, '
        'or the run ends',
        ('close', 'end'),
        'close',
    )


@dataclass(frozen=True, slots=True)
class MotorEncoderParameters:
    """The encoder on the motor's shaft, on ~/motor."""

    counts: int = whole_number(
        'counts in a turn of the motor; 0: exact readings', 0, unit='1/turn', least=0, most=2**32
    )


@dataclass(frozen=True, slots=True)
class TorqueDrive(Drive):
    """Hardware in the loop: the effort commanded on crank_commands moves the linkage's masses."""

    start: float = number('input at the first tick', 0.0, unit='rad or m', least=-1e6, most=1e6)
    rate: float = number('its rate then', 0.0, unit='rad/s or m/s', least=-1e6, most=1e6)
    method: str = choice(
        'integration: of order 1, 4 or 6, at about 1, 4 or 20 evaluations a step',
        tuple(METHODS),
        'rk4',
    )
    step: float = number('length of a step', 1e-3, unit='s', least=1e-6, most=0.1)
    timeout: float = number(
        'validity of a command, unless another one comes', 0.1, unit='s', least=1e-6, most=3600.0
    )
    on_timeout: str = choice(
        'while no command is valid: no effort, or a brake', ('zero', 'brake'), 'zero'
    )
    brake: float = number(
        'holding torque or force of the brake', 0.0, unit='N·m or N', least=0.0, most=LARGEST
    )
    restitution: float = number(
        'ratio of the rates after and before an impact on a stop', 0.0, least=0.0, most=1.0
    )
    stop_margin: float = number(
        'distance of the stop from a toggle at an end of the range, as a fraction of the range: '
        'at the toggle the inertia is unbounded; a limit is itself a stop',
        1e-3,
        above=0.0,
        most=0.49,
    )
    motor: MotorParameters | None = optional_section(  # noqa: RUF009 (a field, as the others are)
        'the motor at the input; without, the command acts on the input itself', MotorParameters
    )
    play: PlayParameters | None = optional_section(  # noqa: RUF009 (as above)
        'play between motor and crank; without, they are one', PlayParameters
    )
    motor_encoder: MotorEncoderParameters | None = optional_section(  # noqa: RUF009 (as above)
        'publishes the motor, as its own encoder reads it, on ~/motor', MotorEncoderParameters
    )

    listens_to = 'crank_commands'
    gives_torque = True
    publishes = '~/motor'
    message = JOINT_STATE_TYPE

    def build(self, context: Context) -> TorqueCrank:
        """
        Build the crank.

        Raise `DefinitionError` if the linkage has several inputs or lacks masses, no motion can
        start at the given start, or the brake is not specified.
        """
        _refuse_useless(self, context)
        motion = _build_motion(self, context)
        given = context.closure.linkage.inputs[0]
        most = given.limits.effort
        motor = None
        if self.motor is not None:
            motor = _build_motor(self.motor, most)
            motion = motor.mount_on(motion)
            if self.motor.command != 'effort':
                most = LARGEST
        start = motion.state_at(self.start, self.rate)
        if start is None:
            raise DefinitionError(
                'drive.torque.start',
                f'at {self.start:g} {given.unit} nothing can be moved: a toggle, or no inertia',
                'start elsewhere',
            )
        mechanics = context.mechanics
        low, high = (min(max(end, start.value - pi), start.value + pi) for end in motion.stops)
        _check_step(self, mechanics, motor, (low, high))
        period = round(NANOSECONDS / context.rate) if context.rate else 0
        wrenches = tuple(mechanics.applied.wrenches.values()) if mechanics.applied else ()
        # An effect of the user's may ask for it.
        exerts = any(name == 'effort' or '.' in name for name in context.effects)
        return TorqueCrank(
            motion, start, self, period, min(most, LARGEST), motor, wrenches, exerts
        )

    def reader(self, context: Context) -> Reader:
        """Build the reader of the messages."""
        return JointEffortReader(context.inputs_in_messages[0], context.dependent).read

    def writer(self, context: Context, drive: TorqueCrank) -> Any:
        """Build the writer of ~/motor; None if the motor is not published."""
        if self.motor_encoder is None:
            return None
        from linkage_ros.stages.drives.motor_encoder import (
            MotorEncoder,  # local import: only if published
        )

        name = f'{context.inputs_in_messages[0]}_motor'
        return MotorEncoder(name, self.motor_encoder.counts, lambda: drive.motor)


def _refuse_useless(parameters: TorqueDrive, context: Context) -> None:
    """Refuse a linkage that the drive cannot move, and a brake that does nothing."""
    n_inputs = len(context.closure.linkage.inputs)
    if n_inputs > 1:
        raise DefinitionError(
            'drive.torque',
            f'the linkage has {n_inputs} inputs, and the torque drive moves one',
            'use a linkage with one input, or another drive',
        )
    brakes = parameters.on_timeout == 'brake'
    if brakes and parameters.brake == 0.0:
        raise DefinitionError(
            'drive.torque.brake',
            'the brake is 0 and holds nothing',
            'write its torque or force, in [N·m] or [N]',
        )
    if parameters.brake and not brakes:
        raise DefinitionError(
            'drive.torque.brake', 'the brake is never applied', 'add on_timeout: brake'
        )


def _build_motion(parameters: TorqueDrive, context: Context) -> Any:
    """Build the motion of the mechanism between its stops, and of a motor beyond a play."""
    mechanics = context.mechanics
    motion = SingleDofMechanism(
        mechanics.motion_equation,
        METHODS[parameters.method].step,
        _find_stops(context.hard_limited, parameters.start, parameters.stop_margin),
        parameters.restitution,
        mechanics.laws,
        context.reactions.friction_effort if mechanics.friction.load_dependent_joint else None,
    )
    if parameters.play is None:
        return motion
    from linkage_ros.dynamics import TwoMasses  # local import: only with play

    play = parameters.play
    return TwoMasses.from_motor(motion, play.inertia, play.width, play.restitution)


def _check_step(
    parameters: TorqueDrive,
    mechanics: Mechanics,
    motor: Motor | Winding | None,
    ends: tuple[float, float],
) -> None:
    """Refuse a step too long for the curves, the motor or the loads between two inputs."""
    low, high = ends
    moved = []
    if motor or mechanics.stribeck_joints:
        places = (low + (high - low) * n / _SAMPLES for n in range(_SAMPLES + 1))
        moved = [terms for terms in map(mechanics.motion_equation, places) if terms]
        moved = [terms for terms in moved if terms.inertia > 0.0]
        mechanics.check_curves(moved, parameters.method, parameters.step)
    if motor:
        least = min([terms.inertia for terms in moved], default=inf)
        if parameters.play is not None:
            least = parameters.play.inertia
        motor.check_step(least, parameters.method, parameters.step)
    if mechanics.applied:
        mechanics.applied.check_step(
            lambda value: terms.inertia if (terms := mechanics.motion_equation(value)) else 0.0,
            ends,
            parameters.method,
            parameters.step,
        )


def _build_motor(given: MotorParameters, most: float) -> Motor | Winding:
    """Return the motor of an input that bears an effort of at most ``most``."""
    from linkage_ros.dynamics import Motor  # local import: only with a motor

    voltage = given.command == 'voltage' or given.voltage < LARGEST
    if voltage and given.resistance < _LEAST_RESISTANCE:
        raise DefinitionError(
            'drive.torque.motor.resistance',
            f'it is {given.resistance:g} Ω, and a voltage would give any current',
            "write the winding's, or command an effort or a current without a limit of voltage",
        )
    motor = Motor(
        given.torque_constant,
        given.resistance,
        given.ratio,
        given.efficiency,
        given.back_efficiency,
        min(
            given.current,
            given.torque / given.torque_constant,
            most / (given.torque_constant * given.ratio * given.efficiency),
        ),
        given.voltage,
        given.command,
    )
    if not given.inductance:
        return motor
    if not voltage:
        raise DefinitionError(
            'drive.torque.motor.inductance',
            'the current is commanded, and without a limit of voltage nothing holds it back',
            'write voltage, or leave it out',
        )
    from linkage_ros.dynamics import Winding  # local import: only with an inductance

    by_current = replace(motor, supply=LARGEST, command='current')
    return Winding(by_current, given.inductance, given.voltage, given.command)


def _find_stops(closure: Closure, start: float, margin: float) -> tuple[float, float]:
    """Return the stops of the input, in [rad] or [m]: at limits, or before a toggle."""
    # If the input has limits, its angle is not reduced by whole turns.
    counted = closure.linkage.inputs[0].limits.is_bounded
    for each in closure.input_ranges:
        if each.is_whole:
            return -inf, inf
        turns = 0.0 if counted else each.shift(start)
        low, high = each.lowest - turns, each.highest - turns
        within = margin * (high - low)
        low, high = (
            (end if by else end + inwards) if limited else copy
            for end, inwards, copy, limited, by in zip(
                (low, high), (within, -within), (-inf, inf), each.limited, each.by, strict=True
            )
        )
        if low <= start <= high:
            return low, high
    raise DefinitionError(
        'drive.torque.start',
        f'{start:g} {closure.linkage.inputs[0].unit} is not between the stops; '
        f'reachable: {describe_ranges(closure.input_ranges)}',
        f'start there, {margin:g} of the range or more from its ends',
    )


def _without_winding(motion: Any) -> Any:
    """Return the motion of motor and mechanism, without the current of a winding."""
    return getattr(motion, 'moved', motion)


class TorqueCrank(Crank):
    """
    A mechanism moved by commanded efforts.

    A tick integrates a limited time, so that a late tick does not become later still: beyond the
    limit whole steps are skipped, as if the mechanism had stood still.

    The mechanism is a `SingleDofMechanism` or `linkage_ros.dynamics.two_masses.TwoMasses`.
    ``period`` is the time from tick to tick, in [ns]; 0 if unknown. Commands are clipped to
    ±``most``, in [N·m] or [N], or for a motor in [A] or [V].
    """

    __slots__ = (
        '_acting',
        '_begun',
        '_boundary',
        '_delay',
        '_due',
        '_idle',
        '_least_made_up',
        '_loaded_until',
        '_made_up',
        '_mechanism',
        '_most',
        '_most_made_up',
        '_motion',
        '_motor',
        '_play',
        '_quantum',
        '_shown',
        '_step',
        '_time',
        '_until',
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
        use: TorqueDrive,
        period: int,
        most: float = LARGEST,
        motor: Motor | Winding | None = None,
        wrenches: tuple[HeldWrench, ...] = (),
        exerts_effort: bool = False,
    ) -> None:
        self.exerts_effort = exerts_effort
        self._mechanism = mechanism
        self._motion = self._shown = start
        self._step = round(use.step * NANOSECONDS)
        # A scene with slow ticks must not skip time between them.
        self._made_up = self._most_made_up = max(_MADE_UP, 2 * period)
        self._idle = self._acting = (mechanism, 0.0, use.brake)
        self._time = self._boundary = self._begun = -1
        self._until = self._due = self._loaded_until = _NEVER
        self._wrenches = wrenches
        self._motor = motor
        self._delay = round(use.motor.delay * NANOSECONDS) if use.motor else 0
        self._quantum = use.motor.quantum if use.motor else 0.0
        self._waiting: deque[tuple[int, _Acting]] = deque()
        self._play = use.play
        self._least_made_up = max(_HURRIED, 2 * period)
        self.max_age = round(use.timeout * NANOSECONDS)
        self._most = most
        self.stamp = self.lost = self.saturated = 0

    def offer(self, command: EffortCommand, now: int) -> Rejection | None:
        """Take a command at a time [ns], or return why it is rejected; then nothing changes."""
        effort = command.effort
        if not -LARGEST <= effort <= LARGEST:
            if isfinite(effort):
                return Rejection.EFFORT_TOO_LARGE
            return Rejection.EFFORT_NOT_FINITE
        self.saturated += not -self._most <= effort <= self._most
        acting = self.actuation_for(effort)
        self.stamp = now
        if self._delay:
            self._waiting.append((now + self._delay, acting))
            self._due = self._waiting[0][0]
            return None
        if self._time >= 0:
            self._advance(now)
            if acting != self._acting and now > self._time:
                self._go_to(now)
        self._acting = acting
        self._until = now + self.max_age
        return None

    def actuation_for(self, effort: float | None) -> tuple[Any, float, float]:
        """Return mechanism, force on its input and brake under a command; None: without one."""
        if effort is None:
            return self._idle
        if not -self._most <= effort <= self._most:
            effort = copysign(self._most, effort)
        if self._motor is None:
            return self._mechanism, effort, 0.0
        if self._quantum:
            effort = round(effort / self._quantum) * self._quantum
        return self._motor.drive_by(self._mechanism, effort)

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
        self._loaded_until = min(each.until for each in self._wrenches)

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
        if motion.rate or not self.exerts_effort:
            return CrankState((motion.value,), (motion.rate,), (acceleration,), 0)
        standing = CrankAtRest((motion.value,), (motion.rate,), (acceleration,), 0)
        standing.bearing = self._resting_efforts(motion, acceleration)
        return standing

    def _watch_chatter(self, play: PlayParameters) -> None:
        """Let a late tick integrate less while motor and crank meet too often, or end the run."""
        if self.chatter_count and play.on_chatter == 'end':
            raise LinkageError(
                'drive.torque.play',
                f'motor and crank meet and part too often for a step of {self._step * 1e-9:g} s, '
                f'at a rate of {self._motion.rate:.4g}',
                'shorten the step, look at the controller, or write on_chatter: close',
            )
        hurries = _without_winding(self._motion).trials < _FEW_TRIALS
        self._made_up = self._least_made_up if hurries else self._most_made_up

    def _resting_efforts(self, motion: Any, acceleration: float) -> tuple[float, float]:
        """Return the least and the greatest effort that acts on the input at rest."""
        mechanism, force, holding = self._acting
        if self._motor:
            resting, within = self._motor.at_rest(mechanism, motion)
            force, holding = force + resting, holding + within
        least, most = force - holding, force + holding
        behind_play = _without_winding(motion)
        if not isinstance(behind_play, Motion):
            # Through the play passes what is left after the motor's own inertia, as a push.
            own = behind_play.motor.terms.inertia * acceleration
            low, high = _PUSHES[behind_play.side]
            least, most = (min(max(end - own, low), high) for end in (least, most))
        return least, most

    @property
    def chatter_count(self) -> int:
        """Return the number of steps in which motor and crank met and parted too often."""
        coarse: int = getattr(_without_winding(self._motion), 'coarse', 0)
        return coarse

    @property
    def motor(self) -> tuple[float, float, float | None]:
        """Angle, rate and torque before the gear at the last state; None without `motor`."""
        moved, mechanism = getattr(self._shown, 'motor', self._shown), self._acting[0]
        if self._motor is None:
            return moved.value, moved.rate, None
        ratio, torque = self._motor.ratio, self._motor.torque(mechanism, self._shown)
        return ratio * moved.value, ratio * moved.rate, torque

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
                self._acting, self._until = self._idle, _NEVER
            if end == self._boundary:
                self._boundary += self._step
            if end == self._due:
                self._acting = self._waiting.popleft()[1]
                self._until = end + self.max_age
                self._due = self._waiting[0][0] if self._waiting else _NEVER

    def _go_to(self, end: int) -> None:
        """Integrate a step, or the rest of one."""
        if end > self._time:
            seconds, time = (end - self._time) * 1e-9, (self._time - self._begun) * 1e-9
            mechanism, force, brake = self._acting
            self._motion = mechanism.advance(self._motion, seconds, force, brake, time)
            self._time = end
