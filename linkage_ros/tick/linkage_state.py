# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The result of a tick, and the state of each linkage at it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TYPE_CHECKING, TypeAlias

from linkage_ros.stages.drives import CrankState
from linkage_ros.stages.effects import MechanismState, SensorReading

if TYPE_CHECKING:
    from linkage_ros.dynamics import Reaction
    from linkage_ros.kinematics import Position
    from linkage_ros.tick.pipeline import LinkagePipeline

Solution: TypeAlias = 'tuple[Position | None, MechanismState | None]'
"""Position and motion of a linkage, each None where there is none."""


class LinkageState:
    """The state of one linkage at a tick; what its messages did not need is computed on demand."""

    __slots__ = ('_linkage', '_reactions', '_solution', 'crank', 'given', 'is_compiled', 'reading')

    def __init__(
        self,
        linkage: LinkagePipeline,
        crank: CrankState | None,
        reading: SensorReading | None,
        reactions: tuple[Reaction, ...] = (),
        given: tuple[float, ...] = (),
        solution: Solution | None = None,
    ) -> None:
        self._linkage = linkage
        self._reactions = reactions
        self._solution = solution
        self.crank = crank
        """State of the crank; None without one."""
        self.reading = reading
        """Published values; None where nothing is published. A delay may publish some although
        the linkage has no pose."""
        self.given = given
        """What gives the loads that change, as in `MechanismState`."""
        self.is_compiled = solution is None
        """Whether a compiled tick computed it; then the linkage is closed."""

    @property
    def position(self) -> Position | None:
        """Solution of the loops; None without a crank state."""
        return self._solve()[0]

    @property
    def motion(self) -> MechanismState | None:
        """Motion of the mechanism; None where the loops do not close."""
        return self._solve()[1]

    @property
    def reactions(self) -> tuple[Reaction, ...]:
        """Forces in pins and sliders; empty where no message holds them, or there are none."""
        if self.is_compiled:
            return self._reactions
        return self.motion.reactions if self.motion is not None else ()

    @property
    def has_pose(self) -> bool:
        """Return whether the linkage has a pose that is published."""
        return self.is_compiled or (self.position is not None and bool(self.position.joints))

    def _solve(self) -> Solution:
        if self._solution is None:
            assert self.crank is not None
            self._solution = self._linkage.solve_mechanism(self.crank, self.given)
        return self._solution


class Tick(NamedTuple):
    """
    The result of a tick.

    Attributes
    ----------
    message
        The serialized JointState; empty where nothing is published.
    extras
        One serialized message for each auxiliary topic, b'' where that topic has none; an empty
        tuple where no auxiliary topic has a message.
    computed
        State of each linkage; instead of a compiled state that is published, the values of its
        crank state and of its reading, its reactions and its given numbers, as plain tuples.
    linkages
        The linkage pipelines.

    """

    message: bytes
    extras: tuple[bytes, ...]
    computed: Sequence[LinkageState | tuple[Any, ...]]
    linkages: Sequence[LinkagePipeline]

    @property
    def states(self) -> tuple[LinkageState, ...]:
        """State of each linkage."""
        return tuple(
            state if isinstance(state, LinkageState) else _name_values(linkage, *state)
            for linkage, state in zip(self.linkages, self.computed, strict=True)
        )


def _name_values(
    linkage: LinkagePipeline, crank: Any, reading: Any, reactions: Any, given: Any
) -> LinkageState:
    crank = crank if isinstance(crank, CrankState) else CrankState(*crank)
    return LinkageState(linkage, crank, SensorReading(*reading), reactions, given)
