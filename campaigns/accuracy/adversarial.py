# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The hard cases, and the difficulty of each.

Single-loop linkages are made from their lengths, with plain frames. There are hard four-bars and
hard sliders, and difficulties that linkages of every kind share: exact angles, large angles, very
large and small lengths, and chains.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import acos, cos, hypot, pi, radians, sin
import random
from typing import NamedTuple

from campaigns.accuracy.dyads import PRP, RPP, RPR, RRP, RRR
from campaigns.accuracy.mechanism import CRANK, Mechanism, polar, Spot, Tie
from campaigns.accuracy.random_families import (
    add_random,
    add_rpr,
    add_rrp,
    add_rrr,
    Builder,
    Case,
    DYADS,
    start,
)
from linkage_ros.kinematics import GROUND, RevoluteJoint, SlideJoint, Slider
import numpy as np

A, B, C, D = ('crank', 'A', 'x'), ('coupler', 'B', 'x'), ('rocker', 'B', 'x'), ('ground', 'D', 'x')
"""Positions of the four lengths of a four-bar."""


def four_bar(
    lengths: tuple[float, float, float, float],
    side: int,
    *,
    fold: bool = False,
    stretch: bool = False,
    ties: tuple[Tie, ...] | None = None,
) -> Mechanism:
    """
    Return a four-bar of crank a, coupler b, rocker c, ground d; +1: B lies left of A→D, -1: right.

    It may pass change points where the crank lies along the ground: fold, stretch. ``ties`` are
    the changes of its dependent lengths.
    """
    a, b, c, d = lengths
    return Mechanism(
        {
            GROUND: {'O': (0.0, 0.0), 'D': (d, 0.0)},
            CRANK: {'O': (0.0, 0.0), 'A': (a, 0.0)},
            'coupler': {'A': (0.0, 0.0), 'B': (b, 0.0)},
            'rocker': {'D': (0.0, 0.0), 'B': (c, 0.0)},
        },
        {},
        (RRR('coupler', 'rocker', Spot(CRANK, 'A'), Spot(GROUND, 'D'), 'B', side, fold, stretch),),
        {
            'coupler_joint': RevoluteJoint(GROUND, 'coupler'),
            'rocker_joint': RevoluteJoint(GROUND, 'rocker'),
        },
        ties,
    )


def slider_crank(a: float, b: float, offset: float, side: int) -> Mechanism:
    """Return crank a and rod b, whose far pin slides along x at an offset from the pivot."""
    return Mechanism(
        {
            GROUND: {'O': (0.0, 0.0), 'Q': (0.0, offset)},
            CRANK: {'O': (0.0, 0.0), 'A': (a, 0.0)},
            'rod': {'A': (0.0, 0.0), 'B': (b, 0.0)},
        },
        {'slide': Slider('B', GROUND, 'Q', (1.0, 0.0))},
        (RRP('rod', Spot(CRANK, 'A'), 'B', 'slide', side),),
        {'rod_joint': RevoluteJoint(GROUND, 'rod'), 'slide_joint': SlideJoint('slide')},
    )


def inverted_slider_crank(
    lengths: tuple[float, float, float],
    side: int,
    *,
    fold: bool = False,
    ties: tuple[Tie, ...] | None = None,
) -> Mechanism:
    """
    Return a crank with a rod that slides through a swivel.

    Its lengths are crank a, ground d to the swivel, and the distance from the crank's pin to the
    rod's line, positive to the left. At +1 the swivel lies ahead of the crank's pin along the rod,
    at -1 behind; with ``fold`` the pins coincide when the crank lies along the ground, and the
    side changes there.
    """
    a, d, offset = lengths
    return Mechanism(
        {
            GROUND: {'O': (0.0, 0.0), 'D': (d, 0.0)},
            CRANK: {'O': (0.0, 0.0), 'A': (a, 0.0)},
            'rod': {'A': (0.0, 0.0), 'Q': (0.0, offset)} if offset else {'A': (0.0, 0.0)},
        },
        {'slide': Slider('D', 'rod', 'Q' if offset else 'A', (1.0, 0.0))},
        (RPR('rod', Spot(CRANK, 'A'), Spot(GROUND, 'D'), 'slide', side, fold),),
        {'rod_joint': RevoluteJoint(GROUND, 'rod'), 'slide_joint': SlideJoint('slide')},
        ties,
    )


