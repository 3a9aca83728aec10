# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Function generation: a four-bar whose crank angle is x and whose rocker angle is y = f(x).

Both scales are linear: the range of x corresponds to the range of the crank, and the values of f
at its ends to the range of the rocker (F. Freudenstein, Approximate synthesis of four-bar
linkages, Transactions of the ASME 77 (1955) 853-861: starting and final values, and the scale
factors between them). In between f may go beyond its values at the ends, and the rocker with it.
A range may decrease: the crank turns back, or y falls while the rocker's angle grows.

The structural error is the rocker angle of a design minus the wanted one. It remains even if every
link has its exact length and nothing bends or has play. At the precision points of an exact design
it is 0, between them it is not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import degrees, floor, isfinite, log10, nan, tau
from typing import NamedTuple

from linkage_ros.errors import quote, SynthesisError
from linkage_ros.kinematics import InputSweep, PlanarClosure
from linkage_ros.tools.design.design import Design, ROCKER
from linkage_ros.tools.design.function.expression import Array, Expression, formula_name
from linkage_ros.tools.design.pairs.freudenstein import exact_four_bar
import numpy as np
from numpy.typing import ArrayLike

_SAMPLES = 2000

_ZOOMS = 3
"""Each zoom makes the samples about 700 times denser, where the function is steepest."""

_JUMP = 0.1
"""A step is a jump if this fraction of it remains when it is sampled 3e8 times closer."""

_ROUNDING = 1e-12
"""Smaller fractions of a function's values are rounding."""

Range = tuple[float, float]
"""First and last value of a range; it may decrease."""

_MOST = 1000
"""Most precision points; more do not improve a four-bar."""

_ERROR_SAMPLES = 720

_ERROR_ZOOMS = 4
"""Zooms on a maximum, each 32 times closer; then its height has all digits."""

_GRID = 64

_SUMMITS = 8
"""Number of maxima that are refined: the errors of a good design are nearly equal."""

_SAME = 1e-9
"""In [rad]: a loop that opens nearer than this to the end of a range counts as closed there."""


def check_defined(function: Expression, low: float, high: float) -> None:
    """
    Raise a SynthesisError if a function is undefined or jumps somewhere in a range.

    The error names the place and a possible range. The function is sampled, and the edges of
    undefined parts are narrowed down; a gap between two samples is missed.
    """
    low, high = min(low, high), max(low, high)
    xs = np.linspace(low, high, _SAMPLES + 1)
    ys = function(xs)
    if not np.isfinite(ys).all():
        raise _undefined_error(function, xs, ys)
    jump = _find_jump(function, xs, ys)
    if jump is not None:
        raise SynthesisError(
            formula_name(function.text),
            f'jumps, or goes to infinity, at x = {_rounded_text(jump, high - low)}',
            'choose a range on one side of it',
        )


def _undefined_error(function: Expression, xs: Array, ys: Array) -> SynthesisError:
    """Return the error for a function that is undefined at some samples."""
    span = float(xs[-1] - xs[0])
    good = np.isfinite(ys)
    runs = _defined_runs(function, xs, good)
    start, end = next((start, end) for start, end, has_value in runs if not has_value)
    value = ys[int(np.argmin(good))]
    reason = 'is not defined' if np.isnan(value) else 'is infinite'
    usable = [(start, end) for start, end, has_value in runs if has_value]
    if not usable:
        return SynthesisError(
            formula_name(function.text), f'{reason} anywhere in the range', 'choose another range'
        )
    first, last = _rounded_text(start, span), _rounded_text(end, span)
    if first == last:
        place, remedy = f'at x = {first}', 'choose a range without it'
    else:
        place = f'from x = {first} to {last}'
        widest = max(usable, key=lambda run: run[1] - run[0])
        ends = ' to '.join(_rounded_text(x, span) for x in widest)
        remedy = f'choose a range within {ends}'
    return SynthesisError(formula_name(function.text), f'{reason} {place}', remedy)


def _defined_runs(function: Expression, xs: Array, good: Array) -> list[tuple[float, float, bool]]:
    """Return the parts of a range in which a function is defined, and in which it is not."""
    runs = []
    start = float(xs[0])
    for i in np.flatnonzero(np.diff(good)):
        edge = _find_edge(function, float(xs[i]), float(xs[i + 1]))
        runs.append((start, edge, bool(good[i])))
        start = edge
    return [*runs, (start, float(xs[-1]), bool(good[-1]))]


