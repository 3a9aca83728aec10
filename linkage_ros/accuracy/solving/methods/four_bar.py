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


"""A four-bar as formulas have it: four lengths, and what leads from their angles to the joints."""

from __future__ import annotations

from cmath import phase, rect
from collections.abc import Callable, Sequence
from math import sqrt
from typing import Any, NamedTuple

from linkage_ros.kinematics.four_bars import four_bars
from linkage_ros.kinematics.groups import find_groups
from linkage_ros.kinematics.linkage import GROUND, Linkage, RevoluteJoint
from linkage_ros.kinematics.structure import Driven


class PlainFourBar(NamedTuple):
    """
    A linkage that is a single four-bar with its crank on the ground.

    Attributes
    ----------
    a, b, c, d
        Lengths of crank, coupler, rocker and ground, in [m].
    side
        1 where the pin of coupler and rocker lies left of what leads from the crank's to the
        ground's, −1 where right.
    turn
        What the input is multiplied by, ±1, to be a crank that turns counter-clockwise.
    offset
        What is added then, to be measured from the line of the ground, in [rad].
    terms
        For each published joint the numbers of two directions and a constant: the first less the
        second, and the constant. The directions are those of ground (0), crank, coupler, rocker.

    """

    a: float
    b: float
    c: float
    d: float
    side: float
    turn: float
    offset: float
    terms: tuple[tuple[int, int, float], ...]

    def joints(self, directions: Sequence[Any]) -> tuple[Any, ...]:
        """Return the published joints of directions, from the line of the ground."""
        return tuple(directions[i] - directions[j] + constant for i, j, constant in self.terms)

    def changes(self, directions: Sequence[Any]) -> tuple[Any, ...]:
        """Return what the published joints' derivatives are, of those of the directions."""
        return tuple(directions[i] - directions[j] for i, j, _ in self.terms)

    def closed_at(self, theta: float) -> tuple[float, float]:
        """
        Return the directions of coupler and rocker at one of the crank, all in [rad].

        By the textbook: good enough to tell a peer once which of the two assemblies is meant.
        """
        crank_pin = rect(self.a, theta)
        across = self.d - crank_pin
        s = abs(across)
        along = 0.5 * (s + (self.b - self.c) * (self.b + self.c) / s)
        aside = self.side * sqrt(max(self.b * self.b - along * along, 0.0))
        coupler = complex(along, aside) * (across / s)
        return phase(coupler), phase(crank_pin + coupler - self.d)


def plain_four_bar(linkage: Linkage) -> PlainFourBar | None:
    """Return a linkage as a four-bar, if it is one and nothing else."""
    structure = find_groups(linkage)
    found = list(four_bars(structure))
    driven = [group for group in structure.groups if isinstance(group, Driven)]
    if len(found) != 1 or len(structure.groups) != 2 or len(driven) != 1 or linkage.sliders:
        return None
    crank, coupler, rocker, ground = found[0].links
    if ground != GROUND or not all(
        isinstance(joint, RevoluteJoint) for joint in linkage.joints.values()
    ):
        return None
    ends: Callable[[str, str], str] = lambda one, other: next(  # noqa: E731  # a word for it
        name for name in linkage.links[one] if name in linkage.links[other]
    )
    pivot, pin = ends(crank, ground), ends(crank, coupler)
    closing, far = ends(coupler, rocker), ends(rocker, ground)

    def facing(link: str, start: str, end: str) -> float:
        points = linkage.links[link]
        return phase(complex(*points[end]) - complex(*points[start]))

    arms = {
        ground: facing(ground, pivot, far),
        crank: facing(crank, pivot, pin),
        coupler: facing(coupler, pin, closing),
        rocker: facing(rocker, far, closing),
    }
    numbers = {link: k for k, link in enumerate(arms)}
    level = arms[ground]
    turn = 1.0 if linkage.inputs[0].child == crank else -1.0
    # The angle of a link is its direction less that of its arm; of the ground it is 0.
    constants = {link: level - arm for link, arm in arms.items()}
    return PlainFourBar(
        *found[0].lengths,
        side=1.0 if linkage.assembly[closing] == 'left' else -1.0,
        turn=turn,
        offset=arms[crank] - level,
        terms=tuple(
            (numbers[j.child], numbers[j.parent], constants[j.child] - constants[j.parent])
            for j in linkage.joints.values()
            if isinstance(j, RevoluteJoint)
        ),
    )
