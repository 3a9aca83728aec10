# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The crank of the torque drive of several inputs, each with its own command and motor.

A message commands the inputs that it names; the commands of the others go on. Each command is
valid for the same time from its own arrival.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import isfinite
from typing import Any, TYPE_CHECKING

from linkage_ros.dynamics import InputLawTerm, InputTerms, InputVector, LARGEST, MotorLaw
from linkage_ros.messages import EffortsCommand, Rejection
from linkage_ros.stages.drives.drive import CrankAtRest, CrankState
from linkage_ros.stages.drives.torque_crank import NEVER, TorqueCrank

if TYPE_CHECKING:
    from linkage_ros.dynamics import HeldWrench, Motor, SeveralDofMechanism

Equation = Callable[[Sequence[float], Sequence[float]], InputTerms | None]


class SeveralTorqueCrank(TorqueCrank):
    """
    A mechanism whose inputs are moved by commanded efforts.

    Commands of an input are clipped to ± its part of ``most_each``, in [N·m] or [N], or for a
    motor in [A] or [V]. ``use`` has the parameters of the drive. ``motors`` has the motor of each
    input, with the step to which its command is rounded; None for an input without one.
    """

    __slots__ = (
        '_brake',
        '_commands',
        '_most_each',
        '_motors',
        '_newest_inputs',
        '_stamps',
        '_untils',
    )

    def __init__(
        self,
        mechanism: SeveralDofMechanism,
        start: Any,
        use: Any,
        period: int,
        most_each: tuple[float, ...],
        motors: tuple[tuple[Motor, float] | None, ...],
        wrenches: tuple[HeldWrench, ...] = (),
        exerts_effort: bool = False,
    ) -> None:
        self._motors, self._most_each, self._brake = motors, most_each, use.brake
        driven = [number for number, motor in enumerate(motors) if motor]
        if driven:
            mechanism = replace(
                mechanism,
                terms=_with_motors(mechanism.terms, driven),
                laws=(*mechanism.laws, *(MotorLaw() for _ in driven)),
            )
            start = mechanism.state_at(start.value, start.rate)
        super().__init__(
            mechanism, start, replace(use, motor=None), period,
            wrenches=wrenches, exerts_effort=exerts_effort,
        )  # fmt: skip
        self._commands: list[float | None] = [None] * len(motors)
        self._untils = [NEVER] * len(motors)
        self._stamps = [0] * len(motors)
        self._newest_inputs: tuple[int, ...] = ()
        self._acting = self._idle = self._actuation()

    @property
    def stamps(self) -> tuple[int, ...]:
        """Arrival of the newest good command of each input, in [ns]; 0 before the first."""
        return tuple(self._stamps)

    @property
    def newest_inputs(self) -> tuple[int, ...]:
        """Numbers of the inputs that the last good message commands."""
        return self._newest_inputs

    def offer(  # type: ignore[override]
        self, command: EffortsCommand, now: int
    ) -> Rejection | None:
        """Take commands at a time [ns], or return why they are rejected; then nothing changes."""
        named = [(n, effort) for n, effort in enumerate(command.efforts) if effort is not None]
        for _, effort in named:
            if not -LARGEST <= effort <= LARGEST:
                if isfinite(effort):
                    return Rejection.EFFORT_TOO_LARGE
                return Rejection.EFFORT_NOT_FINITE
        self.stamp = now
        if self._time >= 0:
            self._advance(now)
        for number, effort in named:
            most = self._most_each[number]
            self.saturated += not -most <= effort <= most
            self._commands[number] = min(max(effort, -most), most)
            self._untils[number] = now + self.max_age
            self._stamps[number] = now
        self._newest_inputs = tuple([number for number, _ in named])
        acting = self._actuation()
        if self._time >= 0 and acting != self._acting and now > self._time:
            self._go_to(now)
        self._acting, self._until = acting, min(self._untils)
        return None

    def _expire(self, end: int) -> None:
        for number, until in enumerate(self._untils):
            if until == end:
                self._commands[number], self._untils[number] = None, NEVER
        self._acting, self._until = self._actuation(), min(self._untils)

    def _actuation(self) -> tuple[Any, InputVector, tuple[float, ...]]:
        """Return mechanism, forces on its inputs and brakes under the commands."""
        mechanism, forces = self._mechanism, [0.0] * len(self._motors)
        laws: list[MotorLaw] = []
        for number, (given, command) in enumerate(zip(self._motors, self._commands, strict=True)):
            if given is None:
                forces[number] = command or 0.0
                continue
            motor, quantum = given
            if command is None:
                laws.append(MotorLaw())
                continue
            rounded = round(command / quantum) * quantum if quantum else command
            laws.append(motor.effort_law(rounded))
        if laws:
            others = len(mechanism.laws) - len(laws)
            mechanism = replace(mechanism, laws=(*mechanism.laws[:others], *laws))
        brakes = tuple([self._brake if each is None else 0.0 for each in self._commands])
        return mechanism, InputVector(forces), brakes

    def _crank_state(self, motion: Any, acceleration: InputVector) -> CrankState:
        values = tuple(motion.value), tuple(motion.rate), tuple(acceleration)
        if not self.exerts_effort:
            return CrankState(*values, 0)
        # A stop may bear a part of an effort, which then does not follow from the motion.
        mechanism, forces, brakes = self._acting
        efforts: list[float] = list(forces)
        driven = [number for number, motor in enumerate(self._motors) if motor]
        # The laws of the motors are the last ones.
        for number, law in zip(reversed(driven), reversed(mechanism.laws), strict=False):
            rate = motion.rate[number]
            efforts[number] = law.force(law.segment(0.0, rate, 0.0), 0.0, rate, 0.0)
        state = CrankAtRest(*values, 0)
        held = zip(efforts, brakes, strict=True)
        state.bearing = tuple(
            end for effort, brake in held for end in (effort - brake, effort + brake)
        )
        return state


def _with_motors(terms: Equation, driven: Sequence[int]) -> Equation:
    """Return an equation of motion with the laws of the motors of some inputs after all others."""

    def equation_with_motors(values: Sequence[float], rates: Sequence[float]) -> InputTerms | None:
        there = terms(values, rates)
        if there is None:
            return None
        laws = tuple(
            InputLawTerm(tuple(float(n == number) for n in range(len(rates))), 0.0, rates[number])
            for number in driven
        )
        return there._replace(laws=(*there.laws, *laws))

    return equation_with_motors
