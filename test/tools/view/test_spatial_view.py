# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The page of a spatial linkage in a browser: places, camera, sliders, a point under the hand."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from linkage_ros.description import load
from linkage_ros.kinematics import SpaceDrawing
from linkage_ros.resources import shipped_path, spatial_linkage_names
from linkage_ros.tools.drawing import Camera
from linkage_ros.tools.view import build_model, Conversation, page_html as page_of
import numpy as np
import pytest

from .conftest import pixel_of, READY
from .served import served
from ...browser.opened import opened

ITERATED = ('hexapod',)
"""What a page asks its server for: too many cells for a program."""
COMPILED = [name for name in spatial_linkage_names() if name not in ITERATED]
TOLD = 'View.linkage.drawn.shapes.length && [...Array(View.linkage.drawn.count).keys()]'


def text_of(name: str) -> str:
    return shipped_path(f'linkages/space/{name}.yaml').read_text('utf-8')


@contextmanager
def shown(browser: Any, file: Path, **settings: Any) -> Iterator[Any]:
    with opened(browser, file, **settings) as found:
        found.page.wait_for_function(READY)
        yield found.page
        assert found.said == []
        assert not found.is_wider_than_its_window()


def spots(page: Any) -> np.ndarray:
    return np.array(page.evaluate(f'({TOLD}).map((row) => View.linkage.spot(row))'))


def camera(page: Any) -> Camera:
    return Camera(*page.evaluate('View.linkage.camera'))


def drag(page: Any, start: np.ndarray, end: np.ndarray) -> None:
    page.mouse.move(*start)
    page.mouse.down()
    for part in (0.2, 0.4, 0.6, 0.8, 1.0):
        page.mouse.move(*(start + part * (end - start)))
    page.mouse.up()


@pytest.mark.sample(2)
@pytest.mark.parametrize('name', COMPILED)
def test_page_places_points_as_the_closure(
    browser: Any, stills: Callable[[str], Path], name: str
) -> None:
    closure = load(name)
    model = SpaceDrawing(closure)
    with shown(browser, stills(name)) as page:
        start = page.evaluate('View.state().inputs')
        for part in (0.0, 0.13, -0.11):
            inputs = [
                value + part * (i + 1) * closure.scale * 0.3 for i, value in enumerate(start)
            ]
            position = closure.position(*inputs)
            page.evaluate('inputs => View.seek(inputs)', inputs)
            assert page.evaluate('View.state().closed') == bool(position.joints)
            if position.joints:
                assert spots(page) == pytest.approx(model.places(position), abs=1e-11)
                assert page.evaluate('View.state().joints') == pytest.approx(position.joints)


def test_drag_moves_a_point_or_turns_the_camera(
    browser: Any, stills: Callable[[str], Path]
) -> None:
    with shown(browser, stills('rssr')) as page:
        first = camera(page)
        # The ball on the crank, to where it is seen a third of a radian on.
        here = np.array(pixel_of(page, 'A'))
        page.evaluate('View.seek([0.33])')
        there = np.array(pixel_of(page, 'A'))
        page.evaluate('View.seek([0])')
        drag(page, here, there)
        (value,) = page.evaluate('View.state().inputs')
        assert value == pytest.approx(0.33, abs=1e-3)
        assert camera(page) == first
        empty = pixel_of(page, 'A') + np.array([0.0, 60.0])
        drag(page, empty, empty + np.array([50.0, -20.0]))
        assert page.evaluate('View.state().inputs') == [value]
        assert camera(page).azimuth == pytest.approx(first.azimuth - 0.5)
        assert camera(page).elevation == pytest.approx(first.elevation - 0.2)
        places = SpaceDrawing(load('rssr'))
        seen, _ = camera(page).project(
            places.places(load('rssr').position(value))
            - np.array(page.evaluate('View.linkage.drawn.middle'))
        )
        told = page.evaluate(f'({TOLD}).map((row) => View.linkage.place(row))')
        assert np.array(told)[:, 0] == pytest.approx(seen.real, abs=1e-9)
        assert np.array(told)[:, 1] == pytest.approx(seen.imag, abs=1e-9)


@pytest.mark.parametrize('width', [400, 1200])
def test_inputs_have_sliders_and_points_show_three_coordinates(
    browser: Any, stills: Callable[[str], Path], width: int
) -> None:
    with shown(browser, stills('wishbone'), width=width) as page:
        sliders = page.locator('#inputs input')
        assert sliders.count() == 2
        sliders.nth(1).fill('650')
        (travel, rack) = page.evaluate('View.state().inputs')
        assert (travel, rack) == (0.0, pytest.approx(0.3, abs=1e-9))
        sliders.nth(1).fill('515')
        _, rack = page.evaluate('View.state().inputs')
        closure = load('wishbone')
        place = closure.points(closure.position(0.0, rack))['wheel']
        read = page.locator('#readout').inner_text().split('wheel')[1]
        assert [float(each) for each in read.split('mm')[0].split(',')] == pytest.approx(
            [1e3 * each for each in place], abs=0.01
        )
        assert page.locator('#undo, #save, #open, #snap, #centres').count() == 0


def test_curves_and_toggles_are_those_of_the_linkage(
    browser: Any, stills: Callable[[str], Path]
) -> None:
    closure = load('spherical_four_bar')
    with shown(browser, stills('spherical_four_bar')) as page:
        page.wait_for_function("document.querySelector('[data-key=joints] .plot').data")
        x, y = page.evaluate(
            "(({x, y}) => [x, y])(document.querySelector('[data-key=joints] .plot').data[0])"
        )
        for at in (20, 180, 300):
            found = closure.position(np.radians(x[at])).joints[0]
            assert np.radians(y[at]) == pytest.approx(found, abs=1e-9)
        toggles = page.evaluate('View.linkage.model.toggles')
        assert toggles == pytest.approx([each.value for each in closure.singular_inputs])


def test_page_without_a_program_asks_the_server(
    browser: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr('linkage_ros.tools.view.model.program_of', lambda _: None)
    text = page_of(build_model(text_of('ankle'), 'ankle'), mode='edit')
    closure = load('ankle')
    model = SpaceDrawing(closure)
    with served([Conversation('ankle', None, None).add_routes], lambda: text) as server:
        page = browser.new_page()
        said: list[str] = []
        page.on('pageerror', lambda error: said.append(str(error)))
        page.goto(server.address)
        page.wait_for_function(READY)
        page.wait_for_function('View.state().there')
        inputs = [0.05, -0.07]
        page.evaluate('inputs => View.seek(inputs)', inputs)
        first = model.places(closure.position(*inputs))
        page.wait_for_function(
            '([x, y, z]) => Math.hypot(...View.linkage.spot(View.linkage.model.pins.at(-1).link)'
            '.map((value, i) => value - [x, y, z][i])) < 1e-12',
            arg=first[list(model.points.values())[-1]].tolist(),
        )
        assert spots(page) == pytest.approx(first, abs=1e-12)
        # Its curves follow, over the first input and beside the second as it is now.
        page.wait_for_function('View.linkage.known.poses[0].inputs[1] === -0.07')
        page.close()
        assert said == []
