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
Layout of a diagram: the ranges of its axes, its points, and the style of each method.

A logarithmic axis has no position for 0 and for values below its lower bound, and no axis has one
for ∞. Such a point is a result too: it is drawn hollow, on the edge. NaN is not drawn. A method
has the same style in all diagrams of a page.
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
"""Smallest margin of a logarithmic axis, in decades."""

_LEAST, _GREATEST = 1e-300, 1e300
"""Plotting libraries fail beyond these values, so they count as 0 and ∞."""

_EMPTY = (0.1, 10.0)
"""Range of an axis without a point."""


class Range(NamedTuple):
    """The range of an axis; its ends are in its unit."""

    axis: Axis
    low: float
    high: float

    def has(self, value: float) -> bool:
        """Return whether the axis can show a value."""
        least = max(_LEAST, self.axis.least)
        return abs(value) <= _GREATEST and (value >= least or not self.axis.logarithmic)

    def place(self, value: float) -> float:
        """Return the position of a value; a value that the axis cannot show is on an edge."""
        if self.has(value):
            return value
        return self.high if value > _GREATEST else self.low


class Placed(NamedTuple):
    """A point with its position in the diagram."""

    # Its position.
    x: float
    y: float
    # Distances to the lower and the upper quartile, both positive; 0 without quartiles.
    x_arms: tuple[float, float]
    y_arms: tuple[float, float]
    on_edge: bool  # Whether it stands for a value that the axis cannot show
    pale: bool  # Whether it is drawn pale: another point is better on both axes
    text: tuple[str, ...]  # Its description, in lines


class PlacedCurve(NamedTuple):
    """
    A curve with the positions of its points; None where the line is broken.

    The name stands beside the point ``named``; None if no point is drawn.
    """

    curve: Curve
    points: tuple[Placed | None, ...]
    named: Placed | None

    @property
    def within(self) -> list[Placed | None]:
        """Return the points within the range; None for the others."""
        return [point and (None if point.on_edge else point) for point in self.points]

    @property
    def on_edge(self) -> list[Placed]:
        """Return the points on an edge."""
        return [point for point in self.points if point is not None and point.on_edge]


class Places(NamedTuple):
    """A diagram with the positions of its curves."""

    # Ranges of its axes.
    x: Range
    y: Range
    curves: tuple[PlacedCurve, ...]  # Its curves
    front: tuple[Placed, ...]  # Its best points, in the order of x; empty if more is not worse
    on_edge: str  # Meaning of the marks on its edges: '0', '∞', '0 or ∞'; '' if there are none

    @property
    def empty(self) -> bool:
        """Return whether there is nothing to draw."""
        return not any(any(curve.points) for curve in self.curves)


def places(diagram: Diagram) -> Places:
    """Return the positions of the points of a diagram."""
    drawn = [
        [point for point in curve.points if not (isnan(point.x) or isnan(point.y))]
        for curve in diagram.curves
    ]
    points = [point for curve in drawn for point in curve]
    x = _range(diagram.x, [(point.x, point.x_spread) for point in points])
    y = _range(diagram.y, [(point.y, point.y_spread) for point in points])
    best = _front(points) if diagram.front else points
    curves = []
    for curve in diagram.curves:
        placed = tuple(_placed(diagram, curve, point, x, y, best) for point in curve.points)
        curves.append(PlacedCurve(curve, placed, _named(diagram, placed)))
    shown = [point for curve in curves for point in curve.points if point and not point.pale]
    front = sorted(shown, key=lambda point: point.x) if diagram.front else []
    return Places(x, y, tuple(curves), tuple(front), _without_place(points, x, y))


def _front(points: Sequence[Point]) -> list[Point]:
    """Return the points for which no other is as good on both axes."""
    best: list[Point] = []
    for point in sorted(points, key=lambda point: (point.x, point.y)):
        if not point.fails and point.y <= _GREATEST and (not best or point.y < best[-1].y):
            best.append(point)
    return best


def _named(diagram: Diagram, placed: Sequence[Placed | None]) -> Placed | None:
    """Return the point beside which a curve has its name: its first best one, or its last."""
    shown = [point for point in placed if point is not None]
    best = [point for point in shown if not point.pale]
    if diagram.front and best:
        return best[0]
    return shown[-1] if shown else None


def _placed(
    diagram: Diagram, curve: Curve, point: Point, x: Range, y: Range, best: Sequence[Point]
) -> Placed | None:
    if isnan(point.x) or isnan(point.y):
        return None
    on_edge = not (x.has(point.x) and y.has(point.y))
    return Placed(
        x.place(point.x),
        y.place(point.y),
        _arms(x, point.x, point.x_spread, on_edge),
        _arms(y, point.y, point.y_spread, on_edge),
        on_edge,
        point not in best,
        (
            curve.name,
            *([point.setting] if point.setting else []),
            _described(diagram.x, point.x, point.x_spread),
            _described(diagram.y, point.y, point.y_spread),
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


def _described(axis: Axis, value: float, spread: Spread | None) -> str:
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
    # An edge with hollow marks keeps a distance from the other points.
    above = any(value > _GREATEST for value, _ in values)
    below = any(not unbounded.has(value) and value <= _GREATEST for value, _ in values)
    if not axis.logarithmic:
        span = (high - low) or abs(high) or 1.0
        return Range(
            axis,
            low - _MARGIN * span * (1 + 2 * below),
            high + _MARGIN * span * (1 + 2 * above),
        )
    # The logarithm of their ratio could overflow.
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
    """A marker, by its names in both libraries."""

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
"""Names of line styles in plotly."""


class Style(NamedTuple):
    """
    Style of a curve. Seven colours and eight markers make 56 different pairs.

    The colour is #rrggbb; black stands for the colour of the text. The dash is one of `DASHES`.
    """

    colour: str
    mark: Mark
    dash: str


Styles = dict[str, Style]
"""By a method's name."""


def styles_of(results: Iterable[Results]) -> Styles:
    """
    Return the style of each method.

    In the order of the pages, each method takes the first style that no other method of its
    diagrams has. So a few styles, those that differ most, serve many methods.
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
