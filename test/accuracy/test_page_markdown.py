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


"""The same results as Markdown, beside their pictures."""

from __future__ import annotations

import re

from linkage_ros.accuracy.page.files import write_markdown
from linkage_ros.pages.markdown import marks
from markdown_it import MarkdownIt
import pytest

from .shown import CLOSING, DIAGRAMS, FOREIGN, METHODS, RESULTS

BEGIN, END = marks('measured')

pytest.importorskip('matplotlib', reason='draws the pictures')

OTHER = RESULTS._replace(scene='other scene')


@pytest.fixture(scope='module')
def page(tmp_path_factory):
    file = tmp_path_factory.mktemp('docs') / 'accuracy.md'
    write_markdown([RESULTS, OTHER], file)
    return file


@pytest.fixture(scope='module')
def html(page):
    """Return what a reader of Markdown with tables makes of the page."""
    return MarkdownIt().enable('table').render(page.read_text('utf-8'))


def test_every_picture_exists_and_is_shown(page, html):
    shown = re.findall(r'<img src="([^"]+)"', html)
    lie = [file.relative_to(page.parent).as_posix() for file in page.parent.rglob('*.svg')]
    assert len(shown) == 2 * len(DIAGRAMS)
    assert sorted(shown) == sorted(lie)


def test_every_row_of_a_table_is_a_row_and_every_cell_a_cell(html):
    (table,) = re.findall(r'<table>.*?</table>', html[: html.index('other scene')], re.DOTALL)[:1]
    rows = re.findall(r'<tr>(.*?)</tr>', table, re.DOTALL)
    assert len(rows) == 1 + len(METHODS.rows)
    assert {row.count('</td>') + row.count('</th>') for row in rows} == {len(METHODS.columns)}


@pytest.mark.parametrize('text', [CLOSING, FOREIGN])
def test_no_text_is_taken_for_markup(html, text):
    escaped = text.replace('&', '&amp;').replace('<', '&lt;').replace('>', '&gt;')
    assert escaped.replace('"', '&quot;') in html


def test_advice_stands_in_a_list(html):
    assert '<li>For 1e-6 rad: a table.</li>' in html


def test_what_is_written_by_hand_stays_and_old_pictures_go(tmp_path):
    file = tmp_path / 'accuracy.md'
    file.write_text(f'# By hand\n\n{BEGIN}\nbefore now\n{END}\n\nbehind\n', 'utf-8')
    for scene in ('four_bar', 'other'):
        (tmp_path / 'accuracy' / scene).mkdir(parents=True)
        (tmp_path / 'accuracy' / scene / 'old.svg').write_text('', 'utf-8')
    write_markdown([RESULTS._replace(scene='four_bar')], file)
    text = file.read_text('utf-8')
    assert text.startswith(f'# By hand\n\n{BEGIN}\n## four_bar\n')
    assert text.endswith(f'\n{END}\n\nbehind\n')
    assert 'before now' not in text
    assert not (tmp_path / 'accuracy' / 'four_bar' / 'old.svg').exists()
    assert (tmp_path / 'accuracy' / 'other' / 'old.svg').exists()


def test_the_same_results_are_the_same_text(page, tmp_path):
    write_markdown([RESULTS, OTHER], tmp_path / 'accuracy.md')
    assert (tmp_path / 'accuracy.md').read_bytes() == page.read_bytes()
