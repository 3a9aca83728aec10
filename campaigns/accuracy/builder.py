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
Linkages made from a pose: pins are put where they shall be, and the links follow.

So a linkage closes at the crank angle that it was made at, whatever its dyads. Frames are plain,
origin on the first pin and x axis towards the second, or stand anywhere: a file may have either.
"""

from __future__ import annotations

from cmath import phase
from math import pi
import random

from campaigns.accuracy.mechanism import CRANK, Dyad, GROUND, Mechanism, polar, Slide, Spot, Turn


class Builder:
    """
    A linkage in the making.

    Parameters
    ----------
    rng
        Source of everything random.
    phi
        Crank angle of the pose.
    plain
        Whether the frames are plain.

    """

    def __init__(self, rng: random.Random, phi: float, plain: bool) -> None:
        self.rng = rng
        self.phi = phi
        self.plain = plain
        self.spread = 0.5
        self.offset = 1.0
        self._frames: dict[str, tuple[complex, complex]] = {GROUND: (0j, 1 + 0j)}
        self._links: dict[str, dict[str, tuple[float, float]]] = {GROUND: {}}
        self._sliders: dict[str, Slide] = {}
        self._dyads: list[Dyad] = []
        self._joints: dict[str, Turn | str] = {}
        self._names = 0

    def mechanism(self) -> Mechanism:
        """Return what has been built."""
        return Mechanism(self._links, self._sliders, tuple(self._dyads), self._joints)

    def is_first(self) -> bool:
        """Return whether no dyad has been added yet."""
        return not self._dyads

    def name(self, stem: str) -> str:
        """Return a name that is not taken."""
        self._names += 1
        return f'{stem}{self._names}'

    def length(self) -> float:
        """Return a random length about 1."""
        return float(10.0 ** self.rng.uniform(-self.spread, self.spread))

    def direction(self) -> float:
        """Return a random direction."""
        return self.rng.uniform(-pi, pi)

    def crank(self) -> Spot:
        """Add the crank, from a pivot on the ground to a pin A."""
        pivot, pin = 0j, polar(self.length(), self.phi)
        if not self.plain:
            pivot = polar(self.length(), self.direction())
        self.put(GROUND, 'O', pivot)
        origin = (
            pivot if self.plain else pivot + polar(self.offset * self.length(), self.direction())
        )
        self._frames[CRANK] = (origin, polar(1.0, self.phi))
        self._links[CRANK] = {}
        self.put(CRANK, 'O', pivot)
        self.put(CRANK, 'A', pivot + pin)
        if self.plain:
            self._links[CRANK]['A'] = (abs(pin), 0.0)
        return Spot(CRANK, 'A')

    def add_crank_by_points(self, points: dict[str, complex]) -> None:
        """Add a crank whose frame lies in the ground's while the crank is at 0."""
        self._frames[CRANK] = (0j, 1 + 0j)
        self._links[CRANK] = {point: (z.real, z.imag) for point, z in points.items()}

    def put(self, link: str, point: str, where: complex) -> None:
        """Add a point to a link where it is in the pose."""
        origin, unit = self._frames[link]
        z = (where - origin) * unit.conjugate()
        self._links[link][point] = (z.real, z.imag)

    def where(self, spot: Spot) -> complex:
        """Return where a point is in the pose."""
        origin, unit = self._frames[spot.link]
        return origin + unit * complex(*self._links[spot.link][spot.point])

    def spot(self, link: str) -> Spot:
        """Add a random point to a link."""
        origin = next(iter(self._links[link]))
        spot = Spot(link, self.name('P'))
        where = self.where(Spot(link, origin)) + polar(self.length(), self.direction())
        self.put(link, spot.point, where)
        return spot

    def link(self, stem: str, pins: dict[str, complex], axis: complex | None = None) -> str:
        """Add a link by its pins; without an axis the first two fix a plain frame."""
        name = self.name(stem)
        first, *others = pins.values()
        if not self.plain:
            origin = first + polar(self.offset * self.length(), self.direction())
            self._frames[name] = (origin, polar(1.0, self.direction()))
        elif axis is None:
            self._frames[name] = (first, (others[0] - first) / abs(others[0] - first))
        else:
            self._frames[name] = (first, axis)
        self._links[name] = {}
        for point, where in pins.items():
            self.put(name, point, where)
        if self.plain:
            self._links[name][next(iter(pins))] = (0.0, 0.0)
        if self.plain and axis is None:
            self._links[name][list(pins)[1]] = (abs(others[0] - first), 0.0)
        return name

    def slide(self, line: complex, along: str, through: str, point: str, block: str | None) -> str:
        """Add a slider whose line has a direction in the pose."""
        name = self.name('s')
        unit = self._frames[along][1]
        local = line * unit.conjugate()
        angle = 0.0
        if self.plain and abs(local.imag) < 1e-12:
            local = complex(round(local.real))
        elif not self.plain:
            local *= self.length()
        if block is not None and not self.plain:
            angle = phase(self._frames[block][1] * unit.conjugate())
        self._sliders[name] = Slide(point, along, through, (local.real, local.imag), block, angle)
        return name

    def axis(self, link: str) -> complex:
        """Return the direction of a link's x axis in the pose."""
        return self._frames[link][1]

    def add(self, dyad: Dyad, *joints: Turn | str) -> None:
        """Add a dyad and what is published of it."""
        self._dyads.append(dyad)
        for joint in joints:
            self._joints[self.name('joint')] = joint

    def parent(self) -> str:
        """Return a link that a published angle may be counted from."""
        return self.rng.choice((GROUND, CRANK))
