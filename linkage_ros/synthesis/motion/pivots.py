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
The other ends of links, found from where one end is in three poses; any number of them at once.

A pin A of the coupler has three places in the ground, P + e^{iθ}·a for the poses (P, θ); the
circle through them has the fixed pivot in its centre. Seen from the coupler it is the fixed pivot
O that has three places, e^{−iθ}·(O − P), and the moving pivot is in the centre of these (L.
Burmester, Lehrbuch der Kinematik, 1888).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from linkage_ros.kinematics.batch import Array, Complex
from linkage_ros.kinematics.rounding import UNIT_ROUNDOFF
from linkage_ros.synthesis.double_double import minus, plus, sine_cosine, times, Twofold
from linkage_ros.synthesis.motion.circle import circle, sensitivity
import numpy as np
from numpy.typing import ArrayLike

TRUSTED = 2.0
"""Units of roundoff times sensitivity that the error of a pivot stays within: one for the rounding
of what is given, and one for what is worked out here, which measured is a third of that."""


class Links(NamedTuple):
    """
    Links that lead from fixed pivots to moving ones; any number of them at once.

    Attributes
    ----------
    pivots
        The pivots that were found, (…), in [m]: fixed ones in the ground's frame, moving ones in
        the coupler's. Infinite or nan where there is none.
    arms
        From the fixed pivot to the moving one in the ground's frame, at each pose, (…, 3).
    sensitivity
        Σ|x ∂p/∂x| + ``abs(p)`` of each pivot p over poses and given pivot x; (…). Times 2⁻⁵³ it
        is what rounding these alone can make of the pivot.
    chords
        Between the places that the given pivot has, each opposite to its own, (…, 3).

    """

    pivots: Complex
    arms: Complex
    sensitivity: Array
    chords: Complex

    @property
    def lengths(self) -> Array:
        """Return the lengths of the links, (…)."""
        return np.abs(self.arms[..., 0])

    @property
    def digits(self) -> Array:
        """Return how many digits of each pivot, on the scale of its link, can be trusted; (…)."""
        with np.errstate(all='ignore'):
            lost = TRUSTED * UNIT_ROUNDOFF * self.sensitivity / self.lengths
            digits: Array = np.clip(np.nan_to_num(-np.log10(lost), nan=0.0), 0.0, 16.0)
        return digits


def fixed_pivots(places: Complex, angles: Array, moving: ArrayLike) -> Links:
    """
    Return the links that carry moving pivots (…) through poses (…, 3); nothing is raised.

    Parameters
    ----------
    places, angles
        Of the coupler, in [m] and [rad].
    moving
        In the coupler's frame, in [m].

    """
    point = np.asarray(moving, np.complex128)[..., None]
    sine, cosine = sine_cosine(_twofold(angles))
    x, y = _turned(_twofold(point.real), _twofold(point.imag), cosine, sine)
    found = circle((plus(_twofold(places.real), x), plus(_twofold(places.imag), y)))
    turn = cosine[0] + 1j * sine[0]
    own = np.stack(_every(places.real, 1j * places.imag, 1j * angles * turn * point), -1)
    shared = np.stack(_every(turn * point.real, 1j * turn * point.imag), -1)
    return Links(found.centre, found.spokes, sensitivity(found, own, shared), found.chords)


def moving_pivots(places: Complex, angles: Array, fixed: ArrayLike) -> Links:
    """
    Return the links that lead from fixed pivots (…) to poses (…, 3); nothing is raised.

    Parameters
    ----------
    places, angles
        Of the coupler, in [m] and [rad].
    fixed
        In the ground's frame, in [m].

    """
    point = np.asarray(fixed, np.complex128)[..., None]
    sine, cosine = sine_cosine(_twofold(-angles))
    x = minus(_twofold(point.real), _twofold(places.real))
    y = minus(_twofold(point.imag), _twofold(places.imag))
    found = circle(_turned(x, y, cosine, sine))
    turn = cosine[0] + 1j * sine[0]
    about = -1j * angles * turn * (x[0] + 1j * y[0])
    own = np.stack(_every(-turn * places.real, -1j * turn * places.imag, about), -1)
    shared = np.stack(_every(turn * point.real, 1j * turn * point.imag), -1)
    arms = -np.conj(turn) * found.spokes
    return Links(found.centre, arms, sensitivity(found, own, shared), found.chords)


def _turned(x: Twofold, y: Twofold, cosine: Twofold, sine: Twofold) -> tuple[Twofold, Twofold]:
    return (
        minus(times(cosine, x), times(sine, y)),
        plus(times(sine, x), times(cosine, y)),
    )


def _twofold(numbers: ArrayLike) -> Twofold:
    high = np.asarray(numbers, np.float64)
    return high, np.zeros_like(high)


def _every(*numbers: ArrayLike) -> list[Any]:
    return list(np.broadcast_arrays(*numbers))
