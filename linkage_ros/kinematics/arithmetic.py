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
Functions that the steps of a solution are written in.

They take numbers. They also take the symbols of a `Tape`, which write down what is done to them:
so a step that is written once also becomes a line of a compiled linkage.
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
    """Return the root of a number."""
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
    """Return a number of the one's size and the other's sign."""
    try:
        return math.copysign(size, sign)
    except TypeError:
        return _real(sign, 'copysign', size, sign)


def remainder(number: float, period: float) -> float:
    """Return how far a number is from the nearest multiple of a period."""
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
    Return the one number where a condition holds, the other where not.

    Both are worked out, and both must be numbers. It is for two forms of equal standing; a
    condition that decides what becomes of a linkage is an ``if``.
    """
    if hasattr(condition, 'apply'):
        return _real(condition, 'where', condition, one, other)
    return one if condition else other


def called(function: Callable[..., Any], *arguments: Any) -> Any:
    """
    Return what a function returns that takes numbers alone: an iteration, or a library's.

    Of symbols it is a call in the program, whose arguments and results are known only there.
    """
    for argument in arguments:
        if hasattr(argument, 'apply'):
            return argument.tape.call(function, *arguments)
    return function(*arguments)


def is_found(result: Any) -> bool:
    """Return whether a function that was `called` has found something, and not None."""
    return bool(_real(result, 'found')) if hasattr(result, 'apply') else result is not None


def _real(symbol: Any, name: str, *arguments: Any) -> float:
    """Return what a symbol writes down; it stands for the number that it will be."""
    found: float = symbol.apply(name, *(arguments or (symbol,)))
    return found


def _complex(symbol: Any, name: str, *arguments: Any) -> complex:
    found: complex = symbol.apply(name, *(arguments or (symbol,)))
    return found


# Vectors and lines of the plane.


def cross(one: complex, other: complex) -> float:
    """Return the z component of the cross product of two vectors."""
    return one.real * other.imag - one.imag * other.real


def resolved(vector: complex, unit: complex) -> tuple[float, float]:
    """Return a vector's parts along a unit vector and to the left of it."""
    turned = vector * unit.conjugate()
    return turned.real, turned.imag


def folded(angle: float) -> float:
    """Return the acute angle between two lines, of an angle between them, in [rad]."""
    return abs(math_remainder(angle, pi))
