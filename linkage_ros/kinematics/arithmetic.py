# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The functions in which the steps of a solution are written.

They take numbers, or symbols of a `Tape`, which records the operations on them: so a step that is
written once also becomes code of a compiled linkage. `Root` and its functions decide by a sum that
may be zero, given the rounding errors of lengths and reaches.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable, Sequence
import math
from math import fsum, pi, tau
from typing import Any, NamedTuple

from linkage_ros.kinematics.status import Status

UNIT_ROUNDOFF = 2.0**-53

SMALLEST = 2.0**-1020
"""Smaller numbers count as zero: their inverse would overflow."""

ROUNDING = 16.0 * UNIT_ROUNDOFF
"""Bound of the error of a reach, relative to the size of its terms."""


class UndecidedError(Exception):
    """Symbols do not say how the links lie: only numbers do."""


def sin(angle: float) -> float:
    """Return the sine of an angle, in [rad]."""
    try:
        return math.sin(angle)
    except TypeError:
        return _real_symbol(angle, 'sin')


def cos(angle: float) -> float:
    """Return the cosine of an angle, in [rad]."""
    try:
        return math.cos(angle)
    except TypeError:
        return _real_symbol(angle, 'cos')


def sqrt(square: float) -> float:
    """Return the square root of a number."""
    try:
        return math.sqrt(square)
    except TypeError:
        return _real_symbol(square, 'sqrt')


def atan2(y: float, x: float) -> float:
    """Return the angle of a vector, in [rad]."""
    try:
        return math.atan2(y, x)
    except TypeError:
        return _real_symbol(y if hasattr(y, 'apply') else x, 'atan2', y, x)


def copysign(size: float, sign: float) -> float:
    """Return a number with the size of the first and the sign of the second."""
    try:
        return math.copysign(size, sign)
    except TypeError:
        return _real_symbol(sign, 'copysign', size, sign)


def remainder(number: float, period: float) -> float:
    """Return the distance of a number from the nearest multiple of a period, signed."""
    try:
        return math.remainder(number, period)
    except TypeError:
        return _real_symbol(number, 'remainder', number, period)


def unit_vector(angle: float) -> complex:
    """Return the unit vector e^{iθ} at an angle, in [rad]."""
    try:
        return cmath.rect(1.0, angle)
    except TypeError:
        return _complex_symbol(angle, 'facing')


def phase(vector: complex) -> float:
    """Return the angle of a vector, in [rad]."""
    try:
        return cmath.phase(vector)
    except TypeError:
        return _real_symbol(vector, 'phase')


def make_vector(x: float, y: float) -> complex:
    """Return the vector of two coordinates."""
    try:
        return complex(x, y)
    except TypeError:
        return _complex_symbol(x if hasattr(x, 'apply') else y, 'vector', x, y)


def all_finite(numbers: Sequence[float]) -> bool:
    """Return whether numbers are neither infinite nor NaN."""
    try:
        return all(map(math.isfinite, numbers))
    except TypeError:
        symbols = [number for number in numbers if hasattr(number, 'apply')]
        if not symbols:
            raise
        return bool(_real_symbol(symbols[0], 'finite', *numbers))


def where(condition: bool, first: float, second: float) -> float:
    """
    Return ``first`` if a condition holds, otherwise ``second``.

    Both are evaluated, and both must be numbers. Use it for two equivalent forms; write ``if`` for
    a condition that decides about the linkage.
    """
    if hasattr(condition, 'apply'):
        return _real_symbol(condition, 'where', condition, first, second)
    return first if condition else second


def call(function: Callable[..., Any], *arguments: Any) -> Any:
    """
    Call a function that takes numbers only, such as an iteration or a library function.

    With symbols, it becomes a call in the program, evaluated only when the program runs.
    """
    for argument in arguments:
        if hasattr(argument, 'apply'):
            return argument.tape.call(function, *arguments)
    return function(*arguments)


def has_result(result: Any) -> bool:
    """Return whether the result of a function that was `call` is not None."""
    return bool(_real_symbol(result, 'found')) if hasattr(result, 'apply') else result is not None


def _real_symbol(symbol: Any, name: str, *arguments: Any) -> float:
    """Return the symbol of an operation, typed as the number that it stands for."""
    result: float = symbol.apply(name, *(arguments or (symbol,)))
    return result


def _complex_symbol(symbol: Any, name: str, *arguments: Any) -> complex:
    result: complex = symbol.apply(name, *(arguments or (symbol,)))
    return result


def cross_product(first: complex, second: complex) -> float:
    """Return the z component of the cross product of two vectors."""
    return first.real * second.imag - first.imag * second.real


def resolve_along(vector: complex, unit: complex) -> tuple[float, float]:
    """Return the components of a vector along a unit vector and to the left of it."""
    turned = vector * unit.conjugate()
    return turned.real, turned.imag


def acute_angle(angle: float) -> float:
    """Return the acute angle between two lines, given any angle between them, in [rad]."""
    return abs(remainder(angle, pi))


def wrap_angle(angle: float) -> float:
    """Return an angle without its whole turns, in (−π, π] rad."""
    rest = math.remainder(angle, tau)
    return pi if rest <= -pi else rest


def exact_sum(*lengths: float) -> float:
    """
    Return a sum of signed lengths that is a constant of a linkage, correctly rounded.

    Lengths come from files, in decimals: terms that cancel up to rounding were meant to cancel,
    and their sum is 0.
    """
    total = fsum(lengths)
    return 0.0 if abs(total) <= 4.0 * UNIT_ROUNDOFF * fsum(map(abs, lengths)) else total


class Root(NamedTuple):
    """The root of a reach: the distance of a dyad from its limit."""

    root: float  # 0 at the limit
    missing: float = 0.0  # 0 if the dyad closes, otherwise the amount that the sum is short of 0
    # A toggle if the sum is zero within its rounding error, open if it is negative.
    status: Status = Status.CLOSED


def signed_root(constant: float, part: float, square: float) -> Root:
    """
    Return the root of ``constant + part²``, given the square.

    A dyad folds or stretches where such a sum, its reach, becomes zero. The constant is a bracket
    of the linkage; the part is signed by the half angle. If the constant is zero, the root is the
    part and has its sign. A sum within its own rounding error of zero counts as zero: these are
    the last few floats on either side of a toggle, where the rate has no correct digit.
    """
    if constant == 0.0:
        return Root(part)
    return root_of(constant + square, abs(constant) + square)


def root_of(total: float, size: float) -> Root:
    """Return `signed_root` of a sum; ``size`` is the sum of its absolute terms."""
    rounding = ROUNDING * size
    if total > rounding:
        return Root(sqrt(total))
    if total >= -rounding:
        return Root(0.0, 0.0, Status.TOGGLE)
    return Root(0.0, -total, Status.OPEN)


def passes_zero(part: float, half_angle: float) -> bool:
    """
    Return whether the sine or cosine of a half angle is zero up to the rounding of the angle.

    An angle is rounded at its own size, and π is not a double: at the nearest double the cosine of
    the half angle is 6e-17.
    """
    size = abs(half_angle)
    return abs(part) <= ROUNDING * where(size > 1.0, size, 1.0)
