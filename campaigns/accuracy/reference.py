# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The reference solution at one input angle, to fifty digits and more, with its condition numbers.

The reference also decides whether a solution exists. If rounding of the inputs may change that
decision, the case is at a limit.

Condition numbers κ = Σ|xᵢ ∂y/∂xᵢ| + |y| of positions, velocities and accelerations.

The sum goes over all coordinates, directions and angles of the linkage, the input angle at its
size within (-π, π], its rate and its acceleration. A published angle counts as at least π: a
direction is a sum of angles of up to half a turn, and if they cancel, their rounding errors
remain. A joint is the difference of two terms, the angles of two links or their rates; |y| is the
sum of the absolute values of the two terms.

The dyads of a linkage are solved one after the other, and each passes doubles to the next. So the
results of a dyad are input data of all later dyads. Let stage k return zₖ with an error of at most
C·u·κₖ, where κₖ is its own condition number. To first order the error of y is then at most
C·u·Σ|∂y/∂zₖ|·κₖ. This sum over the stages is added to the sum over the numbers: a solver whose
dyads are each accurate to C·u·κ is then accurate to C·u·κ as a whole. No solver can avoid this
sum: two results that depend on the same number are rounded independently, so their errors do not
cancel. The stages are

- the angle between crank and ground that the first dyad uses: the sum of φ and a direction of the
  file, if that is not 0, with the absolute value of the sum;
- the angles and slides that a dyad computes, their rates and accelerations, each with its own κ;
- the pins that hold the links, and the points passed to a later dyad, with their velocities and
  accelerations. They are sums of terms already counted; each coordinate counts with its absolute
  value.

The reference computes all of it: ∂y/∂zₖ is the effect of changing zₖ between two of its dyads.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from math import inf, pi, remainder
from typing import Any, NamedTuple

from campaigns.accuracy.mechanism import CRANK, GROUND, Key, Mechanism, Spot, Turn
from campaigns.accuracy.motion import (
    Array,
    conjugate,
    Constants,
    imag,
    Motion,
    OpenError,
    ORDER,
    passed_results,
    PassedResult,
    Tangent,
    turn_sizes,
    turn_values,
    turning,
    UndecidedError,
)
from flint import arb, ctx
import numpy as np

PRECISIONS = (256, 512, 1024, 2048, 4096)
"""In bits. The next precision is used if a result has fewer than 50 proven digits."""


class Outcome(Enum):
    """Whether a linkage closes, decided by balls."""

    CLOSED = 'closed'
    OPEN = 'open'
    SINGULAR = 'singular'
    """Links in line, lines parallel or pins coincident, to the precision of 4096 bits."""


class Truth(NamedTuple):
    """The published joints as power series in time, in the constants' unit."""

    outcome: Outcome
    joints: tuple[Any, ...]
    motion: Motion
    precision: int


class Reference:
    """A mechanism, ready to be solved; its numbers may be replaced by balls."""

    def __init__(
        self,
        mechanism: Mechanism,
        numbers: Mapping[Key, Any] | None = None,
        changed: tuple[PassedResult, Any] | None = None,
    ) -> None:
        self._changed = changed
        self.mechanism = mechanism
        self.numbers = mechanism.numbers() if numbers is None else numbers
        self._constants: dict[int, Constants] = {}

    def solve(self, phi: Any, alpha: Any, lowest: int = PRECISIONS[0]) -> Truth:
        """
        Solve at the lowest precision, in bits, that decides whether the linkage closes.

        The input angle is in [rad], its acceleration in [rad/s²]; its rate is 1 rad/s.
        """
        for precision in [p for p in PRECISIONS if p >= lowest] or [lowest]:
            ctx.prec = precision
            motion = self.motion(precision)
            try:
                motion.solve(arb(phi), arb(alpha))
            except OpenError:
                return Truth(Outcome.OPEN, (), motion, precision)
            except UndecidedError:
                continue
            return Truth(Outcome.CLOSED, self._joints(motion), motion, precision)
        return Truth(Outcome.SINGULAR, (), motion, precision)

    def motion(self, precision: int) -> Motion:
        """Return an unsolved motion at a precision, in bits."""
        if precision not in self._constants:
            self._constants[precision] = Constants(self.mechanism, self.numbers)
        pivot = next(iter(self.mechanism.links[CRANK]))
        return Motion(self.mechanism, self._constants[precision], pivot, self._changed)

    def constants(self) -> Constants:
        """Return the numbers as balls, at the lowest precision."""
        ctx.prec = PRECISIONS[0]
        self.motion(PRECISIONS[0])
        return self._constants[PRECISIONS[0]]

    def _joints(self, motion: Motion) -> tuple[Any, ...]:
        values = []
        for joint in self.mechanism.joints.values():
            if isinstance(joint, Turn):
                unit = motion.unchanged[joint.child]
                if joint.parent != 'ground':
                    unit = unit * conjugate(motion.unchanged[joint.parent])
                values.append(turning(unit))
            else:
                values.append(motion.slide[joint])
        return tuple(values)


