# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The page of a run in a browser: it fits, moves, zooms and tells what was recorded."""

from base64 import b64decode
from cmath import rect
from contextlib import contextmanager
from itertools import combinations, pairwise
from math import cos, pi, sin, sqrt
import random
import re
from threading import Event

from linkage_ros.description import load_scene
from linkage_ros.replay import simulate_run
from linkage_ros.tools.view import bag_page
from linkage_ros.tools.view.report import Window
import numpy as np
import pytest

from . import bags
from .runs import but, data_of, recorded as recorded_run
from ....browser.opened import opened

pytest.importorskip('plotly', reason='is within the page')

FLOAT32 = 2e-8
"""A link's place and angle are numbers of 32 bits: so much of it is seen in a pin, in [m]."""

TICK = 0.0101
DEGREE = pi / 180

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
    with quiet(browser, drill_file) as page:
        yield page


@pytest.fixture
def drill(read):
    """Give the page, at the beginning of the run and with all of it in its plots."""
    read.evaluate('Report.pause(); Report.zoom(null); Report.seek(0)')
    read.locator('#traces').check()
    read.evaluate('document.activeElement.blur(); scrollTo(0, 0)')
    settle(read)
    return read


@pytest.fixture(scope='module')
def long_run(browser, folder):
    bag, rockers = bags.long(folder / 'long')
    with quiet(browser, page_of(bag)) as page:
        yield page, rockers


@pytest.fixture(scope='module')
def foreign_file(folder):
    return page_of(bags.foreign(folder / 'foreign'))


@pytest.fixture(scope='module')
def turning_page(browser, folder):
    """Give the page of a crank that turns twice in 4 s."""
    with quiet(browser, page_of(bags.turning(folder / 'turning', 'continuous'))) as page:
        yield page


@pytest.fixture
def turning(turning_page):
    turning_page.evaluate('document.activeElement.blur(); Report.zoom(null)')
    turning_page.locator('#unit').select_option('rad')
    turning_page.locator('#range').select_option('continuous')
    settle(turning_page)
    return turning_page


@contextmanager
def quiet(browser, file, **options):
    """Open a page; at its end it has asked for nothing, said nothing, and fits its window."""
    with opened(browser, file, **options) as shown:
        yield shown.page
        assert not shown.said
        assert shown.asked == [file.as_uri()]
        assert not shown.is_wider_than_its_window()


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


def values(page, joint='crank_joint', plot='positions_rad'):
    """Return the values of a curve, without its interruptions."""
    told = page.evaluate(TRACE, [plot, joint])['y']
    return np.array([value for value in told if value is not None])


def longest_step(page):
    """Return the greatest step between neighbours of the crank's angles."""
    told = page.evaluate(TRACE, ['positions_rad', 'crank_joint'])['y']
    return max(abs(b - a) for a, b in pairwise(told) if a is not None and b is not None)


def data_in(plot):
    return f'document.querySelector("[data-plot={plot}] .plot").data'


def painted_faces(page):
    """Return whether the crank is painted in its light and in its dark colour."""
    (painted,) = page.evaluate(PAINTED)
    return [painted.get(face, 0) > 100 for face in (INPUT_FACE, DARK_INPUT_FACE)]


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


@pytest.fixture(scope='module')
def recorded(drill_file):
    """Give times and pins of all poses, as the page's data have them."""
    data = data_of(drill_file.read_text('utf-8'))
    (linkage,) = data['linkages']
    times = np.frombuffer(b64decode(data['frames']['times']), '<f8')
    poses = np.frombuffer(b64decode(linkage['poses']), '<f4').astype(float)
    x, y, angle = np.moveaxis(poses.reshape(len(times), -1, 3), 2, 0)
    links = [linkage['links'].index(link) for link in ('crank', 'coupler', 'rocker')]
    pins = (x + 1j * y)[:, links] + [bags.A, bags.B, bags.C] * np.exp(1j * angle[:, links])
    return times, pins


# It opens, fits, and has its colours.


