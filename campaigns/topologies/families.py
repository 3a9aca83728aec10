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


"""The families: every dyad on every kind of link, chains, inputs of all kinds, and class III."""

from __future__ import annotations

from collections.abc import Callable
import random
from typing import NamedTuple

from campaigns.topologies.change_points import CHANGE_POINTS
from campaigns.topologies.topology import KINDS, Topology, TopologyBuilder
from linkage_ros.kinematics.linkage import GROUND


class Family(NamedTuple):
    """How a linkage is made, and what is tried with it."""

    why: str
    make: Callable[[random.Random], Topology]


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
"""The links that carry the ends of a dyad; of a rail, the first one carries its pin."""


def _input(build: TopologyBuilder, on: str = GROUND) -> str:
    return build.sliding(on) if build.rng.random() < 0.35 else build.turning(on)


def _on_links(kind: str, ends: tuple[str, str]) -> Callable[[random.Random], Topology]:
    def make(rng: random.Random) -> Topology:
        build = TopologyBuilder(rng)
        links = {'ground': [GROUND], 'input': [_input(build)]}
        if 'second input' in ends:
            links['second input'] = [_input(build, rng.choice((GROUND, *links['input'])))]
        if 'moving' in ends:
            links['moving'] = build.dyad(rng.choice(KINDS), links['input'][0], GROUND)
            if ends.count('moving') > 1 and rng.random() < 0.5:
                links['moving'] += build.dyad(rng.choice(KINDS), links['input'][0], GROUND)
        one = rng.choice(links[ends[0]])
        other = rng.choice([link for link in links[ends[1]] if link != one] or [GROUND])
        build.dyad(kind, one, other)
        return build.topology()

    return make


def _chain(count: int, inputs: int = 1) -> Callable[[random.Random], Topology]:
    def make(rng: random.Random) -> Topology:
        build = TopologyBuilder(rng)
        known = [GROUND]
        for _ in range(inputs):
            known.append(_input(build, rng.choice(known)))
        latest = known[1:]
        for _ in range(count):
            one = rng.choice(latest)
            other = rng.choice([link for link in known if link != one])
            kind = rng.choice(KINDS)
            if rng.random() < 0.5:
                one, other = other, one
            latest = build.dyad(kind, one, other)
            known += latest
        return build.topology()

    return make


def _between(inputs: int, chain: int) -> Callable[[random.Random], Topology]:
    def make(rng: random.Random) -> Topology:
        build = TopologyBuilder(rng)
        known = [GROUND]
        between = 1 if inputs == 1 else rng.choice((1, 2))
        known += [_input(build) for _ in range(inputs - between)]
        if len(known) < 2:
            # A link that the other bodies hold: both ends stand on the ground.
            known += build.driven_dyad(GROUND, GROUND, between)
        else:
            known += build.driven_dyad(known[-1], GROUND, between)
        for _ in range(chain):
            one = rng.choice(known[1:])
            other = rng.choice([link for link in known if link != one])
            known += build.dyad(rng.choice(KINDS), one, other)
        return build.topology()

    return make


def _class_3(
    sliders: bool, chain: int = 0, inputs: int = 1
) -> Callable[[random.Random], Topology]:
    def make(rng: random.Random) -> Topology:
        build = TopologyBuilder(rng)
        known = [GROUND]
        add = _input if sliders else TopologyBuilder.turning
        known += [add(build, GROUND) for _ in range(inputs)]
        latest = known[1:]
        for _ in range(chain):
            latest = build.dyad(rng.choice(KINDS), known[1], GROUND)
            known += latest
        legs = [rng.choice(('RR', 'PR', 'RP')) for _ in range(3)] if sliders else ['RR'] * 3
        if sliders and legs.count('RR') == 0:
            legs[0] = 'RR'
        held = [rng.choice(latest), *(GROUND if inputs < 2 else known[-1],), GROUND]
        build.platform(held, legs)
        return build.topology()

    return make


FAMILIES: dict[str, Family] = {
    **{
        f'{kind} {one}–{other}': Family(
            f'a random {kind} dyad; first end on the {one} link, second on the {other} link'
            if kind != 'PRP'
            else f'a pin on a line of the {one} link and on one of the {other} link',
            _on_links(kind, (one, other)),
        )
        for kind in KINDS
        for one, other in ENDS
    },
    **{
        f'chain of {count}': Family(
            f'{count} random dyads, each on links before it', _chain(count)
        )
        for count in (2, 3, 4)
    },
    'two inputs': Family('two inputs that turn or slide, and two dyads', _chain(2, 2)),
    'three inputs': Family('three inputs that turn or slide, and two dyads', _chain(2, 3)),
    'cylinder': Family('an input between moving links, both ends on the ground', _between(1, 0)),
    'cylinder and chain': Family('an input between moving links, and two dyads', _between(1, 2)),
    'cylinder and crank': Family('inputs on the ground and between moving links', _between(2, 1)),
    'three, two between': Family('three inputs, one or two between moving links', _between(3, 1)),
    'class III': Family('a platform on three legs, one on a crank', _class_3(False)),
    'class III sliders': Family('a platform whose legs are links, slots or rails', _class_3(True)),
    'class III chain': Family('a platform with a leg on a dyad', _class_3(True, 1)),
    'class III two inputs': Family(
        'a platform on two inputs and the ground', _class_3(True, 0, 2)
    ),
    **{name: Family(why, make) for name, (why, make) in CHANGE_POINTS.items()},
}
