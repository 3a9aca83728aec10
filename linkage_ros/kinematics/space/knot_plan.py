# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
Which joints of a spatial linkage close only together, and by which rods.

The unknown links hang on a tree of joints that starts from known links. What the tree does not
use closes it: rods and struts between its links, and balls, each as three rods of length 1. Of all
sets of unknown joints the smallest is taken that as many independent rods determine in the pose.
"""

from __future__ import annotations

from collections.abc import Iterator
from heapq import heappop, heappush
from itertools import combinations, count, product
from math import dist
from typing import NamedTuple

from linkage_ros.errors import list_names
from linkage_ros.kinematics.iterated.grid import grid_inputs
from linkage_ros.kinematics.iterated.iterated_step import IteratedStep
from linkage_ros.kinematics.iterated.steps_before import StepsBefore
from linkage_ros.kinematics.space.knot_equations import KnotEquations, KnotRod, Mover, RodEnd
from linkage_ros.kinematics.space.plan import SpacePlan
from linkage_ros.kinematics.space.steps import Rod
from linkage_ros.kinematics.space.vectors import (
    cross,
    dot,
    drop_rounding,
    GROUND_FRAME,
    length,
    minus,
    plus,
    scale,
    Vector,
    ZERO,
)

_INDEPENDENT = 1e-6
"""Least part of a rod's equation that others do not tell, in the pose."""

_BETTER = 1e-6
"""By how much the next rod must be better: among equal ones the first is taken."""

_FAR = 4.0
"""No slide needs to be longer to stretch a link, in lengths."""

_MOST_SETS = 4096
"""Most sets of joints that are tried."""


class PlannedEnd(NamedTuple):
    """An end of a rod: a place beside a point, on a link; or on none, if the point is known."""

    link: str
    point: str
    beside: Vector


class PlannedRod(NamedTuple):
    """A rod between two ends."""

    start: PlannedEnd
    end: PlannedEnd
    rod: Rod
    by: str  # What keeps the distance, for people


class KnotPlan(NamedTuple):
    """Links that close together, each with its joint and the link that it hangs on, and rods."""

    links: dict[str, tuple[str, str]]
    unknown: tuple[str, ...]  # Names of the joints
    rods: tuple[PlannedRod, ...]


def add_knot(plan: SpacePlan) -> bool:
    """Add the smallest set of joints that closes as the next step; False if there is none."""
    found = KnotPlanner(plan).find_knot()
    if found is None:
        return False
    for rod in found.rods:
        for end in (rod.start, rod.end):
            if not end.link:
                plan.point_index(end.point)
    coordinates, first = len(plan.state.coordinates), plan.next_pin
    movers: list[Mover] = []
    for link, (name, on) in found.links.items():
        joint, frame = plan.make_joint(name, on, link)
        plan.frames[link], plan.pose_frames[link] = first + len(movers), frame
        unknown = found.unknown.index(name) if name in found.unknown else -1
        movers.append(Mover(joint, unknown, plan.coordinates.get(name, 0)))
    for number, name in enumerate(found.unknown):
        plan.coordinates[name] = coordinates + number

    def make_end(end: PlannedEnd) -> RodEnd:
        if not end.link:
            return RodEnd(-1, plan.points[end.point], end.beside)
        place = plus(plan.places[end.point], end.beside)
        place = drop_rounding(plan.pose_frames[end.link].locate(place))
        return RodEnd(list(found.links).index(end.link), plan.frames[end.link], place)

    rods = [KnotRod(make_end(one), make_end(other), rod) for one, other, rod, _ in found.rods]
    last = 1 + len(plan.linkage.driven)
    before = StepsBefore(tuple(plan.steps), tuple(plan.state.coordinates[1:last]))
    start = list(map(plan.pose_value, found.unknown))
    given = grid_inputs(plan.linkage.inputs, before.inputs, plan.scale)
    equations, sizes = KnotEquations(movers, rods, first), (coordinates, first)
    step = IteratedStep(equations, before, sizes, start, given, _FAR, plan.ratio_turns)
    plan.knots[len(plan.groups)] = step, found.unknown
    plan.add_step(step)
    by = list_names(dict.fromkeys(rod.by for rod in found.rods))
    what = f'{len(rods)} equations for {list_names(found.unknown)}'
    method = f"iterated: Newton's method, {what}: {by}"
    plan.end_group('knot', tuple(found.links), method, 'as in the pose')
    return True


