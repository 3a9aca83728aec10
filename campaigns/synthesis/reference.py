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

"""The truth of a round trip, in balls of more than fifty digits: rocker angles and conditions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from flint import arb, ctx

PRECISION = 384
"""In bits: what a cluster of 1e-9 rad takes away twice still leaves more than fifty digits."""


class Truth(NamedTuple):
    """
    Three pairs of one linkage.

    Attributes
    ----------
    rocker
        Its three angles, as doubles nearest to the true ones, in [rad].
    sensitivity
        Σ|x ∂L/∂x| + ``abs(L)`` of crank, coupler and rocker over the six angles.

    """

    rocker: tuple[float, ...]
    sensitivity: tuple[float, ...]


def truth(lengths: Sequence[float], crank: Sequence[float], sides: Sequence[int]) -> Truth | None:
    """
    Return where the rocker stands, and what its angles tell of the lengths; None if it does not.

    Parameters
    ----------
    lengths
        Of crank, coupler and rocker, the first and the last signed; the ground is 1.
    crank
        Three crank angles, in [rad].
    sides
        For each the assembly: 1 where the pin B lies to the left of A→O4, −1 to the right.

    """
    ctx.prec = PRECISION
    a, b, c = map(arb, lengths)
    rocker, rows = [], []
    for theta, side in zip(crank, sides, strict=True):
        sine, cosine = arb(theta).sin_cos()
        placed = _rocker_direction(a, b, c, cosine, sine, side)
        if placed is None:
            return None
        x, y = placed
        rocker.append(arb.atan2(y, x))
        rows.append(_row(a, b, c, cosine, sine, x, y))
    angles = [arb(theta) for theta in crank] + rocker
    return Truth(tuple(map(float, rocker)), _sensitivity((a, b, c), angles, rows))


def _rocker_direction(
    a: Any, b: Any, c: Any, cosine: Any, sine: Any, side: int
) -> tuple[Any, Any] | None:
    """Return cos φ and sin φ from the triangle of A, B and O4; None where it does not close."""
    x, y = 1 - a * cosine, -a * sine
    square = x * x + y * y
    along = (c * c - b * b + square) / 2
    height = c * c * square - along * along
    if not height > 0:
        return None
    # From O4, along is laid off towards A.
    across = side * height.sqrt()
    return (-along * x - across * y) / (square * c), (across * x - along * y) / (square * c)


def _row(a: Any, b: Any, c: Any, cosine: Any, sine: Any, x: Any, y: Any) -> tuple[Any, ...]:
    """
    Return half of the gradient of F = v·v − b² by a, b, c, θ and φ.

    v = 1 + c·e^{iφ} − a·e^{iθ} is the coupler.
    """
    along, across = 1 + c * x - a * cosine, c * y - a * sine
    return (
        -(along * cosine + across * sine),
        -b,
        along * x + across * y,
        -a * (across * cosine - along * sine),
        c * (across * x - along * y),
    )


def _sensitivity(
    lengths: tuple[Any, ...], angles: list[Any], rows: list[tuple[Any, ...]]
) -> tuple[float, ...]:
    """F = 0 in the three pairs: ∂L/∂x = −J⁻¹·∂F/∂x, by cross products of the rows of J."""
    normals = []
    for i in range(3):
        (p, q, r, *_), (s, t, w, *_) = rows[(i + 1) % 3], rows[(i + 2) % 3]
        normals.append((q * w - r * t, r * s - p * w, p * t - q * s))
    determinant = sum(u * v for u, v in zip(rows[0][:3], normals[0], strict=True))
    return tuple(
        float(
            sum(
                abs(
                    normals[i][j] * (abs(rows[i][3] * angles[i]) + abs(rows[i][4] * angles[3 + i]))
                )
                for i in range(3)
            )
            / abs(determinant)
            + abs(length)
        )
        for j, length in enumerate(lengths)
    )