@pytest.mark.parametrize(('width', 'scheme'), [(400, 'dark'), (1600, 'light')])
def test_page_opens_without_errors_requests_or_scroll_bars(browser, drill_file, width, scheme):
    with quiet(browser, drill_file, width=width, color_scheme=scheme) as page:
        assert page.title() == 'Run of drill & <b>bold</b>'
        assert page.evaluate(WIDER) == []
        ink, paper = map(brightness, page.evaluate(COLOURS))
        assert (paper > 220 and ink < 80) if scheme == 'light' else (paper < 60 and ink > 200)
        assert all(count for _, count in page.evaluate(DRAWN))
        assert painted_faces(page) == [scheme == 'light', scheme == 'dark']
        # At 400 pixels no word of the readout is broken, whatever it tells.
        for time in (0.0, 2.05, 5.1):
            page.evaluate('(time) => Report.seek(time)', time)
            assert page.evaluate(BROKEN) == []


def test_page_opens_at_the_first_pose(browser, folder):
    """A crank may come long after the run began: an empty picture would say nothing."""
    with quiet(browser, page_of(bags.drill(folder / 'late', begin=0.6))) as page:
        assert page.evaluate(PINS) is not None
        time = float(readout(page)['time'].removesuffix(' s'))
        assert time == pytest.approx(0.6, abs=0.05)


def test_page_follows_light_dark_and_print_colours(browser, drill_file):
    with quiet(browser, drill_file, width=1600, color_scheme='light') as page:

        def looks():
            settle(page)
            line = page.evaluate(TRACE, ['positions_rad', 'crank_joint'])['colour']
            return page.evaluate(COLOURS), line, painted_faces(page)

        light = looks()
        page.emulate_media(color_scheme='dark')
        dark = looks()
        assert light[2:] == ([True, False],)
        assert dark[2:] == ([False, True],)
        assert light[1] != dark[1]
        page.locator('#scheme').click()
        assert looks() == light
        page.keyboard.press('l')
        assert looks() == dark
        # What was chosen stays, whatever the system asks for.
        page.emulate_media(color_scheme='light')
        assert looks() == dark
        page.emulate_media(media='print', color_scheme='dark')
        colours, _, faces = looks()
        assert (colours, faces) == (['rgb(0, 0, 0)', 'rgb(255, 255, 255)'], [True, False])
        widths = page.evaluate(
            "[...document.querySelectorAll('.main-svg, canvas')].map((each) => each.clientWidth)"
        )
        # What is left of a sheet of A4 between its margins.
        assert max(widths) <= 178 / 25.4 * 96
        assert not any(each.is_visible() for each in page.locator('.controls, #scheme').all())
        page.emulate_media(media='screen', color_scheme='dark')
        assert looks() == dark


@pytest.mark.parametrize('scheme', ['light', 'dark'])
def test_forced_colours_leave_pictures_and_plots_unchanged(browser, drill_file, scheme):
    with quiet(browser, drill_file, forced_colors='active', color_scheme=scheme) as page:
        assert painted_faces(page) == [scheme == 'light', scheme == 'dark']
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


def test_page_fits_its_window_with_a_foreign_font(browser, drill_file):
    with quiet(browser, drill_file) as page:
        for width in (1600, 400, 1000):
            page.set_viewport_size({'width': width, 'height': 900})
            page.wait_for_function(
                """() => [...document.querySelectorAll('[data-plot]')].every((figure) =>
                  Math.abs(figure.clientWidth
                    - figure.querySelector('.main-svg').clientWidth) < 2)"""
            )
            assert page.evaluate(WIDER) == []
            assert any(painted_faces(page))
        page.add_style_tag(content='* { font: 22px/1.6 monospace !important; }')
        page.set_viewport_size({'width': 420, 'height': 900})
        settle(page)
        assert all(count for _, count in page.evaluate(DRAWN))
        page.locator('#onward').click()
        assert page.evaluate('Report.number') == 1


