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
One four-bar with free zeros: polished by Newton's method, and what it is worth.

The last step takes what is left of the equations in sums of two doubles: it may be smaller than
what their terms are rounded by, and no more may be lost than rounding the angles loses.

Freudenstein's equation of a pair, less that of the first (`free_zeros` has the derivation), is

    k1·Im(p·e^{iβ}) + k2·Im(q·e^{iα}) = Im(r·e^{i(α − β)}).
"""

from __future__ import annotations

from cmath import rect
from collections.abc import Sequence
from math import pi
from typing import Literal, NamedTuple

from linkage_ros.kinematics.rounding import UNIT_ROUNDOFF
from linkage_ros.synthesis.double_double import (
    minus,
    over,
    plus,
    sine,
    sine_cosine,
    times,
    two_sum,
    Twofold,
)
from linkage_ros.synthesis.pairs.freudenstein import LONGEST, TRUSTED
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Moved = Literal['rocker', 'crank', 'both']
Lost = Literal['imaginary', 'infinite', 'vague']

NOISE = 8.0
"""Times what rounding the angles does: below it nothing can be told from zero."""

_UNKNOWNS: dict[Moved, list[int]] = {'crank': [0, 1, 2], 'rocker': [0, 1, 3], 'both': [0, 1, 2, 3]}
"""Of k1, k2, α, β: what is not given."""

_STEPS = 8
"""Of Newton's method at most: two reach rounding level, but for a double root."""

_VAGUE = 0.1
"""Of a link: what it may not be uncertain by."""


class Differences(NamedTuple):
    """
    What the other pairs have over the first, as rows of length 1.

    Attributes
    ----------
    theta, phi
        All angles; (n,).
    p, q, r
        As above, complex, divided by the size; (n − 1,).
    size
        Root of abs(p)² + abs(q)² + abs(r)²; (n − 1,).
    noise
        What rounding the angles does to each row; (n − 1,).

    """

    theta: Array
    phi: Array
    p: NDArray[np.complex128]
    q: NDArray[np.complex128]
    r: NDArray[np.complex128]
    size: Array
    noise: Array


class Solution(NamedTuple):
    """
    A four-bar on a ground of 1.

    Attributes
    ----------
    lengths
        Of crank, coupler and rocker, the first and the last signed; (3,).
    zeros
        α and β, in [−π/2, π/2]; (2,).
    condition, sensitivity
        As in `free_zeros.FreeZeros`.

    """

    lengths: Array
    zeros: Array
    condition: float
    sensitivity: Array


def differences(crank: Sequence[float], rocker: Sequence[float]) -> Differences:
    """Return what the other pairs have over the first; angles in [rad], (n,)."""
    theta, phi = np.asarray(crank, np.float64), np.asarray(rocker, np.float64)
    by_theta, by_phi = 0.5 * (theta[1:] - theta[0]), 0.5 * (phi[1:] - phi[0])
    mean_theta, mean_phi = 0.5 * (theta[1:] + theta[0]), 0.5 * (phi[1:] + phi[0])
    p = np.sin(by_phi) * np.exp(1j * mean_phi)
    q = np.sin(by_theta) * np.exp(1j * mean_theta)
    r = np.sin(by_theta - by_phi) * np.exp(1j * (mean_theta - mean_phi))
    size: Array = np.sqrt(np.abs(p) ** 2 + np.abs(q) ** 2 + np.abs(r) ** 2)
    angles = np.abs(theta) + np.abs(phi)
    noise = UNIT_ROUNDOFF * (1.0 + (angles[1:] + angles[0]) / size)
    return Differences(theta, phi, p / size, q / size, r / size, size, noise)


