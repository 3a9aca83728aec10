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

"""Sliders that are hard, each in its own way."""

from __future__ import annotations

from math import cos, hypot, pi, sin
import random

from campaigns.accuracy.dyads.two_slides import PRP, RPP
from campaigns.accuracy.hard_four_bars import ANGLES, length, side, tiny
from campaigns.accuracy.loops import A, D, inverted_slider_crank, slider_crank
from campaigns.accuracy.mechanism import CRANK, GROUND, Mechanism, Slide, Spot
from campaigns.accuracy.random_families import Case


def swivel_passed_closely(rng: random.Random) -> Case:
    a = length(rng)
    offset = tiny(rng) * a * rng.choice((0, 1))
    loop = inverted_slider_crank((a, a * (1 + tiny(rng)), offset), side(rng))
    return loop, [tiny(rng, -12, -1) for _ in range(ANGLES)]


def rod_through_its_swivel(rng: random.Random) -> Case:
    a = length(rng)
    loop = inverted_slider_crank((a, a, 0.0), side(rng), fold=True, ties=({A: a, D: a},))
    return loop, [tiny(rng, -12, -1) for _ in range(ANGLES)]


def swivel_toggle(rng: random.Random) -> Case:
    a, d, phi = length(rng), length(rng), rng.uniform(-pi, pi)
    s = hypot(d - a * cos(phi), a * sin(phi))
    loop = inverted_slider_crank((a, d, side(rng) * s * (1 + tiny(rng, -15))), side(rng))
    return loop, [phi, *(phi + tiny(rng, -15) for _ in range(4))]


def slider_toggle(rng: random.Random) -> Case:
    a, phi = length(rng), rng.uniform(-pi, pi)
    offset = side(rng) * length(rng)
    b = abs(offset - a * sin(phi)) * (1 + tiny(rng, -15))
    return slider_crank(a, b, offset, side(rng)), [phi, *(phi + tiny(rng, -15) for _ in range(4))]


def axis_through_the_pivot(rng: random.Random) -> Case:
    a = length(rng)
    near = rng.random() < 0.5
    b = a * (1 + tiny(rng) if near else length(rng))
    about = (pi / 2, -pi / 2) if near else (0.0, pi, -pi)
    return slider_crank(a, b, 0.0, side(rng)), [
        rng.choice(about) + tiny(rng) for _ in range(ANGLES)
    ]


def dead_centre(rng: random.Random) -> Case:
    a, b = length(rng), length(rng)
    offset = (b - a) * rng.uniform(-1, 1)
    about = [pi + (offset < 0) * pi, 0.0]
    loop = slider_crank(a, b, offset, side(rng))
    return loop, [rng.choice(about) + tiny(rng) for _ in range(ANGLES)]


def needle_slider_crank(rng: random.Random) -> Case:
    a, phi = length(rng, 6), rng.uniform(-pi, pi)
    offset = rng.choice((0, 1, -1)) * length(rng, 6)
    height = abs(offset - a * sin(phi))
    b = height * (1 + length(rng, 6))
    loop = slider_crank(a, b, offset, side(rng))
    return loop, [phi, *(phi + tiny(rng, -9, 0) for _ in range(ANGLES - 1))]


def needle_swivel(rng: random.Random) -> Case:
    a, d, phi = length(rng, 6), length(rng, 6), rng.uniform(-pi, pi)
    s = hypot(d - a * cos(phi), a * sin(phi))
    offset = rng.choice((0, 1, -1)) * s * min(0.99, length(rng, 6))
    loop = inverted_slider_crank((a, d, offset), side(rng))
    return loop, [phi, *(phi + tiny(rng, -9, 0) for _ in range(ANGLES - 1))]


def lines_almost_parallel(rng: random.Random) -> Case:
    kind = rng.choice((_scotch_yoke, _crossed_slots))
    return kind(rng, tiny(rng)), [rng.uniform(-pi, pi) for _ in range(ANGLES)]


def slots_almost_parallel(rng: random.Random) -> Case:
    loop = _crossed_slots(rng, 0.0)
    return loop, [rng.choice((0.0, pi, -pi)) + tiny(rng) for _ in range(ANGLES)]


def _scotch_yoke(rng: random.Random, small: float) -> Mechanism:
    """Return a yoke along x, whose slot lies almost along x."""
    return Mechanism(
        {
            GROUND: {'O': (0.0, 0.0), 'Q': (length(rng), length(rng))},
            CRANK: {'O': (0.0, 0.0), 'A': (length(rng), 0.0)},
            'yoke': {'C': (0.0, 0.0), 'S': (length(rng), -length(rng))},
        },
        {
            'guide': Slide('C', GROUND, 'Q', (1.0, 0.0), 'yoke'),
            'slot': Slide('A', 'yoke', 'S', (1.0, small)),
        },
        (RPP(Spot(CRANK, 'A'), 'slot', 'guide'),),
        {'yoke_joint': 'guide', 'slot_joint': 'slot'},
    )


def _crossed_slots(rng: random.Random, small: float) -> Mechanism:
    """Return a block along x that stands in a slot along the crank, or almost so."""
    return Mechanism(
        {
            GROUND: {'O': (0.0, 0.0), 'Q': (length(rng), side(rng) * length(rng))},
            CRANK: {'O': (0.0, 0.0), 'S': (length(rng), length(rng))},
            'block': {'B': (0.0, 0.0)},
        },
        {
            'guide': Slide('B', GROUND, 'Q', (1.0, 0.0), 'block'),
            'slot': Slide('B', CRANK, 'S', (1.0, small)),
        },
        (PRP('guide', 'slot', 'B'),),
        {'block_joint': 'guide', 'slot_joint': 'slot'},
    )