ANGLES = 10


def side(rng: random.Random) -> int:
    return rng.choice((1, -1))


def length(rng: random.Random, spread: float = 0.7) -> float:
    return float(10.0 ** rng.uniform(-spread, spread))


def tiny(rng: random.Random, least: float = -12.0, greatest: float = -3.0) -> float:
    """Return a small number of either sign."""
    return side(rng) * float(10.0 ** rng.uniform(least, greatest))


def _reaching(rng: random.Random, a: float, d: float, phi: float) -> tuple[float, float]:
    s = hypot(d - a * cos(phi), a * sin(phi))
    b = s * length(rng)
    return b, abs(s - b) + 2 * min(s, b) * rng.uniform(0.01, 0.99)


def _at_toggle(rng: random.Random, a: float, d: float, phi: float, spread: float) -> Mechanism:
    s = hypot(d - a * cos(phi), a * sin(phi))
    b = s * length(rng, spread)
    off = tiny(rng, -15)
    c = (s + b) * (1 + off) if b > s or rng.random() < 0.5 else (s - b) * (1 + off)
    return four_bar((a, b, c, d), side(rng))


def _scotch_yoke(rng: random.Random, small: float) -> Mechanism:
    """Return a yoke along x, whose slot lies almost along x."""
    return Mechanism(
        {
            GROUND: {'O': (0.0, 0.0), 'Q': (length(rng), length(rng))},
            CRANK: {'O': (0.0, 0.0), 'A': (length(rng), 0.0)},
            'yoke': {'C': (0.0, 0.0), 'S': (length(rng), -length(rng))},
        },
        {
            'guide': Slider('C', GROUND, 'Q', (1.0, 0.0), 'yoke'),
            'slot': Slider('A', 'yoke', 'S', (1.0, small)),
        },
        (RPP(Spot(CRANK, 'A'), 'slot', 'guide'),),
        {'yoke_joint': SlideJoint('guide'), 'slot_joint': SlideJoint('slot')},
    )


def _crossed_slots(rng: random.Random, small: float) -> Mechanism:
    """Return a block on a line along x, in a slot that is parallel to the crank, or almost."""
    return Mechanism(
        {
            GROUND: {'O': (0.0, 0.0), 'Q': (length(rng), side(rng) * length(rng))},
            CRANK: {'O': (0.0, 0.0), 'S': (length(rng), length(rng))},
            'block': {'B': (0.0, 0.0)},
        },
        {
            'guide': Slider('B', GROUND, 'Q', (1.0, 0.0), 'block'),
            'slot': Slider('B', CRANK, 'S', (1.0, small)),
        },
        (PRP('guide', 'slot', 'B'),),
        {'block_joint': SlideJoint('guide'), 'slot_joint': SlideJoint('slot')},
    )


def scaled(exponent: int, rng: random.Random) -> Case:
    """Return a linkage with lengths scaled by 10 to the exponent or its negative."""
    build = start(rng, rng.uniform(-pi, pi))
    add_random(build, rng.choice(DYADS), CRANK, GROUND, first=True)
    mechanism = build.mechanism()
    scale = float(f'1e{rng.choice((-exponent, exponent))}')
    links = {
        link: {point: (x * scale, y * scale) for point, (x, y) in points.items()}
        for link, points in mechanism.links.items()
    }
    angles = [build.phi + rng.gauss(0.0, 0.3) for _ in range(ANGLES)]
    return replace(mechanism, links=links), angles


def _two_dyads(rng: random.Random) -> tuple[Builder, list[str]]:
    build = start(rng, rng.uniform(-pi, pi))
    latest = [CRANK]
    for i in range(2):
        latest = add_random(build, rng.choice(DYADS), rng.choice(latest), GROUND, first=i == 0)
    return build, latest


class Hard(NamedTuple):
    """The difficulty of a case, and a function that makes a linkage with its input angles."""

    difficulty: str
    make: Callable[[random.Random], Case]


ADVERSARIAL: dict[str, Hard] = {}
Maker = Callable[[random.Random], Case]


