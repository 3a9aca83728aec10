# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A crank-rocker from its dead centres: the swing of its rocker, and the ratio of its times.

At its two dead centres crank a and coupler b lie in line, and the rocker's pin is b + a and b − a
away from the crank's pivot. With the swing ψ of the rocker c, and the crank angle α by which the
stroke one way is longer than a half turn, the triangle of the pivot and both places of the pin has
the angle α at the pivot, and the chord 2c·sin(ψ/2) opposite to it (H. Alt, 1932)::

    time ratio = (π + α)/(π − α)        (2c·sin(ψ/2))² = r₁² + r₂² − 2r₁r₂·cos α
    r₁ = b − a                          r₂ = b + a

One parameter is left, here r₁/r₂; and the ground may lie on either side of the chord.
"""

from __future__ import annotations

from cmath import phase, rect
from math import acos, inf, pi, tan
from typing import NamedTuple

from linkage_ros.errors import SynthesisError
from linkage_ros.kinematics import golden_section
from linkage_ros.tools.design.design import Design, DesignRequest, FourBar

_SAMPLES = 1000


class DeadCentreTask(NamedTuple):
    """The swing of the rocker, in [rad]; the ratio of the times; the ground's length, in [m]."""

    swing: float
    time_ratio: float
    ground: float

    @property
    def imbalance_angle(self) -> float:
        """Return the crank angle by which the longer stroke exceeds half a turn, in [rad]."""
        return pi * (self.time_ratio - 1.0) / (self.time_ratio + 1.0)


def crank_rockers(task: DeadCentreTask, count: int) -> list[Design]:
    """
    Return crank-rockers with these dead centres, the best transmission first.

    The others follow at equal steps of the free parameter. A SynthesisError is raised if the task
    is not one or has no crank-rocker.
    """
    if not 0.0 < task.swing < pi:
        raise SynthesisError('the swing', f'is {task.swing:g} rad', 'give one between 0 and 180°')
    if not 1.0 <= task.time_ratio < inf:
        raise SynthesisError(
            'the time ratio', f'is {task.time_ratio:g}', 'give the longer time by the shorter one'
        )
    candidates = []
    for side in (1.0, -1.0):

        def loss(ratio: float, side: float = side) -> float:
            return -_least_transmission(task, ratio, side)

        ratios = [(i + 0.5) / _SAMPLES for i in range(_SAMPLES)]
        best = min(ratios, key=loss)
        if loss(best) < 0.0:
            step = 1.0 / _SAMPLES
            ends = max(best - step, step * step), min(best + step, 1.0 - step * step)
            candidates.append((*golden_section(loss, *ends), side))
            usable = [ratio for ratio in ratios if loss(ratio) < 0.0]
            chosen = usable[:: max(1, len(usable) // max(1, count))]
            candidates += [(loss(ratio), ratio, side) for ratio in chosen]
    if not candidates:
        raise SynthesisError(
            'swing and time ratio', 'no crank-rocker has both', 'ask for a smaller swing or ratio'
        )
    return [_build_design(task, ratio, side) for _, ratio, side in sorted(candidates)[:count]]


def _dead_centre_places(
    task: DeadCentreTask, ratio: float, side: float
) -> tuple[complex, complex, complex]:
    """Return pin B folded and stretched, and pivot O4, all from O2; r₂ = 1 along x."""
    folded, stretched = rect(ratio, task.imbalance_angle), 1.0 + 0.0j
    chord = stretched - folded
    # The apex of the swing over the chord.
    apex = 0.5 * (folded + stretched) + side * 0.5j * chord / tan(0.5 * task.swing)
    return folded, stretched, apex


def _link_lengths(
    task: DeadCentreTask, ratio: float, side: float
) -> tuple[float, float, float, float]:
    """Return crank, coupler, rocker and ground, for the wanted ground."""
    folded, stretched, apex = _dead_centre_places(task, ratio, side)
    scale = task.ground / abs(apex)
    r1, r2 = abs(folded) * scale, abs(stretched) * scale
    return 0.5 * (r2 - r1), 0.5 * (r2 + r1), abs(stretched - apex) * scale, task.ground


def _least_transmission(task: DeadCentreTask, ratio: float, side: float) -> float:
    """Return the least transmission angle, in [rad]; below 0 for other than crank-rockers."""
    folded, stretched, apex = _dead_centre_places(task, ratio, side)
    sides = [(apex.conjugate() * pin).imag for pin in (folded, stretched)]
    a, b, c, d = _link_lengths(task, ratio, side)
    grashof = a < min(b, c, d) and 2.0 * (a + max(b, c, d)) < a + b + c + d
    if sides[0] * sides[1] <= 0.0 or not grashof:
        return -1.0
    angles = [acos((b * b + c * c - s * s) / (2.0 * b * c)) for s in (d - a, d + a)]
    return min(min(angle, pi - angle) for angle in angles)


def _build_design(task: DeadCentreTask, ratio: float, side: float) -> Design:
    """Return the four-bar, with its positions at both dead centres."""
    folded, stretched, apex = _dead_centre_places(task, ratio, side)
    a, b, c, d = _link_lengths(task, ratio, side)
    frame = apex / abs(apex)
    wanted = []
    for pin, sign in ((folded, -1.0), (stretched, 1.0)):
        crank = phase(sign * pin / frame)
        wanted.append(DesignRequest(crank, phase((pin - apex) / frame)))
    # At a dead centre A lies on O2→B, so B is on the same side of A→O4 as of O2→O4.
    left = (stretched / frame).imag > 0.0
    return Design(FourBar.of_lengths(a, b, c, d, side='left' if left else 'right'), tuple(wanted))
