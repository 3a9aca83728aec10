# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A DC motor with a gear: what it gives at the input, as a law over the input's rate.

The current follows the voltage at once (no inductance). With the torque constant k, the resistance
R, the ratio N and the rate of the motor ω = N·q̇::

    i = V/R − k·ω/R,  i,  or  τ/(k·N·η)       for a command of voltage V, current i or effort τ
    i within ±iₘ, then within (±U − k·ω)/R    the limits of the amplifier and its supply U
    T = k·i
    Q = N·T·η  if T·ω ≥ 0,  N·T/ηᵦ otherwise  at the input

The efficiencies of the gear are η while power flows to the input, and ηᵦ while it flows back
(H. Giberti, S. Cinquemani, G. Legnani, Effects of transmission mechanical characteristics on the
choice of a motor-reducer, Mechatronics 20, 2010; for the motor itself: A. Hughes, B. Drury,
Electric Motors and Drives, 4th ed., 2013, ch. 3). At rest the motor holds any load between both
values of Q: this is friction of N·|T|·(1/ηᵦ − η)/2 about their middle.

In each segment of the rate, Q is linear. Segments end where a limit begins or ceases to act and,
unless both efficiencies are 1, where T or ω changes sign. There the integrator cuts its step.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from math import copysign, inf
from typing import Any, TYPE_CHECKING, TypeVar

from linkage_ros.dynamics.equation import Terms
from linkage_ros.dynamics.integrators import check_step
from linkage_ros.dynamics.laws import LawTerm
from linkage_ros.dynamics.motion import LARGEST, SingleDofMechanism

if TYPE_CHECKING:
    from linkage_ros.dynamics.two_masses import TwoMasses

Driven = TypeVar('Driven', SingleDofMechanism, 'TwoMasses')

_AT_INPUT = LawTerm(1.0, 0.0, 1.0)
_RESTING = -1

Line = tuple[float, float]
"""A function of the rate, by its value at a rate of 0 and its slope."""


@dataclass(frozen=True, slots=True)
class MotorLaw:
    """The effort of a motor under one command, over the rate of the input."""

    ends: tuple[float, ...] = ()  # The rates between its segments, in [rad/s] or [m/s], in order
    # The effort in each segment, in [N·m] or [N], without the friction in the gear that acts at
    # rest too.
    lines: tuple[Line, ...] = ((0.0, 0.0),)
    resting: float = 0.0  # The effort at rest, without this friction
    holding: float = 0.0  # This friction: the most that the gear holds at rest
    # The torque of the motor before the gear in each segment, in [N·m].
    torques: tuple[Line, ...] = ((0.0, 0.0),)
    stalled: float = 0.0  # The torque at rest

    def segment(self, _value: float, rate: float, _time: float) -> int:
        """Return how many ends a rate has passed; -1 at rest."""
        return bisect_right(self.ends, rate) if rate else _RESTING

    def margin(self, segment: int, _value: float, rate: float, _time: float) -> float:
        """Return the distance from the nearer end; infinity for a motor that stands."""
        if segment == _RESTING:
            return inf
        below = rate - self.ends[segment - 1] if segment else inf
        above = self.ends[segment] - rate if segment < len(self.ends) else inf
        return min(below, above)

    def force(self, segment: int, _value: float, rate: float, _time: float) -> float:
        """Return the effort by the line of a segment."""
        return self.resting if segment == _RESTING else _evaluate_line(self.lines[segment], rate)

    def torque(self, rate: float) -> float:
        """Return the torque of the motor before the gear, in [N·m], at a rate of the input."""
        segment = self.segment(0.0, rate, 0.0)
        return self.stalled if segment == _RESTING else _evaluate_line(self.torques[segment], rate)


_OFF = MotorLaw()