class KnotPlanner:
    """Finds the next knot of a plan."""

    def __init__(self, plan: SpacePlan) -> None:
        self._plan = plan
        self._linkage = plan.linkage
        self._tree = self._grow_tree()

    def find_knot(self) -> KnotPlan | None:
        """Return the smallest set of joints that closes; None if there is none."""
        rods = [(rod, self._unknown_joints(rod)) for rod in self._find_rods()]
        rods = [(rod, joints) for rod, joints in rods if joints]
        names = sorted(frozenset().union(*(joints for _, joints in rods)))
        slopes = [self._slopes(rod, names) for rod, _ in rods]
        supports = list(dict.fromkeys(joints for _, joints in rods))

        def closing_rods(joints: frozenset[str]) -> list[PlannedRod]:
            """Return as many independent rods as there are joints; none if there are fewer."""
            own = [number for number, (_, moved) in enumerate(rods) if moved <= joints]
            columns = [number for number, name in enumerate(names) if name in joints]
            if len(own) < len(joints):
                return []
            chosen = _independent_rows([[slopes[n][k] for k in columns] for n in own])
            return [rods[own[n]][0] for n in sorted(chosen)] if len(chosen) == len(joints) else []

        number = count()
        waiting = [(len(joints), next(number), joints) for joints in sorted(supports, key=len)]
        seen = set(supports)
        while waiting:
            *_, joints = heappop(waiting)
            if closing := closing_rods(joints):
                return self._make_plan(joints, closing)
            for other in supports:
                union = joints | other
                if other & joints and union not in seen and len(seen) < _MOST_SETS:
                    seen.add(union)
                    heappush(waiting, (len(union), next(number), union))
        # None of the small sets: all joints together, and then without each that can be left out.
        joints = frozenset(names)
        closing = closing_rods(joints)
        for name in names if closing else ():
            less = frozenset().union(*(moved for moved in supports if moved <= joints - {name}))
            if fewer := closing_rods(less):
                joints, closing = less, fewer
        return self._make_plan(joints, closing) if closing else None

    def _make_plan(self, joints: frozenset[str], rods: list[PlannedRod]) -> KnotPlan:
        needed = {link for rod in rods for end in rod[:2] for link in self._chain(end.link)}
        links = {link: way for link, way in self._tree.items() if link in needed}
        unknown = tuple(name for name, _ in links.values() if name in joints)
        return KnotPlan(links, unknown, tuple(rods))

    def _grow_tree(self) -> dict[str, tuple[str, str]]:
        """Return for each link of the tree its joint and the link that it hangs on, in order."""
        tree: dict[str, tuple[str, str]] = {}
        frames = self._plan.frames

        def next_link() -> bool:
            # Slides first: what the tree leaves out is held by rods.
            for name, joint in {**self._linkage.slides, **self._linkage.hinges}.items():
                for on, link in ((joint.parent, joint.child), (joint.child, joint.parent)):
                    if (on in frames or on in tree) and link not in frames and link not in tree:
                        tree[link] = name, on
                        return True
            return False

        while next_link():
            pass
        return tree

    def _chain(self, link: str) -> Iterator[str]:
        """Yield a link of the tree, and those that it hangs on."""
        while link in self._tree:
            yield link
            link = self._tree[link][1]

    def _unknown_joints(self, rod: PlannedRod) -> frozenset[str]:
        """Return the unknown joints that a rod depends on."""
        names = (self._tree[link][0] for end in rod[:2] for link in self._chain(end.link))
        return frozenset(name for name in names if name not in self._plan.coordinates)

    def _count_unknown(self, link: str) -> int:
        """Return how many unknown joints a link of the tree depends on."""
        coordinates = self._plan.coordinates
        return sum(self._tree[one][0] not in coordinates for one in self._chain(link))

    def _tells(self, rod: PlannedRod) -> bool:
        """Return whether unknown joints change the length of a rod in the pose."""
        slopes = self._slopes(rod, sorted(self._unknown_joints(rod)))
        return max(map(abs, slopes), default=0.0) > _INDEPENDENT

    def _find_rods(self) -> Iterator[PlannedRod]:
        """Yield what closes the tree, in the order of the file."""
        plan = self._plan
        for point, links in plan.carriers.items():
            ends = [link for link in links if link in self._tree]
            if not plan.is_known(point):
                first, ends = ends[:1], ends[1:]
            for link in ends:
                start = '' if plan.is_known(point) else first[0]
                for axis in GROUND_FRAME[:3]:
                    beside, at = PlannedEnd(start, point, axis), PlannedEnd(link, point, ZERO)
                    yield PlannedRod(beside, at, Rod(1.0), f'ball {point}')
        for link in self._linkage.link_names:
            for one, other in (
                combinations(plan.carried[link], 2) if link not in plan.frames else ()
            ):
                size = dist(plan.places[one], plan.places[other])
                for found in self._rod_between(one, other, Rod(size), link, (link,)):
                    # A link of the tree is a rod past it only where other joints meet its points.
                    if link not in self._tree or self._tells(found):
                        yield found
        for name, points in self._linkage.struts.items():
            if name in plan.coordinates:
                one, other = (plan.same[point] for point in points)
                yield from self._rod_between(one, other, Rod(0.0, plan.coordinates[name]), name)
        for name, joint in self._linkage.slides.items():
            if name in plan.coordinates:
                for one, other in product(plan.carried[joint.parent], plan.carried[joint.child]):
                    rod, sides = plan.slide_rod(name, one, other), (joint.parent, joint.child)
                    yield from self._rod_between(one, other, rod, name, sides)

    def _rod_between(
        self, one: str, other: str, rod: Rod, by: str, sides: tuple[str, ...] = ()
    ) -> Iterator[PlannedRod]:
        """Yield the rod between points that are known or on the tree, on links without sides."""
        ends = []
        for point in (one, other):
            carriers = self._plan.carriers[point]
            links = [link for link in carriers if link in self._tree and link not in sides]
            if self._plan.is_known(point) or links:
                link = '' if self._plan.is_known(point) else min(links, key=self._count_unknown)
                ends.append(PlannedEnd(link, point, ZERO))
        if len(ends) == 2:
            yield PlannedRod(ends[0], ends[1], rod, f'{by} from {one} to {other}')

    def _slopes(self, rod: PlannedRod, names: list[str]) -> list[float]:
        """Return the slopes of a rod's length by joints, in the pose."""
        plan = self._plan
        places = [plus(plan.places[end.point], end.beside) for end in rod[:2]]
        vector, found = minus(places[1], places[0]), dict.fromkeys(names, 0.0)
        for end, place, sign in zip(rod[:2], places, (-1.0, 1.0), strict=True):
            for link in self._chain(end.link):
                name = self._tree[link][0]
                joint = self._linkage.pair_joints[name]
                axis = scale(1.0 / length(joint.axis), joint.axis)
                arm = minus(place, scale(1.0 / plan.scale, joint.at))
                slope = axis if name in self._linkage.slides else cross(axis, arm)
                if name in found:
                    found[name] += sign * dot(vector, slope) / length(vector)
        return list(found.values())


def _independent_rows(rows: list[list[float]]) -> set[int]:
    """Return the numbers of rows that are independent; each time the one that tells most."""
    import numpy as np  # local import: few linkages have knots

    left, chosen = np.array(rows), set[int]()
    while len(chosen) < min(left.shape):
        best, pivot = _INDEPENDENT, -1
        for number, size in enumerate(np.sqrt((left * left).sum(axis=1)).tolist()):
            if number not in chosen and size > best + _BETTER:
                best, pivot = size, number
        if pivot < 0:
            break
        chosen.add(pivot)
        unit = left[pivot] / best
        left = left - (left * unit).sum(axis=1)[:, None] * unit
    return chosen
