# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The page of a run in a real browser: what it shows is what was recorded, and it can be used."""

from cmath import rect
from math import pi
import random
import re
from threading import Event

from linkage_ros.tools.view import bag_page
from linkage_ros.tools.view.report import Window
import numpy as np
import pytest

from . import bags
from ..browser.opened import opened

pytest.importorskip('plotly', reason='is within the page')

FLOAT32 = 2e-8
"""A link's place and angle are numbers of 32 bits: so much of it is seen in a pin, in [m]."""

TICK = 0.0101

COLOURS = """() => {
  const style = getComputedStyle(document.body);
  return [style.color, style.backgroundColor];
}"""
RANGES = """() => [...document.querySelectorAll('[data-plot] .plot')]
  .filter((place) => place.querySelector('.cursor'))
  .map((place) => place.layout.xaxis.range)"""
DRAWN = """() => [...document.querySelectorAll('[data-plot]')].map((figure) => [
  figure.dataset.plot,
  figure.querySelectorAll('.scatterlayer path, .barlayer path').length,
])"""
TRACE = """([plot, name]) => {
  const {data} = document.querySelector(`[data-plot="${plot}"] .plot`);
  const {x, y, text, rows, line} = data.find((each) => each.name === name);
  return {x, y, text, rows, colour: line?.color};
}"""
# Positions of pins; None without a pose.
PINS = f"""() => {{
  const [linkage] = Report.linkages;
  const at = (link, x) => linkage.place(link, x, 0, Report.number);
  if (!linkage.hasPose(Report.number, Report.time)) return null;
  return [at('crank', {bags.A}), at('coupler', {bags.B}), at('rocker', {bags.C})];
}}"""
# A copy of a canvas: the canvas itself is not meant to be read.
COPY = """const copied = (canvas) => {
  const copy = new OffscreenCanvas(canvas.width, canvas.height);
  const pen = copy.getContext('2d', {willReadFrequently: true});
  pen.drawImage(canvas, 0, 0);
  return pen.getImageData(0, 0, canvas.width, canvas.height).data;
};"""
# For each canvas the number of pixels of each colour.
PAINTED = f"""() => {{ {COPY}
  return [...document.querySelectorAll('canvas')].map((canvas) => {{
    const data = copied(canvas);
    const found = {{}};
    for (let i = 0; i < data.length; i += 4) {{
      if (data[i + 3] < 255) continue;
      const colour = [data[i], data[i + 1], data[i + 2]].join();
      found[colour] = (found[colour] ?? 0) + 1;
    }}
    return found;
  }});
}}"""
# The colour at a position of the linkage, in [m]; None where nothing is painted.
COLOUR_AT = f"""([x, y]) => {{ {COPY}
  const canvas = document.querySelector('canvas');
  const [px, py] = Report.canvases[0].toPixel([x, y]).map((each) =>
    Math.round(each * devicePixelRatio));
  const at = 4 * (py * canvas.width + px);
  const [r, g, b, a] = copied(canvas).slice(at, at + 4);
  return a ? [r, g, b].join() : '';
}}"""
INPUT_FACE, LINK_FACE = '240,160,122', '195,211,226'
DARK_INPUT_FACE = '168,85,58'


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp('pages')


def page_of(bag):
    file = bag.parent / f'{bag.name}.html'
    file.write_text(bag_page(bag, Window(), Event()), 'utf-8')
    return file


@pytest.fixture(scope='module')
def drill_bag(folder):
    return bags.drill(folder / 'drill')


@pytest.fixture(scope='module')
def drill_file(drill_bag):
    return page_of(drill_bag)


@pytest.fixture(scope='module')
def read(browser, drill_file):
    """Give a page for those who leave it as it was."""
    with opened(browser, drill_file) as shown:
        yield shown


@pytest.fixture
def drill(read):
    """Give the page, at the beginning of the run and with all of it in its plots."""
    read.page.evaluate('Report.pause(); Report.zoom(null); Report.seek(0)')
    read.page.locator('#traces').check()
    read.page.evaluate('document.activeElement.blur(); scrollTo(0, 0)')
    settle(read.page)
    return read


