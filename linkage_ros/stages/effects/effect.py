# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The effects in the order in which physics applies them, and the classes that they derive from.

An effect is a frozen dataclass: its fields are its parameters, made by the functions of
`linkage_ros.description.parameters`; its class variables say all else about it. The base names its
place in the tick. A scene imports only the effects that it names.

A scene may also name a user-defined effect, by the dotted name of its module: see
`linkage_ros.stages.effects.user_effects`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Sequence
from random import Random
from typing import ClassVar, TYPE_CHECKING

from linkage_ros.errors import DefinitionError
from linkage_ros.stages.drives import Context
from linkage_ros.stages.effects.stage import DriveStage, Sensor, Stage, Writer

if TYPE_CHECKING:
    from linkage_ros.dynamics import Friction
    from linkage_ros.kinematics import Linkage, SpaceLinkage

_HERE = 'linkage_ros.stages.effects'

EFFECTS: dict[str, str] = {
    # The mechanism as it was made.
    'tolerance': f'{_HERE}.tolerance.ToleranceEffect',
    # Between motor and crank.
    'backlash': f'{_HERE}.backlash.BacklashEffect',
    # Its motion, and the forces for it.
    'velocity': f'{_HERE}.derivatives.VelocityEffect',
    'acceleration': f'{_HERE}.derivatives.AccelerationEffect',
    'friction': f'{_HERE}.friction.FrictionEffect',
    'effort': f'{_HERE}.forces.EffortEffect',
    'pin_forces': f'{_HERE}.forces.PinForcesEffect',
    # Its displacement under these forces.
    'compliance': f'{_HERE}.deflections.ComplianceEffect',
    'clearance': f'{_HERE}.deflections.ClearanceEffect',
    # The sensor: when it measures, what it reads, and when that arrives.
    'jitter': f'{_HERE}.jitter.JitterEffect',
    'bias': f'{_HERE}.bias.BiasEffect',
    'noise': f'{_HERE}.noise.NoiseEffect',
    'measuring_range': f'{_HERE}.measuring_range.MeasuringRangeEffect',
    'encoder': f'{_HERE}.encoder.EncoderEffect',
    'rate_limit': f'{_HERE}.rate_limit.RateLimitEffect',
    'dropout': f'{_HERE}.dropout.DropoutEffect',
    'delay': f'{_HERE}.delay.DelayEffect',
    # The drawing of the mechanism.
    'markers': f'{_HERE}.markers.MarkersEffect',
}
"""Class of each effect, by name."""


class Effect(ABC):
    """
    An effect: the parameters of a scene, and what the effect is.

    Attributes
    ----------
    place
        Where it acts in a tick, for a reader.
    needs
        Effects that it starts from: they are computed, but published only if named.
    publishes_with
        Effects that are named together with it.
    needs_forces
        Whether masses, loads and friction matter to it.
    suppresses_ticks
        Whether it may suppress the message of a tick.
    runs_in_gaps
        Whether it keeps running while a loop is open.
    without_inputs
        Reason and remedy of its refusal where the driven joints are not published; () if it does
        not need them.
    refused_drives
        Drives with which it is refused, each with the reason and the remedy.
    after
        Of a user-defined effect: the effect of this package after which it acts.
    sample
        Parameters for the four-bar, as a scene has them: for tables of costs, and tests.

    """

    __slots__ = ()

    place: ClassVar[str]
    needs: ClassVar[tuple[str, ...]] = ()
    publishes_with: ClassVar[tuple[str, ...]] = ()
    needs_forces: ClassVar[bool] = False
    suppresses_ticks: ClassVar[bool] = False
    runs_in_gaps: ClassVar[bool] = False
    without_inputs: ClassVar[tuple[str, ...]] = ()
    refused_drives: ClassVar[dict[str, tuple[str, str]]] = {}
    after: ClassVar[str] = ''
    sample: ClassVar[str] = '{}'

    @property
    def computes_forces(self) -> bool:
        """Return whether masses, loads and friction matter to it with these parameters."""
        return self.needs_forces

    @property
    def takes_efforts(self) -> bool:
        """Return whether it starts from efforts in the samples of the drive."""
        return False

    def needs_here(self, _named: Collection[str], *, moves_by_rates: bool) -> tuple[str, ...]:
        """Return the effects that it starts from in a scene with the named ones."""
        return self.needs

    @property
    def is_recoverable(self) -> bool:
        """Return whether a replay finds its state again from the middle of a run."""
        return True

    def refusal_beside(self, _beside: Sequence[Effect | None]) -> DefinitionError | None:
        """Return an error if it does not fit to those of all linkages of the scene; else None."""
        return None


