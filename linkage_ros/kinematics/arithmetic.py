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
The functions in which the steps of a solution are written.

They take numbers, or symbols of a `Tape`, which records the operations on them: so a step that is
written once also becomes code of a compiled linkage.
"""

from __future__ import annotations

import cmath
from collections.abc import Callable, Sequence
import math
from math import pi
from math import remainder as math_remainder
from typing import Any


def sin(angle: float) -> float:
    """Return the sine of an angle, in [rad]."""
    try:
        return math.sin(angle)
    except TypeError:
        return _real(angle, 'sin')


def cos(angle: float) -> float:
    """Return the cosine of an angle, in [rad]."""
    try:
        return math.cos(angle)
    except TypeError:
        return _real(angle, 'cos')


def sqrt(square: float) -> float:
    """Return the square root of a number."""
    try:
        return math.sqrt(square)
    except TypeError:
        return _real(square, 'sqrt')


def atan2(y: float, x: float) -> float:
    """Return the angle of a vector, in [rad]."""
    try:
        return math.atan2(y, x)
    except TypeError:
        return _real(y if hasattr(y, 'apply') else x, 'atan2', y, x)


def copysign(size: float, sign: float) -> float:
    """Return a number with the size of the first and the sign of the second."""
    try:
        return math.copysign(size, sign)
    except TypeError:
        return _real(sign, 'copysign', size, sign)


def remainder(number: float, period: float) -> float:
    """Return the distance of a number from the nearest multiple of a period, signed."""
    try:
        return math.remainder(number, period)
    except TypeError:
        return _real(number, 'remainder', number, period)


def facing(angle: float) -> complex:
    """Return the unit vector e^{iθ} at an angle, in [rad]."""
    try:
        return cmath.rect(1.0, angle)
    except TypeError:
        return _complex(angle, 'facing')


def phase(vector: complex) -> float:
    """Return the angle of a vector, in [rad]."""
    try:
        return cmath.phase(vector)
    except TypeError:
        return _real(vector, 'phase')


def vector(x: float, y: float) -> complex:
    """Return the vector of two coordinates."""
    try:
        return complex(x, y)
    except TypeError:
        return _complex(x if hasattr(x, 'apply') else y, 'vector', x, y)


def all_finite(numbers: Sequence[float]) -> bool:
    """Return whether numbers are neither infinite nor NaN."""
    try:
        return all(map(math.isfinite, numbers))
    except TypeError:
        symbols = [number for number in numbers if hasattr(number, 'apply')]
        if not symbols:
            raise
        return bool(_real(symbols[0], 'finite', *numbers))


def where(condition: bool, one: float, other: float) -> float:
    """
    Return ``one`` if a condition holds, otherwise ``other``.

    Both are evaluated, and both must be numbers. Use it for two equivalent forms; write ``if`` for
    a condition that decides about the linkage.
    """
    if hasattr(condition, 'apply'):
        return _real(condition, 'where', condition, one, other)
    return one if condition else other


def called(function: Callable[..., Any], *arguments: Any) -> Any:
    """
    Call a function that takes numbers only, such as an iteration or a library function.

    With symbols, it becomes a call in the program, evaluated only when the program runs.
    """
    for argument in arguments:
        if hasattr(argument, 'apply'):
            return argument.tape.call(function, *arguments)
    return function(*arguments)


def is_found(result: Any) -> bool:
    """Return whether the result of a function that was `called` is not None."""
    return bool(_real(result, 'found')) if hasattr(result, 'apply') else result is not None


def _real(symbol: Any, name: str, *arguments: Any) -> float:
    """Return the symbol of an operation, typed as the number that it stands for."""
    result: float = symbol.apply(name, *(arguments or (symbol,)))
    return result


def _complex(symbol: Any, name: str, *arguments: Any) -> complex:
    result: complex = symbol.apply(name, *(arguments or (symbol,)))
    return result


def cross(one: complex, other: complex) -> float:
    """Return the z component of the cross product of two vectors."""
    return one.real * other.imag - one.imag * other.real


def resolved(vector: complex, unit: complex) -> tuple[float, float]:
    """Return the components of a vector along a unit vector and to the left of it."""
    turned = vector * unit.conjugate()
    return turned.real, turned.imag


def folded(angle: float) -> float:
    """Return the acute angle between two lines, given any angle between them, in [rad]."""
    return abs(math_remainder(angle, pi))
