# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""What passes through the stages of a tick: states, readings, and the stages themselves."""

from __future__ import annotations

from collections.abc import Callable
from operator import add
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics import Acceleration, Position, Velocity
from linkage_ros.stages.drives import CrankState

if TYPE_CHECKING:
    from linkage_ros.dynamics import JointReaction


class MechanismState(NamedTuple):
    """
    The state of the mechanism at a tick, passed from stage to stage.

    Attributes
    ----------
    crank
        The crank at the tick.
    position
        The closed loop.
    velocity, acceleration
        Derivatives of the loop's position; None if no stage computes them, or at a toggle.
    efforts
        Of the inputs, in [N·m] or [N]; empty if no stage computes them, or at a toggle.
    reactions
        In pins and sliders; empty as the efforts are.
    deflection
        Displacement of the published joints under load, in [rad] or [m]; empty for none.
    given
        What gives the loads that change: the time since the first pose, in [s], and the numbers
        of the wrenches; then the efforts of the inputs in the samples, if these are wanted, NaN
        where there are none; else empty.

    """

    crank: CrankState
    position: Position
    velocity: Velocity | None
    acceleration: Acceleration | None
    efforts: tuple[float, ...]
    reactions: tuple[JointReaction, ...]
    deflection: tuple[float, ...]
    given: tuple[float, ...] = ()


class SensorReading(NamedTuple):
    """
    The reading of the sensors, which is published.

    Attributes
    ----------
    stamp
        Of the message, in [ns].
    joints
        Values of the published joints, in [rad] or [m].
    rates
        In [rad/s] or [m/s]; empty if not computed, or at a toggle.
    accelerations
        In [rad/s²] or [m/s²]; empty as the rates are.
    efforts
        In [N·m] or [N]; empty as the rates are.

    """

    stamp: int
    joints: tuple[float, ...]
    rates: tuple[float, ...]
    accelerations: tuple[float, ...]
    efforts: tuple[float, ...]


class SensorStage(NamedTuple):
    """A sensor in its place."""

    read: Sensor
    # Called where the linkage has no pose; returns the reading. None if the sensor has no `gap`.
    gap: Callable[[int], SensorReading | None] | None
    # Called where a sensor before it has no reading, with True for a gap; returns the reading.
    silence: Callable[[int, bool], SensorReading | None] | None

    @classmethod
    def from_sensor(cls, sensor: Sensor) -> SensorStage:
        """Put a sensor in its place."""
        return cls(sensor, getattr(sensor, 'gap', None), getattr(sensor, 'silence', None))

    @property
    def gap_begins(self) -> bool:
        """Return whether the gap started at the last call of `gap`."""
        return self.gap is not None and bool(self.read.gap_begins)  # type: ignore[attr-defined]


class WriterStage(NamedTuple):
    """A writer of a message in its place."""

    write: Writer
    # Writes the message where the loop has no pose; None where nothing is published then.
    no_pose: Callable[[int, Position], bytes] | None
    due: Callable[[int], bool] | None  # At a time, in [ns]; None for always
    of_reading: bool  # The message is made of the reading alone
    of_forces: bool  # The message contains forces in joints only

    @classmethod
    def from_writer(
        cls, writer: Writer, *, of_reading: bool, of_forces: bool = False
    ) -> WriterStage:
        """Put a writer in its place."""
        no_pose, due = getattr(writer, 'no_pose', None), getattr(writer, 'due', None)
        return cls(writer, no_pose, due, of_reading, of_forces)


def restamp(reading: SensorReading, stamp: int) -> SensorReading:
    """Return a reading under another stamp, in [ns]."""
    return reading._replace(stamp=stamp)


def with_deflection(motion: MechanismState, deflection: tuple[float, ...]) -> MechanismState:
    """Return a motion whose published joints have moved further, in [rad] or [m]."""
    return motion._replace(
        deflection=tuple(map(add, motion.deflection, deflection))
        if motion.deflection
        else deflection
    )


DriveStage = Callable[[CrankState], CrankState]
Stage = Callable[[MechanismState], MechanismState]
Sensor = Callable[[int, SensorReading], SensorReading | None]
Writer = Callable[[int, Any, SensorReading], bytes]