def _find_edge(function: Expression, low: float, high: float) -> float:
    """Return the place between two others at which a function becomes defined or undefined."""
    before = isfinite(function(low))
    while low < (middle := 0.5 * (low + high)) < high:
        if isfinite(function(middle)) == before:
            low = middle
        else:
            high = middle
    return high


def _find_jump(function: Expression, xs: Array, ys: Array) -> float | None:
    """
    Return the place where a function jumps: a pole between two samples, or an angle that wraps.

    The search zooms in on the steepest place.
    """
    largest = []
    for _ in range(_ZOOMS + 1):
        with np.errstate(all='ignore'):
            steps = np.abs(np.diff(ys))
        steepest = int(np.argmax(steps))
        largest.append(float(steps[steepest]))
        # One step more on each side: a pole may lie next to the steepest step.
        low, high = xs[max(steepest - 1, 0)], xs[min(steepest + 2, len(xs) - 1)]
        place = 0.5 * float(xs[steepest] + xs[steepest + 1])
        xs = np.linspace(low, high, _SAMPLES + 1)
        ys = function(xs)
        if not np.isfinite(ys).all():
            return float(xs[int(np.argmin(np.isfinite(ys)))])
    size = float(np.max(np.abs(ys)))
    return place if largest[-1] > max(_JUMP * largest[0], _ROUNDING * size) else None


def _rounded_text(x: float, span: float) -> str:
    """Return a place with the digits that matter in a range of this width."""
    # Adding 0 makes 0 of -0.
    return f'{round(x, 10 - floor(log10(span))) + 0.0:.10g}'


@dataclass(frozen=True, slots=True)
class FunctionTask:
    """
    A function to be generated by a four-bar.

    A SynthesisError is raised if a range is invalid, or f is undefined in it or has equal values
    at both ends.
    """

    function: Expression
    x_range: Range  # First and last x
    crank_range: Range  # Crank angles at the first and the last x, in [rad]
    rocker_range: Range  # Rocker angles there, in [rad]

    def __post_init__(self) -> None:
        _check_range('range', self.x_range)
        _check_turn('crank range', self.crank_range)
        _check_turn('rocker range', self.rocker_range)
        check_defined(self.function, *self.x_range)
        self._check_swing()

    @property
    def y_range(self) -> Range:
        """Return the values of f at the ends of the range of x."""
        start, end = self.x_range
        return self.function(start), self.function(end)

    def _check_swing(self) -> None:
        """Refuse a function that is equal at both ends, or whose rocker would turn fully."""
        values = self.function(np.linspace(*self.x_range, _SAMPLES + 1))
        start, end = self.y_range
        by = abs(end - start)
        if by <= _ROUNDING * float(np.max(np.abs(values))):
            x_start, x_end = self.x_range
            raise SynthesisError(
                formula_name(self.function.text),
                f'is {start:.10g} both at x = {x_start:.10g} and at {x_end:.10g}, so that both '
                'ends of the rocker range would be one',
                'let the range end where the function is another',
            )
        first, last = self.rocker_range
        swing = float(np.ptp(values)) / by * abs(last - first)
        if swing >= tau:
            raise SynthesisError(
                formula_name(self.function.text),
                f'goes from {start:.6g} to {end:.6g}, but {float(np.ptp(values)):.6g} up and down '
                f'between: the rocker would swing by {degrees(swing):.6g}°',
                'choose a range without its summits and valleys, or a smaller rocker range',
            )


class FunctionError(NamedTuple):
    """An error of the rocker, read on the scale of the function."""

    # Where the error occurs, and the value of the function there.
    x: float
    y: float
    error: float  # The shown value minus y
    # The same, in percent of the change of y over the range; above 0 in the direction of that
    # change.
    percent: float


