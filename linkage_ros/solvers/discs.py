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
Numbers that are known within a disc, by the thousand; and Taylor series of such.

A disc is a centre, real or complex, and a radius that bounds how far the number may be from it,
rounding of the centre included (circular arithmetic: I. Gargantini and P. Henrici, Numer. Math.
18, 1972). Everything is an array over the cells of a range; overflow apart, what is said of a
number holds for certain.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

_ROUNDING = 2.0**-50
"""Above what a centre is off by, of its size: a product of complex numbers, a sine of numpy's."""

_LEAST = 2.0**-1020
"""Above what a product is off by where it underflows."""

_UP = 1.0 + 2.0**-48
"""What makes up for the rounding of a radius."""


class Disc(NamedTuple):
    """Numbers, each within a radius of a centre."""

    center: Any
    radius: Any

    @property
    def size(self) -> Any:
        """Return a bound of the absolute values."""
        return (np.abs(self.center) + self.radius) * _UP


Jet = list[Disc]
"""The coefficients of a Taylor series, from order 0 on."""

ZERO = Disc(0.0, 0.0)


def total(discs: Sequence[Disc]) -> Disc:
    """Return the sum."""
    center = sum(disc.center for disc in discs)
    sizes = sum(np.abs(disc.center) for disc in discs)
    return Disc(center, sum(disc.radius for disc in discs) * _UP + len(discs) * _ROUNDING * sizes)


def product(one: Disc, other: Disc) -> Disc:
    """Return the product."""
    a, b = np.abs(one.center), np.abs(other.center)
    radius = (a * other.radius + b * one.radius + one.radius * other.radius) * _UP
    return Disc(one.center * other.center, radius + _ROUNDING * a * b + _LEAST)


def times(disc: Disc, factor: complex) -> Disc:
    """Return the product with a number that is a double."""
    size = abs(factor)
    radius = disc.radius * size * _UP + _ROUNDING * size * np.abs(disc.center) + _LEAST
    return Disc(disc.center * factor, radius)


def facing(angle: Jet) -> Jet:
    """
    Return e^{iφ}: of order k it is i/k·Σ j·φ_j·e_(k−j).

    An arc is no shorter than its chord, so that the radius of an angle is one of its direction.
    """
    center = np.exp(1j * np.asarray(angle[0].center))
    found = [Disc(center, angle[0].radius * _UP + _ROUNDING)]
    for k in range(1, len(angle)):
        parts = [times(product(angle[j], found[k - j]), 1j * j) for j in range(1, k + 1)]
        found.append(times(total(parts), 1.0 / k))
    return found


def jet_product(one: Jet, other: Jet) -> Jet:
    """Return the product of two series."""
    return [total([product(one[j], other[k - j]) for j in range(k + 1)]) for k in range(len(one))]
