# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The families: every dyad on every kind of link, chains, inputs of all kinds, and class III.

Some families have exact change points: with every dyad, in both orientations, on a crank and in
chains. All their lengths are multiples of 1/64, so that sums and differences are exact and the
links of the dyad are exactly in line. Frames are those of textbooks; the ground may have another
origin.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import pi
import random
from typing import Any, NamedTuple

from campaigns.accuracy.dyads import RPR, RRP, RRR
from campaigns.accuracy.mechanism import Spot
from campaigns.accuracy.random_families import DYADS
from campaigns.topologies.constraints import Real
from campaigns.topologies.geometry import DrivenLink, Geometry, Group, Passing
from campaigns.topologies.topology import Topology, TopologyBuilder
from linkage_ros.kinematics import GROUND, Input, Linkage, RevoluteJoint, Side, SlideJoint, Slider
import numpy as np

Links = dict[str, dict[str, tuple[float, float]]]

IN_A_CHAIN, REVERSED = ' in a chain', ', input reversed'
PLACES = {
    '': 'on a crank',
    REVERSED: 'on a crank whose input is the angle of the ground to it',
    IN_A_CHAIN: 'on a rocker',
}

_UNIT = 1 / 64
_LEAST_SPARE = 0.01
_NEARLY_FLAT = 1e-3


def _length(rng: random.Random) -> float:
    return rng.randint(16, 192) * _UNIT


def _other(rng: random.Random, *not_these: float) -> float:
    while (length := _length(rng)) in not_these:
        pass
    return length


class _Parts:
    """The parts of a linkage whose crank turns at O; ``crank`` may be the rocker of a chain."""

    def __init__(self, rng: random.Random, place: str) -> None:
        self.rng = rng
        self.origin = (0.0, 0.0) if rng.random() < 0.5 else (_length(rng), -_length(rng))
        self.links: Links = {GROUND: {'O': self.origin}, 'crank': {'O': (0.0, 0.0)}}
        self.sliders: dict[str, Slider] = {}
        self.groups: list[Group] = []
        self.assembly: dict[str, Side] = {}
        self.sides: dict[str, int | Passing] = {}
        self.chained = place == IN_A_CHAIN
        # The input may be the angle of the ground relative to the crank.
        self.child = place != REVERSED
        self.input = 'motor' if self.chained else 'crank'
        pivot = 'O'
        if self.chained:
            # The crank is the rocker of a crank-rocker.
            pivot = 'M'
            self._base()
        ends = (GROUND, self.input) if self.child else (self.input, GROUND)
        self.driven = Input('in', *ends)
        self.groups.insert(0, DrivenLink(self.input, GROUND, 0))
        assert pivot in self.links[self.input]

    def _base(self) -> None:
        rng = self.rng
        a, c, d = 0.25 * _length(rng), _length(rng), 2.0 + _length(rng)
        while not (abs(d - c) + a < (b := _length(rng) + 1.0) < d + c - a):
            c, d = _length(rng), 2.0 + _length(rng)
        direction = rng.uniform(-pi, pi)
        motor = (
            self.origin[0] + d * float(np.cos(direction)),
            self.origin[1] + d * float(np.sin(direction)),
        )
        self.links[GROUND]['M'] = motor
        self.links['crank']['N'] = (0.0, c)
        crank = self.links.pop('crank')
        self.links |= {
            'motor': {'M': (0.0, 0.0), 'K': (a, 0.0)},
            'bar': {'K': (0.0, 0.0), 'N': (b, 0.0)},
            'crank': crank,
        }
        side = rng.choice((1, -1))
        self.groups.append(RRR('bar', 'crank', Spot('motor', 'K'), Spot(GROUND, 'O'), 'N', side))
        self.sides['N'] = side
        self.assembly['N'] = 'left' if side > 0 else 'right'

    def on_ground(self, distance: float, name: str) -> complex:
        """Add a point of the ground at an exact distance from O; return its direction."""
        # Not at π from the input's 0: there the count of turns would be ambiguous.
        direction = self.rng.choice((1 + 0j, 1j, -1j))
        step = distance * direction
        self.links[GROUND][name] = (self.origin[0] + step.real, self.origin[1] + step.imag)
        return direction

    def passing(
        self, side: int, line: complex, at: tuple[bool, bool], zero: float | None = None
    ) -> int | Passing:
        """
        Return a side that changes at crank directions 0 or π from a line, or a constant side.

        ``zero`` is the direction of ``line`` with its turns, if it has any.
        """
        if self.chained and at != (True, True):
            return side
        sign = 1 if self.child else -1
        turns = None if self.chained else (sign, -phase(line) if zero is None else -zero)
        return Passing(side, 'crank', (GROUND, line), at, turns)

    def topology(self, line: complex, at: tuple[bool, bool]) -> Topology | None:
        """Return the built linkage; ``at``: whether its dyad is in line at 0 and at π."""
        moving = [link for link in self.links if link != GROUND]
        joints: dict[str, RevoluteJoint | SlideJoint] = {
            f'a_{link}': RevoluteJoint(GROUND, link) for link in moving
        }
        joints |= {f's_{name}': SlideJoint(name) for name in self.sliders}
        linkage = Linkage(self.links, (self.driven,), self.assembly, joints, dict(self.sliders))
        sign = 1 if self.child else -1
        flat: tuple[float, ...] = ()
        if not self.chained:
            flat = tuple(
                sign * (phase(line) + angle)
                for angle, passed in zip((0.0, pi), at, strict=True)
                if passed
            )
        topology = Topology(
            linkage, tuple(self.groups), dict(self.sides), (0.0,), {}, (0.3,), flat
        )
        return _started(topology, self.rng, (line, at) if self.chained else None)


