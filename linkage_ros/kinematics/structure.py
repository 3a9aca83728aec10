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


"""A linkage as bodies and joints, in the groups and the order in which they are solved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from linkage_ros.kinematics.linkage import GROUND, Point


@dataclass(frozen=True, slots=True)
class Joint:
    """
    A pin ('R') or slider ('P') between two links.

    ``name`` is that of the point or of the slider; ``link`` belongs to the group, ``to`` is the
    link that it is joined to.
    """

    kind: str
    name: str
    link: str
    to: str


@dataclass(frozen=True, slots=True)
class Driven:
    """An input that places ``joint.link`` once ``joint.to`` is known; ``index`` numbers it."""

    joint: Joint
    index: int


@dataclass(frozen=True, slots=True)
class Dyad:
    """
    Two bodies joined to each other, and each to what is known.

    Attributes
    ----------
    kind
        RRR, RRP, RPR, PRP or RPP: the first body's outer joint, the inner one, the second's outer.
    bodies
        The links of each body; more than one where driven joints hold them together.
    outer
        Joint of each body to what is known.
    inner
        Joint from the first body to the second.

    """

    kind: str
    bodies: tuple[tuple[str, ...], tuple[str, ...]]
    outer: tuple[Joint, Joint]
    inner: Joint


@dataclass(frozen=True, slots=True)
class Iterated:
    """Links that no dyad covers; their joints are all those among them and to what is known."""

    links: tuple[str, ...]


Group = Driven | Dyad | Iterated


@dataclass(frozen=True, slots=True)
class Structure:
    """
    A linkage as bodies and joints.

    Attributes
    ----------
    links
        The links and their points; a pin in a slot has a block of its own.
    blocks
        For each slider the link that slides.
    groups
        In the order in which they are solved.
    joints
        All joints; a pin of three links is two.

    """

    links: Mapping[str, Mapping[str, Point]]
    blocks: Mapping[str, str]
    groups: tuple[Group, ...]
    joints: tuple[Joint, ...]

    @property
    def freedom(self) -> int:
        """Degrees of freedom, by Grübler's count, before the inputs take theirs."""
        return 3 * (len(self.links) - 1) - 2 * len(self.joints)

    def joints_of(self, group: Iterated) -> tuple[Joint, ...]:
        """
        Return the joints that hold a group: among its links, and to what is known before it.

        Each is told from a link of the group; what hangs on the group is known only later.
        """
        known = {GROUND}
        for before in self.groups[: self.groups.index(group)]:
            known |= links_of(before)
        found: list[Joint] = []
        pins: set[str] = set()
        for joint in self.joints:
            if joint.kind == 'P':
                ends = {joint.link, joint.to}
                if ends & set(group.links) and ends <= known | set(group.links):
                    found.append(joint)
            elif joint.name not in pins:
                pins.add(joint.name)
                carriers = [link for link, points in self.links.items() if joint.name in points]
                own = [link for link in carriers if link in group.links]
                base = [*(link for link in carriers if link in known), *own]
                found += [Joint('R', joint.name, link, base[0]) for link in own if link != base[0]]
        return tuple(found)


def links_of(group: Group) -> set[str]:
    """Return the links that a group places."""
    if isinstance(group, Driven):
        return {group.joint.link}
    if isinstance(group, Dyad):
        return {link for body in group.bodies for link in body}
    return set(group.links)
