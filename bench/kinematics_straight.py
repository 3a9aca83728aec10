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
The formulas of a four-bar and nothing else: one function, in a straight line.

It is what the closure of any linkage is measured against: no status, no pose, no steps. It serves
linkages whose crank turns fully and passes no change point. The arithmetic is that of
`linkage_ros.kinematics.dyads.rrr` over `linkage_ros.kinematics.crank_diagonal`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, cos, sin, sqrt

Joints = tuple[float, float]
Solve = Callable[[float, float, float], tuple[Joints, Joints, Joints]]
"""Takes the crank's angle, rate and acceleration and returns both joints' of each."""


def straight_line(a: float, b: float, c: float, d: float, sign: float) -> Solve:
    """Return the function of the four-bar with crank a, coupler b, rocker c and ground d."""
    twice_a, apart, apart_square, root = 2.0 * a, d - a, (d - a) * (d - a), 2.0 * sqrt(a * d)
    fold = (abs(d - a) - abs(b - c)) * (abs(d - a) + abs(b - c))
    stretch = (b + c - a - d) * (a + b + c + d)
    difference, lengths = (b - c) * (b + c), (d - a) * (d + a)
    constant_more, constant_less = difference + apart_square, difference - apart_square
    along = a * (d - a)

    def solve(phi: float, rate: float, acceleration: float) -> tuple[Joints, Joints, Joints]:
        half = 0.5 * phi
        half_sine, half_cosine = sin(half), cos(half)
        near, far = root * half_sine, root * half_cosine
        near_square, far_square = near * near, far * far
        square = apart_square + near_square
        fold_root, stretch_root = sqrt(fold + near_square), sqrt(stretch + far_square)
        cross = sign * fold_root * stretch_root
        direction = atan2(
            -twice_a * half_sine * half_cosine, apart + twice_a * half_sine * half_sine
        )
        more, less = constant_more + near_square, constant_less - near_square
        coupler = direction + atan2(cross, more)
        rocker = direction + atan2(cross, less)

        p, q = (along - 0.5 * near * near) / square, 0.5 * near * far / square
        cot_beta, cot_gamma = more / cross, less / cross
        coupler_part, rocker_part = q * cot_gamma - p, q * cot_beta - p

        bend = fold * (far / fold_root) * (far / fold_root)
        bend -= stretch * (near / stretch_root) * (near / stretch_root)
        bend = 0.25 * bend / square
        swirl = q * (lengths / square) - 2.0 * q * (q * (difference / cross))
        whirl = rate * rate
        return (
            (coupler - phi, rocker),
            (rate * coupler_part - rate, rate * rocker_part),
            (
                acceleration * coupler_part + whirl * (swirl + cot_gamma * bend) - acceleration,
                acceleration * rocker_part + whirl * (swirl + cot_beta * bend),
            ),
        )

    return solve
