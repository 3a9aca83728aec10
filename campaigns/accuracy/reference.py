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

"""The truth at one input angle, to fifty digits and more, or that there is none."""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from typing import Any, NamedTuple

from campaigns.accuracy.mechanism import CRANK, Key, Mechanism, Turn
from campaigns.accuracy.motion import (
    conjugate,
    Constants,
    Handed,
    Motion,
    OpenError,
    ORDER,
    turning,
    UndecidedError,
)
from flint import arb, ctx

PRECISIONS = (256, 512, 1024, 2048, 4096)
"""In bits; the next is taken where a result has fewer than 50 digits in common with all others."""


class Outcome(Enum):
    """Whether a linkage closes, decided by balls."""

    CLOSED = 'closed'
    OPEN = 'open'
    SINGULAR = 'singular'
    """Exactly in line, parallel or pin on pin, as far as 4096 bits can tell."""


class Truth(NamedTuple):
    """The published joints; for each the series of its value, in the constants' unit."""

    outcome: Outcome
    joints: tuple[Any, ...]
    motion: Motion
    precision: int


class Reference:
    """
    A mechanism, ready to be solved.

    Parameters
    ----------
    mechanism
        What to solve.
    numbers
        Instead of the mechanism's own; balls may be among them.
    changed
        As of `Motion`.

    """

    def __init__(
        self,
        mechanism: Mechanism,
        numbers: Mapping[Key, Any] | None = None,
        changed: tuple[Handed, Any] | None = None,
    ) -> None:
        self._changed = changed
        self.mechanism = mechanism
        self.numbers = mechanism.numbers() if numbers is None else numbers
        self._constants: dict[int, Constants] = {}

    def solve(self, phi: Any, alpha: Any, lowest: int = PRECISIONS[0]) -> Truth:
        """
        Solve at the lowest precision that decides whether it closes.

        Parameters
        ----------
        phi
            Input angle, in [rad].
        alpha
            Its acceleration where its rate is 1, in [rad/s²].
        lowest
            Precision to begin with, in bits.

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
        found = []
        for joint in self.mechanism.joints.values():
            if isinstance(joint, Turn):
                unit = motion.shown[joint.child]
                if joint.parent != 'ground':
                    unit = unit * conjugate(motion.shown[joint.parent])
                found.append(turning(unit))
            else:
                found.append(motion.slide[joint])
        return tuple(found)


def series(values: Any) -> list[complex]:
    """Return a power series as doubles, all of its coefficients."""
    coefficients = [complex(c) for c in values.coeffs()]
    return coefficients + [0j] * (ORDER - len(coefficients))