def polished(rows: Differences, alpha: float, beta: float, moved: Moved) -> Solution | Lost:
    """Return the four-bar next to these zeros, or why there is none."""
    columns = np.stack(_columns(rows, alpha, beta), -1)
    k1, k2, one = np.linalg.svd(columns * (1.0, 1.0, -1.0))[2][2]
    if abs(one) * LONGEST <= max(abs(k1), abs(k2)):
        return 'infinite'
    free = _UNKNOWNS[moved]
    best = np.array([k1 / one, k2 / one, alpha, beta])
    least = _residual(rows, best)
    for _ in range(_STEPS):
        tried = best.copy()
        # A double root leaves no full rank: the shortest step is as good as any.
        slopes = _slopes(rows, best)[:, free]
        tried[free] -= np.linalg.lstsq(slopes, _left(rows, best), rcond=None)[0]
        residual = _residual(rows, tried)
        if not residual < least:
            break
        best, least = tried, residual
    if not least <= NOISE:
        return 'imaginary'
    if not 1.0 / LONGEST < min(abs(best[:2])) <= max(abs(best[:2])) < LONGEST:
        return 'infinite'
    with np.errstate(all='ignore'):
        solution = _valued(rows, best, free)
        lost = TRUSTED * UNIT_ROUNDOFF * solution.sensitivity[:3] / np.abs(solution.lengths)
    return solution if np.all(lost < _VAGUE) else 'vague'


def same(one: Solution, other: Solution) -> bool:
    """Return whether two differ by rounding only, as those near a double root may."""
    (pins, lost), (others, lost_too) = _pins(one), _pins(other)
    return bool(np.all(np.abs(pins - others) <= NOISE * UNIT_ROUNDOFF * (lost + lost_too)))


def _columns(rows: Differences, alpha: float, beta: float) -> tuple[Array, Array, Array]:
    """Return Im(p·e^{iβ}), Im(q·e^{iα}) and Im(r·e^{i(α − β)}); (n − 1,) each."""
    return (
        (rows.p * rect(1.0, beta)).imag,
        (rows.q * rect(1.0, alpha)).imag,
        (rows.r * rect(1.0, alpha - beta)).imag,
    )


def _left(rows: Differences, unknowns: Array) -> Array:
    """Return what the equations leave; (n − 1,)."""
    k1, k2, alpha, beta = unknowns
    P, Q, R = _columns(rows, alpha, beta)
    left: Array = k1 * P + k2 * Q - R
    return left


def _left_exactly(rows: Differences, unknowns: Array) -> Array:
    """Return what the equations leave, by sums of two doubles; (n − 1,)."""
    k1, k2, alpha, beta = _twofold(unknowns)
    by_theta, by_phi = (_half(two_sum(z[1:], -z[:1])) for z in (rows.theta, rows.phi))
    theta, phi = (_half(two_sum(z[1:], z[:1])) for z in (rows.theta, rows.phi))
    theta, phi = plus(theta, alpha), plus(phi, beta)
    P, Q = times(sine(phi), sine(by_phi)), times(sine(theta), sine(by_theta))
    R = times(sine(minus(theta, phi)), sine(minus(by_theta, by_phi)))
    left: Array = minus(plus(times(k1, P), times(k2, Q)), R)[0] / rows.size
    return left


def _links(
    rows: Differences, unknowns: Array, rest: Array
) -> tuple[float, float, complex, complex, complex]:
    """
    Return the lengths of crank and rocker, and where crank, rocker and coupler point at first.

    By sums of two doubles: where the coupler is short, crank and rocker cancel.
    """
    (one,) = _twofold(np.ones(1))
    parts = zip(_twofold(unknowns), _twofold(rest), strict=True)
    k1, k2, alpha, beta = (plus(value, low) for value, low in parts)
    a, c = over(one, k1), over((-one[0], one[1]), k2)
    crank = [times(a, z) for z in sine_cosine(plus((rows.theta[:1], one[1]), alpha))]
    rocker = [times(c, z) for z in sine_cosine(plus((rows.phi[:1], one[1]), beta))]
    y, x = minus(rocker[0], crank[0]), plus(one, minus(rocker[1], crank[1]))
    turned = [complex(x[0].item(), y[0].item()) for y, x in (crank, rocker, (y, x))]
    return a[0].item(), c[0].item(), turned[0], turned[1], turned[2]


def _twofold(values: Array) -> list[Twofold]:
    return [(value, np.zeros(1)) for value in values[:, None]]


def _half(angle: Twofold) -> Twofold:
    return 0.5 * angle[0], 0.5 * angle[1]