def _started(
    topology: Topology,
    rng: random.Random,
    chained_line: tuple[complex, tuple[bool, bool]] | None,
) -> Topology | None:
    """Return a topology that starts far from its limits; None if it does not close."""
    geometry = Geometry(topology.linkage, topology.groups or (), topology.sides)
    inputs = np.array([[rng.uniform(-pi, pi) for _ in range(400)]], Real)
    places = geometry.place(inputs)
    spare = np.min([margin.spare / margin.grain for margin in places.margins], axis=0)
    best = int(np.nanargmax(spare))
    if spare[best] < _LEAST_SPARE:
        return None
    if chained_line is not None:
        # The rocker has to reach the pose in which the dyad is in line.
        line, at = chained_line
        phi = np.angle(places.units['crank'] * np.conj(line))[spare > -_NEARLY_FLAT]
        away = [np.abs(np.sin(0.5 * (phi - angle))).min() for angle in (0.0, pi)]
        if not any(passed and off < 0.01 for off, passed in zip(away, at, strict=True)):
            return None
    pose = {
        link: (
            float(np.angle(places.units[link][best])),
            float(places.origins[link][best].real),
            float(places.origins[link][best].imag),
        )
        for link in topology.linkage.links
        if link != GROUND
    }
    return replace(topology, start=(float(inputs[0, best]),), pose=pose)


def _rrr(parts: _Parts, fold: bool, stretch: bool) -> Topology | None:
    rng = parts.rng
    a = _length(rng)
    d = _other(rng, a)
    if fold and stretch:
        b, c = (d, a) if rng.random() < 0.6 else (a, d)
    elif fold:
        b = _other(rng, a, d)
        while (c := b + rng.choice((1, -1)) * (d - a)) <= 0.0 or {b, c} == {a, d}:
            b = _other(rng, a, d)
    else:
        while (b := _other(rng, a, d)) >= a + d:
            pass
        c = a + d - b
    parts.links['crank']['A'] = (a, 0.0)
    line = parts.on_ground(d, 'D')
    parts.links['one'] = {'A': (0.0, 0.0), 'B': (b, 0.0)}
    parts.links['two'] = {'D': (0.0, 0.0), 'B': (c, 0.0)}
    side = rng.choice((1, -1))
    parts.groups.append(RRR('one', 'two', Spot('crank', 'A'), Spot(GROUND, 'D'), 'B', side))
    parts.assembly['B'] = 'left' if side > 0 else 'right'
    parts.sides['B'] = parts.passing(side, line, (fold, stretch))
    return parts.topology(line, (fold, stretch))


def _rpr(parts: _Parts, bent: bool, rail_on_crank: bool) -> Topology | None:
    rng = parts.rng
    a = _length(rng)
    d = _other(rng, a) if bent else a
    parts.links['crank']['A'] = (a, 0.0)
    line = parts.on_ground(d, 'D')
    pins = (Spot('crank', 'A'), Spot(GROUND, 'D'))
    if not rail_on_crank:
        pins = pins[::-1]
    offset = rng.choice((1, -1)) * (d - a)
    parts.links['rail'] = {pins[0].point: (0.0, 0.0)}
    through, direction = pins[0].point, rng.choice((1.0, -1.0))
    if bent:
        through = 'Q'
        parts.links['rail']['Q'] = (rng.choice((0.0, _length(rng))), offset)
    block = ''
    if rng.random() < 0.5:
        block = 'block'
        parts.links[block] = {pins[1].point: (0.0, 0.0)}
    parts.sliders['S'] = Slider(pins[1].point, 'rail', through, (direction, 0.0), block, 0.0)
    side = rng.choice((1, -1))
    parts.groups.append(RPR('rail', pins[0], pins[1], 'S', side))
    parts.assembly['S'] = 'ahead' if side > 0 else 'behind'
    parts.sides['S'] = parts.passing(side, line, (True, False))
    return parts.topology(line, (True, False))


