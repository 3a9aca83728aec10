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


"""The folder of a page: its files are complete or absent, and have the expected content."""

import csv
from html import unescape
import io
from math import isnan
import re
import xml.etree.ElementTree as ET

from linkage_ros.accuracy.page.diagrams import places
from linkage_ros.accuracy.page.files import page_files, write_page
from linkage_ros.accuracy.page.numbers import diagram_csv, table_csv
from linkage_ros.accuracy.results import Diagram, Part, Results, Table
from linkage_ros.errors import LinkageError
from linkage_ros.measuring import Spread
from linkage_ros.pages.document import POLICY
import numpy as np
import pytest

from .shown import DIAGRAMS, METHODS, NEWTON, POSITION, RESULTS, TABLES

pytest.importorskip('matplotlib', reason='draws the pictures')
pytest.importorskip('plotly', reason='is within the page')

SVG = '{http://www.w3.org/2000/svg}'


@pytest.fixture(scope='module')
def files():
    return page_files(RESULTS)


def read(text):
    return list(csv.DictReader(io.StringIO(text)))


def test_a_page_its_pictures_and_its_tables(files):
    drawn = [f'{each.key}.svg' for each in DIAGRAMS]
    points = [f'{each.key}_points.csv' for each in DIAGRAMS]
    assert sorted(files) == sorted(
        ['index.html', *drawn, *points, *(f'{each.key}.csv' for each in TABLES)]
    )


def test_the_same_results_are_the_same_bytes(files):
    assert page_files(RESULTS) == files


def test_every_link_of_the_page_leads_somewhere(files):
    page = files['index.html'].decode()
    body = page.partition('<body>')[2].partition('<script')[0]
    links = re.findall(r'<a href="([^"]*)"', body)
    anchors = {f'#{found}' for found in re.findall(r' id="([^"]*)"', body)}
    assert {*files} - {'index.html'} <= set(links) <= {*files} | anchors


def test_the_page_forbids_every_request_and_names_no_address(files):
    page = files['index.html'].decode()
    own = re.sub(r'<script>.*?</script>', '', page, count=1, flags=re.DOTALL)
    assert f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">' in page
    assert not re.findall(r'(?:src|href)="(?!data:|#|[a-z0-9_]+\.(?:svg|csv)")[^"]*"', own)


def test_no_text_is_taken_for_markup(files):
    page = files['index.html'].decode()
    assert '<b>tag</b>' not in page.replace(r'\u003cb>tag', '')
    assert '<i>words</i>' not in page
    assert page.count('</script>') == 3  # the data's, the library's, the page's own


def test_a_table_keeps_every_bit_of_its_numbers(files):
    rows = read(files['solving_methods.csv'].decode())
    for row, said in zip(METHODS.rows, rows, strict=True):
        time, error, memory = row[1:4]
        if isinstance(time, Spread):
            quartiles = [said[f'time, {each} [µs]'] for each in ('low', 'middle', 'high')]
            assert tuple(map(float, quartiles)) == time
        number = float(said['error [rad]'])
        assert number == error or (isnan(number) and isnan(error))
        assert said['memory [B]'] == ('' if memory is None else str(memory))
        assert said['method'] == row[0]
        assert said['remark'] == (row[5] or '')
    assert [row['time, middle [µs]'] for row in rows[2:]] == ['300.25', 'failed', '']
    assert [row['time, low [µs]'] for row in rows[2:]] == ['', '', '']
    assert [row['ratio, high'] for row in rows] == ['1.0', '', '', 'inf', '']


def test_numbers_of_numpy_are_numbers():
    table = Table('key', '', ('a', 'b [m]'), [(np.int64(3), Spread(*np.array([0.1, 0.2, 0.3])))])
    assert table_csv(table) == 'a,"b, low [m]","b, middle [m]","b, high [m]"\n3,0.1,0.2,0.3\n'


