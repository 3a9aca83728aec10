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
Freudenstein's equation for three pairs, solved; threes of pairs by the thousand.

The first equation is taken from the other two, so that k3 falls out::

    k1·(cos φᵢ − cos φ₁) + k2·(cos θᵢ − cos θ₁) = cos(θᵢ − φᵢ) − cos(θ₁ − φ₁),  i = 2, 3

The differences are products,

    cos u − cos v = −2·sin((u + v)/2)·sin((u − v)/2),

of angles that are sums of two or four doubles, and are taken as such. What follows, determinants,
lengths and the coupler, is in sums of two doubles too, since no more may be lost there than
rounding the angles loses: at a change point, in a parallelogram or with a short coupler, terms
cancel that the angles themselves do not touch.
"""

from __future__ import annotations

from typing import NamedTuple

from linkage_ros.synthesis.double_double import (
    Array,
    minus,
    over,
    plus,
    sine,
    sine_cosine,
    times,
    two_sum,
    Twofold,
)
import numpy as np


class System(NamedTuple):
    """
    Freudenstein's equation for three pairs, and its solution for a ground of length 1.

    Attributes
    ----------
    theta, phi
        Angles of crank and rocker, in [rad]; (3, n).
    P, Q, R
        What cos φ, cos θ and cos(θ − φ) of the second and third pair have over those of the
        first, divided by −2; (2, n).
    last
        What P and Q of the third pair have over those of the second; (2, n).
    determinant
        P0·Q1 − P1·Q0; (n,).
    k
        k1, k2 and k3; (3, n).
    lengths
        Of crank, coupler and rocker, the first and the last signed; (3, n).
    coupler
        Its x and y in the first pair; (2, n).

    """

    theta: Array
    phi: Array
    P: Array
    Q: Array
    R: Array
    last: Array
    determinant: Array
    k: Array
    lengths: Array
    coupler: Array


def solved(theta: Array, phi: Array) -> System:
    """
    Solve; infinite or nan where there is no solution.

    Parameters
    ----------
    theta, phi
        Angles of crank and rocker, in [rad]; (3, n).

    """
    with np.errstate(all='ignore'):
        P, Q, R = differences(theta, phi)
        determinant, of_k1, of_k2 = _determinant(P, Q), _determinant(R, Q), _determinant(P, R)
        a, c = over(determinant, of_k1), over(determinant, (-of_k2[0], -of_k2[1]))
        # The coupler is what closes the first position. From k3 long links would leave little.
        nothing = np.zeros_like(theta[0])
        crank_y, crank_x = sine_cosine((theta[0], nothing))
        rocker_y, rocker_x = sine_cosine((phi[0], nothing))
        x, _ = plus((nothing + 1.0, nothing), minus(times(c, rocker_x), times(a, crank_x)))
        y, _ = minus(times(c, rocker_y), times(a, crank_y))
        k1, k2 = over(of_k1, determinant)[0], over(of_k2, determinant)[0]
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


def differences(theta: Array, phi: Array) -> tuple[Twofold, Twofold, Twofold]:
    """
    Return what all equations but the first have over it, divided by −2.

    Parameters
    ----------
    theta, phi
        Angles of crank and rocker, in [rad]; (m, n).

    Returns
    -------
    tuple
        Of cos φ, of cos θ and of cos(θ − φ); (m − 1, n) each.

    """
    theta_by, phi_by = two_sum(theta[1:], -theta[:1]), two_sum(phi[1:], -phi[:1])
    theta_sum, phi_sum = two_sum(theta[1:], theta[:1]), two_sum(phi[1:], phi[:1])
    sums = (phi_sum, theta_sum, minus(theta_sum, phi_sum))
    bys = (phi_by, theta_by, minus(theta_by, phi_by))
    high = 0.5 * np.stack([term[0] for term in (*sums, *bys)])
    low = 0.5 * np.stack([term[1] for term in (*sums, *bys)])
    high, low = sine((high, low))
    high, low = times((high[:3], low[:3]), (high[3:], low[3:]))
    return (high[0], low[0]), (high[1], low[1]), (high[2], low[2])


def _determinant(x: Twofold, y: Twofold) -> Twofold:
    """Return x0·y1 − x1·y0."""
    high, low = times(x, (y[0][::-1], y[1][::-1]))
    return minus((high[0], low[0]), (high[1], low[1]))
