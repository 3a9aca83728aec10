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


"""Where in a range a function has no value, or jumps."""

from __future__ import annotations

from math import floor, isfinite, log10

from linkage_ros.errors import SynthesisError
from linkage_ros.synthesis.function.expression import Array, Expression, named
import numpy as np

_SAMPLES = 2000

_ZOOMS = 3
"""Each makes the samples some 700 times denser, where the function is steepest."""

_JUMP = 0.1
"""A step that stays this part of itself when one looks 3e8 times closer is no slope."""

_ROUNDING = 1e-12
"""What is less of a function's values is rounding."""


def check_defined(function: Expression, low: float, high: float) -> None:
    """
    Refuse a function that has no value somewhere in a range, or jumps there.

    It is sampled, and the edges of what has no value are narrowed down; what lies between two
    samples and shows in neither is missed.

    Raises
    ------
    SynthesisError
        With where it is, and what range would do.

    """
    low, high = min(low, high), max(low, high)
    xs = np.linspace(low, high, _SAMPLES + 1)
    ys = function(xs)
    if not np.isfinite(ys).all():
        raise _undefined(function, xs, ys)
    jump = _jump(function, xs, ys)
    if jump is not None:
        raise SynthesisError(
            named(function.text),
            f'jumps, or goes to infinity, at x = {_rounded(jump, high - low)}',
            'choose a range on one side of it',
        )


def _undefined(function: Expression, xs: Array, ys: Array) -> SynthesisError:
    """Return what is wrong with a function of which some samples have no value."""
    span = float(xs[-1] - xs[0])
    good = np.isfinite(ys)
    runs = _runs(function, xs, good)
    start, end = next((start, end) for start, end, has_value in runs if not has_value)
    value = ys[int(np.argmin(good))]
    reason = 'is not defined' if np.isnan(value) else 'is infinite'
    usable = [(start, end) for start, end, has_value in runs if has_value]
    if not usable:
        return SynthesisError(
            named(function.text), f'{reason} anywhere in the range', 'choose another range'
        )
    first, last = _rounded(start, span), _rounded(end, span)
    if first == last:
        place, remedy = f'at x = {first}', 'choose a range without it'
    else:
        place = f'from x = {first} to {last}'
        widest = max(usable, key=lambda run: run[1] - run[0])
        ends = ' to '.join(_rounded(x, span) for x in widest)
        remedy = f'choose a range within {ends}'
    return SynthesisError(named(function.text), f'{reason} {place}', remedy)


def _runs(function: Expression, xs: Array, good: Array) -> list[tuple[float, float, bool]]:
    """Return the parts of a range in which a function has values, and in which it has none."""
    found = []
    start = float(xs[0])
    for i in np.flatnonzero(np.diff(good)):
        edge = _edge(function, float(xs[i]), float(xs[i + 1]))
        found.append((start, edge, bool(good[i])))
        start = edge
    return [*found, (start, float(xs[-1]), bool(good[-1]))]


def _edge(function: Expression, low: float, high: float) -> float:
    """Return where, between two places, a function begins or ceases to have values."""
    before = isfinite(function(low))
    while low < (middle := 0.5 * (low + high)) < high:
        if isfinite(function(middle)) == before:
            low = middle
        else:
            high = middle
    return high


def _jump(function: Expression, xs: Array, ys: Array) -> float | None:
    """
    Return where a function jumps: a pole between two samples, or an angle that starts again.

    What is looked at ever closer is its steepest place.
    """
    largest = []
    for _ in range(_ZOOMS + 1):
        with np.errstate(all='ignore'):
            steps = np.abs(np.diff(ys))
        steepest = int(np.argmax(steps))
        largest.append(float(steps[steepest]))
        # A step more on each side: a pole may lie beside the steepest step.
        low, high = xs[max(steepest - 1, 0)], xs[min(steepest + 2, len(xs) - 1)]
        place = 0.5 * float(xs[steepest] + xs[steepest + 1])
        xs = np.linspace(low, high, _SAMPLES + 1)
        ys = function(xs)
        if not np.isfinite(ys).all():
            return float(xs[int(np.argmin(np.isfinite(ys)))])
    size = float(np.max(np.abs(ys)))
    return place if largest[-1] > max(_JUMP * largest[0], _ROUNDING * size) else None


def _rounded(x: float, span: float) -> str:
    """Return a place as it matters in a range as wide as this."""
    # Adding 0 makes 0 of -0.
    return f'{round(x, 10 - floor(log10(span))) + 0.0:.10g}'
