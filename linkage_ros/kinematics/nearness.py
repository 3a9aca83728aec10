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


"""How near trouble a linkage is: transmission angle, conditioning, distance to a toggle."""

from __future__ import annotations

from math import inf, pi, remainder, sin, sqrt, tau
from typing import NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.crank_diagonal import CrankDiagonal

if TYPE_CHECKING:
    from linkage_ros.kinematics.closure import Closure, Position


class Nearness(NamedTuple):
    """
    How near trouble a position is; the smaller, the nearer.

    Attributes
    ----------
    transmission_angle
        The smallest of all dyads, folded into [0, π/2], in [rad]; π/2 where there is none.
    conditioning
        The smallest singular value of a loop's Jacobian, of rows of length 1: for a dyad of
        transmission angle μ it is √2·sin(μ/2), from 0 at a toggle to 1. For an iterated group it
        is the smallest singular value divided by the largest.
    toggle_distance
        How far the input is from the next toggle or change point, in [rad] or [m]; infinite where
        there is none, and where there are several inputs.
    group
        Number of the group whose conditioning that is; −1 where there is no dyad and none that is
        iterated.

    """

    transmission_angle: float
    conditioning: float
    toggle_distance: float
    group: int = -1


def nearness(closure: Closure, position: Position) -> Nearness:
    """Return how near trouble a closed position is."""
    angle, conditioning, weakest = 0.5 * pi, 1.0, -1
    groups = closure.step_groups
    for step, pose, group in zip(closure.steps, position.poses, groups, strict=True):
        if hasattr(step, 'transmission_angle'):
            angle = min(angle, of_dyad := step.transmission_angle(pose))
            found = sqrt(2.0) * sin(0.5 * of_dyad)
        elif hasattr(step, 'conditioning'):
            found = step.conditioning(pose)
        else:
            continue
        if weakest < 0 or found < conditioning:
            conditioning, weakest = min(found, 1.0), group
    distance = inf
    if len(closure.linkage.inputs) == 1:
        sliding = bool(closure.linkage.inputs[0].slider)
        unit = closure.scale if sliding else 1.0
        value = position.state.coordinates[1] * unit
        for critical in closure.critical_inputs:
            away = value - critical
            distance = min(distance, abs(away if sliding else remainder(away, tau)))
    return Nearness(angle, conditioning, distance, weakest)


def critical_inputs(closure: Closure) -> tuple[float, ...]:
    """
    Return where a single input meets toggles and change points.

    Toggles end the ranges of the input. A change point of a dyad on crank and ground is where its
    margin is zero: the crank along the ground, outwards for the fold, inwards for the stretch.
    """
    found = []
    for interval in closure.input_ranges:
        if not interval.whole:
            ends = interval.lowest, interval.highest
            found += [end for end, is_one in zip(ends, interval.limited, strict=True) if is_one]
    for step in closure.steps:
        diagonal = getattr(step, 'diagonal', None)
        if isinstance(diagonal, CrankDiagonal) and diagonal.arms[:2] == (1, 0):
            for margin, phi in ((diagonal.fold_margin, 0.0), (diagonal.stretch_margin, pi)):
                if margin == 0.0:
                    found.append(remainder(phi - diagonal.arms[2], tau))
    return tuple(sorted(found))
