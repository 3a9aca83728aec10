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
The structural error: what the rocker of a design has over the angle that was wanted.

It is what remains when every link has its length exactly and nothing bends or plays. At precision
points of an exact design it is 0, between them it is not.
"""

from __future__ import annotations

from collections.abc import Callable
from math import nan, tau
from typing import NamedTuple

from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.survey import Way
from linkage_ros.synthesis.design import Design, ROCKER
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SAMPLES = 720

_ZOOMS = 4
"""How often a summit is looked at closer, each time 32 times; then its height has all digits."""

_GRID = 64

_SUMMITS = 8
"""How many of the highest are looked at: the errors of a good design are nearly equal."""

_SAME = 1e-9
"""What a range may end short of the crank's by and the loop still closes, in [rad]."""


class StructuralError(NamedTuple):
    """
    The error over a range of the crank.

    Attributes
    ----------
    crank
        Angles of the crank from one end of the range to the other, in [rad]; (n,).
    error
        The rocker's angle less the wanted one there, in (−π, π] rad, nan where the loop is open;
        (n,).
    greatest
        The error that is farthest from 0, in [rad]; nan where the loop closes nowhere.
    at
        Angle of the crank where it is made, in [rad].
    rms
        Root of the mean square where the loop closes, in [rad].
    opens_at
        Angle of the crank, on its way through the range, at which the loop opens, in [rad]; None
        where it closes all the way.

    """

    crank: Array
    error: Array
    greatest: float
    at: float
    rms: float
    opens_at: float | None


def structural_error(
    design: Design, wanted: Callable[[Array], Array], low: float, high: float
) -> StructuralError:
    """
    Return the error of a design over a range of the crank, on the design's own assembly.

    Parameters
    ----------
    design
        The design; its own positions are among the samples.
    wanted
        Returns the rocker's angles for angles of the crank, in [rad]; (n,) each.
    low, high
        Where the range begins and ends, in [rad]; it may go down.

    """
    closure = Closure(design.four_bar.linkage())

    def errors(crank: Array) -> Array:
        return _wrapped(_rocker(closure, crank.ravel()) - wanted(crank.ravel())).reshape(
            crank.shape
        )

    first, last = min(low, high), max(low, high)
    precise = [one.crank for one in design.wanted if first <= one.crank <= last]
    crank = np.unique(np.concatenate((np.linspace(first, last, _SAMPLES + 1), precise)))
    if high < low:
        crank = crank[::-1]
    error = errors(crank)
    at, greatest = _greatest(errors, crank, error)
    return StructuralError(
        crank, error, greatest, at, _rms(crank, error), _opens_at(closure, low, high)
    )


def errors_at_positions(design: Design) -> Array:
    """Return the error at each position of a design, on its own assembly, in [rad]; (n,)."""
    closure = Closure(design.four_bar.linkage())
    crank = np.array([one.crank for one in design.wanted])
    wanted = [nan if one.rocker is None else one.rocker for one in design.wanted]
    return _wrapped(_rocker(closure, crank) - np.array(wanted))


def _rocker(closure: Closure, crank: Array) -> Array:
    row = list(closure.linkage.joints).index(f'{ROCKER}_joint')
    angles: Array = closure.solve(crank, derivatives=0).positions[row]
    return angles


def _wrapped(angle: Array) -> Array:
    """Return angles in (−π, π]; small ones keep all their digits."""
    wrapped = angle - tau * np.round(angle / tau)
    return np.where(wrapped <= -np.pi, wrapped + tau, wrapped)


def _greatest(errors: Callable[[Array], Array], crank: Array, error: Array) -> tuple[float, float]:
    """Return where the error is farthest from 0, and what it is there."""
    heights = np.nan_to_num(np.abs(error), nan=-1.0)
    highest = int(np.argmax(heights))
    if heights[highest] < 0.0:
        return nan, nan
    beside = np.pad(heights, 1, constant_values=-1.0)
    summits = np.flatnonzero((heights >= beside[:-2]) & (heights >= beside[2:]) & (heights >= 0.0))
    summits = summits[np.argsort(-heights[summits], kind='stable')[:_SUMMITS]]
    places, found = [crank[highest]], [error[highest]]
    start = crank[np.maximum(summits - 1, 0)]
    end = crank[np.minimum(summits + 1, len(crank) - 1)]
    for _ in range(_ZOOMS):
        grid = np.linspace(start, end, _GRID + 1, axis=-1)
        values = errors(grid)
        best = np.nan_to_num(np.abs(values), nan=-1.0).argmax(-1)
        row = np.arange(len(grid))
        places.extend(grid[row, best])
        found.extend(values[row, best])
        start, end = grid[row, np.maximum(best - 1, 0)], grid[row, np.minimum(best + 1, _GRID)]
    i = int(np.nanargmax(np.abs(found)))
    return float(places[i]), float(found[i])


def _rms(crank: Array, error: Array) -> float:
    """Return the root of the mean square over the parts of the range in which the loop closes."""
    by = np.abs(np.diff(crank))
    squares = 0.5 * (error[1:] ** 2 + error[:-1] ** 2)
    closed = np.isfinite(squares)
    if not closed.any():
        return abs(float(error[0])) if len(error) == 1 else nan
    return float(np.sqrt(np.sum(squares[closed] * by[closed]) / np.sum(by[closed])))


def _opens_at(closure: Closure, low: float, high: float) -> float | None:
    """Return where, on the way from one angle to another, the loop opens, if it does."""
    interval = Way(closure).range_about(low)
    if interval is None:
        return low
    if interval.whole or interval.lowest - _SAME <= high <= interval.highest + _SAME:
        return None
    return interval.highest if high > low else interval.lowest
