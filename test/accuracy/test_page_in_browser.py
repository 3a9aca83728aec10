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

from itertools import combinations
import re

from linkage_ros.accuracy.page.diagrams import places
from linkage_ros.accuracy.page.files import PAGE, write_page
from linkage_ros.accuracy.results import replies, reply
import pytest

from .shown import DIAGRAMS, EMPTY, FAILED, LONG, METHODS, POSITION, RESULTS
from ..browser.opened import opened

pytest.importorskip('matplotlib', reason='draws the pictures')
pytest.importorskip('plotly', reason='is within the page')

# Number of marks drawn in a diagram.
MARKS = '(key) => document.querySelectorAll(`[data-diagram=${key}] .scatterlayer .point`).length'
COLOURS = """() => {
  const style = getComputedStyle(document.body);
  return [style.color, style.backgroundColor];
}"""
DRAWN = """(folded) => {
  document.querySelectorAll('details').forEach((each) => { each.open = folded; });
  return new Promise((done) => setTimeout(done, 300));
}"""
LAYOUT = f'document.querySelector("[data-diagram={POSITION.key}] .plot").layout'


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
        shown.page.evaluate(DRAWN, True)
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
def test_axes_have_their_units_and_each_curve_its_name_beside_a_point(read, diagram):
    figure = read.page.locator(f'[data-diagram={diagram.key}]')
    assert figure.locator('figcaption').inner_text() == diagram.title
    for axis, where in ((diagram.x, '.xtitle'), (diagram.y, '.ytitle')):
        unit = f' [{axis.unit}]' if axis.unit else ''
        assert figure.locator(where).text_content() == f'{axis.name}{unit}'
    names = [''.join(text.split()) for text in figure.locator('.annotation').all_text_contents()]
    named = [curve.curve.name for curve in places(diagram).curves if curve.named]
    assert sorted(names) == sorted(''.join(name.split()) for name in named) or not named


@pytest.mark.parametrize('diagram', [EMPTY, FAILED], ids=lambda diagram: diagram.key)
def test_a_diagram_without_a_point_says_so(read, diagram):
    figure = read.page.locator(f'[data-diagram={diagram.key}]')
    assert figure.locator('.annotation').text_content() == 'nothing was measured'


def test_the_pointer_over_a_point_tells_its_setting_and_its_values_with_units(shown):
    figure = shown.page.locator(f'[data-diagram={POSITION.key}]')
    # The front is the first trace, the cheap curve the second.
    figure.locator('.scatterlayer .trace').nth(2).locator('.point').first.hover(force=True)
    told = shown.page.locator('.hovertext')
    told.wait_for()
    text = ''.join(told.text_content().split())
    for words in (LONG, 'tolerance 1e-2', '1.9 (1.8–2.1) µs', '0.0010 (0.0005–0.0020) rad'):
        assert ''.join(words.split()) in text
    assert not shown.said


def test_a_plot_can_be_zoomed(shown):
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
        # A picture of each part, and the first; the others are folded.
        assert shown.page.locator('.still:visible').count() == 3
        shown.page.locator('summary').last.click()
        assert shown.page.locator('.still:visible').count() == 5


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


def test_the_page_begins_with_its_result_and_one_picture(read):
    assert read.page.locator('header .headline').inner_text() == RESULTS.headline
    first = read.page.locator('main > *').first
    assert first.get_attribute('data-diagram') == POSITION.key


def test_method_tables_and_advice_are_folded(shown):
    part = shown.page.locator('section#solving')
    assert part.locator('> .headline').is_visible()
    assert not part.locator('table').is_visible()
    part.locator('summary').click()
    assert part.locator('table').is_visible()
    assert part.locator('li').all_inner_texts() == list(RESULTS.parts[0].advice)


def answers(shown):
    names = shown.page.locator('.wanted dt').all_inner_texts()
    return dict(zip(names, shown.page.locator('.wanted dd').all_inner_texts(), strict=True))


@pytest.mark.parametrize('typed', ['0.1', '0.02', '1e-3', '1e-6', '1e-30', ' 0,02 '])
def test_the_field_answers_as_the_terminal_does(shown, typed):
    shown.page.locator('.wanted input').fill(typed)
    expected = reply(replies(RESULTS), float(typed.replace(',', '.')))
    said = answers(shown)
    assert said['write into the scene'] == expected.write
    assert said['a tick then costs'] == expected.tick
    assert said['tick rates that make use of it'] == expected.rate
    assert not shown.said


@pytest.mark.parametrize('typed', ['', 'much', '0', '-1', 'Infinity'])
def test_the_field_says_what_to_write_where_it_has_no_number(shown, typed):
    shown.page.locator('.wanted input').fill(typed)
    assert answers(shown) == {'not a number above 0': 'write 0.001, or 1e-6'}


def test_names_beside_the_points_do_not_cover_each_other(read):
    figure = read.page.locator(f'[data-diagram={POSITION.key}]')
    boxes = [each.bounding_box() for each in figure.locator('.annotation-text').all()]
    assert len(boxes) == len(POSITION.curves)
    for one, other in combinations(boxes, 2):
        apart_x = max(one['x'], other['x']) - min(
            one['x'] + one['width'], other['x'] + other['width']
        )
        apart_y = max(one['y'], other['y']) - min(
            one['y'] + one['height'], other['y'] + other['height']
        )
        assert max(apart_x, apart_y) >= 0
