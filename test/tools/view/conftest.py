# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Pages of shipped linkages that need no server, and where their pins are in the window."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from linkage_ros.resources import linkage_of_scene
from linkage_ros.tools.view import build_model, page_html
import pytest

READY = "() => typeof View !== 'undefined' && View.board"


@pytest.fixture(scope='module')
def stills(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return a function that writes the page of a shipped linkage, which needs no server."""
    pages = tmp_path_factory.mktemp('stills')

    def write(name: str) -> Path:
        page = pages / f'{name}.html'
        if not page.exists():
            text = linkage_of_scene(name, pages).read_text('utf-8')
            page.write_text(page_html(build_model(text, name), mode='still'), 'utf-8')
        return page

    return write


def pixel_of(page: Any, pin: str) -> tuple[float, float]:
    """Return where a pin is in the window."""
    page.locator('#drawing').scroll_into_view_if_needed()
    box = page.locator('#drawing').bounding_box()
    x, y = page.evaluate(
        'pin => View.board.toPixel(View.linkage.pins().find((p) => p.name === pin).place)', pin
    )
    return box['x'] + x, box['y'] + y
