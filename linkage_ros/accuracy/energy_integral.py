# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""
State of a linkage with one degree of freedom after some time, from its energy, without steps.

Without friction, damping and commands the energy E is constant. So the rate follows from the
position, and the time from the position by an integral::

    ½·I(q)·q̇² + V(q) = E          t = ∫ dq/q̇ = ∫ √(I/(2·(E − V))) dq

I and V are summed over the links in extended precision, from the reference's positions and rates.
If the crank turns fully, 1/q̇ is periodic in q. If it swings between q₁ and q₂, the substitution
q = (q₁ + q₂)/2 − (q₂ − q₁)/2·cos φ makes dt/dφ periodic and removes the roots at both ends. A
Fourier series, fitted to equidistant positions with as many terms as needed, is integrated term by
term: it converges geometrically, for any number of turns.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from linkage_ros.accuracy.reference import Reference, SingularError
from linkage_ros.dynamics.loads import Loads
from linkage_ros.kinematics.linkage import GROUND, Linkage
from mpmath import MPContext

_DIGITS = 30
_TERMS = (32, 64, 128, 256, 512, 1024)
_ENOUGH = 1e-18
"""Bound of the last terms of a series, relative to its mean."""


class NoReferenceError(ArithmeticError):
    """The series does not converge, or does not apply to the motion."""


class State(NamedTuple):
    """Value and rate of the input, in [rad] or [m], and [rad/s] or [m/s]."""

    value: float
    rate: float


class ExactEnergy:
    """
    The energy of a linkage with one input and masses, in extended precision.

    Its loads include no dampers.
    """

    def __init__(self, linkage: Linkage, loads: Loads) -> None:
        self.mp = MPContext()
        self.mp.dps = _DIGITS + 10
        self._linkage, self._loads = linkage, loads
        self._reference = Reference(linkage, _DIGITS)

    def inertia_and_potential(self, value: Any) -> tuple[Any, Any]:
        """Return I, in [kg·m²] or [kg], and V, in [J], at a value of the input."""
        mp = self.mp
        try:
            links = self._reference.solve((value,)).links
        except SingularError as error:
            raise NoReferenceError(f'it passes a singular pose: {error}') from None

        def moved(link: str, point: tuple[float, float]) -> tuple[Any, Any]:
            """Return the position of a point of a link, and its derivative by the input."""
            arm = mp.mpc(*point)
            if link == GROUND:
                return arm, mp.mpc(0)
            (angle, x, y), (turn, along, up) = links[link][:2]
            arm = arm * mp.expj(angle)
            return mp.mpc(x, y) + arm, mp.mpc(along, up) + 1j * turn * arm

        inertia, potential = mp.mpf(self._loads.drive_inertia), mp.mpf(0)
        gravity = mp.mpc(*self._loads.gravity)
        for link, body in self._linkage.masses.items():
            if link == GROUND:
                continue
            place, velocity = moved(link, body.center)
            inertia += body.mass * abs(velocity) ** 2 + body.inertia * links[link][1][0] ** 2
            potential -= body.mass * (gravity.real * place.real + gravity.imag * place.imag)
        for spring in self._loads.springs:
            start, end = (
                moved(link, self._linkage.links[link][point])[0] for link, point in spring.ends
            )
            potential += spring.stiffness * (abs(end - start) - spring.free_length) ** 2 / 2
        return inertia, potential


def turned(energy: ExactEnergy, start: State, seconds: float) -> State:
    """
    Return the state of a crank that keeps turning after some time.

    Parameters
    ----------
    energy
        Energy of its linkage.
    start
        State at the start, fast enough to pass every position.
    seconds
        The time, in [s].

    Raises
    ------
    NoReferenceError
        If it does not turn fully, or the series does not converge.

    """
    mp = energy.mp
    begin, way = mp.mpf(start.value), 1 if start.rate > 0.0 else -1
    inertia, potential = energy.inertia_and_potential(begin)
    whole = inertia * mp.mpf(start.rate) ** 2 / 2 + potential

    def slowness(angle: Any) -> Any:
        inertia, potential = energy.inertia_and_potential(begin + way * angle)
        if whole <= potential:
            raise NoReferenceError('the crank does not turn round')
        return mp.sqrt(inertia / (2 * (whole - potential)))

    angle = _reached(mp, _Series(mp, slowness), seconds)
    return State(float(begin + way * angle), way / float(slowness(angle)))