@pytest.fixture(scope='module')
def long_run(browser, folder):
    bag, rockers = bags.long(folder / 'long')
    with opened(browser, page_of(bag)) as shown:
        yield shown, rockers


@pytest.fixture(scope='module')
def foreign_file(folder):
    return page_of(bags.foreign(folder / 'foreign'))


def settle(page):
    """Wait until what was asked for is drawn."""
    page.evaluate('() => new Promise((done) => requestAnimationFrame('
                  '() => requestAnimationFrame(done)))')  # fmt: skip


def scrub(page, share):
    """Move the bar to a share of the run, as a hand does; return the time that it stands for."""
    page.locator('#scrub').fill(str(round(share * 1e6)))
    return page.evaluate('Report.time')


def readout(page):
    rows = page.locator('#readout > div')
    terms, told = rows.locator('dt').all_text_contents(), rows.locator('dd').all_text_contents()
    return dict(zip(terms, told, strict=True))


def pixel_of(page, plot, x, y):
    """Return where a place of a plot is in the window, after it has been scrolled there."""
    place = page.locator(f'[data-plot="{plot}"] .plot')
    place.scroll_into_view_if_needed()
    return place.evaluate(
        """(place, [x, y]) => {
          const {left, top} = place.getBoundingClientRect();
          const {xaxis, yaxis} = place._fullLayout;
          return [left + xaxis._offset + xaxis.c2p(x), top + yaxis._offset + yaxis.c2p(y)];
        }""",
        [x, y],
    )


def brightness(colour):
    return sum(map(int, re.findall(r'\d+', colour)[:3])) / 3


def run_times(messages):
    """Yield messages with the time of the run, in [s], which a clock that is set back leaves."""
    begin = last = messages[0][1]
    added = 0
    for message in messages:
        added += max(0, last - message[1])
        last = message[1]
        yield (message[1] - begin + added) * 1e-9, message


@pytest.fixture(scope='module')
def recorded(drill_bag):
    """Give times and pins of all poses of the bag, by its numbers and the law of the circle."""
    samples = bags.joint_states(drill_bag, bags.CRANK)
    good = [each for each in samples if np.isfinite(each[4]).all()]
    numbers = [each[0] for each in good]
    times, pins = [], []
    for time, (number, _, stamp, names, values) in run_times(
        bags.joint_states(drill_bag, bags.STATES)
    ):
        assert names == ['coupler_joint', 'rocker_joint']
        _, _, taken, _, (angle, rate) = good[np.searchsorted(numbers, number) - 1]
        crank = angle + rate * (stamp - taken) * 1e-9
        coupler, rocker = values[:2]
        knee = rect(bags.A, crank)
        times.append(time)
        pins.append((
            knee, knee + rect(bags.B, crank + coupler), bags.D + rect(bags.C, rocker)
        ))  # fmt: skip
    return np.array(times), np.array(pins)


@pytest.mark.parametrize('scheme', ['light', 'dark'])
@pytest.mark.parametrize('width', [400, 1600])
def test_it_opens_without_a_word_a_request_or_a_scroll_bar(browser, drill_file, width, scheme):
    with opened(browser, drill_file, width=width, color_scheme=scheme) as shown:
        assert shown.page.title() == 'Run of drill & <b>bold</b>'
        assert not shown.said
        assert shown.asked == [drill_file.as_uri()]
        assert not shown.is_wider_than_its_window()
        ink, paper = map(brightness, shown.page.evaluate(COLOURS))
        assert (paper > 220 and ink < 80) if scheme == 'light' else (paper < 60 and ink > 200)
        assert all(count for _, count in shown.page.evaluate(DRAWN))
        (painted,) = shown.page.evaluate(PAINTED)
        assert painted[INPUT_FACE if scheme == 'light' else DARK_INPUT_FACE] > 100
        assert (DARK_INPUT_FACE if scheme == 'light' else INPUT_FACE) not in painted


