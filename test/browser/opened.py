# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A page opened in a browser, with all that it has said and asked for."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple


class Opened(NamedTuple):
    """A page in a browser."""

    page: Any  # The page, as Playwright has it
    said: list[str]  # What came on its console, and its uncaught errors: none is good
    asked: list[str]  # Addresses that it has asked for, its own the first

    def is_wider_than_its_window(self) -> bool:
        """Say whether one has to scroll sideways."""
        width = 'document.documentElement.scrollWidth > document.documentElement.clientWidth'
        return bool(self.page.evaluate(width))


@contextmanager
def opened(
    browser: Any, file: Path, *, width: int = 1000, height: int = 900, **context: Any
) -> Iterator[Opened]:
    """
    Open a file in a running browser, in a window of some pixels.

    The context is what else Playwright is told: ``color_scheme='dark'``, ``has_touch=True``.
    """
    viewport = {'width': width, 'height': height}
    # It is not offline: a request must be seen, not fail.
    with browser.new_context(viewport=viewport, **context) as fresh:
        said: list[str] = []
        asked: list[str] = []
        fresh.on('request', lambda request: asked.append(request.url))
        page = fresh.new_page()
        page.on('console', lambda message: said.append(f'{message.type}: {message.text}'))
        page.on('pageerror', lambda error: said.append(f'error: {error}'))
        page.goto(file.resolve().as_uri())
        yield Opened(page, said, asked)
