# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A linkage for the reference: links, sliders, and the dyads in the order of solution.

The package derives the dyads from the linkage file. The reference gets them from the generator of
the linkage, so that neither can inherit a mistake from the other.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, sin
from typing import Any, ClassVar, NamedTuple

from linkage_ros.kinematics import (
    GROUND,
    Input,
    Linkage,
    RevoluteJoint,
    Side,
    SlideJoint,
    Slider,
)

CRANK = 'crank'

Key = tuple[str, str, str]
"""Names one real number of a linkage: its link or slider, its point, and its component."""


class Spot(NamedTuple):
    """A point of a link."""

    link: str
    point: str


class Dyad:
    """
    Two links, or a link and a virtual block, placed by one closed form.

    Its class names the fields that say what it joins and what it passes on.
    """

    __slots__ = ()

    side: int  # Of dyads with two assemblies: +1 or -1
    CLOSING: ClassVar[tuple[str, Side, Side] | None] = None  # The field, and its two sides
    TURNED: ClassVar[tuple[str, ...]] = ()  # Links whose angles it computes
    SLID: ClassVar[tuple[str, ...]] = ()  # Sliders that place a block
    ENDS: ClassVar[tuple[str, str]] = ('a', 'd')  # What joins it to placed links

    @property
    def assembly(self) -> tuple[str, Side] | None:
        if self.CLOSING is None:
            return None
        closing, ahead, behind = self.CLOSING
        return getattr(self, closing), ahead if self.side > 0 else behind

    @property
    def turned(self) -> tuple[str, ...]:
        return tuple(getattr(self, field) for field in self.TURNED)

    @property
    def slid(self) -> tuple[str, ...]:
        return tuple(getattr(self, field) for field in self.SLID)

    @property
    def ends(self) -> tuple[Spot | str, ...]:
        return tuple(getattr(self, field) for field in self.ENDS)

    def given(self, mechanism: Mechanism) -> tuple[Spot, ...]:
        return tuple(end if isinstance(end, Spot) else mechanism.start(end) for end in self.ends)

    def close(self, motion: Any) -> None:
        """Place the links."""
        raise NotImplementedError

    def margin(self, motion: Any) -> Any:
        """
        Return the distance to the toggle, in the constants' unit, negative if open.

        Of two sliders it is the sine of the angle between the lines.
        """
        raise NotImplementedError


Tie = Mapping[Key, float]
"""The changes of dependent numbers per unit of one relative change."""


@dataclass(frozen=True, slots=True)
class Mechanism:
    """A linkage whose crank turns about a pivot of the ground; its angle is the input."""

    # As in a linkage file.
    links: Mapping[str, Mapping[str, tuple[float, float]]]
    sliders: Mapping[str, Slider]
    dyads: tuple[Dyad, ...]  # In the order in which they are solved
    joints: Mapping[str, RevoluteJoint | SlideJoint]
    # For dependent lengths, as in a parallelogram, their independent changes; None: each number
    # changes independently.
    ties: tuple[Tie, ...] | None = None

    def linkage(self) -> Linkage:
        """Return the linkage in the package's terms."""
        return Linkage(
            links=self.links,
            inputs=(Input('crank_joint', GROUND, CRANK),),
            assembly=dict(dyad.assembly for dyad in self.dyads if dyad.assembly),
            joints=self.joints,
            sliders=self.sliders,
        )

    def numbers(self) -> dict[Key, float]:
        """Return all numbers of the linkage."""
        numbers: dict[Key, float] = {}
        for link, points in self.links.items():
            for point, (x, y) in points.items():
                numbers[link, point, 'x'], numbers[link, point, 'y'] = x, y
        for name, slide in self.sliders.items():
            numbers[name, 'direction', 'x'], numbers[name, 'direction', 'y'] = slide.direction
            numbers[name, 'direction', 'angle'] = slide.angle
        return numbers

    def start(self, slider: str) -> Spot:
        """Return the origin of a slider's line."""
        slide = self.sliders[slider]
        return Spot(slide.along, slide.through)

    def passed_pins(self) -> frozenset[str | Spot]:
        """Return what later dyads take from a dyad: the pins of links, and points of links."""
        if len(self.dyads) < 2:
            return frozenset()
        links = [link for link in self.links if link not in {GROUND, CRANK}]
        spots = {spot for dyad in self.dyads[1:] for spot in dyad.given(self)}
        return frozenset([*links, *(spot for spot in spots if spot.link != GROUND)])

    def opening(self) -> float:
        """
        Return the angle between the first dyad's ends on the crank and on the ground, at φ = 0.

        The direction of a point is that from the crank's pivot; a line has its own.
        """
        pivot = next(iter(self.links[CRANK]))
        opening = 1 + 0j
        for end in self.dyads[0].ends:
            if isinstance(end, Spot):
                link, points = end.link, self.links[end.link]
                vector = complex(*points[end.point]) - complex(*points[pivot])
            else:
                link, vector = self.sliders[end].along, complex(*self.sliders[end].direction)
            opening *= vector if link == CRANK else vector.conjugate()
        return phase(opening)

    def size(self) -> float:
        """Return the sum of the distances of each link's points from its first."""
        total = 0.0
        for points in self.links.values():
            (x0, y0), *rest = points.values()
            total += sum(abs(complex(x - x0, y - y0)) for x, y in rest)
        return total


def polar(length: float, angle: float) -> complex:
    """Return a vector by length and direction."""
    return complex(length * cos(angle), length * sin(angle))
