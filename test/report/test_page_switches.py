# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The switches and keys of a report page, the names in its plots, and the widths it fits."""

from itertools import combinations, pairwise
from math import pi

from linkage_ros.messages import JointStateWriter
import numpy as np
import pytest

from . import bags
from .runs import but, recorded
from .test_page_in_browser import COLOURS, page_of, readout, settle, TRACE
from ..browser.opened import opened
from ..cli.recorded import BEGIN, scene_file, SECOND

pytest.importorskip('plotly', reason='is within the page')

DEGREE = pi / 180
PLOT = """(key) => {
  const figure = document.querySelector(`[data-plot="${key}"]`);
  return {
    caption: figure.querySelector('figcaption').textContent,
    axis: figure.querySelector('.plot').layout.yaxis.title.text,
  };
}"""
# Boxes of elements in a plot: left, top, right and bottom.
BOXES = """(selector) => [
  ...document.querySelectorAll(`[data-plot=events] ${selector}`),
].map((each) => {
  const {left, top, right, bottom} = each.getBoundingClientRect();
  return [left, top, right, bottom];
})"""
# Elements that reach beyond the window; what scrolls within its own box may.
WIDER = """() => [...document.body.querySelectorAll(':not(.scroll *, svg *)')]
  .filter((each) =>
    each.getBoundingClientRect().right > document.documentElement.clientWidth + 0.5)
  .map((each) => `${each.tagName} ${each.id} ${each.className}`)"""
RATE = 100


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp('views')


@pytest.fixture(scope='module')
def turning_file(folder):
    """Return the page of a crank that turns twice in 4 s."""
    return page_of(turning(folder / 'turning', 'continuous'))


