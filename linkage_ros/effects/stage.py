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

``PARAMETERS``
    The type of its parameters (see `linkage_ros.files.parameters`).

and with what builds its part of the tick; which, says where in the tick it stands:

``alter(parameters, linkage, random) -> Linkage``
    Another linkage in the place of the one that is drawn; no part of the tick.
``drive_stage(parameters, context) -> Callable[[CrankState], CrankState]``
    Between the drive and the crank.
``stage(parameters, context) -> Callable[[Motion], Motion]``
    In the mechanism, once its loops are closed. The first is `velocity`: all others start from
    rates.
``sensor(parameters, context) -> Callable[[int, Reading], Reading | None]``
    Between the mechanism and the message: given the time of the tick, in [ns], and what is read
    so far, return what is read; None where nothing is. Where the linkage has no pose, or no crank,
    it is not asked, unless it has a method ``gap(now) -> Reading | None``; such a sensor also says
    by ``gap_begins`` whether the last gap that it was told of began there.

An effect that publishes a message of its own has also

``TOPIC``, ``MESSAGE``
    The topic, and the type of the message: package/msg/Type.
``OF_READING``
    True where the message is made of the reading alone: then the motion is None, and the message
    is also published of a reading that a delay brings where the loop has no pose.
``writer(parameters, context) -> Callable[[int, Motion, Reading], bytes]``
    Build what writes the message, given the time of the tick, in [ns]; b'' where there is nothing
    to publish. It is asked only where there is a reading. Where it has a method
    ``no_pose(now, position) -> bytes`` that is asked where the loop has no pose. Where it has a
    method ``due(now) -> bool`` and that says no, it is not asked at all, and no motion is worked
    out for it.

A scene may also name a module of one's own, by its dotted name: see
`linkage_ros.effects.user_effects`. What a module, a sensor or a writer may leave out is looked up
here alone: `Effect`, `SensorStage` and `WriterStage` say what stands in its place.
"""

from __future__ import annotations

from collections.abc import Callable
from operator import add
from typing import Any, NamedTuple, TYPE_CHECKING

from linkage_ros.drives.drive import CrankState
from linkage_ros.kinematics.results import Acceleration, Position, Velocity

if TYPE_CHECKING:
    from linkage_ros.dynamics.reactions import Reaction

EFFECTS = {
    # The mechanism as it was made.
    'tolerance': 'linkage_ros.effects.tolerance',
    # Between motor and crank.
    'backlash': 'linkage_ros.effects.backlash',
    # How it moves, and what that takes.
    'velocity': 'linkage_ros.effects.velocity',
    'acceleration': 'linkage_ros.effects.acceleration',
    'friction': 'linkage_ros.effects.friction',
    'effort': 'linkage_ros.effects.effort',
    'pin_forces': 'linkage_ros.effects.pin_forces',
    # How it yields under these forces.
    'compliance': 'linkage_ros.effects.compliance',
    'clearance': 'linkage_ros.effects.clearance',
    # What a sensor makes of it: when it looks, what it sees, and when that arrives.
    'jitter': 'linkage_ros.effects.jitter',
    'bias': 'linkage_ros.effects.bias',
    'noise': 'linkage_ros.effects.noise',
    'encoder': 'linkage_ros.effects.encoder',
    'rate_limit': 'linkage_ros.effects.rate_limit',
    'dropout': 'linkage_ros.effects.dropout',
    'delay': 'linkage_ros.effects.delay',
    # What is drawn of the mechanism.
    'markers': 'linkage_ros.effects.markers',
}
"""Name of each effect, and the module that holds it."""

NEEDS = {
    'acceleration': ('velocity',),
    'effort': ('velocity', 'acceleration'),
    'pin_forces': ('velocity', 'acceleration'),
    'compliance': ('velocity', 'acceleration', 'pin_forces'),
    'clearance': ('velocity', 'acceleration', 'pin_forces'),
    # Between two readings by their rates, whether these are published or not.
    'jitter': ('velocity',),
    'delay': ('velocity',),
}
"""What an effect starts from, which is then computed; but published only where it is named."""

PUBLISHED_WITH = {'acceleration': ('velocity',)}
"""What to name an effect is to name too: a trajectory without rates is of no use."""

FORCE_EFFECTS = ('effort', 'pin_forces', 'compliance', 'clearance')
"""
Effects to which masses, loads and friction matter.

