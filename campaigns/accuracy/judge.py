# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Compare the package with the reference for one linkage, and tally the errors of many.

Millions of errors are kept as histograms and a few worst cases. The result does not depend on
their order.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from itertools import product
from math import isfinite, pi
from typing import Any, NamedTuple

from campaigns.accuracy.mechanism import Mechanism, Turn
from campaigns.accuracy.reference import (
    Array,
    condition_numbers,
    is_at_limit,
    Outcome,
    Reference,
    Truth,
)
from campaigns.series import CORRECT, FACTORIALS, UNIT_ROUNDOFF
from flint import arb, ctx
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import Closure, Status
import numpy as np
import numpy.typing as npt

QUANTITIES = ('position', 'velocity', 'acceleration')
FAULTS = ('wrong', 'missed', 'false', 'refused', 'crashed')
AT_TOGGLE = 'position at a toggle'

_SUSPICIOUS = 1000.0
"""In u·κ. A position with a larger error is compared with the other assemblies."""

_BAND = 2.0
"""
In u·κ. For a closed case with a larger error, it is checked whether the case lies at a limit.

κ is a first-order estimate. It holds where rounding changes the distance to a toggle by less than
that distance. Nearer to a toggle a rate has no correct digit, whatever the status.
"""

_LEAST = 2.0**-960
"""Below this κ, u·κ is subnormal."""

Answer = tuple[tuple[float, ...], ...]
"""The package's positions, velocities and accelerations of the published joints."""


@dataclass
class Findings:
    """The results of a linkage's cases."""

    # Number of cases: ``cases``, ``closed``, ``open``, ``at limit``, ``wrong`` (assembly),
    # ``missed``, ``false`` (closures), ``refused`` (regular, but reported as a toggle or
    # indeterminate), ``crashed``.
    counts: Counter[str] = field(default_factory=Counter)
    # For each quantity (case, joint, error in u·κ).
    errors: dict[str, list[tuple[int, int, float]]] = field(default_factory=dict)
    # For each case with a finding its description.
    notes: list[tuple[int, str]] = field(default_factory=list)

    def count(self, case: int, outcome: str, note: str = '') -> None:
        self.counts[outcome] += 1
        if outcome not in {'open', 'at limit'}:
            self.notes.append((case, f'{outcome} {note}'.strip()))


def judge(mechanism: Mechanism, phi: list[float], alpha: list[float]) -> Findings:
    """Compare the package with the reference at input angles φ, at rate 1 and accelerations α."""
    findings = Findings(Counter(cases=len(phi)))
    reference = Reference(mechanism)
    truths = [reference.solve(*case) for case in zip(phi, alpha, strict=True)]
    try:
        closure = Closure(mechanism.linkage())
    except DefinitionError as error:
        for i, truth in enumerate(truths):
            at_limit = truth.outcome is Outcome.SINGULAR or is_at_limit(reference, phi[i])
            closed = truth.outcome is Outcome.CLOSED and not at_limit
            findings.count(i, 'missed' if closed else 'open', str(error))
        return findings
    answers: dict[int, Answer] = {}
    toggles: dict[int, Answer] = {}
    for i, truth in enumerate(truths):
        try:
            status, answer = _ask(closure, phi[i], alpha[i])
        except Exception as error:  # noqa: BLE001 - any exception is counted
            findings.count(i, 'crashed', repr(error))
            continue
        outcome = _compare_status(reference, phi[i], truth, status)
        if outcome == 'closed':
            answers[i] = answer
        elif outcome:
            findings.count(i, outcome, f'{status.name}, in truth {truth.outcome.name}')
            if outcome == 'at limit' and status is Status.TOGGLE and truth.joints and answer[0]:
                toggles[i] = answer
    _measure(findings, reference, truths, phi, alpha, answers, QUANTITIES)
    _measure(findings, reference, truths, phi, alpha, toggles, (AT_TOGGLE,))
    return findings


def _ask(closure: Any, phi: float, alpha: float) -> tuple[Status, Answer]:
    position = closure.position(phi)
    if position.status is not Status.CLOSED:
        return position.status, (position.joints,)
    velocity = closure.velocity(position, 1.0)
    acceleration = closure.acceleration(position, velocity, alpha)
    return position.status, (position.joints, velocity.joints, acceleration.joints)


def _compare_status(reference: Reference, phi: float, truth: Truth, status: Status) -> str:
    """Return the outcome of a comparison, a key of `Findings.counts`."""
    if truth.outcome is Outcome.CLOSED and status is Status.CLOSED:
        return 'closed'
    if truth.outcome is Outcome.OPEN and status is Status.OPEN:
        return 'open'
    if truth.outcome is Outcome.SINGULAR or is_at_limit(reference, phi):
        return 'at limit'
    if truth.outcome is Outcome.OPEN:
        return 'false'
    return 'missed' if status is Status.OPEN else 'refused'


