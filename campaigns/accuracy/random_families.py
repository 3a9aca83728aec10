# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Random linkages: one dyad of each type on a crank, and chains of three.

A linkage is made from a pose: the pins are placed, and the links follow. So it closes at the crank
angle of that pose, whatever its dyads. Frames are plain (origin at the first pin, x axis towards
the second) or arbitrary, as in linkage files.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import pi
import random

from campaigns.accuracy.dyads import PRP, RPP, RPR, RRP, RRR
from campaigns.accuracy.mechanism import CRANK, Dyad, Mechanism, polar, Spot
from flint import arb
from linkage_ros.kinematics import GROUND, RevoluteJoint, SlideJoint, Slider


class Builder:
    """Builds a random linkage in a pose of a crank angle; its frames may be plain."""

    def __init__(self, rng: random.Random, phi: float, plain: bool) -> None:
        self.rng = rng
        self.phi = phi
        self.plain = plain
        self.spread = 0.5
        self.offset = 1.0
        self._frames: dict[str, tuple[complex, complex]] = {GROUND: (0j, 1 + 0j)}
        self._links: dict[str, dict[str, tuple[float, float]]] = {GROUND: {}}
        self._sliders: dict[str, Slider] = {}
        self._dyads: list[Dyad] = []
        self._joints: dict[str, RevoluteJoint | SlideJoint] = {}
        self._names = 0

    def mechanism(self) -> Mechanism:
        """Return the built linkage."""
        return Mechanism(self._links, self._sliders, tuple(self._dyads), self._joints)

    def is_first(self) -> bool:
        """Return whether no dyad has been added yet."""
        return not self._dyads

    def name(self, stem: str) -> str:
        """Return an unused name."""
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
        """Add a crank whose frame coincides with the ground's at a crank angle of 0."""
        self._frames[CRANK] = (0j, 1 + 0j)
        self._links[CRANK] = {point: (z.real, z.imag) for point, z in points.items()}

    def put(self, link: str, point: str, where: complex) -> None:
        """Add a point to a link, by its position in the pose."""
        origin, unit = self._frames[link]
        z = (where - origin) * unit.conjugate()
        self._links[link][point] = (z.real, z.imag)

    def where(self, spot: Spot) -> complex:
        """Return the position of a point in the pose."""
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

    def slide(self, line: complex, along: str, through: str, point: str, block: str) -> str:
        """Add a slider whose line has a direction in the pose."""
        name = self.name('s')
        unit = self._frames[along][1]
        local = line * unit.conjugate()
        angle = 0.0
        if self.plain and abs(local.imag) < 1e-12:
            local = complex(round(local.real))
        elif not self.plain:
            local *= self.length()
        if block and not self.plain:
            angle = phase(self._frames[block][1] * unit.conjugate())
        self._sliders[name] = Slider(point, along, through, (local.real, local.imag), block, angle)
        return name

    def axis(self, link: str) -> complex:
        """Return the direction of a link's x axis in the pose."""
        return self._frames[link][1]

    def add(self, dyad: Dyad, *joints: RevoluteJoint | SlideJoint) -> None:
        """Add a dyad and its published joints."""
        self._dyads.append(dyad)
        for joint in joints:
            self._joints[self.name('joint')] = joint

    def parent(self) -> str:
        """Return a random parent link for a published angle."""
        return self.rng.choice((GROUND, CRANK))


_LEAST_SINE = 0.05
"""Minimum sine of the angle between the two lines of a dyad, in its pose."""


def add_rrr(
    build: Builder,
    a: Spot,
    d: Spot,
    pin: complex | None = None,
    *,
    fold: bool = False,
    stretch: bool = False,
) -> list[str]:
    """Add two links pinned together at a given or a random position."""
    start, end = build.where(a), build.where(d)
    where = start + polar(build.length(), build.direction()) if pin is None else pin
    name = build.name('B')
    one = build.link('link', {a.point: start, name: where})
    two = build.link('link', {d.point: end, name: where})
    side = 1 if _cross(end - start, where - start) > 0 else -1
    dyad = RRR(one, two, a, d, name, 1, fold, stretch)
    # RRR wants the side for 0 < φ < π.
    dyad = replace(dyad, side=side * dyad.side_at(arb(build.phi)))
    build.add(dyad, RevoluteJoint(build.parent(), one), RevoluteJoint('ground', two))
    return [one, two]


