# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Velocity: the rates of the published joints, from the loop's velocity equation.

At a toggle the position is valid but no rates exist: they stay empty.
"""

from __future__ import annotations

from dataclasses import dataclass

from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects.stage import MechanismState, Stage


@dataclass(frozen=True, slots=True)
class VelocityParameters:
    """Rates of the joints, in JointState.velocity."""


PARAMETERS = VelocityParameters


def stage(_parameters: VelocityParameters, context: Context) -> Stage:
    """Build the stage."""
    velocity_of = context.closure.velocity

    def velocity(motion: MechanismState) -> MechanismState:
        position = motion.position
        if not position.status.has_rates:
            return motion
        return motion._replace(velocity=velocity_of(position, *motion.crank.rates))

    return velocity
