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
A dyad whose loop Newton's method closes.

Its two unknowns p and q, angles or slides, close one loop of vectors, F(p, q) = 0, which is two
real equations. With × for the z component of the cross product::

    F_p·δp + F_q·δq = −F      δp = F_q × F/(F_p × F_q)      δq = F × F_p/(F_p × F_q)

Rates and accelerations solve the same for what F changes by while p and q keep their value, or
their rate. F_p × F_q is 0 where the dyad folds or stretches, and has the other sign in its other
assembly.
"""

from __future__ import annotations

from cmath import rect

from linkage_ros.kinematics.plane import cross
from linkage_ros.kinematics.rounding import UNIT_ROUNDOFF
from linkage_ros.solvers.loops import Loops, Vector

_STEPS = 12
"""Of Newton's method; a cold start takes up to ten."""

LEAST_SINE = 0.05
"""Sine of the angle between F_p and F_q below which the dyad is too near to folding."""

_ROUNDING = 16.0 * UNIT_ROUNDOFF


class NewtonDyad:
    """
    A dyad.

    Parameters
    ----------
    loops
        Its loop.
    tolerance
        What corrections of an angle are below at the end, in [rad].
    slide_tolerance
        Likewise of a slide, in the unit of the lengths.

    """

    __slots__ = ('_arms', '_constant', '_first', '_known', '_new', '_tolerances', '_two_arms')

    def __init__(self, loops: Loops, tolerance: float, slide_tolerance: float) -> None:
        self._first, second = loops.coordinates
        (vectors,) = loops.equations
        new = tuple(v for v in vectors if {self._first, second} & {*dict(v.turns), v.slide})
        known = [v for v in vectors if v not in new]
        self._new = new
        self._constant = sum((v.factor for v in known if not v.turns and v.slide < 0), 0j)
        single = [v for v in known if v.slide < 0 and len(v.turns) == 1 and v.turns[0][1] > 0.0]
        self._arms = tuple((v.factor, v.turns[0][0]) for v in single)
        self._known = tuple(
            v for v in known if v not in single and (v.turns or v.slide >= 0 or v.pin >= 0)
        )
        sliding = {v.slide for v in new}
        self._tolerances = tuple(
            max(slide_tolerance if k in sliding else tolerance, _ROUNDING)
            for k in (self._first, second)
        )
        by_turns = {v.turns: v.factor for v in new if v.slide < 0}
        turns = ((self._first, 1.0),), ((second, 1.0),)
        self._two_arms = None
        if len(new) == 2 and set(by_turns) == set(turns):
            self._two_arms = by_turns[turns[0]], by_turns[turns[1]]

    def close(self, x: list[float], pins: list[complex], p: float, q: float, sign: float) -> bool:
        """
        Append p and q to the coordinates, or say that there is nothing that could be.

        Parameters
        ----------
        x, pins
            What is known; of pins what iterations have placed.
        p, q
            Where to start.
        sign
            Of F_p × F_q.

        """
        known = self._constant
        for factor, arm in self._arms:
            known += factor * rect(1.0, x[arm])
        for vector in self._known:
            known += _value(vector, x, pins)
        if self._two_arms is None:
            return self._close_any(x, pins, known, p, q, sign)
        first, second = self._two_arms
        p_least, q_least = self._tolerances
        for _ in range(_STEPS):
            one, other = first * rect(1.0, p), second * rect(1.0, q)
            off = known + one + other
            # F_p = i·one, F_q = i·other.
            across = one.real * other.imag - one.imag * other.real
            if not across:
                return False
            dp = -(other.real * off.real + other.imag * off.imag) / across
            dq = (one.real * off.real + one.imag * off.imag) / across
            p += dp
            q += dq
            if -p_least <= dp <= p_least and -q_least <= dq <= q_least:
                x += (p, q)
                return across * sign >= LEAST_SINE * abs(one) * abs(other)
        return False

    def _close_any(
        self, x: list[float], pins: list[complex], known: complex, p: float, q: float, sign: float
    ) -> bool:
        first = self._first
        x += (p, q)
        p_least, q_least = self._tolerances
        for _ in range(_STEPS):
            off = known
            for vector in self._new:
                off += _value(vector, x, pins)
            by_p, by_q = self._slopes(x)
            across = cross(by_p, by_q)
            if not across:
                break
            dp, dq = cross(by_q, off) / across, cross(off, by_p) / across
            x[first] += dp
            x[first + 1] += dq
            if -p_least <= dp <= p_least and -q_least <= dq <= q_least:
                return across * sign >= LEAST_SINE * abs(by_p) * abs(by_q)
        del x[first:]
        return False

    def orientation(self, x: list[float]) -> float:
        """Return the sine of the angle from F_p to F_q."""
        by_p, by_q = self._slopes(x)
        return cross(by_p, by_q) / (abs(by_p) * abs(by_q))

    def rates(
        self, x: list[float], pins: list[complex], v: list[float], speeds: list[complex]
    ) -> None:
        """Append the rates of p and q, given those of what is known."""
        v += (0.0, 0.0)
        drift = 0j
        for factor, arm in self._arms:
            drift += 1j * (v[arm] * (factor * rect(1.0, x[arm])))
        for vector in (*self._known, *self._new):
            drift += _rate(vector, x, pins, v, speeds)
        self._solve(x, drift, v)

    def accelerations(
        self,
        x: list[float],
        v: list[float],
        a: list[float],
        pulls: list[complex],
    ) -> None:
        """Append the accelerations of p and q, given those of what is known."""
        a += (0.0, 0.0)
        drift = 0j
        for factor, arm in self._arms:
            drift += complex(-v[arm] * v[arm], a[arm]) * (factor * rect(1.0, x[arm]))
        for vector in (*self._known, *self._new):
            drift += _acceleration(vector, x, v, a, pulls)
        self._solve(x, drift, a)

    def _solve(self, x: list[float], drift: complex, into: list[float]) -> None:
        by_p, by_q = self._slopes(x)
        across = cross(by_p, by_q)
        into[self._first] = cross(by_q, drift) / across
        into[self._first + 1] = cross(drift, by_p) / across

    def _slopes(self, x: list[float]) -> tuple[complex, complex]:
        """Return F_p and F_q."""
        first = self._first
        found = [0j, 0j]
        for factor, turns, slide, _ in self._new:
            unit = factor * rect(1.0, sum([sign * x[k] for k, sign in turns]))
            if slide >= first:
                found[slide - first] += unit
            if slide >= 0:
                unit *= x[slide]
            for k, sign in turns:
                if k >= first:
                    found[k - first] += sign * 1j * unit
        return found[0], found[1]


