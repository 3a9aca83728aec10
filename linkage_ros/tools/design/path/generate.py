# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Path generation: four-bars whose coupler point passes as near as possible to given points.

Many four-bars are drawn and placed on the points (`search`), the best are improved, and the
distinct linkages among them are the result. A coupler curve has nine numbers: up to nine points
can be met exactly without timing (H. Alt, Über die Erzeugung gegebener ebener Kurven mit Hilfe des
Gelenkvierecks, Zeitschrift für angewandte Mathematik und Mechanik 3 (1923) 13-19), and five with
it. Fewer points have infinitely many exact solutions; those with the better transmission angles
then come first. Every linkage has two others, its cognates, that trace the same curve (S. Roberts,
On three-bar motion in plane space, Proceedings of the London Mathematical Society 7 (1875) 14-23).
They count as different.

Many four-bars are fitted at once, each from its own start, by least squares of the distances,
damped until a step improves them (K. Levenberg, 1944; D. W. Marquardt, 1963). A step that opens
the loop on its way, or passes the points in another order, is refused whatever the distances are.
A guard keeps the first steps away from toggles, so that no fit ends at such an edge far from the
solution: the cotangent of the transmission angle counts as a distance. In a step

- without timing, the crank angle of every point is an unknown too. It moves only one place, so it
  is eliminated from the normal equations (a Schur complement): they stay nine by nine however many
  points there are.
