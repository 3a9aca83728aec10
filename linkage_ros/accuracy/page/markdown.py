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


"""Results of one scene or several as Markdown, beside the pictures that it shows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
import re
import shutil

from linkage_ros.accuracy.page.numbers import Cell, cell_text, numeric_columns
from linkage_ros.accuracy.page.styles import Styles, styles_of
from linkage_ros.accuracy.page.svg import diagram_svg
from linkage_ros.accuracy.results import Part, Results, Table

BEGIN, END = '<!-- measured: begin -->', '<!-- measured: end -->'
"""Between them stands what is made here; what is around them is written by hand."""


def write_markdown(results: Sequence[Results], page: Path) -> None:
    """
    Write a page of Markdown, and its pictures into a folder of the page's name.

    Parameters
    ----------
    results
        Of some scenes, which have different names.
    page
        Where it goes. Of one that is there, with `BEGIN` and `END` in it, only what stands between
        them is replaced.

    Raises
    ------
    LinkageError
        Where matplotlib is not installed.

    """
    styles = styles_of(results)
    pictures = page.with_suffix('')
    text = '\n'.join(line for each in results for line in _scene(each, pictures.name))
    old = page.read_text('utf-8') if page.exists() else f'{BEGIN}\n{END}\n'
    head, _, rest = old.partition(BEGIN)
    _, _, tail = rest.partition(END)
    for each in results:
        _draw(each, styles, pictures / _folder(each))
    page.write_text(f'{head}{BEGIN}\n{text}\n{END}{tail}', 'utf-8')


def _draw(results: Results, styles: Styles, folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for part in results.parts:
        for diagram in part.diagrams:
            (folder / f'{diagram.key}.svg').write_bytes(diagram_svg(diagram, styles))


def _scene(results: Results, pictures: str) -> Iterator[str]:
    yield f'## {_escaped(results.scene)}'
    yield ''
    yield f'{_escaped(", ".join(f"{name} {value}" for name, value in results.machine))}.'
    yield ''
    for part in results.parts:
        yield from _part(part, f'{pictures}/{_folder(results)}')
    advised = [part for part in results.parts if part.advice]
    if advised:
        yield '### What to take'
        yield ''
        for part in advised:
            yield f'{_escaped(part.title)}:'
            yield from (f'- {_escaped(advice)}' for advice in part.advice)
            yield ''


def _part(part: Part, pictures: str) -> Iterator[str]:
    yield f'### {_escaped(part.title)}'
    yield ''
    for paragraph in part.text:
        yield _escaped(paragraph)
        yield ''
    for diagram in part.diagrams:
        yield f'![{_escaped(diagram.title)}]({pictures}/{diagram.key}.svg)'
        yield ''
    for table in part.tables:
        yield from _table(table)


def _table(table: Table) -> Iterator[str]:
    numbers = numeric_columns(table)
    yield f'{_escaped(table.title)}:'
    yield ''
    yield _row(table.columns)
    yield f'| {" | ".join("---:" if number else "---" for number in numbers)} |'
    yield from map(_row, table.rows)
    yield ''


def _row(cells: Sequence[Cell]) -> str:
    return f'| {" | ".join(_escaped(cell_text(cell)) for cell in cells)} |'


def _folder(results: Results) -> str:
    """Return the name of a scene as a folder that every link can name."""
    return re.sub(r'[^a-z0-9_]+', '-', results.scene.lower()).strip('-') or 'scene'


def _escaped(text: str) -> str:
    """Return a text in which nothing is markup, on one line."""
    return re.sub(r'([\\`*|<&$\[\]])', r'\\\1', ' '.join(text.split()))
