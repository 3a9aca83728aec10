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

The reference computes all of it, by one way back through the tape of a solution.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from enum import Enum
from typing import Any, NamedTuple

from campaigns.accuracy.mechanism import Key, Mechanism, Tie
from campaigns.accuracy.motion import Motion, OpenError, UndecidedError
from campaigns.series import PRECISIONS, real_series, Series, UNIT_ROUNDOFF
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


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
    # The joints on the tape of the motion, with the absolute values of their terms.
    made: tuple[tuple[Series, list[float]], ...] = ()


class Reference:
    """A mechanism, ready to be solved; its numbers may be replaced by balls."""

    def __init__(self, mechanism: Mechanism, numbers: Mapping[Key, Any] | None = None) -> None:
        self.mechanism = mechanism
        self.numbers = mechanism.numbers() if numbers is None else numbers

    def solve(self, phi: Any, alpha: Any, lowest: int = PRECISIONS[0]) -> Truth:
        """
        Solve at the lowest precision, in bits, that decides whether the linkage closes.

        The input angle is in [rad], its acceleration in [rad/s²]; its rate is 1 rad/s.
        """
        for precision in [p for p in PRECISIONS if p >= lowest] or [lowest]:
            motion = Motion(self.mechanism, self.numbers, precision, phi, alpha)
            try:
                motion.solve()
            except OpenError:
                return Truth(Outcome.OPEN, (), motion, precision)
            except UndecidedError:
                continue
            made = tuple(motion.joints())
            joints = tuple(real_series(joint.value) for joint, _ in made)
            return Truth(Outcome.CLOSED, joints, motion, precision, made)
        return Truth(Outcome.SINGULAR, (), motion, precision)


def condition_numbers(truth: Truth) -> Array:
    """
    Return κ of a closed case, [joint, derivative].

    The dependent lengths of a linkage, as of a parallelogram, vary together.
    """
    motion = truth.motion
    widths, ties, tied = motion.tape.widths, motion.mechanism.ties, []
    if ties is not None:
        numbers = {at for at, _ in motion.numbers.values()}
        widths = {at: width for at, width in widths.items() if at not in numbers}
        tied = [_tied(motion, tie) for tie in ties]
    kappa = np.array(
        [np.add(joint.changes(widths, tied), terms) for joint, terms in truth.made], float
    )
    if ties is not None:
        # A joint of such a linkage may not move at all. Its κ would be 0, but its terms are as
        # large as the crank's rate and acceleration, and are rounded.
        alpha = abs(float(motion.crank.orders()[2]))
        kappa[:, 1:] = np.maximum(kappa[:, 1:], (1.0, 2.0 * max(1.0, alpha)))
    return kappa


def _tied(motion: Motion, tie: Tie) -> dict[int, complex]:
    """Return the changes of dependent lengths by their index on the tape."""
    changes: dict[int, complex] = {}
    for key, size in tie.items():
        at, part = motion.numbers[key]
        changes[at] = changes.get(at, 0.0) + part * size * 2.0**-motion.exponent
    return changes


TOLERANCE = 16.0 * UNIT_ROUNDOFF
"""Relative to the sum of all lengths and the condition number of the distance to a toggle."""

_LIMIT_PRECISION = 1024


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
    mechanism = reference.mechanism
    motion = Motion(mechanism, reference.numbers, _LIMIT_PRECISION, phi)
    with suppress(OpenError, UndecidedError):
        motion.solve()
    size = mechanism.size() * 2.0**-motion.exponent
    found = []
    for dyad in mechanism.dyads[: motion.placed + 1]:
        margin = dyad.margin(motion)
        condition = margin.changes(motion.widths)[0]
        found.append((float(margin.value[0].real), TOLERANCE * (condition + size)))
    return found