- lengths stay within bounds. A length at a bound that would leave it is held for that step.
- the step is curved like the curves, to second order.
"""

from __future__ import annotations

from cmath import rect
from collections.abc import Callable
from dataclasses import replace
from math import remainder, tau
from typing import NamedTuple

from linkage_ros.errors import SynthesisError
from linkage_ros.kinematics import Array, Complex, Mask
from linkage_ros.tools.design.design import Design, DesignRequest, FourBar
from linkage_ros.tools.design.path.curves import (
    Aim,
    COLUMNS,
    Fitted,
    LENGTHS,
    path_distances,
    PathTask,
    POINT,
    point_slopes,
    Slopes,
    stay_closed,
    transmission_cotangents,
)
from linkage_ros.tools.design.path.search import problem_of
from linkage_ros.tools.design.proof import least_transmission
from linkage_ros.tools.design.study import search
import numpy as np
from numpy.typing import NDArray

_SIZE = len(COLUMNS)

_BENT = 0.4
"""Largest second-order part of a step, relative to its length."""

_AHEAD = 0.1
"""Fraction of the step at which the curvature is evaluated."""

_TINY = 1e-30
"""Prevents a division by zero if a crank angle moves nothing."""

_DAMPING = 1e-2
_LEAST_DAMPED, _MOST_DAMPED = 1e-12, 1e10
_HELPED, _FAILED = 0.2, 5.0
"""Factors of the damping after a step that improved the distances, and after one that did not."""

_SETTLED = 1e-15
"""A step with a smaller relative gain of the squares is the last."""

_NOTHING = 1e-30
"""Squares below this are rounding, for a path of size 1."""

COUNT = 200_000
"""Default number of four-bars that are drawn."""

_STARTS = 512
_STAGES = ((30, 3e-3, 128), (50, 3e-4, 64), (150, 3e-5, 32))
"""Steps, guard, and the number of distinct four-bars that continue."""

_LAST_STEPS = 300
_THINNED = 32
"""Points used by the search; the last steps use all of them."""

_SAME = 0.05
"""Linkages that differ by less than this, relative to the longest length, count as one."""

_EXACT = 1e-9
"""Errors below this, relative to the size of the path, count as none."""


def damped_step(now: Fitted, seen: Slopes, damping: Array, aim: Aim, guard: float) -> Fitted:
    """
    Return the result of one damped step, within the bounds.

    Without a guard the step has a second-order part (M. K. Transtrum and J. P. Sethna,
    Improvements to the Levenberg-Marquardt algorithm, arXiv:1201.5885, 2012): errors of coupler
    curves have long, curved valleys, along which straight steps are short.
    """
    equations = _step_equations(now, seen, aim, guard)
    solve = _PathSolver(now, equations, damping, aim)
    change = solve(equations.gaps, equations.aside)
    if not guard:
        bend = _second_order_change(now, seen, change, aim)
        more = solve(np.stack((bend.real, bend.imag), axis=1), equations.aside)
        sizes = [np.abs(part).max(1) for part in (change.rows, more.rows)]
        helps = (sizes[1] <= _BENT * sizes[0])[:, None]
        change = Fitted(
            change.rows + helps * more.rows, change.angles + helps * more.angles, change.side
        )
    return _move_design(now, change, aim)


class _PathEquations(NamedTuple):
    """The equations of a step: derivatives times step = gaps, by least squares."""

    by: Array  # Derivatives by the unknowns common to all points, (n, parts, N, m)
    turns: Array  # Derivatives by the crank angle of the point, (n, parts, N)
    gaps: Array  # Right sides, (n, parts, N)
    # Derivatives of equations without a point, (n, k, m), and their gaps, (n, k).
    more: Array
    aside: Array


def _step_equations(now: Fitted, seen: Slopes, aim: Aim, guard: float) -> _PathEquations:
    miss = aim.points - seen.places
    by = np.stack((seen.by_dimension.real, seen.by_dimension.imag), axis=1)
    turns = np.stack((seen.by_angle.real, seen.by_angle.imag), axis=1)
    gaps = np.stack((miss.real, miss.imag), axis=1)
    more, aside = np.zeros((len(by), 0, _SIZE)), np.zeros((len(by), 0))
    if guard:
        # If the crank's angle is not an unknown it is 0 or π, where a full turn comes nearest to
        # its toggles.
        folded, by_dimension, by_angle = transmission_cotangents(now.rows, now.angles)
        by = np.concatenate((by, guard * by_dimension[:, None]), axis=1)
        turns = np.concatenate((turns, guard * by_angle[:, None]), axis=1)
        gaps = np.concatenate((gaps, -guard * folded[:, None]), axis=1)
        if aim.full_turn:
            folded, by_dimension, _ = transmission_cotangents(
                now.rows, np.broadcast_to((0.0, np.pi), (len(by), 2))
            )
            more, aside = guard * by_dimension, -guard * folded
    if aim.timing is not None and aim.zero_free:
        by = np.concatenate((by, turns[..., None]), axis=3)
        more = np.pad(more, ((0, 0), (0, 0), (0, 1)))
    elif aim.timing is not None:
        # The crank's angle in the world is given: turning the ground turns it back.
        by[..., 2] -= turns
    return _PathEquations(by, turns, gaps, more, aside)


class _PathSolver:
    """The damped normal equations of a step, ready for any gaps."""

    def __init__(self, now: Fitted, equations: _PathEquations, damping: Array, aim: Aim) -> None:
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
        slope, _ = self._error_gradient(equations.gaps, equations.aside)
        low, high = _row_bounds(aim)
        self._held[:, :_SIZE] = (now.rows <= low) & (slope[:, :_SIZE] < 0.0)
        self._held[:, :_SIZE] |= (now.rows >= high) & (slope[:, :_SIZE] > 0.0)
        matrix *= ~self._held[:, :, None] & ~self._held[:, None, :]
        matrix[:, diagonal, diagonal] += self._held
        self._inverse = np.linalg.inv(matrix)

    def __call__(self, gaps: Array, aside: Array) -> Fitted:
        """Return the change of rows and angles."""
        slope, pull = self._error_gradient(gaps, aside)
        change = np.matmul(self._inverse, np.where(self._held, 0.0, slope)[..., None])[..., 0]
        # Far from the solution a step may have any size, and e^x must stay finite.
        np.clip(change, -1.0, 1.0, out=change)
        rows = change[:, :_SIZE]
        if self._aim.timing is None:
            turned = (pull - np.matmul(self._mixed, rows[..., None])[..., 0]) / self._stiff
        else:
            turn = change[:, _SIZE:] if self._aim.zero_free else -rows[:, 2:3]
            turned = np.broadcast_to(turn, self._now.angles.shape)
        return Fitted(rows, turned, self._now.side)

    def _error_gradient(self, gaps: Array, aside: Array) -> tuple[Array, Array]:
        right = np.concatenate((gaps.reshape(len(gaps), -1), aside), axis=1)
        slope = np.matmul(right[:, None, :], self._rows)[:, 0, :]
        if self._aim.timing is not None:
            return slope, slope
        pull = (self._equations.turns * gaps).sum(1)
        return slope - np.matmul(pull[:, None, :], self._shares)[:, 0, :], pull


def _second_order_change(now: Fitted, seen: Slopes, change: Fitted, aim: Aim) -> Complex:
    """Return the second-order change of the places along a step, (n, N)."""
    ahead = point_slopes(
        *_move_design(now, Fitted(_AHEAD * change.rows, _AHEAD * change.angles, change.side), aim)
    )
    straight = np.matmul(seen.by_dimension, change.rows[..., None])[..., 0]
    straight = straight + seen.by_angle * change.angles
    bend: Complex = ((seen.places - ahead.places) / _AHEAD + straight) / _AHEAD
    return bend


def _move_design(now: Fitted, change: Fitted, aim: Aim) -> Fitted:
    low, high = _row_bounds(aim)
    moved = np.clip(now.rows + change.rows, low, high)
    return Fitted(moved, now.angles + change.angles, now.side)


def _row_bounds(aim: Aim) -> tuple[Array, Array]:
    """Return the bounds of the rows, (9,)."""
    low, high = np.full(_SIZE, -np.inf), np.full(_SIZE, np.inf)
    low[LENGTHS], high[LENGTHS] = np.log(aim.shortest), np.log(aim.longest)
    low[POINT], high[POINT] = -aim.longest, aim.longest
    return low, high


def improve(start: Fitted, aim: Aim, steps: int, guard: float = 0.0) -> tuple[Fitted, Array]:
    """
    Return the four-bars after at most ``steps``, and their sums of squared distances, (n,).

    Invalid four-bars (open, or with points out of order) have inf, and are not changed. ``guard``
    is the weight of a transmission angle of 45° as a distance; it is not part of the sums.
    """
    now = Fitted(*(np.array(part) for part in start))
    seen = point_slopes(*now)
    cost = _fit_cost(now, seen, aim, guard)
    damping = np.full(len(cost), _DAMPING)
    going = np.flatnonzero(np.isfinite(cost))
    # A trial may be open, with meaningless derivatives: its cost is inf.
    with np.errstate(all='ignore'):
        for _ in range(steps):
            if not len(going):
                break
            at = Slopes(*(part[going] for part in seen))
            tried = damped_step(now.select_rows(going), at, damping[going], aim, guard)
            fresh = point_slopes(*tried)
            reached = _fit_cost(tried, fresh, aim, guard)
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
    return now, np.where(np.isfinite(cost), _squared_distances(seen, aim), np.inf)


def are_allowed(fitted: Fitted, aim: Aim) -> Mask:
    """Return which four-bars stay closed on their way through the points, in order."""
    angles = fitted.angles
    low, high = angles.min(1), angles.max(1)
    good: Mask = np.ones(len(low), dtype=bool)
    if aim.timing is None:
        along = np.diff(angles, axis=1) * np.sign(angles[:, -1:] - angles[:, :1])
        good = (along > 0.0).all(1) & (high - low < tau)
    if aim.full_turn:
        low, high = np.zeros_like(low), np.full_like(high, tau)
    good &= stay_closed(fitted.rows, low, high)
    return good


def _fit_cost(fitted: Fitted, seen: Slopes, aim: Aim, guard: float) -> Array:
    squares = _squared_distances(seen, aim)
    if guard:
        squares += guard * guard * _fold_angles(fitted.rows, fitted.angles)
        if aim.full_turn:
            squares += guard * guard * _fold_angles(fitted.rows, np.array([[0.0, np.pi]]))
    return np.where(are_allowed(fitted, aim), squares, np.inf)


def _fold_angles(rows: Array, angles: Array) -> Array:
    folded = transmission_cotangents(rows, angles)[0]
    squares: Array = (folded * folded).sum(1)
    return squares


def _squared_distances(seen: Slopes, aim: Aim) -> Array:
    miss = aim.points - seen.places
    total: Array = (miss.real**2 + miss.imag**2).sum(1)
    total[~np.isfinite(total)] = np.inf
    return total


class PathResult(NamedTuple):
    """A linkage that passes near the points."""

    # The design, with the crank angle at each point; without timing the crank's x axis is along
    # the link.
    design: Design
    # Root mean square and largest of the distances from the points, in [m].
    rms: float
    greatest: float


class Paths(NamedTuple):
    """The result of a path generation, sorted by error."""

    found: tuple[PathResult, ...]  # The best accepted linkages
    refused: tuple[PathResult, ...]  # The best refused linkages


def generate_path(
    task: PathTask,
    *,
    seed: int,
    count: int = COUNT,
    keep: int = 3,
    accept: Callable[[Design], bool] | None = None,
    progress: Callable[[int, int], None] | None = None,
    address: str = '',
) -> Paths:
    """
    Find four-bars that pass nearest to points.

    Parameters
    ----------
    task
        The points.
    seed, count
        Seed and number of the drawn four-bars; the same values give the same results.
    keep
        Most distinct linkages of each kind to return.
    accept
        Returns whether a linkage is acceptable; by default all are.
    progress
        Called with the number of drawn four-bars, and their total.
    address
        Address of a Dask scheduler; '' to draw in this process.

    Raises
    ------
    SynthesisError
        If no drawn four-bar reaches the points with links of these sizes.

    """
    points = np.array(task.points, dtype=np.complex128)
    middle = complex(points.mean())
    whole = Aim(
        (points - middle) / task.size,
        None if task.timing is None else np.array(task.timing, dtype=np.float64),
        task.zero_free,
        task.closed or task.full_turn,
        *task.links,
    )
    some = _thin_points(len(points))
    timing = None if whole.timing is None else whole.timing[some]
    thin = replace(whole, points=whole.points[some], timing=timing)
    problem = problem_of(thin, task.closed)
    drawn = search(
        problem, seed=seed, count=count, keep=_STARTS, progress=progress, address=address
    )
    if not drawn:
        raise SynthesisError(
            'path',
            f'none of {count} four-bars with links of {task.links[0]:g} to {task.links[1]:g} '
            'times its size reaches the points',
            'allow longer links, or draw more',
        )
    fitted = problem.place_candidates(np.array([design.candidate for design in drawn]))
    for steps, guard, survivors in _STAGES:
        fitted, squares = improve(fitted, thin, steps, guard)
        fitted = fitted.select_rows(_distinct_indices(fitted, squares, max(survivors, 4 * keep)))
    fitted, squares = improve(_on_all(fitted, some, whole), whole, _LAST_STEPS)
    fitted = fitted.select_rows(_distinct_indices(fitted, squares, len(squares)))
    return _sort_paths(_path_results(task, fitted, whole, middle), keep, accept)


def _thin_points(points: int) -> NDArray[np.intp]:
    """Return the indices of the points for the search, including the first and the last."""
    chosen = np.linspace(0, points - 1, min(_THINNED, points)).round().astype(np.intp)
    return np.unique(chosen)


def _on_all(fitted: Fitted, some: NDArray[np.intp], aim: Aim) -> Fitted:
    """Return the same four-bars with crank angles at all points, by distance along the path."""
    if len(some) == len(aim.points):
        return fitted
    if aim.timing is not None:
        return fitted._replace(angles=fitted.angles[:, :1] + (aim.timing - aim.timing[0]))
    way = path_distances(aim.points)
    angles = [np.interp(way, way[some], row) for row in fitted.angles]
    return fitted._replace(angles=np.array(angles).reshape(-1, len(way)))


def _distinct_indices(fitted: Fitted, squares: Array, most: int) -> NDArray[np.intp]:
    """Return the indices of distinct four-bars, the nearest first."""
    a, b, c, d = np.exp(fitted.rows[:, LENGTHS]).T
    x, y, direction = fitted.rows[:, :3].T
    rest = fitted.rows[:, 7:]
    looks = np.column_stack(
        (x, y, x + d * np.cos(direction), y + d * np.sin(direction), a, b, c, rest, fitted.side)
    )
    same = _SAME * np.maximum.reduce((a, b, c, d))
    order = np.argsort(squares, kind='stable')
    order = order[np.isfinite(squares[order])]
    chosen: list[np.intp] = []
    while len(order) and len(chosen) < most:
        chosen.append(order[0])
        order = order[np.abs(looks[order] - looks[order[0]]).max(1) > same[order[0]]]
    return np.array(chosen, dtype=np.intp)


def _path_results(task: PathTask, fitted: Fitted, aim: Aim, middle: complex) -> list[PathResult]:
    """Return the designs, by error; those without an error by transmission angle."""
    miss = np.abs(aim.points - point_slopes(*fitted).places)
    rms = np.sqrt((miss * miss).mean(1))
    start, end = fitted.angles[:, 0], fitted.angles[:, -1]
    if aim.full_turn:
        start, end = np.zeros_like(start), np.full_like(end, tau)
    transmission, _ = least_transmission(np.exp(fitted.rows[:, LENGTHS]), start, end)
    order = np.lexsort((-transmission, np.maximum(rms, _EXACT)))
    return [
        PathResult(
            _build_design(task, fitted.rows[i], fitted.angles[i], fitted.side[i], middle),
            float(rms[i]) * task.size,
            float(miss[i].max()) * task.size,
        )
        for i in order
    ]


def _build_design(
    task: PathTask, row: Array, angles: Array, side: float, middle: complex
) -> Design:
    x, y, direction = (float(value) for value in row[:3])
    a, b, c, d = (task.size * float(length) for length in np.exp(row[LENGTHS]))
    o2 = middle + task.size * complex(x, y)
    crank = complex(a, 0.0)
    if task.timing is None:
        first = remainder(direction + float(angles[0]), tau)
        turned = [first + float(angle - angles[0]) for angle in angles]
    else:
        turned = list(task.timing)
        if task.zero_free:
            crank = rect(a, remainder(direction + float(angles[0]) - turned[0], tau))
    four_bar = FourBar(
        pivots=(o2, o2 + rect(d, direction)),
        crank=crank,
        coupler=(0j, complex(b, 0.0)),
        rocker=complex(c, 0.0),
        side='left' if side > 0.0 else 'right',
        traced=task.size * complex(*row[7:]),
    )
    wanted = (DesignRequest(crank=t, place=z) for t, z in zip(turned, task.points, strict=True))
    return Design(four_bar, tuple(wanted))


def _sort_paths(
    results: list[PathResult], keep: int, accept: Callable[[Design], bool] | None
) -> Paths:
    accepted: list[PathResult] = []
    refused: list[PathResult] = []
    for result in results:
        kind = accepted if accept is None or accept(result.design) else refused
        if len(kind) < keep:
            kind.append(result)
        if len(accepted) == keep:
            break
    return Paths(tuple(accepted), tuple(refused))
