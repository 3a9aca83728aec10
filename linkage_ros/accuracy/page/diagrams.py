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
How a diagram is laid out: its ranges, its points, and the look of each method.

A logarithmic axis has no position for 0, nor for values below its least, and no axis has one for
∞. Such a point is a result all the same: it is drawn hollow, on the edge. NaN is not drawn. A
method looks the same in all diagrams of a page.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import count
from math import isnan, log10
from typing import NamedTuple

from linkage_ros.accuracy.page.numbers import number_text, spread_text
from linkage_ros.accuracy.results import Axis, Curve, Diagram, Point, Results
from linkage_ros.drawing.painting import COLOURS
from linkage_ros.measuring import Spread

_MARGIN = 0.05
_LEAST_MARGIN = 0.05
"""Of a logarithmic axis, in decades."""

_LEAST, _GREATEST = 1e-300, 1e300
"""Plotting libraries fail beyond these values: they count as 0 and ∞."""

_EMPTY = (0.1, 10.0)
"""Range of an axis without a point."""


class Range(NamedTuple):
    """
    The range of an axis.

    Attributes
    ----------
    axis
        The axis.
    low, high
        Its ends, in its unit.

    """

    axis: Axis
    low: float
    high: float

    def has(self, value: float) -> bool:
        """Return whether the axis can show a value."""
        least = max(_LEAST, self.axis.least)
        return abs(value) <= _GREATEST and (value >= least or not self.axis.logarithmic)

    def place(self, value: float) -> float:
        """Return where a value is drawn: one that the axis cannot show lies on the nearer edge."""
        if self.has(value):
            return value
        return self.high if value > _GREATEST else self.low


class Placed(NamedTuple):
    """
    A point where it is drawn.

    Attributes
    ----------
    x, y
        Where.
    x_arms, y_arms
        How far the quartiles are from it, below and above, both positive; 0 without quartiles.
    on_edge
        Whether it stands for a value that the axis cannot show.
    text
        Its description, in lines.

    """

    x: float
    y: float
    x_arms: tuple[float, float]
    y_arms: tuple[float, float]
    on_edge: bool
    text: tuple[str, ...]


class PlacedCurve(NamedTuple):
    """
    A curve where it is drawn.

    Attributes
    ----------
    curve
        The curve.
    points
        Its points; None where the line is broken.

    """

    curve: Curve
    points: tuple[Placed | None, ...]

    @property
    def within(self) -> list[Placed | None]:
        """Return the points within the range; None for the others."""
        return [point and (None if point.on_edge else point) for point in self.points]

    @property
    def on_edge(self) -> list[Placed]:
        """Return the points on an edge."""
        return [point for point in self.points if point is not None and point.on_edge]


class Places(NamedTuple):
    """
    A diagram where it is drawn.

    Attributes
    ----------
    x, y
        What its axes show.
    curves
        Its curves.
    on_edge
        What the marks on its edges stand for: '0', '∞', '0 or ∞'; '' where there are none.

    """

    x: Range
    y: Range
    curves: tuple[PlacedCurve, ...]
    on_edge: str

    @property
    def empty(self) -> bool:
        """Return whether there is nothing to draw."""
        return not any(any(curve.points) for curve in self.curves)


def places(diagram: Diagram) -> Places:
    """Return where the points of a diagram are drawn."""
    drawn = [
        [point for point in curve.points if not (isnan(point.x) or isnan(point.y))]
        for curve in diagram.curves
    ]
    points = [point for curve in drawn for point in curve]
    x = _range(diagram.x, [(point.x, point.x_spread) for point in points])
    y = _range(diagram.y, [(point.y, point.y_spread) for point in points])
    curves = [
        PlacedCurve(curve, tuple(_placed(diagram, curve, point, x, y) for point in curve.points))
        for curve in diagram.curves
    ]
    return Places(x, y, tuple(curves), _without_place(points, x, y))


def _placed(diagram: Diagram, curve: Curve, point: Point, x: Range, y: Range) -> Placed | None:
    if isnan(point.x) or isnan(point.y):
        return None
    on_edge = not (x.has(point.x) and y.has(point.y))
    return Placed(
        x.place(point.x),
        y.place(point.y),
        _arms(x, point.x, point.x_spread, on_edge),
        _arms(y, point.y, point.y_spread, on_edge),
        on_edge,
        (
            curve.name,
            *([point.setting] if point.setting else []),
            _said(diagram.x, point.x, point.x_spread),
            _said(diagram.y, point.y, point.y_spread),
        ),
    )