def family(name: str, difficulty: str) -> Callable[[Maker], Maker]:
    """Return a decorator that adds a family."""

    def add(make: Maker) -> Maker:
        ADVERSARIAL[name] = Hard(difficulty, make)
        return make

    return add


QUARTERS = (0.0, -0.0, pi / 2, -pi / 2, pi, -pi)


@family('textbook divisor', 'Ax = d, to ±1e-9 rad: the textbook formula divides by d − Ax')
def textbook_divisor(rng: random.Random) -> Case:
    d = length(rng)
    a = d * (1.05 + length(rng))
    phi = side(rng) * acos(d / a)
    b, c = _reaching(rng, a, d, phi)
    off = [0.0, 1e-9, -1e-9, *(tiny(rng) for _ in range(ANGLES - 3))]
    return four_bar((a, b, c, d), side(rng)), [phi + small for small in off]


@family(
    'parallelogram',
    'change points at 0 and π, from 1e-3 to 1e-12 rad: two circles that almost coincide',
)
def parallelogram(rng: random.Random) -> Case:
    a, d = length(rng), length(rng)
    ties = ({A: a, C: a}, {B: d, D: d})
    loop = four_bar((a, d, a, d), side(rng), fold=True, stretch=True, ties=ties)
    return loop, [rng.choice((0.0, pi, -pi)) + tiny(rng) for _ in range(ANGLES)]


@family('folded kite', 'a = b, c = d, change points as above: B lies on the crank pivot')
def folded_kite(rng: random.Random) -> Case:
    a, d = length(rng), length(rng)
    ties = ({A: a, B: a}, {C: d, D: d})
    loop = four_bar((a, a, d, d), side(rng), fold=True, stretch=True, ties=ties)
    return loop, [rng.choice((0.0, pi, -pi)) + tiny(rng) for _ in range(ANGLES)]


@family('kite through its pivot', 'a = d, b = c: A passes through D, and the diagonal reverses')
def kite_through_its_pivot(rng: random.Random) -> Case:
    a = length(rng)
    b = a * (0.1 + length(rng))
    ties = ({A: a, D: a}, {B: b, C: b})
    loop = four_bar((a, b, b, a), side(rng), fold=True, ties=ties)
    return loop, [tiny(rng) for _ in range(ANGLES)]


@family('single change point', 'lengths with one change point exactly, 1e-3 to 1e-12 rad from it')
def single_change_point(rng: random.Random) -> Case:
    """Return a four-bar with an exact change point: the sums of its lengths are exact."""
    a, b, d = (rng.randrange(2**16, 2**20) / 2**18 for _ in range(3))
    if a == d or a + d - b <= 0 or b in (a, d):
        return single_change_point(rng)
    if rng.random() < 0.5:
        c, about = a + d - b, pi
        ties = ({A: a, C: a}, {B: b, C: -b}, {D: d, C: d})
        loop = four_bar((a, b, c, d), side(rng), stretch=True, ties=ties)
    else:
        sign = side(rng)
        c, about = b + sign * (a - d), 0.0
        if c <= 0:
            return single_change_point(rng)
        ties = ({A: a, C: sign * a}, {B: b, C: b}, {D: d, C: -sign * d})
        loop = four_bar((a, b, c, d), side(rng), fold=True, ties=ties)
    return loop, [about + tiny(rng) for _ in range(ANGLES)]


@family(
    'almost a change point',
    'lengths and crank 1e-3 to 1e-12 from a change point: both small terms matter',
)
def almost_a_change_point(rng: random.Random) -> Case:
    a, b, d = (length(rng) for _ in range(3))
    about = rng.choice((0.0, pi))
    c = abs(a + d - b) if about else b + side(rng) * (a - d)
    if c < 0.01:
        return almost_a_change_point(rng)
    loop = four_bar((a, b, c * (1 + tiny(rng)), d), side(rng))
    return loop, [about + tiny(rng) for _ in range(ANGLES)]


@family(
    'four-bar toggle',
    '1e-3 to 1e-15 from stretched or folded, on both sides: the root of a difference',
)
def toggle(rng: random.Random) -> Case:
    a, d, phi = length(rng), length(rng), rng.uniform(-pi, pi)
    return _at_toggle(rng, a, d, phi, 1.5), [phi, *(phi + tiny(rng, -15) for _ in range(4))]


