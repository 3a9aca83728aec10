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

"""Decisions by a sum that may be zero: the rounding errors of lengths and reaches."""

from __future__ import annotations

from math import fsum
from typing import NamedTuple

from linkage_ros.kinematics.arithmetic import sqrt, where
from linkage_ros.kinematics.status import Status

UNIT_ROUNDOFF = 2.0**-53

SMALLEST = 2.0**-1020
"""Smaller numbers count as zero: their inverse would overflow."""

ROUNDING = 16.0 * UNIT_ROUNDOFF
"""Bound of the error of a reach, relative to the size of its terms."""


def margin(*lengths: float) -> float:
    """
    Return a sum of signed lengths that is a constant of a linkage, correctly rounded.

    Lengths come from files, in decimals: terms that cancel up to rounding were meant to cancel,
    and their sum is 0.
    """
    total = fsum(lengths)
    return 0.0 if abs(total) <= 4.0 * UNIT_ROUNDOFF * fsum(map(abs, lengths)) else total


class Root(NamedTuple):
    """
    The root of a reach: the distance of a dyad from its limit.

    Attributes
    ----------
    root
        0 at the limit.
    missing
        0 if the dyad closes, otherwise the amount that the sum is short of 0.
    status
        A toggle if the sum is zero within its rounding error, open if it is negative.

    """

    root: float
    missing: float = 0.0
    status: Status = Status.CLOSED


def reach(constant: float, part: float, square: float) -> Root:
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
    """Return the root as `reach` does, of a sum; ``size`` is the sum of its absolute terms."""
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