def add_rrp(build: Builder, a: Spot, along: str) -> list[str]:
    """Add a link whose far pin a slider, with or without a block, keeps on a line."""
    start = build.where(a)
    where = start + polar(build.length(), build.direction())
    line = _line(build, along)
    pin = build.name('B')
    one = build.link('link', {a.point: start, pin: where})
    block, point, on_line = _perhaps_block(build, pin, where, along)
    through = _through(build, along, on_line, line)
    slider = build.slide(line, along, through, point, block)
    side = 1 if ((where - start) * line.conjugate()).real > 0 else -1
    build.add(
        RRP(one, a, pin, slider, side), RevoluteJoint(build.parent(), one), SlideJoint(slider)
    )
    return [link for link in (one, block) if link]


def add_rpr(build: Builder, a: Spot, d: Spot) -> list[str]:
    """Add a rod, straight or bent, that slides through a swivel."""
    start, end = build.where(a), build.where(d)
    straight = build.rng.random() < 0.4
    line = polar(1.0, build.direction())
    if straight:
        line = (end - start) / abs(end - start) * build.rng.choice((1, -1))
    rail = build.link('rail', {a.point: start}, axis=line)
    block, point, on_line = _perhaps_block(build, d.point, end, rail)
    through = a.point
    if not (straight and build.plain):
        through = _through(build, rail, on_line, line)
    elif block:
        # With another point of the block the line would not pass through the swivel.
        point = d.point
    slider = build.slide(line, rail, through, point, block)
    side = 1 if ((end - start) * line.conjugate()).real > 0 else -1
    build.add(
        RPR(rail, a, d, slider, side), RevoluteJoint(build.parent(), rail), SlideJoint(slider)
    )
    return [link for link in (rail, block) if link]


def add_prp(build: Builder, known: str, other: str) -> list[str]:
    """Add a block on each of two lines, pinned together; the second block may be virtual."""
    where = polar(build.length(), build.direction())
    pin = build.name('B')
    links, sliders = [], []
    line = 0j
    for i, along in enumerate((known, other)):
        line = _line(build, along, line)
        block, point, on_line = _perhaps_block(build, pin, where, along, always=i == 0)
        links.append(block)
        through = _through(build, along, on_line, line)
        sliders.append(build.slide(line, along, through, point, block))
    build.add(PRP(sliders[0], sliders[1], pin), *map(SlideJoint, sliders))
    return [link for link in links if link]


def add_rpp(build: Builder, a: Spot, along: str) -> list[str]:
    """Add a yoke on a line, and in its slot a pin or a block."""
    start = build.where(a)
    guide = build.where(build.spot(along)) + polar(build.length(), build.direction())
    line = _line(build, along)
    yoke_point, through = build.name('C'), build.name('Q')
    yoke = build.link('yoke', {yoke_point: guide}, axis=build.axis(along))
    build.put(along, through, guide - line * build.length())
    outer = build.slide(line, along, through, yoke_point, yoke)
    block, point, on_line = _perhaps_block(build, a.point, start, yoke)
    slot = _line(build, along, line)
    if build.plain and build.rng.random() < 0.5:
        slot = line * 1j
    inner = build.slide(slot, yoke, _through(build, yoke, on_line, slot), point, block)
    build.add(RPP(a, inner, outer), SlideJoint(inner), SlideJoint(outer))
    return [link for link in (yoke, block) if link]


def _perhaps_block(
    build: Builder, pin: str, where: complex, along: str, *, always: bool = False
) -> tuple[str, str, complex]:
    """Return a new block as `_block` does, or none: then the pin itself is on the line."""
    if always or build.rng.random() < 0.5:
        return _block(build, pin, where, along)
    return '', pin, where


