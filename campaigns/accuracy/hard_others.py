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

"""What is hard for linkages of every kind: forced angles, great angles, sizes, and chains."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import pi
import random

from campaigns.accuracy.builder import Builder
from campaigns.accuracy.hard_four_bars import ANGLES, side, tiny
from campaigns.accuracy.mechanism import CRANK, GROUND, polar, Spot
from campaigns.accuracy.random_dyads import add_rpr, add_rrp, add_rrr
from campaigns.accuracy.random_families import add_random, Case, DYADS, start

QUARTERS = (0.0, -0.0, pi / 2, -pi / 2, pi, -pi)


def forced_angles(rng: random.Random) -> Case:
    """Return a four-bar whose links lie along the axes exactly, with the crank at 0."""
    build = Builder(rng, 0.0, plain=True)
    (ax, ay, b, c) = (rng.randrange(-(2**10), 2**10) / 2**9 or 1.0 for _ in range(4))
    build.put(GROUND, 'O', 0j)
    build.add_crank_by_points({'O': 0j, 'A': complex(ax, ay)})
    pin = complex(ax, ay) + b * rng.choice((1, 1j))
    # The rocker along an axis too, or as a triangle of 3, 4 and 5.
    build.put(GROUND, 'D', pin - c * rng.choice((1, 1j, 0.6 + 0.8j)))
    if abs(build.where(Spot(GROUND, 'D')) - complex(ax, ay)) < 1e-3:
        return forced_angles(rng)
    add_rrr(build, Spot(CRANK, 'A'), Spot(GROUND, 'D'), pin)
    return build.mechanism(), [*QUARTERS, *(tiny(rng, -16, -1) for _ in range(4))]


def forced_input(rng: random.Random) -> Case:
    build = start(rng, rng.choice(QUARTERS))
    add_random(build, rng.choice(DYADS), CRANK, GROUND, first=True)
    angles = [q + t for q in QUARTERS for t in (0.0, tiny(rng, -16, -9))]
    return build.mechanism(), angles


def subnormal_input(rng: random.Random) -> Case:
    build = start(rng, 0.0)
    add_random(build, rng.choice(DYADS), CRANK, GROUND, first=True)
    angles = [sign * x for x in (0.0, 5e-324, 1e-310, 2.3e-308, 1e-200) for sign in (1, -1)]
    return build.mechanism(), angles


def wound_crank(rng: random.Random) -> Case:
    build = start(rng, rng.uniform(-pi, pi))
    add_random(build, rng.choice(DYADS), CRANK, GROUND, first=True)
    turns = 2 * pi * 159_154
    return build.mechanism(), [
        build.phi + rng.gauss(0.0, 0.3) + rng.choice((turns, -turns)) for _ in range(ANGLES)
    ]


def scaled(*exponents: int) -> Callable[[random.Random], Case]:
    """Return a generator of linkages whose lengths are times 10 to one of the exponents."""

    def family(rng: random.Random) -> Case:
        build = start(rng, rng.uniform(-pi, pi))
        add_random(build, rng.choice(DYADS), CRANK, GROUND, first=True)
        mechanism = build.mechanism()
        scale = float(f'1e{rng.choice(exponents)}')
        links = {
            link: {point: (x * scale, y * scale) for point, (x, y) in points.items()}
            for link, points in mechanism.links.items()
        }
        angles = [build.phi + rng.gauss(0.0, 0.3) for _ in range(ANGLES)]
        return replace(mechanism, links=links), angles

    return family


def far_frames(rng: random.Random) -> Case:
    """Return a linkage with links whose frames begin a million lengths away."""
    build = Builder(rng, rng.uniform(-pi, pi), plain=False)
    build.offset = 10.0 ** rng.uniform(2, 6)
    add_random(build, rng.choice(DYADS), CRANK, GROUND, first=True)
    return build.mechanism(), [build.phi + rng.gauss(0.0, 0.3) for _ in range(ANGLES)]


def chain_of_needles(rng: random.Random) -> Case:
    build = start(rng, rng.uniform(-pi, pi))
    build.spread = 3.0
    latest = [CRANK]
    for i in range(3):
        latest = add_random(build, rng.choice(DYADS), rng.choice(latest), GROUND, first=i == 0)
    return build.mechanism(), [build.phi + tiny(rng, -9, 0) for _ in range(ANGLES)]


def chain_at_a_toggle(rng: random.Random) -> Case:
    build, latest = _two_dyads(rng)
    a, d = build.spot(rng.choice(latest)), build.spot(GROUND)
    start_pin, end_pin = build.where(a), build.where(d)
    stretched = rng.choice((0.3, 0.7, 1.5, -0.5))
    pin = start_pin + (end_pin - start_pin) * complex(stretched, tiny(rng, -7.5, -2))
    add_rrr(build, a, d, pin)
    return build.mechanism(), [build.phi, *(build.phi + tiny(rng, -15) for _ in range(4))]


def chain_whose_pins_meet(rng: random.Random) -> Case:
    build, latest = _two_dyads(rng)
    a = build.spot(rng.choice(latest))
    d = build.name('D')
    build.put(GROUND, d, build.where(a) + polar(abs(tiny(rng, -9)), build.direction()))
    rng.choice((add_rrr, add_rpr))(build, a, Spot(GROUND, d))
    return build.mechanism(), [build.phi + tiny(rng) for _ in range(5)]


def chain_on_a_parallelogram(rng: random.Random) -> Case:
    """Return dyads that hang on the coupler of a parallelogram, away from its change points."""
    build = start(rng, side(rng) * rng.uniform(0.3, 2.8), plain=True)
    crank = build.crank()
    d = build.length()
    build.put(GROUND, 'D', complex(d, 0))
    links = add_rrr(
        build, crank, Spot(GROUND, 'D'), build.where(crank) + d, fold=True, stretch=True
    )
    add_rrp(build, build.spot(links[0]), rng.choice((GROUND, CRANK)))
    return build.mechanism(), [build.phi + rng.gauss(0, 0.05) for _ in range(ANGLES)]


def _two_dyads(rng: random.Random) -> tuple[Builder, list[str]]:
    build = start(rng, rng.uniform(-pi, pi))
    latest = [CRANK]
    for i in range(2):
        latest = add_random(build, rng.choice(DYADS), rng.choice(latest), GROUND, first=i == 0)
    return build, latest
