# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Places, velocities and accelerations of certain points of links, and of no others.

A point is reached from the coordinates of a closure: from the ground (or from a link that an
iteration has placed) along arms e^{iθ}·c of links and ways s·e^{iθ}·û along sliders. With the
rates ω = θ̇ and α = θ̈ of its link, an arm r adds iω·r to the velocity and (iα − ω²)·r to the
acceleration; a way adds (ṡ + iω·s)·û and (s̈ − ω²·s + i(α·s + 2ω·ṡ))·û, with û turned into the
frame of the ground (R. L. Norton, Design of Machinery, ch. 6 and 7: slip velocity and Coriolis
acceleration).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, TYPE_CHECKING

from linkage_ros.kinematics.arithmetic import make_vector, unit_vector
from linkage_ros.kinematics.plane.linkage import GROUND
from linkage_ros.kinematics.plane.solved_links import SolvedLinks
from linkage_ros.kinematics.step import LinkState

if TYPE_CHECKING:
    from linkage_ros.kinematics.results import Acceleration, Position, Velocity

_Place = tuple[str, int]
"""A point: the list of `_Walk` that holds it, and its index there."""


class _TrackerNode(NamedTuple):
    """A point: index of its base, index of its angle, vector from the base, slide or −1."""

    base: int
    arm: int
    way: complex
    slide: int


class PointTracker:
    """
    Certain points of links, tracked through the states of a closure.

    Each method returns a list of every point on the way; the requested points are at `indices`.

    Each point is the name of its link and its place in that link's frame, in [m].
    """

    __slots__ = ('_fixed', '_nodes', '_pins', '_scale', '_still', 'indices')

    def __init__(self, known: SolvedLinks, points: Sequence[tuple[str, complex]]) -> None:
        walk = _Walk(known)
        ends = [walk.reach_point(link, point / known.scale) for link, point in points]
        self._scale = known.scale
        self._fixed = [place * known.scale for place in walk.fixed]
        self._still = [0j] * len(walk.fixed)
        self._pins = tuple(walk.pins)
        self._nodes = tuple(
            _TrackerNode(walk.joined_index(base), arm, way * known.scale, slide)
            for base, arm, way, slide in walk.nodes
        )
        # For each requested point its index in the lists.
        self.indices = tuple(walk.joined_index(place) for place in ends)

    def places(self, position: Position) -> list[complex]:
        """Return the places of the points in the frame of the ground, in [m]."""
        return self.places_in(position.state)

    def places_in(self, state: LinkState) -> list[complex]:
        """Return the places of the points as `places` does, for a state."""
        x = state.coordinates
        places = self._initial_points(self._fixed, state.pins)
        for base, arm, way, slide in self._nodes:
            turned = unit_vector(x[arm]) * way
            places.append(places[base] + (turned if slide < 0 else x[slide] * turned))
        return places

    def velocities(
        self, position: Position, velocity: Velocity, places: list[complex]
    ) -> list[complex]:
        """Return the velocities of the points, in [m/s], given their places."""
        v = velocity.state.coordinates
        velocities = self._initial_points(self._still, velocity.state.pins)
        for base, arm, way, slide in self._nodes:
            moved = 1j * v[arm] * (places[len(velocities)] - places[base])
            if slide >= 0:
                moved += v[slide] * (unit_vector(position.state.coordinates[arm]) * way)
            velocities.append(velocities[base] + moved)
        return velocities

    def accelerations(
        self,
        position: Position,
        velocity: Velocity,
        acceleration: Acceleration,
        places: list[complex],
    ) -> list[complex]:
        """Return the accelerations of the points, in [m/s²], given their places."""
        v = velocity.state.coordinates
        a = acceleration.state.coordinates
        accelerations = self._initial_points(self._still, acceleration.state.pins)
        for base, arm, way, slide in self._nodes:
            turn = v[arm]
            lever = places[len(accelerations)] - places[base]
            moved = make_vector(-turn * turn, a[arm]) * lever
            if slide >= 0:
                unit = unit_vector(position.state.coordinates[arm]) * way
                moved += make_vector(a[slide], 2.0 * turn * v[slide]) * unit
            accelerations.append(accelerations[base] + moved)
        return accelerations

    def _initial_points(self, fixed: list[complex], pins: list[complex]) -> list[complex]:
        """Return the points on the ground and those that an iteration has placed."""
        started = fixed.copy()
        for index in self._pins:
            started.append(pins[index] * self._scale)
        return started


class _Walk:
    """The shortest way to the points, in the unit of the closure's lengths."""

    def __init__(self, known: SolvedLinks) -> None:
        self._known = known
        self._places: dict[tuple[str, complex], _Place] = {}
        self.fixed: list[complex] = []
        self.pins: list[int] = []
        self.nodes: list[tuple[_Place, int, complex, int]] = []

    def joined_index(self, place: _Place) -> int:
        """Return the index of a point if all lists are joined."""
        kind, index = place
        before = {'fixed': 0, 'pin': len(self.fixed), 'node': len(self.fixed) + len(self.pins)}
        return before[kind] + index

    def reach_point(self, link: str, point: complex) -> _Place:
        """Return a point of a link, and add the way to it."""
        if (link, point) not in self._places:
            self._places[link, point] = self._add_point(link, point)
        return self._places[link, point]

    def _add_point(self, link: str, point: complex) -> _Place:
        if link == GROUND:
            self.fixed.append(point)
            return 'fixed', len(self.fixed) - 1
        held = self._known.attachments[link]
        if held.point != point:
            angle = self._known.angles[link]
            vector = angle.unit * (point - held.point)
            return self._add_node(
                (self.reach_point(link, held.point), angle.coordinate, vector, -1)
            )
        if held.pin >= 0:
            self.pins.append(held.pin)
            return 'pin', len(self.pins) - 1
        base = self.reach_point(held.link, held.link_point)
        if held.slide is None:
            return base
        angle, slide = self._known.angles[held.link], held.slide
        unit = angle.unit * (slide.sign * held.direction)
        return self._add_node((base, angle.coordinate, unit, slide.coordinate))

    def _add_node(self, node: tuple[_Place, int, complex, int]) -> _Place:
        self.nodes.append(node)
        return 'node', len(self.nodes) - 1
