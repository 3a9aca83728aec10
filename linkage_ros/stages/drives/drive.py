# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The drives, which determine the crank state, and the classes that they derive from.

A drive is a frozen dataclass: its fields are its parameters, made by the functions of
`linkage_ros.description.parameters`; its class variables say all else about it. It builds the
crank that it moves. A scene imports only the drive that it names.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from random import Random
from typing import Any, ClassVar, NamedTuple, Protocol, TYPE_CHECKING

from linkage_ros.kinematics import Closure
from linkage_ros.stages.plugin import load_class

if TYPE_CHECKING:
    from linkage_ros.dynamics import Friction, Loads, Mechanics, Reactions

_HERE = 'linkage_ros.stages.drives'

DRIVES = {
    'topic': f'{_HERE}.topic.TopicDrive',
    'constant_rate': f'{_HERE}.steady_motion.ConstantRateDrive',
    'profile': f'{_HERE}.profile.ProfileDrive',
    'sine': f'{_HERE}.steady_motion.SineDrive',
    'chirp': f'{_HERE}.chirp.ChirpDrive',
    'bag': f'{_HERE}.bag.BagDrive',
    'torque': f'{_HERE}.torque.TorqueDrive',
}
"""Class of each drive, by name."""

LARGEST = 1e10
"""Larger angles, in [rad], are 2e-6 rad apart as doubles: no machine has them. Likewise rates."""

Reader = Callable[[bytes], Any]
"""Reads a sample, or a Rejection, from a message."""


class CrankState(NamedTuple):
    """
    State of the inputs at a tick.

    Attributes
    ----------
    angles
        Value of each input, in the order of the linkage, in [rad]; of a sliding input in [m].
    rates
        Rates in [rad/s] or [m/s].
    accelerations
        Accelerations in [rad/s²] or [m/s²]; 0 where unknown.
    age
        Time of the tick minus time of the sample, in [ns].

    """

    angles: tuple[float, ...]
    rates: tuple[float, ...]
    accelerations: tuple[float, ...]
    age: int


class CrankBehindPlay(CrankState):
    """State of the inputs at a tick, after the play between them and their motors."""

    # For each input the acceleration of its motor, in [rad/s²] or [m/s²], while the motor moves
    # within the play and transmits no force; None while it drives the input.
    free_motors: tuple[float | None, ...] = ()


class CrankAtRest(CrankState):
    """State of inputs with the efforts that the drive may exert, as on one that stands."""

    # For each input the least and the greatest, in [N·m] or [N]: they differ where a brake or a
    # gear holds.
    bearing: tuple[float, ...] = ()


class Crank(Protocol):
    """A crank that a drive moves, with its state; a reset builds a new one."""

    exerts_effort: bool = False
    """Whether its state says what the drive exerts on an input at rest."""

    @property
    def stamp(self) -> int:
        """Stamp of the newest good sample, in [ns]; 0 without one."""

    @property
    def stamps(self) -> tuple[int, ...]:
        """Likewise of each input, where each has samples of its own; else of all together."""
        return (self.stamp,)

    @property
    def newest_inputs(self) -> tuple[int, ...]:
        """Numbers of the inputs, of those with samples of their own, that took the last one."""
        return (0,)

    @property
    def efforts(self) -> tuple[float, ...]:
        """Efforts of the inputs in the newest samples, in [N·m] or [N]; NaN for none."""
        return ()

    @property
    def max_age(self) -> int:
        """Age of the newest sample above which a warning is due, in [ns]; 0 for never."""

    def state(self, now: int, /) -> CrankState | None:
        """Return the crank state at a time, in [ns]; None if there is none."""

    @property
    def chatter_count(self) -> int:
        """Return the number of steps in which motor and crank met and parted too often."""
        return 0


class FormulaCrank(Crank):
    """
    A crank whose state is a formula of the time and of the numbers that it holds.

    A compiled tick runs `crank_state` on symbols: it takes its functions from
    `linkage_ros.kinematics`, and where it decides otherwise than usually, the tick is interpreted.
    """

    __slots__ = ()

    HELD: ClassVar[str]
    """Name of the attribute with the numbers that it holds; None as long as there are none."""

    def usual(self, inputs: int) -> tuple[int, Any]:
        """Return a time, in [ns], and held numbers for a number of inputs, in their types."""
        raise NotImplementedError

    def crank_state(self, now: int, held: Any) -> CrankState | None:
        """Return the crank state at a time, in [ns], by the numbers that it holds."""
        raise NotImplementedError

    def state(self, now: int) -> CrankState | None:
        """Return the crank state at a time, in [ns]; None if there is none."""
        held = getattr(self, self.HELD)
        return None if held is None else self.crank_state(now, held)


def describe_chatter(steps: int) -> str:
    """Return a line on the steps that `Crank.chatter_count` counts."""
    return (
        f'drive.torque.play: motor and crank met and parted too often in {steps} steps, at whose '
        'ends the play was closed; shorten the step, or look at the controller'
    )