def test_light_and_dark_are_what_the_reader_has_chosen_also_while_it_is_open(drill):
    line = drill.page.evaluate(TRACE, ['positions_rad', 'crank_joint'])['colour']
    drill.page.emulate_media(color_scheme='dark')
    settle(drill.page)
    (painted,) = drill.page.evaluate(PAINTED)
    assert DARK_INPUT_FACE in painted
    assert INPUT_FACE not in painted
    assert drill.page.evaluate(TRACE, ['positions_rad', 'crank_joint'])['colour'] != line
    drill.page.emulate_media(color_scheme='light')
    settle(drill.page)
    assert INPUT_FACE in drill.page.evaluate(PAINTED)[0]
    assert not drill.said


BROKEN = """() => {
  const broken = [];
  const walk = document.createTreeWalker(document.getElementById('readout'), NodeFilter.SHOW_TEXT);
  for (let node = walk.nextNode(); node; node = walk.nextNode()) {
    for (const found of node.data.matchAll(/[A-Za-z]+/g)) {
      const range = document.createRange();
      range.setStart(node, found.index);
      range.setEnd(node, found.index + found[0].length);
      if (range.getClientRects().length > 1) broken.push(found[0]);
    }
  }
  return broken;
}"""


def test_it_opens_at_the_first_pose(browser, folder):
    """A crank may come long after the run began: an empty picture would say nothing."""
    with opened(browser, page_of(bags.late(folder / 'late'))) as shown:
        assert shown.page.evaluate(PINS) is not None
        assert float(readout(shown.page)['time'].removesuffix(' s')) == pytest.approx(
            0.6, abs=0.05
        )
        assert not shown.said


def test_at_400_pixels_no_word_of_the_readout_is_broken(browser, drill_file):
    with opened(browser, drill_file, width=400) as shown:
        for time in (0.0, 2.05, 5.1):
            shown.page.evaluate('(time) => Report.seek(time)', time)
            assert shown.page.evaluate(BROKEN) == []


def test_the_bar_moves_the_pose_to_the_recorded_one(drill, recorded):
    times, pins = recorded
    end = drill.page.evaluate('Report.whole[1]')
    draws = random.Random(8)
    posed = 0
    for share in [0.0, 1.0, *(draws.random() for _ in range(60))]:
        time = scrub(drill.page, share)
        assert time == pytest.approx(share * end, abs=1e-6 * end)
        newest = np.searchsorted(times, time + 1e-9) - 1
        # Three periods without a joint state are a silence.
        following = times[newest + 1] if newest + 1 < len(times) else times[newest]
        silent = following - times[newest] > 0.03
        shown = drill.page.evaluate(PINS)
        if silent:
            assert shown is None
            continue
        posed += 1
        found = np.array(shown) @ [1, 1j]
        assert np.abs(found - pins[newest]).max() < FLOAT32
    assert posed > 30


def test_a_sensor_that_is_wrong_is_seen_as_such(drill, recorded):
    times, pins = recorded
    scrub(drill.page, 0.99)
    newest = np.searchsorted(times, drill.page.evaluate('Report.time') + 1e-9) - 1
    apart = abs(pins[newest][1] - pins[newest][2])
    assert apart > 1e-3
    told = readout(drill.page)['links come apart by']
    assert told == f'{1e3 * apart:.2f} mm'


def test_the_picture_is_painted_where_the_pose_is(drill, recorded):
    times, pins = recorded
    page = drill.page
    page.locator('#traces').uncheck()

    def colour_at(place):
        return page.evaluate(COLOUR_AT, [place.real, place.imag])

    middles = {}
    for time in (0.5, 1.65):
        page.evaluate('(time) => Report.seek(time)', time)
        newest = np.searchsorted(times, time + 1e-9) - 1
        middles[time] = pins[newest][0] / 2
        for pin_a, pin_b, face in ((0, pins[newest][0], INPUT_FACE),
                                   (bags.D, pins[newest][2], LINK_FACE)):  # fmt: skip
            middle = (pin_a + pin_b) / 2
            assert colour_at(middle) == face
    assert abs(middles[0.5] - middles[1.65]) > 0.01
    # Where the crank was before, there is paper.
    assert colour_at(middles[0.5]) == ''
    page.locator('#traces').check()