class LinkageEffect(Effect):
    """An effect that alters the linkage once, before the tick."""

    __slots__ = ()
    place: ClassVar[str] = 'in the place of the linkage that is drawn'

    @abstractmethod
    def alter(self, linkage: Linkage | SpaceLinkage, random: Random) -> Linkage | SpaceLinkage:
        """Return the linkage as it is made."""


class DriveEffect(Effect):
    """An effect between the drive and the crank."""

    __slots__ = ()
    place: ClassVar[str] = 'between motor and crank'

    @abstractmethod
    def drive_stage(self, context: Context) -> DriveStage:
        """Build a function of the crank state, which returns the crank state behind it."""


class MechanismEffect(Effect):
    """
    An effect in the mechanism, after its loops are closed.

    Attributes
    ----------
    derivative
        Order of the time derivative that it computes; 0 for none. A compiled linkage computes it
        by itself.
    is_compiled
        Whether its stage is compiled with the linkage: it takes functions from
        `kinematics.arithmetic`.
    gives
        Field of the reading that it fills; '' for none.

    """

    __slots__ = ()
    place: ClassVar[str] = 'in the mechanism'
    needs: ClassVar[tuple[str, ...]] = ('velocity',)
    derivative: ClassVar[int] = 0
    is_compiled: ClassVar[bool] = False
    gives: ClassVar[str] = ''

    @abstractmethod
    def stage(self, context: Context) -> Stage:
        """Build a function of the mechanism's state, which returns the state behind it."""


class ForceEffect(Effect):
    """An effect on all that works with forces; it is not a stage of the tick."""

    __slots__ = ()
    place: ClassVar[str] = 'in the forces'

    @property
    @abstractmethod
    def friction(self) -> Friction:
        """Return the friction in the joints, in the form that `Mechanics` takes."""


class SensorEffect(Effect):
    """
    An effect between the mechanism and the message.

    Attributes
    ----------
    reads
        Sensor effect before it whose sensor it reads at its own times, by `read_by`; '' for none.

    """

    __slots__ = ()
    place: ClassVar[str] = 'between mechanism and message'
    reads: ClassVar[str] = ''

    @abstractmethod
    def sensor(self, context: Context) -> Sensor:
        """
        Build a function of the time of the tick, in [ns], and the reading so far.

        It returns the reading, or None. It is not called where the linkage has no pose or no
        crank, unless it has a method ``gap(now) -> SensorReading | None``; such a sensor also has
        ``gap_begins``: True if the gap started at the last call of `gap`.
        """


class MessageEffect(Effect):
    """
    An effect that publishes its own message.

    Attributes
    ----------
    topic, message
        The topic, and the type of the message: package/msg/Type.
    of_reading
        Whether the message is made of the reading alone: then the motion is None, and the message
        is also published for a reading that a delay brings while the loop has no pose.
    of_forces
        Whether the message contains forces in joints only.

    """

    __slots__ = ()
    place: ClassVar[str] = 'next to the joint states'
    topic: ClassVar[str] = ''
    message: ClassVar[str] = ''
    of_reading: ClassVar[bool] = False
    of_forces: ClassVar[bool] = False

    @abstractmethod
    def writer(self, context: Context) -> Writer:
        """
        Build a function of time, in [ns], motion and reading, which writes the message.

        It returns b'' if there is nothing to publish. It is called only if there is a reading. If
        it has a method ``no_pose(now, position) -> bytes``, that is called where the loop has no
        pose. If it has a method ``due(now) -> bool`` that returns False, it is not called, and no
        motion is computed for it.
        """


BASES = (LinkageEffect, DriveEffect, MechanismEffect, ForceEffect, SensorEffect, MessageEffect)
"""The bases, of which each effect has one or more."""
