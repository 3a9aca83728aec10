# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The inductance of a motor's winding: the current is a state, and follows the voltage with a lag.

With the inductance L, and else as in `linkage_ros.dynamics.motor`::

    L·di/dt = V − R·i − k·ω

A command of voltage is V, within the supply ±U. For a command of current or effort the amplifier
drives the current to what is commanded, as fast as the supply lets it: at each instant with a V
within ±U. A limit of the current holds it there. Without a valid command there is no current.

A step of the mechanism lies between two halves of a step of the current (G. Strang, On the
construction and comparison of difference schemes, SIAM J. Numer. Anal. 5, 1968): the mechanism
moves under a constant current by its own method, and the current is exact at a constant rate. So
the whole is of order 2, whatever the method; a step longer than L/R is refused.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import expm1, inf, sqrt
from typing import Any, ClassVar, NamedTuple

from linkage_ros.dynamics.integrators import check_step
from linkage_ros.dynamics.motor import Motor
from linkage_ros.errors import DefinitionError


@dataclass(frozen=True, slots=True)
class Winding:
    """A motor whose winding has an inductance."""

    motor: Motor  # The motor under a command of current, without a limit of voltage
    inductance: float  # L, in [H]
    supply: float  # U, in [V]
    # What is commanded: 'effort' in [N·m] or [N], 'current' in [A], or 'voltage' in [V].
    command: str
    idle: ClassVar[float] = 0.0
    """The current at the first tick, in [A]."""

    @property
    def ratio(self) -> float:
        """Return the turns of the motor for one of the input, in [rad/rad] or [rad/m]."""
        return self.motor.ratio

    def mount_on(self, mechanism: Any) -> WoundMechanism:
        """Return a mechanism with this motor at its input, without a command."""
        return WoundMechanism(self.motor.mount_on(mechanism), self)

    def drive_by(
        self, mechanism: WoundMechanism, command: float
    ) -> tuple[WoundMechanism, float, float]:
        """Return a mechanism under a command, and no further force or friction on its input."""
        if self.command == 'effort':
            command = self.motor.current_for(command)
        return replace(mechanism, command=command), 0.0, 0.0

    def torque(self, _mechanism: WoundMechanism, motion: WoundMotion) -> float:
        """Return the torque before the gear, in [N·m]."""
        current: float = motion.current
        return self.motor.constant * current

    def at_rest(self, _mechanism: WoundMechanism, motion: WoundMotion) -> tuple[float, float]:
        """Return the effort at rest, and what the gear holds."""
        law = self.motor.effort_law(motion.current)
        return law.resting, law.holding

    def check_step(
        self, inertia: float, method: str, step: float, key: str = 'drive.torque.motor'
    ) -> None:
        """
        Refuse a motor whose current, alone or with the rate, is too fast for the integration.

        Parameters and error are as in `Motor.check_step`.
        """
        motor = self.motor
        if motor.resistance and self.inductance / motor.resistance < step:
            raise DefinitionError(
                f'{key}.inductance',
                f'the current changes within {self.inductance / motor.resistance:.3g} s, and a '
                f'step is {step:g} s',
                'leave it out, so that the current follows at once, or write a shorter step',
            )
        coupling = motor.constant * motor.ratio / sqrt(motor.backward * inertia)
        swings = coupling / sqrt(self.inductance)
        slows = coupling**2 / motor.resistance if motor.resistance else inf
        check_step(
            key,
            min(swings, slows),
            method,
            step,
            'its current and its rate change too fast',
            'add the inertia of its rotor to loads.drive_inertia',
        )

    def current_after(
        self, begin: float, rate: float, command: float | None, seconds: float
    ) -> float:
        """
        Return the current, in [A], after some seconds at a constant rate of the input.

        ``begin`` is the current before, in [A]; the rate is in [rad/s] or [m/s], the command in
        [A] or [V], None for no current.
        """
        if command is None:
            return 0.0
        low, high = -self.supply, self.supply
        if self.command == 'voltage':
            low = high = min(max(command, low), high)
        least, most = (self._current_after(begin, rate, volt, seconds) for volt in (low, high))
        current = min(max(command, least), most)
        return min(max(current, -self.motor.max_current), self.motor.max_current)

    def _current_after(self, begin: float, rate: float, voltage: float, seconds: float) -> float:
        """Return the current after some time at a constant voltage."""
        push = voltage - self.motor.constant * self.motor.ratio * rate
        resistance, times = self.motor.resistance, seconds / self.inductance
        if not resistance * times:
            return begin + push * times
        return begin + (begin - push / resistance) * expm1(-resistance * times)


class WoundMotion(NamedTuple):
    """A state of a mechanism and of the current that drives it; of several inputs one of each."""

    moved: Any  # The state of the mechanism
    current: Any  # The current in the winding, in [A]

    @property
    def value(self) -> Any:
        """Return the input's value, in [rad] or [m]."""
        return self.moved.value

    @property
    def rate(self) -> Any:
        """Return the input's rate, in [rad/s] or [m/s]."""
        return self.moved.rate

    @property
    def motor(self) -> Any:
        """Return the state of the motor: behind play its own, else the state of the input."""
        return getattr(self.moved, 'motor', self.moved)


@dataclass(frozen=True, slots=True)
class WoundMechanism:
    """A mechanism that is driven by the current in a winding; of several inputs in one of each."""

    mechanism: Any  # What moves, with its motor
    winding: Any  # The winding
    command: Any = None  # The command, in [A] or [V]; None if there is none

    @property
    def stops(self) -> Any:
        """Lower and upper stop of the input, in [rad] or [m]."""
        return self.mechanism.stops

    def state_at(self, value: Any, rate: Any) -> WoundMotion | None:
        """Return a state without a current, or None if there is none."""
        moved = self.mechanism.state_at(value, rate)
        return None if moved is None else WoundMotion(moved, self.winding.idle)

    def acceleration(self, motion: WoundMotion, force: Any, brake: Any, time: float = 0.0) -> Any:
        """Return q̈; the parameters are as in `SingleDofMechanism.advance`."""
        under, push, holding = self.winding.motor.drive_by(self.mechanism, motion.current)
        return under.acceleration(motion.moved, force + push, brake + holding, time)

    def advance(
        self, motion: WoundMotion, seconds: float, force: Any, brake: Any, time: float = 0.0
    ) -> WoundMotion:
        """Advance a state by one step; the parameters are as in `SingleDofMechanism.advance`."""
        current_after, half = self.winding.current_after, 0.5 * seconds
        current = current_after(motion.current, motion.motor.rate, self.command, half)
        under, push, holding = self.winding.motor.drive_by(self.mechanism, current)
        moved = WoundMotion(
            under.advance(motion.moved, seconds, force + push, brake + holding, time), current
        )
        current = current_after(current, moved.motor.rate, self.command, half)
        return moved._replace(current=current)
