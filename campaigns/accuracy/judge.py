# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Compare the package with the reference for one linkage."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import product
from math import isfinite, pi
from typing import Any

from campaigns.accuracy.mechanism import Mechanism
from campaigns.accuracy.reference import (
    Array,
    condition_numbers,
    is_at_limit,
    Outcome,
    Reference,
    Truth,
)
from campaigns.series import CORRECT, FACTORIALS, UNIT_ROUNDOFF
from campaigns.tally import Judgement, QUANTITIES
from flint import arb, ctx
from linkage_ros.errors import DefinitionError
from linkage_ros.kinematics import Closure, RevoluteJoint, Status
import numpy as np

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


def judge(mechanism: Mechanism, phi: list[float], alpha: list[float]) -> Judgement:
    """
    Compare the package with the reference at input angles φ, at rate 1 and accelerations α.

    It counts ``cases``, ``closed``, ``open``, ``at limit``, and as findings ``wrong`` (assembly),
    ``missed`` and ``false`` (closures), ``refused`` (regular, but reported as a toggle or
    indeterminate) and ``crashed``.
    """
    findings = Judgement(Counter(cases=len(phi)))
    reference = Reference(mechanism)
    truths = [reference.solve(*case) for case in zip(phi, alpha, strict=True)]
    try:
        closure = Closure(mechanism.linkage())
    except DefinitionError as error:
        for i, truth in enumerate(truths):
            at_limit = truth.outcome is Outcome.SINGULAR or is_at_limit(reference, phi[i])
            closed = truth.outcome is Outcome.CLOSED and not at_limit
            if closed:
                findings.find('missed', str(error), i)
            else:
                findings.counts['open'] += 1
        return findings
    answers: dict[int, Answer] = {}
    toggles: dict[int, Answer] = {}
    for i, truth in enumerate(truths):
        try:
            status, answer = answer_of(closure, phi[i], alpha[i])
        except Exception as error:  # noqa: BLE001 - any exception is counted
            findings.find('crashed', repr(error), i)
            continue
        outcome = _compare_status(reference, phi[i], truth, status)
        if outcome == 'closed':
            answers[i] = answer
        elif outcome in FAULTS:
            findings.find(outcome, f'{status.name}, in truth {truth.outcome.name}', i)
        else:
            findings.counts[outcome] += 1
            if outcome == 'at limit' and status is Status.TOGGLE and truth.joints and answer[0]:
                toggles[i] = answer
    _measure(findings, reference, truths, phi, alpha, answers, QUANTITIES)
    _measure(findings, reference, truths, phi, alpha, toggles, (AT_TOGGLE,))
    return findings


def answer_of(closure: Any, phi: float, alpha: float) -> tuple[Status, Answer]:
    """Return the status of a case and, if it is closed, positions, velocities, accelerations."""
    position = closure.position(phi)
    if position.status is not Status.CLOSED:
        return position.status, (position.joints,)
    velocity = closure.velocity(position, 1.0)
    acceleration = closure.acceleration(position, velocity, alpha)
    return position.status, (position.joints, velocity.joints, acceleration.joints)


def _compare_status(reference: Reference, phi: float, truth: Truth, status: Status) -> str:
    """Return the outcome of a comparison, a key of the counts."""
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
    findings: Judgement,
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
            if isinstance(joint, RevoluteJoint):
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
            findings.find('wrong', case=i)
            continue
        named = quantities
        if errors.max() > _BAND and named is QUANTITIES and is_at_limit(reference, phi[i]):
            findings.counts['at limit'] += 1
            named = (AT_TOGGLE,)
        findings.counts['closed' if named is QUANTITIES else 'toggles'] += 1
        for k, quantity in enumerate(named):
            findings.note_errors(quantity, i, errors[:, k].tolist())


def _differences(reference: Reference, truth: Truth, answer: Answer) -> tuple[Array, Array, Array]:
    """Return the errors of an answer, the widths of the truth, and whether the truth may be 0."""
    ctx.prec = truth.precision
    unit = arb(2) ** -truth.motion.exponent
    off = np.zeros((len(truth.joints), 3))
    width = np.zeros((len(truth.joints), 3))
    zero = np.zeros((len(truth.joints), 3), bool)
    joints = reference.mechanism.joints.values()
    for j, (joint, value) in enumerate(zip(joints, truth.joints, strict=True)):
        turns = isinstance(joint, RevoluteJoint)
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