def series(values: Any) -> list[complex]:
    """Return a power series as doubles, all of its coefficients."""
    coefficients = [complex(c) for c in values.coeffs()]
    return coefficients + [0j] * (ORDER - len(coefficients))


FACTORIALS = (1.0, 1.0, 2.0)

_PRECISION = 1024
_STEP = 300
"""Minus the exponent of the step of differences: both errors are then below 50 digits."""


def condition_numbers(
    reference: Reference, truths: list[Truth], phi: list[float], alpha: list[float]
) -> Array:
    """Return κ of all closed cases in doubles, [case, joint, derivative]."""
    mechanism = reference.mechanism
    motions = [truth.motion for truth in truths]
    values: dict[str | int, Array] = {}
    for name in mechanism.links:
        values[name] = np.array([series(m.unit[name]) for m in motions]).T
    for name in mechanism.sliders:
        values[name] = np.array([series(m.slide[name]) for m in motions]).real.T
    for i in range(len(mechanism.dyads)):
        values[i] = np.array([series(m.inverse[i]) for m in motions]).real.T
    tangent = Tangent(
        mechanism,
        reference.constants(),
        reference.numbers,
        values,
        {
            handed.owner: np.array([series(_place(m, handed.owner)) for m in motions]).T
            for handed in passed_results(mechanism)
            if handed.quantity == 'x' and not handed.power
        },
        np.array([remainder(angle, 2 * pi) for angle in phi]),
        np.array(alpha),
        np.array([_opening(reference, angle) for angle in phi]),
    )
    kappa = np.empty((len(truths), len(mechanism.joints), 3))
    for j, joint in enumerate(mechanism.joints.values()):
        if isinstance(joint, Turn):
            change = tangent.unchanged[joint.child] - tangent.unchanged[joint.parent]
        else:
            change = tangent.slide[joint]
        kappa[:, j] = np.abs(change).sum(axis=2).T
    return (kappa + _published(reference, motions)) * FACTORIALS


def exact_condition_numbers(
    reference: Reference, phi: float, alpha: float, independent: bool = False
) -> Array | None:
    """
    Return κ of one case by differences of balls, [joint, derivative]; None if it is singular.

    If ``independent``, each number varies independently, even if the linkage has dependent
    lengths.
    """
    base = reference.solve(phi, alpha, _PRECISION)
    if base.outcome is not Outcome.CLOSED:
        return None
    precision = base.precision
    ctx.prec = precision
    step = arb(2) ** -_STEP
    numbers = reference.numbers
    ties = reference.mechanism.ties
    if ties is None or independent:
        ties = tuple({key: value} for key, value in numbers.items() if value)
    kappa = np.zeros((len(base.joints), 3))
    exact = _coefficients(base)
    passed = passed_results(reference.mechanism)
    conditions = [0.0] * len(passed)
    joints = list(reference.mechanism.joints.values())

    def add(changed: Truth) -> None:
        for j, (one, other) in enumerate(zip(exact, _coefficients(changed), strict=True)):
            for k in range(3):
                difference = other[k] - one[k]
                if k == 0 and isinstance(joints[j], Turn):
                    # An angle next to π is on the other side of it as soon as anything changes.
                    difference -= 2 * round(float(difference) / (2 * pi)) * arb.pi()
                kappa[j, k] += abs(float(difference / step))
        for i, handed in enumerate(passed):
            conditions[i] += abs(float(_change(base.motion, changed.motion, handed) / step))

    for tie in ties:
        varied: dict[Key, Any] = dict(numbers)
        for key, change in tie.items():
            varied[key] = arb(numbers[key]) + step * arb(change)
        add(Reference(reference.mechanism, varied).solve(phi, alpha, precision))
    turned = remainder(phi, 2 * pi)
    add(reference.solve(arb(phi) + step * arb(turned), alpha, precision))
    add(reference.solve(arb(phi) + step * arb(_opening(reference, phi)), alpha, precision))
    add(reference.solve(phi, arb(alpha) * (1 + step), precision))
    # The derivative by the rate ω, which is 1: y' is proportional to ω, and y'' = g·ω² + h·α.
    for j, y in enumerate(exact):
        kappa[j, 1] += abs(float(y[1]))
    still = _coefficients(reference.solve(phi, 0.0, precision))
    for j, y in enumerate(still):
        kappa[j, 2] += 2 * abs(float(y[2]))
    # The part g·ω² of an acceleration, which remains where α is 0, counts twice.
    still_motion = reference.solve(phi, 0.0, precision).motion
    for i, handed in enumerate(passed):
        if handed.quantity in {'turn', 'slide'} and handed.power:
            of = base.motion if handed.power == 1 else still_motion
            conditions[i] += handed.power * abs(_value(of, handed))
    for i, handed in enumerate(passed):
        amount = step * arb(_size(base.motion, handed) + conditions[i])
        changed = Reference(reference.mechanism, numbers, (handed, amount))
        add(changed.solve(phi, alpha, precision))
    kappa += _published(reference, [base.motion])[0]
    if ties is reference.mechanism.ties:
        # A joint of such a linkage may not move at all. Its κ would be 0, but its terms are as
        # large as the crank's rate and acceleration, and are rounded.
        kappa[:, 1:] = np.maximum(kappa[:, 1:], (1.0, max(1.0, abs(alpha))))
    return kappa * FACTORIALS


