# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Results of cases: counts, errors and findings of one linkage, and the tally of many.

Millions of errors are kept as histograms and a few worst cases. The result does not depend on
their order.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

QUANTITIES = ('position', 'velocity', 'acceleration')

OCTAVE = 32
"""Bins from one power of two to the next: a percentile is right to 2 %."""

_LOWEST, _HIGHEST = -24, 64
BINS = (_HIGHEST - _LOWEST) * OCTAVE + 2
"""The first bin has all smaller errors, the last one all larger errors and NaN."""

_KEPT = 3


@dataclass
class Judgement:
    """The results of a linkage's cases."""

    # Number of cases by outcome, and of findings by name.
    counts: Counter[str] = field(default_factory=Counter)
    # For each quantity (case, joint, error in u·κ).
    errors: dict[str, list[tuple[int, int, float]]] = field(default_factory=dict)
    # For the first finding of each name (case, name, description).
    notes: list[tuple[int, str, str]] = field(default_factory=list)

    def find(self, name: str, text: str = '', case: int = 0) -> None:
        """Count a finding; the first of each name is described."""
        if not self.counts[name]:
            self.notes.append((case, name, text))
        self.counts[name] += 1

    def note_errors(self, quantity: str, case: int, errors: Sequence[float]) -> None:
        """Add the errors of a case, joint by joint."""
        self.errors.setdefault(quantity, []).extend(
            (case, joint, error) for joint, error in enumerate(errors)
        )


class Worst(NamedTuple):
    """An error and its place; the worst sorts first."""

    minus_error: float
    linkage: int
    case: int
    joint: int


class Note(NamedTuple):
    """A finding and its place."""

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

    def percentile(self, share: float) -> float:
        """Return the quantile of a share of all errors, to the width of a bin."""
        place = int(np.searchsorted(np.cumsum(self.histogram), share * self.count()))
        return min(float(edges()[min(place, BINS - 2)]), self.greatest())

    def texts(self, share: float) -> tuple[str, str]:
        """Return this quantile and the greatest error as text."""
        return f'{self.percentile(share):.2f}', f'{self.greatest():.3g}'


@dataclass
class Tally:
    """The results of one family."""

    counts: Counter[str] = field(default_factory=Counter)
    quantities: dict[str, Quantity] = field(default_factory=dict)
    # Number of linkages with each finding, and the first of them.
    found_with: Counter[str] = field(default_factory=Counter)
    notes: dict[str, list[Note]] = field(default_factory=dict)

    def add(self, linkage: int, judged: Judgement) -> None:
        """Count the results of one linkage."""
        self.counts += judged.counts
        self.counts['linkages'] += 1
        self.counts['linkages with findings'] += bool(judged.notes)
        for quantity, errors in judged.errors.items():
            self.quantities.setdefault(quantity, Quantity()).add(linkage, errors)
        for case, name, text in judged.notes:
            self.found_with[name] += 1
            self._keep(name, [Note(linkage, case, text)])

    def merge(self, other: Tally) -> None:
        """Add the results of another part of the campaign."""
        self.counts += other.counts
        self.found_with += other.found_with
        for quantity, errors in other.quantities.items():
            self.quantities.setdefault(quantity, Quantity()).merge(errors)
        for name, notes in other.notes.items():
            self._keep(name, notes)

    def _keep(self, name: str, notes: Sequence[Note]) -> None:
        self.notes[name] = sorted([*self.notes.get(name, []), *notes])[:_KEPT]

    def findings(self) -> list[tuple[str, Note]]:
        """Return the kept findings, each with its name."""
        return [(name, note) for name, notes in self.notes.items() for note in notes]