def test_touch_scrolls_the_page_without_zooming(browser, drill_file):
    with quiet(browser, drill_file, width=400, has_touch=True, is_mobile=True) as page:
        layout = 'document.querySelector("[data-plot=rates_rad] .plot").layout'
        assert page.evaluate(f'{layout}.xaxis.fixedrange')
        assert page.evaluate(f'{layout}.dragmode') is False
        x, y = pixel_of(page, 'rates_rad', 6.3, 0.0)
        page.touchscreen.tap(x, y)
        page.wait_for_function('() => Report.time > 6')


# It moves.


def test_time_slider_shows_the_recorded_pose(drill, recorded):
    times, pins = recorded
    end = drill.evaluate('Report.whole[1]')
    draws = random.Random(8)
    posed = 0
    for share in [0.0, 1.0, *(draws.random() for _ in range(60))]:
        time = scrub(drill, share)
        assert time == pytest.approx(share * end, abs=1e-6 * end)
        newest = np.searchsorted(times, time + 1e-9) - 1
        # Three periods without a joint state are a silence.
        following = times[newest + 1] if newest + 1 < len(times) else times[newest]
        silent = following - times[newest] > 0.03
        shown = drill.evaluate(PINS)
        if silent:
            assert shown is None
            continue
        posed += 1
        found = np.array(shown) @ [1, 1j]
        assert np.abs(found - pins[newest]).max() < FLOAT32
    assert posed > 30
    # A sensor that is wrong is seen as such.
    scrub(drill, 0.99)
    newest = np.searchsorted(times, drill.evaluate('Report.time') + 1e-9) - 1
    apart = abs(pins[newest][1] - pins[newest][2])
    assert apart > 1e-3
    assert readout(drill)['links come apart by'] == f'{1e3 * apart:.2f} mm'


def test_picture_is_painted_at_the_pose(drill, recorded):
    times, pins = recorded
    drill.locator('#traces').uncheck()

    def colour_at(place):
        return drill.evaluate(COLOUR_AT, [place.real, place.imag])

    middles = {}
    for time in (0.5, 1.65):
        drill.evaluate('(time) => Report.seek(time)', time)
        newest = np.searchsorted(times, time + 1e-9) - 1
        middles[time] = pins[newest][0] / 2
        for pin_a, pin_b, face in ((0, pins[newest][0], INPUT_FACE),
                                   (bags.D, pins[newest][2], LINK_FACE)):  # fmt: skip
            middle = (pin_a + pin_b) / 2
            assert colour_at(middle) == face
    assert abs(middles[0.5] - middles[1.65]) > 0.01
    # Where the crank was before, there is paper.
    assert colour_at(middles[0.5]) == ''
    drill.locator('#traces').check()


@pytest.mark.parametrize('time', [1.25, 3.4, 5.1])
def test_picture_without_a_recorded_pose_names_the_gap(drill, time):
    assert INPUT_FACE in drill.evaluate(PAINTED)[0]
    drill.evaluate('(time) => Report.seek(time)', time)
    (painted,) = drill.evaluate(PAINTED)
    assert INPUT_FACE not in painted
    assert LINK_FACE not in painted
    told = readout(drill)
    assert told['pose'] == 'none recorded here'
    assert 'gap in joint states' in told['going on']
    assert 'rocker_joint' not in told


PRESS = """
links: {{ground: {{O: [0, 0]}},
  crank: {{O: [0, 0], A: [{r}, 0]}}, rod: {{A: [0, 0], B: [{l}, 0]}}}}
sliders: {{press: {{point: B, along: ground, through: O, direction: [1, 0]}}}}
assembly: {{press: ahead}}
input: {{joint: crank_joint, parent: ground, child: crank}}
joints: {{press_slide: {{slider: press}}}}
"""
PRESS_SCENE = """
rate: 100
drive: {{sine: {{amplitude: {amplitude}, frequency: 1}}}}
effects: {{velocity: {{}}}}
publish_input: true
"""


