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
A function that a four-bar shall work out: x is the crank's angle, y = f(x) the rocker's.

Both scales are even: x begins and ends where the crank's range does, and f of these two where the
rocker's does (F. Freudenstein, Approximate synthesis of four-bar linkages, Transactions of the
ASME 77 (1955) 853-861: starting and final values, and the scale factors between them). In between
f may go beyond its ends, and the rocker with it. A range may go down: the crank turns back, or y
falls where the rocker's angle grows.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees, isfinite, tau
from typing import NamedTuple

from linkage_ros.errors import SynthesisError
from linkage_ros.synthesis.function.expression import Array, Expression, named
from linkage_ros.synthesis.function.undefined import check_defined
import numpy as np
from numpy.typing import ArrayLike

Range = tuple[float, float]
"""Where something begins and ends; it may go down."""

_SAMPLES = 2000

_ROUNDING = 1e-12
"""What is less of a function's values is rounding."""

_MOST = 1000
"""Precision points; more make no four-bar better."""


@dataclass(frozen=True, slots=True)
class FunctionTask:
    """
    A function to be generated.

    Parameters
    ----------
    function
        f.
    x_range
        Where x begins and ends.
    crank_range, rocker_range
        Angles of the links there, in [rad].

    Raises
    ------
    SynthesisError
        Where a range is none, or f has no value everywhere in it or the same at both ends.

    """

    function: Expression
    x_range: Range
    crank_range: Range
    rocker_range: Range

    def __post_init__(self) -> None:
        _check_range('range', self.x_range)
        _check_turn('crank range', self.crank_range)
        _check_turn('rocker range', self.rocker_range)
        check_defined(self.function, *self.x_range)
        self._check_swing()

    @property
    def y_range(self) -> Range:
        """Return what f is at the ends of the range of x."""
        start, end = self.x_range
        return self.function(start), self.function(end)

    def _check_swing(self) -> None:
        """Refuse a function whose ends say nothing of how far it goes between them."""
        values = self.function(np.linspace(*self.x_range, _SAMPLES + 1))
        start, end = self.y_range
        by = abs(end - start)
        if by <= _ROUNDING * float(np.max(np.abs(values))):
            x_start, x_end = self.x_range
            raise SynthesisError(
                named(self.function.text),
                f'is {start:.10g} both at x = {x_start:.10g} and at {x_end:.10g}, so that both '
                'ends of the rocker range would be one',
                'let the range end where the function is another',
            )
        first, last = self.rocker_range
        swing = float(np.ptp(values)) / by * abs(last - first)
        if swing >= tau:
            raise SynthesisError(
                named(self.function.text),
                f'goes from {start:.6g} to {end:.6g}, but {float(np.ptp(values)):.6g} up and down '
                f'between: the rocker would swing by {degrees(swing):.6g}°',
                'choose a range without its summits and valleys, or a smaller rocker range',
            )


class FunctionError(NamedTuple):
    """
    An error of the rocker, read on the scale of the function.

    Attributes
    ----------
    x, y
        Where it is made, and what the function is there.
    error
        What is shown over y.
    percent
        The same, in percent of what y changes by over the range; above 0 in the direction in
        which y goes.

    """

    x: float
    y: float
    error: float
    percent: float


def chebyshev(low: float, high: float, count: int) -> Array:
    """
    Return precision points of a range, spaced as P. L. Chebyshev has it.

    They are (low + high)/2 − (high − low)/2·cos((2j − 1)π/(2n)), where the polynomial of degree n
    that stays nearest to 0 over the range has its zeros, as half angles, which do not cancel
    near ``low``.

    Raises
    ------
    SynthesisError
        Where they are too many.

    """
    if count > _MOST:
        raise SynthesisError('points', f'{count} of them', f'{_MOST} do')
    half = (
        (2.0 * np.arange(1, count + 1) - 1.0) * (np.pi / (4.0 * count)) if count else np.empty(0)
    )
    points: Array = low + (high - low) * np.sin(half) ** 2
    return points


def pairs(task: FunctionTask, xs: ArrayLike) -> tuple[list[float], list[float]]:
    """
    Return the angles of crank and rocker at precision points, in [rad].

    Raises
    ------
    SynthesisError
        Where a point lies outside of the range, or comes twice.

    """
    points = [float(x) for x in np.asarray(xs, np.float64).ravel()]
    low, high = sorted(task.x_range)
    for number, x in enumerate(points, 1):
        if not low <= x <= high:
            raise SynthesisError(
                f'point {number}',
                f'x = {x:.10g} lies outside of the range {low:.10g} to {high:.10g}',
                'choose it within',
            )
        if x in points[: number - 1]:
            raise SynthesisError(
                f'point {number}', f'x = {x:.10g} comes a second time', 'give each point once'
            )
    start, end = task.x_range
    at = np.array(points)
    crank = _between(task.crank_range, (at - start) / (end - start))
    return crank.tolist(), _rocker(task, at).tolist()


def wanted_rocker(task: FunctionTask, crank: ArrayLike) -> Array:
    """Return the rocker's angles that go with angles of the crank in its range, in [rad]; (…)."""
    return _rocker(task, _x(task, np.asarray(crank, np.float64)))


def on_scale(task: FunctionTask, crank: float, error: float) -> FunctionError:
    """
    Return what an error of the rocker means for the function.

    Parameters
    ----------
    task
        The function.
    crank
        Where, in [rad].
    error
        What the rocker's angle has over the wanted one, in [rad].

    """
    x = float(_x(task, np.array(crank)))
    (start, end), (first, last) = task.y_range, task.rocker_range
    part = error / (last - first)
    return FunctionError(x, task.function(x), part * (end - start), 100.0 * part)


def _x(task: FunctionTask, crank: Array) -> Array:
    """Return x at angles of the crank, within the range of x also where these round."""
    start, end = task.crank_range
    x: Array = np.clip(
        _between(task.x_range, (crank - start) / (end - start)),
        min(task.x_range),
        max(task.x_range),
    )
    return x


def _rocker(task: FunctionTask, x: Array) -> Array:
    """Return the rocker's angles at values of x."""
    start, end = task.y_range
    return _between(task.rocker_range, (task.function(x) - start) / (end - start))


def _between(ends: Range, part: Array) -> Array:
    """Return what lies a part of the way between two ends, which themselves are exact."""
    start, end = ends
    return start * (1.0 - part) + end * part


def _check_range(name: str, ends: Range) -> None:
    start, end = ends
    if not isfinite(end - start):
        raise SynthesisError(name, f'{start} to {end} is none', 'give it two numbers')
    if start == end:
        raise SynthesisError(
            name, f'begins and ends at {start:.10g}', 'let it end where it does not begin'
        )


def _check_turn(name: str, ends: Range) -> None:
    start, end = map(degrees, ends)
    _check_range(name, (start, end))
    if abs(ends[1] - ends[0]) >= tau:
        raise SynthesisError(
            name, f'{start:.10g}° to {end:.10g}° is a full turn or more', 'keep it below 360°'
        )
