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


"""The joints of links that no dyad covers, as constraints of an `Iteration`."""

from __future__ import annotations

from cmath import phase
from collections.abc import Sequence
from typing import TYPE_CHECKING

from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.equations import (
    Constraint,
    End,
    Facing,
    Meeting,
    OnLine,
    Parallel,
)
from linkage_ros.kinematics.initial_guess import starting_pose
from linkage_ros.kinematics.linkage import Linkage
from linkage_ros.kinematics.newton_group import Iteration
from linkage_ros.kinematics.step import State, Step
from linkage_ros.kinematics.structure import Joint

if TYPE_CHECKING:
    from linkage_ros.kinematics.plan import Planner


class Constraints:
    """
    What holds a group of links.

    Parameters
    ----------
    linkage
        The linkage.
    joints
        Those of the group.
    links
        The links of the group.
    planner
        Knows and places what comes before the group.

    Attributes
    ----------
    slides
        The sliders of the group, by name.

    """

    def __init__(
        self, linkage: Linkage, joints: Sequence[Joint], links: Sequence[str], planner: Planner
    ) -> None:
        self._linkage = linkage
        self._planner = planner
        self._links = links
        self._bodies = {link: i for i, link in enumerate(links)}
        self._constraints: list[Constraint] = []
        self._known_pins: dict[str, int] = {}
        self.slides: dict[str, OnLine] = {}
        for joint in joints:
            self._add_joint(joint)
        self._add_drives()

    def iteration(self, before: tuple[Step, ...]) -> Iteration:
        """Return the step that solves the group, given those before it."""
        planner = self._planner

        def place_known(
            inputs: Sequence[float],
        ) -> tuple[dict[str, complex], dict[str, float]]:
            known = State([0.0, *inputs], [])
            for step in before:
                if not step.close(known).status.has_pose:
                    raise DefinitionError(
                        'pose.inputs',
                        'what comes before the iterated links does not close there',
                        'give inputs that the linkage can have',
                    )
            x, pins = known
            return (
                {name: pins[i] for name, i in self._known_pins.items()},
                {link: x[a.coordinate] + a.constant for link, a in planner.angles.items()},
            )

        start = starting_pose(
            self._linkage, self._links, planner.blocks, planner.points, planner.scale, place_known
        )
        sliding = tuple(bool(given.slider) for given in self._linkage.inputs)
        far = sum(
            max(abs(one - other) for one in points.values() for other in points.values())
            for points in planner.points.values()
        )
        return Iteration(
            tuple(self._constraints), tuple(self.slides.values()), start, before, sliding, far
        )

    def _add_joint(self, joint: Joint) -> None:
        if joint.kind == 'R':
            self._constraints.append(
                Meeting(self._end(joint.link, joint.name), self._end(joint.to, joint.name))
            )
            return
        slider = self._linkage.sliders[joint.name]
        block, rail = self._facing(joint.link, 0.0), self._facing(joint.to, 0.0)
        self._constraints.append(Parallel(block, rail, slider.angle))
        self.slides[joint.name] = OnLine(
            self._end(joint.link, slider.point),
            self._end(joint.to, slider.through),
            self._facing(joint.to, phase(complex(*slider.direction))),
        )
        self._constraints.append(self.slides[joint.name])

    def _add_drives(self) -> None:
        for i, given in enumerate(self._linkage.inputs, 1):
            if given.slider in self.slides:
                self._constraints.append(self.slides[given.slider]._replace(slide=i))
            elif given.child in self._bodies or given.parent in self._bodies:
                child, parent = (self._facing(end, 0.0) for end in (given.child, given.parent))
                self._constraints.append(Parallel(child, parent, 0.0, i))

    def _end(self, link: str, name: str) -> End:
        points = self._planner.points[link]
        if link in self._bodies:
            return End(self._bodies[link], points[name] - next(iter(points.values())))
        self._known_pins[name] = self._planner.place(link, points[name])
        return End(-1, 0j, self._known_pins[name])

    def _facing(self, link: str, direction: float) -> Facing:
        if link in self._bodies:
            return Facing(self._bodies[link], 0, direction)
        angle = self._planner.angles[link].plus(direction)
        return Facing(-1, angle.coordinate, angle.constant)