@dataclass(frozen=True, slots=True)
class Motor:
    """A DC motor with a gear, and its amplifier."""

    constant: float  # k, in [N·m/A] or [V·s/rad]
    resistance: float  # R, in [Ω]; 0 only without commands of voltage and without a limit of it
    ratio: float  # N, in [rad/rad] or [rad/m]
    # η and ηᵦ.
    forward: float
    backward: float
    max_current: float  # iₘ, in [A]
    supply: float  # U, in [V]
    # What is commanded: 'effort' in [N·m] or [N], 'current' in [A], or 'voltage' in [V].
    command: str

    def mount_on(self, mechanism: Driven) -> Driven:
        """Return a mechanism with this motor at its input, switched off: without a current."""
        return mechanism.driven_by(
            lambda moved: replace(moved, terms=_with_motor(moved.terms), laws=(*moved.laws, _OFF))
        )

    def drive_by(self, mechanism: Driven, command: float) -> tuple[Driven, float, float]:
        """
        Return a mechanism with this motor under a command, in the unit of ``command``.

        The second result is a further force on the input: 0, since the motor is a law. The third
        is the friction of the gear that acts at rest too, as a brake, in [N·m] or [N].
        """
        law = self.effort_law(command)
        under = mechanism.driven_by(lambda moved: replace(moved, laws=(*moved.laws[:-1], law)))
        return under, 0.0, law.holding

    @staticmethod
    def torque(mechanism: Any, motion: Any) -> float:
        """Return the torque before the gear, in [N·m], under the command of a mechanism."""
        *_, law = getattr(mechanism, 'motor', mechanism).laws
        torque: float = law.torque(getattr(motion, 'motor', motion).rate)
        return torque

    @staticmethod
    def at_rest(mechanism: Any, _motion: Any) -> tuple[float, float]:
        """Return the effort at rest, and what the gear holds beyond the friction of `drive_by`."""
        *_, law = getattr(mechanism, 'motor', mechanism).laws
        return law.resting, 0.0

    def check_step(
        self, inertia: float, method: str, step: float, key: str = 'drive.torque.motor'
    ) -> None:
        """
        Refuse a motor whose rate follows the voltage faster than a step in [s] can follow.

        ``inertia`` is the least inertia of the equation of motion, in [kg·m²] or [kg]. The remedy
        is the longest step that carries it.
        """
        if self.command == 'voltage' or self._supply_limits():
            damping = -self._current_slope() * self.constant * self.ratio / self.backward
            check_step(
                key,
                damping / inertia,
                method,
                step,
                'it follows its voltage too fast',
                'add the inertia of its rotor to loads.drive_inertia',
            )

    def effort_law(self, command: float) -> MotorLaw:
        """Return the effort over the rate of the input, under a command."""
        wanted, supply = self._wanted_current(command), self._supply_limits()
        limits: list[Line] = [(-self.max_current, 0.0), (self.max_current, 0.0), *supply]
        lossy = self.forward < 1.0 or self.backward < 1.0
        crossings = {_crossing_rate(*pair) for pair in combinations([wanted, *limits], 2)}
        if lossy:
            crossings |= {0.0, *(_crossing_rate(line, (0.0, 0.0)) for line in (wanted, *limits))}
        rates = sorted(rate for rate in crossings if abs(rate) <= LARGEST)
        still = _evaluate_line(self._current_line(wanted, supply, 0.0), 0.0)
        to_input = self.ratio * self.constant
        holding = 0.5 * to_input * abs(still) * (1.0 / self.backward - self.forward)
        ends: list[float] = []
        lines: list[Line] = []
        torques: list[Line] = []
        begins = [-inf, *rates]
        for begin, at in zip(begins, _rates_between(rates), strict=True):
            start, slope = self._current_line(wanted, supply, at)
            drives = (start + slope * at) * at >= 0.0
            factor = to_input * (self.forward if drives else 1.0 / self.backward)
            line = factor * start + copysign(holding, at), factor * slope
            if not lines or line != lines[-1]:
                lines.append(line)
                torques.append((self.constant * start, self.constant * slope))
                ends.append(begin)
        resting = 0.5 * to_input * still * (1.0 / self.backward + self.forward)
        stalled = self.constant * still
        return MotorLaw(tuple(ends[1:]), tuple(lines), resting, holding, tuple(torques), stalled)

    def _wanted_current(self, command: float) -> Line:
        """Return the current that a command asks for, in [A]."""
        if self.command == 'voltage':
            voltage = min(max(command, -self.supply), self.supply)
            return voltage / self.resistance, self._current_slope()
        if self.command == 'current':
            return command, 0.0
        return self.current_for(command), 0.0

    def current_for(self, effort: float) -> float:
        """Return the current, in [A], that gives an effort at the input while it drives."""
        return effort / (self.constant * self.ratio * self.forward)

    def _supply_limits(self) -> tuple[Line, ...]:
        """Return the least and the greatest current by the supply; none if it has no limit."""
        if self.supply >= LARGEST:
            return ()
        most = self.supply / self.resistance
        return (-most, self._current_slope()), (most, self._current_slope())

    def _current_slope(self) -> float:
        return -self.constant * self.ratio / self.resistance

    def _current_line(self, wanted: Line, supply: tuple[Line, ...], rate: float) -> Line:
        """Return the line that the current follows about a rate of the input."""
        current = wanted
        if abs(_evaluate_line(wanted, rate)) > self.max_current:
            current = copysign(self.max_current, _evaluate_line(wanted, rate)), 0.0
        for side, limit in zip((-1.0, 1.0), supply, strict=False):
            if side * (_evaluate_line(current, rate) - _evaluate_line(limit, rate)) > 0.0:
                current = limit
        return current


def _with_motor(terms: Callable[[float], Terms | None]) -> Callable[[float], Terms | None]:
    """Return an equation of motion with the motor's law after all others."""

    def equation_with_motor(value: float) -> Terms | None:
        there = terms(value)
        return None if there is None else there._replace(laws=(*there.laws, _AT_INPUT))

    return equation_with_motor


def _evaluate_line(line: Line, rate: float) -> float:
    start, slope = line
    return start + slope * rate


def _crossing_rate(first: Line, second: Line) -> float:
    """Return the rate at which two lines cross; infinity if they are parallel."""
    slope = first[1] - second[1]
    return (second[0] - first[0]) / slope if slope else inf


def _rates_between(rates: list[float]) -> list[float]:
    """Return a rate before, between and after some rates in order."""
    if not rates:
        return [0.0]
    inner = [0.5 * (low + high) for low, high in pairwise(rates)]
    return [rates[0] - 1.0, *inner, rates[-1] + 1.0]
