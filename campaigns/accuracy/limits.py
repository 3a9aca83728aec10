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

"""Whether a case lies so near a limit position that rounding its inputs may decide it."""

from __future__ import annotations

from math import inf, pi, remainder
from typing import Any

from campaigns.accuracy.mechanism import Key
from campaigns.accuracy.motion import Motion, OpenError, UndecidedError
from campaigns.accuracy.reference import Reference
from flint import arb, ctx

UNIT_ROUNDOFF = 2.0**-53
TOLERANCE = 16.0 * UNIT_ROUNDOFF
"""As a part of all lengths, and of the condition number of what the links reach too far."""

_PRECISION = 1024
_STEP = 300


def is_at_limit(reference: Reference, phi: float) -> bool:
    """
    Return whether a dyad is within the tolerance of a toggle, or of lines that are parallel.

    What a dyad may reach farther is a length y(x) of the numbers x; the inputs' rounding changes
    it by u·Σ|xᵢ ∂y/∂xᵢ|, which for a dyad at the end of a chain may be much more than u times all
    lengths.
    """
    return any(abs(margin) <= tolerance for margin, tolerance in margins(reference, phi))


def margins(reference: Reference, phi: float) -> list[tuple[float, float]]:
    """Return for each dyad, up to the first that is open, its margin and the tolerance of it."""
    base = _margins(reference, arb(phi))
    step = arb(2) ** -_STEP
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
    ctx.prec = _PRECISION
    motion: Motion = reference.motion(_PRECISION)
    try:
        motion.solve(phi, arb(0))
        placed = len(reference.mechanism.dyads)
    except (OpenError, UndecidedError):
        placed = len(motion.inverse) + 1
    return [dyad.margin(motion) for dyad in reference.mechanism.dyads[:placed]]
