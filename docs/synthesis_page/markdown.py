# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Markdown: paragraphs, tables, numbers."""

from __future__ import annotations

from collections.abc import Iterator
from textwrap import dedent, fill

_WIDTH = 110


def prose(words: str) -> Iterator[str]:
    """Yield paragraphs in lines of one width, each with a blank line after it."""
    for paragraph in dedent(words).strip().split('\n\n'):
        yield fill(paragraph, _WIDTH, break_long_words=False, break_on_hyphens=False)
        yield ''


def table(*columns: str) -> Iterator[str]:
    """Yield the head of a table; columns with a > are aligned to the right."""
    yield row(*(column.lstrip('>') for column in columns))
    yield row(*('---:' if column.startswith('>') else '---' for column in columns))


def row(*cells: object) -> str:
    """Return a row of a table."""
    return f'| {" | ".join(map(str, cells))} |'


def power(value: float) -> str:
    """Return a number with two digits and a power of ten."""
    digits, _, exponent = f'{value:.1e}'.partition('e')
    return f'{digits}e{int(exponent)}'.replace('1.0e', '1e')
