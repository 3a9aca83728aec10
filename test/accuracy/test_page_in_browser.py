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

"""The page in a real browser: drawn, told, in every width and light, and silent to the network."""

from __future__ import annotations

import json
import re

from linkage_ros.accuracy.page.diagrams import places
from linkage_ros.accuracy.page.files import PAGE, write_page
import pytest

from .shown import DIAGRAMS, EMPTY, FAILED, LONG, MANY, METHODS, POSITION, RESULTS
from ..browser.chromium import browser as chromium
from ..browser.opened import opened

pytest.importorskip('matplotlib', reason='draws the pictures')
pytest.importorskip('plotly', reason='is within the page')

# Number of marks drawn in a diagram.
MARKS = '(key) => document.querySelectorAll(`[data-diagram=${key}] .scatterlayer .point`).length'
COLOURS = """() => {
  const style = getComputedStyle(document.body);
  return [style.color, style.backgroundColor];
}"""
LAYOUT = f'document.querySelector("[data-diagram={POSITION.key}] .plot").layout'


@pytest.fixture(scope='module')
def browser():
    with chromium() as started:
        yield started


@pytest.fixture(scope='module')
def file(tmp_path_factory):
    folder = tmp_path_factory.mktemp('accuracy') / 'page'
    write_page(RESULTS, folder)
    return folder / PAGE


@pytest.fixture
def shown(browser, file):
    """Give the page, freshly opened."""
    with opened(browser, file) as shown:
        yield shown


@pytest.fixture(scope='module')
def read(browser, file):
    """Give the page for those who only look."""
    with opened(browser, file) as shown:
        yield shown


def drawn_points(diagram):
    return sum(point is not None for curve in places(diagram).curves for point in curve.points)


def brightness(colour):
    return sum(map(int, re.findall(r'\d+', colour)[:3])) / 3


@pytest.mark.parametrize('scheme', ['light', 'dark'])
@pytest.mark.parametrize('width', [400, 1600])
def test_it_opens_without_a_word_a_request_or_a_scroll_bar(browser, file, width, scheme):
    with opened(browser, file, width=width, color_scheme=scheme) as shown:
        assert shown.page.title() == f'What accuracy costs: {RESULTS.scene}'
        assert not shown.said
        assert shown.asked == [file.as_uri()]
        assert not shown.is_wider_than_its_window()


def test_a_request_would_be_seen_and_refused(shown):
    # Without this the tests that see none would say nothing.
    shown.page.evaluate("fetch('https://example.invalid/').catch(() => 0)")
    shown.page.evaluate("document.body.append(Object.assign(new Image(), {src: 'x.png'}))")
    shown.page.wait_for_timeout(100)
    assert sum('Content Security Policy' in each for each in shown.said) >= 2


@pytest.mark.parametrize('diagram', DIAGRAMS, ids=lambda diagram: diagram.key)
def test_every_point_that_has_a_place_is_drawn(read, diagram):
    assert read.page.evaluate(MARKS, diagram.key) == drawn_points(diagram)


@pytest.mark.parametrize('diagram', DIAGRAMS, ids=lambda diagram: diagram.key)
def test_axes_have_their_units_and_the_legend_all_names(read, diagram):
    figure = read.page.locator(f'[data-diagram={diagram.key}]')
    assert figure.locator('figcaption').inner_text() == diagram.title
    for axis, where in ((diagram.x, '.xtitle'), (diagram.y, '.ytitle')):
        unit = f' [{axis.unit}]' if axis.unit else ''
        assert figure.locator(where).text_content() == f'{axis.name}{unit}'
    names = [''.join(text.split()) for text in figure.locator('.legendtext').all_text_contents()]
    assert names == [''.join(curve.name.split()) for curve in diagram.curves]


@pytest.mark.parametrize('diagram', [EMPTY, FAILED], ids=lambda diagram: diagram.key)
def test_a_diagram_without_a_point_says_so(read, diagram):
    figure = read.page.locator(f'[data-diagram={diagram.key}]')
    assert figure.locator('.annotation').text_content() == 'nothing was measured'


