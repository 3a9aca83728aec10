# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Three pairs of which only the differences matter: the zeros of crank and rocker are free.

Each pair of zeros (α, β) gives Freudenstein's equation three other pairs, θ + α and φ + β, and so
another four-bar: a family of two parameters, of which most have a defect and few a good
transmission angle. Millions of random zeros are scored, and the best are refined. Half a turn of a
zero is the same link with the opposite sign of its length, so zeros from 0 to π are sufficient.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import degrees, hypot, isfinite, pi, remainder

from linkage_ros.errors import SynthesisError
from linkage_ros.tools.design.defects import Needs, needs_penalties
from linkage_ros.tools.design.design import Design, FourBar
from linkage_ros.tools.design.pairs.freudenstein import check_pairs, solve_links, wanted_of
from linkage_ros.tools.design.proof import (
    Array,
    assemble,
    Flags,
    least_transmission,
    Traversal,
    traverse_positions,
)
from linkage_ros.tools.design.study import DesignFound, search
import numpy as np

_FAR = 90.0
"""Weight of an unmet need relative to a degree of transmission angle: more than all of them."""

_LARGEST = 1e6
"""Largest ratio of a link and the ground, either way."""

_POOL = 4096
"""Number of candidates that are refined; the best ones lie side by side."""

_APART = 0.1
"""Designs whose zeros are nearer than this, in [rad], count as one."""

_GRID = 7
_ROUNDS = 24


@dataclass(frozen=True, slots=True)
class ZeroProblem:
    """The candidates of `study.search`: zeros (α, β) of three angle pairs, all in [rad]."""

    crank: tuple[float, ...]
    rocker: tuple[float, ...]
    needs: Needs

    def sample(self, generator: np.random.Generator, count: int) -> Array:
        """Return random zeros; (count, 2)."""
        return generator.uniform(0.0, pi, (count, 2))

    def score(self, candidates: Array) -> Array:
        """
        Return the deficit from a transmission angle of 90 degrees, in degrees; (count,).

        An unmet need counts for more than that. Infinite without a four-bar, and for one with a
        defect.
        """
        lengths, courses, exists = self.courses(candidates)
        ends = courses.directions[:, 0], courses.directions[:, -1]
        angle, _ = least_transmission(lengths, *ends)
        missed = needs_penalties(lengths, angle, self.needs)
        score = (90.0 - np.degrees(angle)) + _FAR * (missed + (missed > 0.0))
        return np.where(exists & courses.is_usable, score, np.inf)

    def courses(self, candidates: Array) -> tuple[Array, Traversal, Flags]:
        """
        Return the four-bars of zeros, their traversals of the pairs, and which exist, (count,).

        The lengths, (count, 4), are crank, coupler, rocker and ground; all 1 where no four-bar
        exists.
        """
        theta, phi = self.crank + candidates[:, :1], self.rocker + candidates[:, 1:]
        signed = solve_links(theta, phi).lengths
        size = np.abs(signed)
        inside = (size < _LARGEST) & (size > 1.0 / _LARGEST)
        exists: Flags = np.all(inside, axis=-1)
        signed = np.where(exists[:, None], signed, 1.0)
        lengths = np.concatenate((np.abs(signed), np.ones((len(signed), 1))), -1)
        a, c = signed[:, :1], signed[:, 2:]
        ax, ay = a * np.cos(theta), a * np.sin(theta)
        bx, by = 1.0 + c * np.cos(phi), c * np.sin(phi)
        left = (1.0 - ax) * (by - ay) + ay * (bx - ax) > 0.0
        return (
            lengths,
            traverse_positions(lengths, theta + np.where(a < 0.0, pi, 0.0), left),
            exists,
        )


def search_zeros(
    crank: Sequence[float],
    rocker: Sequence[float],
    ground: float,
    needs: Needs,
    *,
    seed: int,
    count: int,
    keep: int,
    progress: Callable[[int, int], None] | None = None,
    address: str = '',
) -> tuple[Design, ...]:
    """
    Return the best four-bars for three pairs whose zeros are free, the best first.

    Designs that meet the needs come first, by their transmission angle; then the nearest. None has
    a defect. The angles are in [rad], the ground is in [m]; ``keep`` is the maximum number of
    designs, and the other arguments are as in `study.search`.

    A SynthesisError is raised if two pairs are equal, or none of the zeros tried gives a four-bar
    without defects.
    """
    check_pairs(crank, rocker, ground)
    needs.check()
    problem = ZeroProblem(tuple(crank), tuple(rocker), needs)
    designs = search(
        problem, seed=seed, count=count, keep=_POOL, progress=progress, address=address
    )
    designs = [design for design in designs if isfinite(design.score)]
    if not designs:
        pairs = ', '.join(
            f'{degrees(t):.6g}° → {degrees(p):.6g}°' for t, p in zip(crank, rocker, strict=True)
        )
        raise SynthesisError(
            f'pairs {pairs}',
            f'none of {count} zeros of crank and rocker gives a four-bar without a defect',
            'try more zeros, or move an angle',
        )
    spacing = pi / count**0.5
    best = [_polish(problem, design, spacing) for design in _distinct(designs)[: 4 * keep]]
    return tuple(
        _design(problem, design.candidate, ground) for design in _distinct(sorted(best))[:keep]
    )


def _polish(problem: ZeroProblem, start: DesignFound, radius: float) -> DesignFound:
    """Return the best place near a candidate: in a grid around it, then in finer ones."""
    axis = np.linspace(-1.0, 1.0, _GRID)
    grid = np.stack(np.meshgrid(axis, axis), -1).reshape(-1, 2)
    best = start
    for _ in range(_ROUNDS):
        candidates = np.array(best.candidate) + radius * grid
        scores = problem.score(candidates)
        i = int(scores.argmin())
        if scores[i] < best.score:
            best = DesignFound(float(scores[i]), tuple(candidates[i].tolist()))
        else:
            radius *= 0.4
    return best


def _distinct(designs: Sequence[DesignFound]) -> list[DesignFound]:
    """Return the best of candidates near each other, from a list with the best first."""
    kept: list[DesignFound] = []
    for design in designs:
        alpha, beta = design.candidate
        if all(
            hypot(remainder(alpha - p, pi), remainder(beta - q, pi)) >= _APART
            for _, (p, q) in kept
        ):
            kept.append(design)
    return kept


def _design(problem: ZeroProblem, zeros: Sequence[float], ground: float) -> Design:
    alpha, beta = zeros
    theta = np.array(problem.crank) + alpha
    a, b, c = solve_links(theta, np.array(problem.rocker) + beta).lengths.tolist()
    four_bar = FourBar.of_lengths(a * ground, b * ground, c * ground, ground, alpha, beta)
    return assemble(Design(four_bar, wanted_of(problem.crank, problem.rocker)))
