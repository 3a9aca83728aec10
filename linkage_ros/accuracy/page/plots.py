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


"""Diagrams as plain data for the script of the page, which gives them to Plotly."""

from __future__ import annotations

from collections.abc import Sequence
from math import log10
from textwrap import wrap
from typing import Any

from linkage_ros.accuracy.page.places import axis_title, Placed, places, Range
from linkage_ros.accuracy.page.styles import Style, Styles
from linkage_ros.accuracy.results import Diagram

_NAME_LETTERS, _HOVER_LETTERS = 28, 48

_ENTITIES = str.maketrans({letter: f'&#{ord(letter)};' for letter in '&<>$'})

_SLACK = 1e-6
"""By so much of its length an axis is longer: Plotly leaves out what rounding puts beyond it."""


def plot(diagram: Diagram, styles: Styles) -> dict[str, Any]:
    """Return a diagram as page.js takes it."""
    placed = places(diagram)
    traces = []
    for curve in placed.curves:
        style = styles[curve.curve.name]
        name = _lines([curve.curve.name], _NAME_LETTERS)
        joined = curve.curve.joined and len(curve.points) > 1
        within = any(curve.within) or not curve.on_edge
        if within:
            traces.append(_trace(name, curve.within, style, joined=joined))
        if curve.on_edge:
            traces.append(_on_edge(_trace(name, curve.on_edge, style, joined=False), within))
    return {
        'title': diagram.title,
        'x': _axis(placed.x),
        'y': _axis(placed.y),
        'empty': placed.empty,
        'traces': traces,
    }


def _axis(shown: Range) -> dict[str, Any]:
    logarithmic = shown.axis.logarithmic
    low, high = (log10(end) if logarithmic else end for end in (shown.low, shown.high))
    slack = _SLACK * (high - low)
    return {
        'title': _escaped(axis_title(shown.axis)),
        'logarithmic': logarithmic,
        'range': [low - slack, high + slack],
    }


def _trace(
    name: str,
    points: Sequence[Placed | None],
    style: Style,
    *,
    joined: bool,
) -> dict[str, Any]:
    return {
        'name': name,
        'in_legend': True,
        'x': [point and point.x for point in points],
        'y': [point and point.y for point in points],
        'x_arms': _arms([point and point.x_arms for point in points]),
        'y_arms': _arms([point and point.y_arms for point in points]),
        'text': ['' if point is None else _hover(point) for point in points],
        'colour': style.colour,
        'symbol': style.mark.plotly,
        'dash': style.dash,
        'joined': joined,
        'on_edge': False,
    }


def _on_edge(trace: dict[str, Any], named: bool) -> dict[str, Any]:
    """Return the hollow marks of a curve, which may have other marks that name it."""
    symbol = f'{trace["symbol"]}-open'
    return {**trace, 'symbol': symbol, 'in_legend': not named, 'on_edge': True}


def _arms(arms: Sequence[tuple[float, float] | None]) -> list[list[float]]:
    """Return what is below the points, and what is above; nothing where no point has arms."""
    if not any(each and any(each) for each in arms):
        return []
    return [[each[side] if each else 0.0 for each in arms] for side in (0, 1)]


def _hover(point: Placed) -> str:
    name, *others = point.text
    return f'<b>{_lines([name], _HOVER_LETTERS)}</b><br>{_lines(others, _HOVER_LETTERS)}'


def _lines(texts: Sequence[str], letters: int) -> str:
    return '<br>'.join(_escaped(line) for text in texts for line in wrap(text, letters) or [''])


def _escaped(text: str) -> str:
    """Return a text in which Plotly finds neither markup nor a formula."""
    return text.translate(_ENTITIES)
