# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The effects in the order in which physics applies them, and the interface of their modules.

Each is a module, imported only if a scene names the effect, with

``PARAMETERS``
    The type of its parameters (see `linkage_ros.description.parameters`).

and with one function, whose name gives its place in the tick and which builds its part there:

``alter(parameters, linkage, random) -> Linkage``
    Return the linkage as it is made; this runs once, before the tick.
``drive_stage(parameters, context) -> Callable[[CrankState], CrankState]``
    Between the drive and the crank.
``stage(parameters, context) -> Callable[[MechanismState], MechanismState]``
    In the mechanism, after its loops are closed. The first is `velocity`: all others start from
    rates.
``sensor(parameters, context) -> Callable[[int, SensorReading], SensorReading | None]``
    Between the mechanism and the message: takes the time of the tick, in [ns], and the reading so
    far; returns the reading, or None. It is not called where the linkage has no pose or no crank,
    unless it has a method ``gap(now) -> SensorReading | None``; such a sensor also has
    ``gap_begins``: True if the gap started at the last call of `gap`.

An effect that publishes its own message also has

``TOPIC``, ``MESSAGE``
    The topic, and the type of the message: package/msg/Type.
``OF_READING``
    True if the message is made of the reading alone: then the motion is None, and the message is
    also published for a reading that a delay brings while the loop has no pose.
``writer(parameters, context) -> Callable[[int, MechanismState, SensorReading], bytes]``
    Build a function that writes the message, given the time of the tick, in [ns]; b'' if there is
    nothing to publish. It is called only if there is a reading. If it has a method
    ``no_pose(now, position) -> bytes``, that is called where the loop has no pose. If it has a
    method ``due(now) -> bool`` that returns False, it is not called, and no motion is computed
    for it.

A scene may also name a user-defined effect by the dotted name of its module: see
`linkage_ros.stages.effects.user_effects`. The optional parts of a module, a sensor or a writer are
looked up only here: in `Effect`, `SensorStage` and `WriterStage`.
"""

from __future__ import annotations

from collections.abc import Callable
from operator import add
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics import Acceleration, Position, Velocity
from linkage_ros.stages.drives import CrankState

if TYPE_CHECKING:
    from linkage_ros.dynamics import Reaction

EFFECTS: dict[str, str] = {
    # The mechanism as it was made.
    'tolerance': 'linkage_ros.stages.effects.tolerance',
    # Between motor and crank.
    'backlash': 'linkage_ros.stages.effects.backlash',
    # Its motion, and the forces for it.
    'velocity': 'linkage_ros.stages.effects.velocity',
    'acceleration': 'linkage_ros.stages.effects.acceleration',
    'friction': 'linkage_ros.stages.effects.friction',
    'effort': 'linkage_ros.stages.effects.effort',
    'pin_forces': 'linkage_ros.stages.effects.pin_forces',
    # Its displacement under these forces.
    'compliance': 'linkage_ros.stages.effects.compliance',
    'clearance': 'linkage_ros.stages.effects.clearance',
    # The sensor: when it measures, what it reads, and when that arrives.
    'jitter': 'linkage_ros.stages.effects.jitter',
    'bias': 'linkage_ros.stages.effects.bias',
    'noise': 'linkage_ros.stages.effects.noise',
    'measuring_range': 'linkage_ros.stages.effects.measuring_range',
    'encoder': 'linkage_ros.stages.effects.encoder',
    'rate_limit': 'linkage_ros.stages.effects.rate_limit',
    'dropout': 'linkage_ros.stages.effects.dropout',
    'delay': 'linkage_ros.stages.effects.delay',
    # The drawing of the mechanism.
    'markers': 'linkage_ros.stages.effects.markers',
}
"""Module of each effect, by name."""

NEEDS = {
    'acceleration': ('velocity',),
    'effort': ('velocity', 'acceleration'),
    'pin_forces': ('velocity', 'acceleration'),
    'compliance': ('velocity', 'acceleration', 'pin_forces'),
    'clearance': ('velocity', 'acceleration', 'pin_forces'),
    # They interpolate by the rates, whether these are published or not.
    'jitter': ('velocity',),
    'delay': ('velocity',),
}
"""Effects that an effect starts from: they are computed, but published only if named."""

PUBLISHED_WITH = {'acceleration': ('velocity',)}
"""Effects that are named together with an effect: a trajectory needs rates."""

FORCE_EFFECTS = ('effort', 'pin_forces', 'compliance', 'clearance')
"""
Effects to which masses, loads and friction matter.

Their stages are compiled with the linkage: they take functions from `kinematics.arithmetic`, and
call those that know numbers alone by its `called`.
"""


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
        of the wrenches; empty without such loads.

    """

    crank: CrankState
    position: Position
    velocity: Velocity | None
    acceleration: Acceleration | None
    efforts: tuple[float, ...]
    reactions: tuple[Reaction, ...]
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

    @classmethod
    def from_writer(cls, writer: Writer, *, of_reading: bool) -> WriterStage:
        """Put a writer in its place."""
        return cls(
            writer, getattr(writer, 'no_pose', None), getattr(writer, 'due', None), of_reading
        )


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
