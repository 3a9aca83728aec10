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


"""The worst states of a recorded run: where its loops close worst, and come nearest a toggle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import NamedTuple

from linkage_ros.bag.reader import Bag
from linkage_ros.errors import BagError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.results import Position, SingularityMargin
from linkage_ros.kinematics.status import Status
from linkage_ros.pipeline.pipeline import Pipeline
from linkage_ros.replay.replay import replay
from linkage_ros.scene.scene import Scene, SceneLinkage

_TOLD_EVERY = 1024


class Place(NamedTuple):
    """
    When something was, and where.

    Attributes
    ----------
    time
        The time that was solved for, in [ns].
    inputs
        Of the linkage, in [rad] or [m].

    """

    time: int
    inputs: tuple[float, ...]


class WorstResiduals(NamedTuple):
    """
    The worst states of a linkage over a run.

    Attributes
    ----------
    member, closure
        The linkage, in its scene and as it is solved.
    states
        How many states closed, and so were looked at.
    toggles, limited
        How many of them stood at a toggle, and how many beyond limits.
    residual
        The worst of `Closure.residual`, in [m], and where it was; nothing without states.
    nearest
        The nearness to trouble where the conditioning was least, and where that was.

    """

    member: SceneLinkage
    closure: Closure
    states: int
    toggles: int
    limited: int
    residual: tuple[float, Place] | None
    nearest: tuple[SingularityMargin, Place] | None


class Examined(NamedTuple):
    """
    What came of running a scene once more over its bag.

    Attributes
    ----------
    linkages
        The worst states of each linkage.
    joint_states
        How many joint states the bag holds.
    same
        How many of them came out again to the same bytes.
    damage
        What is damaged, on one line, where it ended there.
    stopped
        Whether it was stopped before the end.

    """

    linkages: tuple[WorstResiduals, ...]
    joint_states: int
    same: int
    damage: str
    stopped: bool


def examine(
    bag: Bag, scene: Scene, told: Callable[[int], None], stopped: Callable[[], bool]
) -> Examined:
    """
    Run a scene once more over its bag and look at every state; memory does not grow with them.

    Parameters
    ----------
    bag, scene
        As for `replay`.
    told
        Takes how many ticks have been looked at, now and then.
    stopped
        Whether to stop.

    Raises
    ------
    LinkageError
        Where the scene cannot be run.

    """
    # The closures are those that the replay builds once more: they follow from the scene alone.
    watched = [_Watch(line.member, line.closure) for line in Pipeline(scene).lines]
    joint_states = same = number = 0
    damage, halted = '', False
    try:
        for number, (time, recorded, _, tick) in enumerate(replay(bag, scene), 1):
            if recorded:
                joint_states += 1
                same += recorded == tick.message
            for watch, (crank, position, _, _) in zip(watched, tick.looks, strict=True):
                if crank is not None and position is not None and position.joints:
                    watch.look(time, crank.angles, position)
            if not number % _TOLD_EVERY:
                told(number)
                if stopped():
                    halted = True
                    break
    except BagError as error:
        damage = f'{error.where}: {error.reason}'
    linkages = tuple(watch.found() for watch in watched)
    return Examined(linkages, joint_states, same, damage, halted)


class _Watch:
    """Remembers the worst of what it has been shown of a linkage."""

    __slots__ = (
        '_least',
        '_limited',
        '_nearest',
        '_place',
        '_states',
        '_toggles',
        '_worst',
        'closure',
        'of',
    )

    def __init__(self, member: SceneLinkage, closure: Closure) -> None:
        self.of, self.closure = member, closure
        self._states = self._toggles = self._limited = 0
        self._worst, self._least = -1.0, inf
        self._place: Place | None = None
        self._nearest: tuple[SingularityMargin, Place] | None = None

    def look(self, time: int, inputs: Sequence[float], position: Position) -> None:
        self._states += 1
        self._toggles += position.status is Status.TOGGLE
        self._limited += position.status is Status.LIMITED
        residual = self.closure.residual(position)
        if residual > self._worst:
            self._worst, self._place = residual, Place(time, tuple(inputs))
        nearness = self.closure.singularity_margin(position)
        if nearness.conditioning < self._least:
            self._least = nearness.conditioning
            self._nearest = nearness, Place(time, tuple(inputs))

    def found(self) -> WorstResiduals:
        residual = (self._worst, self._place) if self._place else None
        return WorstResiduals(
            self.of,
            self.closure,
            self._states,
            self._toggles,
            self._limited,
            residual,
            self._nearest,
        )
