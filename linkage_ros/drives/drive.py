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
The drives: where the crank comes from.

Each is a module, imported only where a scene names the drive, with

``PARAMETERS``
    The type of its parameters (see `linkage_ros.files.parameters`).
``build(parameters, context: Context) -> Drive``
    Build it.

A drive that listens to a topic has also

``TOPIC``
    The topic; its messages are ``sensor_msgs/msg/JointState``.
``reader(context) -> Callable[[bytes], sample | Rejection]``
    Build what makes a sample of a message; the drive has then ``offer(sample, now)``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from random import Random
from typing import Any, NamedTuple, Protocol, TYPE_CHECKING

from linkage_ros.generated_code import Lines
from linkage_ros.kinematics.closure import Closure

if TYPE_CHECKING:
    from linkage_ros.dynamics.loads import Friction, Loads
    from linkage_ros.dynamics.mechanics import Mechanics
    from linkage_ros.dynamics.reactions import Reactions

DRIVES = {
    'topic': 'linkage_ros.drives.topic',
    'constant_rate': 'linkage_ros.drives.constant_rate',
    'profile': 'linkage_ros.drives.profile',
    'sine': 'linkage_ros.drives.sine',
    'chirp': 'linkage_ros.drives.chirp',
    'bag': 'linkage_ros.drives.bag',
    'torque': 'linkage_ros.drives.torque',
}
"""Name of each drive, and the module that holds it."""


class CrankState(NamedTuple):
    """
    The crank at a tick.

    Attributes
    ----------
    angles
        Of each input, in the order of the linkage, in [rad]; of one that slides in [m].
    rates
        In [rad/s] or [m/s].
    accelerations
        In [rad/s²] or [m/s²]; 0 where they are unknown.
    age
        Time of the tick less that of the sample, in [ns].

    """

    angles: tuple[float, ...]
    rates: tuple[float, ...]
    accelerations: tuple[float, ...]
    age: int


_CRANK = ', '.join(CrankState._fields)


class CrankBehindPlay(CrankState):
    """
    The crank at a tick, behind the play between it and its motor.

    Attributes
    ----------
    free_motors
        For each input the acceleration of its motor, in [rad/s²] or [m/s²], where the motor moves
        within the play and pushes nothing; None where it pushes the crank.

    """

    free_motors: tuple[float | None, ...] = ()


class Drive(Protocol):
    """A drive at work; it remembers, and a reset builds it again."""

    @property
    def stamp(self) -> int:
        """Stamp of the newest good sample, in [ns]; 0 where there is none."""

    @property
    def max_age(self) -> int:
        """Age of the newest sample beyond which something is amiss, in [ns]; 0 for never."""

    def state(self, now: int, /) -> CrankState | None:
        """Return the crank at a time, in [ns]; nothing where there is none."""

    def straight(self, _inputs: int, leave: str) -> Lines:
        """
        Return `state` as lines that make what a `CrankState` has, by its names, of ``now``.

        Parameters
        ----------
        inputs
            How many the linkage has.
        leave
            The statement that leaves the lines where there is no crank.

        """
        lines = ['crank = state(now)', 'if crank is None:', f'    {leave}', f'{_CRANK} = crank']
        return Lines(lines, {'state': self.state})


@dataclass(frozen=True)
class Context:
    """
    What drives and effects are built for.

    Attributes
    ----------
    closure
        The linkage, as it is solved.
    rate
        Ticks a second, in [Hz]; 0 for one for every crank sample.
    needs_rate
        Whether something uses the crank's rate.
    seed
        From which every random generator of this linkage is made.
    loads
        The forces that act on it.
    friction
        In its joints; nothing where the scene names none.
    prefix
        What the joints' names have before their own in messages; '' for nothing.
    dependent
        Names in messages of the joints of all linkages that follow from driven ones.
    effects
        Names of the effects that the scene names.
    moves_by_rates
        Whether the crank's rates are those at which it moves; one that is held between its samples
        stands, whatever its rate.

    """

    closure: Closure
    rate: float
    needs_rate: bool
    seed: str
    loads: Loads | None
    friction: Friction | None
    prefix: str = ''
    dependent: frozenset[str] = frozenset()
    effects: frozenset[str] = frozenset()
    moves_by_rates: bool = True

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the published joints, as the linkage has them."""
        return tuple(self.closure.linkage.joints)

    @property
    def joints_in_messages(self) -> tuple[str, ...]:
        """Names of the published joints, as messages have them."""
        return tuple(self.prefix + joint for joint in self.closure.linkage.joints)

    @property
    def inputs_in_messages(self) -> tuple[str, ...]:
        """Names of the driven joints, as messages have them."""
        return tuple(self.prefix + given.joint for given in self.closure.linkage.inputs)

    def random(self, effect: str) -> Random:
        """Return a generator of an effect's own: what others draw does not change it."""
        return self.generator(self.seed, effect)

    @staticmethod
    def generator(seed: str, effect: str) -> Random:
        """Return an effect's generator, where its context does not exist yet."""
        return Random(f'{seed}/{effect}')

    @cached_property
    def mechanics(self) -> Mechanics:
        """Return the forces of the linkage, shared by all that ask for them."""
        from linkage_ros.dynamics.mechanics import Mechanics  # local import: where forces act

        return Mechanics(self.closure, self.loads, self.friction)

    @cached_property
    def reactions(self) -> Reactions:
        """Return the forces in its pins and sliders, shared by all that ask for them."""
        from linkage_ros.dynamics.reactions import Reactions  # local import: where forces act

        return Reactions(self.mechanics)


Reader = Callable[[bytes], Any]
"""Makes a sample, or a Rejection, of a message."""
