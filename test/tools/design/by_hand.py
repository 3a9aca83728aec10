# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Four-bars with compass and ruler: circles that meet, and positions that are known from it."""

from cmath import phase, rect
from math import pi, radians

from linkage_ros.tools.design import Assembly, Design, DesignRequest, FourBar

from ...support.four_bar import meeting_point

Lengths = tuple[float, float, float, float]
"""Of crank, coupler, rocker and ground."""


def cross(one: complex, other: complex) -> float:
    return (one.conjugate() * other).imag


def pins(lengths: Lengths, direction: float) -> list[complex] | None:
    """Return where B can be, left of A→O4 first; O2 is the origin and O4 lies on the x axis."""
    a, b, c, d = lengths
    found = [meeting_point(rect(a, direction), d, b, c, side) for side in (1, -1)]
    return None if None in found else found


def on(side: Assembly, lengths: Lengths, direction: float) -> complex:
    """Return where B is on an assembly."""
    found = pins(lengths, direction)
    assert found is not None
    return found[side == 'right']


def design(
    lengths: Lengths,
    positions: list[tuple[float, Assembly]],
    side: Assembly = 'left',
    zeros: tuple[float, float] = (0.0, 0.0),
    ground: float = 0.0,
) -> Design:
    """Return a four-bar that meets (crank [°], assembly); zeros and ground turn its frames."""
    a, b, c, d = lengths
    alpha, beta = zeros
    o2 = 0.3 - 0.2j if ground else 0j
    four_bar = FourBar(
        (o2, o2 + rect(d, ground)), rect(a, alpha), (0j, b + 0j), rect(c, beta), side
    )
    wanted = []
    for angle, where in positions:
        direction = radians(angle)
        rocker = phase(on(where, lengths, direction) - d)
        wanted.append(DesignRequest(direction + ground - alpha, rocker + ground - beta))
    return Design(four_bar, tuple(wanted))


def transmission(lengths: Lengths, direction: float) -> float:
    """Return the acute angle between coupler and rocker."""
    _, _, _, d = lengths
    found = pins(lengths, direction)
    assert found is not None
    angle = abs(phase((rect(lengths[0], direction) - found[0]) / (d - found[0])))
    return min(angle, pi - angle)