@family('four-bar needle', 'length ratios up to 1e12: sums lose the short link')
def needle(rng: random.Random) -> Case:
    a, d, phi = length(rng, 3), length(rng, 3), rng.uniform(-pi, pi)
    if rng.random() < 0.3:
        loop = _at_toggle(rng, a, d, phi, 6.0)
    else:
        s = hypot(d - a * cos(phi), a * sin(phi))
        b = s * length(rng, 6)
        c = abs(s - b) + 2 * min(s, b) * rng.random()
        loop = four_bar((a, b, c, d), side(rng))
    return loop, [phi, *(phi + tiny(rng, -9, 0) for _ in range(ANGLES - 1))]


@family('Freudenstein', 'the source’s design and similar ones: the coupler is 3 % of the crank')
def freudenstein(rng: random.Random) -> Case:
    """Return a four-bar designed for the source's three pairs of angles, or near them."""
    pairs = ((25, 30), (35, 40), (50, 60))
    wander = rng.choice((0.0, 0.1, 3.0))
    cranks, rockers = (
        [radians(pair[i] + rng.uniform(-wander, wander)) for pair in pairs] for i in (0, 1)
    )
    rows = [[cos(r), -cos(c), 1.0] for c, r in zip(cranks, rockers, strict=True)]
    right = [cos(c - r) for c, r in zip(cranks, rockers, strict=True)]
    k1, k2, k3 = np.linalg.solve(rows, right).tolist()
    a, c = 1 / k1, 1 / k2
    square = a * a + c * c + 1 - 2 * a * c * k3
    if a <= 0 or c <= 0 or square <= 0:
        return freudenstein(rng)
    loop = four_bar((a, square**0.5, c, 1.0), side(rng))
    return loop, [*cranks, *(rng.uniform(min(cranks), max(cranks)) for _ in range(ANGLES - 3))]


@family('pins that meet', 'a ≈ d, b ≈ c, φ ≈ 0, to 1e-3 to 1e-12: the diagonal almost vanishes')
def pins_meet(rng: random.Random) -> Case:
    a = length(rng)
    b = a * length(rng)
    lengths = (a, b, b * (1 + tiny(rng)), a * (1 + tiny(rng)))
    # Lengths so near to those of a kite change the side where the kite does.
    loop = four_bar(lengths, side(rng), fold=True)
    return loop, [tiny(rng) for _ in range(ANGLES)]


@family('forced angles', 'links exactly at 0, ±π/2, π: poles of tan and 1/sin, and signed zeros')
def forced_angles(rng: random.Random) -> Case:
    """Return a four-bar whose links lie along the axes exactly, with the crank at 0."""
    build = Builder(rng, 0.0, plain=True)
    (ax, ay, b, c) = (rng.randrange(-(2**10), 2**10) / 2**9 or 1.0 for _ in range(4))
    build.put(GROUND, 'O', 0j)
    build.add_crank_by_points({'O': 0j, 'A': complex(ax, ay)})
    pin = complex(ax, ay) + b * rng.choice((1, 1j))
    # The rocker lies along an axis too, or has the direction of a 3-4-5 triangle.
    build.put(GROUND, 'D', pin - c * rng.choice((1, 1j, 0.6 + 0.8j)))
    if abs(build.where(Spot(GROUND, 'D')) - complex(ax, ay)) < 1e-3:
        return forced_angles(rng)
    add_rrr(build, Spot(CRANK, 'A'), Spot(GROUND, 'D'), pin)
    return build.mechanism(), [*QUARTERS, *(tiny(rng, -16, -1) for _ in range(4))]


@family('forced input', 'the crank at 0, ±π/2, ±π, and within 1e-9 of it')
def forced_input(rng: random.Random) -> Case:
    build = start(rng, rng.choice(QUARTERS))
    add_random(build, rng.choice(DYADS), CRANK, GROUND, first=True)
    angles = [q + t for q in QUARTERS for t in (0.0, tiny(rng, -16, -9))]
    return build.mechanism(), angles


@family('subnormal input', 'the crank at ±0, ±5e-324, ±1e-310')
def subnormal_input(rng: random.Random) -> Case:
    build = start(rng, 0.0)
    add_random(build, rng.choice(DYADS), CRANK, GROUND, first=True)
    angles = [sign * x for x in (0.0, 5e-324, 1e-310, 2.3e-308, 1e-200) for sign in (1, -1)]
    return build.mechanism(), angles