@pytest.mark.parametrize('time', [1.25, 3.4, 5.1])
def test_where_no_joint_state_was_recorded_no_pose_is_drawn_and_the_page_says_so(drill, time):
    assert INPUT_FACE in drill.page.evaluate(PAINTED)[0]
    drill.page.evaluate('(time) => Report.seek(time)', time)
    (painted,) = drill.page.evaluate(PAINTED)
    assert INPUT_FACE not in painted
    assert LINK_FACE not in painted
    told = readout(drill.page)
    assert told['pose'] == 'none recorded here'
    assert 'gap in joint states' in told['going on']
    assert 'rocker_joint' not in told


def test_the_readout_tells_values_with_units_and_what_is_going_on(drill):
    told = readout(drill.page)
    assert told['time'] == '0.000000 s'
    coupler, rocker = bags.follow(bags.A, bags.B, bags.C, bags.D, 0.9 * pi * 0.003)
    for joint, value in (('coupler_joint', coupler), ('rocker_joint', rocker)):
        number, unit, degrees = told[joint].split()
        assert float(number) == pytest.approx(value, rel=1e-5)
        assert unit == 'rad'
        assert float(degrees.strip('(°)')) == pytest.approx(value * 180 / pi, abs=0.0051)
    assert 'going on' not in told
    drill.page.evaluate('Report.seek(2.05)')
    assert 'samples rejected: position or rate not finite' in readout(drill.page)['going on']


def test_it_plays_as_fast_as_was_asked_for_and_stops_at_the_end(browser, drill_file):
    with opened(browser, drill_file) as shown:
        page = shown.page
        page.clock.install(time=0)
        page.clock.pause_at(1000)
        for speed in ('1', '0.25', '2'):
            page.evaluate('Report.pause(); Report.seek(0.5)')
            page.locator('#speed').select_option(speed)
            page.locator('#play').click()
            page.clock.run_for(1000)
            # It goes on picture by picture, of which there are 60 a second.
            passed = page.evaluate('Report.time') - 0.5
            assert passed == pytest.approx(float(speed), abs=0.02 * float(speed))
        assert page.locator('#play').get_attribute('aria-label') == 'Pause'
        page.locator('#play').click()
        stood = page.evaluate('Report.time')
        page.clock.run_for(500)
        assert page.evaluate('Report.time') == stood
        page.locator('#speed').select_option('60')
        page.locator('#play').click()
        page.clock.run_for(500)
        assert page.evaluate('[Report.time, Report.playing]') == [
            page.evaluate('Report.whole[1]'), False,
        ]  # fmt: skip
        assert page.locator('#play').get_attribute('aria-label') == 'Play'
        # At the end it begins anew.
        page.locator('#speed').select_option('1')
        page.locator('#play').click()
        page.clock.run_for(100)
        assert 0 < page.evaluate('Report.time') < 0.2
        assert not shown.said


def test_the_pose_moves_while_it_plays(drill):
    before = drill.page.evaluate(PINS)
    drill.page.locator('#play').click()
    drill.page.wait_for_function('() => Report.time > 0.05')
    drill.page.locator('#play').click()
    assert drill.page.evaluate(PINS) != before


def test_buttons_and_keys_step_from_picture_to_picture(drill, recorded):
    times, _ = recorded
    page = drill.page
    numbers = []
    for act in (
        lambda: page.locator('#onward').click(),
        lambda: page.keyboard.press('ArrowRight'),
        lambda: page.locator('#scrub').press('ArrowRight'),
        lambda: page.locator('#back').click(),
        lambda: page.keyboard.press('ArrowLeft'),
    ):
        act()
        number = page.evaluate('Report.number')
        assert page.evaluate('Report.time') == pytest.approx(times[number], abs=1e-9)
        numbers.append(number)
    assert numbers == [1, 2, 3, 2, 1]
    for _ in range(3):
        page.locator('#back').click()
    assert page.evaluate('Report.number') == 0
    assert not drill.said


