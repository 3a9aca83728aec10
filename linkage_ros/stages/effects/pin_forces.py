# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Pin forces: forces between the links of a linkage in their pins and sliders.

They are computed for the rigid linkage, by Newton's and Euler's equations of every link; see
`linkage_ros.dynamics.reactions`. One message holds all forces of an instant, hence the type
``sensor_msgs/MultiDOFJointState`` and not a ``geometry_msgs/WrenchStamped`` per pin: these would
be separate topics, to be matched by stamp, each with a frame that no node broadcasts. ``wrench``
holds for each of ``joint_names`` the force (x, y) and the moment about z, in the frame of the
ground; ``transforms`` and ``twist`` are empty. At a toggle no forces exist, and there is no
message.
"""

from __future__ import annotations

from dataclasses import dataclass

from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects.stage import MechanismState, SensorReading, Stage, Writer

TOPIC = '~/pin_forces'
MESSAGE = 'sensor_msgs/msg/MultiDOFJointState'


@dataclass(frozen=True, slots=True)
class PinForcesParameters:
    """Forces in pins and sliders, on ~/pin_forces."""


PARAMETERS = PinForcesParameters


def stage(_parameters: PinForcesParameters, context: Context) -> Stage:
    """Build the stage."""
    solve = context.reactions.solve

    def pin_forces(motion: MechanismState) -> MechanismState:
        velocity, acceleration = motion.velocity, motion.acceleration
        if velocity is None or acceleration is None:
            return motion
        reactions = solve(motion.position, velocity, acceleration, motion.given)
        return motion if reactions is None else motion._replace(reactions=reactions)

    return pin_forces


def writer(_parameters: PinForcesParameters, context: Context) -> Writer:
    """Build the writer of the message; b'' where there are no forces."""
    from linkage_ros.messages import joint_values  # local import: if published

    write = joint_values.PlanarWrenchWriter(
        [context.prefix + name for name in context.reactions.names]
    ).write

    def write_forces(now: int, motion: MechanismState, _reading: SensorReading) -> bytes:
        return write(now, motion.reactions) if motion.reactions else b''

    return write_forces
