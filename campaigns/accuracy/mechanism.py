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
A linkage for the reference: links, sliders, and the dyads in the order of solution.

The package finds the dyads from the linkage file's terms. The reference gets them from the
generator of the linkage, so that neither can inherit a mistake from the other.
"""

from __future__ import annotations

from cmath import phase
from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, sin
from typing import Any, NamedTuple, Protocol

from linkage_ros.kinematics.linkage import (
    Input,
    Linkage,
    RevoluteJoint,
    Side,
    SlideJoint,
    Slider,
)

GROUND = 'ground'
CRANK = 'crank'

Key = tuple[str, str, str]
"""Names one real number of a linkage: what it belongs to, which, and its component."""


class Spot(NamedTuple):
    """A point of a link."""

    link: str
    point: str


class Slide(NamedTuple):
    """A point of a link on a line of another; as `linkage_ros.kinematics.linkage.Slider`."""

    point: str
    along: str
    through: str
    direction: tuple[float, float]
    block: str | None = None
    angle: float = 0.0


class Turn(NamedTuple):
    """A published angle: that of the child less that of the parent."""

    parent: str
    child: str


class Dyad(Protocol):
    """Two links, or a link and a virtual block, that one closed form places."""

    @property
    def assembly(self) -> tuple[str, Side] | None: ...

    @property
    def turned(self) -> tuple[str, ...]: ...

    @property
    def slid(self) -> tuple[str, ...]: ...

    @property
    def seen(self) -> tuple[Spot | str, Spot | str]: ...

    def given(self, mechanism: Mechanism) -> tuple[Spot, ...]: ...

    def close(self, motion: Any) -> None: ...

    def vary(self, tangent: Any) -> None: ...

    def margin(self, motion: Any) -> Any: ...


Tie = Mapping[Key, float]
"""What numbers change by, together, per unit of one free relative change."""


@dataclass(frozen=True, slots=True)
class Mechanism:
    """
    A linkage whose crank turns about a pivot of the ground; its angle is the input.

    Attributes
    ----------
    links, sliders
        As in a linkage file.
    dyads
        In the order in which they are solved.
    joints
        The published joint: an angle, or the name of a slider.
    ties
        Where lengths hang together (a parallelogram's), the free ways for them to change; None:
        each number changes by itself.

    """

    links: Mapping[str, Mapping[str, tuple[float, float]]]
    sliders: Mapping[str, Slide]
    dyads: tuple[Dyad, ...]
    joints: Mapping[str, Turn | str]
    ties: tuple[Tie, ...] | None = None

    def linkage(self) -> Linkage:
        """Return it in the package's terms."""
        return Linkage(
            links=self.links,
            inputs=(Input('crank_joint', GROUND, CRANK),),
            assembly=dict(dyad.assembly for dyad in self.dyads if dyad.assembly),
            joints={
                name: SlideJoint(joint) if isinstance(joint, str) else RevoluteJoint(*joint)
                for name, joint in self.joints.items()
            },
            sliders={name: Slider(**slide._asdict()) for name, slide in self.sliders.items()},
        )

    def numbers(self) -> dict[Key, float]:
        """Return all numbers that the linkage is made of."""
        found: dict[Key, float] = {}
        for link, points in self.links.items():
            for point, (x, y) in points.items():
                found[link, point, 'x'], found[link, point, 'y'] = x, y
        for name, slide in self.sliders.items():
            found[name, 'direction', 'x'], found[name, 'direction', 'y'] = slide.direction
            found[name, 'direction', 'angle'] = slide.angle
        return found

    def start(self, slider: str) -> Spot:
        """Return the origin of a slider's line."""
        slide = self.sliders[slider]
        return Spot(slide.along, slide.through)

    def opening(self) -> float:
        """
        Return the angle between what the first dyad sees on the crank and on the ground, at φ = 0.

        Points are seen from the crank's pivot, lines in their direction.
        """
        pivot = next(iter(self.links[CRANK]))
        opening = 1 + 0j
        for seen in self.dyads[0].seen:
            if isinstance(seen, Spot):
                link, points = seen.link, self.links[seen.link]
                vector = complex(*points[seen.point]) - complex(*points[pivot])
            else:
                link, vector = self.sliders[seen].along, complex(*self.sliders[seen].direction)
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
