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
The round trips: pairs of a known linkage, as doubles, and how far the synthesised one is off.

Each linkage has a generator of its own, seeded by the campaign's seed, its family and its number:
what comes out does not depend on how the work was shared, and any linkage can be made again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from random import Random
from typing import NamedTuple

from campaigns.processes import results_of
from campaigns.synthesis.families import Case, draw, FAMILIES
from linkage_ros.synthesis.pairs.freudenstein import three_pairs, TRUSTED
import numpy as np
from numpy.typing import NDArray

_PART = 500
_ROUNDOFF = 2.0**-53


class Part(NamedTuple):
    """Some linkages of a family."""

    seed: int
    family: str
    first: int
    size: int


class Worst(NamedTuple):
    """An error in units of roundoff times sensitivity, and where it was met."""

    error: float
    linkage: int


NONE = Worst(0.0, -1)


@dataclass
class Tally:
    """
    What was found in one family.

    Attributes
    ----------
    cases
        Linkages.
    flagged
        Those of whose lengths no digit was trusted.
    digits
        The sum of the digits trusted, of the least trusted length of each that was not flagged.
    worst
        The greatest error of those not flagged, by the sensitivity that the result came with;
        lengths apart whose second derivatives count for more.
    worst_true
        The same by that of the true linkage, worked out from the loop in balls.
    worst_lost
        The greatest error of all that are not flagged, in what the result said may be lost.
    kappa
        How the first of these sensitivities was to the second, at least and at most.

    """

    cases: int = 0
    flagged: int = 0
    digits: float = 0.0
    worst: Worst = NONE
    worst_true: Worst = NONE
    worst_lost: Worst = NONE
    kappa: tuple[float, float] = (np.inf, 0.0)

    def merge(self, other: Tally) -> None:
        """Add what another part of the campaign has found."""
        self.cases += other.cases
        self.flagged += other.flagged
        self.digits += other.digits
        self.worst = max(self.worst, other.worst)
        self.worst_true = max(self.worst_true, other.worst_true)
        self.worst_lost = max(self.worst_lost, other.worst_lost)
        self.kappa = min(self.kappa[0], other.kappa[0]), max(self.kappa[1], other.kappa[1])


def make(seed: int, family: str, index: int) -> Case:
    """Return a linkage of a family."""
    return draw(FAMILIES[family], Random(f'{seed}/{family}/{index}'))


def judge(cases: list[Case], first: int) -> Tally:
    """Synthesise linkages from their pairs, all at once, and compare."""
    found = three_pairs([case.crank for case in cases], [case.truth.rocker for case in cases])
    off = np.abs(found.lengths - [case.lengths for case in cases])
    kappa = np.array([case.truth.sensitivity for case in cases])
    told = np.flatnonzero((found.digits > 0.0).all(1))
    tally = Tally(len(cases), len(cases) - len(told))
    if len(told):
        off, kappa, said = off[told], kappa[told], found.sensitivity[told]
        lost, numbers = found.lost[told] * np.abs(found.lengths[told]), first + told
        linear = lost < 2.0 * TRUSTED * _ROUNDOFF * said
        tally.digits = float(found.digits[told].min(1).sum())
        tally.worst = _worst(np.where(linear, off / said, 0.0) / _ROUNDOFF, numbers)
        tally.worst_true = _worst(np.where(linear, off / kappa, 0.0) / _ROUNDOFF, numbers)
        tally.worst_lost = _worst(off / lost, numbers)
        tally.kappa = float((said / kappa).min()), float((said / kappa).max())
    return tally


def parts(cases: int, seed: int, families: list[str]) -> list[Part]:
    """Return the work for so many linkages of each family."""
    return [
        Part(seed, family, first, min(_PART, cases - first))
        for family in families
        for first in range(0, cases, _PART)
    ]


def do(part: Part) -> tuple[Part, Tally]:
    """Do one part."""
    numbers = range(part.first, part.first + part.size)
    return part, judge([make(part.seed, part.family, i) for i in numbers], part.first)


def run(
    work: list[Part], jobs: int, progress: Callable[[Part], None] | None = None
) -> dict[str, Tally]:
    """
    Do all parts and return what was found by family.

    Parameters
    ----------
    work
        The parts.
    jobs
        How many processes; 1: this one.
    progress
        Called with each part when it is done.

    """
    tallies: dict[str, Tally] = {part.family: Tally() for part in work}
    for part, tally in results_of(do, work, jobs):
        tallies[part.family].merge(tally)
        if progress is not None:
            progress(part)
    return tallies


def _worst(errors: NDArray[np.float64], numbers: NDArray[np.intp]) -> Worst:
    # A length that is not a number is as wrong as can be.
    each = np.nan_to_num(errors, nan=np.inf).max(1)
    place = int(each.argmax())
    return Worst(float(each[place]), int(numbers[place]))
