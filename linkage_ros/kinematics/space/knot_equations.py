# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.
"""
The equations of links in space that close only together, and their derivatives.

The unknowns are the joints of a tree. Each rod is one equation, ½(|C − B|² − L²) = 0, between
places on two links. All functions take numbers or symbols, and decide nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import combinations, combinations_with_replacement, islice
from math import dist, hypot, inf
from operator import add
from typing import NamedTuple

from linkage_ros.kinematics.built_once import BuiltProperty
from linkage_ros.kinematics.iterated.group import Equations, GroupMotion
from linkage_ros.kinematics.iterated.straight_line import StraightLine
from linkage_ros.kinematics.space.joints import LowerPair, SlidePair
from linkage_ros.kinematics.space.steps import missing_length, Rod
from linkage_ros.kinematics.space.vectors import (
    dot,
    length,
    minus,
    plus,
    SpaceFrame,
    subtract,
    Vector,
)
from linkage_ros.kinematics.step import LinkState

_AMID = 1.3
"""Longest that a rod may be between two solutions, relative to its length."""

_SHORTEST = 2.0**-6
"""In lengths: the gap of a shorter rod is measured as that of one of this length."""

_SLID = 0.25
"""How far a slide may move between two solutions, in lengths."""


class Mover(NamedTuple):
    """A joint of the tree: the frame of its child follows those of the movers before it."""

    joint: LowerPair
    unknown: int  # Number of its value among the unknowns, or −1
    coordinate: int = 0  # If it is known, its index among the coordinates

    def value(self, unknowns: Sequence[float], state: LinkState) -> float:
        """Return its value, or a derivative of it."""
        return unknowns[self.unknown] if self.unknown >= 0 else state.coordinates[self.coordinate]


class RodEnd(NamedTuple):
    """A place on the link that a mover moves; or, if that is −1, beside a known point."""

    mover: int
    pin: int  # Index, among the pins, of the frame of the link, or of the point
    place: Vector

    def locate(self, state: LinkState) -> Vector:
        """Return the place in the frame of the ground."""
        pin = state.pins[self.pin]
        return plus(pin, self.place) if self.mover < 0 else pin.place(self.place)

    def _arm(self, state: LinkState) -> Vector:
        """Return the place from the origin of its link."""
        frame: SpaceFrame = state.pins[self.pin]
        return frame.turn(self.place)

    def velocity(self, state: LinkState, moving: LinkState) -> Vector:
        """Return the velocity of the place."""
        found: Vector = moving.pins[self.pin]
        if self.mover >= 0:
            found = moving.pins[self.pin].velocity(self._arm(state))
        return found

    def acceleration(self, state: LinkState, moving: LinkState, changing: LinkState) -> Vector:
        """Return the acceleration of the place."""
        found: Vector = changing.pins[self.pin]
        if self.mover >= 0:
            found = moving.pins[self.pin].acceleration(found, self._arm(state))
        return found


class KnotRod(NamedTuple):
    """Two places at a known distance."""

    start: RodEnd
    end: RodEnd
    rod: Rod


class KnotEquations(Equations):
    """
    As many rods as there are unknown joints among the movers of a tree.

    ``first`` is the index of the first mover's frame among the pins.
    """

    def __init__(self, movers: Sequence[Mover], rods: Sequence[KnotRod], first: int) -> None:
        self._movers, self._rods, self._first = tuple(movers), tuple(rods), first
        self._chains = [self._moving_chains(rod) for rod in rods]
        unknown = sorted((one for one in movers if one.unknown >= 0), key=lambda one: one.unknown)
        self.angles = [not isinstance(one.joint, SlidePair) for one in unknown]
        self.free = self.closing = range(len(unknown))
        self._bends_line = StraightLine(self._list_bends, lambda: None)

    def drift(self, motion: GroupMotion) -> list[float]:
        """
        Return for each rod (C − B)·(Ċ − Ḃ) − L·L̇, if the unknowns stand.

        At steady rates return (C − B)·(C̈ − B̈) + |Ċ − Ḃ|² − L·L̈ − L̇².
        """
        changes, velocities = motion.solved_accelerations, motion.solved_rates
        state, moving, changing = self._carry(motion)
        found = []
        for rod in self._rods:
            vector = minus(rod.end.locate(state), rod.start.locate(state))
            slip = minus(*(end.velocity(state, moving) for end in (rod.end, rod.start)))
            if changes is None:
                found.append(subtract(dot(vector, slip), rod.rod.power(state, velocities)))
                continue
            pull = minus(
                *(end.acceleration(state, moving, changing) for end in (rod.end, rod.start))
            )
            of_rod = subtract(rod.rod.bend(state, velocities, changes), dot(slip, slip))
            found.append(subtract(dot(vector, pull), of_rod))
        return found

    def _carry(self, motion: GroupMotion) -> tuple[LinkState, LinkState, LinkState]:
        """Return the state with the links, its rates, and its accelerations if wanted."""
        known, unknowns, rates = motion.solved, motion.unknowns, motion.rates
        state, first = self._place_links(known, unknowns), self._first
        velocities, changes = motion.solved_rates, motion.solved_accelerations
        moving = LinkState(velocities.coordinates, velocities.pins[:first])
        for number, mover in enumerate(self._movers, first):
            rate = mover.value(rates, velocities)
            moving.pins.append(mover.joint.motion(state, moving, state.pins[number], rate))
        if changes is None:
            return state, moving, moving
        changing = LinkState(changes.coordinates, changes.pins[:first])
        for number, mover in enumerate(self._movers, first):
            given = mover.value(rates, moving), mover.value(motion.accelerations, changes)
            frame = state.pins[number]
            changing.pins.append(mover.joint.change(state, moving, changing, frame, *given))
        return state, moving, changing

    def _place_links(self, known: LinkState, unknowns: Sequence[float]) -> LinkState:
        """Return the state with the frames of the links."""
        first = self._first
        state = LinkState(known.coordinates, known.pins[:first])
        for mover in self._movers:
            value = mover.value(unknowns, known)
            state.pins.append(mover.joint.child_frame(mover.joint.base(state), value))
        return state

    # The links: the unknown joints, and the frames of the links

    def place(
        self, known: LinkState, unknowns: Sequence[float], gained: Sequence[float]
    ) -> LinkState:
        return self._own_part(map(add, unknowns, gained), self._place_links(known, unknowns))

    def move(self, motion: GroupMotion) -> LinkState:
        *_, moved = self._carry(motion)
        return self._own_part(motion.highest[0], moved)

    def _own_part(self, joints: Iterable[float], state: LinkState) -> LinkState:
        return LinkState([*joints], [*islice(state.pins, self._first, None)])

    def list_places(self, known: LinkState, unknowns: Sequence[float]) -> list[complex]:
        state = self._place_links(known, unknowns)
        ends = (end.locate(state) for rod in self._rods for end in (rod.start, rod.end))
        return [coordinate for end in ends for coordinate in end]

    def missing_length(self, known: LinkState) -> float | None:
        return missing_length([rod.rod for rod in self._rods], known)

    @BuiltProperty
    def _rings(self) -> list[tuple[KnotRod, KnotRod]]:
        """Return the pairs of rods from known places to one link."""
        rods = []
        for rod in self._rods:
            start, end = sorted((rod.start, rod.end), key=lambda each: each.mover)
            rods.append(KnotRod(start, end, rod.rod))
        return [
            (one, other)
            for one, other in combinations(rods, 2)
            if one.start.mover == other.start.mover == -1 and one.end.mover == other.end.mover
        ]

    def shortfalls(self, known: LinkState) -> list[float]:
        """
        Return by how much rings of four bars are too short to close, in lengths; or less than 0.

        Two rods and the two links that they join are such a ring. It closes if no bar is longer
        than the others together.
        """
        found = []
        for one, other in self._rings:
            bars = [
                length(minus(one.start.locate(known), other.start.locate(known))),
                dist(one.end.place, other.end.place),
                abs(one.rod.length(known)),
                abs(other.rod.length(known)),
            ]
            found += [2.0 * bar - sum(bars[1:], bars[0]) for bar in bars]
        return found

    def evaluate(
        self, known: LinkState, unknowns: Sequence[float]
    ) -> tuple[list[float], list[list[float]]]:
        state = self._place_links(known, unknowns)
        errors, rows = [], []
        for rod, chains in zip(self._rods, self._chains, strict=True):
            places = rod.start.locate(state), rod.end.locate(state)
            vector, size = minus(places[1], places[0]), rod.rod.length(state)
            errors.append(0.5 * (dot(vector, vector) - size * size))
            row = [0.0] * len(self._rods)
            for sign, place, chain in zip((-1.0, 1.0), places, chains, strict=True):
                for number in chain:
                    joint, unknown, _ = self._movers[number]
                    frame = state.pins[self._first + number]
                    slope = dot(vector, joint.slope(frame.z, minus(place, frame.origin)))
                    if unknown >= 0:
                        row[unknown] = slope if sign > 0.0 else subtract(0.0, slope)
            rows.append(row)
        return errors, rows

    def _moving_chains(self, rod: KnotRod) -> tuple[list[int], list[int]]:
        """Return the movers that move one end of a rod only, for both ends, the last first."""
        chains: list[list[int]] = []
        for end in (rod.start, rod.end):
            chain, number = [], end.mover
            while number >= 0:
                chain.append(number)
                number = max(self._movers[number].joint.parent - self._first, -1)
            chains.append(chain)
        one, other = chains
        return [k for k in one if k not in other], [k for k in other if k not in one]

    @BuiltProperty
    def _axis_cosines(self) -> dict[tuple[int, int], float]:
        """Return the |cosines| between the axes of slides that no hinge turns against another."""
        found: dict[tuple[int, int], float] = {}
        for one, mover in enumerate(self._movers):
            other, axis = one, mover.joint.seat.z
            while other >= 0 and isinstance(self._movers[other].joint, SlidePair):
                joint = self._movers[other].joint
                if other != one:
                    # The axis in the frame of the child of the other.
                    found[one, other] = abs(dot(axis, (0.0, 0.0, 1.0)))
                axis, other = joint.seat.turn(axis), joint.parent - self._first
        return found

    def error_units(self, known: LinkState) -> list[float]:
        return [max(rod.rod.length(known), _SHORTEST) for rod in self._rods]

    def bound_changes(
        self, known: LinkState, unknowns: Sequence[float]
    ) -> Callable[[Sequence[float]], list[list[float]]]:
        count = len(unknowns)
        pairs = [*combinations_with_replacement(range(count), 2)]
        found = self._bends_line(known, LinkState([*unknowns], []))
        bends = found or [inf] * (count * len(pairs))

        def bound_change(moved: Sequence[float]) -> list[list[float]]:
            rows = [[0.0] * count for _ in range(count)]
            for number, row in enumerate(rows):
                first = number * len(pairs)
                of_row = bends[first:]
                for (one, other), bend in zip(pairs, of_row, strict=False):
                    # The bound of two unknowns is one of both derivatives together.
                    half = bend if one == other else 0.5 * bend
                    row[one] += half * moved[other]
                    if one != other:
                        row[other] += half * moved[one]
            return rows

        return bound_change

    def _list_bends(self, known: LinkState, pose: LinkState) -> list[float]:
        found = (self.bound_bends(k, known, pose.coordinates) for k in range(len(self._rods)))
        return [bend for bends in found for bend in bends]

    def bound_bends(self, number: int, known: LinkState, unknowns: Sequence[float]) -> list[float]:
        """
        Return bounds of the second derivatives of an equation: one for each pair of unknowns.

        An end is never farther from an axis than the links between reach. It moves by no more for
        a turn, and by 1 for a slide; only what is nearer to the ground turns that.
        """
        start, end, rod = self._rods[number]
        size, count = _AMID * rod.length(known), len(unknowns)
        bounds = dict.fromkeys(combinations_with_replacement(range(count), 2), 0.0)
        moves: list[tuple[int, float]] = []

        def bound(one: int, other: int, by: float) -> None:
            pair = sorted((self._movers[one].unknown, self._movers[other].unknown))
            bounds[pair[0], pair[1]] += by

        for at, chain in zip((start, end), self._chains[number], strict=True):
            reach, outer = hypot(*at.place), len(moves)
            for k in chain:
                mover = self._movers[k]
                slides = isinstance(mover.joint, SlidePair)
                if mover.unknown >= 0:
                    moves.append((k, 1.0 if slides else reach))
                    # A turn nearer to the ground turns what the others move, and itself.
                    for other, move in () if slides else moves[outer:]:
                        bound(k, other, size * move * (1.0 if other == k else 2.0))
                reach += hypot(*mover.joint.seat.origin)
                reach += abs(mover.value(unknowns, known)) + _SLID if slides else 0.0
        aligned = self._axis_cosines
        for one, move in moves:
            for other, more in moves:
                aligned_pair = max(one, other), min(one, other)
                bound(one, other, move * more * aligned.get(aligned_pair, 1.0))
        return [*bounds.values()]
