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
from math import log10
from textwrap import wrap
from typing import Any

from linkage_ros.accuracy.page.diagrams import Placed, places, Range, Style, Styles
from linkage_ros.accuracy.page.numbers import cell_text, numeric_columns
from linkage_ros.accuracy.results import Diagram, Part, Results, Table
from linkage_ros.pages.document import document, facts_html, picture, table_html

_ADVICE = 'What to take'
_HERE = 'linkage_ros.accuracy.page'


def results_html(results: Results, styles: Styles, pictures: Mapping[str, bytes]) -> str:
    """
    Return the page.

    Parameters
    ----------
    results
        What it tells.
    styles
        What each method looks like.
    pictures
        The diagrams as SVG, by their keys; for print, and for where no script runs.

    Raises
    ------
    LinkageError
        Where plotly is not installed.

    """
    title = title_of(results)
    diagrams = [diagram for part in results.parts for diagram in part.diagrams]
    data = {'diagrams': {diagram.key: plot(diagram, styles) for diagram in diagrams}}
    body = _body(title, results, pictures)
    return document(title, body, data, [(_HERE, 'page.css')], [(_HERE, 'page.js')])


def title_of(results: Results) -> str:
    """Return the title of a page."""
    return f'What accuracy costs: {results.scene}'


def _body(title: str, results: Results, pictures: Mapping[str, bytes]) -> Iterator[str]:
    yield f'<header><h1>{escape(title)}</h1>'
    yield from facts_html(results.machine)
    advised = [part for part in results.parts if part.advice]
    yield '<nav aria-label="Parts"><ul>'
    for part in results.parts:
        yield f'<li><a href="#{escape(part.key)}">{escape(part.title)}</a></li>'
    if advised:
        yield f'<li><a href="#advice">{_ADVICE}</a></li>'
    yield '</ul></nav></header>'
    yield '<main>'
    for part in results.parts:
        yield from _part(part, pictures)
    if advised:
        yield f'<section id="advice"><h2>{_ADVICE}</h2>'
        yield '<div class="advice">'
        for part in advised:
            yield f'<h3>{escape(part.title)}</h3>'
            yield '<ul>'
            yield from (f'<li>{escape(advice)}</li>' for advice in part.advice)
            yield '</ul>'
        yield '</div></section>'
    yield '</main>'


def _part(part: Part, pictures: Mapping[str, bytes]) -> Iterator[str]:
    yield f'<section id="{escape(part.key)}"><h2>{escape(part.title)}</h2>'
    yield from (f'<p>{escape(paragraph)}</p>' for paragraph in part.text)
    for diagram in part.diagrams:
        yield from _diagram(diagram, pictures[diagram.key])
    for table in part.tables:
        yield from _table(table)
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
        'title': _escaped(shown.axis.title),
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