def swung(energy: ExactEnergy, low: float, high: float, seconds: float) -> State:
    """
    Return the state of an input that swings from rest at one position, after some time.

    Parameters
    ----------
    energy
        Energy of its linkage.
    low
        Position at the start, at rest, in [rad] or [m].
    high
        Approximate position at which it turns back; the exact one is computed.
    seconds
        The time, in [s].

    Raises
    ------
    NoReferenceError
        If it does not turn back there, or the series does not converge.

    """
    mp = energy.mp
    first = mp.mpf(low)
    whole = energy.inertia_and_potential(first)[1]
    near = mp.mpf(high)
    last = mp.findroot(
        lambda value: energy.inertia_and_potential(value)[1] - whole,
        (near, near * (1 + mp.mpf(10) ** -6) + mp.mpf(10) ** -9),
        tol=mp.mpf(10) ** (-2 * _DIGITS),
        verify=False,
    )
    middle, half = (first + last) / 2, (last - first) / 2

    def slowness(phase: Any) -> Any:
        inertia, potential = energy.inertia_and_potential(middle - half * mp.cos(phase))
        if whole <= potential:
            raise NoReferenceError('the input does not swing freely')
        return abs(half * mp.sin(phase)) * mp.sqrt(inertia / (2 * (whole - potential)))

    phase = _reached(mp, _Series(mp, slowness), seconds)
    value = middle - half * mp.cos(phase)
    rate = half * mp.sin(phase) / slowness(phase)
    return State(float(value), float(rate))


class _Series:
    """
    The Fourier series of a function with the period 2π.

    Samples lie between the multiples of π/n, never on them.
    """

    def __init__(self, mp: MPContext, function: Callable[[Any], Any]) -> None:
        self.mp = mp
        for count in _TERMS:
            values = [function(mp.pi * (2 * k + 1) / count) for k in range(count)]
            self.mean = mp.fsum(values) / count
            self.terms = [self._term(values, order) for order in range(1, count // 2)]
            tail = max(abs(part) for pair in self.terms[-4:] for part in pair)
            if tail <= _ENOUGH * abs(self.mean):
                return
        raise NoReferenceError(f'{_TERMS[-1]} terms are too few')

    def integral(self, at: Any) -> Any:
        """Return the integral from 0."""
        mp = self.mp
        return self.mean * at + mp.fsum(
            (a * mp.sin(k * at) + b * (1 - mp.cos(k * at))) / k
            for k, (a, b) in enumerate(self.terms, 1)
        )

    def value(self, at: Any) -> Any:
        """Return the value of the function."""
        mp = self.mp
        return self.mean + mp.fsum(
            a * mp.cos(k * at) + b * mp.sin(k * at) for k, (a, b) in enumerate(self.terms, 1)
        )

    def _term(self, values: list[Any], order: int) -> tuple[Any, Any]:
        """Return the coefficients of cos and sin of an order."""
        mp, count = self.mp, len(values)
        step = mp.expj(2 * mp.pi * order / count)
        turn, total = mp.expj(mp.pi * order / count), mp.mpc(0)
        for value in values:
            total += value * turn
            turn *= step
        return 2 * total.real / count, 2 * total.imag / count


def _reached(mp: MPContext, series: _Series, seconds: float) -> Any:
    """Return the argument at which the integral of a series equals some time."""
    time = mp.mpf(seconds)
    at = time / series.mean
    for _ in range(100):
        step = (series.integral(at) - time) / series.value(at)
        at -= step
        if abs(step) <= mp.mpf(10) ** -_DIGITS * abs(at):
            return at
    raise NoReferenceError('the time is not found')
