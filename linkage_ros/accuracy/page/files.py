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
import os
from pathlib import Path
import re
import shutil

from linkage_ros.accuracy import PARTS
from linkage_ros.accuracy.page.diagrams import Styles, styles_of
from linkage_ros.accuracy.page.html import field_html, results_html
from linkage_ros.accuracy.page.numbers import diagram_csv, number_text, table_csv
from linkage_ros.accuracy.page.svg import diagram_svg
from linkage_ros.accuracy.results import Diagram, replies, reply, Results
from linkage_ros.errors import check_installed, LinkageError
from linkage_ros.pages.markdown import filled, marks, table_lines

PAGE = 'index.html'
"""File that a browser opens."""

_KEY = re.compile(r'[a-z0-9_]+')


def check_folder(folder: Path) -> None:
    """
    Check that a page can be written, before anything is measured for it.

    A LinkageError is raised if the folder exists, or a plotting library is not installed.
    """
    check_installed('matplotlib')
    check_installed('plotly')
    if os.path.lexists(folder):
        raise LinkageError(folder, 'exists already', 'name a new folder; nothing is overwritten')


def write_page(results: Results, folder: Path) -> None:
    """
    Write a page: its folder appears complete, or not at all.

    Parameters
    ----------
    results
        The results.
    folder
        Folder of the page. It is created; an existing one is never changed.

    Raises
    ------
    LinkageError
        If the folder exists or cannot be written, or a plotting library is not installed.

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
        If a plotting library is not installed.
    ValueError
        If a key is not a valid file name, or two parts have the same key.

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
_SHOWN = (0.1, 1e-2, 1e-3, 1e-6, 1e-12)
"""Wanted accuracies in the table of the page, in [rad]."""


def write_markdown(results: Sequence[Results], page: Path) -> None:
    """
    Write a page of Markdown, and a folder of the page's name with its pictures and tables.

    The page has the answers and for each part its headlines, with the picture of the first scene
    that has one. The method of measurement is written to ``method.md`` in the folder.

    Parameters
    ----------
    results
        Results of scenes with different names.
    page
        The page. If it exists and has the marks ``measured``, only the text between them is
        replaced; likewise that of the method.

    Raises
    ------
    LinkageError
        If matplotlib is not installed.

    """
    styles = styles_of(results)
    folder = page.with_suffix('')
    for each in results:
        _write_files(each, styles, folder / _folder(each))
    for file, lines in (
        (page, _page(results, folder.name)),
        (folder / 'method.md', _method(results)),
    ):
        old = file.read_text('utf-8') if file.exists() else f'{"".join(marks(_MARK))}\n'
        file.write_text(filled(old, _MARK, '\n'.join(lines)), 'utf-8')


def _write_files(results: Results, styles: Styles, folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for part in results.parts:
        for diagram in part.diagrams:
            (folder / f'{diagram.key}.svg').write_bytes(diagram_svg(diagram, styles))
        for table in part.tables:
            (folder / f'{table.key}.csv').write_text(table_csv(table), 'utf-8')


def _page(results: Sequence[Results], folder: str) -> Iterator[str]:
    yield from (f'- **{_escaped(each.scene)}**{_tail(each)}' for each in results)
    yield ''
    parts = {part.key: part.title for each in results for part in each.parts}
    keys = sorted(parts, key=PARTS.index)
    solved = next((each for each in results if replies(each)), None)
    if solved is not None:
        yield from _picture(solved, solved.parts[0].diagrams[0], folder)
        heads = ('accuracy', 'write into the scene', 'a tick costs', 'tick rates that use it')
        answers = replies(solved)
        rows = (
            (f'{number_text(wanted)} rad', *map(_escaped, reply(answers, wanted)[1:]))
            for wanted in _SHOWN
        )
        yield f'What to take for {_escaped(solved.scene)}:'
        yield ''
        yield from table_lines(heads, rows)
        yield ''
        yield field_html({each.scene: replies(each) for each in results if replies(each)})
        yield ''
    for key in keys:
        yield f'## {_escaped(parts[key])}'
        yield ''
        yield from _part(results, key, folder)


def _tail(results: Results) -> str:
    """Return the headline behind the name of the scene."""
    return _escaped(results.headline.removeprefix(results.scene))


def _part(results: Sequence[Results], key: str, folder: str) -> Iterator[str]:
    """Yield a part: the headlines of all scenes, the picture and the sentences of one."""
    found = [(each, part) for each in results for part in each.parts if part.key == key]
    yield from (f'- {_escaped(each.scene)}: {_escaped(part.headline)}' for each, part in found)
    yield ''
    shown, part = next((one for one in found if one[1].diagrams), found[0])
    # The first picture of the first part stands at the head of the page.
    first = min(len(part.diagrams) - 1, 1) if part is shown.parts[0] else 0
    if part.diagrams:
        yield from _picture(shown, part.diagrams[first], folder)
    if part.sentences:
        yield _escaped(f'{shown.scene}: {" ".join(part.sentences)}')
        yield ''
    for each, one in found:
        place = f'{folder}/{_folder(each)}'
        files = [f'[{diagram.key}.svg]({place}/{diagram.key}.svg)' for diagram in one.diagrams]
        files += [f'[{table.key}.csv]({place}/{table.key}.csv)' for table in one.tables]
        if files:
            yield f'Files of {_escaped(each.scene)}: {", ".join(files)}.'
            yield ''


def _picture(results: Results, diagram: Diagram, folder: str) -> Iterator[str]:
    yield f'![{_escaped(diagram.title)}]({folder}/{_folder(results)}/{diagram.key}.svg)'
    yield ''


def _method(results: Sequence[Results]) -> Iterator[str]:
    """Yield the method of each part, and the machine of each scene."""
    for key in sorted({part.key for each in results for part in each.parts}, key=PARTS.index):
        scene, part = next(
            (each, part) for each in results for part in each.parts if part.key == key
        )
        yield f'## {_escaped(part.title)}'
        yield ''
        for paragraph in part.method:
            yield _escaped(paragraph)
            yield ''
        if part.advice:
            yield f'For {_escaped(scene.scene)}:'
            yield ''
            yield from (f'- {_escaped(advice)}' for advice in part.advice)
            yield ''
    yield '## Machine'
    yield ''
    for each in results:
        machine = ', '.join(f'{name} {value}' for name, value in each.machine)
        yield f'- {_escaped(each.scene)}: {_escaped(machine)}'


def _folder(results: Results) -> str:
    """Return the name of a scene as a folder that every link can name."""
    return re.sub(r'[^a-z0-9_]+', '-', results.scene.lower()).strip('-') or 'scene'


def _escaped(text: str) -> str:
    """Return a text in which nothing is markup, on one line."""
    return re.sub(r'([\\`*|<&$\[\]])', r'\\\1', ' '.join(text.split()))
