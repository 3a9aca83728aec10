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
A linkage as a tree of its pins and sliders themselves, whatever is published, and the pins cut.

Inputs and sliders stay in the tree, since a pin alone is easily closed again by an engine; of the
pins those that are published joints come first. A pin in a slot has a block of its own, which
slides.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.linkage import GROUND, RevoluteJoint, SlideJoint
from linkage_ros.robot_models.orientation_part import named_joints


class Branch(NamedTuple):
    """
    A joint of the tree.

    Attributes
    ----------
    kind
        ``R`` for a pin, ``P`` for a slider.
    name
        Of the pin or slider.
    parent, child
        The links; a block is named as in the closure's structure.
    joint
        As messages name it; '' where none does.
    sign
        −1 where the joint counts the other way round.

    """

    kind: str
    name: str
    parent: str
    child: str
    joint: str
    sign: int


class PhysicalTree(NamedTuple):
    """
    A linkage as a tree.

    Attributes
    ----------
    branches
        Each after the one that its parent hangs by.
    cuts
        Pins that are cut: the point, and the two links that it joins.

    """

    branches: tuple[Branch, ...]
    cuts: tuple[tuple[str, str, str], ...]


class _Edge(NamedTuple):
    rank: int
    kind: str
    name: str
    ends: tuple[str, str]


def physical_tree(closure: Closure) -> PhysicalTree:
    """
    Return a linkage as a tree of pins and sliders.

    Every loop has a pin that is no input, and is cut there: a loop of sliders holds an angle twice
    over, one whose pins are all driven cannot move, and neither is a linkage.
    """
    links = closure.structure.links
    part_of = {link: link for link in links}
    kept: list[_Edge] = []
    for edge in sorted(_edges(closure), key=lambda edge: edge.rank):
        one, other = (part_of[end] for end in edge.ends)
        if one != other:
            kept.append(edge)
            part_of = {link: one if part == other else part for link, part in part_of.items()}
    branches: list[Branch] = []
    reached = [GROUND]
    for link in reached:
        for edge in kept:
            if link in edge.ends:
                child = edge.ends[0] if edge.ends[1] == link else edge.ends[1]
                if child not in reached:
                    reached.append(child)
                    joint, sign = _named(closure, edge, link, child)
                    branches.append(Branch(edge.kind, edge.name, link, child, joint, sign))
    return PhysicalTree(tuple(branches), tuple(_cuts(closure, kept)))


def _edges(closure: Closure) -> Iterator[_Edge]:
    """Yield pins between any two links, and sliders; what is to stay in the tree ranks first."""
    linkage, links = closure.linkage, closure.structure.links
    driven = {frozenset((given.parent, given.child)) for given in linkage.inputs}
    for name, slider in linkage.sliders.items():
        is_input = any(given.slider == name for given in linkage.inputs)
        ends = (slider.along, closure.structure.blocks[name])
        yield _Edge(0 if is_input else 1, 'P', name, ends)
    published = {
        frozenset((joint.parent, joint.child))
        for joint in named_joints(linkage).values()
        if isinstance(joint, RevoluteJoint)
    }
    for one, other in combinations(links, 2):
        for pin in links[one]:
            if pin in links[other]:
                pair = frozenset((one, other))
                rank = 0 if pair in driven else 2 if pair in published else 3
                yield _Edge(rank, 'R', pin, (one, other))


def _cuts(closure: Closure, kept: list[_Edge]) -> Iterator[tuple[str, str, str]]:
    carriers: dict[str, list[str]] = {}
    for link, points in closure.structure.links.items():
        for point in points:
            carriers.setdefault(point, []).append(link)
    for point, carried in carriers.items():
        part_of = {link: link for link in carried}
        for edge in kept:
            if edge.kind == 'R' and edge.name == point:
                one, other = (part_of[end] for end in edge.ends)
                part_of = {link: one if p == other else p for link, p in part_of.items()}
        first, *others = dict.fromkeys(part_of[link] for link in carried)
        yield from ((point, first, other) for other in others)


def _named(closure: Closure, edge: _Edge, parent: str, child: str) -> tuple[str, int]:
    """Return the name under which messages have a joint, and with which sign."""
    for name, joint in named_joints(closure.linkage).items():
        if isinstance(joint, SlideJoint):
            if edge.kind == 'P' and joint.slider == edge.name:
                return name, 1
        elif edge.kind == 'R' and {joint.parent, joint.child} == {parent, child}:
            return name, 1 if joint.parent == parent else -1
    return '', 1
