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

"""Random dyads of every type, put onto links that are placed. Each returns its new links."""

from __future__ import annotations

from dataclasses import replace

from campaigns.accuracy.builder import Builder
from campaigns.accuracy.dyads.rpr import RPR
from campaigns.accuracy.dyads.rrp import RRP
from campaigns.accuracy.dyads.rrr import RRR
from campaigns.accuracy.dyads.two_slides import PRP, RPP
from campaigns.accuracy.mechanism import polar, Spot, Turn
from flint import arb

_LEAST_SINE = 0.05
"""Of the angle between the two lines of a dyad, in its pose."""


def add_rrr(
    build: Builder,
    a: Spot,
    d: Spot,
    pin: complex | None = None,
    *,
    fold: bool = False,
    stretch: bool = False,
) -> list[str]:
    """Add two links pinned together, at a given place or a random one."""
    start, end = build.where(a), build.where(d)
    where = start + polar(build.length(), build.direction()) if pin is None else pin
    name = build.name('B')
    one = build.link('link', {a.point: start, name: where})
    two = build.link('link', {d.point: end, name: where})
    side = 1 if _cross(end - start, where - start) > 0 else -1
    dyad = RRR(one, two, a, d, name, 1, fold, stretch)
    # The side that is told is the one for 0 < φ < π.
    dyad = replace(dyad, side=side * dyad.side_at(arb(build.phi)))
    build.add(dyad, Turn(build.parent(), one), Turn('ground', two))
    return [one, two]


def add_rrp(build: Builder, a: Spot, along: str) -> list[str]:
    """Add a link whose far pin a slider, with or without a block, keeps on a line."""
    start = build.where(a)
    where = start + polar(build.length(), build.direction())
    line = _line(build, along)
    pin = build.name('B')
    one = build.link('link', {a.point: start, pin: where})
    links, block, point, on_line = [one], None, pin, where
    if build.rng.random() < 0.5:
        block, point, on_line = _block(build, pin, where, along)
        links.append(block)
    through = build.name('Q')
    build.put(along, through, on_line - line * build.length() * build.rng.choice((1, -1)))
    slider = build.slide(line, along, through, point, block)
    side = 1 if ((where - start) * line.conjugate()).real > 0 else -1
    build.add(RRP(one, a, pin, slider, side), Turn(build.parent(), one), slider)
    return links


def add_rpr(build: Builder, a: Spot, d: Spot) -> list[str]:
    """Add a rod, straight or bent, that slides through a swivel."""
    start, end = build.where(a), build.where(d)
    straight = build.rng.random() < 0.4
    line = polar(1.0, build.direction())
    if straight:
        line = (end - start) / abs(end - start) * build.rng.choice((1, -1))
    rail = build.link('rail', {a.point: start}, axis=line)
    links, block, point, on_line = [rail], None, d.point, end
    if build.rng.random() < 0.5:
        block, point, on_line = _block(build, d.point, end, rail)
        links.append(block)
    through = a.point
    if not (straight and build.plain):
        through = build.name('Q')
        build.put(rail, through, on_line - line * build.length() * build.rng.choice((1, -1)))
    elif block is not None:
        # A block that stands beside its pin would move the line off the swivel.
        point = d.point
    slider = build.slide(line, rail, through, point, block)
    side = 1 if ((end - start) * line.conjugate()).real > 0 else -1
    build.add(RPR(rail, a, d, slider, side), Turn(build.parent(), rail), slider)
    return links


def add_prp(build: Builder, known: str, other: str) -> list[str]:
    """Add a block on each of two lines, pinned together; the second block may be virtual."""
    where = polar(build.length(), build.direction())
    pin = build.name('B')
    links, sliders = [], []
    line = 0j
    for i, along in enumerate((known, other)):
        line = _line(build, along, line)
        block, point, on_line = None, pin, where
        if i == 0 or build.rng.random() < 0.5:
            block, point, on_line = _block(build, pin, where, along)
            links.append(block)
        through = build.name('Q')
        build.put(along, through, on_line - line * build.length() * build.rng.choice((1, -1)))
        sliders.append(build.slide(line, along, through, point, block))
    build.add(PRP(sliders[0], sliders[1], pin), *sliders)
    return links


def add_rpp(build: Builder, a: Spot, along: str) -> list[str]:
    """Add a yoke on a line, and in its slot a pin or a block."""
    start = build.where(a)
    guide = build.where(build.spot(along)) + polar(build.length(), build.direction())
    line = _line(build, along)
    yoke_point, through = build.name('C'), build.name('Q')
    yoke = build.link('yoke', {yoke_point: guide}, axis=build.axis(along))
    build.put(along, through, guide - line * build.length())
    outer = build.slide(line, along, through, yoke_point, yoke)
    links, block, point, on_line = [yoke], None, a.point, start
    if build.rng.random() < 0.5:
        block, point, on_line = _block(build, a.point, start, yoke)
        links.append(block)
    slot = _line(build, along, line)
    if build.plain and build.rng.random() < 0.5:
        slot = line * 1j
    start_of_slot = build.name('Q')
    build.put(yoke, start_of_slot, on_line - slot * build.length() * build.rng.choice((1, -1)))
    inner = build.slide(slot, yoke, start_of_slot, point, block)
    build.add(RPP(a, inner, outer), inner, outer)
    return links


def _block(build: Builder, pin: str, where: complex, along: str) -> tuple[str, str, complex]:
    """Add a block; return it, its point on the line, and where that is."""
    axis = build.axis(along)
    if build.rng.random() < 0.5:
        return build.link('block', {pin: where}, axis=axis), pin, where
    point = build.name('C')
    beside = where + polar(0.3 * build.length(), build.direction())
    return build.link('block', {pin: where, point: beside}, axis=axis), point, beside


def _line(build: Builder, along: str, other: complex = 0j) -> complex:
    """
    Return a direction: that of the x axis of the link, or any; not along another.

    Only the first dyad has lines along axes: two sliders on parallel lines of links that do not
    turn cancel each other, and nothing moves, or nothing can be told.
    """
    line = polar(1.0, build.direction())
    if build.plain and build.is_first() and build.rng.random() < 0.5:
        line = build.axis(along) * build.rng.choice((1, -1))
    return line if abs(_cross(line, other)) > _LEAST_SINE * abs(other) or not other else 1j * line


def _cross(one: complex, other: complex) -> float:
    return (one.conjugate() * other).imag