def test_the_points_of_a_diagram_with_setting_units_and_quartiles():
    rows = read(diagram_csv(POSITION))
    assert len(rows) == sum(len(curve.points) for curve in POSITION.curves)
    assert rows[1] == {
        'curve': NEWTON.name,
        'setting': 'tolerance 1e-2',
        'time per state, low [µs]': '1.8',
        'time per state, middle [µs]': '1.9',
        'time per state, high [µs]': '2.1',
        'greatest error, low [rad]': '0.0005',
        'greatest error, middle [rad]': '0.001',
        'greatest error, high [rad]': '0.002',
    }


@pytest.mark.parametrize('diagram', DIAGRAMS, ids=lambda diagram: diagram.key)
def test_a_picture_has_all_curves_and_says_their_names_units_and_message(files, diagram):
    builder = ET.TreeBuilder(insert_comments=True)
    parser = ET.XMLParser(target=builder)
    picture = ET.fromstring(files[f'{diagram.key}.svg'], parser)
    groups = {group.get('id') for group in picture.iter(f'{SVG}g')}
    assert {f'curve_{n + 1}' for n in range(len(diagram.curves))} <= groups
    # Letters are drawn as shapes, each text behind a comment that says it.
    said = ' '.join(
        ' '.join(unescape(each.text).split()) for each in picture.iter() if each.tag is ET.Comment
    )
    named = [curve.curve.name for curve in places(diagram).curves if curve.named]
    for text in (diagram.title, diagram.x.unit, diagram.y.unit, *named):
        assert ' '.join(text.split()) in said


def test_a_picture_of_a_curve_has_a_mark_for_each_point_that_has_a_place(files):
    picture = ET.fromstring(files['solving_position.svg'])
    (curve,) = (group for group in picture.iter(f'{SVG}g') if group.get('id') == 'curve_2')
    assert len(list(curve.iter(f'{SVG}use'))) == 3  # four points, one failed


def test_a_folder_is_written_as_a_whole(tmp_path):
    write_page(RESULTS, tmp_path / 'new' / 'page')
    assert {file.name for file in (tmp_path / 'new' / 'page').iterdir()} == set(
        page_files(RESULTS)
    )
    assert [folder.name for folder in (tmp_path / 'new').iterdir()] == ['page']


def test_a_folder_that_exists_is_not_touched(tmp_path):
    folder = tmp_path / 'page'
    folder.mkdir()
    with pytest.raises(LinkageError, match='exists already; name a new folder'):
        write_page(RESULTS, folder)
    assert not list(folder.iterdir())


def test_where_nothing_can_be_written_nothing_is_left(tmp_path):
    (tmp_path / 'file').write_text('', 'utf-8')
    with pytest.raises(LinkageError, match='cannot be written'):
        write_page(RESULTS, tmp_path / 'file' / 'page')
    assert [file.name for file in tmp_path.iterdir()] == ['file']


def test_a_write_that_fails_leaves_no_folder(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr('pathlib.Path.write_bytes', full)
    with pytest.raises(LinkageError, match='No space left on device'):
        write_page(RESULTS, tmp_path / 'page')
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize('missing', ['matplotlib', 'plotly'])
def test_what_draws_is_missed_before_anything_is_written(tmp_path, monkeypatch, missing):
    def find_spec(name):
        return None if name == missing else object()

    monkeypatch.setattr('linkage_ros.errors.find_spec', find_spec)
    with pytest.raises(LinkageError, match=rf'{missing}: is not installed; pip install'):
        write_page(RESULTS, tmp_path / 'page')


@pytest.mark.parametrize('keys', [('../up',), ('same', 'same'), ('',)])
def test_a_key_is_the_name_of_one_file(keys):
    diagrams = [Diagram(key, '', POSITION.x, POSITION.y, []) for key in keys]
    with pytest.raises(ValueError, match='is no name of a file'):
        page_files(Results('', [], [Part('solving', '', '', diagrams=diagrams)]))
