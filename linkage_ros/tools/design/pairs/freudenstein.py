# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Freudenstein's equation: the four-bar for given pairs of crank and rocker angles.

The loop a·e^{iθ} + b·e^{iγ} = d + c·e^{iφ}, without the coupler's angle γ, is linear in three
numbers (F. Freudenstein, Approximate synthesis of four-bar linkages, Transactions of the ASME 77
(1955) 853-861)::

    k1·cos φ + k2·cos θ + k3 = cos(θ − φ)
    k1 = d/a,  k2 = −d/c,  k3 = (a² − b² + c² + d²)/(2ac)

Three pairs determine them (`System`, for thousands of triples at once). The first equation is
subtracted from the other two, which eliminates k3::

    k1·(cos φᵢ − cos φ₁) + k2·(cos θᵢ − cos θ₁) = cos(θᵢ − φᵢ) − cos(θ₁ − φ₁),  i = 2, 3

The differences are products,

    cos u − cos v = −2·sin((u + v)/2)·sin((u − v)/2),

of angles that are sums of two or four doubles, and are computed so. Determinants, lengths and the
coupler are computed in sums of two doubles too, so that they lose no more than rounding the angles
loses: at a change point, in a parallelogram or with a short coupler, terms cancel whatever the
angles are. So only the error of the angles remains: each length is within 4·2⁻⁵³ of its
sensitivity κ, the sum of its relative changes with each angle (`length_gradient`); if κ is too
large for any digit, no digit is trusted. More pairs are met by least squares. The coupler is real
whenever the angles are: b² is the mean, over the pairs, of the squared distance of crank pin and
rocker pin.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import degrees, remainder, tau
from typing import NamedTuple

from linkage_ros.errors import SynthesisError
from linkage_ros.kinematics import UNIT_ROUNDOFF
from linkage_ros.tools.design.design import Design, DesignRequest, FARTHEST, FourBar, SHORTEST
from linkage_ros.tools.design.double_double import (
    add,
    Array,
    divide,
    multiply,
    sine,
    sine_cosine,
    subtract,
    two_sum,
    Twofold,
)
from linkage_ros.tools.design.proof import assemble
import numpy as np
from numpy.typing import ArrayLike

MOVE = 'move one of the angles'

_SAME = 1e-12
"""Angles nearer than this count as equal, in [rad]."""

_FARTHEST = 1e9
"""Larger angles, in [rad], have lost the digits of their direction."""

_CONSISTENT = 1e-9
"""Equations with a smaller relative residual do not contradict each other."""

TRUSTED = 4.0
"""Bound of the error of a length, in units of roundoff times sensitivity; measured."""

LONGEST = 1e9
"""In grounds: the length of a longer link is indistinguishable from infinite."""

_NOISE = TRUSTED * UNIT_ROUNDOFF
_SHAKEN = 0.1

_BLOCK = 2048
"""Triples of pairs that are computed at once: they stay in the cache."""


class System(NamedTuple):
    """Freudenstein's equation for three pairs, and its solution for a ground of length 1."""

    # Angles of crank and rocker, in [rad]; (3, n).
    theta: Array
    phi: Array
    # cos φ, cos θ and cos(θ − φ) of the second and third pair minus the first, divided by
    # −2; (2, n).
    P: Array
    Q: Array
    R: Array
    last: Array  # P and Q of the third pair minus the second; (2, n)
    determinant: Array  # P0·Q1 − P1·Q0; (n,)
    k: Array  # k1, k2 and k3; (3, n)
    lengths: Array  # Lengths of crank, coupler and rocker, the first and the last signed; (3, n)
    coupler: Array  # Vector of the coupler in the first pair, x and y; (2, n)


def solve_pairs(theta: Array, phi: Array) -> System:
    """Solve three pairs, in [rad], (3, n); infinite or NaN without a solution."""
    with np.errstate(all='ignore'):
        P, Q, R = equation_differences(theta, phi)
        determinant, of_k1, of_k2 = _determinant(P, Q), _determinant(R, Q), _determinant(P, R)
        a, c = divide(determinant, of_k1), divide(determinant, (-of_k2[0], -of_k2[1]))
        # The coupler closes the first position. From k3, long links would leave few digits.
        nothing = np.zeros_like(theta[0])
        crank_y, crank_x = sine_cosine((theta[0], nothing))
        rocker_y, rocker_x = sine_cosine((phi[0], nothing))
        x, _ = add((nothing + 1.0, nothing), subtract(multiply(c, rocker_x), multiply(a, crank_x)))
        y, _ = subtract(multiply(c, rocker_y), multiply(a, crank_y))
        k1, k2 = divide(of_k1, determinant)[0], divide(of_k2, determinant)[0]
        k3 = np.cos(theta[0] - phi[0]) - k1 * rocker_x[0] - k2 * crank_x[0]
        return System(
            theta,
            phi,
            P[0],
            Q[0],
            R[0],
            np.stack([(high[1] - high[0]) + (low[1] - low[0]) for high, low in (P, Q)]),
            determinant[0],
            np.stack((k1, k2, k3)),
            np.stack((a[0], np.hypot(x, y), c[0])),
            np.stack((x, y)),
        )


