# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where a Chromium is, and what it needs to start."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
import shutil
from typing import Any

import pytest

from ..node_packages import BROWSER

_NAMES = ('chromium', 'chromium-headless-shell', 'chromium-browser', 'google-chrome')
_REMEDY = (
    'no Chromium here: run `make test` where the npm registry can be reached, install the '
    "system's (apt-get install chromium), or name one in CHROME_PATH"
)


@contextmanager
def browser() -> Iterator[Any]:
    """Give a running Chromium, without a window; skip the test where there is none."""
    playwright = pytest.importorskip('playwright.sync_api', reason='pip install playwright')
    executable, environment = find()
    with playwright.sync_playwright() as driver:
        # Where a test runs as root, or within a container, there is no sandbox to be had.
        started = driver.chromium.launch(
            executable_path=executable, chromium_sandbox=False, env=environment
        )
        try:
            yield started
        finally:
            started.close()


def find() -> tuple[str, dict[str, str]]:
    """Return the program and its environment; skip the test where there is none."""
    environment = dict(os.environ)
    if 'CHROME_PATH' in environment:
        return environment['CHROME_PATH'], environment
    if (BROWSER / '.installed').is_file():
        libraries = [str(BROWSER / 'al2023' / 'lib'), environment.get('LD_LIBRARY_PATH', '')]
        environment['LD_LIBRARY_PATH'] = os.pathsep.join(filter(None, libraries))
        environment['FONTCONFIG_PATH'] = str(BROWSER / 'fonts')
        return str(BROWSER / 'chromium'), environment
    executable = next(filter(None, map(shutil.which, _NAMES)), None)
    if executable is None:
        pytest.skip(_REMEDY)
    return executable, environment
