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

from html import unescape
import json
import re

from linkage_ros.accuracy.page.files import write_markdown
from linkage_ros.accuracy.results import replies
from linkage_ros.pages.markdown import marks
from markdown_it import MarkdownIt
import pytest

from .shown import CLOSING, DIAGRAMS, EMPTY, FOREIGN, MANY, POSITION, RESULTS, TABLES

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


def test_every_file_exists_and_is_linked(page, html):
    linked = set(re.findall(r'(?:src|href)="(accuracy/[^"]+)"', html))
    lie = {file.relative_to(page.parent).as_posix() for file in page.parent.glob('*/*/*.*')}
    assert linked == lie
    assert len(lie) == 2 * (len(DIAGRAMS) + len(TABLES))


def test_each_part_has_one_picture_beside_the_first_of_all(html):
    shown = re.findall(r'<img src="[^"]*/([^"/]+)\.svg"', html)
    assert shown == [POSITION.key, MANY.key, EMPTY.key]


def test_the_page_begins_with_the_headline_of_each_scene(html):
    first = html.partition('<ul>')[2].partition('</ul>')[0]
    assert first.count('<li>') == 2
    assert 'other scene</strong>: exact to' in first


def test_what_to_take_is_a_table_of_five_accuracies(html):
    (table,) = re.findall(r'<table>.*?</table>', html, re.DOTALL)
    rows = re.findall(r'<tr>(.*?)</tr>', table, re.DOTALL)
    assert [row.count('</td>') + row.count('</th>') for row in rows] == [4] * 6
    assert '<td>0.01 rad</td>' in rows[2]
    assert 'solver: {table: {tolerance: 0.001}}' in rows[2]
    assert 'solver: closed_form # the default' in rows[4]


def test_the_field_has_the_answers_of_all_scenes(html):
    (data,) = re.findall(r'data-replies="([^"]*)"', html)
    answers = json.loads(unescape(data))
    assert list(answers) == [RESULTS.scene, 'other scene']
    assert answers['other scene'] == [each._asdict() for each in replies(OTHER)]


def test_the_method_has_a_page_of_its_own_with_the_machine(page):
    text = (page.parent / 'accuracy' / 'method.md').read_text('utf-8')
    html = MarkdownIt().render(text)
    assert 'How it was measured, in &lt;i&gt;words&lt;/i&gt;.' in html
    assert '<li>For 1e-6 rad: a table.</li>' in html
    assert 'Some CPU @ 2.50GHz' in html


@pytest.mark.parametrize('text', [CLOSING, FOREIGN])
def test_no_text_is_taken_for_markup(html, text):
    escaped = text.replace('&', '&amp;').replace('<', '&lt;').replace('>', '&gt;')
    assert escaped.replace('"', '&quot;') in html


def test_what_is_written_by_hand_stays_and_old_pictures_go(tmp_path):
    file = tmp_path / 'accuracy.md'
    file.write_text(f'# By hand\n\n{BEGIN}\nbefore now\n{END}\n\nbehind\n', 'utf-8')
    for scene in ('four_bar', 'other'):
        (tmp_path / 'accuracy' / scene).mkdir(parents=True)
        (tmp_path / 'accuracy' / scene / 'old.svg').write_text('', 'utf-8')
    write_markdown([RESULTS._replace(scene='four_bar')], file)
    text = file.read_text('utf-8')
    assert text.startswith(f'# By hand\n\n{BEGIN}\n- **four_bar**: ')
    assert text.endswith(f'\n{END}\n\nbehind\n')
    assert 'before now' not in text
    assert not (tmp_path / 'accuracy' / 'four_bar' / 'old.svg').exists()
    assert (tmp_path / 'accuracy' / 'other' / 'old.svg').exists()


def test_the_same_results_are_the_same_text(page, tmp_path):
    write_markdown([RESULTS, OTHER], tmp_path / 'accuracy.md')
    assert (tmp_path / 'accuracy.md').read_bytes() == page.read_bytes()