def equation_differences(theta: Array, phi: Array) -> tuple[Twofold, Twofold, Twofold]:
    """
    Return all equations but the first minus the first, divided by −2, for angles (m, n) in [rad].

    The results are the differences of cos φ, cos θ and cos(θ − φ); (m − 1, n) each.
    """
    theta_by, phi_by = two_sum(theta[1:], -theta[:1]), two_sum(phi[1:], -phi[:1])
    theta_sum, phi_sum = two_sum(theta[1:], theta[:1]), two_sum(phi[1:], phi[:1])
    sums = (phi_sum, theta_sum, subtract(theta_sum, phi_sum))
    bys = (phi_by, theta_by, subtract(theta_by, phi_by))
    high = 0.5 * np.stack([term[0] for term in (*sums, *bys)])
    low = 0.5 * np.stack([term[1] for term in (*sums, *bys)])
    high, low = sine((high, low))
    high, low = multiply((high[:3], low[:3]), (high[3:], low[3:]))
    return (high[0], low[0]), (high[1], low[1]), (high[2], low[2])


def _determinant(x: Twofold, y: Twofold) -> Twofold:
    """Return x0·y1 − x1·y0."""
    high, low = multiply(x, (y[0][::-1], y[1][::-1]))
    return subtract((high[0], low[0]), (high[1], low[1]))


def length_gradient(system: System) -> Array:
    """
    Differentiate the lengths, and the direction of the coupler in the first pair, by the angles.

    The residual of equation i, k1·cos φ + k2·cos θ + k3 − cos(θ − φ), changes by sin(θ − φ) −
    k2·sin θ with θᵢ and by −sin(θ − φ) − k1·sin φ with φᵢ; k changes by that times minus column i
    of the inverse. The coupler is 1 + c·e^{iφ} − a·e^{iθ} in the first pair.

    The result, (4, 6, n) per [rad], has crank, coupler, rocker and direction by the three crank
    angles, then by the three rocker angles.
    """
    theta, phi = system.theta, system.phi
    k1, k2, _ = system.k
    a, b, c = system.lengths
    of_k1, of_k2 = _k_derivatives(system)
    across = np.sin(theta - phi)
    moves = np.concatenate((k2 * np.sin(theta) - across, k1 * np.sin(phi) + across))
    of_a = -a * a * np.concatenate((of_k1, of_k1)) * moves
    of_c = c * c * np.concatenate((of_k2, of_k2)) * moves
    # Crank and rocker in the frame of the coupler: along it and across.
    x, y = system.coupler / b
    crank_x, crank_y = np.cos(theta[0]), np.sin(theta[0])
    rocker_x, rocker_y = np.cos(phi[0]), np.sin(phi[0])
    crank_along, crank_across = x * crank_x + y * crank_y, x * crank_y - y * crank_x
    rocker_along, rocker_across = x * rocker_x + y * rocker_y, x * rocker_y - y * rocker_x
    of_b = rocker_along * of_c - crank_along * of_a
    of_b[0] += a * crank_across
    of_b[3] -= c * rocker_across
    turned = rocker_across * of_c - crank_across * of_a
    turned[0] -= a * crank_along
    turned[3] += c * rocker_along
    return np.stack((of_a, of_b, of_c, turned / b))


def determinant_sensitivity(system: System) -> Array:
    """
    Return Σ|x ∂D/∂x| / ``abs(D)`` of the determinant D over the six angles x; (n,).

    The trace of M⁻¹·dM is the differential of the logarithm of D.
    """
    of_k1, of_k2 = _k_derivatives(system)
    by_theta = np.sin(system.theta) * of_k2 * system.theta
    by_phi = np.sin(system.phi) * of_k1 * system.phi
    return np.asarray((np.abs(by_theta) + np.abs(by_phi)).sum(0))


