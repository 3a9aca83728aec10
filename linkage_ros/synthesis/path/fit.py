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
Coupler curves brought nearer to their points: many four-bars at once, each from its own start.

K. Levenberg (1944) and D. W. Marquardt (1963): steps of least squares on the distances themselves
(`steps`), damped until they help. A step that opens the loop on its way, or takes the points
out of order, does not help, whatever the distances say. So that none ends at such an edge far from
the answer, toggles are kept off by a guard at first: the cotangent of the transmission angle
counts as a distance.
"""

from __future__ import annotations

from linkage_ros.kinematics.batch import Array, Mask
from linkage_ros.synthesis.path.aim import Aim, Fitted
from linkage_ros.synthesis.path.model import closes, folds, Slopes, slopes
from linkage_ros.synthesis.path.steps import step
import numpy as np

_TURN = 2.0 * np.pi

_DAMPING = 1e-2
_LEAST_DAMPED, _MOST_DAMPED = 1e-12, 1e10
_HELPED, _FAILED = 0.2, 5.0
"""What damping is multiplied by after a step."""

_SETTLED = 1e-15
"""A step that gains less than this part of the squares is the last."""

_NOTHING = 1e-30
"""Squares that are rounding, of a path of size 1."""


def improve(start: Fitted, aim: Aim, steps: int, guard: float = 0.0) -> tuple[Fitted, Array]:
    """
    Return the four-bars after so many steps, and their sums of squared distances, (n,).

    Those that are no answer from the outset (open, out of order) have inf, and stay as they are.

    Parameters
    ----------
    start, aim
        As above.
    steps
        At most.
    guard
        What a transmission angle of 45° counts for as a distance. Not part of the sums.

    """
    now = Fitted(*(np.array(part) for part in start))
    seen = slopes(*now)
    cost = _cost(now, seen, aim, guard)
    damping = np.full(len(cost), _DAMPING)
    going = np.flatnonzero(np.isfinite(cost))
    # What is tried may be open, and its derivatives anything: its cost is inf.
    with np.errstate(all='ignore'):
        for _ in range(steps):
            if not len(going):
                break
            at = Slopes(*(part[going] for part in seen))
            tried = step(now.some(going), at, damping[going], aim, guard)
            fresh = slopes(*tried)
            reached = _cost(tried, fresh, aim, guard)
            better = reached < cost[going]
            settled = better & (cost[going] - reached <= _SETTLED * reached)
            taken = going[better]
            for old, new in zip((*now, *seen), (*tried, *fresh), strict=True):
                old[taken] = new[better]
            cost[taken] = reached[better]
            damping[going] = np.maximum(
                damping[going] * np.where(better, _HELPED, _FAILED), _LEAST_DAMPED
            )
            settled |= (damping[going] > _MOST_DAMPED) | (cost[going] < _NOTHING)
            going = going[~settled]
    return now, np.where(np.isfinite(cost), _squares(seen, aim), np.inf)


def allowed(fitted: Fitted, aim: Aim) -> Mask:
    """Return which four-bars stay closed on their way through the points, in order."""
    angles = fitted.angles
    low, high = angles.min(1), angles.max(1)
    good: Mask = np.ones(len(low), dtype=bool)
    if aim.timing is None:
        along = np.diff(angles, axis=1) * np.sign(angles[:, -1:] - angles[:, :1])
        good = (along > 0.0).all(1) & (high - low < _TURN)
    if aim.full_turn:
        low, high = np.zeros_like(low), np.full_like(high, _TURN)
    good &= closes(fitted.rows, low, high)
    return good


def _cost(fitted: Fitted, seen: Slopes, aim: Aim, guard: float) -> Array:
    squares = _squares(seen, aim)
    if guard:
        squares += guard * guard * _folded(fitted.rows, fitted.angles)
        if aim.full_turn:
            squares += guard * guard * _folded(fitted.rows, np.array([[0.0, np.pi]]))
    return np.where(allowed(fitted, aim), squares, np.inf)


def _folded(rows: Array, angles: Array) -> Array:
    folded = folds(rows, angles)[0]
    squares: Array = (folded * folded).sum(1)
    return squares


def _squares(seen: Slopes, aim: Aim) -> Array:
    miss = aim.points - seen.places
    total: Array = (miss.real**2 + miss.imag**2).sum(1)
    total[~np.isfinite(total)] = np.inf
    return total
