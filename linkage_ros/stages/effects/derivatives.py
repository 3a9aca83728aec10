# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Velocity and acceleration: the time derivatives of the published joints.

`velocity`: the rates of the published joints, from the loop's velocity equation.

At a toggle the position is valid but no rates exist: they stay empty.

`acceleration`: the second time derivative of the published joints, on a separate topic.

It is computed from the velocity, without solving the loops again. The acceleration of the crank
comes from the drive, which gives 0 if it is unknown: then only the part due to the crank's rate is
published. At a toggle neither accelerations nor rates exist, and both stay empty.
"""

from __future__ import annotations

from dataclasses import dataclass

from linkage_ros.kinematics import all_finite
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects.effect import MechanismEffect, MessageEffect
from linkage_ros.stages.effects.stage import MechanismState, SensorReading, Stage, Writer


@dataclass(frozen=True, slots=True)
class VelocityEffect(MechanismEffect):
    """Rates of the joints, in JointState.velocity."""

    needs = ()
    derivative = 1
    is_compiled = True
    gives = 'rates'

    def stage(self, context: Context) -> Stage:
        """Build the stage."""
        velocity_of = context.closure.velocity

        def velocity(motion: MechanismState) -> MechanismState:
            position = motion.position
            if not position.status.has_rates:
                return motion
            return motion._replace(velocity=velocity_of(position, *motion.crank.rates))

        return velocity


@dataclass(frozen=True, slots=True)
class AccelerationEffect(MechanismEffect, MessageEffect):
    """Accelerations of the joints, on ~/motion; and with them velocity."""

    publishes_with = ('velocity',)
    derivative = 2
    is_compiled = True
    gives = 'accelerations'
    topic = '~/motion'
    message = 'trajectory_msgs/msg/JointTrajectory'
    of_reading = True

    def stage(self, context: Context) -> Stage:
        """Build the stage."""
        acceleration_of = context.closure.acceleration

        def acceleration(motion: MechanismState) -> MechanismState:
            velocity = motion.velocity
            if velocity is None:
                return motion
            acceleration = acceleration_of(motion.position, velocity, *motion.crank.accelerations)
            # Near a toggle it grows with the cube of the factor of the rates, and may overflow.
            if not all_finite(acceleration.joints):
                return motion
            return motion._replace(acceleration=acceleration)

        return acceleration

    def writer(self, context: Context) -> Writer:
        """Build the writer of the message: the reading as a trajectory of one point."""
        from linkage_ros.messages import joint_values  # local import: if published

        write = joint_values.JointTrajectoryWriter(context.joints_in_messages).write

        def write_motion(
            _now: int, _motion: MechanismState | None, reading: SensorReading
        ) -> bytes:
            return write(reading.stamp, reading.joints, reading.rates, reading.accelerations)

        return write_motion
