# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The page in a browser: what the hand does, compared with the closure; what goes wrong, said."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import linkage_ros as lr
from linkage_ros.description import load, parse_yaml, read_closure
from linkage_ros.kinematics import Closure
from linkage_ros.resources import linkage_names, shipped_path
from linkage_ros.tools.view import build_model, Conversation, page_html as page_of, UserFile
import pytest

from .conftest import pixel_of, READY
from .served import Served, served
from ...browser.opened import opened

NEAR = 1e-12
FOUR_BAR = shipped_path('linkages/four_bar.yaml').read_text('utf-8')
QUIET = "() => typeof View !== 'undefined' && !View.state().busy && View.state().there"


@contextmanager
def edited(browser: Any, folder: Path, **settings: Any) -> Iterator[tuple[Any, Path, Served]]:
    """Open the page of a file of the user's, with its server."""
    file = folder / 'mine.yaml'
    file.write_text(FOUR_BAR, 'utf-8')
    user = UserFile(file)

    def page() -> str:
        return page_of(build_model(file.read_text('utf-8'), 'mine'), mode='edit', can_save=True)

    with served([Conversation('mine', None, user).add_routes], page) as server:
        shown = browser.new_page(**settings)
        said: list[str] = []
        shown.on('console', lambda one: said.append(one.text) if one.type == 'error' else None)
        shown.on('pageerror', lambda one: said.append(str(one)))
        shown.goto(server.address)
        shown.wait_for_function(QUIET)
        try:
            yield shown, file, server
            assert said == []
        finally:
            shown.close()


def state(page: Any) -> dict[str, Any]:
    found: dict[str, Any] = page.evaluate('() => View.state()')
    return found


def closure_of(text: str) -> Closure:
    return read_closure(parse_yaml(text.encode(), 'page'))


def drag(page: Any, pin: str, across: float, down: float) -> None:
    """Drag a pin by so many pixels, in steps as a hand does."""
    text = state(page)['text']
    x, y = pixel_of(page, pin)
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(1, 6):
        page.mouse.move(x + across * step / 5, y + down * step / 5)
        page.wait_for_timeout(30)
    page.mouse.up()
    page.wait_for_function(QUIET)
    page.wait_for_function('text => View.state().text !== text', arg=text)


def agrees(page: Any) -> None:
    """Check that all joints of the page are those of the closure, for the text of the page."""
    shown = state(page)
    position = closure_of(shown['text']).position(*shown['inputs'])
    assert shown['joints'] == pytest.approx(position.joints, abs=NEAR)


# Without a server.


@pytest.mark.sample(1)
@pytest.mark.parametrize('name', linkage_names())
def test_page_shows_every_shipped_linkage_at_its_pose(
    browser: Any, stills: Callable[[str], Path], name: str
) -> None:
    with opened(browser, stills(name)) as shown:
        page = shown.page
        page.wait_for_function(READY)
        assert shown.said == []
        found = state(page)
        assert found['closed']
        position = load(name).position(*found['inputs'])
        near = NEAR if found['model']['program'] else 1e-9
        assert found['joints'] == pytest.approx(position.joints, abs=near)


@pytest.mark.parametrize(('width', 'scheme'), [(400, 'dark'), (1600, 'light')])
def test_the_page_fits_its_window(
    browser: Any, stills: Callable[[str], Path], width: int, scheme: str
) -> None:
    with opened(browser, stills('jansen_leg'), width=width, color_scheme=scheme) as shown:
        assert shown.said == []
        assert not shown.is_wider_than_its_window()


def test_keyboard_turns_the_crank_and_plays(browser: Any, stills: Callable[[str], Path]) -> None:
    with opened(browser, stills('four_bar')) as shown:
        page = shown.page
        page.focus('#drawing')
        before = state(page)['inputs'][0]
        page.keyboard.press('ArrowRight')
        after = state(page)
        assert after['inputs'][0] == pytest.approx(before + 6.283185307179586 / 360)
        joints = load('four_bar').position(*after['inputs']).joints
        assert after['joints'] == pytest.approx(joints, abs=NEAR)
        page.keyboard.press(' ')
        page.wait_for_function(f'() => View.state().inputs[0] > {after["inputs"][0] + 0.1}')
        page.keyboard.press(' ')


