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
Effort: what the drive must give for the motion, by virtual work (inverse dynamics).

It bears the inertia of links and drive, gravity, springs and friction: see
`linkage_ros.dynamics.mechanics` for the equation and its source. The crank's acceleration is part
of it, and comes from the drive; a topic does not say it, and then it counts as 0. Under the torque
drive the effort is the one that makes the motion, which where the linkage sticks or lies against a
stop is not the one commanded.

At a toggle no rates exist, and no effort.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

from linkage_ros.drives.drive import Context
from linkage_ros.effects.stage import Motion, Stage
from linkage_ros.tuples import new


@dataclass(frozen=True, slots=True)
class EffortParameters:
    """Effort of the drive, in JointState.effort of the input where that is published."""


PARAMETERS = EffortParameters


def stage(_parameters: EffortParameters, context: Context) -> Stage:
    """Build the stage."""
    efforts_of = context.mechanics.drive_efforts

    def effort(motion: Motion) -> Motion:
        crank, position, velocity, acceleration, _, reactions, shift = motion
        if velocity is None or acceleration is None:
            return motion
        efforts = efforts_of(position, velocity, acceleration)
        # Towards a toggle they grow with the accelerations, and further.
        if not all(map(isfinite, efforts)):
            return motion
        return new(Motion, (crank, position, velocity, acceleration, efforts, reactions, shift))

    return effort
