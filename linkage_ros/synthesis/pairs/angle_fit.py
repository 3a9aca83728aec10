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
Pairs met as well as may be: least squares of what the rocker is off, not of an equation.

Freudenstein's equation weighs a pair by how fast what it leaves grows with the rocker's angle,
which is little near a toggle and nothing at it; its best four-bar is a start only. Here the links
are stretched, and turned in their frames where zeros are free, until the sum of squares of the
rocker's errors is least. Where a loop does not close the rocker points as near as it can come, and
what the links miss each other by is an error beside the angle's, and counts for more.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from math import inf, isfinite

from linkage_ros.errors import SynthesisError
from linkage_ros.synthesis.design import Design, FourBar
from linkage_ros.synthesis.double_double import Array
from linkage_ros.synthesis.pairs.freudenstein import fit_equation, links, wanted_of
from linkage_ros.synthesis.proof import SIDES
from linkage_ros.synthesis.study import scipy_optimize
import numpy as np

_TOLERANCE = 1e-15
_TRIALS = 2000

_GAP = 30.0
"""What a gap counts for beside an angle: a loop that opens is of no use, however small the gap."""

_TRIPLES = 200
"""How many threes of the pairs are tried as starts, and how many of all starts are fitted."""
_STARTS = 6

_LONGEST = 100.0
"""In grounds, of a start's links, or of the ground in a link: what is fitted may go beyond."""


def nearest(
    crank: Sequence[float], rocker: Sequence[float], ground: float, *, free_zeros: bool = False
) -> Design:
    """
    Return the four-bar that comes nearest to more than three pairs.

    Minima are many. It is the best of those that the four-bar of Freudenstein's equation leads to,
    and some that have three of the pairs exactly; one that closes at all pairs comes before any
    that does not.

    Parameters
    ----------
    crank, rocker
        More than three angles each, in [rad].
    ground
        Length of the ground, in [m].
    free_zeros
        Whether the zero angles of crank and rocker are free too; five pairs then, at least.

    Raises
    ------
    SynthesisError
        Where the pairs fix no four-bar.
    LinkageError
        Where scipy is not installed.

    """
    starts = [fit_equation(crank, rocker, ground), *_through_triples(crank, rocker, ground)]
    starts.sort(key=root_mean_square)
    fitted = [fit_angles(start, free_zeros=free_zeros) for start in starts[:_STARTS]]
    return min(fitted, key=lambda one: (_opens(one), root_mean_square(one)))


def _opens(design: Design) -> bool:
    """Return whether the loop is open in one of the positions."""
    _, gaps = np.split(rocker_errors(design), 2)
    return bool(gaps.any())


def _through_triples(
    crank: Sequence[float], rocker: Sequence[float], ground: float
) -> Iterator[Design]:
    """Yield four-bars that have three of the pairs exactly, on either assembly."""
    triples = list(combinations(range(len(crank)), 3))
    chosen = np.array(triples[:: -(-len(triples) // _TRIPLES)])
    found = links(np.array(crank)[chosen], np.array(rocker)[chosen]).lengths
    size = np.abs(found)
    usual = np.all((size < _LONGEST) & (size > 1.0 / _LONGEST), axis=-1)
    wanted = wanted_of(crank, rocker)
    for a, b, c in (found[usual] * ground).tolist():
        for side in SIDES:
            yield Design(FourBar.of_lengths(a, b, c, ground, side=side), wanted)


def fit_angles(design: Design, *, free_zeros: bool = False) -> Design:
    """
    Change the links until the rocker is off least; the ground stays.

    What is least is `root_mean_square` of the errors, on one assembly for all positions: both are
    tried and the better is returned, never one that is worse than the start on its own assembly.
    The minimum is the one that the start leads to, and the same each time.

    Parameters
    ----------
    design
        The start. All positions that it is wanted for have a rocker angle.
    free_zeros
        Whether the zero angles of crank and rocker are free too.

    Raises
    ------
    SynthesisError
        Where a position asks for no rocker angle, or there are fewer than unknowns.
    LinkageError
        Where scipy is not installed.

    """
    count = 5 if free_zeros else 3
    if len(design.wanted) < count:
        raise SynthesisError(
            'the fit',
            f'has {count} unknowns and {len(design.wanted)} pairs: there is nothing to fit',
            'give more pairs, or synthesise exactly',
        )
    least_squares = scipy_optimize().least_squares
    found = [(root_mean_square(design), design)]
    for side in SIDES:
        start = replace(design.four_bar, side=side)

        def errors(changes: Array, start: FourBar = start) -> Array:
            return _weighed(design._replace(four_bar=_changed(start, changes)))

        best = least_squares(
            errors,
            np.zeros(count),
            jac='3-point',
            x_scale='jac',
            ftol=_TOLERANCE,
            xtol=_TOLERANCE,
            gtol=_TOLERANCE,
            max_nfev=_TRIALS,
        )
        fitted = design._replace(four_bar=_changed(start, best.x))
        found.append((root_mean_square(fitted), fitted))
    # What overflowed is no better than anything.
    return min(found, key=lambda one: one[0] if isfinite(one[0]) else inf)[1]


def root_mean_square(design: Design) -> float:
    """
    Return the root mean square of the rocker's errors on the design's assembly, in [rad].

    A gap of one rocker length counts as 30 rad.
    """
    return float(np.sqrt((_weighed(design) ** 2).sum() / len(design.wanted)))


def _weighed(design: Design) -> Array:
    """Return the errors as they are squared."""
    angles, gaps = np.split(rocker_errors(design), 2)
    return np.concatenate((angles, _GAP * gaps))


def rocker_errors(design: Design) -> Array:
    """
    Return what the rocker is off in each position on the design's assembly; (2n,).

    First the angles in [rad], then what coupler and rocker miss each other by, in rocker lengths;
    0 where they reach.
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
    # From O4 to A: the rocker lies off it by an angle of the triangle that it, b and c make.
    diagonal = o2 + four_bar.crank * np.exp(1j * theta) - o4
    s = np.maximum(np.abs(diagonal), np.finfo(np.float64).tiny)
    cosine = ((s - b) * (s + b) + c * c) / (2.0 * c * s)
    off = np.arccos(np.clip(cosine, -1.0, 1.0))
    angle = np.angle(diagonal) + (off if four_bar.side == 'right' else -off)
    zero = np.angle(four_bar.rocker)
    gap = np.maximum(np.maximum(s - (b + c), abs(b - c) - s), 0.0) / c
    turns = np.round((angle - zero - phi) / (2.0 * np.pi))
    return np.concatenate((angle - zero - phi - 2.0 * np.pi * turns, gap))


def _changed(four_bar: FourBar, changes: Array) -> FourBar:
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
