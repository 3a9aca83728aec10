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


"""Poses that a coupler is wanted in, and what none can be designed for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from math import degrees, isfinite, remainder, tau
from typing import NamedTuple

from linkage_ros.errors import SynthesisError
from linkage_ros.kinematics.batch import Array, Complex
from linkage_ros.kinematics.rounding import UNIT_ROUNDOFF
import numpy as np

SAME = 1e-12
"""Angles nearer than this are the same, in [rad], and places so near in parts of the motion."""


class Pose(NamedTuple):
    """Where the coupler shall be: the origin of its frame, in [m], and its angle, in [rad]."""

    place: complex
    angle: float


def check_task(poses: Sequence[Pose], pivots: Mapping[str, complex]) -> None:
    """
    Refuse poses and pivots that no four-bar can have.

    Raises
    ------
    SynthesisError
        With the numbers of the poses, counted from 1, or the names of the pivots.

    """
    if len(poses) != 3:
        raise SynthesisError('poses', f'{len(poses)} were given', 'give three')
    for number, (place, angle) in enumerate(poses, 1):
        if not (finite(place) and isfinite(angle)):
            raise SynthesisError(
                f'pose {number}', f'({place.real}, {place.imag}), {angle} is none', 'give numbers'
            )
    for name, place in pivots.items():
        if not finite(place):
            raise SynthesisError(name, f'({place.real}, {place.imag}) is no place', 'give numbers')
    spread = max(abs(one.place - other.place) for one, other in combinations(poses, 2))
    for (i, one), (j, other) in combinations(enumerate(poses, 1), 2):
        if (
            abs(remainder(one.angle - other.angle, tau)) < SAME
            and abs(one.place - other.place) <= SAME * spread
        ):
            raise SynthesisError(
                f'poses {i} and {j}',
                f'are the same, {said(one.place)} at {degrees(one.angle):.10g}°',
                'give each pose once',
            )
    (name, place), (other_name, other_place) = pivots.items()
    if abs(place - other_place) <= 4.0 * UNIT_ROUNDOFF * (abs(place) + abs(other_place)):
        raise SynthesisError(
            f'{name} and {other_name}',
            f'are the same place, {said(place)}: a link between them has no length',
            'give two places',
        )


def columns(poses: Sequence[Pose]) -> tuple[Complex, Array]:
    """Return the places of poses, and their angles, (3,) both."""
    return (
        np.array([pose.place for pose in poses], np.complex128),
        np.array([pose.angle for pose in poses], np.float64),
    )


def finite(place: complex) -> bool:
    """Return whether both coordinates are numbers."""
    return isfinite(place.real) and isfinite(place.imag)


def said(place: complex) -> str:
    """Return a place as a human reads it."""
    return f'({place.real:.6g}, {place.imag:.6g}) m'
