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
The effects, in the order in which physics applies them.

Each is a module, imported only where a scene names the effect, with

``NEEDS_CRANK_RATE``
    Whether it uses the crank's rate.
``read(content: Section) -> parameters``
    Read its parameters, strictly; a frozen type.
``build(parameters, closure: Closure) -> Stage``
    Build the stage of the tick.

An effect that publishes a message of its own has also

``writer(joints: Sequence[str]) -> Writer``
    Build what writes the message, from the motion as it is published.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from linkage_ros.drives.topic import CrankState
from linkage_ros.kinematics.closure import Position, Velocity

EFFECTS = {
    'velocity': 'linkage_ros.effects.velocity',
    'acceleration': 'linkage_ros.effects.acceleration',
}
"""Name of each effect, and the module that holds it."""

NEEDS = {'acceleration': ('velocity',)}
"""What an effect starts from: to name it is to name these too."""


class Motion(NamedTuple):
    """
    What a tick knows, handed from stage to stage.

    Attributes
    ----------
    crank
        The crank at the tick.
    position
        The closed loop.
    joints
        Values of the published joints, in [rad] or [m].
    rates
        Their rates, in [rad/s] or [m/s]; empty where no one asked, or at a toggle.
    accelerations
        Their accelerations, in [rad/s²] or [m/s²]; empty as the rates are.
    velocity
        The loop's, from which its acceleration starts; nothing where there are no rates.

    """

    crank: CrankState
    position: Position
    joints: tuple[float, ...]
    rates: tuple[float, ...]
    accelerations: tuple[float, ...]
    velocity: Velocity | None


Stage = Callable[[Motion], Motion]
Writer = Callable[[int, Motion], bytes]
"""Writes a message, given its stamp, in [ns], and the motion."""