def test_touch_turns_the_crank(browser: Any, stills: Callable[[str], Path]) -> None:
    context = browser.new_context(has_touch=True, viewport={'width': 400, 'height': 900})
    page = context.new_page()
    page.goto(stills('four_bar').as_uri())
    page.wait_for_function(READY)
    before = state(page)['inputs'][0]
    x, y = pixel_of(page, 'A')
    a, b = pixel_of(page, 'O2')
    wire = context.new_cdp_session(page)
    for kind, at in (
        ('touchStart', [(x, y)]),
        ('touchMove', [(a, b - 60)]),
        ('touchEnd', []),
    ):
        points = [{'x': px, 'y': py} for px, py in at]
        wire.send('Input.dispatchTouchEvent', {'type': kind, 'touchPoints': points})
    page.wait_for_function(f'() => View.state().inputs[0] !== {before}')
    # The finger is straight above the pivot.
    assert state(page)['inputs'][0] == pytest.approx(1.5707963, abs=1e-6)
    context.close()


def test_curves_are_continuous_and_end_before_a_toggle(
    browser: Any, stills: Callable[[str], Path]
) -> None:
    with opened(browser, stills('five_bar')) as shown:
        # Its elbows leap by whole turns in what is published: the pose is the same.
        for curve in shown.page.evaluate(
            "() => document.querySelector('[data-key=joints] .plot').data.map((each) => each.y)"
        ):
            known = [value for value in curve if value is not None]
            steps = [abs(b - a) for a, b in pairwise(known)]
            assert max(steps) < 90.0
    with opened(browser, stills('elliptic_trammel')) as shown:
        top, most = shown.page.evaluate("""() => {
            const plot = document.querySelector('[data-key=accelerations] .plot');
            const values = plot.data[0].y.filter((value) => value !== null);
            return [plot.layout.yaxis.range[1], Math.max(...values)];
        }""")
        assert 0.0 < top < most / 10


SLIDER_CRANK_IN_MM = """\
units: mm
links:
  ground: {O: [0, 0], G: [200, 0]}
  crank: {O: [0, 0], A: [40, 0]}
  rod: {A: [0, 0], B: [120, 0], P: [60, 30]}
sliders:
  cylinder: {point: B, along: ground, through: G, direction: [1, 0]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {cylinder: ahead}
joints:
  rod_joint: {parent: crank, child: rod}
  piston_slide: {slider: cylinder}
traced: [P]
"""
READOUT = """() => [...document.querySelectorAll('#readout div')].map((row) =>
  [row.querySelector('dt').textContent, row.querySelector('dd').textContent])"""
CURVES = """key => document.querySelector(`[data-key=${key}] .plot`).data.map(
  ({ x, y, line }) => ({ x, y, line }))"""


def test_rate_field_sets_the_plotted_rates(browser: Any, stills: Callable[[str], Path]) -> None:
    with opened(browser, stills('four_bar')) as shown:
        page = shown.page
        page.select_option('#angles', 'radians')
        page.fill('#rate', '-2.5')
        page.press('#rate', 'Enter')
        closure = load('four_bar')

        def differences() -> Iterator[float]:
            for key in ('rates', 'accelerations'):
                curves = page.evaluate(CURVES, key)
                for number in (0, 100, 250):
                    position = closure.position(curves[0]['x'][number])
                    found = velocity = closure.velocity(position, -2.5)
                    if key == 'accelerations':
                        found = closure.acceleration(position, velocity, 0.0)
                    for curve, joint in zip(curves, found.joints, strict=True):
                        yield abs(curve['y'][number] - joint)

        for _ in range(100):  # Curves that were drawn just now are drawn again a little later.
            if max(differences()) < 1e-9:
                break
            page.wait_for_timeout(100)
        assert max(differences()) < 1e-9


