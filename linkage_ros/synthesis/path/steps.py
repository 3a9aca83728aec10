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
One step of least squares for many four-bars at once.

- Without timing the crank angle of every point is an unknown too. It moves one place only, so that
  it is eliminated from the normal equations (a Schur complement): they stay nine by nine however
  many points there are.
- Lengths stay in a box. One at an edge that would leave it is held for that step.
- A step is bent as the curves bend, to second order.
"""

from __future__ import annotations

from typing import NamedTuple

from linkage_ros.kinematics.batch import Array, Complex
from linkage_ros.synthesis.path.aim import Aim, Fitted
from linkage_ros.synthesis.path.model import COLUMNS, folds, LENGTHS, POINT, Slopes, slopes
import numpy as np

_SIZE = len(COLUMNS)

_BENT = 0.4
"""A step is bent by this part of its own length at most."""

_AHEAD = 0.1
"""The part of a step after which is looked how the curves bend."""

_TINY = 1e-30
"""Keeps a division from zero where a crank angle moves nothing."""


def step(now: Fitted, seen: Slopes, damping: Array, aim: Aim, guard: float) -> Fitted:
    """
    Return where one damped step leads, within the box.

    Without a guard the step is bent as the curves bend, to second order (M. K. Transtrum and J. P.
    Sethna, Improvements to the Levenberg-Marquardt algorithm, arXiv:1201.5885, 2012): errors of
    coupler curves have long, bent valleys, along which straight steps are short.
    """
    equations = _equations(now, seen, aim, guard)
    solve = _Solver(now, equations, damping, aim)
    change = solve(equations.gaps, equations.aside)
    if not guard:
        bend = _bend(now, seen, change, aim)
        more = solve(np.stack((bend.real, bend.imag), axis=1), equations.aside)
        sizes = [np.abs(part).max(1) for part in (change.rows, more.rows)]
        helps = (sizes[1] <= _BENT * sizes[0])[:, None]
        change = Fitted(
            change.rows + helps * more.rows, change.angles + helps * more.angles, change.side
        )
    return _moved(now, change, aim)


class _Equations(NamedTuple):
    """
    What is asked of a step: derivatives times step = gaps, as near as can be.

    Attributes
    ----------
    by
        Derivatives by the unknowns that all points share, (n, parts, N, m).
    turns
        Derivatives by the crank angle of the point, (n, parts, N).
    gaps
        (n, parts, N).
    more, aside
        Derivatives of what belongs to no point, (n, k, m), and their gaps, (n, k).

    """

    by: Array
    turns: Array
    gaps: Array
    more: Array
    aside: Array


def _equations(now: Fitted, seen: Slopes, aim: Aim, guard: float) -> _Equations:
    miss = aim.points - seen.places
    by = np.stack((seen.by_dimension.real, seen.by_dimension.imag), axis=1)
    turns = np.stack((seen.by_angle.real, seen.by_angle.imag), axis=1)
    gaps = np.stack((miss.real, miss.imag), axis=1)
    more, aside = np.zeros((len(by), 0, _SIZE)), np.zeros((len(by), 0))
    if guard:
        # Where the crank's angle is no unknown it is 0 or π, at which a full turn comes nearest to
        # its toggles.
        folded, by_dimension, by_angle = folds(now.rows, now.angles)
        by = np.concatenate((by, guard * by_dimension[:, None]), axis=1)
        turns = np.concatenate((turns, guard * by_angle[:, None]), axis=1)
        gaps = np.concatenate((gaps, -guard * folded[:, None]), axis=1)
        if aim.full_turn:
            folded, by_dimension, _ = folds(now.rows, np.broadcast_to((0.0, np.pi), (len(by), 2)))
            more, aside = guard * by_dimension, -guard * folded
    if aim.timing is not None and aim.zero_free:
        by = np.concatenate((by, turns[..., None]), axis=3)
        more = np.pad(more, ((0, 0), (0, 0), (0, 1)))
    elif aim.timing is not None:
        # The crank's angle in the world is given: what turns the ground turns it back.
        by[..., 2] -= turns
    return _Equations(by, turns, gaps, more, aside)


class _Solver:
    """The damped normal equations of a step, ready for any gaps."""

    def __init__(self, now: Fitted, equations: _Equations, damping: Array, aim: Aim) -> None:
        self._now, self._equations, self._aim = now, equations, aim
        by, turns, more = equations.by, equations.turns, equations.more
        count, unknowns = len(by), by.shape[3]
        self._rows = np.concatenate((by.reshape(count, -1, unknowns), more), axis=1)
        matrix = np.matmul(self._rows.transpose(0, 2, 1), self._rows)
        diagonal = np.arange(unknowns)
        scale = matrix[:, diagonal, diagonal]
        if aim.timing is None:
            self._stiff = (turns * turns).sum(1) * (1.0 + damping[:, None]) + _TINY
            self._mixed = (turns[..., None] * by).sum(1)
            self._shares = self._mixed / self._stiff[..., None]
            matrix -= np.matmul(self._shares.transpose(0, 2, 1), self._mixed)
        matrix[:, diagonal, diagonal] += damping[:, None] * scale
        matrix[:, diagonal, diagonal] += 1e-12 * scale.max(1, keepdims=True)
        self._held = np.zeros((count, unknowns), dtype=bool)
        slope, _ = self._slope(equations.gaps, equations.aside)
        low, high = _box(aim)
        self._held[:, :_SIZE] = (now.rows <= low) & (slope[:, :_SIZE] < 0.0)
        self._held[:, :_SIZE] |= (now.rows >= high) & (slope[:, :_SIZE] > 0.0)
        matrix *= ~self._held[:, :, None] & ~self._held[:, None, :]
        matrix[:, diagonal, diagonal] += self._held
        self._inverse = np.linalg.inv(matrix)

    def __call__(self, gaps: Array, aside: Array) -> Fitted:
        """Return the change of rows and angles."""
        slope, pull = self._slope(gaps, aside)
        change = np.matmul(self._inverse, np.where(self._held, 0.0, slope)[..., None])[..., 0]
        # Far from the answer a step may be of any size, and e^x must stay finite.
        np.clip(change, -1.0, 1.0, out=change)
        rows = change[:, :_SIZE]
        if self._aim.timing is None:
            turned = (pull - np.matmul(self._mixed, rows[..., None])[..., 0]) / self._stiff
        else:
            turn = change[:, _SIZE:] if self._aim.zero_free else -rows[:, 2:3]
            turned = np.broadcast_to(turn, self._now.angles.shape)
        return Fitted(rows, turned, self._now.side)

    def _slope(self, gaps: Array, aside: Array) -> tuple[Array, Array]:
        right = np.concatenate((gaps.reshape(len(gaps), -1), aside), axis=1)
        slope = np.matmul(right[:, None, :], self._rows)[:, 0, :]
        if self._aim.timing is not None:
            return slope, slope
        pull = (self._equations.turns * gaps).sum(1)
        return slope - np.matmul(pull[:, None, :], self._shares)[:, 0, :], pull


def _bend(now: Fitted, seen: Slopes, change: Fitted, aim: Aim) -> Complex:
    """Return what the places lag behind a step for their second derivative along it, (n, N)."""
    ahead = slopes(
        *_moved(now, Fitted(_AHEAD * change.rows, _AHEAD * change.angles, change.side), aim)
    )
    straight = np.matmul(seen.by_dimension, change.rows[..., None])[..., 0]
    straight = straight + seen.by_angle * change.angles
    bend: Complex = ((seen.places - ahead.places) / _AHEAD + straight) / _AHEAD
    return bend


def _moved(now: Fitted, change: Fitted, aim: Aim) -> Fitted:
    low, high = _box(aim)
    moved = np.clip(now.rows + change.rows, low, high)
    return Fitted(moved, now.angles + change.angles, now.side)


def _box(aim: Aim) -> tuple[Array, Array]:
    """Return bounds of the rows, (9,)."""
    low, high = np.full(_SIZE, -np.inf), np.full(_SIZE, np.inf)
    low[LENGTHS], high[LENGTHS] = np.log(aim.shortest), np.log(aim.longest)
    low[POINT], high[POINT] = -aim.longest, aim.longest
    return low, high
