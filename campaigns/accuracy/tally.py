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

"""Millions of errors as histograms and a few worst ones, the same in whatever order they come."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

from campaigns.accuracy.judge import Findings
import numpy as np
import numpy.typing as npt

OCTAVE = 32
"""Bins from one power of two to the next: a percentile is right to 2 %."""

_LOWEST, _HIGHEST = -24, 64
BINS = (_HIGHEST - _LOWEST) * OCTAVE + 2
"""The first has what is less than any other, the last what is more, and what is no number."""

_KEPT = 3


class Worst(NamedTuple):
    """An error with where it was met; the worse sorts first."""

    minus_error: float
    linkage: int
    case: int
    joint: int


class Note(NamedTuple):
    """What else was not as it should be, and where."""

    linkage: int
    case: int
    text: str


def bins_of(errors: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
    """Return the bin of each error."""
    with np.errstate(divide='ignore', invalid='ignore'):
        octaves = np.log2(errors) - _LOWEST
    places = np.floor(np.nan_to_num(octaves * OCTAVE, nan=BINS, posinf=BINS, neginf=-1.0)) + 1
    return np.asarray(np.clip(places, 0, BINS - 1), np.int64)


def edges() -> npt.NDArray[np.float64]:
    """Return the upper end of each bin but the last."""
    return np.asarray(2.0 ** (_LOWEST + np.arange(BINS - 1) / OCTAVE))


@dataclass
class Quantity:
    """The errors of one quantity in one family."""

    histogram: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros(BINS, np.int64))
    worst: list[Worst] = field(default_factory=list)

    def add(self, linkage: int, errors: list[tuple[int, int, float]]) -> None:
        self.histogram += np.bincount(
            bins_of(np.array([error for _, _, error in errors])), minlength=BINS
        )
        self._keep([Worst(-error, linkage, case, joint) for case, joint, error in errors])

    def merge(self, other: Quantity) -> None:
        self.histogram += other.histogram
        self._keep(other.worst)

    def _keep(self, worst: list[Worst]) -> None:
        self.worst = sorted([*self.worst, *worst])[:_KEPT]

    def count(self) -> int:
        return int(self.histogram.sum())

    def greatest(self) -> float:
        """Return the greatest error, in u·κ."""
        return -self.worst[0].minus_error if self.worst else 0.0

    def percentile(self, part: float) -> float:
        """Return what a part of all errors does not exceed, to the width of a bin."""
        place = int(np.searchsorted(np.cumsum(self.histogram), part * self.count()))
        return min(float(edges()[min(place, BINS - 2)]), self.greatest())


@dataclass
class Tally:
    """All that was found in one family."""

    counts: Counter[str] = field(default_factory=Counter)
    quantities: dict[str, Quantity] = field(default_factory=dict)
    notes: list[Note] = field(default_factory=list)

    def add(self, linkage: int, findings: Findings) -> None:
        """Count the findings of one linkage."""
        self.counts += findings.counts
        for quantity, errors in findings.errors.items():
            self.quantities.setdefault(quantity, Quantity()).add(linkage, errors)
        self._keep([Note(linkage, case, text) for case, text in findings.notes])

    def merge(self, other: Tally) -> None:
        """Add what another part of the campaign has found."""
        self.counts += other.counts
        for quantity, found in other.quantities.items():
            self.quantities.setdefault(quantity, Quantity()).merge(found)
        self._keep(other.notes)

    def _keep(self, notes: list[Note]) -> None:
        self.notes = sorted([*self.notes, *notes])[:_KEPT]
