# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The page of a spatial run: places as solved, a camera that turns, and all by the keyboard."""

from base64 import b64decode
from pathlib import Path
from typing import Any

from linkage_ros.description import load
from linkage_ros.kinematics import SpaceDrawing
from linkage_ros.messages import JointStateWriter
from linkage_ros.tools.drawing import Camera
from linkage_ros.tools.view.report import FRAME_BYTES
import numpy as np
import pytest

from .runs import BEGIN, data_of, MS, page_of_run, read, recorded
from .test_page_in_browser import page_of, PAINTED, quiet, settle
from ....node.ticked import Moment

WISHBONE = Path(__file__).parents[4] / 'config' / 'linkages' / 'space' / 'wishbone.yaml'
SCENE = """
rate: 200
drive: {sine: {amplitude: 0.2, frequency: 1.0, inputs: {rack: {amplitude: 0.03, frequency: 2.0}}}}
"""


@pytest.fixture(scope='module')
def bag(tmp_path_factory: pytest.TempPathFactory) -> Any:
    ticks = (Moment(BEGIN + 5 * tick * MS, ()) for tick in range(200))
    return recorded(tmp_path_factory.mktemp('car'), SCENE, ticks, WISHBONE.read_text())


@pytest.fixture(scope='module')
def page(browser: Any, bag: Any) -> Any:
    with quiet(browser, page_of(bag.path)) as page:
        yield page


@pytest.fixture
def canvas(page: Any) -> Any:
    """Give the picture, at the beginning of the run and as it was first seen."""
    page.evaluate('Report.pause(); Report.seek(0); document.activeElement.blur()')
    picture = page.locator('canvas.orbit')
    picture.dblclick()
    page.evaluate('document.activeElement.blur()')
    settle(page)
    return picture


def camera_of(page: Any) -> Camera:
    return Camera(*page.evaluate('Report.linkages[0].camera'))


def test_page_places_equal_the_drawing_at_recorded_inputs(bag):
    data = data_of(page_of_run(read(bag)))
    (told,), frames = data['linkages'], data['frames']
    closure = load(WISHBONE)
    model = SpaceDrawing(closure)
    poses = np.frombuffer(b64decode(told['poses']), '<f4').reshape(-1, model.count, 3)
    inputs = [np.frombuffer(b64decode(frames['values'][name])) for name in told['inputs']]
    assert len(poses) == len(inputs[0]) == 200
    assert poses.nbytes + sum(each.nbytes for each in inputs) < FRAME_BYTES
    for number in range(0, 200, 20):
        places = model.places(closure.position(*(each[number] for each in inputs)))
        assert poses[number] == pytest.approx(places, abs=1e-7)
    middle, (across, up) = np.array(told['drawn']['middle']), told['drawn']['reach']
    away = poses - middle
    assert np.hypot(away[..., 0], away[..., 1]).max() < across
    assert np.linalg.norm(away, axis=2).max() < up


def test_page_projects_places_as_draw_does(page, canvas):
    model = SpaceDrawing(load(WISHBONE))
    for share in (0.0, 0.3, 0.8):
        page.locator('#scrub').fill(str(round(share * 1e6)))
        inputs = page.evaluate(
            "['travel', 'rack'].map((name) => Report.frames.values[name][Report.number])"
        )
        places = model.places(model.closure.position(*inputs))
        middle = page.evaluate('Report.linkages[0].drawn.middle')
        seen, near = camera_of(page).project(places - np.array(middle))
        told = page.evaluate(
            f'[...Array({model.count}).keys()].map('
            '(row) => Report.linkages[0].place(row, Report.number))'
        )
        expected = np.array([seen.real, seen.imag, near]).T
        assert np.array(told) == pytest.approx(expected, abs=1e-6)


def test_drag_and_arrow_keys_turn_the_camera(page, canvas):
    first = camera_of(page)
    box = canvas.bounding_box()
    x, y = box['x'] + box['width'] / 2, box['y'] + box['height'] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 50, y - 20, steps=3)
    page.mouse.up()
    page.mouse.move(x, y)
    dragged = camera_of(page)
    # What is dragged follows the hand: the camera goes the other way.
    assert dragged.azimuth == pytest.approx(first.azimuth - 0.5)
    assert dragged.elevation == pytest.approx(first.elevation - 0.2)
    canvas.focus()
    for key in ('ArrowLeft', 'ArrowUp', 'ArrowUp'):
        page.keyboard.press(key)
    turned = camera_of(page)
    assert turned.azimuth < dragged.azimuth
    assert turned.elevation > dragged.elevation
    assert page.evaluate('Report.time') == 0
    for _ in range(60):
        page.keyboard.press('ArrowUp')
    assert camera_of(page).elevation == pytest.approx(np.pi / 2)  # never over the top
    canvas.dblclick()
    assert camera_of(page) == pytest.approx(first)


def test_arrow_and_end_keys_move_the_run_time(page, canvas):
    page.keyboard.press('ArrowRight')
    assert page.evaluate('Report.number') == 1
    canvas.focus()
    page.keyboard.press('End')
    assert page.evaluate('Report.number') == 199


@pytest.mark.parametrize('scheme', ['light', 'dark'])
def test_spatial_parts_are_painted_in_page_colours(browser, bag, scheme):
    with quiet(browser, page_of(bag.path), color_scheme=scheme) as page:
        settle(page)
        ink = page.evaluate('Picture.ink()')
        wanted = {
            ','.join(map(str, bytes.fromhex(ink[role].removeprefix('#'))))
            for role in ('input', 'base', 'ball')
        }
        assert wanted <= page.evaluate(PAINTED)[0].keys()


def test_open_spatial_linkage_has_no_pose(tmp_path):
    rows = (JointStateWriter(['travel', 'rack']).write(BEGIN + tick * MS, [2.9, 0.9])
            for tick in range(50))  # fmt: skip
    ticks = (Moment(BEGIN + tick * MS, (row,)) for tick, row in enumerate(rows))
    found = read(recorded(tmp_path, 'rate: 1000\n', ticks, WISHBONE.read_text()))
    (told,) = data_of(page_of_run(found))['linkages']
    assert found.event_tracks['open'].count == 50
    assert np.isnan(np.frombuffer(b64decode(told['poses']), '<f4')).all()