def test_page_prints_lengths_in_the_unit_of_the_file(browser: Any, tmp_path: Path) -> None:
    file = tmp_path / 'mm.html'
    file.write_text(page_of(build_model(SLIDER_CRANK_IN_MM, 'mm'), mode='still'), 'utf-8')
    closure = closure_of(SLIDER_CRANK_IN_MM)
    with opened(browser, file) as shown:
        told = dict(shown.page.evaluate(READOUT))
        (angle,) = state(shown.page)['inputs']
        position = closure.position(angle)
        slide, unit = told['piston_slide'].split()
        assert unit == 'mm'
        assert float(slide) == pytest.approx(1e3 * position['piston_slide'], rel=1e-5)
        x, y, unit = told['P'].replace(',', '').split()
        assert unit == 'mm'
        place = 1e3 * position.points['P']
        assert complex(float(x), float(y)) == pytest.approx(place, abs=0.02)


def test_four_bar_page_shows_curves_assemblies_and_instant_centres(
    browser: Any, stills: Callable[[str], Path]
) -> None:
    with opened(browser, stills('four_bar')) as shown:
        page = shown.page
        # Plotly leaves out points that seem to lie on a line: a smooth curve has corners then.
        for key in ('joints', 'rates', 'accelerations'):
            assert not any(each['line']['simplify'] for each in page.evaluate(CURVES, key))
        for value, unit, text in (
            (-6.6e-16, 'rad', '0.00000°'), (2e-13, 'm', '0.00000 m'), (1e-9, 'm', '1.00000e-9 m'),
        ):  # fmt: skip
            assert page.evaluate('([v, u]) => Angles.readout(v, u)', [value, unit]) == text
        assert page.evaluate('() => View.board.ghosts.length') == 1
        # Of the rocker it is its pivot; of the coupler where crank and rocker meet (Kennedy).
        centre = page.evaluate("() => View.linkage.centre('rocker')")
        assert centre == pytest.approx([0.1, 0.0], abs=1e-9)
        places = page.evaluate(
            '() => Object.fromEntries(View.linkage.pins().map((p) => [p.name, p.place]))'
        )
        o2, a, o4, b = (complex(*places[name]) for name in ('O2', 'A', 'O4', 'B'))
        u, w, d = a - o2, b - o4, o4 - o2
        meets = o2 + u * (d.real * w.imag - d.imag * w.real) / (u.real * w.imag - u.imag * w.real)
        x, y = page.evaluate("() => View.linkage.centre('coupler')")
        assert complex(x, y) == pytest.approx(meets, abs=1e-9)
        page.check('#centres')
        assert shown.said == []


# With a server.


def test_dragged_pin_is_undone_to_the_last_bit(browser: Any, tmp_path: Path) -> None:
    with edited(browser, tmp_path) as (page, _, _):
        first = state(page)
        drag(page, 'B', 40, -30)
        agrees(page)
        one = state(page)
        assert one['text'] != first['text']
        drag(page, 'A', 15, 10)
        agrees(page)
        assert state(page)['inputs'] != one['inputs']  # the crank has turned with its pin
        for wanted in (one, first):
            page.click('#undo')
            page.wait_for_function('text => View.state().text === text', arg=wanted['text'])
            page.wait_for_function(QUIET)
            found = state(page)
            for key in ('inputs', 'joints', 'rates', 'accelerations', 'frames'):
                assert found[key] == wanted[key]
        page.keyboard.press('Control+y')
        page.wait_for_function('text => View.state().text === text', arg=one['text'])
        assert state(page)['joints'] == one['joints']


