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

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from linkage_ros.effects.stage import Motion, Stage, Writer
from linkage_ros.joint_trajectory import JointTrajectoryWriter
from linkage_ros.kinematics.closure import Closure
from linkage_ros.scene.section import Section
from linkage_ros.tuples import new

NEEDS_CRANK_RATE = True


@dataclass(frozen=True, slots=True)
class AccelerationParameters:
    """Acceleration has none."""


def read(content: Section) -> AccelerationParameters:
    """Read the parameters."""
    content.finish()
    return AccelerationParameters()


def build(_parameters: AccelerationParameters, closure: Closure) -> Stage:
    """Build the stage."""
    acceleration_of = closure.acceleration

    def acceleration(motion: Motion) -> Motion:
        crank, position, joints, rates, _, velocity = motion
        if velocity is None:
            return motion
        found = acceleration_of(position, velocity, *crank.accelerations).joints
        # Towards a toggle it grows as the cube of what the rates grow as: it may overflow alone.
        if not all(map(isfinite, found)):
            return motion
        return new(Motion, (crank, position, joints, rates, found, velocity))

    return acceleration


def writer(joints: Sequence[str]) -> Writer:
    """Build what writes the message: the motion, as a trajectory of one point."""
    write = JointTrajectoryWriter(joints).write

    def write_motion(stamp: int, motion: Motion) -> bytes:
        _, _, positions, rates, accelerations, _ = motion
        return write(stamp, positions, rates, accelerations)

    return write_motion
