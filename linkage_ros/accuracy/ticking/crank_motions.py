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


"""Motions of a crank that make staleness felt: a chirp, and a constant acceleration."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from linkage_ros.drives.chirp import Chirp, curve
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.survey import usual_inputs, Way
from linkage_ros.messages.layout import NANOSECONDS

CHIRP, ACCELERATION = 'chirp', 'constant acceleration'

_FREQUENCIES = (0.2, 5.0)  # [Hz]
_SWING = 1.0  # [rad]
_GROWTH = 10.0  # [rad/s²]
_PART = 0.8
"""Of its range that an input moves through where it cannot turn round."""

CrankAt = Callable[[int], tuple[float, float]]
"""Value and rate of the input, in [rad] or [m] and a second, at a time since the start in [ns]."""


class Motions(NamedTuple):
    """
    The motions of a linkage's input.

    Attributes
    ----------
    by_name
        `CHIRP` and `ACCELERATION`.
    greatest
        For each the greatest rate and acceleration of the input, in [rad/s] and [rad/s²], or of m.

    """

    by_name: Mapping[str, CrankAt]
    greatest: Mapping[str, tuple[float, float]]


def motions_of(closure: Closure, seconds: float) -> Motions:
    """
    Return motions that stay where the loops close.

    Parameters
    ----------
    closure
        A linkage with one input.
    seconds
        How long they take.

    """
    (start,) = usual_inputs(closure)
    widest = Way(closure).widest_range
    length = round(seconds * NANOSECONDS)
    middle, swing, begin, growth = start, _SWING, start, _GROWTH
    if widest is not None and not widest.whole:
        width = widest.highest - widest.lowest
        middle, swing = widest.lowest + 0.5 * width, min(swing, 0.5 * _PART * width)
        begin = widest.lowest + 0.5 * (1.0 - _PART) * width
        growth = min(growth, 2.0 * _PART * width / seconds**2)
    sweep = curve(Chirp(swing, *_FREQUENCIES, seconds, middle, 'linear', repeat=False))

    def chirp(time: int) -> tuple[float, float]:
        value, rate, _ = sweep(min(max(time, 0), length - 1))
        return value, rate

    def accelerated(time: int) -> tuple[float, float]:
        t = min(max(time, 0), length) * 1e-9
        return begin + 0.5 * growth * t * t, growth * t

    steps = [sweep(length * k // 4000) for k in range(4000)]
    return Motions(
        {CHIRP: chirp, ACCELERATION: accelerated},
        {
            CHIRP: (max(abs(s[1]) for s in steps), max(abs(s[2]) for s in steps)),
            ACCELERATION: (growth * seconds, growth),
        },
    )