def _measure(
    findings: Findings,
    reference: Reference,
    truths: list[Truth],
    phi: list[float],
    alpha: list[float],
    answers: dict[int, Answer],
    quantities: tuple[str, ...],
) -> None:
    for i, answer in answers.items():
        condition = np.maximum(condition_numbers(truths[i]), _LEAST)
        count = len(quantities)
        off, width, zero = _differences(reference, truths[i], answer)
        # A published angle counts its turns, and is rounded relative to its size.
        for j, joint in enumerate(reference.mechanism.joints.values()):
            if isinstance(joint, Turn):
                condition[j, 0] += max(0.0, abs(answer[0][j]) - pi)
        # The κ of a joint that does not move is 0, but its terms are not 0 and are rounded.
        condition[zero] = np.maximum(condition[zero], 1.0)
        while not (width <= CORRECT * condition)[:, :count].all():
            truths[i] = reference.solve(phi[i], alpha[i], 2 * truths[i].precision)
            off, width, zero = _differences(reference, truths[i], answer)
        errors = off[:, :count] / (UNIT_ROUNDOFF * condition[:, :count])
        errors[off[:, :count] == 0.0] = 0.0
        errors[np.isnan(errors)] = np.inf
        if errors[:, 0].max() > _SUSPICIOUS and _is_other_assembly(
            reference, phi[i], alpha[i], answer, off[:, 0].max()
        ):
            findings.count(i, 'wrong')
            continue
        named = quantities
        if errors.max() > _BAND and named is QUANTITIES and is_at_limit(reference, phi[i]):
            findings.count(i, 'at limit')
            named = (AT_TOGGLE,)
        findings.counts['closed' if named is QUANTITIES else 'toggles'] += 1
        for k, quantity in enumerate(named):
            findings.errors.setdefault(quantity, []).extend(
                (i, j, error) for j, error in enumerate(errors[:, k].tolist())
            )


def _differences(reference: Reference, truth: Truth, answer: Answer) -> tuple[Array, Array, Array]:
    """Return the errors of an answer, the widths of the truth, and whether the truth may be 0."""
    ctx.prec = truth.precision
    unit = arb(2) ** -truth.motion.exponent
    off = np.zeros((len(truth.joints), 3))
    width = np.zeros((len(truth.joints), 3))
    zero = np.zeros((len(truth.joints), 3), bool)
    joints = reference.mechanism.joints.values()
    for j, (joint, value) in enumerate(zip(joints, truth.joints, strict=True)):
        turns = isinstance(joint, Turn)
        for k, numbers in enumerate(answer):
            if not isfinite(numbers[j]):
                off[j, k] = np.inf
                continue
            exact = value[k]
            answered = arb(numbers[j]) / FACTORIALS[k]
            difference = exact - (answered if turns else answered * unit)
            if turns and k == 0 and abs(float(difference)) > 3.0:
                nearest = round(float(difference) / (2 * pi))
                difference -= 2 * nearest * arb.pi()
            off[j, k] = abs(float(difference)) * FACTORIALS[k]
            width[j, k] = float(exact.rad()) * FACTORIALS[k]
            zero[j, k] = exact == 0 or exact.contains(0)
    return off, width, zero


def _is_other_assembly(
    reference: Reference, phi: float, alpha: float, answer: Answer, off: float
) -> bool:
    dyads: tuple[Any, ...] = reference.mechanism.dyads
    flippable = [(1, -1) if dyad.assembly else (1,) for dyad in dyads]
    for signs in list(product(*flippable))[1:]:
        flipped = tuple(
            replace(dyad, side=-dyad.side) if sign < 0 else dyad
            for sign, dyad in zip(signs, dyads, strict=True)
        )
        other = Reference(replace(reference.mechanism, dyads=flipped))
        truth = other.solve(phi, alpha)
        if truth.outcome is Outcome.CLOSED:
            errors, _, _ = _differences(other, truth, answer)
            if errors[:, 0].max() < off / _SUSPICIOUS:
                return True
    return False


OCTAVE = 32
"""Bins from one power of two to the next: a percentile is right to 2 %."""

_LOWEST, _HIGHEST = -24, 64
BINS = (_HIGHEST - _LOWEST) * OCTAVE + 2
"""The first bin has all smaller errors, the last one all larger errors and NaN."""

_KEPT = 3


class Worst(NamedTuple):
    """An error and its place; the worst sorts first."""

    minus_error: float
    linkage: int
    case: int
    joint: int


class Note(NamedTuple):
    """Another fault and its place."""

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


@dataclass
class Tally:
    """The findings for one family."""

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
        """Add the findings of another part of the campaign."""
        self.counts += other.counts
        for quantity, errors in other.quantities.items():
            self.quantities.setdefault(quantity, Quantity()).merge(errors)
        self._keep(other.notes)

    def _keep(self, notes: list[Note]) -> None:
        self.notes = sorted([*self.notes, *notes])[:_KEPT]
