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
The circle through three places A₁, A₂, A₃; any number of them at once.

With the chords u = A₂ − A₁ and v = A₃ − A₁ the centre is ::

    c = A₁ + i·(u·v² − v·u²)/(2·(u × v)),

the place that is as far from A₂ and from A₃ as from A₁. It is worked out to 20 bits more than a
double has: in places near a line, or near each other, u × v keeps little of u and v.

What a small move of the places does to it follows from |Aᵢ − c|² = r². With n = A − c and
g = n·dA, of each place, u·dc = g₂ − g₁ and v·dc = g₃ − g₁; so that ::

    dc = i·((v − u)·g₁ − v·g₂ + u·g₃)/(u × v).
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

from linkage_ros.kinematics.batch import Array, Complex
from linkage_ros.synthesis.double_double import minus, over, plus, times, Twofold
import numpy as np

Place: TypeAlias = tuple[Twofold, Twofold]
"""Its x and y."""


class Circle(NamedTuple):
    """
    A circle; inf or nan where the places lie on a line, or two of them are the same.

    Attributes
    ----------
    centre
        (…).
    spokes
        From the centre to the places, (…, 3).
    chords
        Between the places, each opposite to its own: A₃ − A₂, A₁ − A₃ and A₂ − A₁, (…, 3).
    pull
        dc/dg of each place, as above, (…, 3).

    """

    centre: Complex
    spokes: Complex
    chords: Complex
    pull: Complex


def circle(places: Place) -> Circle:
    """Return the circle through three places, (…, 3)."""
    first, second, third = (_at(places, index) for index in range(3))
    u, v = _minus(second, first), _minus(third, first)
    with np.errstate(all='ignore'):
        cross = minus(times(u[0], v[1]), times(u[1], v[0]))
        twice = (2.0 * cross[0], 2.0 * cross[1])
        u_square, v_square = (plus(times(w[0], w[0]), times(w[1], w[1])) for w in (u, v))
        to_centre = (
            over(minus(times(v[1], u_square), times(u[1], v_square)), twice),
            over(minus(times(u[0], v_square), times(v[0], u_square)), twice),
        )
        centre = plus(first[0], to_centre[0]), plus(first[1], to_centre[1])
        spokes = [number(_minus(place, centre)) for place in (first, second, third)]
        chords = np.stack((number(_minus(v, u)), -number(v), number(u)), -1)
        pull = 1j * chords / cross[0][..., None]
    return Circle(number(centre), np.stack(spokes, -1), chords, pull)


def sensitivity(found: Circle, own: Complex, shared: Complex) -> Array:
    """
    Return Σ|x·∂c/∂x| + ``abs(c)`` of the centre c over all inputs x; (…).

    Times 2⁻⁵³ it is what rounding the inputs alone can make of the centre.

    Parameters
    ----------
    found
        The circle.
    own
        x·∂A/∂x of each place by the inputs that move it alone, (…, 3, k).
    shared
        x·∂A/∂x of each place by the inputs that move all three, (…, 3, m).

    """
    with np.errstate(all='ignore'):
        back = np.conj(found.spokes)[..., None]
        alone = np.abs(found.pull)[..., None] * np.abs((back * own).real)
        together = np.abs((found.pull[..., None] * (back * shared).real).sum(-2))
        total: Array = alone.sum((-2, -1)) + together.sum(-1) + np.abs(found.centre)
    return total


def number(place: Place) -> Complex:
    """Return a place as the nearest complex number."""
    found = np.empty(place[0][0].shape, np.complex128)
    found.real, found.imag = place[0][0], place[1][0]
    return found


def _at(places: Place, index: int) -> Place:
    (x, x_low), (y, y_low) = places
    return (x[..., index], x_low[..., index]), (y[..., index], y_low[..., index])


def _minus(one: Place, other: Place) -> Place:
    return minus(one[0], other[0]), minus(one[1], other[1])
