# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The topics whose messages load the links of a scene, and what is refused of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from re import fullmatch
from typing import Any, TYPE_CHECKING

from linkage_ros.dynamics import GREATEST_LOAD
from linkage_ros.errors import FileError, quote
from linkage_ros.messages import read_wrench, Rejection

if TYPE_CHECKING:
    from linkage_ros.description import SceneLinkage
    from linkage_ros.dynamics import HeldWrench

MOST_WRENCHES = 32
"""Most wrenches of a scene: each tick asks for the messages of each."""

_TOKEN = '[A-Za-z_][A-Za-z0-9_]*'
_NAME = f'(/|~/)?{_TOKEN}(/{_TOKEN})*'
_LONGEST = 200
"""Longest name of a topic; with a namespace ROS takes 248 characters."""


class WrenchTopic:
    """
    The topic of the wrench on a link; messages change the wrench ``held``.

    The drive learns of each wrench if it has ``load``.
    """

    def __init__(
        self, scene_linkage: SceneLinkage, link: str, drive: Any, held: HeldWrench
    ) -> None:
        wrench = scene_linkage.loads.applied.wrenches[link] if scene_linkage.loads else None
        self.key = f'loads.wrenches.{link}'  # In the scene
        self.topic = (wrench and wrench.topic) or f'wrenches/{scene_linkage.prefix}{link}'
        self.wrench = held
        self._change_load = getattr(drive, 'load', None)
        self._content = scene_linkage.content

    def offer_wrench(self, message: bytes, now: int) -> Rejection | None:
        """
        Take a serialized WrenchStamped at a time [ns], or return why it is rejected.

        A rejected message changes nothing.
        """
        numbers = read_wrench(message)
        if isinstance(numbers, Rejection):
            return numbers
        wrench = tuple(numbers[index] for index in self.wrench.numbers)
        for number in wrench:
            if not -GREATEST_LOAD <= number <= GREATEST_LOAD:
                if isfinite(number):
                    return Rejection.WRENCH_TOO_LARGE
                return Rejection.WRENCH_NOT_FINITE
        if self._change_load is None:
            self.wrench.set_wrench(wrench, now)
        else:
            # The drive moves the linkage up to this time under the load before.
            self._change_load(self.wrench, wrench, now)
        return None

    def refusal(self, reason: str, remedy: str) -> FileError:
        """Return an error of the name of the topic."""
        return self._content.error(f'{self.key}.topic', reason, remedy)


def make_wrench_topics(
    linkages: Sequence[tuple[SceneLinkage, Any, Mapping[str, HeldWrench]]], drive_topic: str
) -> tuple[WrenchTopic, ...]:
    """
    Return the topics of all wrenches on linkages, given with their drives and wrenches by link.

    Raise `FileError` if a name is taken or is not a topic's, or if there are too many.
    """
    topics = tuple(
        WrenchTopic(scene_linkage, link, drive, held)
        for scene_linkage, drive, wrenches in linkages
        for link, held in wrenches.items()
    )
    taken = {drive_topic: 'the drive', 'joint_states': 'the joint states'}
    for index, wrench in enumerate(topics):
        name = wrench.topic
        if index == MOST_WRENCHES:
            raise wrench.refusal(
                f'is one of {len(topics)}, more than {MOST_WRENCHES}', 'leave some out'
            )
        if not fullmatch(_NAME, name) or len(name) > _LONGEST:
            raise wrench.refusal(
                f'{quote(name)} is not a ROS topic', 'write a topic, as topic: wrenches/coupler'
            )
        name = name.removeprefix('/')
        if name in taken:
            raise wrench.refusal(f'{quote(name)} is the topic of {taken[name]}', 'write another')
        taken[name] = wrench.key
    return topics