def condition_number(system: System) -> Array:
    """Return the condition number of the matrix of rows (cos φ, cos θ, 1), by the 2-norm; (n,)."""
    x, y = np.cos(system.phi), np.cos(system.theta)
    of_k1, of_k2 = _k_derivatives(system)
    of_k3 = -x[0] * of_k1 - y[0] * of_k2
    of_k3[0] += 1.0
    return _matrix_norm(x, y, np.ones_like(x)) * _matrix_norm(of_k1, of_k2, of_k3)


def _k_derivatives(system: System) -> tuple[Array, Array]:
    """Return the derivatives of k1 and k2 by the right sides of the equations; (3, n) each."""
    P, Q, (last_P, last_Q) = system.P, system.Q, system.last
    scale = -0.5 / system.determinant
    return (
        np.stack((-last_Q, Q[1], -Q[0])) * scale,
        np.stack((last_P, -P[1], P[0])) * scale,
    )


def _matrix_norm(x: Array, y: Array, z: Array) -> Array:
    """
    Return the 2-norm of matrices of three rows; (n,).

    The largest eigenvalue of their squares in closed form (O. K. Smith, Eigenvalues of a symmetric
    3 × 3 matrix, Communications of the ACM 4 (1961)), which is accurate enough for the largest,
    and about ten times as fast as a decomposition.
    """
    xx, yy, zz = (x * x).sum(0), (y * y).sum(0), (z * z).sum(0)
    xy, xz, yz = (x * y).sum(0), (x * z).sum(0), (y * z).sum(0)
    mean = (xx + yy + zz) / 3.0
    xx, yy, zz = xx - mean, yy - mean, zz - mean
    square = (xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0
    determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)
    width = np.sqrt(square)
    turned = np.arccos(np.clip(determinant / (2.0 * square * width), -1.0, 1.0)) / 3.0
    return np.asarray(np.sqrt(mean + 2.0 * width * np.cos(turned)))


def wanted_of(crank: Sequence[float], rocker: Sequence[float]) -> tuple[DesignRequest, ...]:
    """Return pairs as wanted positions."""
    return tuple(DesignRequest(t, p) for t, p in zip(crank, rocker, strict=True))


def check_pairs(crank: Sequence[float], rocker: Sequence[float], ground: float) -> None:
    """
    Refuse pairs that no four-bar can have, or that repeat each other.

    The SynthesisError has the numbers of the pairs, counted from 1.
    """
    if not SHORTEST <= ground <= FARTHEST:
        remedy = f'give it one from {SHORTEST:g} to {FARTHEST:g}'
        raise SynthesisError('ground', f'{ground!r} m is not a length', remedy)
    pairs = [*enumerate(zip(crank, rocker, strict=True), 1)]
    for number, pair in pairs:
        if not all(abs(angle) <= _FARTHEST for angle in pair):
            raise SynthesisError(
                f'pair {number}',
                f'{_pair_text(pair)} is not a pair of angles',
                f'write two numbers of at most {degrees(_FARTHEST):.1g}°',
            )
    for (i, first), (j, second) in combinations(pairs, 2):
        theta, phi = (abs(remainder(u - v, tau)) for u, v in zip(first, second, strict=True))
        if theta < _SAME and phi < _SAME:
            raise SynthesisError(
                f'pairs {i} and {j}',
                f'are the same, {_pair_text(first)}',
                'give each position once',
            )
        if theta < _SAME:
            raise SynthesisError(
                f'pairs {i} and {j}',
                f'want the rocker at {_degrees_text(first[1])} and at {_degrees_text(second[1])} '
                'for the same '
                f'crank angle, {_degrees_text(first[0])}, which needs both assemblies',
                'change one of the crank angles',
            )


def centre_cosines(crank: Sequence[float], rocker: Sequence[float]) -> tuple[Array, Array, Array]:
    """
    Return cos φ, cos θ and cos(θ − φ) of each pair minus their means, divided by −2; (n,) each.

    Subtracting the means eliminates Freudenstein's k3, which makes the mean residual zero.
    """
    theta, phi = np.array(crank, np.float64), np.array(rocker, np.float64)
    columns = equation_differences(theta[:, None], phi[:, None])
    P, Q, R = (np.append(0.0, high[:, 0]) for high, _ in columns)
    return P - P.mean(), Q - Q.mean(), R - R.mean()


