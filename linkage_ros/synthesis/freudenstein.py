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
Freudenstein's equation: the four-bar whose crank and rocker stand at given pairs of angles.

The loop a·e^{iθ} + b·e^{iγ} = d + c·e^{iφ}, freed of the coupler's angle γ, is linear in three
numbers (F. Freudenstein, Approximate synthesis of four-bar linkages, Transactions of the ASME 77
(1955) 853-861)::

    k1·cos φ + k2·cos θ + k3 = cos(θ − φ)
    k1 = d/a,  k2 = −d/c,  k3 = (a² − b² + c² + d²)/(2ac)

Three pairs fix them. The first equation is taken from the others, so that k3 falls out; what is
left is a 2×2 system of differences of cosines. These are products,

    cos u − cos v = −2·sin((u + v)/2)·sin((u − v)/2),

so that pairs near each other lose no digit, and its determinants are worked out with the error of
their products (C.-P. Jeannerod, N. Louvet and J.-M. Muller, Further analysis of Kahan's algorithm
for the accurate computation of 2x2 determinants, Mathematics of Computation 82 (2013)). What error
remains is that of the angles themselves: `ThreePairs.sensitivity` says how much.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import degrees, isfinite, remainder, tau
from typing import NamedTuple

from linkage_ros.errors import SynthesisError
from linkage_ros.kinematics.diagonal import UNIT_ROUNDOFF
from linkage_ros.synthesis.design import Design, FourBar, Wanted
from linkage_ros.synthesis.proof import assembled
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

TRUSTED = 4.0
"""Units of roundoff times sensitivity that the error of a length stays within; measured."""

_SPLITTER = 2.0**27 + 1.0
_SAME = 1e-12
"""Angles nearer than this are the same, in [rad]."""

_LONGEST = 1e9
"""In grounds: a link beyond it is an infinite one but for rounding."""


class Links(NamedTuple):
    """
    The links of a four-bar with a ground of length 1; any number of them at once.

    Attributes
    ----------
    k
        Freudenstein's k1, k2, k3; (…, 3).
    lengths
        Of crank, coupler and rocker; (…, 3). Crank and rocker are negative where the link points
        the other way. Infinite or nan where there is no such link.

    """

    k: Array
    lengths: Array


class ThreePairs(NamedTuple):
    """
    What three pairs come to, and what it is worth; any number of them at once.

    Attributes
    ----------
    k, lengths
        As in `Links`.
    condition
        Of the matrix of rows (cos φ, cos θ, 1), by the 2-norm; (…).
    sensitivity
        Of each length L, Σ|x ∂L/∂x| + ``abs(L)`` over the six angles x; (…, 3). Times 2⁻⁵³ it is
        what rounding the angles alone can make of a length.
    gradient
        ∂L/∂x of each length by the three crank angles, then by the three rocker angles, per
        [rad]; (…, 3, 6).

    """

    k: Array
    lengths: Array
    condition: Array
    sensitivity: Array
    gradient: Array

    @property
    def digits(self) -> Array:
        """Return how many digits of each length can be trusted, 0 to 16; (…, 3)."""
        with np.errstate(all='ignore'):
            lost = TRUSTED * UNIT_ROUNDOFF * self.sensitivity / np.abs(self.lengths)
            digits: Array = np.clip(np.nan_to_num(-np.log10(lost), nan=0.0), 0.0, 16.0)
        return digits


def links(crank: ArrayLike, rocker: ArrayLike) -> Links:
    """
    Solve for three pairs, or for many threes at once.

    Nothing is raised: what does not exist is infinite or nan.

    Parameters
    ----------
    crank, rocker
        Angles θ and φ, in [rad]; (…, 3).

    """
    theta, phi = np.asarray(crank, np.float64), np.asarray(rocker, np.float64)
    with np.errstate(all='ignore'):
        P, Q, R = _differences(theta, phi)
        determinant = _determinant(P, Q)
        k1 = _determinant(R, Q) / determinant
        k2 = _determinant(P, R) / determinant
        t, p = theta[..., 0], phi[..., 0]
        k3 = np.cos(t - p) - k1 * np.cos(p) - k2 * np.cos(t)
        a, c = 1.0 / k1, -1.0 / k2
        # Not from k3, where long links leave little: the coupler closes the first position.
        b = np.hypot(1.0 + c * np.cos(p) - a * np.cos(t), c * np.sin(p) - a * np.sin(t))
    return Links(np.stack((k1, k2, k3), -1), np.stack((a, b, c), -1))


