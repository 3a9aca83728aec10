# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The four-bar nearest to pairs of angles: least squares of the rocker's errors, not of an equation.

Freudenstein's equation weighs a pair by the growth of its residual with the rocker's angle, which
is small near a toggle and zero at it; its best four-bar is only a start. Here the links are
stretched, and turned in their frames if zeros are free, until the sum of squares of the rocker's
errors is least. If a loop does not close, the rocker points as near as it can, and the distance
between the links is an additional error, with a larger weight.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from math import inf, isfinite

from linkage_ros.errors import SynthesisError
from linkage_ros.tools.design.design import Design, FourBar
from linkage_ros.tools.design.double_double import Array
from linkage_ros.tools.design.pairs.freudenstein import fit_equation, solve_links, wanted_of
from linkage_ros.tools.design.proof import SIDES
from linkage_ros.tools.design.study import scipy_optimize
import numpy as np

_TOLERANCE = 1e-15
_TRIALS = 2000

_GAP = 30.0
"""Weight of a gap relative to an angle: a loop that opens is useless, however small the gap."""

_TRIPLES = 200
"""Triples of the pairs that are tried as starts, and starts that are fitted."""
_STARTS = 6

_LONGEST = 100.0
"""Largest ratio of a link and the ground in a start, either way; the fit may exceed it."""


def nearest_four_bar(
    crank: Sequence[float], rocker: Sequence[float], ground: float, *, free_zeros: bool = False
) -> Design:
    """
    Return the four-bar nearest to more than three pairs, in [rad]; the ground is in [m].

    There are many minima. The result is the best of those reached from the four-bar of
    Freudenstein's equation, and from some that meet three of the pairs exactly; one that closes at
    all pairs is preferred to any that does not. With ``free_zeros`` the zero angles of crank and
    rocker are free too, and five pairs are needed.

    A SynthesisError is raised if the pairs determine no four-bar, a LinkageError if scipy is
    missing.
    """
    starts = [fit_equation(crank, rocker, ground), *_through_triples(crank, rocker, ground)]
    starts.sort(key=root_mean_square)
    fitted = [fit_angles(start, free_zeros=free_zeros) for start in starts[:_STARTS]]
    return min(fitted, key=lambda four_bar: (_is_open(four_bar), root_mean_square(four_bar)))


def _is_open(design: Design) -> bool:
    """Return whether the loop is open at one of the positions."""
    _, gaps = np.split(rocker_errors(design), 2)
    return bool(gaps.any())


def _through_triples(
    crank: Sequence[float], rocker: Sequence[float], ground: float
) -> Iterator[Design]:
    """Yield four-bars that meet three of the pairs exactly, on either assembly."""
    triples = list(combinations(range(len(crank)), 3))
    chosen = np.array(triples[:: -(-len(triples) // _TRIPLES)])
    lengths = solve_links(np.array(crank)[chosen], np.array(rocker)[chosen]).lengths
    size = np.abs(lengths)
    usual = np.all((size < _LONGEST) & (size > 1.0 / _LONGEST), axis=-1)
    wanted = wanted_of(crank, rocker)
    for a, b, c in (lengths[usual] * ground).tolist():
        for side in SIDES:
            yield Design(FourBar.of_lengths(a, b, c, ground, side=side), wanted)


def fit_angles(design: Design, *, free_zeros: bool = False) -> Design:
    """
    Change the links until the rocker's error is least; the ground stays.

    It minimises `root_mean_square` of the errors, on one assembly for all positions: both are
    tried and the better is returned, never one that is worse than the start on its own assembly.
    The minimum is the one reached from the start, and the same each time. With ``free_zeros`` the
    zero angles of crank and rocker are free too.

    A SynthesisError is raised if a position has no wanted rocker angle, or there are fewer
    positions than unknowns; a LinkageError if scipy is not installed.
    """
    count = 5 if free_zeros else 3
    if len(design.wanted) < count:
        raise SynthesisError(
            'the fit',
            f'has {count} unknowns and {len(design.wanted)} pairs: there is nothing to fit',
            'give more pairs, or synthesise exactly',
        )
    least_squares = scipy_optimize().least_squares
    candidates = [(root_mean_square(design), design)]
    for side in SIDES:
        start = replace(design.four_bar, side=side)

        def changed_errors(changes: Array, start: FourBar = start) -> Array:
            return _weighted_errors(design._replace(four_bar=_change_design(start, changes)))

        best = least_squares(
            changed_errors,
            np.zeros(count),
            jac='3-point',
            x_scale='jac',
            ftol=_TOLERANCE,
            xtol=_TOLERANCE,
            gtol=_TOLERANCE,
            max_nfev=_TRIALS,
        )
        fitted = design._replace(four_bar=_change_design(start, best.x))
        candidates.append((root_mean_square(fitted), fitted))
    # A result that overflowed counts as the worst.
    return min(candidates, key=lambda row: row[0] if isfinite(row[0]) else inf)[1]


def root_mean_square(design: Design) -> float:
    """
    Return the root mean square of the rocker's errors on the design's assembly, in [rad].

    A gap of one rocker length counts as 30 rad.
    """
    return float(np.sqrt((_weighted_errors(design) ** 2).sum() / len(design.wanted)))


def _weighted_errors(design: Design) -> Array:
    """Return the weighted errors that are squared."""
    angles, gaps = np.split(rocker_errors(design), 2)
    return np.concatenate((angles, _GAP * gaps))


def rocker_errors(design: Design) -> Array:
    """
    Return the errors of the rocker in each position on the design's assembly; (2n,).

    First the angles in [rad], then the gaps between coupler and rocker, in rocker lengths; 0 if
    the loop closes.
    """
    for number, wanted in enumerate(design.wanted, 1):
        if wanted.rocker is None:
            raise SynthesisError(
                f'position {number}', 'asks for no rocker angle', 'give pairs of angles'
            )
    theta = np.array([wanted.crank for wanted in design.wanted])
    phi = np.array([wanted.rocker for wanted in design.wanted], np.float64)
    four_bar = design.four_bar
    _, b, c, _ = four_bar.lengths
    o2, o4 = four_bar.pivots
    # From O4 to A: the rocker is at an angle of the triangle with sides diagonal, b and c.
    diagonal = o2 + four_bar.crank * np.exp(1j * theta) - o4
    s = np.maximum(np.abs(diagonal), np.finfo(np.float64).tiny)
    cosine = ((s - b) * (s + b) + c * c) / (2.0 * c * s)
    off = np.arccos(np.clip(cosine, -1.0, 1.0))
    angle = np.angle(diagonal) + (off if four_bar.side == 'right' else -off)
    zero = np.angle(four_bar.rocker)
    gap = np.maximum(np.maximum(s - (b + c), abs(b - c) - s), 0.0) / c
    turns = np.round((angle - zero - phi) / (2.0 * np.pi))
    return np.concatenate((angle - zero - phi - 2.0 * np.pi * turns, gap))


def _change_design(four_bar: FourBar, changes: Array) -> FourBar:
    """Stretch the links by the exponentials of three changes, turn crank and rocker by others."""
    crank, coupler, rocker = np.exp(changes[:3]).tolist()
    if len(changes) > 3:
        turn_crank, turn_rocker = np.exp(1j * changes[3:]).tolist()
        crank, rocker = crank * turn_crank, rocker * turn_rocker
    a, b = four_bar.coupler
    return replace(
        four_bar,
        crank=four_bar.crank * crank,
        coupler=(a, a + (b - a) * coupler),
        rocker=four_bar.rocker * rocker,
    )