def _through(build: Builder, along: str, on_line: complex, line: complex) -> str:
    """Add the start of a line, at a random distance from a point on it; return its name."""
    through = build.name('Q')
    build.put(along, through, on_line - line * build.length() * build.rng.choice((1, -1)))
    return through


def _block(build: Builder, pin: str, where: complex, along: str) -> tuple[str, str, complex]:
    """Add a block; return it, its point on the line, and the position of that point."""
    axis = build.axis(along)
    if build.rng.random() < 0.5:
        return build.link('block', {pin: where}, axis=axis), pin, where
    point = build.name('C')
    beside = where + polar(0.3 * build.length(), build.direction())
    return build.link('block', {pin: where, point: beside}, axis=axis), point, beside


def _line(build: Builder, along: str, other: complex = 0j) -> complex:
    """
    Return the direction of the link's x axis, or a random one; not parallel to another line.

    Only the first dyad has lines along axes. Two sliders on parallel lines of links that do not
    turn would make a linkage that does not move, or that is indeterminate.
    """
    line = polar(1.0, build.direction())
    if build.plain and build.is_first() and build.rng.random() < 0.5:
        line = build.axis(along) * build.rng.choice((1, -1))
    return line if abs(_cross(line, other)) > _LEAST_SINE * abs(other) or not other else 1j * line


def _cross(one: complex, other: complex) -> float:
    return (one.conjugate() * other).imag


Case = tuple[Mechanism, list[float]]
"""A linkage and the input angles to solve it at."""

DYADS = ('RRR', 'RRP', 'RPR', 'PRP', 'RPP')

ANGLES = 50
"""Number of input angles of each linkage."""


def _random_dyad(kind: str, rng: random.Random) -> Case:
    build = start(rng, rng.uniform(-pi, pi))
    add_random(build, kind, CRANK, GROUND, first=True)
    return build.mechanism(), crank_angles(rng, build.phi)


def _chain(kinds: Sequence[str], rng: random.Random) -> Case:
    """Return a chain of three dyads, each of one of some kinds."""
    build = start(rng, rng.uniform(-pi, pi))
    latest, earlier = [CRANK], [GROUND]
    for i in range(3):
        kind = rng.choice(kinds) if len(kinds) > 1 else kinds[0]
        known, other = rng.choice(latest), GROUND
        if rng.random() < 0.3:
            other = rng.choice(earlier)
        links = add_random(build, kind, known, other, first=i == 0)
        earlier, latest = [*earlier, *latest], links
    return build.mechanism(), crank_angles(rng, build.phi)


RANDOM: dict[str, tuple[float, Callable[[random.Random], Case]]] = {
    **{kind: (1.4, partial(_random_dyad, kind)) for kind in DYADS},
    'RRR-RRR-RRR': (1.0, partial(_chain, ('RRR',))),
    'any three': (2.0, partial(_chain, DYADS)),
}
"""For each family its share of the cases, and the function that makes a linkage."""


def crank_angles(rng: random.Random, phi: float) -> list[float]:
    """Return angles over two turns, and as many near one at which the linkage closes."""
    near = [phi + rng.gauss(0.0, 0.3) for _ in range(ANGLES // 2)]
    return [rng.uniform(-2 * pi, 2 * pi) for _ in range(ANGLES - len(near))] + near


def start(rng: random.Random, phi: float, plain: bool | None = None) -> Builder:
    """Return a builder with plain or arbitrary frames; None draws which."""
    return Builder(rng, phi, rng.random() < 0.5 if plain is None else plain)


def add_random(build: Builder, kind: str, known: str, other: str, first: bool) -> list[str]:
    """Add a random dyad of a kind between two links; for the first dyad, add the crank too."""
    if first:
        pin = build.crank()
    elif kind == 'PRP':
        return add_prp(build, known, other)
    else:
        pin = build.spot(known)
    if kind == 'RRP':
        return add_rrp(build, pin, other)
    if kind == 'PRP':
        return add_prp(build, known, other)
    if kind == 'RPP':
        return add_rpp(build, pin, other)
    end: Spot = build.spot(other)
    return (add_rrr if kind == 'RRR' else add_rpr)(build, pin, end)