def _rrp(parts: _Parts, below: bool, above: bool, pin_on_crank: bool) -> Topology | None:
    rng = parts.rng
    a = _length(rng)
    # The pivot lies by e left of the line; the rod is perpendicular where b = |e ± a|.
    e = 0.0 if below and above else rng.choice((1, -1)) * _other(rng, a)
    b = a
    if not (below and above):
        # y of the pin goes from e − a to e + a; the rod is perpendicular at y = b and y = −b.
        b = a + e if below else a - e
        while b <= 0.0 or b == a:
            e = rng.choice((1, -1)) * _other(rng, a)
            b = a + e if below else a - e
    side = rng.choice((1, -1))
    if pin_on_crank:
        parts.links['crank']['A'] = (a, 0.0)
        pin, along = Spot('crank', 'A'), GROUND
        unit = rng.choice((1 + 0j, 1j, -1j))
        foot = -1j * unit * e
        parts.links[GROUND]['Q'] = (
            parts.origin[0] + foot.real,
            parts.origin[1] + foot.imag,
        )
        line, zero = -1j * unit, phase(unit) - 0.5 * pi
        # ψ = φ − π/2: above (y = −b) at φ = 0, below (y = b) at φ = π.
        at = (above, below)
    else:
        direction = parts.on_ground(a, 'A')
        pin, along = Spot(GROUND, 'A'), 'crank'
        unit = direction if direction.real else 1 + 0j
        parts.links['crank']['Q'] = (0.0, -unit.real * e)
        # The ground's pin seen from the crank's rail: ψ = dir(OA) − crank − dir(û).
        line = -1j * direction * unit.conjugate()
        zero = phase(direction * unit.conjugate()) - 0.5 * pi
        # crank = dir(line) + φ: ψ = π/2 − φ: below at φ = 0, above at φ = π.
        at = (below, above)
    parts.links['rod'] = {pin.point: (0.0, 0.0), 'B': (b, 0.0)}
    block = ''
    if rng.random() < 0.5:
        block = 'block'
        parts.links[block] = {'B': (0.0, 0.0)}
    parts.sliders['S'] = Slider('B', along, 'Q', (unit.real, unit.imag), block, 0.0)
    parts.groups.append(RRP('rod', pin, 'B', 'S', side))
    parts.assembly['S'] = 'ahead' if side > 0 else 'behind'
    parts.sides['S'] = parts.passing(side, line, at, zero)
    return parts.topology(line, at)


class Family(NamedTuple):
    """The description of a family, and the function that makes a linkage."""

    description: str
    make: Callable[[random.Random], Topology]


def _until_it_closes(shape: Shape, place: str, rng: random.Random) -> Topology:
    while (topology := shape(_Parts(rng, place))) is None:
        pass
    return topology


Shape = Callable[[_Parts], Topology | None]

_CARRIERS = {'the crank': True, 'the ground': False}

_SHAPES: dict[str, tuple[str, Shape]] = {
    **{
        f'RRR {name}': (
            f'an RRR dyad {{}} that is exactly in line: {name}',
            partial(_rrr, fold='fold' in name, stretch='stretch' in name),
        )
        for name in ('fold', 'stretch', 'fold and stretch')
    },
    **{
        f'RPR {name}, rail on {carrier}': (
            f'an RPR dyad {{}} exactly in line, its rail {name} on {carrier}',
            partial(_rpr, bent=name == 'bent', rail_on_crank=crank),
        )
        for name in ('bent', 'straight')
        for carrier, crank in _CARRIERS.items()
    },
    **{
        f'RRP {name}, pin on {carrier}': (
            f'an RRP dyad {{}}, pin on {carrier}, rod exactly perpendicular: {name}',
            partial(_rrp, below='below' in name, above='above' in name, pin_on_crank=crank),
        )
        for name in ('below', 'above', 'below and above')
        for carrier, crank in _CARRIERS.items()
    },
}
"""Dyads with exact change points: what each is, with {} for its place, and what makes it."""


ENDS = (
    ('input', 'ground'),
    ('ground', 'input'),
    ('moving', 'ground'),
    ('ground', 'moving'),
    ('moving', 'input'),
    ('input', 'moving'),
    ('moving', 'moving'),
    ('input', 'second input'),
)
"""The links that carry the ends of a dyad; the first one carries the pin of a rail."""


def _input(build: TopologyBuilder, on: str = GROUND) -> str:
    return build.sliding(on) if build.rng.random() < 0.35 else build.turning(on)


