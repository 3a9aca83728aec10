# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The type of a four-bar, from its four lengths, and the four-bars in a linkage."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from math import fsum
from typing import NamedTuple

from linkage_ros.kinematics.arithmetic import exact_sum
from linkage_ros.kinematics.plane.linkage import GROUND
from linkage_ros.kinematics.plane.topology import Dyad, links_of, Structure

NEARLY = 2e-3
"""Largest relative difference of two lengths that were meant to be equal: a rounded digit."""

# In the order of the shortest link, or of the longest: input, coupler, output, frame.
GRASHOF = (
    ('GCRR', 'crank-rocker'),
    ('GRCR', 'double rocker (the coupler turns fully)'),
    ('GRRC', 'rocker-crank'),
    ('GCCC', 'double crank (drag link)'),
)
TRIPLE_ROCKERS = (
    ('RRR2', 'triple rocker, the input is longest'),
    ('RRR3', 'triple rocker, the coupler is longest'),
    ('RRR4', 'triple rocker, the output is longest'),
    ('RRR1', 'triple rocker, the frame is longest'),
)
CHANGE_POINTS = (
    ('SCRR', 'change-point crank-rocker'),
    ('SRCR', 'change-point double rocker'),
    ('SRRC', 'change-point rocker-crank'),
    ('SCCC', 'change-point double crank'),
)


class Paired(NamedTuple):
    """A four-bar whose lengths are equal in pairs, or nearly."""

    name: str  # parallelogram, kite or rhombus
    deviation: float  # Largest difference within a pair, in the unit of the lengths
    crosses: tuple[bool, bool]  # Whether its dyad changes its side where it folds and stretches


class FourBarType(NamedTuple):
    """The type of a four-bar, after Grashof and Barker."""

    # Barker's code: G Grashof, S change point; then C crank or R rocker for input, coupler and
    # output. RRR1 to RRR4 are triple rockers, by the longest link.
    code: str
    name: str  # The name in words
    # Sum of the other two links minus the sum of the shortest and the longest, in the unit of the
    # lengths; 0 at a change point.
    margin: float


def four_bar_type(a: float, b: float, c: float, d: float) -> FourBarType:
    """
    Return the type of a four-bar.

    F. Grashof (Theoretische Maschinenlehre, vol. 2, 1883): some link turns fully relative to the
    others if the shortest and the longest together are no longer than the other two. The fourteen
    names are those of C. R. Barker, A complete classification of planar four-bar linkages,
    Mechanism and Machine Theory 20 (1985) 535-554; R. L. Norton, Design of Machinery, ch. 2, lists
    them. Lengths count as equal if they differ only by their rounding.

    Two shortest or two longest links cause no doubt: they make one of the inequalities impossible;
    at a change point they come in pairs.

    a, b, c and d are the lengths of input, coupler, output and frame, above 0. The type has no
    code if one link is longer than the others together: there is no loop.
    """
    sides = (a, b, c, d)
    shortest, p, q, longest = sorted(sides)
    excess = exact_sum(p, q, -shortest, -longest)
    if fsum((shortest, p, q, -longest)) < 0.0 and exact_sum(shortest, p, q, -longest):
        return FourBarType('', 'no loop (one link is longer than the others together)', excess)
    nearly = nearly_paired(*sides)
    almost = f'{nearly.name} to within {nearly.deviation:.2g} m; else a ' if nearly else ''
    if excess:
        code, name = (
            GRASHOF[sides.index(shortest)]
            if excess > 0.0
            else TRIPLE_ROCKERS[sides.index(longest)]
        )
        return FourBarType(code, almost + name, excess)
    opposite = exact_sum(a, -c) == exact_sum(b, -d) == 0.0
    beside = (
        exact_sum(a, -b) == exact_sum(c, -d) == 0.0 or exact_sum(a, -d) == exact_sum(b, -c) == 0.0
    )
    if opposite and beside:
        return FourBarType('S3X', 'rhombus (change point, all links equal)', 0.0)
    if opposite:
        return FourBarType('S2X', 'parallelogram (change point)', 0.0)
    if beside:
        return FourBarType('S2X', 'kite (change point)', 0.0)
    return FourBarType(*CHANGE_POINTS[sides.index(shortest)], 0.0)


def nearly_equal(first: float, second: float) -> bool:
    """Return whether two lengths are equal up to a rounded digit."""
    return abs(first - second) <= NEARLY * max(first, second)


def nearly_paired(a: float, b: float, c: float, d: float) -> Paired | None:
    """
    Return the parallelogram, kite or rhombus that a four-bar nearly is, or None.

    None too if the lengths make a change point exactly: then these lengths were meant.
    """
    exact = (exact_sum(b, c, -a, -d), exact_sum(max(a, d), -min(a, d), -max(b, c), min(b, c)))
    if 0.0 in exact:
        return None
    opposite, beside, across = ((a, c), (b, d)), ((a, b), (c, d)), ((a, d), (b, c))
    pairings = [
        pair for pair in (opposite, beside, across) if all(nearly_equal(p, q) for p, q in pair)
    ]
    if not pairings:
        return None
    name = 'parallelogram' if pairings[0] is opposite else 'kite'
    deviation = max(abs(p - q) for p, q in pairings[0])
    if len(pairings) > 1:
        name, deviation = 'rhombus', max(a, b, c, d) - min(a, b, c, d)
    return Paired(name, deviation, (True, pairings[0] is not across))


class FourBarLengths(NamedTuple):
    """A loop of four links and four pins: a dyad on two links that are pinned together."""

    group: int  # Number of the dyad among the groups
    # Input, coupler, output and frame; the frame is the link that is known first.
    links: tuple[str, str, str, str]
    # Their lengths between the pins, in this order, in [m].
    lengths: tuple[float, float, float, float]
    kind: FourBarType  # Type after Grashof, seen from the frame


def four_bars(structure: Structure) -> Iterator[FourBarLengths]:
    """Yield the four-bars of a linkage, in the order in which they are solved."""
    known = [GROUND]
    for index, group in enumerate(structure.groups):
        if isinstance(group, Dyad):
            four_bar = _four_bar(structure, known, index, group)
            if four_bar is not None:
                yield four_bar
        known += links_of(group)


def _four_bar(
    structure: Structure, known: list[str], number: int, dyad: Dyad
) -> FourBarLengths | None:
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
        a, b, c, d = (
            abs(complex(*links[link][first]) - complex(*links[link][second]))
            for link, first, second in (
                (arm, pivot, start),
                (coupler, start, closing),
                (output, closing, end),
                (frame, pivot, end),
            )
        )
        kind = four_bar_type(a, b, c, d)
        return FourBarLengths(number, (arm, coupler, output, frame), (a, b, c, d), kind)
    return None
