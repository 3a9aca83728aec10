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

"""Random linkages: one dyad of each type on a crank, and chains of three."""

from __future__ import annotations

from collections.abc import Callable
from math import pi
import random

from campaigns.accuracy.builder import Builder
from campaigns.accuracy.mechanism import CRANK, GROUND, Mechanism, Spot
from campaigns.accuracy.random_dyads import add_prp, add_rpp, add_rpr, add_rrp, add_rrr

Case = tuple[Mechanism, list[float]]
"""A linkage and the input angles to solve it at."""

DYADS = ('RRR', 'RRP', 'RPR', 'PRP', 'RPP')

ANGLES = 50
"""How many input angles each linkage is solved at."""


def _random_dyad(kind: str) -> Callable[[random.Random], Case]:
    def family(rng: random.Random) -> Case:
        build = start(rng, rng.uniform(-pi, pi))
        add_random(build, kind, CRANK, GROUND, first=True)
        return build.mechanism(), crank_angles(rng, build.phi)

    return family


def _chain(kinds: tuple[str, str, str] | None) -> Callable[[random.Random], Case]:
    def family(rng: random.Random) -> Case:
        build = start(rng, rng.uniform(-pi, pi))
        latest, earlier = [CRANK], [GROUND]
        for i in range(3):
            kind = rng.choice(DYADS) if kinds is None else kinds[i]
            known, other = rng.choice(latest), GROUND
            if rng.random() < 0.3:
                other = rng.choice(earlier)
            links = add_random(build, kind, known, other, first=i == 0)
            earlier, latest = [*earlier, *latest], links
        return build.mechanism(), crank_angles(rng, build.phi)

    return family


RANDOM: dict[str, tuple[float, Callable[[random.Random], Case]]] = {
    **{kind: (1.4, _random_dyad(kind)) for kind in DYADS},
    'RRR-RRR-RRR': (1.0, _chain(('RRR', 'RRR', 'RRR'))),
    'any three': (2.0, _chain(None)),
}
"""For each family its share of the cases and how one linkage is made."""


def crank_angles(rng: random.Random, phi: float) -> list[float]:
    """Return angles over two turns, and as many about one where the linkage closes."""
    near = [phi + rng.gauss(0.0, 0.3) for _ in range(ANGLES // 2)]
    return [rng.uniform(-2 * pi, 2 * pi) for _ in range(ANGLES - len(near))] + near


def start(rng: random.Random, phi: float, plain: bool | None = None) -> Builder:
    """Return a linkage in the making whose frames are plain, or anywhere, or either."""
    return Builder(rng, phi, rng.random() < 0.5 if plain is None else plain)


def add_random(build: Builder, kind: str, known: str, other: str, first: bool) -> list[str]:
    """Add a random dyad of a type between two links; the first one has a crank made for it."""
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
