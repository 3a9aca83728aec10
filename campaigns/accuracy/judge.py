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

"""One linkage, solved by the package and by the reference, and by how much they differ."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from itertools import product
from math import isfinite, pi
from typing import Any

from campaigns.accuracy.condition import (
    condition_numbers,
    exact_condition_numbers,
    FACTORIALS,
)
from campaigns.accuracy.limits import is_at_limit, UNIT_ROUNDOFF
from campaigns.accuracy.mechanism import Mechanism, Turn
from campaigns.accuracy.reference import Outcome, Reference, Truth
from campaigns.accuracy.tangent import Array
from flint import arb, ctx
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.status import Status
import numpy as np

QUANTITIES = ('position', 'velocity', 'acceleration')
AT_TOGGLE = 'position at a toggle'

_SUSPICIOUS = 1000.0
"""A position that is off by more, in u·κ, may be that of another assembly: a look is taken."""

_BAND = 2.0
"""
Above this, in u·κ, it is asked whether a closed case lies at a limit.

κ is of first order: it holds where rounding changes what a dyad reaches by less than that is.
Nearer to a toggle a rate has no correct digit, whichever status is told.
"""

_CORRECT = 2.0**-163
"""What the enclosure of a result may be wide, as a part of κ, u being 2⁻⁵³: fifty digits."""

_LEAST = 2.0**-960
"""Below this κ, u·κ is no normal number."""

Answer = tuple[tuple[float, ...], ...]
"""The package's positions, velocities and accelerations of the published joints."""


@dataclass
class Findings:
    """
    What a linkage's cases came to.

    Attributes
    ----------
    counts
        How many cases: ``cases``, ``closed``, ``open``, ``at limit``, ``wrong`` (assembly),
        ``missed``, ``false`` (closures), ``refused`` (regular, but said to be a toggle or
        indeterminate), ``crashed``.
    errors
        For each quantity (case, joint, error in u·κ).
    notes
        For each case that is not as it should be, what.

    """

    counts: Counter[str] = field(default_factory=Counter)
    errors: dict[str, list[tuple[int, int, float]]] = field(default_factory=dict)
    notes: list[tuple[int, str]] = field(default_factory=list)

    def count(self, case: int, what: str, note: str = '') -> None:
        self.counts[what] += 1
        if what not in {'open', 'at limit'}:
            self.notes.append((case, f'{what} {note}'.strip()))


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
        except Exception as error:  # noqa: BLE001 - whatever it is, it is counted
            findings.count(i, 'crashed', repr(error))
            continue
        what = _compare_status(reference, phi[i], truth, status)
        if what == 'closed':
            answers[i] = answer
        elif what:
            findings.count(i, what, f'{status.name}, in truth {truth.outcome.name}')
            if what == 'at limit' and status is Status.TOGGLE and truth.joints and answer[0]:
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
    """Return ``closed`` where both are, or else what the package's status is."""
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
    if not answers:
        return
    cases = list(answers)
    arguments = [truths[i] for i in cases], [phi[i] for i in cases], [alpha[i] for i in cases]
    if reference.mechanism.ties is None:
        kappa = condition_numbers(reference, *arguments)
    else:
        found = [exact_condition_numbers(reference, *a) for a in zip(*arguments[1:], strict=True)]
        kappa = np.array(found)
    for i, least in zip(cases, kappa, strict=True):
        condition = np.maximum(least, _LEAST)
        count = len(quantities)
        off, width, nought = _differences(reference, truths[i], answers[i])
        # An angle is published as it grows, not within a turn, and rounded at the size it has.
        for j, joint in enumerate(reference.mechanism.joints.values()):
            if isinstance(joint, Turn):
                condition[j, 0] += max(0.0, abs(answers[i][0][j]) - pi)
        # What does not move at all has a κ of 0, but terms that are not 0 are rounded to give it.
        condition[nought] = np.maximum(condition[nought], 1.0)
        while not (width <= _CORRECT * condition)[:, :count].all():
            truths[i] = reference.solve(phi[i], alpha[i], 2 * truths[i].precision)
            off, width, nought = _differences(reference, truths[i], answers[i])
        errors = off[:, :count] / (UNIT_ROUNDOFF * condition[:, :count])
        errors[off[:, :count] == 0.0] = 0.0
        errors[np.isnan(errors)] = np.inf
        if errors[:, 0].max() > _SUSPICIOUS and _is_other_assembly(
            reference, phi[i], alpha[i], answers[i], off[:, 0].max()
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
    """Return by how much an answer is off, how wide the truth is, and whether it may be 0."""
    exponent = reference.constants().exponent
    ctx.prec = truth.precision
    unit = arb(2) ** -exponent
    off = np.zeros((len(truth.joints), 3))
    width = np.zeros((len(truth.joints), 3))
    nought = np.zeros((len(truth.joints), 3), bool)
    joints = reference.mechanism.joints.values()
    for j, (joint, value) in enumerate(zip(joints, truth.joints, strict=True)):
        turns = isinstance(joint, Turn)
        for k, numbers in enumerate(answer):
            if not isfinite(numbers[j]):
                off[j, k] = np.inf
                continue
            exact = value[k]
            found = arb(numbers[j]) / FACTORIALS[k]
            difference = exact - (found if turns else found * unit)
            if turns and k == 0 and abs(float(difference)) > 3.0:
                nearest = round(float(difference) / (2 * pi))
                difference -= 2 * nearest * arb.pi()
            off[j, k] = abs(float(difference)) * FACTORIALS[k]
            width[j, k] = float(exact.rad()) * FACTORIALS[k]
            nought[j, k] = exact == 0 or exact.contains(0)
    return off, width, nought


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
            found, _, _ = _differences(other, truth, answer)
            if found[:, 0].max() < off / _SUSPICIOUS:
                return True
    return False