@family('wound crank', '1e6 rad: φ itself has lost ten digits')
def wound_crank(rng: random.Random) -> Case:
    build = start(rng, rng.uniform(-pi, pi))
    add_random(build, rng.choice(DYADS), CRANK, GROUND, first=True)
    turns = 2 * pi * 159_154
    return build.mechanism(), [
        build.phi + rng.gauss(0.0, 0.3) + rng.choice((turns, -turns)) for _ in range(ANGLES)
    ]


@family(
    'swivel passed closely', 'the crank is as long as the ground, to 1e-3 to 1e-12: r² cancels'
)
def swivel_passed_closely(rng: random.Random) -> Case:
    a = length(rng)
    offset = tiny(rng) * a * rng.choice((0, 1))
    loop = inverted_slider_crank((a, a * (1 + tiny(rng)), offset), side(rng))
    return loop, [tiny(rng, -12, -1) for _ in range(ANGLES)]


@family('rod through its swivel', 'a = d exactly: the crank pin passes through the swivel')
def rod_through_its_swivel(rng: random.Random) -> Case:
    a = length(rng)
    loop = inverted_slider_crank((a, a, 0.0), side(rng), fold=True, ties=({A: a, D: a},))
    return loop, [tiny(rng, -12, -1) for _ in range(ANGLES)]


@family('swivel toggle', 'the offset equals the diagonal, to 1e-3 to 1e-15')
def swivel_toggle(rng: random.Random) -> Case:
    a, d, phi = length(rng), length(rng), rng.uniform(-pi, pi)
    s = hypot(d - a * cos(phi), a * sin(phi))
    loop = inverted_slider_crank((a, d, side(rng) * s * (1 + tiny(rng, -15))), side(rng))
    return loop, [phi, *(phi + tiny(rng, -15) for _ in range(4))]


@family('slider-crank toggle', 'the rod is perpendicular to its line, to 1e-3 to 1e-15')
def slider_toggle(rng: random.Random) -> Case:
    a, phi = length(rng), rng.uniform(-pi, pi)
    offset = side(rng) * length(rng)
    b = abs(offset - a * sin(phi)) * (1 + tiny(rng, -15))
    return slider_crank(a, b, offset, side(rng)), [phi, *(phi + tiny(rng, -15) for _ in range(4))]


@family(
    'axis through the pivot',
    'no offset; crank ≈ rod near the pose in which the slider passes the pivot',
)
def axis_through_the_pivot(rng: random.Random) -> Case:
    a = length(rng)
    near = rng.random() < 0.5
    b = a * (1 + tiny(rng) if near else length(rng))
    about = (pi / 2, -pi / 2) if near else (0.0, pi, -pi)
    return slider_crank(a, b, 0.0, side(rng)), [
        rng.choice(about) + tiny(rng) for _ in range(ANGLES)
    ]


@family('dead centre', 'the slider reverses: its rate is a difference')
def dead_centre(rng: random.Random) -> Case:
    a, b = length(rng), length(rng)
    offset = (b - a) * rng.uniform(-1, 1)
    about = [pi + (offset < 0) * pi, 0.0]
    loop = slider_crank(a, b, offset, side(rng))
    return loop, [rng.choice(about) + tiny(rng) for _ in range(ANGLES)]


@family('slider-crank needle', 'length ratios up to 1e12')
def needle_slider_crank(rng: random.Random) -> Case:
    a, phi = length(rng, 6), rng.uniform(-pi, pi)
    offset = rng.choice((0, 1, -1)) * length(rng, 6)
    height = abs(offset - a * sin(phi))
    b = height * (1 + length(rng, 6))
    loop = slider_crank(a, b, offset, side(rng))
    return loop, [phi, *(phi + tiny(rng, -9, 0) for _ in range(ANGLES - 1))]


@family('swivel needle', 'length ratios up to 1e12')
def needle_swivel(rng: random.Random) -> Case:
    a, d, phi = length(rng, 6), length(rng, 6), rng.uniform(-pi, pi)
    s = hypot(d - a * cos(phi), a * sin(phi))
    offset = rng.choice((0, 1, -1)) * s * min(0.99, length(rng, 6))
    loop = inverted_slider_crank((a, d, offset), side(rng))
    return loop, [phi, *(phi + tiny(rng, -9, 0) for _ in range(ANGLES - 1))]


