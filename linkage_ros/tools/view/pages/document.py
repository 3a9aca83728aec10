# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A self-contained page: style, script, data and plotting library in one file.

Its content policy forbids the browser all requests, whatever the page holds.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from importlib import resources
import json
from typing import Any

from linkage_ros.cli import Table
from linkage_ros.errors import check_installed, escape_unprintable
from linkage_ros.kinematics import COLOURS, FACES, INK

_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; "
    "base-uri 'none'; form-action 'none'"
)

SERVED_POLICY = _POLICY.replace(
    "script-src 'unsafe-inline'",
    # The program of the linkage; and the server that has sent this page.
    "script-src 'unsafe-inline' 'unsafe-eval'; connect-src ws://127.0.0.1:* ws://localhost:*",
).replace('img-src data:', 'img-src data: blob:')
"""Content policy of a page that asks the server which has sent it."""

_HERE = 'linkage_ros.tools.view.pages'
_DRAWING = ('angles.js', 'curves.js', 'looks.js', 'picture.js', 'space.js')
"""Scripts of all pages that draw a linkage and plots."""

_LONG = 28
"""Length from which the text of a cell may be broken into lines."""


def html_document(
    title: str,
    body: Iterable[str],
    data: Mapping[str, Any],
    package: str,
    files: Sequence[str],
    *,
    is_served: bool = False,
    has_plots: bool = True,
) -> str:
    """
    Return a page with a title, lines of HTML, and data for its script as JSON without NaN.

    ``files`` are its styles and scripts in a package, after the ones that all pages share, in
    their order. The content policy of a page ``is_served`` allows requests to its server. With
    ``has_plots`` Plotly, the scripts that draw and their colours are part of the page; a
    LinkageError is raised if Plotly is not installed.
    """
    plotting = [f'<script>{_within_script(plotting_library())}</script>'] if has_plots else []
    if has_plots:
        data = {'colours': COLOURS, 'faces': {**FACES, 'edge': INK}, **data}
    shared = ['page.css', 'page.js', *(_DRAWING if has_plots else ())]
    parts = [*((_HERE, name) for name in shared), *((package, name) for name in files)]
    policy = SERVED_POLICY if is_served else _POLICY
    return '\n'.join(
        [
            '<!doctype html>',
            '<html lang="en">',
            '<head>',
            '<meta charset="utf-8">',
            f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="color-scheme" content="light dark">',
            # Without an icon, a browser asks the server for one.
            '<link rel="icon" href="data:,">',
            f'<title>{escape(escape_unprintable(title))}</title>',
            f'<style>\n{_join_files(parts, ".css")}</style>',
            '</head>',
            '<body>',
            '<button type="button" id="scheme" class="no-print" hidden></button>',
            _clean_lines('\n'.join(body)),
            f'<script type="application/json" id="data">{_script_json(data)}</script>',
            *plotting,
            f'<script>\n{_join_files(parts, ".js")}</script>',
            '</body>',
            '</html>',
            '',
        ]
    )


def plotting_library() -> str:
    """Return the script of Plotly; a LinkageError if it is not installed."""
    check_installed('plotly')
    from plotly.offline import get_plotlyjs  # local import: an optional dependency, slow to load

    return str(get_plotlyjs())


def _join_files(parts: Sequence[tuple[str, str]], kind: str) -> str:
    """Return the files of a kind, each with its package, as one text."""
    files = (resources.files(package) / name for package, name in parts if name.endswith(kind))
    return '\n'.join(file.read_text('utf-8') for file in files)


def _script_json(data: Any) -> str:
    # No text may end the script element or open a comment.
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(',', ':'))
    text = text.replace('<', r'\u003c')
    # Names that the script shows are cleaned here, too; json has escaped the rest.
    return _escape_letters(
        {letter for letter in set(text) if not letter.isprintable()}, text, '\\'
    )


def _clean_lines(text: str) -> str:
    return _escape_letters(
        {letter for letter in set(text) - {'\n'} if not letter.isprintable()}, text
    )


def _escape_letters(letters: set[str], text: str, before: str = '') -> str:
    for letter in letters:
        text = text.replace(letter, before + escape_unprintable(letter))
    return text


def _within_script(text: str) -> str:
    return text.replace('</script', r'<\/script')


def table_html(table: Table) -> Iterator[str]:
    """
    Yield a table within a figure; columns of numbers align to the right.

    If all headings are empty, none is written.
    """
    table = table.as_texts()
    columns = [head.removeprefix('>') for head in table.heads]
    numbers = [head.startswith('>') for head in table.heads]
    yield f'<figure><figcaption>{escape(table.title)}</figcaption>'
    yield '<div class="scroll" tabindex="0"><table>'
    if any(columns):
        yield f'<thead><tr>{"".join(map(_head_cell, columns, numbers))}</tr></thead>'
    yield '<tbody>'
    for row in table.rows:
        yield f'<tr>{"".join(map(_body_cell, row, numbers))}</tr>'
    yield '</tbody></table></div></figure>'


def facts_html(facts: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Yield facts, each with its name."""
    yield '<dl class="facts">'
    for name, value in facts:
        yield f'<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>'
    yield '</dl>'


def _head_cell(column: str, number: bool) -> str:
    return f'<th{" class=number" if number else ""}>{escape(column)}</th>'


def _body_cell(text: str, number: bool) -> str:
    kind = ' class=number' if number else ' class=long' if len(text) >= _LONG else ''
    return f'<td{kind}>{escape(text)}</td>'
