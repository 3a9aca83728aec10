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


"""What pages are put together of: tables, and facts in a row."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from html import escape

_LONG = 28
"""Letters from which on a cell may be broken."""


def table_html(
    title: str, columns: Sequence[str], rows: Iterable[Sequence[str]], numbers: Sequence[bool]
) -> Iterator[str]:
    """
    Yield a table, within a figure that is left open.

    Parameters
    ----------
    title
        What stands above it.
    columns
        Headings; all empty: none are written.
    rows
        The cells.
    numbers
        Which columns hold numbers, and are set right.

    """
    yield f'<figure><figcaption>{escape(title)}</figcaption>'
    yield '<div class="scroll" tabindex="0"><table>'
    if any(columns):
        yield f'<thead><tr>{"".join(map(_head, columns, numbers))}</tr></thead>'
    yield '<tbody>'
    for row in rows:
        yield f'<tr>{"".join(map(_cell, row, numbers))}</tr>'
    yield '</tbody></table></div>'


def facts_html(facts: Iterable[tuple[str, str]]) -> Iterator[str]:
    """Yield facts, each with its name."""
    yield '<dl class="facts">'
    for name, value in facts:
        yield f'<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd></div>'
    yield '</dl>'


def _head(column: str, number: bool) -> str:
    return f'<th{" class=number" if number else ""}>{escape(column)}</th>'


def _cell(text: str, number: bool) -> str:
    kind = ' class=number' if number else ' class=long' if len(text) >= _LONG else ''
    return f'<td{kind}>{escape(text)}</td>'