def test_space_plays_and_pauses_unless_it_is_meant_for_something_else(drill):
    page = drill.page
    page.keyboard.press(' ')
    assert page.evaluate('Report.playing')
    page.keyboard.press(' ')
    assert not page.evaluate('Report.playing')
    page.locator('summary').press(' ')
    assert page.locator('details').get_attribute('open') is not None
    assert not page.evaluate('Report.playing')
    page.locator('summary').press(' ')
    page.locator('#traces').press(' ')
    assert not page.evaluate('Report.playing')
    assert not page.locator('#traces').is_checked()
    page.locator('#traces').check()
    before = page.evaluate('Report.number')
    page.keyboard.press('Control+ArrowRight')
    assert page.evaluate('Report.number') == before


def test_a_zoom_in_one_plot_is_one_in_all_and_a_double_click_shows_all_again(drill):
    page = drill.page
    whole = page.evaluate('Report.whole')
    assert page.evaluate(RANGES) == [whole] * 5
    drag(page, 'rates_rad', 2.0, 4.0)
    ranges = page.evaluate(RANGES)
    assert ranges == [ranges[0]] * 5
    assert ranges[0] == pytest.approx([2.0, 4.0], abs=0.05)
    # The bar is for all of the run, whatever is shown of it.
    assert scrub(page, 1.0) == whole[1]
    lanes = page.evaluate("document.querySelector('[data-plot=events] .plot').data")
    shown = [x for lane in lanes for x in lane['x'] if x is not None]
    assert shown
    assert all(whole[0] <= x <= whole[1] for x in shown)
    x, y = pixel_of(page, 'age', 3.0, 100.0)
    page.mouse.dblclick(x, y)
    settle(page)
    assert page.evaluate(RANGES) == [whole] * 5
    assert page.evaluate('Report.whole') == whole
    assert not drill.said


def drag(page, plot, begin, end):
    """Draw a zoom with the mouse in a plot, from a time to another."""
    bounds = page.evaluate(
        '(plot) => document.querySelector(`[data-plot="${plot}"] .plot`)._fullLayout.yaxis.range',
        plot,
    )
    middle = sum(bounds) / 2
    x, y = pixel_of(page, plot, begin, middle)
    to, _ = pixel_of(page, plot, end, middle)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(to, y, steps=5)
    page.mouse.up()
    settle(page)


def test_the_whole_of_a_long_run_holds_its_least_and_greatest_values(long_run):
    shown, rockers = long_run
    trace = shown.page.evaluate(TRACE, ['positions_rad', 'rocker_joint'])
    assert trace['rows'] > 1
    assert len(trace['x']) < 4000
    found = 0
    ends, extremes = np.reshape(trace['x'], (-1, 2)), np.reshape(trace['y'], (-1, 2))
    for (begin, end), told in zip(
        np.rint(ends * bags.LONG_RATE).astype(int), extremes, strict=True
    ):
        past = end + 1
        rows = rockers[begin:past]
        assert sorted(told) == [rows.min(), rows.max()]
        found += len(rows)
    assert found == bags.LONG_ROWS
    spiked = shown.page.evaluate(TRACE, ['rates_rad', 'rocker_joint'])
    assert max(spiked['y']) == bags.SPIKE


def test_a_zoom_shows_more_of_a_long_run_than_all_of_it_does(long_run):
    shown, _ = long_run
    page = shown.page
    name = ['positions_rad', 'rocker_joint']
    rows = [page.evaluate(TRACE, name)['rows']]
    for begin, end in ((10.0, 20.0), (12.0, 13.0)):
        drag(page, 'rates_rad', begin, end)
        trace = page.evaluate(TRACE, name)
        rows.append(trace['rows'])
        within = [x for x in trace['x'] if begin + 0.1 < x < end - 0.1]
        assert len(within) > 200
    assert rows[0] > rows[1] > rows[2]
    # The page says how many of the rows are one on it: no zoom can show more.
    notes = ' '.join(page.locator('.note').all_text_contents())
    assert rows[2] == int(re.search(r'intervals of (\d+)', notes)[1])
    page.evaluate('Report.zoom(null)')
    settle(page)
    assert page.evaluate(TRACE, name)['rows'] == rows[0]
    assert not shown.said