def chebyshev_points(low: float, high: float, count: int) -> Array:
    """
    Return precision points of a range, by P. L. Chebyshev's spacing.

    They are (low + high)/2 − (high − low)/2·cos((2j − 1)π/(2n)), the zeros of the polynomial of
    degree n that deviates least from 0 over the range; computed by half angles, which do not
    cancel near ``low``.

    A SynthesisError is raised if there are too many points.
    """
    if count > _MOST:
        raise SynthesisError('points', f'{count} of them', f'{_MOST} do')
    half = (
        (2.0 * np.arange(1, count + 1) - 1.0) * (np.pi / (4.0 * count)) if count else np.empty(0)
    )
    points: Array = low + (high - low) * np.sin(half) ** 2
    return points


def angle_pairs(task: FunctionTask, xs: ArrayLike) -> tuple[list[float], list[float]]:
    """
    Return the angles of crank and rocker at precision points, in [rad].

    A SynthesisError is raised if a point lies outside of the range, or is repeated.
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
    crank = _interpolate(task.crank_range, (at - start) / (end - start))
    return crank.tolist(), _rocker_at_x(task, at).tolist()


def wanted_rocker(task: FunctionTask, crank: ArrayLike) -> Array:
    """Return the rocker's angles for angles of the crank in its range, in [rad]; (…)."""
    return _rocker_at_x(task, _x_at_crank(task, np.asarray(crank, np.float64)))


def on_scale(task: FunctionTask, crank: float, error: float) -> FunctionError:
    """Return an error of the rocker's angle, at a crank angle, as one of the function."""
    x = float(_x_at_crank(task, np.array(crank)))
    (start, end), (first, last) = task.y_range, task.rocker_range
    part = error / (last - first)
    return FunctionError(x, task.function(x), part * (end - start), 100.0 * part)


def _x_at_crank(task: FunctionTask, crank: Array) -> Array:
    """Return x at angles of the crank, within the range of x in spite of rounding."""
    start, end = task.crank_range
    x: Array = np.clip(
        _interpolate(task.x_range, (crank - start) / (end - start)),
        min(task.x_range),
        max(task.x_range),
    )
    return x


def _rocker_at_x(task: FunctionTask, x: Array) -> Array:
    """Return the rocker's angles at values of x."""
    start, end = task.y_range
    return _interpolate(task.rocker_range, (task.function(x) - start) / (end - start))


def _interpolate(ends: Range, part: Array) -> Array:
    """Interpolate between two ends, which are exact themselves."""
    start, end = ends
    return start * (1.0 - part) + end * part


def _check_range(name: str, ends: Range) -> None:
    start, end = ends
    if not isfinite(end - start):
        raise SynthesisError(name, f'{start} to {end} is not a range', 'write two finite numbers')
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


def generate_function(
    function: str,
    x_range: Range,
    crank_range: Range,
    rocker_range: Range,
    *,
    points: int = 3,
    ground: float = 1.0,
) -> Design:
    """
    Design a four-bar that computes a function.

    With three precision points it meets them exactly, by Freudenstein's equation; with more points
    it is the nearest four-bar, which needs scipy.

    Parameters
    ----------
    function
        Function of x, such as ``'log10(x)'``.
    x_range
        First and last x.
    crank_range, rocker_range
        Angles of crank and rocker there, in [rad].
    points
        Number of precision points, spaced by `chebyshev_points`.
    ground
        Length of the ground, in [m].

    Raises
    ------
    SynthesisError
        If the function or a range is invalid, or no four-bar of finite links exists.
    LinkageError
        If scipy is needed and not installed.
    TypeError
        If the function is not a string.

    """
    if not isinstance(function, str):
        raise TypeError(f"function: {quote(function)} is not a string; write it as 'log10(x)'")
    if points < 3:
        raise SynthesisError('points', f'there are {points}', 'ask for 3 or more')
    task = FunctionTask(Expression(function), x_range, crank_range, rocker_range)
    crank, rocker = angle_pairs(task, chebyshev_points(*x_range, points))
    if points > 3:
        from linkage_ros.tools.design.pairs.angle_fit import (
            nearest_four_bar,  # local import: to fit only
        )

        return nearest_four_bar(crank, rocker, ground)
    design, _ = exact_four_bar(crank, rocker, ground)
    return design


