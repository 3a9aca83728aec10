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
The four-bar's closed form in numbers of 32 bits, inputs and constants included.

The stable form by the half angle, as `linkage_ros.kinematics.crank_diagonal` has it. With
near = 2√(ad)·sin(φ/2) and far = 2√(ad)·cos(φ/2), s² = (d − a)² + near²::

    K² = (s² − (b − c)²)·((b + c)² − s²)
       = ((d − a)² − (b − c)² + near²)·((b + c)² − (a + d)² + far²)
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any

from linkage_ros.accuracy.solving.methods.four_bar import plain_four_bar, PlainFourBar
from linkage_ros.accuracy.solving.methods.method import ACCELERATION, Joints, Method, Motion, RATE
from linkage_ros.kinematics.linkage import Linkage
import numpy as np

NAME = 'closed form, float32'

_Single = np.float32


def single_precision(linkage: Linkage) -> Method | None:
    """Return it, of a four-bar."""
    shape = plain_four_bar(linkage)
    if shape is None:
        return None
    solve = _solver(shape)

    def position(angle: float) -> Joints:
        found: Joints = solve(_Single(angle), 0)[0]
        return found

    def motion(angle: float) -> Motion:
        joints, rates, accelerations = solve(_Single(angle), 2)
        return joints, rates, accelerations

    def batch(inputs: Sequence[Any], derivatives: int) -> Sequence[Any]:
        (angles,) = inputs
        found = solve(angles.astype(_Single), derivatives)
        return [np.stack([np.broadcast_to(row, angles.shape) for row in rows]) for rows in found]

    return Method(NAME, '', position, motion, batch)


def _solver(shape: PlainFourBar) -> Any:
    a, b, c, d = shape[:4]
    one, half, sign = _Single(1.0), _Single(0.5), _Single(shape.side)
    turn, offset = _Single(shape.turn), _Single(shape.offset)
    twice_a, apart, apart_square = _Single(2.0 * a), _Single(d - a), _Single((d - a) ** 2)
    root = _Single(2.0 * sqrt(a * d))
    fold = _Single((abs(d - a) - abs(b - c)) * (abs(d - a) + abs(b - c)))
    stretch = _Single((b + c - a - d) * (a + b + c + d))
    difference, lengths = _Single((b - c) * (b + c)), _Single((d - a) * (d + a))
    more, less = (
        _Single((b - c) * (b + c) + (d - a) ** 2),
        _Single((b - c) * (b + c) - (d - a) ** 2),
    )
    along = _Single(a * (d - a))
    rate, acceleration = turn * _Single(RATE), turn * _Single(ACCELERATION)
    terms = [(i, j, _Single(constant)) for i, j, constant in shape.terms]
    zero = _Single(0.0)

    def solve(angle: Any, derivatives: int) -> list[tuple[Any, ...]]:
        phi = turn * angle + offset
        halved = half * phi
        sine, cosine = np.sin(halved), np.cos(halved)
        near, far = root * sine, root * cosine
        near_square, far_square = near * near, far * far
        square = apart_square + near_square
        # At a change point the root is signed with the half angle. A negative rest is rounding
        # where the loop closes; without this a toggle is refused.
        inner = np.sqrt(np.maximum(fold + near_square, zero)) if fold else near
        outer = np.sqrt(np.maximum(stretch + far_square, zero)) if stretch else far
        cross = sign * inner * outer
        direction = np.arctan2(-twice_a * sine * cosine, apart + twice_a * sine * sine)
        plus, minus = more + near_square, less - near_square
        coupler = direction + np.arctan2(cross, plus)
        rocker = direction + np.arctan2(cross, minus)
        lines = (zero, phi, coupler, rocker)
        found = [tuple(lines[i] - lines[j] + constant for i, j, constant in terms)]
        if not derivatives:
            return found
        with np.errstate(all='ignore'):
            p, q = (along - half * near_square) / square, half * near * far / square
            cot_beta, cot_gamma = plus / cross, minus / cross
            lines = (zero, one, q * cot_gamma - p, q * cot_beta - p)
            swept = [line * rate for line in lines]
            found.append(tuple(swept[i] - swept[j] for i, j, _ in terms))
            if derivatives < 2:
                return found
            bend = fold * (far / inner) * (far / inner)
            bend -= stretch * (near / outer) * (near / outer)
            bend = _Single(0.25) * bend / square
            swirl = q * (lengths / square) - _Single(2.0) * q * (q * (difference / cross))
            whirl = rate * rate
            pulled = (
                zero,
                acceleration,
                acceleration * lines[2] + whirl * (swirl + cot_gamma * bend),
                acceleration * lines[3] + whirl * (swirl + cot_beta * bend),
            )
            found.append(tuple(pulled[i] - pulled[j] for i, j, _ in terms))
        return found

    return solve