def dependence_error(crank: Sequence[float], rocker: Sequence[float]) -> SynthesisError:
    """Return the reason why the equations of pairs do not determine a four-bar, if known."""
    pairs = [*enumerate(zip(crank, rocker, strict=True), 1)]
    if all(abs(remainder(theta - phi, tau)) < _SAME for _, (theta, phi) in pairs):
        return SynthesisError(
            'the pairs',
            'turn crank and rocker by the same angles, as parallelograms of any crank length do',
            'change one, or draw a parallelogram',
        )
    for (i, first), (j, second) in combinations(pairs, 2):
        if all(abs(remainder(u + v, tau)) < _SAME for u, v in zip(first, second, strict=True)):
            return SynthesisError(
                f'pairs {i} and {j}',
                f'{_pair_text(first)} and {_pair_text(second)} are mirror images in the ground '
                'line: a '
                'four-bar that has one has the other',
                'replace one of the pairs',
            )
    P, Q, R = centre_cosines(crank, rocker)
    matrix = np.stack((P, Q), 1)
    rest = R - matrix @ np.linalg.lstsq(matrix, R, _CONSISTENT)[0]
    if np.linalg.norm(rest) < _CONSISTENT * np.linalg.norm(R):
        return SynthesisError(
            'the pairs', 'do not determine a four-bar: any number of four-bars has them all', MOVE
        )
    return SynthesisError(
        'the pairs',
        'contradict each other: no four-bar of finite links has them all',
        f'{MOVE}, or let the zero angles be free',
    )


def _pair_text(pair: tuple[float, float]) -> str:
    return ' → '.join(map(_degrees_text, pair))


def _degrees_text(angle: float) -> str:
    return f'{degrees(angle):.10g}°'


class FreudensteinLinks(NamedTuple):
    """The links of a four-bar with a ground of length 1; any number of them at once."""

    k: Array  # Freudenstein's k1, k2, k3; (…, 3)
    # Lengths of crank, coupler and rocker; (…, 3). Crank and rocker are negative if the link
    # points the other way. Infinite or NaN if there is no such link.
    lengths: Array


class ThreePairs(NamedTuple):
    """The solution of three pairs, and its accuracy; any number of them at once."""

    # As in `FreudensteinLinks`.
    k: Array
    lengths: Array
    # Condition number of the matrix of rows (cos φ, cos θ, 1), by the 2-norm; (…).
    condition: Array
    # Σ|x ∂y/∂x| over the six angles x; (…, 2). Of the logarithm y of the system's determinant, and
    # of the coupler's angle y in the first pair, in [rad].
    system_sensitivity: Array
    # Σ|x ∂L/∂x| + ``abs(L)`` of each length L over the six angles x; (…, 3). Times 2⁻⁵³ it bounds
    # the error of a length that rounding the angles alone causes.
    sensitivity: Array
    # ∂L/∂x of each length by the three crank angles, then by the three rocker angles, per [rad];
    # (…, 3, 6).
    gradient: Array

    @property
    def reliable_digits(self) -> Array:
        """Return the number of reliable digits of each length, 0 to 16; (…, 3)."""
        with np.errstate(all='ignore'):
            return np.asarray(np.clip(-np.log10(self.lost_digits), 0.0, 16.0))

    @property
    def lost_digits(self) -> Array:
        """
        Return the relative error of each length that rounding the angles may cause; (…, 3).

        It is 4·2⁻⁵³ of the sensitivity, plus the square of the largest such error of lengths,
        determinant and direction of the coupler, for the nonlinear part. If that is a tenth or
        more, the first derivatives are meaningless: then it is 1 for all three.
        """
        with np.errstate(all='ignore'):
            linear = _NOISE * self.sensitivity / np.abs(self.lengths)
            shaken = np.maximum(linear.max(-1), _NOISE * self.system_sensitivity.max(-1))[
                ..., None
            ]
            return np.where(shaken < _SHAKEN, linear + shaken * shaken, 1.0)


def solve_links(crank: ArrayLike, rocker: ArrayLike) -> FreudensteinLinks:
    """
    Solve for three pairs of angles θ and φ in [rad], or for many triples at once, (…, 3).

    No error is raised: a link that does not exist is infinite or NaN.
    """
    theta, phi = _angle_columns(crank), _angle_columns(rocker)
    k, lengths = np.empty((2, *theta.shape))
    for block in _split_blocks(theta.shape[1]):
        system = solve_pairs(theta[:, block], phi[:, block])
        k[:, block], lengths[:, block] = system.k, system.lengths
    shape = np.shape(crank)
    return FreudensteinLinks(k.T.reshape(shape), lengths.T.reshape(shape))


