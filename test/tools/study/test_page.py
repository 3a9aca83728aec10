# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The page of a budget in a real browser: its answers, and nothing that leads out of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from linkage_ros.tools.study import budget_html, lead_lines, NeedAnswer, rows_of
import pytest

from .shown_budget import BUDGET
from ...browser.opened import Opened, opened

ANSWERS = [
    NeedAnswer(True, 0.5, (), 'a: 1'),
    NeedAnswer(True, 1e-3, (), 'a: 2'),
    NeedAnswer(False, 0.0, (), 'nothing does: <b>age</b>'),
]
TYPED = {
    '0.7': 'a: 1', '0,5': 'a: 1', '1e-2': 'a: 2', '0.001': 'a: 2',
    '1e-9': 'nothing does: <b>age</b>',
    '0': 'write a number above 0, such as 1e-3', 'x': 'write a number above 0, such as 1e-3',
}  # fmt: skip


@pytest.fixture(scope='module')
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    page = tmp_path_factory.mktemp('page') / 'page.html'
    odd = BUDGET._replace(machine=[*BUDGET.machine, ('kernel', '</script><i>x</i>')])
    page.write_text(budget_html(odd, ANSWERS), 'utf-8')
    return page


@pytest.fixture(scope='module')
def shown(browser: Any, file: Path) -> Iterator[Opened]:
    with opened(browser, file) as page:
        yield page


@pytest.mark.parametrize('typed', TYPED)
def test_page_field_shows_the_cheapest_answer(shown: Opened, typed: str) -> None:
    shown.page.fill('#need', typed)
    assert shown.page.text_content('#answer') == TYPED[typed]


def test_page_shows_lead_lines_picture_and_table(shown: Opened) -> None:
    leads = shown.page.locator('.lead').all_text_contents()
    assert leads == lead_lines(BUDGET)
    assert shown.page.locator('figure svg').count() == 1
    rows = shown.page.locator('tbody tr')
    assert rows.count() == len(rows_of(BUDGET))


@pytest.mark.parametrize('scheme', ['light', 'dark'])
@pytest.mark.parametrize('width', [400, 1600])
def test_page_opens_without_errors_requests_or_scrolling(
    browser: Any, file: Path, width: int, scheme: str
) -> None:
    with opened(browser, file, width=width, color_scheme=scheme) as page:
        assert not page.said
        assert page.asked == [file.as_uri()]
        assert not page.is_wider_than_its_window()


def test_page_without_answers_has_no_field() -> None:
    assert 'id="need"' not in budget_html(BUDGET, [])


def test_budget_page_stays_below_60_kilobytes() -> None:
    assert len(budget_html(BUDGET, ANSWERS)) < 60_000