def test_angles_that_run_on_do_not_flatten_those_that_swing(long_run):
    shown, rockers = long_run
    low, high = shown.page.evaluate(
        "document.querySelector('[data-plot=positions_rad] .plot')._fullLayout.yaxis.range"
    )
    assert high - low < 1.5 * (rockers.max() - rockers.min())


def test_the_pointer_over_a_point_tells_its_time_and_its_value_with_units(drill):
    page = drill.page
    trace = page.evaluate(TRACE, ['rates_rad', 'crank_joint'])
    place = next(i for i, x in enumerate(trace['x']) if x is not None and x > 6.2)
    x, y = pixel_of(page, 'rates_rad', trace['x'][place], trace['y'][place])
    page.mouse.move(x, y)
    told = page.locator('.hovertext')
    told.wait_for()
    assert 'crank_joint' in told.text_content()
    assert f'{trace["x"][place]:.6f} s' in told.text_content()
    assert f'{trace["y"][place]:.9g} rad/s' in told.text_content()
    page.mouse.move(1, 1)


@pytest.mark.parametrize(
    ('plot', 'word'), [('crossed_0', ' rad'), ('spread_age', ('tick', ' ticks')), ('age', ' ms')]
)
def test_every_plot_tells_units(drill, plot, word):
    told = drill.page.evaluate(
        '(plot) => document.querySelector(`[data-plot="${plot}"] .plot`).data[0].text', plot
    )
    assert told
    assert all(text.endswith(word) for text in told if text and 'NaN' not in text)


def test_the_middle_of_a_span_tells_what_it_is(drill):
    heights = drill.page.evaluate(
        "document.querySelector('[data-plot=events] .plot').layout.yaxis.tickvals"
    )
    x, y = pixel_of(drill.page, 'events', 5.03, heights[2])
    drill.page.mouse.move(x, y)
    told = drill.page.locator('.hovertext')
    told.wait_for()
    assert 'no pose, by diagnostics' in told.text_content()
    assert '4.500000 s to 5.500000 s (1 s)' in told.text_content()
    drill.page.mouse.move(1, 1)


@pytest.mark.parametrize('y', [0.0, -2.0], ids=['between curves', 'below'])
def test_a_click_into_a_plot_goes_there(drill, y):
    page = drill.page
    x, y = pixel_of(page, 'rates_rad', 6.3, y)
    page.mouse.click(x, y)
    assert page.evaluate('Report.time') == pytest.approx(6.3, abs=0.05)
    for line in page.locator('.cursor').all():
        assert line.bounding_box()['x'] == pytest.approx(x, abs=5)
    assert float(page.locator('#scrub').input_value()) / 1e6 == pytest.approx(6.3 / 7.98, abs=0.01)
    assert not drill.said


def test_what_happened_stands_on_the_time_line(drill):
    lanes = drill.page.evaluate(
        """() => document.querySelector('[data-plot=events] .plot').data
          .filter((lane) => lane.name).map(({name, x, text}) => ({name, x, text}))"""
    )
    assert {lane['name'] for lane in lanes} == set(bags.DRILL_LANES)
    titles = drill.page.locator('[data-plot=events] .ytick text').all_text_contents()
    # A title of two lines has no space where it is broken.
    assert [title.replace(' ', '') for title in titles] == [
        lane['name'].replace(' ', '') for lane in lanes
    ]
    for lane in lanes:
        spans, span = [], []
        for x, text in zip(lane['x'], lane['text'], strict=True):
            if x is None:
                spans.append((span[0][0], span[-1][0], span[0][1]))
                span = []
            else:
                span.append((x, text))
        expected = bags.DRILL_LANES[lane['name']]
        assert len(spans) == len(expected), lane['name']
        for (begin, end, text), (wanted_begin, wanted_end, word) in zip(
            spans, expected, strict=True
        ):
            assert begin == pytest.approx(wanted_begin, abs=TICK)
            assert end == pytest.approx(wanted_end, abs=TICK)
            assert word in text


