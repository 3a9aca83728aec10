# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The shipped linkages by complex numbers, independent of the package."""

from cmath import exp, phase
from math import acos, remainder, tau

import pytest

from ..support.four_bar import four_bar_angles, GALLERY

A, B, C, D = GALLERY


def four_bar(theta: float) -> tuple[float, float]:
    """Return coupler_joint and rocker_joint."""
    coupler, rocker = four_bar_angles(theta)
    return coupler - theta, rocker


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


def accelerations(loop, theta: float, omega: float) -> tuple[float, ...]:
    """Return the joints' accelerations at a constant rate, from the difference of positions."""
    # Five of them: of three, either what is left out or the rounding shows in the fourth digit.
    step = 1e-3
    theta = remainder(theta, tau)  # turns alone would cost a digit of every difference
    here = loop(theta)
    sums = [0.0] * len(here)
    for steps, weight in ((-2, -1.0), (-1, 16.0), (1, 16.0), (2, -1.0)):
        for i, (there, h) in enumerate(zip(loop(theta + steps * step), here, strict=True)):
            sums[i] += weight * phase(exp(1j * (there - h)))
    return tuple(value / (12.0 * step**2) * omega**2 for value in sums)


def transmission_angle(theta: float) -> float:
    """Return the acute angle between coupler and rocker of the four-bar, by the law of cosines."""
    square = abs(D - A * exp(1j * theta)) ** 2
    return acos(abs(B * B + C * C - square) / (2 * B * C))


def five_bar_gap(upper: float, lower: float, left: float, right: float) -> complex:
    """Return by how much the two halves of FIVE_BAR miss each other, in [m]."""
    here = 0.04 * exp(1j * left) + 0.12 * exp(1j * upper)
    return here - (0.1 + 0.05 * exp(1j * right) + 0.11 * exp(1j * lower))


def modulo_turns(angle: float) -> object:
    """Return what equals an angle whatever its turns."""
    return pytest.approx(exp(1j * angle), abs=1e-9)