class StructuralError(NamedTuple):
    """The error over a range of the crank."""

    crank: Array  # Angles of the crank from one end of the range to the other, in [rad]; (n,)
    # The rocker's angle minus the wanted one there, in (−π, π] rad, NaN if the loop is open; (n,).
    error: Array
    greatest: float  # The error that is farthest from 0, in [rad]; NaN if the loop closes nowhere
    greatest_at: float  # Angle of the crank at that error, in [rad]
    rms: float  # Root of the mean square where the loop closes, in [rad]
    # Angle of the crank, on its way through the range, at which the loop opens, in [rad]; None if
    # it closes all the way.
    opens_at: float | None


def structural_error(
    design: Design, wanted: Callable[[Array], Array], low: float, high: float
) -> StructuralError:
    """
    Return the error of a design over a range of the crank, on the design's own assembly.

    ``wanted`` returns the rocker's angles for crank angles, in [rad], (n,) each. The range may
    decrease; the design's positions are among the samples.
    """
    closure = PlanarClosure(design.four_bar.linkage())

    def errors_at(crank: Array) -> Array:
        return _wrap_angles(_rocker_of(closure, crank.ravel()) - wanted(crank.ravel())).reshape(
            crank.shape
        )

    first, last = min(low, high), max(low, high)
    precise = [position.crank for position in design.wanted if first <= position.crank <= last]
    crank = np.unique(np.concatenate((np.linspace(first, last, _ERROR_SAMPLES + 1), precise)))
    if high < low:
        crank = crank[::-1]
    error = errors_at(crank)
    at, greatest = _greatest_error(errors_at, crank, error)
    return StructuralError(
        crank, error, greatest, at, _rms_error(crank, error), _opens_at(closure, low, high)
    )


def _rocker_of(closure: PlanarClosure, crank: Array) -> Array:
    row = list(closure.linkage.joints).index(f'{ROCKER}_joint')
    angles: Array = closure.solve(crank, derivatives=0).positions[row]
    return angles


def _wrap_angles(angle: Array) -> Array:
    """Return angles in (−π, π]; small ones keep all their digits."""
    wrapped = angle - tau * np.round(angle / tau)
    return np.where(wrapped <= -np.pi, wrapped + tau, wrapped)


def _greatest_error(
    errors: Callable[[Array], Array], crank: Array, error: Array
) -> tuple[float, float]:
    """Return the place where the error is farthest from 0, and the error there."""
    heights = np.nan_to_num(np.abs(error), nan=-1.0)
    highest = int(np.argmax(heights))
    if heights[highest] < 0.0:
        return nan, nan
    padded = np.pad(heights, 1, constant_values=-1.0)
    summits = np.flatnonzero((heights >= padded[:-2]) & (heights >= padded[2:]) & (heights >= 0.0))
    summits = summits[np.argsort(-heights[summits], kind='stable')[:_SUMMITS]]
    places, errors_at = [crank[highest]], [error[highest]]
    start = crank[np.maximum(summits - 1, 0)]
    end = crank[np.minimum(summits + 1, len(crank) - 1)]
    for _ in range(_ERROR_ZOOMS):
        grid = np.linspace(start, end, _GRID + 1, axis=-1)
        values = errors(grid)
        best = np.nan_to_num(np.abs(values), nan=-1.0).argmax(-1)
        row = np.arange(len(grid))
        places.extend(grid[row, best])
        errors_at.extend(values[row, best])
        start, end = grid[row, np.maximum(best - 1, 0)], grid[row, np.minimum(best + 1, _GRID)]
    i = int(np.nanargmax(np.abs(errors_at)))
    return float(places[i]), float(errors_at[i])


def _rms_error(crank: Array, error: Array) -> float:
    """Return the root of the mean square over the parts of the range in which the loop closes."""
    by = np.abs(np.diff(crank))
    squares = 0.5 * (error[1:] ** 2 + error[:-1] ** 2)
    closed = np.isfinite(squares)
    if not closed.any():
        return abs(float(error[0])) if len(error) == 1 else nan
    return float(np.sqrt(np.sum(squares[closed] * by[closed]) / np.sum(by[closed])))


def _opens_at(closure: PlanarClosure, low: float, high: float) -> float | None:
    """Return the angle, on the way from one to another, at which the loop opens, or None."""
    interval = InputSweep(closure).range_about(low)
    if interval is None:
        return low
    if interval.is_whole or interval.lowest - _SAME <= high <= interval.highest + _SAME:
        return None
    return interval.highest if high > low else interval.lowest