def test_a_joint_has_one_colour_in_all_plots_and_joints_have_their_own(drill):
    found = {}
    for plot in ('positions_rad', 'rates_rad', 'crossed_0'):
        for trace in drill.page.evaluate(
            '(plot) => document.querySelector(`[data-plot="${plot}"] .plot`).data', plot
        ):
            found.setdefault(trace['name'], set()).add(trace['marker']['color'])
    assert set(found) == {'crank_joint', 'coupler_joint', 'rocker_joint'}
    assert all(len(colours) == 1 for colours in found.values())
    assert len(set.union(*found.values())) == 3


def test_names_that_are_markup_stay_names(browser, folder, foreign_file):
    for file in (foreign_file, page_of(bags.named(folder / 'named'))):
        with opened(browser, file, width=400) as shown:
            page = shown.page
            page.mouse.move(200, 400)
            assert page.evaluate('window.hit') is None
            assert page.locator('img, b:not(.hovertext b)').count() == 0
            assert not shown.said
            assert len(shown.asked) == 1
            assert not shown.is_wider_than_its_window()
            assert bags.NAMES[1] in page.locator('body').inner_text()
            legend = page.locator('.legendtext').all_text_contents()
            assert any(text.startswith(r'$\sqrt{2}$ & <b>') for text in legend)
            assert all(count for _, count in page.evaluate(DRAWN))
            page.evaluate('Report.seek(1.0)')
            assert page.evaluate('window.hit') is None
            assert not shown.said


def test_a_bag_without_a_scene_has_plots_and_no_player(browser, foreign_file):
    with opened(browser, foreign_file) as shown:
        assert 'No scene of linkage_ros' in shown.page.locator('.warnings').inner_text()
        assert shown.page.locator('canvas, .controls').count() == 0
        assert [plot for plot, _ in shown.page.evaluate(DRAWN)] == ['positions', 'rates']
        drag(shown.page, 'rates', 0.5, 1.0)
        ranges = shown.page.evaluate(RANGES)
        assert ranges[0] == ranges[1] == pytest.approx([0.5, 1.0], abs=0.02)
        assert not shown.said


def test_a_bag_without_a_message_says_so(browser, folder):
    with opened(browser, page_of(bags.empty(folder / 'empty'))) as shown:
        text = shown.page.locator('body').inner_text()
        assert 'The bag holds no messages.' in text
        assert 'No joint states are in this bag.' in text
        assert shown.page.locator('canvas').count() == 0
        shown.page.keyboard.press(' ')
        for plot in shown.page.locator('.nsewdrag').all():
            plot.click(force=True)
        assert not shown.said
        assert not shown.is_wider_than_its_window()


def test_each_linkage_of_a_scene_has_its_picture(browser, folder):
    with opened(browser, page_of(bags.fingers(folder / 'fingers'))) as shown:
        page = shown.page
        assert page.locator('.pictures figcaption').all_inner_texts() == ['left', 'right']
        page.evaluate('Report.seek(1.0)')
        tips = page.evaluate("""() => Report.linkages.map(
          (linkage) => linkage.place('crank', 0.04, 0, Report.number))""")
        for tip, angle in zip(tips, (1.0, -2.0), strict=True):
            assert abs(complex(*tip) - rect(0.04, angle)) < FLOAT32
        assert all(painted[INPUT_FACE] > 100 for painted in page.evaluate(PAINTED))
        told = readout(page)
        assert told['left_crank_joint'].startswith('1.00000 rad')
        assert told['right_crank_joint'].startswith('-2.00000 rad')
        assert [plot for plot, _ in page.evaluate(DRAWN) if plot.startswith('crossed')] == [
            'crossed_0', 'crossed_1',
        ]  # fmt: skip
        assert not shown.said


