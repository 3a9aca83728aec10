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
Coupler curves of many four-bars at once, and how they change with every dimension.

A four-bar is a row of nine numbers (`COLUMNS`): the crank's pivot p, the direction φ of the
ground, the logarithms of the lengths a, b, c, d, and the traced point w in the coupler's frame. At
the crank angle θ, counted from the ground line, ::

    z = p + e^{iφ}·(a·e^{iθ} + w·e^{iβ}),   a·e^{iθ} + b·e^{iβ} = d + c·e^{iψ}.

The coupler's direction needs no angle: with D = d − a·e^{iθ} from the crank's pin to the rocker's
pivot, x = (b² + |D|² − c²)/2b and y = √(|D|² − x²) along and across b, ::

    e^{iβ} = D·(x ± i·y)/|D|²,   + where the rocker's pin is on the left of D.

Its derivatives follow from |a·e^{iθ} + b·e^{iβ} − d| = c.
"""

from __future__ import annotations

from typing import NamedTuple

from linkage_ros.kinematics.batch import Array, Complex, Mask
import numpy as np

COLUMNS = ('x', 'y', 'phi', 'ln_a', 'ln_b', 'ln_c', 'ln_d', 'w_x', 'w_y')
"""What a row of dimensions holds."""

LENGTHS = slice(3, 7)
POINT = slice(7, 9)
"""Where in it the logarithms of the lengths are, and the traced point."""

_SPARE = 1e-9
"""How far a loop stays from folding, relative to its longest diagonal: a root has a derivative."""


class Slopes(NamedTuple):
    """
    Places of the traced point, and their derivatives.

    Attributes
    ----------
    places
        (n, N).
    by_dimension
        (n, N, 9), in the order of `COLUMNS`.
    by_angle
        (n, N), by the crank angle θ.

    """

    places: Complex
    by_dimension: Complex
    by_angle: Complex


def coupler_directions(
    crank: Complex, b: Array, c: Array, d: Array, side: Array
) -> tuple[Complex, Array]:
    """
    Return e^{iβ}, and y², which is below 0 where the loop is open.

    Parameters
    ----------
    crank
        The crank vector a·e^{iθ}, (n, N).
    b, c, d
        Lengths, (n, 1).
    side
        1 for left and −1 for right, (n, 1).

    """
    diagonal = d - crank
    square = diagonal.real**2 + diagonal.imag**2
    along = (square + (b * b - c * c)) / (2.0 * b)
    across_square = square - along * along
    across = np.sqrt(np.maximum(across_square, 0.0))
    across *= side
    turned = np.empty_like(diagonal)
    turned.real = diagonal.real * along - diagonal.imag * across
    turned.imag = diagonal.real * across + diagonal.imag * along
    turned /= square
    return turned, across_square


def slopes(rows: Array, angles: Array, side: Array) -> Slopes:
    """Return places and derivatives of four-bars (n, 9) at crank angles (n, N)."""
    a, b, c, d = np.exp(rows[:, LENGTHS]).T[:, :, None]
    frame = np.exp(1j * rows[:, 2:3])
    point = rows[:, 7:8] + 1j * rows[:, 8:9]
    unit = np.exp(1j * angles)
    crank = a * unit
    coupler, _ = coupler_directions(crank, b, c, d, side[:, None])
    rocker = crank + b * coupler - d
    back = np.conj(rocker)
    # d(|R|²)/dβ, which vanishes where the loop folds.
    fold = -b * (back * coupler).imag
    by = np.empty((*angles.shape, len(COLUMNS)), dtype=np.complex128)
    arm = frame * point * coupler
    turn = 1j * arm / fold
    swing = frame * crank
    by[..., 0] = 1.0
    by[..., 1] = 1j
    by[..., 2] = 1j * (swing + arm)
    by[..., 3] = swing - turn * (back * crank).real
    by[..., 4] = -turn * (b * (back * coupler).real)
    by[..., 5] = turn * (c * c)
    by[..., 6] = turn * (d * rocker.real)
    by[..., 7] = frame * coupler
    by[..., 8] = 1j * by[..., 7]
    by_angle = 1j * swing + turn * (back * crank).imag
    pivot = rows[:, 0:1] + 1j * rows[:, 1:2]
    return Slopes(pivot + swing + arm, by, by_angle)


def folds(rows: Array, angles: Array) -> tuple[Array, Array, Array]:
    """
    Return the cotangent of the transmission angle, and its derivatives.

    It is 0 where coupler and rocker are square, and without bounds where they are in line. With
    cos μ = (b² + c² − |D|²)/2bc, d(cot μ) = d(cos μ)/sin³ μ.

    Parameters
    ----------
    rows
        (n, 9).
    angles
        Of the crank, (n, N).

    Returns
    -------
    tuple
        Cotangents (n, N), by dimension (n, N, 9), by crank angle (n, N).

    """
    a, b, c, d = np.exp(rows[:, LENGTHS]).T[:, :, None]
    cosine, swing = np.cos(angles), 2.0 * a * d * np.sin(angles)
    square = (a - d) ** 2 + 2.0 * a * d * (1.0 - cosine)
    twice = 2.0 * b * c
    inward = (b * b + c * c - square) / twice
    sine = np.sqrt(np.maximum(1.0 - inward * inward, 1e-30))
    steep = 1.0 / (twice * sine**3)
    by = np.zeros((*square.shape, len(COLUMNS)))
    by[..., 3] = -steep * (2.0 * a * (a - d * cosine))
    by[..., 4] = steep * (b * b - c * c + square)
    by[..., 5] = steep * (c * c - b * b + square)
    by[..., 6] = -steep * (2.0 * d * (d - a * cosine))
    return inward / sine, by, -steep * swing


def diagonals(a: Array, d: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """
    Return the shortest and the longest diagonal from the crank's pin to the rocker's pivot.

    Parameters
    ----------
    a, d
        Lengths of crank and ground.
    low, high
        The crank angles that it turns between, counted from the ground line, in [rad].

    """
    first, last = np.cos(low), np.cos(high)
    nearest = np.where(_holds(low, high, 0.0), 1.0, np.maximum(first, last))
    farthest = np.where(_holds(low, high, np.pi), -1.0, np.minimum(first, last))
    constant, factor = (a - d) ** 2, 2.0 * a * d
    return (
        np.sqrt(constant + factor * (1.0 - nearest)),
        np.sqrt(constant + factor * (1.0 - farthest)),
    )


def closes(rows: Array, low: Array, high: Array) -> Mask:
    """Return which four-bars (n, 9) stay closed, and off a toggle, all the way between angles."""
    a, b, c, d = np.exp(rows[:, LENGTHS]).T
    shortest, longest = diagonals(a, d, low, high)
    spare = _SPARE * longest
    closed: Mask = (b + c > longest + spare) & (np.abs(b - c) < shortest - spare)
    return closed


def _holds(low: Array, high: Array, angle: float) -> Mask:
    """Return whether an angle, or it and whole turns, lies between two."""
    turn = 2.0 * np.pi
    held: Mask = np.ceil((low - angle) / turn) * turn + angle <= high
    return held