def three_pairs(crank: ArrayLike, rocker: ArrayLike) -> ThreePairs:
    """Solve as `solve_links`, with the accuracy of the result."""
    theta, phi = _angle_columns(crank), _angle_columns(rocker)
    count = theta.shape[1]
    k, lengths, kappa = np.empty((3, 3, count))
    conditions, doubts, slopes = np.empty(count), np.empty((2, count)), np.empty((3, 6, count))
    for block in _split_blocks(count):
        t, p = theta[:, block], phi[:, block]
        system = solve_pairs(t, p)
        k[:, block], lengths[:, block] = system.k, system.lengths
        with np.errstate(all='ignore'):
            conditions[block] = condition_number(system)
            by_angle = length_gradient(system)
            slopes[..., block] = by_angle[:3]
            *sums, turned = (np.abs(by_angle) * np.abs(np.concatenate((t, p)))).sum(1)
            kappa[:, block] = sums + np.abs(system.lengths)
            doubts[:, block] = determinant_sensitivity(system), turned
    shape = np.shape(crank)
    return ThreePairs(
        k.T.reshape(shape),
        lengths.T.reshape(shape),
        conditions.reshape(shape[:-1]),
        doubts.T.reshape((*shape[:-1], 2)),
        kappa.T.reshape(shape),
        np.moveaxis(slopes, 2, 0).reshape((*shape, 6)),
    )


def exact_four_bar(
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
        If two pairs contradict or repeat each other, or no single four-bar of finite links has
        the three pairs.

    """
    check_pairs(crank, rocker, ground)
    solution = three_pairs(crank, rocker)
    if not _NOISE * solution.system_sensitivity[0] < _SHAKEN:
        raise dependence_error(crank, rocker)
    a, b, c = (float(length) for length in solution.lengths)
    parts = _NOISE * solution.sensitivity / np.abs(solution.lengths)
    for link, length, part in (('crank', a, parts[0]), ('rocker', c, parts[2])):
        if not (part < 1.0 and abs(length) < LONGEST):
            raise SynthesisError(
                f'the {link}',
                'would be infinitely long, and is a slider on a straight line then',
                MOVE,
            )
    if not solution.reliable_digits.all():
        raise SynthesisError(
            'the pairs',
            f'do not determine the lengths of the links: rounding their angles changes one by '
            f'{parts.max():.0%}',
            'move the pairs apart',
        )
    four_bar = FourBar.of_lengths(a * ground, b * ground, c * ground, ground)
    return assemble(Design(four_bar, wanted_of(crank, rocker))), solution


def fit_equation(crank: Sequence[float], rocker: Sequence[float], ground: float) -> Design:
    """
    Design the four-bar nearest to three or more pairs, by Freudenstein's equation.

    It minimises the sum of squares of the equation's residuals, not of the rocker's errors;
    `angle_fit.nearest` starts from here.

    Parameters
    ----------
    crank, rocker
        Angles, in [rad]; as many of each.
    ground
        Length of the ground, in [m].

    Raises
    ------
    SynthesisError
        If two pairs contradict or repeat each other, or all together do not determine a four-bar
        of finite links.

    """
    check_pairs(crank, rocker, ground)
    P, Q, R = centre_cosines(crank, rocker)
    sizes = np.array((np.linalg.norm(P), np.linalg.norm(Q)))
    size = np.linalg.norm((crank, rocker))
    k, _, rank, _ = np.linalg.lstsq(
        np.stack((P, Q), 1) / sizes, R, max(UNIT_ROUNDOFF * size / sizes.min(), 1e-12)
    )
    if rank < 2:
        raise dependence_error(crank, rocker)
    k1, k2 = (k / sizes).tolist()
    for link, inverse in (('crank', k1), ('rocker', k2)):
        if not abs(inverse) * LONGEST > 1.0:
            raise SynthesisError(
                f'the {link}',
                'of the nearest four-bar would be infinitely long, and is a slider then',
                MOVE,
            )
    a, c = 1.0 / k1, -1.0 / k2
    apart = 1.0 + c * np.exp(1j * np.array(rocker)) - a * np.exp(1j * np.array(crank))
    b = float(np.sqrt((np.abs(apart) ** 2).mean()))
    four_bar = FourBar.of_lengths(a * ground, b * ground, c * ground, ground)
    return assemble(Design(four_bar, wanted_of(crank, rocker)))


def _angle_columns(angles: ArrayLike) -> Array:
    """Return triples of angles as (3, n)."""
    return np.ascontiguousarray(np.asarray(angles, np.float64).reshape(-1, 3).T)


def _split_blocks(count: int) -> list[slice]:
    return [slice(start, start + _BLOCK) for start in range(0, count, _BLOCK)]
