# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Hardware in the loop: a controller commands the effort of the input, which moves the linkage.

The crank that takes the commands and integrates the motion is
`linkage_ros.stages.drives.torque_crank`; of several inputs
`linkage_ros.stages.drives.several_torques`.

With a motor (`linkage_ros.dynamics.motor`) a command is an effort, a current or a voltage, and the
effort follows from it and the rate. A command that is delayed waits until its time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, pi
from typing import Any, TYPE_CHECKING

from linkage_ros.description import choice, each_part, number, optional_section, whole_number
from linkage_ros.dynamics import LARGEST, METHODS, SingleDofMechanism
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import Closure, describe_ranges
from linkage_ros.messages import JOINT_STATE_TYPE, JointEffortReader
from linkage_ros.stages.drives.drive import Context, Drive, Reader
from linkage_ros.stages.drives.torque_crank import TorqueCrank

if TYPE_CHECKING:
    from linkage_ros.dynamics import (
        Mechanics,
        Motor,
        SeveralDofMechanism,
        SeveralMotion,
        Winding,
    )
    from linkage_ros.stages.drives.several_torques import SeveralTorqueCrank

_SAMPLES = 90
"""Intervals of the range over which the least inertia is looked for."""

_LEAST_RESISTANCE = 1e-9
"""Smaller resistances count as none, in [Ω]."""


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
class TorqueInput:
    """Start, motor and play of one input."""

    start: float = number('value at the first tick', 0.0, unit='rad or m', least=-1e6, most=1e6)
    rate: float = number('its rate then', 0.0, unit='rad/s or m/s', least=-1e6, most=1e6)
    motor: MotorParameters | None = optional_section(  # noqa: RUF009 (a field, as the others are)
        'its own motor; without, the common one', MotorParameters
    )
    play: PlayParameters | None = optional_section(  # noqa: RUF009 (as above)
        'its own play; without, the common one', PlayParameters
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
        'at the toggle the inertia is unbounded; a limit is itself a stop; of several inputs, '
        'ratio of the inertias at the start and at the stop',
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
    inputs: Mapping[str, TorqueInput] = each_part(
        'inputs with a start, a rate, a motor and play of their own', 'input', TorqueInput
    )

    listens_to = 'crank_commands'
    gives_torque = True
    publishes = '~/motor'
    message = JOINT_STATE_TYPE

    def build(self, context: Context) -> TorqueCrank:
        """
        Build the crank.

        Raise `DefinitionError` if the linkage lacks masses, no motion can start at the given
        start, the brake is not specified, or something is for one input and there are several.
        """
        _refuse_useless(self)
        names = context.closure.input_names
        if len(names) > 1:
            return _build_several(self, context)
        return _build_single(self.for_input(names[0]), context)

    def for_input(self, name: str) -> TorqueDrive:
        """Return the drive with the start, the motor and the play of an input."""
        own = self.inputs.get(name)
        if own is None:
            return self
        motor, play = own.motor or self.motor, own.play or self.play
        return replace(self, start=own.start, rate=own.rate, motor=motor, play=play)

    def key_for(self, name: str, part: str) -> str:
        """Return the key under which a part of an input is, as ``motor``."""
        own = name in self.inputs and getattr(self.inputs[name], part) is not None
        return f'drive.torque.inputs.{name}.{part}' if own else f'drive.torque.{part}'

    def reader(self, context: Context) -> Reader:
        """Build the reader of the messages."""
        return JointEffortReader(context.inputs_in_messages, context.dependent).read

    def writer(self, context: Context, drive: TorqueCrank) -> Any:
        """Build the writer of ~/motor; None if the motor is not published."""
        if self.motor_encoder is None:
            return None
        from linkage_ros.stages.drives.motor_encoder import (
            MotorEncoder,  # local import: only if published
        )

        names = [f'{name}_motor' for name in context.inputs_in_messages]
        return MotorEncoder(names, self.motor_encoder.counts, lambda: drive.motors)


def _refuse_useless(parameters: TorqueDrive) -> None:
    """Refuse a brake that does nothing."""
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


def _build_single(parameters: TorqueDrive, context: Context) -> TorqueCrank:
    """Build the crank of a linkage with one input."""
    motion = _build_motion(parameters, context)
    driven = context.closure.linkage.inputs[0]
    motor = None
    if parameters.motor is not None:
        key = parameters.key_for(driven.joint, 'motor')
        motor = _build_motor(parameters.motor, driven.limits.effort, key)
        motion = motor.mount_on(motion)
    start = motion.state_at(parameters.start, parameters.rate)
    if start is None:
        raise DefinitionError(
            parameters.key_for(driven.joint, 'start'),
            f'at {parameters.start:g} {driven.unit} nothing can be moved: a toggle, or no inertia',
            'start elsewhere',
        )
    low, high = (min(max(end, start.value - pi), start.value + pi) for end in motion.stops)
    _check_step(parameters, context.mechanics, motor, (low, high))
    return TorqueCrank(motion, start, (parameters,), context, motor)


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


def _build_motor(parameters: MotorParameters, most: float, key: str) -> Motor | Winding:
    """Return the motor of an input that bears an effort of at most ``most``."""
    from linkage_ros.dynamics import Motor  # local import: only with a motor

    voltage = parameters.command == 'voltage' or parameters.voltage < LARGEST
    if voltage and parameters.resistance < _LEAST_RESISTANCE:
        raise DefinitionError(
            f'{key}.resistance',
            f'it is {parameters.resistance:g} Ω, and a voltage would give any current',
            "write the winding's, or command an effort or a current without a limit of voltage",
        )
    motor = Motor(
        parameters.torque_constant,
        parameters.resistance,
        parameters.ratio,
        parameters.efficiency,
        parameters.back_efficiency,
        min(
            parameters.current,
            parameters.torque / parameters.torque_constant,
            most / (parameters.torque_constant * parameters.ratio * parameters.efficiency),
        ),
        parameters.voltage,
        parameters.command,
    )
    if not parameters.inductance:
        return motor
    if not voltage:
        raise DefinitionError(
            f'{key}.inductance',
            'the current is commanded, and without a limit of voltage nothing holds it back',
            'write voltage, or leave it out',
        )
    from linkage_ros.dynamics import Winding  # local import: only with an inductance

    by_current = replace(motor, supply=LARGEST, command='current')
    return Winding(by_current, parameters.inductance, parameters.voltage, parameters.command)


def _find_stops(closure: Closure, start: float, margin: float) -> tuple[float, float]:
    """Return the stops of the input, in [rad] or [m]: at limits, or before a toggle."""
    # If the input has limits, its angle is not reduced by whole turns.
    counted = closure.linkage.inputs[0].limits.is_bounded
    for span in closure.input_ranges:
        if span.is_whole:
            return -inf, inf
        turns = 0.0 if counted else span.shift(start)
        low, high = span.lowest - turns, span.highest - turns
        within = margin * (high - low)
        low, high = (
            (end if by else end + inwards) if limited else copy
            for end, inwards, copy, limited, by in zip(
                (low, high),
                (within, -within),
                (-inf, inf),
                span.limited,
                span.by,
                strict=True,
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


def _build_several(parameters: TorqueDrive, context: Context) -> SeveralTorqueCrank:
    """Build the crank of a linkage with several inputs."""
    from linkage_ros.dynamics import (
        behind_play,  # local import: only with several
        MotorPlay,  # local import: only with several
        motors_of,  # local import: only with several
    )
    from linkage_ros.stages.drives.several_torques import (
        SeveralTorqueCrank,  # local import: only with several
    )

    mechanics, inputs = context.mechanics, context.closure.linkage.inputs
    uses = tuple(parameters.for_input(driven.joint) for driven in inputs)
    keys = [parameters.key_for(driven.joint, 'motor') for driven in inputs]
    built = [
        _build_motor(use.motor, driven.limits.effort, key) if use.motor else None
        for use, driven, key in zip(uses, inputs, keys, strict=True)
    ]
    mechanism, start = _build_mechanism(parameters, uses, context)
    plays = {
        index: MotorPlay(use.play.width, use.play.inertia, use.play.restitution)
        for index, use in enumerate(uses)
        if use.play
    }
    for index, (motor, key) in enumerate(zip(built, keys, strict=True)):
        if motor:
            # What it moves if the other inputs are free.
            alone = 1.0 / start.terms.mobility[index][index]
            least = plays[index].inertia if index in plays else alone
            motor.check_step(least, parameters.method, parameters.step, key)
    mechanics.check_curves_at(start.terms, parameters.method, parameters.step)
    if mechanics.applied:
        mobility = start.terms.mobility
        mechanics.applied.check_step_at(start.value, mobility, parameters.method, parameters.step)
    drives = [*range(len(inputs))]
    for at, index in enumerate(plays, len(inputs)):
        drives[index] = at
    motors = motors_of(built, drives)
    moved = motors.mount_on(behind_play(mechanism, plays) if plays else mechanism)
    begin = moved.state_at(*([*of, *[of[n] for n in plays]] for of in (start.value, start.rate)))
    return SeveralTorqueCrank(moved, begin, uses, context, motors)


def _build_mechanism(
    parameters: TorqueDrive, uses: Sequence[TorqueDrive], context: Context
) -> tuple[SeveralDofMechanism, SeveralMotion]:
    """Return what several inputs move, without their motors, and its start."""
    from linkage_ros.dynamics import SeveralDofMechanism  # local import: only with several

    mechanics, inputs = context.mechanics, context.closure.linkage.inputs
    limits = context.hard_limited.linkage.inputs
    terms, pressing = mechanics.input_equation, None
    if mechanics.friction.load_dependent_joint:
        pressing = context.reactions.pressing
        terms = pressing.mount_on(terms)
    mechanism = SeveralDofMechanism(
        terms,
        METHODS[parameters.method].step,
        tuple((driven.limits.low, driven.limits.high) for driven in limits),
        parameters.restitution,
        mechanics.applied.laws if mechanics.applied else (),
        frictions=mechanics.dry_frictions,
        joint_stops=mechanics.joint_stops,
        pressing=pressing,
    )
    start = mechanism.state_at([use.start for use in uses], [use.rate for use in uses])
    if start is None:
        values = ', '.join(f'{use.start:g} {i.unit}' for use, i in zip(uses, inputs, strict=True))
        raise DefinitionError(
            parameters.key_for(inputs[0].joint, 'start'),
            f'at {values} nothing can be moved: beyond a stop, a toggle, or no inertia',
            f'start elsewhere, as inputs: {{{inputs[0].joint}: {{start: 0.1}}}}',
        )
    inertia = start.terms.total_inertia
    of_motors = sum(use.play.inertia for use in uses if use.play)
    most = inertia / parameters.stop_margin + of_motors
    return replace(mechanism, most_inertia=most), start
