# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The loop equations of a linkage, as polygons of vectors.

A point of a link is reached from the ground, or from a known pin, along arms and slides; two ways
to one place form a loop. With the coordinates x of a closure, each vector of a loop is::

    c·e^{iφ}·s        φ = Σ ±x_j        s = 1, or the slide x_k

and the vectors of a loop add up to 0. Each group, a dyad or links that are iterated, has as many
of these equations as determine the coordinates that it appends.
"""

from __future__ import annotations

from typing import NamedTuple

from linkage_ros.kinematics import (
    Angle,
    Driven,
    Dyad,
    GROUND,
    Iterated,
    Joint,
    Linkage,
    SolvedLinks,
    Structure,
)

Turns = tuple[tuple[int, float], ...]
"""Coordinates and their signs, whose sum is an angle."""


class Vector(NamedTuple):
    """c·e^{iφ}·s."""

    factor: complex  # c, in the unit of the closure's lengths
    turns: Turns = ()  # Terms of φ
    slide: int = -1  # Index of the coordinate s; −1 for 1
    pin: int = -1  # Index of a pin whose place replaces e^{iφ}·s; −1 for none


class Balance(NamedTuple):
    """A constraint Σ ±x_j + constant = 0 of a group; modulo a turn if ``turning``."""

    terms: Turns
    constant: float
    turning: bool = True


class Loops(NamedTuple):
    """The equations of a group of links."""

    # Indices of those that it appends.
    coordinates: tuple[int, ...]
    pins: tuple[int, ...]
    equations: tuple[tuple[Vector, ...], ...]  # Sums of vectors, each equal to 0
    balances: tuple[Balance, ...] = ()  # Constraints on angles and slides; a dyad has none


class LoopFinder:
    """Finds the loops of a closure, from all its known links."""

    def __init__(self, linkage: Linkage, structure: Structure, known: SolvedLinks) -> None:
        self._known = known
        self._inputs = linkage.inputs
        self._sliders = linkage.sliders
        self._structure = structure
        self._turned: dict[int, tuple[int, tuple[int, float]]] = {}
        for group in structure.groups:
            if isinstance(group, Driven) and group.joint.kind == 'R':
                self._note_turned(group.joint, 1 + group.index)

    def find_loops(self) -> list[Loops]:
        """Return the loops of every group that is not driven, in the order of solution."""
        return [
            self._dyad_loops(group) if isinstance(group, Dyad) else self._iterated_loops(group)
            for group in self._structure.groups
            if not isinstance(group, Driven)
        ]

    def expand_coordinate(self, coordinate: int) -> Turns:
        """Return a coordinate as a sum of inputs and coordinates of groups."""
        if not coordinate:
            return ()
        if coordinate not in self._turned:
            return ((coordinate, 1.0),)
        arm, turn = self._turned[coordinate]
        return (*self.expand_coordinate(arm), turn)

    def expand_difference(self, one: int, other: int) -> Turns:
        """Return the difference of two coordinates as `expand_coordinate` does."""
        return (
            *self.expand_coordinate(one),
            *((k, -sign) for k, sign in self.expand_coordinate(other)),
        )

    def _note_turned(self, joint: Joint, index: int) -> None:
        coordinate = self._known.angles[joint.link].coordinate
        if coordinate != index:
            sign = 1.0 if self._inputs[index - 1].child == joint.link else -1.0
            arm = self._known.angles[joint.to].coordinate
            self._turned[coordinate] = (arm, (index, sign))

    def _dyad_loops(self, dyad: Dyad) -> Loops:
        slides = [
            self._known.slides[joint.name].coordinate
            for joint in (dyad.inner, *dyad.outer)
            if joint.kind == 'P'
        ]
        # In RPR both links have one angle; in PRP and RPP they turn with the links they slide on.
        angles = [self._known.angles[joint.link].coordinate for joint in dyad.outer]
        angles = angles[: 2 - len(slides)]
        return Loops(tuple(sorted(angles + slides)), (), (self._loop_equation(dyad.inner),))

    def _iterated_loops(self, group: Iterated) -> Loops:
        known = self._known
        slides, equations, balances = [], [], []
        for joint in self._structure.joints_of(group):
            equations.append(self._loop_equation(joint))
            if joint.kind == 'P':
                slides.append(joint.name)
                angle = self._sliders[joint.name].angle
                ends = known.blocks[joint.name], self._sliders[joint.name].along
                balances.append(self._balance_between(*ends, angle))
        for index, given in enumerate(self._inputs, 1):
            if given.slider in slides:
                slide = known.slides[given.slider]
                terms = ((slide.coordinate, slide.sign), (index, -1.0))
                balances.append(Balance(terms, slide.constant, turning=False))
            elif given.child in group.links or given.parent in group.links:
                turned = self._balance_between(given.child, given.parent, 0.0)
                balances.append(Balance((*turned.terms, (index, -1.0)), turned.constant))
        coordinates = [known.angles[link].coordinate for link in group.links]
        coordinates += [known.slides[name].coordinate for name in slides]
        pins = tuple(known.attachments[link].pin for link in group.links)
        return Loops(tuple(coordinates), pins, tuple(equations), tuple(balances))

    def _balance_between(self, link: str, to: str, angle: float) -> Balance:
        one, other = self._known.angles[link], self._known.angles[to]
        terms = self.expand_difference(one.coordinate, other.coordinate)
        return Balance(terms, one.constant - other.constant - angle)

    def _loop_equation(self, joint: Joint) -> tuple[Vector, ...]:
        """Return the loop that a joint closes."""
        points = self._known.points
        if joint.kind == 'R':
            one = self._vectors_to_point(joint.link, points[joint.link][joint.name])
            other = self._vectors_to_point(joint.to, points[joint.to][joint.name])
            return _merge_vectors([*one, *_negate_vectors(other)])
        slider, slide = self._sliders[joint.name], self._known.slides[joint.name]
        direction = slider.unit
        # The joint of a dyad may be given from either end.
        block, rail = self._known.blocks[joint.name], slider.along
        line = self._known.angles[rail]
        start = points[rail][slider.through] + slide.constant * direction
        point = self._vectors_to_point(block, points[block][slider.point])
        through = self._vectors_to_point(rail, start)
        way = self._make_vector(line, slide.sign * direction, slide.coordinate)
        return _merge_vectors([*point, *_negate_vectors([*through, way])])

    def _vectors_to_point(self, link: str, point: complex) -> list[Vector]:
        if link == GROUND:
            return [Vector(point)]
        held = self._known.attachments[link]
        way = []
        if held.point != point:
            way.append(self._make_vector(self._known.angles[link], point - held.point))
        if held.pin >= 0:
            return [*way, Vector(1.0 + 0j, pin=held.pin)]
        if held.slide is not None:
            unit = held.slide.sign * held.direction
            way.append(
                self._make_vector(self._known.angles[held.link], unit, held.slide.coordinate)
            )
        return [*way, *self._vectors_to_point(held.link, held.link_point)]

    def _make_vector(self, angle: Angle, vector: complex, slide: int = -1) -> Vector:
        return Vector(angle.unit * vector, self.expand_coordinate(angle.coordinate), slide)


def _negate_vectors(vectors: list[Vector]) -> list[Vector]:
    return [vector._replace(factor=-vector.factor) for vector in vectors]


def _merge_vectors(vectors: list[Vector]) -> tuple[Vector, ...]:
    """Add up the vectors with the same angle and slide."""
    sums: dict[tuple[Turns, int, int], complex] = {}
    for factor, turns, slide, pin in vectors:
        key = (tuple(sorted(turns)), slide, pin)
        sums[key] = sums.get(key, 0j) + factor
    return tuple(Vector(factor, *key) for key, factor in sums.items() if factor)
