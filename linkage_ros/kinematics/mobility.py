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


"""Where the crank can turn, of a linkage of one loop."""

from __future__ import annotations

from math import acos, asin, pi, sqrt
from typing import NamedTuple

from linkage_ros.kinematics.assembly import Loop
from linkage_ros.kinematics.dyads.rrr import RRRDyad


class CrankRange(NamedTuple):
    """An interval of crank angles at which the loop closes, in [rad], not wrapped."""

    lowest: float
    highest: float

    def __str__(self) -> str:
        if self.highest - self.lowest >= 2.0 * pi:
            return 'every crank angle'
        return f'{self.lowest:.6g} to {self.highest:.6g} rad'


def crank_ranges(loop: Loop) -> tuple[CrankRange, ...]:
    """
    Return the intervals in which the loop closes; none where it closes nowhere.

    The diagonal s grows with |φ| from |d − a| to a + d. Its limits, |b − c| and b + c for a
    four-bar and |h| for an inverted slider-crank, are met at::

        sin²(φ/2) = (limit² − (d − a)²)/(4ad)        cos²(φ/2) = ((a + d)² − limit²)/(4ad)
    """
    dyad = loop.dyad
    if isinstance(dyad, RRRDyad):
        a, b, c, d = dyad.sides
        lower, upper = abs(b - c), b + c
        stretch = dyad.stretch_margin
    else:
        a, d, offset = dyad.sides
        lower, upper, stretch = abs(offset), float('inf'), float('inf')
    fold = dyad.fold_margin

    lowest, highest = 0.0, pi
    if fold < 0.0:
        square = -fold / a * (lower + abs(d - a)) / d / 4.0
        if square > 1.0:
            return ()
        lowest = 2.0 * asin(sqrt(square))
    if stretch < 0.0:
        square = -stretch / a * (a + d + upper) / d / 4.0
        if square > 1.0:
            return ()
        highest = 2.0 * acos(sqrt(square))

    if lowest == 0.0:
        intervals = [(-highest, highest)]
    elif highest == pi:
        intervals = [(lowest, 2.0 * pi - lowest)]
    else:
        intervals = [(-highest, -lowest), (lowest, highest)]
    return tuple(
        CrankRange(low - loop.crank_offset, high - loop.crank_offset) for low, high in intervals
    )


def describe(ranges: tuple[CrankRange, ...]) -> str:
    """Return crank ranges as a user reads them."""
    return ' or '.join(map(str, ranges))
