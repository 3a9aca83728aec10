# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The web page of docs/how_to/compile.md shows the joints of the linkage in a browser."""

from __future__ import annotations

from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

from .blocks import blocks, ROOT
from ..support.commands import linkage


class Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        """Do not log requests."""


def test_compiled_javascript_page_shows_the_joints(tmp_path: Path, browser: Any) -> None:
    page = ROOT / 'docs' / 'how_to' / 'compile.md'
    texts = {block.language: block.text for block in blocks(page)}
    (tmp_path / 'page.html').write_text(f'<!doctype html>\n{texts["html"]}')
    assert linkage(tmp_path, 'compile', 'four_bar', '-o', 'four_bar.js').returncode == 0
    with ThreadingHTTPServer(('127.0.0.1', 0), partial(Quiet, directory=tmp_path)) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        shown = browser.new_page()
        shown.goto(f'http://127.0.0.1:{server.server_port}/page.html')
        shown.wait_for_function("document.getElementById('shown').textContent.includes(', ')")
        coupler, rocker = map(float, shown.inner_text('#shown').split(', '))
        server.shutdown()
    assert -7.0 < coupler < 7.0
    # The rocker of this crank-rocker swings between these angles, in [rad].
    assert 0.9 < rocker < 2.4
