# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The motors of several inputs: each with its own command, gear and winding.

A motor gives its effort as a law over the rate of what it drives (`linkage_ros.dynamics.motor`),
which is one more law of the equation of motion. The friction in its gear that acts at rest too is
that of a brake. Where windings have an inductance, their currents are states: a step of the
mechanism lies between two halves of a step of all currents (`linkage_ros.dynamics.winding`).

Play between a motor and its input is the stop of a joint between two freedoms: they meet, press on
each other and part as any joint and its stops do (`linkage_ros.dynamics.several_freedoms`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.dynamics.dry_friction import JointStop, Slip
from linkage_ros.dynamics.equation import InputLawTerm, InputTerms
from linkage_ros.dynamics.motor import Motor, MotorLaw
from linkage_ros.dynamics.several_freedoms import InputVector, SeveralDofMechanism

if TYPE_CHECKING:
    from linkage_ros.dynamics.winding import Winding, WoundMechanism

Commands = Sequence[float | None]
"""The command of each input in its unit; None without one."""


class MotorPlay(NamedTuple):
    """The play between a motor and the input that it drives."""

    width: float  # In [rad] or [m]
    inertia: float  # The motor's, seen at the input, in [kg·m²] or [kg]
    restitution: float  # Ratio of the relative rates after and before they meet, 0 to 1


def behind_play(
    mechanism: SeveralDofMechanism, plays: Mapping[int, MotorPlay]
) -> SeveralDofMechanism:
    """
    Return a mechanism of which some inputs, by number, have play to their motors.

    Each such motor is one more freedom, in the order of the inputs; within the play nothing
    couples it to the others, and at its ends a motor and its input meet as at a hard stop.
    """
    terms, count, more = mechanism.terms, len(mechanism.stops), (0.0,) * len(plays)

    def equation_with_motors(values: Sequence[float], rates: Sequence[float]) -> InputTerms | None:
        there = terms(values[:count], rates[:count])
        if there is None:
            return None
        matrix = there.matrix
        mobility = [row + more for row in there.mobility]
        limited = [slip._replace(levers=slip.levers + more) for slip in there.limited]
        for at, (driven, play) in enumerate(plays.items(), count):
            own = tuple(float(n == at) for n in range(count + len(more)))
            matrix += (*own[:at], play.inertia)
            mobility.append(tuple(lever / play.inertia for lever in own))
            levers = tuple(lever - (n == driven) for n, lever in enumerate(own))
            gap, opening = values[at] - values[driven], rates[at] - rates[driven]
            limited.append(Slip(levers, opening, 0.0, gap))
        return InputTerms(
            matrix,
            tuple(mobility),
            there.bias + more,
            tuple([law._replace(levers=law.levers + more) for law in there.laws]),
            tuple([slip._replace(levers=slip.levers + more) for slip in there.slips]),
            tuple(limited),
            there.presses,
        )

    ends = [
        JointStop(-0.5 * play.width, 0.5 * play.width, None, play.restitution)
        for play in plays.values()
    ]
    return replace(
        mechanism,
        terms=equation_with_motors,
        stops=(*mechanism.stops, *((-inf, inf) for _ in plays)),
        joint_stops=(*mechanism.joint_stops, *ends),
    )


@dataclass(frozen=True, slots=True)
class InputMotors:
    """What drives several inputs: the motor of each, or None where a command is the effort."""

    motors: tuple[Motor | None, ...]
    # The number of what each of them drives, among the freedoms of the mechanism.
    drives: tuple[int, ...]

    @property
    def _driving(self) -> list[tuple[int, Motor]]:
        """Return the motors, each with the number of what it drives, in the order of the laws."""
        driven_motors = zip(self.drives, self.motors, strict=True)
        return [(at, motor) for at, motor in driven_motors if motor]

    def mount_on(self, mechanism: SeveralDofMechanism) -> SeveralDofMechanism:
        """Return a mechanism with these motors, switched off: with their laws after all others."""
        terms, driven = mechanism.terms, [at for at, _ in self._driving]

        def equation_with_motors(
            values: Sequence[float], rates: Sequence[float]
        ) -> InputTerms | None:
            there = terms(values, rates)
            if there is None:
                return None
            laws = tuple(
                InputLawTerm(tuple(float(n == at) for n in range(len(rates))), 0.0, rates[at])
                for at in driven
            )
            return there._replace(laws=(*there.laws, *laws))

        if not driven:
            return mechanism
        laws = (*mechanism.laws, *(MotorLaw() for _ in driven))
        return replace(mechanism, terms=equation_with_motors, laws=laws)

    def drive_by(
        self, mechanism: SeveralDofMechanism, commands: Commands, brake: float = 0.0
    ) -> tuple[SeveralDofMechanism, InputVector, InputVector]:
        """
        Return a mechanism with these motors under commands.

        The second result has the forces of inputs without a motor, the third what holds them: a
        brake where there is no command, and the friction of the gears that acts at rest too, in
        [N·m] or [N].
        """
        forces, brakes = [0.0] * len(mechanism.stops), [0.0] * len(mechanism.stops)
        laws: list[MotorLaw] = []
        for at, motor, command in zip(self.drives, self.motors, commands, strict=True):
            brakes[at] = brake if command is None else 0.0
            if motor is None:
                forces[at] = command or 0.0
                continue
            law = MotorLaw() if command is None else motor.effort_law(command)
            brakes[at] += law.holding
            laws.append(law)
        if laws:
            mechanism = replace(mechanism, laws=(*self._loads_of(mechanism), *laws))
        return mechanism, InputVector(forces), InputVector(brakes)

    def efforts(
        self, mechanism: Any, motion: Any, forces: InputVector, brakes: InputVector
    ) -> tuple[list[float], InputVector]:
        """Return what drives give with forces, without their gears, and what holds at rest."""
        efforts: list[float] = [*forces]
        for at, law in self._laws_of(mechanism):
            rate = motion.rate[at]
            efforts[at] += law.force(law.segment(0.0, rate, 0.0), 0.0, rate, 0.0)
        return efforts, brakes

    def torques(self, mechanism: Any, motion: Any) -> dict[int, float]:
        """Return the torque of motors before their gears, in [N·m], by what they drive."""
        return {at: law.torque(motion.rate[at]) for at, law in self._laws_of(mechanism)}

    def _loads_of(self, mechanism: SeveralDofMechanism) -> tuple[Any, ...]:
        """Return the laws that are not motors."""
        return mechanism.laws[: len(mechanism.laws) - len(self._driving)]

    def _laws_of(self, mechanism: SeveralDofMechanism) -> list[tuple[int, Any]]:
        driven = [at for at, _ in self._driving]
        first = len(self._loads_of(mechanism))
        return [*zip(driven, mechanism.laws[first:], strict=True)]


@dataclass(frozen=True, slots=True)
class InputWindings:
    """Motors of several inputs of which some have a winding with an inductance."""

    motor: InputMotors  # The motors, those with windings under a command of current
    windings: tuple[Winding | None, ...]

    @property
    def drives(self) -> tuple[int, ...]:
        """Return the number of what each motor drives."""
        return self.motor.drives

    @property
    def idle(self) -> tuple[float | None, ...]:
        """Return the currents of windings without commands; of the others no command."""
        return tuple(0.0 if winding else None for winding in self.windings)

    def mount_on(self, mechanism: SeveralDofMechanism) -> WoundMechanism:
        """Return a mechanism with these motors, without commands."""
        from linkage_ros.dynamics.winding import (
            WoundMechanism,  # local import: only with an inductance
        )

        return WoundMechanism(self.motor.mount_on(mechanism), self, (None,) * len(self.windings))

    def drive_by(
        self, mechanism: WoundMechanism, commands: Commands, brake: float = 0.0
    ) -> tuple[WoundMechanism, InputVector, InputVector]:
        """Return a mechanism under commands, no further force, and brakes without a command."""
        wanted = [
            winding.motor.current_for(command)
            if winding and winding.command == 'effort' and command is not None
            else command
            for winding, command in zip(self.windings, commands, strict=True)
        ]
        brakes = [0.0] * len(mechanism.mechanism.stops)
        for at, command in zip(self.drives, commands, strict=True):
            brakes[at] = brake if command is None else 0.0
        nothing = InputVector([0.0] * len(brakes))
        return replace(mechanism, command=tuple(wanted)), nothing, InputVector(brakes)

    def current_after(
        self, begin: Commands, rates: Sequence[float], commands: Commands, seconds: float
    ) -> tuple[float | None, ...]:
        """Return the currents after some time at constant rates; of the others their commands."""
        running = zip(self.windings, self.drives, begin, commands, strict=True)
        return tuple(
            winding.current_after(current or 0.0, rates[at], command, seconds)
            if winding
            else command
            for winding, at, current, command in running
        )

    def efforts(
        self, mechanism: Any, motion: Any, forces: InputVector, brakes: InputVector
    ) -> tuple[list[float], InputVector]:
        """Return what drives give as in `InputMotors.efforts`, by their currents."""
        under, push, holding = self.motor.drive_by(mechanism.mechanism, motion.current)
        return self.motor.efforts(under, motion.moved, forces + push, brakes + holding)

    def torques(self, mechanism: Any, motion: Any) -> dict[int, float]:
        """Return torques as in `InputMotors.torques`, by their currents."""
        under, _, _ = self.motor.drive_by(mechanism.mechanism, motion.current)
        return self.motor.torques(under, motion.moved)


def motors_of(
    built: Sequence[Motor | Winding | None], drives: Sequence[int]
) -> InputMotors | InputWindings:
    """Return the motors of several inputs, each with the number of what it drives."""
    windings = tuple(None if isinstance(motor, Motor) else motor for motor in built)
    plain = [
        motor if motor is None or isinstance(motor, Motor) else motor.motor for motor in built
    ]
    motors = InputMotors(tuple(plain), tuple(drives))
    return InputWindings(motors, windings) if any(windings) else motors