@pytest.mark.parametrize(('unit', 'one'), [('m', 1.0), ('mm', 1e3), ('in', 1 / 0.0254)])
@pytest.mark.parametrize('degrees', [True, False])
def test_page_has_the_units_of_its_file(browser, tmp_path, unit, one, degrees):
    """The slide of a press in line is r·cos + √(l² − r²·sin²), and at most r + l."""
    head = f'units: {unit}\nangles: {"degrees" if degrees else "radians"}\n'
    of_angle = 180.0 / pi if degrees else 1.0
    linkage = head + PRESS.format(r=0.04 * one, l=0.125 * one)
    scene = bags.scene_file(tmp_path, head + PRESS_SCENE.format(amplitude=0.5 * of_angle), linkage)
    simulate_run(load_scene(scene), tmp_path / 'bag', 101, lambda _: True)
    file = page_of(tmp_path / 'bag')
    with quiet(browser, file) as page:
        page.evaluate('Report.pause(); Report.seek(0.25)')
        settle(page)
        number, shown = readout(page)['press_slide'].split()[:2]
        slide = 0.04 * cos(0.5) + sqrt(0.125**2 - (0.04 * sin(0.5)) ** 2)
        assert (float(number), shown) == (pytest.approx(slide * one, rel=1e-5), unit)
        captions = page.locator('[data-plot] figcaption').all_text_contents()
        angle = '°' if degrees else 'rad'
        assert {f'Angles [{angle}]', f'Slides [{unit}]', f'Rates of angles [{angle}/s]'} < {
            *captions
        }
        assert f'Rates of slides [{unit}/s]' in captions
        rows = [row.split('\t') for row in page.locator('.tables tr').all_inner_texts()]
        (found,) = [row for row in rows if row[:2] == ['press_slide', 'position']]
        assert (float(found[3]), found[4]) == (pytest.approx(0.165 * one, rel=1e-8), unit)


def test_readout_prints_values_with_units_and_events(drill):
    told = readout(drill)
    assert told['time'] == '0.000000 s'
    coupler, rocker = bags.follow(bags.A, bags.B, bags.C, bags.D, 0.9 * pi * 0.003)
    for joint, value in (('coupler_joint', coupler), ('rocker_joint', rocker)):
        number, unit, degrees = told[joint].split()
        assert float(number) == pytest.approx(value, rel=1e-5)
        assert unit == 'rad'
        assert float(degrees.strip('(°)')) == pytest.approx(value * 180 / pi, abs=0.0051)
    assert 'going on' not in told
    drill.evaluate('Report.seek(2.05)')
    assert 'samples rejected: position or rate not finite' in readout(drill)['going on']


def test_playback_keeps_its_speed_and_stops_at_the_end(browser, drill_file):
    with quiet(browser, drill_file) as page:
        page.clock.install(time=0)
        page.clock.pause_at(1000)
        for speed in ('1', '0.25', '2'):
            page.evaluate('Report.pause(); Report.seek(0.5)')
            before = page.evaluate(PINS)
            page.locator('#speed').select_option(speed)
            page.locator('#play').click()
            page.clock.run_for(1000)
            # It goes on picture by picture, of which there are 60 a second.
            passed = page.evaluate('Report.time') - 0.5
            assert passed == pytest.approx(float(speed), abs=0.02 * float(speed))
            assert page.evaluate(PINS) != before
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


def test_buttons_and_keys_step_between_pictures(drill, recorded):
    times, _ = recorded
    numbers = []
    for act in (
        lambda: drill.locator('#onward').click(),
        lambda: drill.keyboard.press('ArrowRight'),
        lambda: drill.locator('#scrub').press('ArrowRight'),
        lambda: drill.locator('#back').click(),
        lambda: drill.keyboard.press('ArrowLeft'),
    ):
        act()
        number = drill.evaluate('Report.number')
        assert drill.evaluate('Report.time') == pytest.approx(times[number], abs=1e-9)
        numbers.append(number)
    assert numbers == [1, 2, 3, 2, 1]
    for _ in range(3):
        drill.locator('#back').click()
    assert drill.evaluate('Report.number') == 0