def test_open_length_is_reported_at_its_pin(browser: Any, tmp_path: Path) -> None:
    with edited(browser, tmp_path) as (page, _, _):
        before = state(page)
        field = page.get_by_label('length coupler A–B')
        field.fill('1.3')
        field.press('Enter')
        page.wait_for_function('() => View.state().wrong')
        assert state(page)['wrong']['pin'] == 'B'
        assert 'the loops close at no value of the input' in page.inner_text('#wrong')
        assert state(page)['text'] == before['text']
        for number in ('0.13', '0.131'):
            field.fill(number)
            page.keyboard.press('Enter')
            page.wait_for_function(f"() => View.state().text.includes('B: [{number}, 0]')")
            page.wait_for_function(QUIET)  # also after all checks have come
            assert state(page)['wrong'] is None
            agrees(page)
            # A number that is taken leaves the focus where it is.
            focused = page.evaluate('() => document.activeElement.ariaLabel')
            assert (focused, field.input_value()) == ('length coupler A–B', number)
        page.click('#undo')
        page.wait_for_function("() => View.state().text.includes('B: [0.13, 0]')")
        page.wait_for_function(QUIET)
        assert field.input_value() == '0.13'


def test_saved_file_is_the_edited_text(browser: Any, tmp_path: Path) -> None:
    with edited(browser, tmp_path) as (page, file, server):
        other = browser.new_page()
        other.goto(server.address)
        other.wait_for_function(QUIET)
        assert page.is_disabled('#save')
        drag(page, 'B', 20, 20)
        # A second page is one of its own.
        assert state(other)['text'] == FOUR_BAR
        other.close()
        page.click('#save')
        page.get_by_text('saved: mine.yaml').wait_for()
        text = state(page)['text']
        assert file.read_text('utf-8') == text
        assert '# A crank-rocker: the crank turns fully' in text  # the author's comment
        page.reload()
        page.wait_for_function(QUIET)
        assert state(page)['text'] == text
        agrees(page)


def test_clicks_choose_points_inputs_and_sides(browser: Any, tmp_path: Path) -> None:
    with edited(browser, tmp_path) as (page, _, _):
        page.select_option('#choices select', 'right')
        page.wait_for_function("() => View.state().text.includes('{B: right}')")
        agrees(page)
        page.check('input[value=trace]')
        page.wait_for_function(QUIET)  # the picture fits the other assembly then
        page.mouse.click(*middle(page, 'O4', 'B'))
        page.wait_for_function("() => View.state().text.includes('traced: [P, P1]')")
        page.get_by_label('trace P no more').click()
        page.wait_for_function("() => View.state().text.includes('traced: [P1]')")
        page.check('input[value=input]')
        page.wait_for_function(QUIET)
        page.mouse.click(*middle(page, 'O4', 'B', 0.7))
        page.wait_for_function("() => View.state().text.includes('input: {joint: rocker_joint')")
        agrees(page)
        page.wait_for_function(QUIET)
        # The joints that are new have colours of their own, and the picture fits where they go.
        for key in ('joints', 'rates', 'accelerations'):
            curves = page.evaluate(CURVES, key)
            assert len({curve['line']['color'] for curve in curves}) == len(curves) == 2
        low, high = page.evaluate('() => View.linkage.range()')
        for share in (0.01, 0.3, 0.7, 0.99):
            page.evaluate('(value) => View.seek([value])', low + share * (high - low))
            assert page.evaluate(OUTSIDE) == 0


OUTSIDE = """() => {
  const { width, tall } = View.board.size;
  return View.linkage.drawn.shapes.flatMap(({ link, points }) => {
    const found = [];
    for (let i = 0; i < points.length; i += 2) {
      const [x, y] = View.board.toPixel(View.linkage.place(link, points[i], points[i + 1]));
      if (x < 0 || x > width || y < 0 || y > tall) found.push([x, y]);
    }
    return found;
  }).length;
}"""


def middle(page: Any, one: str, other: str, share: float = 0.5) -> tuple[float, float]:
    (x, y), (u, v) = pixel_of(page, one), pixel_of(page, other)
    return x + share * (u - x), y + share * (v - y)


def test_keyboard_moves_a_pin(browser: Any, tmp_path: Path) -> None:
    with edited(browser, tmp_path) as (page, _, _):
        page.focus('#drawing')
        while page.evaluate('() => View.board.chosen') != 'B':
            page.keyboard.press('n')
        for drags, key in ((False, 'Shift+ArrowUp'), (True, 'ArrowLeft')):
            if drags:  # the pin that was dragged is the chosen one
                drag(page, 'A', 10, 10)
            text = state(page)['text']
            page.keyboard.press(key)
            page.wait_for_function('text => View.state().text !== text', arg=text)
            agrees(page)
            page.keyboard.press('Control+z')
            page.wait_for_function('text => View.state().text === text', arg=text)


