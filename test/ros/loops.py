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


"""The shipped linkages by complex numbers, independent of the package."""

from __future__ import annotations

from cmath import exp, phase
from math import sqrt

import pytest

A, B, C, D = 0.040, 0.120, 0.080, 0.100
"""Lengths of config/linkages/four_bar.yaml, in [m]."""


def four_bar(theta: float) -> tuple[float, float]:
    """Return coupler_joint and rocker_joint: B is where two circles meet, left of A→O4."""
    a = A * exp(1j * theta)
    diagonal = D - a
    s = abs(diagonal)
    along = (s * s + B * B - C * C) / (2 * s)
    b = a + diagonal / s * (along + 1j * sqrt(B * B - along * along))
    return phase(b - a) - theta, phase(b - D)


def inverted_slider_crank(theta: float) -> tuple[float, float]:
    """Return rod_joint and rod_slide of config/linkages/inverted_slider_crank.yaml."""
    rod = 0.25 + 0.10j - 0.15 * exp(1j * theta)
    return phase(rod) - theta, abs(rod)


def rates(loop, theta: float, omega: float) -> tuple[float, ...]:
    """Return the joints' rates, from the difference of two positions."""
    step = 1e-6
    there, here = loop(theta + step), loop(theta - step)
    return tuple(
        # What lies between is small, so that a turn between them is none of it.
        phase(exp(1j * (t - h))) / (2 * step) * omega
        for t, h in zip(there, here, strict=True)
    )


def modulo_turns(angle: float) -> object:
    """Return what equals an angle whatever its turns."""
    return pytest.approx(exp(1j * angle), abs=1e-9)
