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


"""Results as the page that a browser shows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape

from linkage_ros.accuracy.page.numbers import cell_text, numeric_columns
from linkage_ros.accuracy.page.places import places
from linkage_ros.accuracy.page.plots import plot
from linkage_ros.accuracy.page.styles import Styles
from linkage_ros.accuracy.results import Diagram, Part, Results, Table
from linkage_ros.page.document import document, picture
from linkage_ros.page.parts import facts_html, table_html

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
