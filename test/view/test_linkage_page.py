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

"""The page of a linkage in a notebook: it moves in its cell, and reaches nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import linkage_ros as lr
import pytest

from ..browser.opened import opened


@pytest.mark.parametrize('name', ['four_bar', 'slider_crank'])
def test_a_notebook_shows_the_page_of_a_closure(browser: Any, tmp_path: Path, name: str) -> None:
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


def test_a_linkage_without_a_name_has_a_page() -> None:
    page = lr.Closure(lr.load('four_bar').linkage).view()
    assert '<h1 id="title">linkage</h1>' in page.text
    assert '<title>linkage' in page.text
