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

"""Poses of a linkage that has no program, as its program would give them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from math import isfinite
from typing import Any

from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.compiling.source import STATUSES

_STATUSES = {name: number for number, name in enumerate(STATUSES)}


def pose(closure: Closure, inputs: Sequence[float]) -> dict[str, Any]:
    """Return a pose as the program of a model gives it; rates are those of a first input at 1."""
    position = closure.position(*inputs)
    found: dict[str, Any] = {
        'status': _STATUSES[position.status.name],
        'joints': list(position.joints),
        'rates': [],
        'accelerations': [],
        'frames': [],
        'frameRates': [],
    }
    if not position.joints:
        return found
    frames = closure.link_frames
    found['frames'] = _flat(frames.at(position))
    if position.status.has_rates:
        rest = [0.0] * (len(inputs) - 1)
        velocity = closure.velocity(position, 1.0, *rest)
        acceleration = closure.acceleration(position, velocity, 0.0, *rest)
        motion = {
            'rates': list(velocity.joints),
            'accelerations': list(acceleration.joints),
            'frameRates': _flat(frames.rates(position, velocity)),
        }
        # Beside a toggle they may be larger than a number can be.
        if all(map(isfinite, chain(*motion.values()))):
            found |= motion
    return found


def _flat(frames: Sequence[tuple[complex, float]]) -> list[float]:
    return [value for place, angle in frames for value in (place.real, place.imag, angle)]
