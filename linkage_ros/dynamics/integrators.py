# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The methods of integration, for one freedom: q' = w, w' = a(q, w, t).

All use the value q and its rate w, not the momentum, so their state is what is published. The step
is fixed: with an adaptive step the cost of a tick, and so whether it meets its deadline, would
depend on the motion.

The longest step: beyond one length a stiff load makes the motion grow without end. A shorter one
is needed where the fast motion itself counts, as in the blow on a stop, which a stable step may
swallow.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import fsum, inf, sqrt
from typing import NamedTuple

from linkage_ros.errors import DefinitionError

Field = Callable[[float, float, float], float | None]
"""a(q, w, t), in [rad/s²] or [m/s²], t seconds into the step; None if there is no such motion."""

Step = Callable[[Field, float, float, float, float], tuple[float, float] | None]
"""
Takes a(q, w, t), q, w, the acceleration there, and the step in [s]; returns q and w at its end.

Returns None if a stage lies where there is no motion, or does not converge.
"""

_R = sqrt(15.0)

GAUSS_NODES = (0.5 - _R / 10, 0.5, 0.5 + _R / 10)
GAUSS_WEIGHTS = (5 / 18, 4 / 9, 5 / 18)
GAUSS_MATRIX = (
    (5 / 36, 2 / 9 - _R / 15, 5 / 36 - _R / 30),
    (5 / 36 + _R / 24, 2 / 9, 5 / 36 - _R / 24),
    (5 / 36 + _R / 30, 2 / 9 + _R / 15, 5 / 36),
)

_SQUARE = tuple(
    tuple(fsum(a * of[j] for a, of in zip(row, GAUSS_MATRIX, strict=True)) for j in range(3))
    for row in GAUSS_MATRIX
)
_LEVERS = tuple(b * (1.0 - c) for b, c in zip(GAUSS_WEIGHTS, GAUSS_NODES, strict=True))
_STAGES = tuple(zip(GAUSS_NODES, _SQUARE, GAUSS_MATRIX, strict=True))

_ITERATIONS = 20
"""More iterations mean no convergence; a shorter step converges faster."""
_ROUNDING = 2.0**-54
"""Smaller changes count as none, relative to the accelerations."""
_NOISE = 1e-12
"""Changes that grow again are rounding below this fraction, and divergence above it."""

STABLE = {'semi_implicit_euler': 1.5, 'rk4': 2.5, 'gauss_legendre': 1.5}
"""
Greatest |s|·h of a motion e^{s·t} for a step h.

The explicit methods are stable up to 2 and 2.78 (E. Hairer, G. Wanner, Solving Ordinary
Differential Equations II, 2nd ed., 1996, IV.2); the stages of the implicit one converge.
"""

EXACT = {'semi_implicit_euler': 0.04, 'rk4': 0.5, 'gauss_legendre': 1.5}
"""
The same for a fast motion that counts: it is right to the share of `_SHARES`.

Measured: the rate after a blow on a stop, as a share of that before it, over dampings and places
of the blow within a step (`test/dynamics/test_longest_step.py`).
"""

_SHARES = {'semi_implicit_euler': '1 %', 'rk4': '0.1 %', 'gauss_legendre': '0.01 %'}

_SHORTEST = 1e-6


def semi_implicit_euler(
    _field: Field, value: float, rate: float, acceleration: float, length: float
) -> tuple[float, float]:
    """
    Advance by semi-implicit Euler, of order 1: first the rate, then the value with the new rate.

    One evaluation a step. If the inertia is constant and no force depends on the rate it is
    symplectic, so that its energy errs but does not drift (E. Hairer, C. Lubich, G. Wanner,
    Geometric Numerical Integration, 2nd ed., 2006, I.1.2).
    """
    rate += length * acceleration
    return value + length * rate, rate


def rk4(
    field: Field, value: float, rate: float, acceleration: float, length: float
) -> tuple[float, float] | None:
    """
    Advance by the classical Runge-Kutta method, of order 4: four evaluations a step.

    W. Kutta, Beitrag zur näherungsweisen Integration totaler Differentialgleichungen, Zeitschrift
    für Mathematik und Physik 46, 1901. Each stage starts from the slopes of the previous one only.
    """
    slope, change = rate, acceleration
    mean_slope, mean_change = (1 / 6) * slope, (1 / 6) * change
    for node, weight in ((0.5, 1 / 3), (0.5, 1 / 3), (1.0, 1 / 6)):
        ahead = node * length
        slope, at = rate + ahead * change, value + ahead * slope
        stage = field(at, slope, ahead)
        if stage is None:
            return None
        change = stage
        mean_slope += weight * slope
        mean_change += weight * change
    return value + length * mean_slope, rate + length * mean_change


