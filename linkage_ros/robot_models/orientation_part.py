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
The orientation of one link against another, as a sum of published joints.

A published angle is that of its child less that of its parent, whether or not the two are pinned
together; a block keeps its angle to what it slides along. So every link whose angle can be told
from messages hangs in a graph together with the ground, and the way between two links in it is
the sum.
"""

from __future__ import annotations

from collections.abc import Iterator
from heapq import heappop, heappush
from typing import NamedTuple

from linkage_ros.kinematics.linkage import Linkage, RevoluteJoint, SlideJoint


class Turn(NamedTuple):
    """
    A term of an orientation.

    Attributes
    ----------
    joint
        Name of the published joint; '' for a constant.
    sign
        With which the joint counts, +1 or −1.
    constant
        In [rad]; 0 for a joint.

    """

    joint: str
    sign: int
    constant: float = 0.0


def named_joints(linkage: Linkage) -> dict[str, RevoluteJoint | SlideJoint]:
    """Return all joints that messages name: the inputs, then what is published."""
    inputs: dict[str, RevoluteJoint | SlideJoint] = {
        given.joint: SlideJoint(given.slider)
        if given.slider
        else RevoluteJoint(given.parent, given.child)
        for given in linkage.inputs
    }
    return inputs | dict(linkage.joints)


class Orientations:
    """
    What messages say of the angles of links against each other.

    Parameters
    ----------
    linkage
        The linkage.

    """

    def __init__(self, linkage: Linkage) -> None:
        self._links = tuple(linkage.links)
        self._next: dict[str, list[tuple[str, Turn]]] = {link: [] for link in linkage.links}
        for slider in linkage.sliders.values():
            if slider.block:
                self._join(slider.along, slider.block, '', slider.angle)
        for name, joint in named_joints(linkage).items():
            if isinstance(joint, RevoluteJoint):
                self._join(joint.parent, joint.child, name, 0.0)

    def _join(self, one: str, other: str, joint: str, constant: float) -> None:
        self._next[one].append((other, Turn(joint, 1, constant)))
        self._next[other].append((one, Turn(joint, -1, -constant)))

    def between(self, link: str, other: str) -> tuple[Turn, ...] | None:
        """
        Return the angle of the other link less that of the link, by as few joints as will do.

        None where messages do not tell it. After each term stands the orientation of some link.
        """
        return self._from(link).get(other)

    def known_from(self, link: str) -> Iterator[str]:
        """Yield the links whose angles against this one are told, in the order of the linkage."""
        known = self._from(link)
        return (other for other in self._links if other in known)

    def _from(self, link: str) -> dict[str, tuple[Turn, ...]]:
        """Search from a link, the fewest joints first; a constant is no joint."""
        found: dict[str, tuple[Turn, ...]] = {}
        ahead: list[tuple[int, int, str, tuple[Turn, ...]]] = [(0, 0, link, ())]
        count = 0
        while ahead:
            joints, _, reached, turns = heappop(ahead)
            if reached in found:
                continue
            found[reached] = turns
            for other, turn in self._next[reached]:
                if other not in found:
                    count += 1
                    more = joints + bool(turn.joint)
                    heappush(ahead, (more, count, other, (*turns, turn)))
        return found