def three_pairs(crank: ArrayLike, rocker: ArrayLike) -> ThreePairs:
    """
    Solve for three pairs, or for many threes at once, and say what the result is worth.

    Nothing is raised: what does not exist is infinite or nan.

    Parameters
    ----------
    crank, rocker
        Angles θ and φ, in [rad]; (…, 3).

    """
    theta, phi = np.asarray(crank, np.float64), np.asarray(rocker, np.float64)
    k, lengths = links(theta, phi)
    with np.errstate(all='ignore'):
        matrix = np.stack((np.cos(phi), np.cos(theta), np.ones_like(theta)), -1)
        finite = np.isfinite(matrix).all((-2, -1))
        condition = np.linalg.cond(np.where(finite[..., None, None], matrix, 0.0))
        gradient = _gradient(theta, phi, k, lengths)
        angles = np.abs(np.concatenate((theta, phi), -1))
        sensitivity = (np.abs(gradient) @ angles[..., None])[..., 0] + np.abs(lengths)
    return ThreePairs(k, lengths, condition, sensitivity, gradient)


def exact(
    crank: Sequence[float], rocker: Sequence[float], ground: float
) -> tuple[Design, ThreePairs]:
    """
    Design the four-bar of three pairs.

    Parameters
    ----------
    crank, rocker
        Three angles each, in [rad].
    ground
        Length of the ground, in [m].

    Raises
    ------
    SynthesisError
        Where two pairs are equal, or no four-bar of finite links has the three.

    """
    check_pairs(crank, rocker, ground)
    found = three_pairs(crank, rocker)
    a, b, c = (float(length) for length in found.lengths)
    if not isfinite(found.condition) or found.condition * UNIT_ROUNDOFF > 1.0:
        raise SynthesisError(
            'pairs',
            'the three equations depend on each other, so that no four-bar or any number of them '
            'fits',
            'move one of the angles, or free the zero angles',
        )
    for link, length in (('crank', a), ('rocker', c)):
        if not abs(length) < _LONGEST:
            raise SynthesisError(
                'pairs',
                f'the {link} would be infinitely long: a slider, not a link, does it',
                'move one of the angles',
            )
    if not all(digits >= 1.0 for digits in found.digits):
        raise SynthesisError(
            'pairs',
            f'the links cannot be told: rounding the angles alone changes one by '
            f'{float(np.max(found.sensitivity / np.abs(found.lengths))) * UNIT_ROUNDOFF:.0%}',
            'move one of the angles',
        )
    four_bar = FourBar.of_lengths(a * ground, b * ground, c * ground, ground)
    return assembled(Design(four_bar, wanted_of(crank, rocker))), found


def wanted_of(crank: Sequence[float], rocker: Sequence[float]) -> tuple[Wanted, ...]:
    """Return pairs as positions that are wanted."""
    return tuple(Wanted(t, p) for t, p in zip(crank, rocker, strict=True))


def check_pairs(crank: Sequence[float], rocker: Sequence[float], ground: float) -> None:
    """
    Refuse pairs that no four-bar can have.

    Raises
    ------
    SynthesisError
        With the numbers of the pairs, counted from 1.

    """
    if not 0.0 < ground < _LONGEST:
        raise SynthesisError('ground', f'{ground!r} m is no length', 'give it one above 0')
    for number, pair in enumerate(zip(crank, rocker, strict=True), 1):
        if not all(map(isfinite, pair)):
            raise SynthesisError(f'pair {number}', f'{pair} is no pair', 'write two numbers')
    for (i, one), (j, other) in combinations(enumerate(zip(crank, rocker, strict=True), 1), 2):
        t, p = (abs(remainder(u - v, tau)) for u, v in zip(one, other, strict=True))
        said = f'{degrees(one[0]):.10g}° → {degrees(one[1]):.10g}°'
        if max(t, p) < _SAME:
            raise SynthesisError(
                f'pairs {i} and {j}', f'are the same, {said}', 'give each position once'
            )


def fit_equation(crank: Sequence[float], rocker: Sequence[float], ground: float) -> Design:
    """
    Design the four-bar that comes nearest to more than three pairs, by Freudenstein's equation.

    What is least is the sum of squares of what the equation leaves, not of the rocker's error;
    `angle_fit.fit_angles` starts from here.

    Raises
    ------
    SynthesisError
        Where the pairs do not fix a four-bar, or its coupler would be imaginary.

    """
    check_pairs(crank, rocker, ground)
    k = fitted(crank, rocker)
    k1, k2, k3 = (float(value) for value in k)
    if not min(abs(k1), abs(k2)) > 1.0 / _LONGEST:
        raise SynthesisError(
            'pairs', 'a link of the nearest four-bar would be infinitely long', 'move some angles'
        )
    a, c = 1.0 / k1, -1.0 / k2
    square = (a - c) ** 2 + 1.0 + 2.0 * a * c * (1.0 - k3)
    if not square > 0.0:
        raise SynthesisError(
            'pairs',
            f'the coupler of the nearest four-bar would be imaginary, its square {square:.3g} '
            "of the ground's",
            'use fewer pairs, or nearer ones',
        )
    four_bar = FourBar.of_lengths(a * ground, square**0.5 * ground, c * ground, ground)
    return assembled(Design(four_bar, wanted_of(crank, rocker)))


