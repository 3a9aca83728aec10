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
Acceleration: the second time derivative of the published joints, on a topic of its own.

It starts from the velocity and solves no loop again. The crank's own acceleration comes from the
drive, which says 0 where it does not know: then what is published is the part that the shape of
the linkage makes of the crank's rate. At a toggle no acceleration exists, as no rate does, and
both stay empty.
"""

from __future__ import annotations

from dataclasses import dataclass

from linkage_ros.drives.drive import Context
from linkage_ros.effects.stage import MechanismState, SensorReading, Stage, Writer
from linkage_ros.kinematics.arithmetic import all_finite

TOPIC = '~/motion'
MESSAGE = 'trajectory_msgs/msg/JointTrajectory'
OF_READING = True


@dataclass(frozen=True, slots=True)
class AccelerationParameters:
    """Accelerations of the joints, on ~/motion; and with them velocity."""


PARAMETERS = AccelerationParameters


def stage(_parameters: AccelerationParameters, context: Context) -> Stage:
    """Build the stage."""
    acceleration_of = context.closure.acceleration

    def acceleration(motion: MechanismState) -> MechanismState:
        velocity = motion.velocity
        if velocity is None:
            return motion
        found = acceleration_of(motion.position, velocity, *motion.crank.accelerations)
        # Towards a toggle it grows as the cube of what the rates grow as: it may overflow alone.
        if not all_finite(found.joints):
            return motion
        return motion._replace(acceleration=found)

    return acceleration


def writer(_parameters: AccelerationParameters, context: Context) -> Writer:
    """Build what writes the message: what is read, as a trajectory of one point."""
    from linkage_ros.messages import joint_trajectory  # local import: if published

    write = joint_trajectory.JointTrajectoryWriter(context.joints_in_messages).write

    def write_motion(_now: int, _motion: MechanismState | None, reading: SensorReading) -> bytes:
        return write(reading.stamp, reading.joints, reading.rates, reading.accelerations)

    return write_motion