def turning(folder, angles):
    """Write a run of a crank that turns twice in 4 s, with angles as a scene publishes them."""
    folder.mkdir()
    scene = scene_file(
        folder,
        f'rate: {RATE}\nangles: {angles}\ndrive: {{constant_rate: {{rate: {pi}}}}}\n'
        'effects: {velocity: {}}\n',
        'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n',
    )
    writer = JointStateWriter(['crank_joint', 'coupler_joint', 'rocker_joint'])

    def messages():
        for row in range(4 * RATE + 1):
            crank = pi * row / RATE
            coupler, rocker = bags.follow(0.04, 0.12, 0.08, 0.1, crank)
            values = [crank, coupler, rocker]
            if angles == 'wrapped':
                values = [np.angle(np.exp(1j * value)) for value in values]
            stamp = BEGIN + row * (SECOND // RATE)
            yield bags.STATES, stamp, stamp, writer.write(stamp, values, [pi, 0.0, 0.0])

    return bags.write(folder / 'bag', messages(), scene)


@pytest.fixture
def shown(browser, turning_file):
    with opened(browser, turning_file) as page:
        yield page
        assert not page.said


def values(page, joint='crank_joint', plot='positions_rad'):
    """Return the values of a curve, without its interruptions."""
    told = page.evaluate(TRACE, [plot, joint])['y']
    return np.array([value for value in told if value is not None])


def test_the_switch_to_degrees_changes_titles_values_and_the_readout(shown):
    page = shown.page
    radians = {key: values(page, plot=key) for key in ('positions_rad', 'rates_rad')}
    assert page.evaluate(PLOT, 'rates_rad') == {
        'caption': 'Rates of angles [rad/s]', 'axis': '[rad/s]'
    }  # fmt: skip
    page.evaluate('Report.seek(2.5)')
    assert readout(page)['crank_joint'] == '7.85398 rad (1 turn + 90.00°)'
    page.locator('#unit').select_option('degrees')
    settle(page)
    assert page.evaluate(PLOT, 'positions_rad') == {'caption': 'Angles [°]', 'axis': '[°]'}
    assert page.evaluate(PLOT, 'rates_rad') == {
        'caption': 'Rates of angles [°/s]', 'axis': '[°/s]'
    }  # fmt: skip
    for key, before in radians.items():
        assert values(page, plot=key) == pytest.approx(before / DEGREE)
    assert readout(page)['crank_joint'] == '450.000° (1 turn + 90.00°)'
    over = "document.querySelector('[data-plot=crossed_0] .plot').layout"
    assert page.evaluate(f'{over}.xaxis.range') == [0, 360]
    assert page.evaluate(f'{over}.yaxis.title.text') == '[°]'
    page.locator('#unit').select_option('rad')
    settle(page)
    assert (values(page) == radians['positions_rad']).all()


def test_within_half_a_turn_continuous_angles_are_interrupted_where_they_jump(shown):
    page = shown.page
    continuous = values(page)
    assert np.ptp(continuous) == pytest.approx(4 * pi)
    page.locator('#range').select_option('wrapped')
    settle(page)
    wrapped = values(page)
    assert np.exp(1j * wrapped) == pytest.approx(np.exp(1j * continuous))
    assert np.abs(wrapped).max() <= pi
    told = page.evaluate(TRACE, ['positions_rad', 'crank_joint'])['y']
    for before, after in pairwise(told):
        assert before is None or after is None or abs(after - before) < 0.1
    page.evaluate('Report.seek(2.5)')
    assert readout(page)['crank_joint'] == '1.57080 rad (90.00°)'


def test_angles_recorded_within_a_turn_are_shown_so_until_they_are_made_continuous(
    browser, folder
):
    with opened(browser, page_of(turning(folder / 'wrapped', 'wrapped'))) as page:
        assert page.page.locator('#range').input_value() == 'wrapped'
        assert np.abs(values(page.page)).max() <= pi
        page.page.locator('#range').select_option('continuous')
        settle(page.page)
        expected = pi * np.arange(4 * RATE + 1) / RATE
        assert values(page.page) == pytest.approx(expected, abs=1e-12)
        assert not page.said


def test_intervals_of_a_long_run_are_cut_at_half_a_turn(browser, folder):
    bag, _ = bags.long(folder / 'long')
    with opened(browser, page_of(bag)) as page:
        page.page.keyboard.press('w')
        settle(page.page)
        told = page.page.evaluate(TRACE, ['positions_rad', 'crank_joint'])
        assert told['rows'] > 1
        wrapped = values(page.page)
        # Each of the 19 jumps leaves the plot at its upper edge, and comes back at its lower one.
        assert (wrapped == pi).sum() + (wrapped == -pi).sum() <= 2 * 19
        assert np.abs(wrapped).max() <= pi
        for before, after in pairwise(told['y']):
            assert before is None or after is None or abs(after - before) < 0.5
        assert not page.said


@pytest.mark.parametrize('scheme', ['light', 'dark'])
def test_the_switch_of_colours_turns_what_the_system_asks_for(browser, turning_file, scheme):
    with opened(browser, turning_file, color_scheme=scheme) as page:
        own = page.page.evaluate(COLOURS)
        line = page.page.evaluate(TRACE, ['positions_rad', 'crank_joint'])['colour']
        page.page.locator('#scheme').click()
        settle(page.page)
        other = page.page.evaluate(COLOURS)
        assert page.page.evaluate(TRACE, ['positions_rad', 'crank_joint'])['colour'] != line
        page.page.keyboard.press('l')
        settle(page.page)
        assert page.page.evaluate(COLOURS) == own
    with opened(
        browser, turning_file, color_scheme={'light': 'dark', 'dark': 'light'}[scheme]
    ) as page:
        assert page.page.evaluate(COLOURS) == other


def test_every_control_is_reached_and_worked_by_keys_alone(shown):
    page = shown.page
    reached = set()
    for _ in range(20):
        page.keyboard.press('Tab')
        reached.add(page.evaluate('document.activeElement.id'))
    assert {
        'scheme',
        'play',
        'back',
        'onward',
        'scrub',
        'speed',
        'traces',
        'unit',
        'range',
    } <= reached
    page.evaluate('document.activeElement.blur()')
    page.keyboard.press('End')
    assert page.evaluate('Report.time === Report.whole[1]')
    page.keyboard.press('Home')
    assert page.evaluate('Report.time') == 0
    page.evaluate('Report.seek(2)')
    page.keyboard.press('+')
    assert page.evaluate('Report.view') == pytest.approx([2 - 2 / 1.5, 2 + 2 / 1.5])
    page.keyboard.press('-')
    assert page.evaluate('Report.view') == pytest.approx([0, 4])
    page.keyboard.press('+')
    page.keyboard.press('0')
    assert page.evaluate('Report.view') == [0, 4]
    page.keyboard.press('d')
    page.keyboard.press('w')
    assert page.locator('#unit').input_value() == 'degrees'
    assert page.locator('#range').input_value() == 'wrapped'
    # In a list, a letter chooses among its items.
    page.locator('#speed').press('d')
    assert page.locator('#unit').input_value() == 'degrees'


@pytest.fixture(scope='module')
def faulty_file(folder):
    """Return the page of a run in which faults begin together, overlap and follow each other."""
    names = ('loose_plug', 'worn_gear', 'bad_encoder', 'hung_driver')
    faults = ', '.join(f'{name}: {{silence: {{}}}}' for name in names)
    asked = {
        100: ((names[0], True), (names[1], True)),
        300: ((names[0], False), (names[2], True)),
        310: ((names[2], False),),
        320: ((names[3], True),),
        980: ((names[1], False),),
    }
    place = folder / 'faulty'
    place.mkdir()
    moments = but(1000, lambda tick, moment: moment._replace(asked=asked.get(tick, ())))
    return names, page_of(recorded(place, f'faults: {{{faults}}}\n', moments).path)


@pytest.mark.parametrize('width', [400, 1600])
def test_each_fault_is_named_at_its_bar_and_no_name_lies_on_another(browser, faulty_file, width):
    names, file = faulty_file
    with opened(browser, file, width=width) as page:
        told = page.page.locator('[data-plot=events] .annotation-text').all_text_contents()
        assert sorted(told) == sorted(names)
        boxes = page.page.evaluate(BOXES, '.annotation-text')
        rows = page.page.evaluate(BOXES, '.ytick text')
        ((left, _, right, _),) = page.page.evaluate(BOXES, '.nsewdrag')
        assert all(left <= box[0] and box[2] <= right + 1 for box in boxes)
        # The names of rows have a gutter of their own, left of the bars and the time.
        assert all(box[2] <= left for box in rows)
        assert all(box[0] >= 0 for box in rows)
        for one, other in combinations([*boxes, *rows], 2):
            apart = one[2] <= other[0] or other[2] <= one[0]
            assert apart or one[3] <= other[1] + 2 or other[3] <= one[1] + 2
        assert not page.said


@pytest.mark.parametrize('width', [400, 1600])
def test_nothing_is_wider_than_the_window_and_wide_tables_scroll(browser, faulty_file, width):
    _, file = faulty_file
    with opened(browser, file, width=width) as page:
        assert page.page.evaluate(WIDER) == []
        topics = page.page.locator('figure:has(figcaption:text-is("Topics")) .scroll')
        inner, outer = topics.evaluate('(each) => [each.scrollWidth, each.clientWidth]')
        if width == 400:
            assert inner > outer
            topics.focus()
            page.page.keyboard.press('ArrowRight')
            page.page.wait_for_function(
                '() => [...document.querySelectorAll(".scroll")].some((each) => each.scrollLeft)'
            )
        assert not page.said
