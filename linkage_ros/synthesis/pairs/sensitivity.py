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


"""What a change of the angles of three pairs does to their four-bar, and to their equations."""

from __future__ import annotations

from linkage_ros.synthesis.double_double import Array
from linkage_ros.synthesis.pairs.system import System
import numpy as np


def gradient(system: System) -> Array:
    """
    Differentiate the lengths, and the direction of the coupler in the first pair, by the angles.

    Equation i, k1·cos φ + k2·cos θ + k3 − cos(θ − φ) = 0, moves by sin(θ − φ) − k2·sin θ with θᵢ,
    by −sin(θ − φ) − k1·sin φ with φᵢ; the k by that times less column i of the inverse. The
    coupler is 1 + c·e^{iφ} − a·e^{iθ} in the first pair.

    Returns
    -------
    Array
        Of crank, coupler, rocker and direction by the three crank angles, then by the three rocker
        angles, per [rad]; (4, 6, n).

    """
    theta, phi = system.theta, system.phi
    k1, k2, _ = system.k
    a, b, c = system.lengths
    of_k1, of_k2 = _inverse(system)
    across = np.sin(theta - phi)
    moves = np.concatenate((k2 * np.sin(theta) - across, k1 * np.sin(phi) + across))
    of_a = -a * a * np.concatenate((of_k1, of_k1)) * moves
    of_c = c * c * np.concatenate((of_k2, of_k2)) * moves
    # Crank and rocker as the coupler sees them: along it and across.
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


def doubt(system: System) -> Array:
    """
    Return Σ|x ∂D/∂x| / ``abs(D)`` of the determinant D over the six angles x; (n,).

    Of dM, the trace of M⁻¹·dM is that of the logarithm of D.
    """
    of_k1, of_k2 = _inverse(system)
    by_theta = np.sin(system.theta) * of_k2 * system.theta
    by_phi = np.sin(system.phi) * of_k1 * system.phi
    return np.asarray((np.abs(by_theta) + np.abs(by_phi)).sum(0))


def condition(system: System) -> Array:
    """Return the condition number of the matrix of rows (cos φ, cos θ, 1), by the 2-norm; (n,)."""
    x, y = np.cos(system.phi), np.cos(system.theta)
    of_k1, of_k2 = _inverse(system)
    of_k3 = -x[0] * of_k1 - y[0] * of_k2
    of_k3[0] += 1.0
    return _norm(x, y, np.ones_like(x)) * _norm(of_k1, of_k2, of_k3)


def _inverse(system: System) -> tuple[Array, Array]:
    """Return how k1 and k2 go with the right sides of the three equations; (3, n) each."""
    P, Q, (last_P, last_Q) = system.P, system.Q, system.last
    scale = -0.5 / system.determinant
    return (
        np.stack((-last_Q, Q[1], -Q[0])) * scale,
        np.stack((last_P, -P[1], P[0])) * scale,
    )


def _norm(x: Array, y: Array, z: Array) -> Array:
    """
    Return the 2-norm of matrices of three rows; (n,).

    The greatest eigenvalue of their squares in closed form (O. K. Smith, Eigenvalues of a
    symmetric 3 × 3 matrix, Communications of the ACM 4 (1961)), which is exact enough for the
    greatest, and some ten times as fast as a decomposition.
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