@pytest.mark.parametrize('scheme', ['light', 'dark'])
def test_colours_that_the_system_forces_leave_pictures_and_plots(browser, drill_file, scheme):
    with opened(browser, drill_file, forced_colors='active', color_scheme=scheme) as shown:
        page = shown.page
        (painted,) = page.evaluate(PAINTED)
        assert painted[INPUT_FACE if scheme == 'light' else DARK_INPUT_FACE] > 100
        for place in ('canvas', '[data-plot=rates_rad] .main-svg'):
            ground = page.locator(place).first.evaluate(
                '(each) => getComputedStyle(each).backgroundColor'
            )
            # What is painted was chosen for the page's own paper.
            assert ground == ('rgb(255, 255, 255)' if scheme == 'light' else 'rgb(21, 25, 30)')
        page.locator('#onward').click()
        assert page.evaluate('Report.number') == 1
        for button in page.locator('.controls button').all():
            ink, ground = button.evaluate(
                '(each) => [getComputedStyle(each).color, getComputedStyle(each).backgroundColor]'
            )
            assert abs(brightness(ink) - brightness(ground)) > 100
        assert not shown.said


def test_a_foreign_font_does_not_break_it(browser, drill_file):
    with opened(browser, drill_file, width=400) as shown:
        page = shown.page
        page.add_style_tag(content='* { font: 22px/1.6 monospace !important; }')
        page.set_viewport_size({'width': 420, 'height': 900})
        settle(page)
        assert not shown.is_wider_than_its_window()
        assert all(count for _, count in page.evaluate(DRAWN))
        page.locator('#onward').click()
        assert page.evaluate('Report.number') == 1
        assert not shown.said


def test_a_plot_takes_the_width_that_its_window_gets(browser, drill_file):
    with opened(browser, drill_file) as shown:
        for width in (1600, 400, 1000):
            shown.page.set_viewport_size({'width': width, 'height': 900})
            shown.page.wait_for_function(
                """() => [...document.querySelectorAll('[data-plot]')].every((figure) =>
                  Math.abs(figure.clientWidth
                    - figure.querySelector('.main-svg').clientWidth) < 2)"""
            )
            assert not shown.is_wider_than_its_window()
            (painted,) = shown.page.evaluate(PAINTED)
            assert INPUT_FACE in painted
        assert not shown.said


def test_on_paper_all_is_light_and_fits(browser, drill_file):
    with opened(browser, drill_file, width=1600, color_scheme='dark') as shown:
        page = shown.page
        page.emulate_media(media='print', color_scheme='dark')
        settle(page)
        assert page.evaluate(COLOURS) == ['rgb(0, 0, 0)', 'rgb(255, 255, 255)']
        assert INPUT_FACE in page.evaluate(PAINTED)[0]
        widths = page.evaluate(
            "[...document.querySelectorAll('.main-svg, canvas')].map((each) => each.clientWidth)"
        )
        # What is left of a sheet of A4 between its margins.
        assert max(widths) <= 178 / 25.4 * 96
        assert not any(each.is_visible() for each in page.locator('.controls, #scheme').all())
        page.emulate_media(media='screen', color_scheme='dark')
        settle(page)
        assert DARK_INPUT_FACE in page.evaluate(PAINTED)[0]
        assert not shown.said


def test_a_finger_scrolls_the_page_and_does_not_zoom(browser, drill_file):
    with opened(browser, drill_file, width=400, has_touch=True, is_mobile=True) as shown:
        layout = 'document.querySelector("[data-plot=rates_rad] .plot").layout'
        assert shown.page.evaluate(f'{layout}.xaxis.fixedrange')
        assert shown.page.evaluate(f'{layout}.dragmode') is False
        assert not shown.is_wider_than_its_window()
        x, y = pixel_of(shown.page, 'rates_rad', 6.3, 0.0)
        shown.page.touchscreen.tap(x, y)
        shown.page.wait_for_function('() => Report.time > 6')
        assert not shown.said