def _coefficients(truth: Truth) -> list[list[Any]]:
    return [[y[0], y[1], y[2]] for y in truth.joints]


def _opening(reference: Reference, phi: float) -> float:
    """Return the angle that the first dyad uses if it is a rounded sum; otherwise 0."""
    opening = reference.mechanism.opening()
    return remainder(phi + opening, 2 * pi) if opening else 0.0


def _published(reference: Reference, motions: list[Motion]) -> Array:
    """Return the absolute terms of the published joints, summed, [case, joint, power]."""
    sizes = np.zeros((len(motions), len(reference.mechanism.joints), 3))
    for j, joint in enumerate(reference.mechanism.joints.values()):
        if isinstance(joint, Turn):
            for link in {joint.child, joint.parent} - {GROUND}:
                sizes[:, j] += turn_sizes(
                    np.array([series(m.unchanged[link]) for m in motions]).T
                ).T
            sizes[:, j, 0] = pi
        else:
            sizes[:, j] = np.abs([series(m.slide[joint]) for m in motions])
    return sizes


def _place(motion: Motion, owner: str | Spot) -> Any:
    return motion.at(owner) if isinstance(owner, Spot) else motion.held[owner]


def _size(motion: Motion, handed: PassedResult) -> float:
    """Return the absolute value of a passed result."""
    if handed.quantity == 'turn' and not handed.power:
        return pi
    return abs(_value(motion, handed))


def _value(motion: Motion, handed: PassedResult) -> float:
    owner, quantity, power = handed
    if quantity == 'turn':
        return float(turn_values(np.array([series(motion.unchanged[owner])]).T)[power, 0])
    if quantity == 'slide':
        return series(motion.slide[owner])[power].real
    place = series(_place(motion, owner))[power]
    return place.real if quantity == 'x' else place.imag


def _change(motion: Motion, changed: Motion, handed: PassedResult) -> Any:
    """Return the change of an angle or a slide; 0 for a pin, which counts with its size."""
    owner, quantity, power = handed
    if quantity == 'turn':
        return imag(changed.unchanged[owner] * conjugate(motion.unchanged[owner]))[power]
    if quantity == 'slide':
        return (changed.slide[owner] - motion.slide[owner])[power]
    return 0


UNIT_ROUNDOFF = 2.0**-53
TOLERANCE = 16.0 * UNIT_ROUNDOFF
"""Relative to the sum of all lengths and the condition number of the distance to a toggle."""

_LIMIT_PRECISION = 1024
_LIMIT_STEP = 300


def is_at_limit(reference: Reference, phi: float) -> bool:
    """
    Return whether a dyad is within the tolerance of a toggle, or of parallel lines.

    The distance to a toggle is a length y(x) of the numbers x. Rounding the inputs changes it by
    u·Σ|xᵢ ∂y/∂xᵢ|. For a dyad at the end of a chain this may be much more than u times all
    lengths.
    """
    return any(abs(margin) <= tolerance for margin, tolerance in margins(reference, phi))


def margins(reference: Reference, phi: float) -> list[tuple[float, float]]:
    """Return the margin of each dyad up to the first open one, and its tolerance."""
    base = _margins(reference, arb(phi))
    step = arb(2) ** -_LIMIT_STEP
    numbers = reference.numbers
    conditions = [0.0] * len(base)

    def add(changed: list[Any]) -> None:
        for i in range(len(base)):
            slope = float((changed[i] - base[i]) / step) if i < len(changed) else inf
            conditions[i] += abs(slope)

    for key, value in numbers.items():
        if value:
            varied: dict[Key, Any] = dict(numbers)
            varied[key] = arb(value) * (1 + step)
            add(_margins(Reference(reference.mechanism, varied), arb(phi)))
    add(_margins(reference, arb(phi) + step * arb(remainder(phi, 2 * pi))))
    size = reference.mechanism.size() * 2.0 ** -reference.constants().exponent
    return [
        (float(margin), TOLERANCE * (condition + size))
        for margin, condition in zip(base, conditions, strict=True)
    ]


def _margins(reference: Reference, phi: Any) -> list[Any]:
    ctx.prec = _LIMIT_PRECISION
    motion: Motion = reference.motion(_LIMIT_PRECISION)
    try:
        motion.solve(phi, arb(0))
        placed = len(reference.mechanism.dyads)
    except (OpenError, UndecidedError):
        placed = len(motion.inverse) + 1
    return [dyad.margin(motion) for dyad in reference.mechanism.dyads[:placed]]