def _value(vector: Vector, x: list[float], pins: list[complex]) -> complex:
    factor, turns, slide, pin = vector
    if pin >= 0:
        return factor * pins[pin]
    unit = factor * rect(1.0, sum([sign * x[k] for k, sign in turns]))
    return unit if slide < 0 else unit * x[slide]


def _rate(
    vector: Vector, x: list[float], pins: list[complex], v: list[float], speeds: list[complex]
) -> complex:
    """Return the derivative: e^{iφ}·(ṡ + iφ̇·s)."""
    factor, turns, slide, pin = vector
    if pin >= 0:
        return factor * speeds[pin]
    unit = factor * rect(1.0, sum([sign * x[k] for k, sign in turns]))
    turn = sum([sign * v[k] for k, sign in turns])
    if slide < 0:
        return 1j * turn * unit
    return complex(v[slide], turn * x[slide]) * unit


def _acceleration(
    vector: Vector, x: list[float], v: list[float], a: list[float], pulls: list[complex]
) -> complex:
    """Return the second derivative: e^{iφ}·(s̈ − φ̇²·s + i(φ̈·s + 2φ̇·ṡ))."""
    factor, turns, slide, pin = vector
    if pin >= 0:
        return factor * pulls[pin]
    unit = factor * rect(1.0, sum([sign * x[k] for k, sign in turns]))
    turn = sum([sign * v[k] for k, sign in turns])
    change = sum([sign * a[k] for k, sign in turns])
    if slide < 0:
        return complex(-turn * turn, change) * unit
    s, way = x[slide], v[slide]
    return complex(a[slide] - turn * turn * s, change * s + 2.0 * turn * way) * unit