def _without_place(points: Iterable[Point], x: Range, y: Range) -> str:
    values = {
        value
        for point in points
        for shown, value in ((x, point.x), (y, point.y))
        if not shown.has(value)
    }
    least = max(x.axis.least, y.axis.least)
    kinds = {
        f'less than {number_text(least)}': any(_LEAST <= value < least for value in values),
        '0': any(0.0 <= value < _LEAST for value in values),
        'less than 0': any(-_GREATEST <= value < 0.0 for value in values),
        '-∞': any(value < -_GREATEST for value in values),
        '∞': any(value > _GREATEST for value in values),
    }
    return ' or '.join(kind for kind, found in kinds.items() if found)


def _said(axis: Axis, value: float, spread: Spread | None) -> str:
    text = number_text(value) if spread is None else spread_text(spread)
    return f'{axis.name}: {text} {axis.unit}'.rstrip()


def _arms(shown: Range, value: float, spread: Spread | None, on_edge: bool) -> tuple[float, float]:
    if spread is None or on_edge or any(map(isnan, spread)):
        return 0.0, 0.0
    return (
        max(0.0, value - shown.place(spread.low)),
        max(0.0, shown.place(spread.high) - value),
    )


def _range(axis: Axis, values: Sequence[tuple[float, Spread | None]]) -> Range:
    unbounded = Range(axis, 0.0, 0.0)
    shown = [each for each in _all(values) if unbounded.has(each)]
    if not shown:
        return Range(axis, *_EMPTY)
    low, high = min(shown), max(shown)
    # An edge on which something stands keeps away from what has a place.
    above = any(value > _GREATEST for value, _ in values)
    below = any(not unbounded.has(value) and value <= _GREATEST for value, _ in values)
    if not axis.logarithmic:
        span = (high - low) or abs(high) or 1.0
        return Range(
            axis,
            low - _MARGIN * span * (1 + 2 * below),
            high + _MARGIN * span * (1 + 2 * above),
        )
    # Not of their ratio: it may be beyond a double.
    margin = max(_MARGIN * (log10(high) - log10(low)), _LEAST_MARGIN)
    return Range(
        axis,
        max(low * 10.0 ** -(margin * (1 + 2 * below)), _LEAST),
        min(high * 10.0 ** (margin * (1 + 2 * above)), _GREATEST),
    )


def _all(values: Sequence[tuple[float, Spread | None]]) -> Iterable[float]:
    for value, spread in values:
        yield value
        if spread is not None:
            yield spread.low
            yield spread.high


class Mark(NamedTuple):
    """
    A mark, as both libraries name it.

    Attributes
    ----------
    plotly, matplotlib
        Its names.

    """

    plotly: str
    matplotlib: str


MARKS = (
    Mark('circle', 'o'),
    Mark('square', 's'),
    Mark('triangle-up', '^'),
    Mark('diamond', 'D'),
    Mark('triangle-down', 'v'),
    Mark('cross', 'P'),
    Mark('x', 'X'),
    Mark('star', '*'),
)

DASHES = ('solid', 'dash', 'dot', 'dashdot')
"""As plotly names them; matplotlib's names are another's."""


class Style(NamedTuple):
    """
    What a curve looks like. Seven colours and eight marks make 56 pairs that differ.

    Attributes
    ----------
    colour
        As #rrggbb; black stands for the colour of the text.
    mark
        What marks a point.
    dash
        What its line is like; one of `DASHES`.

    """

    colour: str
    mark: Mark
    dash: str


Styles = dict[str, Style]
"""By a method's name."""


def styles_of(results: Iterable[Results]) -> Styles:
    """
    Return what each method looks like.

    In the order in which the pages tell of them, each takes the first look that no method has
    with which it shares a diagram: so few looks serve many methods, and those are told apart best.
    """
    diagrams = [
        [curve.name for curve in diagram.curves]
        for each in results
        for part in each.parts
        for diagram in part.diagrams
    ]
    numbers: dict[str, int] = {}
    for name in dict.fromkeys(name for names in diagrams for name in names):
        beside = {other for names in diagrams if name in names for other in names}
        taken = {numbers[other] for other in beside if other in numbers}
        numbers[name] = next(number for number in count() if number not in taken)
    return {name: _style(number) for name, number in numbers.items()}


def _style(number: int) -> Style:
    turns = number // len(COLOURS)
    return Style(
        COLOURS[number % len(COLOURS)],
        MARKS[number % len(MARKS)],
        DASHES[turns % len(DASHES)],
    )