def test_opened_shipped_linkage_is_not_saved_over_the_file(browser: Any, tmp_path: Path) -> None:
    with edited(browser, tmp_path) as (page, file, _):
        page.wait_for_function("() => document.getElementById('open').options.length > 5")
        page.select_option('#open', 'slider_crank')
        page.wait_for_function("() => View.state().model.name === 'slider_crank'")
        agrees(page)
        for kind in ('yaml', 'svg', 'png'):
            with page.expect_download() as found:
                page.select_option('#download', kind)
            assert len(Path(found.value.path()).read_bytes()) > 500
            assert found.value.suggested_filename.endswith(f'.{kind}')
        page.wait_for_function(QUIET)
        page.click('#save')
        page.get_by_text('is not the file with which this page was opened').first.wait_for()
        assert file.read_text('utf-8') == FOUR_BAR


def test_lost_connection_is_shown_until_it_returns(browser: Any, tmp_path: Path) -> None:
    file = tmp_path / 'mine.yaml'
    file.write_text(FOUR_BAR, 'utf-8')
    sockets: list[Any] = []

    def through(socket: Any) -> None:
        socket.connect_to_server()
        sockets.append(socket)

    page = browser.new_page()
    page.route_web_socket(lambda address: address.endswith('/ws'), through)
    text = page_of(build_model(FOUR_BAR, 'mine'), mode='edit', can_save=True)
    with served([Conversation('mine', None, UserFile(file)).add_routes], lambda: text) as server:
        page.goto(server.address)
        page.wait_for_function(QUIET)
        sockets[0].close(code=4000, reason='the network has gone')
        page.wait_for_selector('#lost:not([hidden])')
        assert 'the network has gone' in page.inner_text('#lost')
        page.wait_for_function(QUIET)
        page.wait_for_selector('#lost', state='hidden')
        drag(page, 'B', 20, 10)
        agrees(page)
        edited_text = state(page)['text']
    # The server has ended.
    page.wait_for_selector('#lost:not([hidden])')
    assert page.is_disabled('#undo')
    assert page.get_by_label('length coupler A–B').is_disabled()
    before = state(page)['inputs'][0]
    page.focus('#drawing')
    page.keyboard.press('ArrowRight')
    assert state(page)['inputs'][0] > before
    assert state(page)['text'] == edited_text
    agrees(page)
    page.close()


# The page of a linkage in a notebook: it moves in its cell, and reaches nothing else.


@pytest.mark.parametrize('name', ['four_bar', 'slider_crank'])
def test_notebook_shows_the_page_of_a_closure(browser: Any, tmp_path: Path, name: str) -> None:
    closure = lr.load(name)
    notebook = tmp_path / 'notebook.html'
    notebook.write_text(
        f'<!doctype html><meta charset="utf-8"><body>{closure.view()._repr_html_()}', 'utf-8'
    )
    with opened(browser, notebook) as page:
        cell = page.page.frame_locator('iframe')
        cell.locator('#inputs input').focus()
        page.page.keyboard.press('End')
        (frame,) = page.page.main_frame.child_frames
        shown = frame.evaluate('() => View.state()')
        assert page.said == []
        assert shown['inputs'][0] == pytest.approx(6.283185307179586)
        joints = closure.position(*shown['inputs']).joints
        assert shown['joints'] == pytest.approx(joints, abs=1e-12)
        assert frame.evaluate('() => window.origin') == 'null'
        assert cell.locator('h1').inner_text() == name


def test_unnamed_linkage_has_a_page() -> None:
    page = lr.Closure(lr.load('four_bar').linkage).view()
    assert '<h1 id="title">linkage</h1>' in page.text
    assert '<title>linkage' in page.text
