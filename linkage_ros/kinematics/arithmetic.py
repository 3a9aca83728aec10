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
from collections.abc import Sequence
import math
from typing import Any


def sin(angle: float) -> float:
    """Return the sine of an angle, in [rad]."""
    try:
        return math.sin(angle)
    except TypeError:
        return _of(angle, 'sin')


def cos(angle: float) -> float:
    """Return the cosine of an angle, in [rad]."""
    try:
        return math.cos(angle)
    except TypeError:
        return _of(angle, 'cos')


def sqrt(square: float) -> float:
    """Return the root of a number."""
    try:
        return math.sqrt(square)
    except TypeError:
        return _of(square, 'sqrt')


def atan2(y: float, x: float) -> float:
    """Return the angle of a vector, in [rad]."""
    try:
        return math.atan2(y, x)
    except TypeError:
        return _of(y if hasattr(y, 'apply') else x, 'atan2', y, x)


def copysign(size: float, sign: float) -> float:
    """Return a number of the one's size and the other's sign."""
    try:
        return math.copysign(size, sign)
    except TypeError:
        return _of(sign, 'copysign', size, sign)


def facing(angle: float) -> complex:
    """Return the unit vector e^{iθ} at an angle, in [rad]."""
    try:
        return cmath.rect(1.0, angle)
    except TypeError:
        return _of(angle, 'facing')


def phase(vector: complex) -> float:
    """Return the angle of a vector, in [rad]."""
    try:
        return cmath.phase(vector)
    except TypeError:
        return _of(vector, 'phase')


def vector(x: float, y: float) -> complex:
    """Return the vector of two coordinates."""
    try:
        return complex(x, y)
    except TypeError:
        return _of(x if hasattr(x, 'apply') else y, 'vector', x, y)


def all_finite(numbers: Sequence[float]) -> bool:
    """Return whether numbers are neither infinite nor NaN."""
    try:
        return all(map(math.isfinite, numbers))
    except TypeError:
        symbols = [number for number in numbers if hasattr(number, 'apply')]
        if not symbols:
            raise
        return bool(_of(symbols[0], 'finite', *numbers))


def where(condition: bool, one: float, other: float) -> float:
    """
    Return the one number where a condition holds, the other where not.

    Both are worked out, and both must be numbers. It is for two forms of equal standing; a
    condition that decides what becomes of a linkage is an ``if``.
    """
    if hasattr(condition, 'apply'):
        return _of(condition, 'where', condition, one, other)
    return one if condition else other


def _of(symbol: Any, name: str, *arguments: Any) -> Any:
    return symbol.apply(name, *(arguments or (symbol,)))
