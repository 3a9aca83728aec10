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


"""Results as files: a folder with page, pictures and CSV, or Markdown with its pictures."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
import os
from pathlib import Path
import re
import shutil

from linkage_ros.accuracy.page.diagrams import Styles, styles_of
from linkage_ros.accuracy.page.html import results_html
from linkage_ros.accuracy.page.numbers import (
    cell_text,
    diagram_csv,
    numeric_columns,
    table_csv,
)
from linkage_ros.accuracy.page.svg import diagram_svg
from linkage_ros.accuracy.results import Part, Results, Table
from linkage_ros.errors import LinkageError
from linkage_ros.pages.markdown import filled, marks, table_lines

PAGE = 'index.html'
"""What a browser opens."""

_NEEDED = ('matplotlib', 'plotly')
_KEY = re.compile(r'[a-z0-9_]+')


def check_folder(folder: Path) -> None:
    """
    Check that a page can be written, before anything is measured for it.

    Raises
    ------
    LinkageError
        Where the folder exists, or what draws is not installed.

    """
    for name in _NEEDED:
        if find_spec(name) is None:
            raise LinkageError(name, 'is not installed', 'pip install linkage_ros[report]')
    if os.path.lexists(folder):
        raise LinkageError(folder, 'exists already', 'name a new folder; nothing is overwritten')


def write_page(results: Results, folder: Path) -> None:
    """
    Write a page: the folder is there when all has been written, or not at all.

    Parameters
    ----------
    results
        What it tells.
    folder
        Where it goes. It is made here; one that exists is never touched.

    Raises
    ------
    LinkageError
        Where the folder exists or cannot be written, or what draws is not installed.

    """
    check_folder(folder)
    files = page_files(results)
    target = folder.resolve()
    temporary = target.with_name(f'.{target.name}.{os.getpid()}.tmp')
    try:
        temporary.mkdir(parents=True)
        try:
            for name, data in files.items():
                (temporary / name).write_bytes(data)
            temporary.rename(target)
        except BaseException:
            shutil.rmtree(temporary, ignore_errors=True)
            raise
    except OSError as error:
        raise LinkageError(
            folder, f'cannot be written ({error.strerror or error})', 'name another folder'
        ) from None


def page_files(results: Results) -> dict[str, bytes]:
    """
    Return the files of a page, by their names.

    Raises
    ------
    LinkageError
        Where what draws is not installed.
    ValueError
        A key is no name of a file, or two parts have the same.

    """
    diagrams = [diagram for part in results.parts for diagram in part.diagrams]
    tables = [table for part in results.parts for table in part.tables]
    _check_keys([diagram.key for diagram in diagrams])
    _check_keys([table.key for table in tables])
    styles = styles_of([results])
    pictures = {diagram.key: diagram_svg(diagram, styles) for diagram in diagrams}
    return {
        PAGE: results_html(results, styles, pictures).encode(),
        **{f'{key}.svg': svg for key, svg in pictures.items()},
        **{f'{each.key}_points.csv': diagram_csv(each).encode() for each in diagrams},
        **{f'{each.key}.csv': table_csv(each).encode() for each in tables},
    }


def _check_keys(keys: list[str]) -> None:
    unfit = [key for key in keys if not _KEY.fullmatch(key)]
    unfit += [key for key, count in Counter(keys).items() if count > 1]
    if unfit:
        raise ValueError(f'{unfit[0]!r} is no name of a file, or that of two')


_MARK = 'measured'


def write_markdown(results: Sequence[Results], page: Path) -> None:
    """
    Write a page of Markdown, and its pictures into a folder of the page's name.

    Parameters
    ----------
    results
        Of some scenes, which have different names.
    page
        Where it goes. If it exists and has the marks ``measured``, only the text between them is
        replaced.

    Raises
    ------
    LinkageError
        Where matplotlib is not installed.

    """
    styles = styles_of(results)
    pictures = page.with_suffix('')
    text = '\n'.join(line for each in results for line in _scene(each, pictures.name))
    old = page.read_text('utf-8') if page.exists() else f'{"".join(marks(_MARK))}\n'
    for each in results:
        _draw(each, styles, pictures / _folder(each))
    page.write_text(filled(old, _MARK, text), 'utf-8')


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
    rows = ([_escaped(cell_text(cell)) for cell in row] for row in (table.columns, *table.rows))
    yield from table_lines(next(rows), rows, numbers)
    yield ''


def _folder(results: Results) -> str:
    """Return the name of a scene as a folder that every link can name."""
    return re.sub(r'[^a-z0-9_]+', '-', results.scene.lower()).strip('-') or 'scene'


def _escaped(text: str) -> str:
    """Return a text in which nothing is markup, on one line."""
    return re.sub(r'([\\`*|<&$\[\]])', r'\\\1', ' '.join(text.split()))
