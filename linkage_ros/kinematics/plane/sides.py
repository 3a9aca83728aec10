# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The sides of the dyads that close in two ways: their names, and where they lie."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple, TYPE_CHECKING, TypeGuard

from linkage_ros.kinematics.plane.dyads.two_sided import TwoSided
from linkage_ros.kinematics.plane.linkage import AssemblyPose, Linkage, links_by_point
from linkage_ros.kinematics.plane.topology import Dyad, Group, Iterated, Structure

if TYPE_CHECKING:
    from linkage_ros.kinematics.plane.closure import PlanarClosure
    from linkage_ros.kinematics.results import Position

SIDES = {'RRR': {'left': 1, 'right': -1}, 'RRP': {'ahead': 1, 'behind': -1}}
SIDES['RPR'] = SIDES['RRP']
"""The words for the sides of each kind of dyad that closes in two ways, and their signs."""


class TwoWays(NamedTuple):
    """A dyad that closes in two ways, and what the file says of it."""

    dyad: Dyad
    step: int  # Number of its step
    # Its side in `assembly`, +1 for 'left' and 'ahead'; 0 if it is left out.
    written: int
    # Whether it changes its side at a change point; and the sign of its step for the side +1 while
    # the crank points to the left of the ground line, or ahead along the slider.
    crosses: bool
    upright: int

    @property
    def assembly_key(self) -> str:
        """Return its key in `assembly`."""
        return closing_name(self.dyad)

    def side_word(self, side: float) -> str:
        """Return the word of a side by its sign."""
        return next(word for word, sign in SIDES[self.dyad.kind].items() if sign * side > 0)


def closes_in_two_ways(group: Group) -> TypeGuard[Dyad]:
    """Return whether a group is a dyad that closes in two ways."""
    return isinstance(group, Dyad) and group.kind in SIDES


def closing_name(dyad: Dyad) -> str:
    """Return the pin or slider by which `assembly` names a dyad that closes in two ways."""
    return dyad.outer[1].name if dyad.kind == 'RRP' else dyad.inner.name


def telling_part(links: Mapping[str, Mapping[str, Any]], dyad: Dyad) -> tuple[str, str]:
    """
    Return the link and its point that determine the side of a dyad.

    If a rail has no other point than its pin, its angle determines the side: the point is ''.
    """
    if dyad.kind != 'RPR':
        return dyad.inner.link, dyad.inner.name
    rail, pin = dyad.outer[0].link, dyad.outer[0].name
    at = links[rail][pin]
    return rail, next((name for name, place in links[rail].items() if place != at), '')


def assembly_sides(structure: Structure) -> dict[str, tuple[str, ...]]:
    """Return the pins and sliders whose side is to be written, with the sides they may have."""
    sides = {}
    for group in structure.groups:
        if closes_in_two_ways(group):
            sides[closing_name(group)] = tuple(SIDES[group.kind])
    return sides


def written_sides(closure: PlanarClosure) -> dict[str, str]:
    """Return the side of each dyad as the file writes it, or as its pose draws it."""
    pose = closure.linkage.pose
    drawn = (
        sides_at(closure, closure.close_unlimited(*pose.inputs)) if pose and pose.is_drawn else {}
    )
    return {**drawn, **closure.linkage.assembly}


def without_drawn_pose(linkage: Linkage, structure: Structure) -> Linkage:
    """Return a linkage whose pose places no link of a dyad, so that the sides decide."""
    pose = linkage.pose
    if pose is None or not pose.is_drawn:
        return linkage
    groups = (group for group in structure.groups if isinstance(group, Iterated))
    iterated = {link for group in groups for link in group.links}
    on = links_by_point(structure.links)
    points = {name: place for name, place in pose.points.items() if {*on[name]} <= iterated}
    angles = {link: angle for link, angle in pose.angles.items() if link in iterated}
    return replace(linkage, pose=AssemblyPose(pose.inputs, points, angles))


def sides_at(closure: PlanarClosure, position: Position) -> dict[str, str]:
    """
    Return the side of each dyad that closes in two ways, as it lies at a position.

    A dyad in line has none.
    """
    sides: dict[str, str] = {}
    groups: tuple[Group, ...] = closure.structure.groups
    for step, number, pose in zip(
        closure.steps, closure.step_groups, position.poses, strict=False
    ):
        group = groups[number]
        if isinstance(step, TwoSided) and isinstance(group, Dyad):
            side = step.side_of(pose)
            words = SIDES[group.kind].items()
            sides |= {closing_name(group): word for word, sign in words if sign * side > 0.0}
    return sides