def test_space_key_plays_and_pauses_outside_of_controls(drill):
    drill.keyboard.press(' ')
    assert drill.evaluate('Report.playing')
    drill.keyboard.press(' ')
    assert not drill.evaluate('Report.playing')
    drill.locator('summary').press(' ')
    assert drill.locator('details').get_attribute('open') is not None
    assert not drill.evaluate('Report.playing')
    drill.locator('summary').press(' ')
    drill.locator('#traces').press(' ')
    assert not drill.evaluate('Report.playing')
    assert not drill.locator('#traces').is_checked()
    drill.locator('#traces').check()
    before = drill.evaluate('Report.number')
    drill.keyboard.press('Control+ArrowRight')
    assert drill.evaluate('Report.number') == before


def test_each_linkage_of_a_scene_has_its_picture(browser, folder):
    with quiet(browser, page_of(bags.fingers(folder / 'fingers'))) as page:
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


# Its plots.


def test_zoom_applies_to_all_plots_until_a_double_click(drill):
    whole = drill.evaluate('Report.whole')
    assert drill.evaluate(RANGES) == [whole] * 5
    drag(drill, 'rates_rad', 2.0, 4.0)
    ranges = drill.evaluate(RANGES)
    assert ranges == [ranges[0]] * 5
    assert ranges[0] == pytest.approx([2.0, 4.0], abs=0.05)
    # The bar is for all of the run, whatever is shown of it.
    assert scrub(drill, 1.0) == whole[1]
    lanes = drill.evaluate("document.querySelector('[data-plot=events] .plot').data")
    shown = [x for lane in lanes for x in lane['x'] if x is not None]
    assert shown
    assert all(whole[0] <= x <= whole[1] for x in shown)
    x, y = pixel_of(drill, 'age', 3.0, 100.0)
    drill.mouse.dblclick(x, y)
    settle(drill)
    assert drill.evaluate(RANGES) == [whole] * 5
    assert drill.evaluate('Report.whole') == whole


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


def test_zoom_refines_the_curves_of_a_long_run(long_run):
    page, rockers = long_run
    name = ['positions_rad', 'rocker_joint']
    trace = page.evaluate(TRACE, name)
    rows = [trace['rows']]
    # All of it has its least and greatest values, and those that run on do not flatten them.
    assert len(trace['x']) < 4000
    ends, extremes = np.reshape(trace['x'], (-1, 2)), np.reshape(trace['y'], (-1, 2))
    numbers = np.rint(ends * bags.LONG_RATE).astype(int)
    assert (numbers[0, 0], numbers[-1, 1]) == (0, bags.LONG_ROWS - 1)
    assert (numbers[1:, 0] == numbers[:-1, 1] + 1).all()
    for (begin, end), told in zip(numbers.tolist(), extremes, strict=True):
        own = rockers[slice(begin, end + 1)]
        assert sorted(told) == [own.min(), own.max()]
    assert max(values(page, 'rocker_joint', 'rates_rad')) == bags.SPIKE
    low, high = page.evaluate(
        "document.querySelector('[data-plot=positions_rad] .plot')._fullLayout.yaxis.range"
    )
    assert high - low < 1.5 * (rockers.max() - rockers.min())
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
    # Each of the 19 jumps leaves the plot at its upper edge, and comes back at its lower one.
    page.keyboard.press('w')
    settle(page)
    wrapped = values(page)
    assert (np.abs(wrapped) == pi).sum() <= 2 * 19
    assert np.abs(wrapped).max() <= pi
    assert longest_step(page) < 0.5


