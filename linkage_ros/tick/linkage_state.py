# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The state of a linkage at a tick."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

from linkage_ros.stages.drives import CrankState
from linkage_ros.stages.effects import MechanismState, SensorReading

if TYPE_CHECKING:
    from linkage_ros.dynamics import JointReaction
    from linkage_ros.kinematics import Position

Solution: TypeAlias = 'tuple[Position | None, MechanismState | None]'
"""Position and motion of a linkage, each None where there is none."""


class LinkageState:
    """The state of one linkage at a tick; what its messages did not need is computed on demand."""

    __slots__ = (
        '_complete',
        '_reactions',
        '_solution',
        'crank',
        'given',
        'is_compiled',
        'reading',
    )

    def __init__(
        self,
        complete: Callable[[CrankState, tuple[float, ...]], Solution],
        crank: CrankState | None,
        reading: SensorReading | None,
        reactions: tuple[JointReaction, ...] = (),
        given: tuple[float, ...] = (),
        solution: Solution | None = None,
    ) -> None:
        self._complete = complete
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
    def reactions(self) -> tuple[JointReaction, ...]:
        """Return the forces in pins and sliders; empty where there are none or none are needed."""
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
            self._solution = self._complete(self.crank, self.given)
        return self._solution