def gauss_legendre(
    field: Field, value: float, rate: float, acceleration: float, length: float
) -> tuple[float, float] | None:
    """
    Advance by Gauss's collocation with three stages: of order 6, implicit, symmetric in time.

    Because it is symmetric, it keeps the energy of a reversible motion, such as the motion of
    an undamped linkage, within a bound for ever, apart from rounding (E. Hairer, C. Lubich, G.
    Wanner, Geometric Numerical Integration, 2nd ed., 2006, II.1.3, XI.3). With the accelerations A
    of the stages::

        q_i = q + h·c_i·w + h²·Σ ā_ij·A_j        w_i = w + h·Σ a_ij·A_j
        A_i = a(q_i, w_i, h·c_i)
        q₁  = q + h·w     + h²·Σ b̄_j·A_j         w₁  = w + h·Σ b_j·A_j

    where ā = a·a and b̄_j = b_j·(1 − c_j). The stages are iterated until only rounding changes
    them, which keeps the energy to rounding too (E. Hairer, R. McLachlan, A. Razakarivony,
    Achieving Brouwer's law with implicit Runge-Kutta methods, BIT 48, 2008).
    """
    stages = [acceleration, acceleration, acceleration]
    square = length * length
    before = 0.0
    for _ in range(_ITERATIONS):
        change = largest = 0.0
        for i, (c, (s1, s2, s3), (a1, a2, a3)) in enumerate(_STAGES):
            # Earlier stages already have this iteration's values, which converges faster.
            f1, f2, f3 = stages
            at = value + (length * c * rate + square * (s1 * f1 + s2 * f2 + s3 * f3))
            speed = rate + length * (a1 * f1 + a2 * f2 + a3 * f3)
            new = field(at, speed, length * c)
            if new is None:
                return None
            change = max(change, abs(new - stages[i]))
            largest = max(largest, abs(new))
            stages[i] = new
        grows = 0.0 < before <= change
        # Changes fall by one factor: the next would be change²/before.
        settled = change * change <= _ROUNDING * largest * before
        if settled or change == 0.0 or (grows and change <= _NOISE * largest):
            f1, f2, f3 = stages
            b1, b2, b3 = GAUSS_WEIGHTS
            l1, l2, l3 = _LEVERS
            moved = length * rate + square * (l1 * f1 + l2 * f2 + l3 * f3)
            return value + moved, rate + length * (b1 * f1 + b2 * f2 + b3 * f3)
        if grows:
            return None
        before = change
    return None


class Method(NamedTuple):
    """A method; the error of a motion falls with the step to the power of its order."""

    step: Step
    order: int


METHODS = {
    'semi_implicit_euler': Method(semi_implicit_euler, 1),
    'rk4': Method(rk4, 4),
    'gauss_legendre': Method(gauss_legendre, 6),
}
"""The methods, by name."""


def check_step(
    where: str,
    fastest: float,
    method: str,
    step: float,
    fault: str,
    otherwise: str,
    limits: Mapping[str, float] = STABLE,
) -> None:
    """
    Refuse what is too stiff for the step of the integration; the remedy is the longest step.

    ``where`` is the key of what is stiff, and ``fastest`` the greatest |s| of the motion e^{s·t}
    that it causes, in [1/s]. The step of the method is in [s]. ``fault`` says what is wrong, as
    'it is too stiff', ``otherwise`` is the remedy if no step is short enough, and ``limits`` is
    `STABLE` or `EXACT`.
    """
    carried = limits[method] / fastest if fastest else inf
    if step > carried:
        gives = f'follows it to {_SHARES[method]}'
        if limits is STABLE:
            gives = f'is stable; {_in_short(EXACT[method] / fastest)} s {gives}'
        raise DefinitionError(
            where,
            f'{fault} for a step of {step:g} s: motion changes at {fastest:.3g}/s there',
            f'write a step of {_in_short(carried)} s or less in drive.torque, which {gives}'
            if carried >= _SHORTEST
            else otherwise,
        )


def _in_short(seconds: float) -> str:
    """Return a time in two digits, rounded down."""
    near = f'{seconds:.1e}'
    return near if float(near) <= seconds else f'{0.95 * seconds:.1e}'