def test_pointer_shows_values_of_points_and_spans(drill):
    trace = drill.evaluate(TRACE, ['rates_rad', 'crank_joint'])
    place = next(i for i, x in enumerate(trace['x']) if x is not None and x > 6.2)
    time, value = trace['x'][place], trace['y'][place]
    height = drill.evaluate(
        "document.querySelector('[data-plot=events] .plot').layout.yaxis.tickvals[2]"
    )
    for plot, at, told in (
        ('rates_rad', (time, value), ('crank_joint', f'{time:.6f} s', f'{value:.9g} rad/s')),
        ('events', (5.03, height), ('no pose, by diagnostics', '4.500000 s to 5.500000 s (1 s)')),
    ):
        drill.mouse.move(*pixel_of(drill, plot, *at))
        text = drill.locator('.hovertext')
        text.wait_for()
        assert all(word in text.text_content() for word in told)
        drill.mouse.move(1, 1)
        text.wait_for(state='detached')
    for plot, unit in (('crossed_0', ' rad'), ('spread_age', ('tick', ' ticks')), ('age', ' ms')):
        texts = [text for text in drill.evaluate(f'{data_in(plot)}[0].text') if text]
        assert texts
        assert all(text.endswith(unit) for text in texts if 'NaN' not in text)


@pytest.mark.parametrize('y', [0.0, -2.0], ids=['between curves', 'below'])
def test_click_in_a_plot_sets_the_time(drill, y):
    x, y = pixel_of(drill, 'rates_rad', 6.3, y)
    drill.mouse.click(x, y)
    assert drill.evaluate('Report.time') == pytest.approx(6.3, abs=0.05)
    for line in drill.locator('.cursor').all():
        assert line.bounding_box()['x'] == pytest.approx(x, abs=5)
    share = float(drill.locator('#scrub').input_value()) / 1e6
    assert share == pytest.approx(6.3 / 7.98, abs=0.01)


def test_event_plot_shows_every_event_of_the_run(drill, drill_file):
    lanes = {lane['title']: lane['spans'] for lane in data_of(drill_file.read_text())['lanes']}
    assert set(lanes) == set(bags.DRILL_LANES)
    for title, expected in bags.DRILL_LANES.items():
        assert len(lanes[title]) == len(expected), title
        for (begin, end, _, text), wanted in zip(lanes[title], expected, strict=True):
            assert (begin, end) == pytest.approx(wanted[:2], abs=TICK)
            assert wanted[2] in text
    drawn = drill.evaluate(
        f'{data_in("events")}.filter((lane) => lane.name).map(({{name, x}}) => [name, x])'
    )
    for title, times in drawn:
        spans = lanes.pop(title)
        assert times.count(None) == len(spans)
        assert {x for x in times if x is not None} >= {x for span in spans for x in span[:2]}
    assert not lanes
    titles = drill.locator('[data-plot=events] .ytick text').all_text_contents()
    # A title of two lines has no space where it is broken.
    assert [title.replace(' ', '') for title in titles] == [
        title.replace(' ', '') for title, _ in drawn
    ]


def test_each_joint_has_one_colour_in_all_plots(drill):
    found = {}
    for plot in ('positions_rad', 'rates_rad', 'crossed_0'):
        for trace in drill.evaluate(data_in(plot)):
            found.setdefault(trace['name'], set()).add(trace['marker']['color'])
    assert set(found) == {'crank_joint', 'coupler_joint', 'rocker_joint'}
    assert all(len(colours) == 1 for colours in found.values())
    assert len(set.union(*found.values())) == 3


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
    return names, page_of(recorded_run(place, f'faults: {{{faults}}}\n', moments).path)


