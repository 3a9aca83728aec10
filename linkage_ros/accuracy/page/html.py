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


"""Results as a page for the browser: its HTML, and its diagrams as data for Plotly."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
import json
from math import log10
from textwrap import wrap
from typing import Any

from linkage_ros.accuracy.page.diagrams import (
    Placed,
    PlacedCurve,
    places,
    Range,
    Style,
    Styles,
)
from linkage_ros.accuracy.page.numbers import cell_text, numeric_columns
from linkage_ros.accuracy.results import Diagram, Part, replies, Reply, Results, Table
from linkage_ros.pages.document import document, facts_html, picture, table_html

_HERE = 'linkage_ros.accuracy.page'


def results_html(results: Results, styles: Styles, pictures: Mapping[str, bytes]) -> str:
    """
    Return the page; a LinkageError if plotly is not installed.

    The pictures are the diagrams as SVG, by key: for print, and for browsers without scripts.
    """
    title = title_of(results)
    diagrams = [diagram for part in results.parts for diagram in part.diagrams]
    data = {'diagrams': {diagram.key: plot(diagram, styles) for diagram in diagrams}}
    body = _body(title, results, pictures)
    scripts = [(_HERE, 'page.js'), (_HERE, 'field.js')]
    return document(title, body, data, [(_HERE, 'page.css')], scripts)


def title_of(results: Results) -> str:
    """Return the title of a page."""
    return f'What accuracy costs: {results.scene}'


def _body(title: str, results: Results, pictures: Mapping[str, bytes]) -> Iterator[str]:
    yield f'<header><h1>{escape(title)}</h1>'
    yield f'<p class="headline">{escape(results.headline)}</p></header>'
    yield '<main>'
    first = next((part.diagrams[0] for part in results.parts if part.diagrams), None)
    if first is not None:
        yield from _diagram(first, pictures[first.key])
    answers = replies(results)
    if answers:
        yield field_html({results.scene: answers})
    for part in results.parts:
        yield from _part(part, [each for each in part.diagrams if each is not first], pictures)
    yield '</main><footer>'
    yield from facts_html(results.machine)
    yield '</footer>'


def field_html(answers: Mapping[str, Sequence[Reply]]) -> str:
    """Return the field for a wanted accuracy; field.js fills it with the answers by scene."""
    data = {scene: [each._asdict() for each in some] for scene, some in answers.items()}
    return f'<div class="wanted" data-replies="{escape(json.dumps(data, allow_nan=False))}"></div>'


def _part(part: Part, diagrams: Sequence[Diagram], pictures: Mapping[str, bytes]) -> Iterator[str]:
    yield f'<section id="{escape(part.key)}"><h2>{escape(part.title)}</h2>'
    yield f'<p class="headline">{escape(part.headline)}</p>'
    for diagram in diagrams[:1]:
        yield from _diagram(diagram, pictures[diagram.key])
    if part.sentences:
        yield f'<p>{escape(" ".join(part.sentences))}</p>'
    if part.method or part.tables:
        yield '<details><summary>What to take, how it was measured, tables and CSV</summary>'
        if part.advice:
            yield f'<ul>{"".join(f"<li>{escape(each)}</li>" for each in part.advice)}</ul>'
        yield from (f'<p>{escape(paragraph)}</p>' for paragraph in part.method)
        for diagram in diagrams[1:]:
            yield from _diagram(diagram, pictures[diagram.key])
        for table in part.tables:
            yield from _table(table)
        yield '</details>'
    yield '</section>'


def _diagram(diagram: Diagram, svg: bytes) -> Iterator[str]:
    key, title = escape(diagram.key), escape(diagram.title)
    yield f'<figure class="pictured" data-diagram="{key}"><figcaption>{title}</figcaption>'
    yield f'<div class="plot" role="img" aria-label="{title}"></div>'
    yield f'<img class="still" alt="{title}" src="{picture(svg)}">'
    on_edge = places(diagram).on_edge
    note = f'A hollow mark on the edge stands for {on_edge}. ' if on_edge else ''
    yield (
        f'<div class="files">{note}<a href="{key}.svg">SVG</a> '
        f'<a href="{key}_points.csv">CSV</a></div></figure>'
    )


def _table(table: Table) -> Iterator[str]:
    rows = (list(map(cell_text, row)) for row in table.rows)
    yield from table_html(table.title, table.columns, rows, numeric_columns(table))
    yield f'<div class="files"><a href="{escape(table.key)}.csv">CSV</a></div></figure>'


_NAME_LETTERS, _HOVER_LETTERS = 28, 48

_ENTITIES = str.maketrans({letter: f'&#{ord(letter)};' for letter in '&<>$'})

_SLACK = 1e-6
"""Relative extension of an axis: Plotly omits points that rounding puts beyond its end."""


def plot(diagram: Diagram, styles: Styles) -> dict[str, Any]:
    """Return a diagram in the form that page.js reads."""
    placed = places(diagram)
    traces = []
    for curve in placed.curves:
        style = styles[curve.curve.name]
        joined = curve.curve.joined and len(curve.points) > 1
        if any(curve.within) or not curve.on_edge:
            traces.append(_trace(curve.within, style, joined=joined))
        if curve.on_edge:
            traces.append(_on_edge(_trace(curve.on_edge, style, joined=False)))
    return {
        'title': diagram.title,
        'x': _axis(placed.x),
        'y': _axis(placed.y),
        'empty': placed.empty,
        'traces': traces,
        'names': [_name(curve, styles) for curve in placed.curves if curve.named],
        'front': [[point.x for point in placed.front], [point.y for point in placed.front]],
    }


def _axis(shown: Range) -> dict[str, Any]:
    logarithmic = shown.axis.logarithmic
    low, high = (log10(end) if logarithmic else end for end in (shown.low, shown.high))
    slack = _SLACK * (high - low)
    return {
        'title': _escaped(shown.axis.title),
        'logarithmic': logarithmic,
        'range': [low - slack, high + slack],
    }


def _name(curve: PlacedCurve, styles: Styles) -> dict[str, Any]:
    assert curve.named is not None, 'a curve that is not drawn has no name'
    return {
        'lines': [_escaped(line) for line in wrap(curve.curve.name, _NAME_LETTERS)],
        'x': curve.named.x,
        'y': curve.named.y,
        'colour': styles[curve.curve.name].colour,
        'pale': curve.named.pale,
    }


def _trace(points: Sequence[Placed | None], style: Style, *, joined: bool) -> dict[str, Any]:
    return {
        'x': [point and point.x for point in points],
        'y': [point and point.y for point in points],
        'x_arms': _arms([point and point.x_arms for point in points]),
        'y_arms': _arms([point and point.y_arms for point in points]),
        'pale': [bool(point and point.pale) for point in points],
        'text': ['' if point is None else _hover(point) for point in points],
        'colour': style.colour,
        'symbol': style.mark.plotly,
        'dash': style.dash,
        'joined': joined,
        'on_edge': False,
    }


def _on_edge(trace: dict[str, Any]) -> dict[str, Any]:
    """Return the hollow marks of a curve."""
    return {**trace, 'symbol': f'{trace["symbol"]}-open', 'on_edge': True}


def _arms(arms: Sequence[tuple[float, float] | None]) -> list[list[float]]:
    """Return the lengths below and above the points; an empty list if no point has arms."""
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