@dataclass(frozen=True)
class Context:
    """
    Context from which drives and effects are built.

    Attributes
    ----------
    closure
        Closure of the linkage.
    rate
        Tick rate, in [Hz]; 0 for one tick per crank sample.
    needs_rate
        Whether something uses the rate of the crank.
    seed
        Seed of every random generator of this linkage.
    loads
        Forces on the linkage.
    friction
        Friction in its joints; None if the scene has none.
    prefix
        Prefix of the joint names in messages; '' for none.
    dependent
        Names, as in messages, of the dependent joints of all linkages.
    effects
        Names of the effects in the scene.
    moves_by_rates
        Whether the crank moves at its rates; an input that is held between samples stands still,
        whatever its rate.
    takes_efforts
        Whether the efforts in samples of the crank are wanted.
    instead_of_inputs
        Joints that samples name instead of the inputs; none if the inputs.

    """

    closure: Any  # A `Closure`; an effect for planar linkages alone asks for one of these
    rate: float
    needs_rate: bool
    seed: str
    loads: Loads | None
    friction: Friction | None
    prefix: str = ''
    dependent: frozenset[str] = frozenset()
    effects: frozenset[str] = frozenset()
    moves_by_rates: bool = True
    takes_efforts: bool = False
    instead_of_inputs: tuple[str, ...] = ()

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the published joints, without prefix."""
        return tuple(self.closure.linkage.joints)

    @property
    def joints_in_messages(self) -> tuple[str, ...]:
        """Names of the published joints, as messages have them."""
        return tuple(self.prefix + joint for joint in self.closure.linkage.joints)

    @property
    def inputs_in_messages(self) -> tuple[str, ...]:
        """Names of the driven joints, as messages have them."""
        return tuple(self.prefix + driven.joint for driven in self.closure.linkage.inputs)

    def random(self, effect: str) -> Random:
        """Return the random generator of an effect, independent of other effects."""
        return self.generator(self.seed, effect)

    @staticmethod
    def generator(seed: str, effect: str) -> Random:
        """Return the random generator of an effect before its context exists."""
        return Random(f'{seed}/{effect}')

    @cached_property
    def hard_limited(self) -> Any:  # A `Closure`
        """Return the closure without the limits at which a stop yields."""
        yielding = self.loads.applied.stops if self.loads else ()
        if not yielding:
            return self.closure
        return Closure(self.closure.linkage.without_limits(yielding))

    @cached_property
    def mechanics(self) -> Mechanics:
        """Return the force model of the linkage; all users share it."""
        from linkage_ros.dynamics import Mechanics  # local import: only with forces

        return Mechanics(self.closure, self.loads, self.friction)

    @cached_property
    def reactions(self) -> Reactions:
        """Return the forces in pins and sliders; all users share them."""
        from linkage_ros.dynamics import Reactions  # local import: only with forces

        return Reactions(self.mechanics)


class Drive(ABC):
    """
    A drive: the parameters of a scene, and what the drive is.

    Attributes
    ----------
    listens_to
        Its topic, of ``sensor_msgs/msg/JointState``; '' for none. Then its crank has
        ``offer(sample, now) -> Rejection | None``.
    publishes, message
        Its own topic, and the type of the message: package/msg/Type; '' for none.
    is_measured
        Whether its samples say where the inputs are, and it moves them no other way.
    gives_torque
        Whether it gives efforts, by which the inputs move.
    reads_bag
        Whether its samples come from a bag.
    keeps_state
        Whether its crank's state depends on earlier ticks.

    """

    __slots__ = ()

    listens_to: ClassVar[str] = ''
    publishes: ClassVar[str] = ''
    message: ClassVar[str] = ''
    is_measured: ClassVar[bool] = False
    gives_torque: ClassVar[bool] = False
    reads_bag: ClassVar[bool] = False
    keeps_state: ClassVar[bool] = True

    @property
    def instead_of_inputs(self) -> tuple[str, ...]:
        """Return the joints that samples name instead of the inputs; none if the inputs."""
        return ()

    @property
    def moves_by_rates(self) -> bool:
        """Return whether the crank moves at its rates between samples."""
        return True

    @property
    def is_recoverable(self) -> bool:
        """Return whether a run may be replayed from its middle: samples say the state."""
        return False

    @abstractmethod
    def build(self, context: Context) -> Crank:
        """Build the crank; raise `DefinitionError` if it cannot move as the parameters say."""

    def reader(self, _context: Context) -> Reader:
        """Build a function that reads a sample from a message."""
        raise NotImplementedError

    def writer(self, _context: Context, _crank: Any) -> Callable[..., bytes] | None:
        """Build the writer of its own message, for its crank; None if there is none."""
        return None


def drive_class(name: str) -> type[Drive]:
    """Import a drive."""
    return load_class(DRIVES[name])