@family('lines almost parallel', 'the two lines of a PRP or RPP at 1e-3 to 1e-12 rad')
def lines_almost_parallel(rng: random.Random) -> Case:
    kind = rng.choice((_scotch_yoke, _crossed_slots))
    return kind(rng, tiny(rng)), [rng.uniform(-pi, pi) for _ in range(ANGLES)]


@family(
    'slots almost parallel', 'the crank turns one slot to within 1e-3 to 1e-12 rad of the other'
)
def slots_almost_parallel(rng: random.Random) -> Case:
    loop = _crossed_slots(rng, 0.0)
    return loop, [rng.choice((0.0, pi, -pi)) + tiny(rng) for _ in range(ANGLES)]


family('lengths × 1e±9', 'any threshold that is a length fails')(partial(scaled, 9))
family('lengths × 1e±150', 'squares and products of lengths overflow or underflow')(
    partial(scaled, 150)
)


@family('far frames', 'frame origins up to a million lengths from the pins: coordinates cancel')
def far_frames(rng: random.Random) -> Case:
    """Return a linkage whose frames have their origins up to a million lengths away."""
    build = Builder(rng, rng.uniform(-pi, pi), plain=False)
    build.offset = 10.0 ** rng.uniform(2, 6)
    add_random(build, rng.choice(DYADS), CRANK, GROUND, first=True)
    return build.mechanism(), [build.phi + rng.gauss(0.0, 0.3) for _ in range(ANGLES)]


@family('chain of needles', 'three dyads, lengths from 1e-3 to 1e3')
def chain_of_needles(rng: random.Random) -> Case:
    build = start(rng, rng.uniform(-pi, pi))
    build.spread = 3.0
    latest = [CRANK]
    for i in range(3):
        latest = add_random(build, rng.choice(DYADS), rng.choice(latest), GROUND, first=i == 0)
    return build.mechanism(), [build.phi + tiny(rng, -9, 0) for _ in range(ANGLES)]


@family(
    'chain at a toggle',
    'the third dyad 1e-4 to 1e-15 from its toggle, with the errors of the first two',
)
def chain_at_a_toggle(rng: random.Random) -> Case:
    build, latest = _two_dyads(rng)
    a, d = build.spot(rng.choice(latest)), build.spot(GROUND)
    start_pin, end_pin = build.where(a), build.where(d)
    stretched = rng.choice((0.3, 0.7, 1.5, -0.5))
    pin = start_pin + (end_pin - start_pin) * complex(stretched, tiny(rng, -7.5, -2))
    add_rrr(build, a, d, pin)
    return build.mechanism(), [build.phi, *(build.phi + tiny(rng, -15) for _ in range(4))]


@family('chain whose pins meet', 'the third dyad’s outer pins 1e-3 to 1e-9 apart')
def chain_whose_pins_meet(rng: random.Random) -> Case:
    build, latest = _two_dyads(rng)
    a = build.spot(rng.choice(latest))
    d = build.name('D')
    build.put(GROUND, d, build.where(a) + polar(abs(tiny(rng, -9)), build.direction()))
    rng.choice((add_rrr, add_rpr))(build, a, Spot(GROUND, d))
    return build.mechanism(), [build.phi + tiny(rng) for _ in range(5)]


@family('chain on a parallelogram', 'a change-point linkage carries another dyad')
def chain_on_a_parallelogram(rng: random.Random) -> Case:
    """Return dyads on the coupler of a parallelogram, away from its change points."""
    build = start(rng, side(rng) * rng.uniform(0.3, 2.8), plain=True)
    crank = build.crank()
    d = build.length()
    build.put(GROUND, 'D', complex(d, 0))
    links = add_rrr(
        build, crank, Spot(GROUND, 'D'), build.where(crank) + d, fold=True, stretch=True
    )
    add_rrp(build, build.spot(links[0]), rng.choice((GROUND, CRANK)))
    return build.mechanism(), [build.phi + rng.gauss(0, 0.05) for _ in range(ANGLES)]