def _on_links(kind: str, ends: tuple[str, str], rng: random.Random) -> Topology:
    build = TopologyBuilder(rng)
    links = {'ground': [GROUND], 'input': [_input(build)]}
    if 'second input' in ends:
        links['second input'] = [_input(build, rng.choice((GROUND, *links['input'])))]
    if 'moving' in ends:
        links['moving'] = build.dyad(rng.choice(DYADS), links['input'][0], GROUND)
        if ends.count('moving') > 1 and rng.random() < 0.5:
            links['moving'] += build.dyad(rng.choice(DYADS), links['input'][0], GROUND)
    one = rng.choice(links[ends[0]])
    other = rng.choice([link for link in links[ends[1]] if link != one] or [GROUND])
    build.dyad(kind, one, other)
    return build.topology()


def _chain(count: int, inputs: int, rng: random.Random) -> Topology:
    build = TopologyBuilder(rng)
    known = [GROUND]
    for _ in range(inputs):
        known.append(_input(build, rng.choice(known)))
    latest = known[1:]
    for _ in range(count):
        one = rng.choice(latest)
        other = rng.choice([link for link in known if link != one])
        kind = rng.choice(DYADS)
        if rng.random() < 0.5:
            one, other = other, one
        latest = build.dyad(kind, one, other)
        known += latest
    return build.topology()


def _between(inputs: int, chain: int, rng: random.Random) -> Topology:
    build = TopologyBuilder(rng)
    known = [GROUND]
    between = 1 if inputs == 1 else rng.choice((1, 2))
    known += [_input(build) for _ in range(inputs - between)]
    if len(known) < 2:
        # Both ends of the arms are on the ground.
        known += build.driven_dyad(GROUND, GROUND, between)
    else:
        known += build.driven_dyad(known[-1], GROUND, between)
    for _ in range(chain):
        one = rng.choice(known[1:])
        other = rng.choice([link for link in known if link != one])
        known += build.dyad(rng.choice(DYADS), one, other)
    return build.topology()


def _class_3(sliders: bool, chain: int, inputs: int, rng: random.Random) -> Topology:
    build = TopologyBuilder(rng)
    known = [GROUND]
    add = _input if sliders else TopologyBuilder.turning
    known += [add(build, GROUND) for _ in range(inputs)]
    latest = known[1:]
    for _ in range(chain):
        latest = build.dyad(rng.choice(DYADS), known[1], GROUND)
        known += latest
    legs = [rng.choice(('RR', 'PR', 'RP')) for _ in range(3)] if sliders else ['RR'] * 3
    if sliders and legs.count('RR') == 0:
        legs[0] = 'RR'
    held = [rng.choice(latest), *(GROUND if inputs < 2 else known[-1],), GROUND]
    build.platform(held, legs)
    return build.topology()


_OTHERS: dict[str, tuple[Any, ...]] = {
    # The description, and what makes a linkage, with its arguments.
    'two inputs': ('two inputs that turn or slide, and two dyads', _chain, 2, 2),
    'three inputs': ('three inputs that turn or slide, and two dyads', _chain, 2, 3),
    'cylinder': ('an input between moving links, both ends on the ground', _between, 1, 0),
    'cylinder and chain': ('an input between moving links, and two dyads', _between, 1, 2),
    'cylinder and crank': ('inputs on the ground and between moving links', _between, 2, 1),
    'three, two between': ('three inputs, one or two between moving links', _between, 3, 1),
    'class III': ('a platform on three legs, one on a crank', _class_3, False, 0, 1),
    'class III sliders': ('a platform whose legs are links, slots or rails', _class_3, True, 0, 1),
    'class III chain': ('a platform with a leg on a dyad', _class_3, True, 1, 1),
    'class III two inputs': ('a platform on two inputs and the ground', _class_3, True, 0, 2),
}

FAMILIES: dict[str, Family] = {
    **{
        f'{kind} {one}–{other}': Family(
            f'a random {kind} dyad; first end on the {one} link, second on the {other} link'
            if kind != 'PRP'
            else f'a pin on a line of the {one} link and on one of the {other} link',
            partial(_on_links, kind, (one, other)),
        )
        for kind in DYADS
        for one, other in ENDS
    },
    **{
        f'chain of {count}': Family(
            f'{count} random dyads, each on links before it', partial(_chain, count, 1)
        )
        for count in (2, 3, 4)
    },
    **{
        name: Family(text, partial(make, *given)) for name, (text, make, *given) in _OTHERS.items()
    },
    **{
        f'{name}{place}': Family(text.format(where), partial(_until_it_closes, shape, place))
        for place, where in PLACES.items()
        for name, (text, shape) in _SHAPES.items()
    },
}