def fitted(crank: ArrayLike, rocker: ArrayLike) -> Array:
    """
    Return k1, k2 and k3 that leave least of Freudenstein's equation; (3,).

    Raises
    ------
    SynthesisError
        Where the equations depend on each other.

    """
    theta, phi = np.asarray(crank, np.float64), np.asarray(rocker, np.float64)
    matrix = np.stack((np.cos(phi), np.cos(theta), np.ones_like(theta)), -1)
    k, _, rank, _ = np.linalg.lstsq(matrix, np.cos(theta - phi), rcond=None)
    if rank < 3:
        raise SynthesisError(
            'pairs',
            f'the {len(theta)} equations depend on each other',
            'move some angles, or free the zero angles',
        )
    return np.asarray(k)


def _two_product(x: Array, y: Array) -> tuple[Array, Array]:
    """Return a product and its rounding error (T. J. Dekker, Numer. Math. 18 (1971))."""
    product = x * y
    big = _SPLITTER * x
    x_high = big - (big - x)
    big = _SPLITTER * y
    y_high = big - (big - y)
    x_low, y_low = x - x_high, y - y_high
    error = ((x_high * y_high - product) + x_high * y_low + x_low * y_high) + x_low * y_low
    return product, error


def _two_sum(x: Array, y: Array) -> tuple[Array, Array]:
    """Return a sum and its rounding error (D. E. Knuth, TAOCP vol. 2, 4.2.2)."""
    total = x + y
    part = total - x
    return total, (x - (total - part)) + (y - part)


def _differences(theta: Array, phi: Array) -> tuple[Array, Array, Array]:
    """
    Return what the second and third equation have over the first, each (…, 2), divided by −2.

    Of cos φ, of cos θ and of cos(θ − φ). Differences of angles are taken with their rounding
    errors: the third, of four angles, may be nothing but these.
    """
    theta_by, theta_rest = _two_sum(theta[..., 1:], -theta[..., :1])
    phi_by, phi_rest = _two_sum(phi[..., 1:], -phi[..., :1])
    by, rest = _two_sum(theta_by, -phi_by)
    by += rest + (theta_rest - phi_rest)
    theta_mean = 0.5 * (theta[..., 1:] + theta[..., :1])
    phi_mean = 0.5 * (phi[..., 1:] + phi[..., :1])
    return (
        np.sin(phi_mean) * np.sin(0.5 * phi_by),
        np.sin(theta_mean) * np.sin(0.5 * theta_by),
        np.sin(theta_mean - phi_mean) * np.sin(0.5 * by),
    )


def _determinant(P: Array, Q: Array) -> Array:
    """Return P0·Q1 − P1·Q0."""
    one, one_error = _two_product(P[..., 0], Q[..., 1])
    other, other_error = _two_product(P[..., 1], Q[..., 0])
    return (one - other) + (one_error - other_error)


def _gradient(theta: Array, phi: Array, k: Array, lengths: Array) -> Array:
    """
    Differentiate the lengths by the angles.

    Row i of the system moves by g = −sin(θ − φ) + k2·sin θ with θᵢ, by sin(θ − φ) + k1·sin φ
    with φᵢ; k by that times column i of the inverse, whose columns are the cross products of the
    matrix's rows over their triple product, the determinant.
    """
    rows = np.stack((np.cos(phi), np.cos(theta), np.ones_like(theta)), -1)
    normals = np.stack(
        [np.cross(rows[..., (i + 1) % 3, :], rows[..., (i + 2) % 3, :]) for i in range(3)], -1
    )
    P, Q, _ = _differences(theta, phi)
    inverse = normals / (4.0 * _determinant(P, Q))[..., None, None]
    k1, k2, k3 = (k[..., i, None] for i in range(3))
    by_theta = k2 * np.sin(theta) - np.sin(theta - phi)
    by_phi = k1 * np.sin(phi) + np.sin(theta - phi)
    of_k = np.concatenate((inverse * by_theta[..., None, :], inverse * by_phi[..., None, :]), -1)
    a, b, c = (lengths[..., i, None] for i in range(3))
    of_a, of_c = -a * a * of_k[..., 0, :], c * c * of_k[..., 1, :]
    # b² = a² + c² + 1 − 2ac·k3
    of_b = ((a - c * k3) * of_a + (c - a * k3) * of_c - a * c * of_k[..., 2, :]) / b
    return np.stack((of_a, of_b, of_c), -2)