@pytest.mark.parametrize('width', [400, 1600])
def test_fault_names_do_not_overlap_and_tables_scroll(browser, faulty_file, width):
    names, file = faulty_file
    with quiet(browser, file, width=width) as page:
        told = page.locator('[data-plot=events] .annotation-text').all_text_contents()
        assert sorted(told) == sorted(names)
        boxes = page.evaluate(BOXES, '.annotation-text')
        rows = page.evaluate(BOXES, '.ytick text')
        ((left, _, right, _),) = page.evaluate(BOXES, '.nsewdrag')
        assert all(left <= box[0] and box[2] <= right + 1 for box in boxes)
        # The names of rows have a gutter of their own, left of the bars and the time.
        assert all(box[2] <= left for box in rows)
        assert all(box[0] >= 0 for box in rows)
        for one, other in combinations([*boxes, *rows], 2):
            apart = one[2] <= other[0] or other[2] <= one[0]
            assert apart or one[3] <= other[1] + 2 or other[3] <= one[1] + 2
        assert page.evaluate(WIDER) == []
        topics = page.locator('figure:has(figcaption:text-is("Topics")) .scroll')
        inner, outer = topics.evaluate('(each) => [each.scrollWidth, each.clientWidth]')
        if width == 400:
            assert inner > outer
            topics.focus()
            page.keyboard.press('ArrowRight')
            page.wait_for_function(
                '() => [...document.querySelectorAll(".scroll")].some((each) => each.scrollLeft)'
            )


# Its switches and keys.


def test_degrees_switch_changes_titles_values_and_readout(turning):
    radians = {key: values(turning, plot=key) for key in ('positions_rad', 'rates_rad')}
    assert turning.evaluate(PLOT, 'rates_rad') == {
        'caption': 'Rates of angles [rad/s]', 'axis': '[rad/s]'
    }  # fmt: skip
    turning.evaluate('Report.seek(2.5)')
    assert readout(turning)['crank_joint'] == '7.85398 rad (1 turn + 90.00°)'
    turning.locator('#unit').select_option('degrees')
    settle(turning)
    assert turning.evaluate(PLOT, 'positions_rad') == {'caption': 'Angles [°]', 'axis': '[°]'}
    assert turning.evaluate(PLOT, 'rates_rad') == {
        'caption': 'Rates of angles [°/s]', 'axis': '[°/s]'
    }  # fmt: skip
    for key, before in radians.items():
        assert values(turning, plot=key) == pytest.approx(before / DEGREE)
    assert readout(turning)['crank_joint'] == '450.000° (1 turn + 90.00°)'
    over = "document.querySelector('[data-plot=crossed_0] .plot').layout"
    assert turning.evaluate(f'{over}.xaxis.range') == [0, 360]
    assert turning.evaluate(f'{over}.yaxis.title.text') == '[°]'
    turning.locator('#unit').select_option('rad')
    settle(turning)
    assert (values(turning) == radians['positions_rad']).all()


def test_wrapped_curves_break_at_half_a_turn(turning):
    continuous = values(turning)
    assert np.ptp(continuous) == pytest.approx(4 * pi)
    turning.locator('#range').select_option('wrapped')
    settle(turning)
    wrapped = values(turning)
    assert np.exp(1j * wrapped) == pytest.approx(np.exp(1j * continuous))
    assert np.abs(wrapped).max() <= pi
    assert longest_step(turning) < 0.1
    turning.evaluate('Report.seek(2.5)')
    assert readout(turning)['crank_joint'] == '1.57080 rad (90.00°)'


def test_recorded_wrapped_angles_are_shown_wrapped_first(browser, folder):
    with quiet(browser, page_of(bags.turning(folder / 'wrapped', 'wrapped'))) as page:
        assert page.locator('#range').input_value() == 'wrapped'
        assert np.abs(values(page)).max() <= pi
        page.locator('#range').select_option('continuous')
        settle(page)
        expected = 0.01 * pi * np.arange(401)
        assert values(page) == pytest.approx(expected, abs=1e-12)


