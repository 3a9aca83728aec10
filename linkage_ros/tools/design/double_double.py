# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Double-double arithmetic on arrays, with twenty bits or more beyond a double if terms cancel.

A number is a pair (high, low) of arrays, low at most half a unit in the last place of high. Sums
and products follow T. J. Dekker, A floating-point technique for extending the available precision,
Numerische Mathematik 18 (1971), and D. E. Knuth, The Art of Computer Programming 2, 4.2.2. Sine
and cosine come from a table of 2048 parts of a turn; the rest is at most 1.6e-3 rad, so that its
series can be summed in doubles, with a relative error of 2⁻⁷⁰. Unlike those of a library, they are
the same on every machine.
"""

from __future__ import annotations

from functools import cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Twofold: TypeAlias = tuple[Array, Array]

_PARTS = 2048
_SPLITTER = 2.0**27 + 1.0

_BITS = 192
_PI = 0x3_243F6A8885A308D313198A2E03707344A4093822299F31D0
"""π times 2¹⁹²."""


def two_sum(x: Array, y: Array) -> Twofold:
    """Return a sum and its rounding error."""
    total = x + y
    part = total - x
    return total, (x - (total - part)) + (y - part)


def two_product(x: Array, y: Array) -> Twofold:
    """Return a product and its rounding error."""
    product = x * y
    big = _SPLITTER * x
    x_high = big - (big - x)
    x_low = x - x_high
    big = _SPLITTER * y
    y_high = big - (big - y)
    y_low = y - y_high
    return product, ((x_high * y_high - product) + x_high * y_low + x_low * y_high) + x_low * y_low


def add(x: Twofold, y: Twofold) -> Twofold:
    """Return a sum."""
    total, error = two_sum(x[0], y[0])
    return _normalize(total, error + (x[1] + y[1]))


def subtract(x: Twofold, y: Twofold) -> Twofold:
    """Return a difference."""
    return add(x, (-y[0], -y[1]))


def multiply(x: Twofold, y: Twofold) -> Twofold:
    """Return a product."""
    product, error = two_product(x[0], y[0])
    return _normalize(product, error + (x[0] * y[1] + x[1] * y[0]))


def divide(x: Twofold, y: Twofold) -> Twofold:
    """Return a quotient."""
    quotient = x[0] / y[0]
    product, error = two_product(quotient, y[0])
    return _normalize(quotient, (((x[0] - product) - error + x[1]) - quotient * y[1]) / y[0])


def sine(angle: Twofold) -> Twofold:
    """Return the sine of an angle, in [rad]."""
    part, rest, low = _reduce_angle(angle)
    sines, cosines = _part_of_turn(part)
    return _turn_by(sines, cosines, rest, low)


def sine_cosine(angle: Twofold) -> tuple[Twofold, Twofold]:
    """Return sine and cosine of an angle, in [rad]."""
    part, rest, low = _reduce_angle(angle)
    (high, tail), cosines = _part_of_turn(part)
    return _turn_by((high, tail), cosines, rest, low), _turn_by(cosines, (-high, -tail), rest, low)


def _reduce_angle(angle: Twofold) -> tuple[NDArray[np.intp], Array, Array]:
    """Return the nearest part of a turn, and the angle beyond it."""
    # The first two parts have so few bits that their products with an integer are exact.
    first, second, third = _part_of_a_turn()
    parts = np.rint(angle[0] * (1.0 / first))
    rest, low = two_sum(angle[0] - parts * first, -parts * second)
    rest, low = _normalize(rest, low + (angle[1] - parts * third))
    return parts.astype(np.intp) & (_PARTS - 1), rest, low


def _part_of_turn(part: NDArray[np.intp]) -> tuple[Twofold, Twofold]:
    sine_high, sine_low, cosine_high, cosine_low = (row.take(part) for row in _sine_table())
    return (sine_high, sine_low), (cosine_high, cosine_low)


def _turn_by(along: Twofold, across: Twofold, rest: Array, low: Array) -> Twofold:
    """Return along·cos(rest) + across·sin(rest)."""
    square = rest * rest
    # sin x − x and cos x − 1, to x⁷ and x⁶.
    sine = rest * square * (-1 / 6 + square * (1 / 120 - square * (1 / 5040)))
    cosine = square * (-0.5 + square * (1 / 24 - square * (1 / 720)))
    product, error = two_product(across[0], rest)
    total, product_error = two_sum(along[0], product)
    tail = across[0] * (low + sine) + along[0] * cosine + across[1] * rest + along[1]
    return _normalize(total, tail + error + product_error)


def _normalize(high: Array, low: Array) -> Twofold:
    total = high + low
    return total, low - (total - high)


@cache
def _part_of_a_turn() -> tuple[float, float, float]:
    """Return the 2048th part of a turn as a sum of three doubles, the first two of 33 bits."""
    rest, parts = 2 * _PI // _PARTS, []
    for _ in range(2):
        cut = rest.bit_length() - 33
        parts.append((rest >> cut << cut) / (1 << _BITS))
        rest &= (1 << cut) - 1
    return parts[0], parts[1], rest / (1 << _BITS)


@cache
def _sine_table() -> tuple[Array, Array, Array, Array]:
    """Return the sines of all parts of a turn, high and low, and their cosines."""
    eighth = [(1 << _BITS, 0)]
    cosine, sine = _small_turn(2 * _PI // _PARTS)
    for _ in range(_PARTS // 8):
        x, y = eighth[-1]
        eighth.append(((x * cosine - y * sine) >> _BITS, (x * sine + y * cosine) >> _BITS))
    # By symmetry, so that multiples of a quarter turn are exact.
    turned = eighth + [(y, x) for x, y in eighth[-2:0:-1]]
    quarter = turned
    for _ in range(3):
        quarter = [(-y, x) for x, y in quarter]
        turned = turned + quarter
    sines, cosines = (_as_twofold([place[axis] for place in turned]) for axis in (1, 0))
    return *sines, *cosines


def _as_twofold(numbers: list[int]) -> Twofold:
    unit = 1 << _BITS
    high = [number / unit for number in numbers]
    low = []
    for number, rounded in zip(numbers, high, strict=True):
        above, below = rounded.as_integer_ratio()
        low.append((number - above * (unit // below)) / unit)
    return np.array(high), np.array(low)


def _small_turn(angle: int) -> tuple[int, int]:
    """Return cosine and sine by their series, times 2¹⁹²."""
    sums, term = [0, 0, 0, 0], 1 << _BITS
    for power in range(24):
        sums[power % 4] += term
        term = (term * angle >> _BITS) // (power + 1)
    return sums[0] - sums[2], sums[1] - sums[3]