Their stages are compiled with the linkage: they take functions from `kinematics.arithmetic`, and
call those that know numbers alone by its `called`.
"""


class MechanismState(NamedTuple):
    """
    What the mechanism does at a tick, handed from stage to stage.

    Attributes
    ----------
    crank
        The crank at the tick.
    position
        The closed loop.
    velocity, acceleration
        The loop's; nothing where no stage asked, or at a toggle.
    efforts
        Of the inputs, in [N·m] or [N]; empty where no stage asked, or at a toggle.
    reactions
        In pins and sliders; empty as the efforts are.
    shift
        What is added to the published joints, in [rad] or [m], because the mechanism yields; empty
        for nothing.

    """

    crank: CrankState
    position: Position
    velocity: Velocity | None
    acceleration: Acceleration | None
    efforts: tuple[float, ...]
    reactions: tuple[Reaction, ...]
    shift: tuple[float, ...]


class SensorReading(NamedTuple):
    """
    What the sensors make of a motion, and what is published.

    Attributes
    ----------
    stamp
        Of the message, in [ns].
    joints
        Values of the published joints, in [rad] or [m].
    rates
        In [rad/s] or [m/s]; empty where not called for, or at a toggle.
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
    """
    A sensor in its place.

    Attributes
    ----------
    read
        Reads.
    gap
        Is told that the linkage has no pose, and returns what is read then; None where nothing is
        and it need not be told.
    silence
        Is told that a sensor before it reads nothing, and whether since that one looks into a gap;
        returns what is read then. None as above.

    """

    read: Sensor
    gap: Callable[[int], SensorReading | None] | None
    silence: Callable[[int, bool], SensorReading | None] | None

    @classmethod
    def of(cls, sensor: Sensor) -> SensorStage:
        """Put a sensor in its place."""
        return cls(sensor, getattr(sensor, 'gap', None), getattr(sensor, 'silence', None))

    @property
    def gap_begins(self) -> bool:
        """Return whether the last gap that it was told of began there."""
        return self.gap is not None and bool(self.read.gap_begins)  # type: ignore[attr-defined]


class WriterStage(NamedTuple):
    """
    A writer of a message in its place.

    Attributes
    ----------
    write
        Writes the message.
    no_pose
        Writes it where the loop has no pose; None where nothing is published then.
    due
        Says whether there is anything to write at a time, in [ns]; None for always.
    of_reading
        Whether the message is made of the reading alone.

    """

    write: Writer
    no_pose: Callable[[int, Position], bytes] | None
    due: Callable[[int], bool] | None
    of_reading: bool

    @classmethod
    def of(cls, writer: Writer, *, of_reading: bool) -> WriterStage:
        """Put a writer in its place."""
        return cls(
            writer, getattr(writer, 'no_pose', None), getattr(writer, 'due', None), of_reading
        )


def restamped(reading: SensorReading, stamp: int) -> SensorReading:
    """Return a reading under another stamp, in [ns]."""
    return reading._replace(stamp=stamp)


def yielding(motion: MechanismState, moved: tuple[float, ...]) -> MechanismState:
    """Return a motion whose published joints have moved further, in [rad] or [m]."""
    return motion._replace(shift=tuple(map(add, motion.shift, moved)) if motion.shift else moved)


DriveStage = Callable[[CrankState], CrankState]
Stage = Callable[[MechanismState], MechanismState]
Sensor = Callable[[int, SensorReading], SensorReading | None]
Writer = Callable[[int, Any, SensorReading], bytes]
