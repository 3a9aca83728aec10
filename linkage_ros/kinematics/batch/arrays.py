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


"""What the steps over arrays share: blocks of states, statuses as codes, angles as units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import tan
from typing import Any, NamedTuple, Protocol, TypeAlias, TypeVar

from linkage_ros.kinematics.rounding import ROUNDING, UNIT_ROUNDOFF
from linkage_ros.kinematics.status import Status
import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Complex: TypeAlias = NDArray[np.complex128]
Codes: TypeAlias = NDArray[np.uint8]
Mask: TypeAlias = NDArray[np.bool_]

States: TypeAlias = Any
"""A `State` of many: each coordinate and pin an array, or a number where it is one for all."""

BLOCK = 8192
"""States of a block: as many as stay in the cache."""

CODES = {status: code for code, status in enumerate(Status)}
"""
How an array says a status: closed is 0, and the greater the worse.

Below the toggle there are rates, up to it a pose.
"""

CLOSED, CHANGE_POINT = CODES[Status.CLOSED], CODES[Status.CHANGE_POINT]
LIMITED, TOGGLE = CODES[Status.LIMITED], CODES[Status.TOGGLE]
OPEN, INDETERMINATE = CODES[Status.OPEN], CODES[Status.INDETERMINATE]

_Step = TypeVar('_Step')


class Block(NamedTuple):
    """
    Some states, as far as they are solved.

    Attributes
    ----------
    known
        As the scalar steps have it.
    speeds, changes
        Likewise; None where they are not asked for, the changes with the speeds.
    status
        The code of each state: that of the first step that fails, else the worst of the steps.
    scratch
        Rows to work in, as long as a block; a step may use them until it returns.
    places
        By derivative and coordinate, where one that is published is wanted at last; a step that
        writes it there saves a copy.

    """

    known: States
    speeds: States | None
    changes: States | None
    status: Codes
    scratch: Array
    places: Sequence[Mapping[int, Array]] = ({}, {}, {})

    def room(self, derivative: int, coordinate: int) -> Array:
        """Return an array for a coordinate, or for a derivative of it."""
        place = self.places[derivative].get(coordinate)
        return np.empty(len(self.status)) if place is None else place

    def note(self, codes: Codes) -> None:
        """Take in what a step says of each state."""
        np.maximum(self.status, codes, out=self.status, where=self.status <= TOGGLE)


class ArrayStep(Protocol):
    """A step that solves all states of a block."""

    def solve(self, block: Block, /) -> None:
        """Append to what is known, to its rates and its accelerations, and note the status."""


def remade(kind: type[_Step], step: _Step, **changed: object) -> _Step:
    """Return a step as one of a derived kind: the same constants, methods that take arrays."""
    made = object.__new__(kind)
    for parent in kind.__mro__:
        for name in getattr(parent, '__slots__', ()):
            setattr(made, name, changed[name] if name in changed else getattr(step, name))
    return made


def codes_of(
    gap: Array | float, lost: Mask | bool, toggle: Mask | bool, change_point: Mask | bool = False
) -> Codes:
    """Return the status: open where there is a gap, else the worst of what else there is."""
    codes = np.where(change_point, np.uint8(CHANGE_POINT), np.uint8(CLOSED))
    codes = np.where(toggle, np.uint8(TOGGLE), codes)
    codes = np.where(lost, np.uint8(INDETERMINATE), codes)
    return np.where(gap > 0.0, np.uint8(OPEN), codes)


def passes_zeros(parts: Array, half_angles: Array) -> Mask:
    """Return where a sine or cosine of a half angle is zero, as `passes_zero` does of one."""
    found: Mask = np.abs(parts) <= ROUNDING * np.maximum(1.0, np.abs(half_angles))
    return found


def joined(real: Array | float, imaginary: Array | float) -> Complex:
    """Return complex numbers of their parts."""
    numbers: Complex = np.empty(np.broadcast(real, imaginary).shape, np.complex128)
    numbers.real = real
    numbers.imag = imaginary
    return numbers


def turned(angle: Array | float) -> Complex:
    """Return e^{i·angle}."""
    if not isinstance(angle, np.ndarray):
        return joined(np.cos(angle), np.sin(angle))
    sine, cosine, spare = np.empty((3, *angle.shape))
    sine_cosine(angle, sine, cosine, spare, 1.0)
    return joined(cosine, np.add(sine, sine, out=sine))


def phases(numbers: Complex | complex) -> Array:
    """Return the direction of each complex number, in [rad]."""
    angles: Array = np.arctan2(numbers.imag, numbers.real)
    return angles


def sine_cosine(angle: Array, sine: Array, cosine: Array, spare: Array, part: float) -> None:
    """
    Write half the sine and the cosine of a part of an angle.

    The cosine is right to the last digit of 1, not of itself. numpy's tangent is vectorised where
    its sine and cosine are not: it takes a tenth of them both.
    """
    if not _BY_TANGENT:
        np.multiply(angle, part, out=spare)
        np.cos(spare, out=cosine)
        np.sin(spare, out=sine)
        np.multiply(sine, 0.5, out=sine)
        return
    # With t = tan(angle/2): t/(1 + t²) and (1 − t²)/(1 + t²).
    np.multiply(angle, 0.5 * part, out=spare)
    np.tan(spare, out=spare)
    np.multiply(spare, spare, out=cosine)
    np.add(cosine, 1.0, out=sine)
    np.subtract(1.0, cosine, out=cosine)
    np.divide(cosine, sine, out=cosine)
    np.divide(spare, sine, out=sine)


def _tangent_is_close() -> bool:
    """
    Return whether numpy's tangent is right to its last digit, here.

    Of the vectorised ones some are 3 ulp off; sine and cosine, which take longer, never are.
    """
    angles = np.linspace(-1.5, 1.5, 1000)
    return all(
        abs(found - exact) <= 2.5 * UNIT_ROUNDOFF * abs(exact)
        for found, exact in zip(np.tan(angles).tolist(), map(tan, angles.tolist()), strict=True)
    )


_BY_TANGENT = _tangent_is_close()


def roots_of(total: Array, size: Array | float) -> tuple[Array, Array]:
    """Return roots and what is missing, as `root_of` does of one sum."""
    rounding = ROUNDING * size
    roots = np.sqrt(np.where(total > rounding, total, 0.0))
    return roots, np.where(total >= -rounding, 0.0, -total)


def reaches(constant: float, part: Array, square: Array) -> tuple[Array, Array | float]:
    """Return roots and what is missing, as `reach` does."""
    if constant == 0.0:
        return part, 0.0
    return roots_of(constant + square, abs(constant) + square)