def _residual(rows: Differences, unknowns: Array) -> float:
    """Return the largest of what is left, by what rounding the angles does to it."""
    left = np.abs(_left(rows, unknowns)) / rows.noise
    return float(np.max(left)) / float(max(1.0, *np.abs(unknowns[:2])))


def _slopes(rows: Differences, unknowns: Array) -> Array:
    """Return the derivatives of what is left by k1, k2, α and β; (n − 1, 4)."""
    k1, k2, alpha, beta = unknowns
    P, Q, _ = _columns(rows, alpha, beta)
    of_p, of_q = (rows.p * rect(1.0, beta)).real, (rows.q * rect(1.0, alpha)).real
    of_r = (rows.r * rect(1.0, alpha - beta)).real
    return np.stack((P, Q, k2 * of_q - of_r, k1 * of_p + of_r), -1)


def _valued(rows: Differences, unknowns: Array, free: list[int]) -> Solution:
    """
    Return the links, and what they are worth.

    By a pair's own angles its equation moves by g = sin(θ + α − φ − β) − k2·sin(θ + α) and
    h = −sin(θ + α − φ − β) − k1·sin(φ + β), its difference by −g/2 and −h/2; by those of the first
    pair all differences move the other way.
    """
    k1, k2, alpha, beta = unknowns
    slopes = _slopes(rows, unknowns)[:, free]
    across = np.linalg.norm(slopes, axis=0)
    scaled = slopes / across
    condition = float(np.linalg.cond(scaled / np.linalg.norm(scaled, axis=1)[:, None]))
    inverse = np.zeros((4, len(free)))
    inverse[free] = _inverse(scaled) / across[:, None] / rows.size
    t, p = rows.theta + alpha, rows.phi + beta
    by = np.sin(t - p)
    parts = np.concatenate((-inverse.sum(-1, keepdims=True), inverse), -1) / 2.0
    of_k1, of_k2, of_alpha, of_beta = np.concatenate(
        (parts * (by - k2 * np.sin(t)), -parts * (by + k1 * np.sin(p))), -1
    )
    rest = np.zeros(4)
    rest[free] = -inverse[free] @ (rows.size * _left_exactly(rows, unknowns))
    a, c, crank, rocker, coupler = _links(rows, unknowns, rest)
    of_a, of_c = -a * a * of_k1, c * c * of_k2
    # The coupler closes the first pair, whose own angles turn crank and rocker too.
    of_t, of_p = of_alpha.copy(), of_beta.copy()
    of_t[0] += 1.0
    of_p[len(p)] += 1.0
    moved = rocker * (of_c / c + 1j * of_p) - crank * (of_a / a + 1j * of_t)
    of_b = (np.conj(coupler) * moved).real / abs(coupler)
    (alpha, sign_a), (beta, sign_c) = _acute(alpha + rest[2]), _acute(beta + rest[3])
    values = np.array([sign_a * a, abs(coupler), sign_c * c, alpha, beta])
    angles = np.abs(np.concatenate((rows.theta, rows.phi)))
    lost = np.abs(np.stack((of_a, of_b, of_c, of_alpha, of_beta)))
    sensitivity: Array = lost @ angles + np.abs(values)
    return Solution(values[:3], values[3:], condition, sensitivity)


def _inverse(matrix: Array) -> Array:
    try:
        return np.asarray(np.linalg.inv(matrix), np.float64)
    except np.linalg.LinAlgError:
        return np.full_like(matrix, np.nan)


def _acute(angle: float) -> tuple[float, float]:
    """Return an angle less its half turns, in [−π/2, π/2], and −1.0 where these are odd."""
    halves = round(angle / pi)
    return angle - pi * halves, -1.0 if halves % 2 else 1.0


def _pins(solution: Solution) -> tuple[NDArray[np.complex128], Array]:
    """Return where the pins of crank and rocker lie in their frames, and how sensitive; (2,)."""
    lengths = solution.lengths[::2]
    sensitivity = solution.sensitivity[[0, 2]] + np.abs(lengths) * solution.sensitivity[3:]
    return lengths * np.exp(1j * solution.zeros), sensitivity