def test_keyboard_reaches_and_works_every_control(turning):
    reached = set()
    for _ in range(20):
        turning.keyboard.press('Tab')
        reached.add(turning.evaluate('document.activeElement.id'))
    controls = 'scheme play back onward scrub speed traces unit range'
    assert {*controls.split()} <= reached
    turning.evaluate('document.activeElement.blur()')
    turning.keyboard.press('End')
    assert turning.evaluate('Report.time === Report.whole[1]')
    turning.keyboard.press('Home')
    assert turning.evaluate('Report.time') == 0
    turning.evaluate('Report.seek(2)')
    turning.keyboard.press('+')
    assert turning.evaluate('Report.view') == pytest.approx([2 - 2 / 1.5, 2 + 2 / 1.5])
    turning.keyboard.press('-')
    assert turning.evaluate('Report.view') == pytest.approx([0, 4])
    turning.keyboard.press('+')
    turning.keyboard.press('0')
    assert turning.evaluate('Report.view') == [0, 4]
    turning.keyboard.press('d')
    turning.keyboard.press('w')
    assert turning.locator('#unit').input_value() == 'degrees'
    assert turning.locator('#range').input_value() == 'wrapped'
    # In a list, a letter chooses among its items.
    turning.locator('#speed').press('d')
    assert turning.locator('#unit').input_value() == 'degrees'


# For each plot with a legend whether the buttons in its corner, or the curves, hide any of it.
HIDDEN_LEGENDS = """() => [...document.querySelectorAll('[data-plot]')]
  .filter((plot) => plot.querySelector('.legend'))
  .map((plot) => {
    const box = (selector) => plot.querySelector(selector).getBoundingClientRect();
    const legend = box('.legend');
    return ['.modebar', '.nsewdrag'].map(box).some((other) =>
      other.left < legend.right && legend.left < other.right
      && other.top < legend.bottom - 1 && legend.top < other.bottom - 1);
  })"""


@pytest.mark.sample(2)
@pytest.mark.parametrize('width', [400, 700, 1000])
@pytest.mark.parametrize('name', ['n{}', 'cylinder_number_{}'])
def test_buttons_hide_no_legend(browser, tmp_path, name, width):
    linkages = [f'{{name: {name.format(k)}, linkage: slider_crank}}' for k in range(9)]
    scene = tmp_path / 'nine.yaml'
    scene.write_text(
        f'linkages: [{", ".join(linkages)}]\nrate: 50\ndrive: {{constant_rate: {{rate: 3}}}}\n'
        'effects: {velocity: {}}\n'
    )
    simulate_run(load_scene(scene), tmp_path / 'bag', 100, lambda _: True)
    with quiet(browser, page_of(tmp_path / 'bag'), width=width) as page:
        hidden = page.evaluate(HIDDEN_LEGENDS)
        assert len(hidden) > 3
        assert not any(hidden)


# Bags of others.


def test_html_in_names_is_shown_as_text(browser, folder, foreign_file):
    for file in (foreign_file, page_of(bags.named(folder / 'named'))):
        with quiet(browser, file, width=400) as page:
            page.mouse.move(200, 400)
            assert page.evaluate('window.hit') is None
            assert page.locator('img, b:not(.hovertext b)').count() == 0
            assert bags.NAMES[1] in page.locator('body').inner_text()
            legend = page.locator('.legendtext').all_text_contents()
            assert any(text.startswith(r'$\sqrt{2}$ & <b>') for text in legend)
            assert all(count for _, count in page.evaluate(DRAWN))
            page.evaluate('Report.seek(1.0)')
            assert page.evaluate('window.hit') is None


def test_page_without_a_scene_has_plots_and_no_player(browser, foreign_file):
    with quiet(browser, foreign_file) as page:
        assert 'No scene of linkage_ros' in page.locator('.warnings').inner_text()
        assert page.locator('canvas, .controls').count() == 0
        assert [plot for plot, _ in page.evaluate(DRAWN)] == ['positions', 'rates']
        drag(page, 'rates', 0.5, 1.0)
        ranges = page.evaluate(RANGES)
        assert ranges[0] == ranges[1] == pytest.approx([0.5, 1.0], abs=0.02)


def test_page_of_an_empty_bag_names_the_missing_messages(browser, folder):
    with quiet(browser, page_of(bags.empty(folder / 'empty'))) as page:
        text = page.locator('body').inner_text()
        assert 'The bag holds no messages.' in text
        assert 'No joint states are in this bag.' in text
        assert page.locator('canvas').count() == 0
        page.keyboard.press(' ')
        for plot in page.locator('.nsewdrag').all():
            plot.click(force=True)
