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
Path generation: four-bars whose coupler point passes as near as can be to given points.

Many are drawn and laid upon the points (`search`), the best are brought nearer
(`fit`), and what is left of them are distinct linkages. A coupler curve has nine numbers: up
to nine points can be met exactly without timing (H. Alt, Über die Erzeugung gegebener ebener
Kurven mit Hilfe des Gelenkvierecks, Zeitschrift für angewandte Mathematik und Mechanik 3 (1923)
13-19), and five with it. Of fewer points there are endlessly many exact answers; those with the
better transmission angles come first then.

Every linkage has two others, its cognates, that trace the same curve (S. Roberts, On three-bar
motion in plane space, Proceedings of the London Mathematical Society 7 (1875) 14-23). They count
as different.
"""

from __future__ import annotations

from cmath import rect
from collections.abc import Callable
from dataclasses import replace
from math import remainder, tau
from typing import NamedTuple

from linkage_ros.errors import SynthesisError
from linkage_ros.kinematics.batch import Array
from linkage_ros.synthesis.course import least_transmission
from linkage_ros.synthesis.design import Design, FourBar, Wanted
from linkage_ros.synthesis.path.aim import Aim, Fitted
from linkage_ros.synthesis.path.arcs import fractions
from linkage_ros.synthesis.path.fit import improve
from linkage_ros.synthesis.path.model import LENGTHS, slopes
from linkage_ros.synthesis.path.search import problem_of
from linkage_ros.synthesis.path.task import PathTask
from linkage_ros.synthesis.study import search
import numpy as np
from numpy.typing import NDArray

COUNT = 200_000
"""Four-bars that are drawn, if not said otherwise."""

_STARTS = 512
_STAGES = ((30, 3e-3, 128), (50, 3e-4, 64), (150, 3e-5, 32))
"""Steps, guard and how many distinct four-bars go on."""

_LAST_STEPS = 300
_THINNED = 32
"""Points that the search looks at; the last steps see all of them."""

_SAME = 0.05
"""Linkages whose places and lengths differ by less than this part of the longest are one."""

_EXACT = 1e-9
"""Errors below this part of the path's size are none."""


class PathResult(NamedTuple):
    """
    A linkage that passes near the points.

    Attributes
    ----------
    design
        With the crank angle at each point; without timing the crank's x axis is along the link.
    rms, greatest
        Of the distances from the points, in [m].

    """

    design: Design
    rms: float
    greatest: float


class Paths(NamedTuple):
    """
    What was found, by error.

    Attributes
    ----------
    found
        The best that were accepted.
    refused
        The best that were not.

    """

    found: tuple[PathResult, ...]
    refused: tuple[PathResult, ...]


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
        Of the four-bars drawn; the same give the same results.
    keep
        How many distinct linkages to return of each kind, at most.
    accept
        Which ones will do; all, if not said.
    progress
        Is told how many of how many were drawn.
    address
        Of a Dask scheduler; '' to draw here.

    Raises
    ------
    SynthesisError
        Where nothing that was drawn reaches the points with links of these sizes.

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
    some = _thinned(len(points))
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
    fitted = problem.starts(np.array([found.candidate for found in drawn]))
    for steps, guard, survivors in _STAGES:
        fitted, squares = improve(fitted, thin, steps, guard)
        fitted = fitted.some(_distinct(fitted, squares, max(survivors, 4 * keep)))
    fitted, squares = improve(_on_all(fitted, some, whole), whole, _LAST_STEPS)
    fitted = fitted.some(_distinct(fitted, squares, len(squares)))
    return _sorted(_results(task, fitted, whole, middle), keep, accept)


def _thinned(points: int) -> NDArray[np.intp]:
    """Return the numbers of the points that are searched for, the first and the last with them."""
    chosen = np.linspace(0, points - 1, min(_THINNED, points)).round().astype(np.intp)
    return np.unique(chosen)


def _on_all(fitted: Fitted, some: NDArray[np.intp], aim: Aim) -> Fitted:
    """Return the same four-bars with crank angles at all points, by how far along they are."""
    if len(some) == len(aim.points):
        return fitted
    if aim.timing is not None:
        return fitted._replace(angles=fitted.angles[:, :1] + (aim.timing - aim.timing[0]))
    way = fractions(aim.points)
    angles = [np.interp(way, way[some], row) for row in fitted.angles]
    return fitted._replace(angles=np.array(angles).reshape(-1, len(way)))


def _distinct(fitted: Fitted, squares: Array, most: int) -> NDArray[np.intp]:
    """Return the numbers of distinct four-bars, the nearest first."""
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


def _results(task: PathTask, fitted: Fitted, aim: Aim, middle: complex) -> list[PathResult]:
    """Return the four-bars in the world, by error; where that is none, by transmission angle."""
    miss = np.abs(aim.points - slopes(*fitted).places)
    rms = np.sqrt((miss * miss).mean(1))
    start, end = fitted.angles[:, 0], fitted.angles[:, -1]
    if aim.full_turn:
        start, end = np.zeros_like(start), np.full_like(end, tau)
    transmission, _ = least_transmission(np.exp(fitted.rows[:, LENGTHS]), start, end)
    order = np.lexsort((-transmission, np.maximum(rms, _EXACT)))
    return [
        PathResult(
            _design(task, fitted.rows[i], fitted.angles[i], fitted.side[i], middle),
            float(rms[i]) * task.size,
            float(miss[i].max()) * task.size,
        )
        for i in order
    ]


def _design(task: PathTask, row: Array, angles: Array, side: float, middle: complex) -> Design:
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
    wanted = (Wanted(crank=t, place=z) for t, z in zip(turned, task.points, strict=True))
    return Design(four_bar, tuple(wanted))


def _sorted(
    results: list[PathResult], keep: int, accept: Callable[[Design], bool] | None
) -> Paths:
    found: list[PathResult] = []
    refused: list[PathResult] = []
    for result in results:
        kind = found if accept is None or accept(result.design) else refused
        if len(kind) < keep:
            kind.append(result)
        if len(found) == keep:
            break
    return Paths(tuple(found), tuple(refused))