def test_the_pointer_over_a_point_tells_its_setting_and_its_values_with_units(shown):
    figure = shown.page.locator(f'[data-diagram={POSITION.key}]')
    figure.locator('.scatterlayer .trace').nth(1).locator('.point').first.hover(force=True)
    told = shown.page.locator('.hovertext')
    told.wait_for()
    text = ''.join(told.text_content().split())
    for words in (LONG, 'tolerance 1e-2', '1.9 (1.8–2.1) µs', '0.0010 (0.0005–0.0020) rad'):
        assert ''.join(words.split()) in text
    assert not shown.said


def test_a_curve_can_be_hidden_and_a_plot_zoomed(shown):
    shown.page.locator(f'[data-diagram={MANY.key}] .legendtoggle').nth(5).click()
    shown.page.wait_for_function(f'() => ({MARKS})({json.dumps(MANY.key)}) < {drawn_points(MANY)}')
    plot = shown.page.locator(f'[data-diagram={POSITION.key}] .nsewdrag')
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    before = shown.page.evaluate(f'{LAYOUT}.xaxis.range')
    shown.page.mouse.move(box['x'] + 50, box['y'] + 50)
    shown.page.mouse.down()
    shown.page.mouse.move(box['x'] + 250, box['y'] + 200, steps=5)
    shown.page.mouse.up()
    after = shown.page.evaluate(f'{LAYOUT}.xaxis.range')
    assert before[0] < after[0] < after[1] < before[1]
    assert not shown.said


def test_light_and_dark_are_what_the_reader_has_chosen_also_while_it_is_open(shown):
    ink, paper = map(brightness, shown.page.evaluate(COLOURS))
    assert ink < 80
    assert paper > 220
    shown.page.emulate_media(color_scheme='dark')
    ink, paper = map(brightness, shown.page.evaluate(COLOURS))
    assert ink > 200
    assert paper < 60
    plot = f'[data-diagram={POSITION.key}] .main-svg'
    ground = shown.page.locator(plot).first.evaluate(
        '(svg) => getComputedStyle(svg).backgroundColor'
    )
    assert brightness(ground) < 60
    assert not shown.said


def test_a_plot_takes_the_width_that_its_window_gets(shown):
    plot = f'[data-diagram={POSITION.key}] .main-svg'
    for width in (1600, 400, 1000):
        shown.page.set_viewport_size({'width': width, 'height': 900})
        shown.page.wait_for_function(
            '([plot, width]) => Math.abs(document.querySelector(plot).clientWidth'
            ' - document.querySelector("figure").clientWidth) < 2',
            arg=[plot, width],
        )
        assert not shown.is_wider_than_its_window()
    assert shown.page.evaluate(MARKS, POSITION.key) == drawn_points(POSITION)
    assert not shown.said


def test_on_paper_the_pictures_stand_for_the_plots(shown):
    shown.page.emulate_media(media='print', color_scheme='dark')
    figure = shown.page.locator(f'[data-diagram={POSITION.key}]')
    assert not figure.locator('.plot').is_visible()
    assert figure.locator('.still').is_visible()
    assert figure.locator('.still').evaluate('(image) => image.naturalWidth') > 400
    ink, paper = map(brightness, shown.page.evaluate(COLOURS))
    assert (ink, paper) == (0, 255)


def test_where_no_script_runs_the_pictures_are_shown(browser, file):
    with opened(browser, file, java_script_enabled=False) as shown:
        assert shown.page.locator('.still:visible').count() == len(DIAGRAMS)


def test_a_table_is_as_it_was_measured(read):
    cells = read.page.locator('table').first.locator('tbody tr').nth(0).locator('td')
    assert cells.all_text_contents() == [
        'closed form',
        '0.70 (0.68–0.75)',
        '2.1e-16',
        '0',
        '1',
        '',
    ]
    assert read.page.locator('table').first.locator('tbody tr').count() == len(METHODS.rows)


def test_a_finger_scrolls_the_page_and_does_not_zoom(browser, file):
    with opened(browser, file, width=400, has_touch=True, is_mobile=True) as shown:
        assert shown.page.evaluate(f'{LAYOUT}.xaxis.fixedrange')
        assert shown.page.evaluate(f'{LAYOUT}.dragmode') is False
        assert not shown.is_wider_than_its_window()


def test_the_page_ends_in_advice(read):
    last = read.page.locator('main > section').last
    assert last.locator('h2').inner_text() == 'What to take'
    assert last.locator('li').all_inner_texts() == [
        each for part in RESULTS.parts for each in part.advice
    ]
