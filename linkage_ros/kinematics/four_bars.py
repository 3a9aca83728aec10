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


"""The four-bars that a linkage is made of, wholly or in part."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

from linkage_ros.kinematics.grashof import four_bar_type, FourBarType
from linkage_ros.kinematics.linkage import GROUND
from linkage_ros.kinematics.structure import Driven, Dyad, Structure


class FourBar(NamedTuple):
    """
    A loop of four links and four pins: a dyad on two links that are pinned together.

    Attributes
    ----------
    group
        Number of the dyad among the groups.
    links
        Input, coupler, output and frame: the frame is the link that is known first.
    lengths
        Theirs between the pins, in this order, in [m].
    kind
        After Grashof, as seen from the frame.

    """

    group: int
    links: tuple[str, str, str, str]
    lengths: tuple[float, float, float, float]
    kind: FourBarType


def four_bars(structure: Structure) -> Iterator[FourBar]:
    """Yield the four-bars of a linkage, in the order in which they are solved."""
    known = [GROUND]
    for number, group in enumerate(structure.groups):
        if isinstance(group, Dyad):
            found = _four_bar(structure, known, number, group)
            if found is not None:
                yield found
            known += [link for body in group.bodies for link in body]
        elif isinstance(group, Driven):
            known.append(group.joint.link)
        else:
            known += group.links


def _four_bar(structure: Structure, known: list[str], number: int, dyad: Dyad) -> FourBar | None:
    if dyad.kind != 'RRR' or any(len(body) > 1 for body in dyad.bodies):
        return None
    start, end = (outer.name for outer in dyad.outer)
    links = structure.links
    frames = [link for link in known if end in links[link]]
    arms = [link for link in known if start in links[link]]
    for frame, arm in product(frames, arms):
        pivots = set(links[frame]) & set(links[arm]) - {start, end} if frame != arm else set()
        if not pivots:
            continue
        pivot = min(pivots)
        closing = dyad.inner.name
        ((coupler,), (output,)) = dyad.bodies
        lengths = (
            _length(structure, arm, pivot, start),
            _length(structure, coupler, start, closing),
            _length(structure, output, closing, end),
            _length(structure, frame, pivot, end),
        )
        kind = four_bar_type(*lengths)
        return FourBar(number, (arm, coupler, output, frame), lengths, kind)
    return None


def _length(structure: Structure, link: str, one: str, other: str) -> float:
    points = structure.links[link]
    return abs(complex(*points[one]) - complex(*points[other]))
