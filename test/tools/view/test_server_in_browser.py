# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A browser keeps other pages away from the server, and lets its own page in."""

from __future__ import annotations

from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import Any

from linkage_ros.tools.view import Conversation
import pytest

from .served import Served, served
from ...browser import chromium

OWN = """<!doctype html><link rel="icon" href="data:,"><script>
window.said = {};
said.program = new Function('return 1 + 1')();
const socket = new WebSocket(new URL('ws', location.href.replace('http', 'ws')));
socket.onopen = () => socket.send('{"id": 1, "do": "names"}');
socket.onmessage = (message) => { said.socket = 'ok' in JSON.parse(message.data); };
document.addEventListener('securitypolicyviolation', (event) => {
  said.elsewhere = event.effectiveDirective;
});
fetch('https://example.org/').catch(() => {});
</script>"""

OTHER = """<!doctype html><link rel="icon" href="data:,"><body><script>
window.said = {};
const address = '%s';
fetch(address).then(() => { said.page = 'read'; }, () => { said.page = 'refused'; });
fetch(address, { mode: 'no-cors' })
  .then(() => { said.blind = 'read'; }, () => { said.blind = 'refused'; });
const socket = new WebSocket(`${address.replace('http', 'ws')}ws`);
socket.onopen = () => { said.socket = 'open'; };
socket.onerror = () => { said.socket = 'refused'; };
const frame = document.createElement('iframe');
frame.onload = () => { said.frame = 'loaded'; };
frame.src = address;
document.body.append(frame);
</script>"""


@pytest.fixture(scope='module')
def server() -> Iterator[Served]:
    with served([Conversation('four_bar', None, None).add_routes], lambda: OWN) as found:
        yield found


@pytest.fixture
def elsewhere(server: Served) -> Iterator[str]:
    """Return the address of a page of another origin, which tries to reach the server."""

    class Other(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header('Content-Type', 'text/html')
            self.end_headers()
            self.wfile.write((OTHER % server.address).encode())

        def log_message(self, *_: Any) -> None:
            pass

    other = ThreadingHTTPServer(('127.0.0.1', 0), Other)
    Thread(target=other.serve_forever).start()
    try:
        yield f'http://127.0.0.1:{other.server_port}/'
    finally:
        other.shutdown()
        other.server_close()


def said(page: Any, count: int) -> dict[str, Any]:
    """Return what a page says, once it has said so much."""
    page.wait_for_function(f'Object.keys(window.said).length >= {count}')
    found: dict[str, Any] = page.evaluate('window.said')
    return found


def test_server_admits_its_own_page_and_no_other_origin(server: Served, elsewhere: str) -> None:
    with chromium.browser() as browser:
        page = browser.new_page()
        for address in (server.address, server.address.replace('127.0.0.1', 'localhost')):
            page.goto(address)
            assert said(page, 3) == {'program': 2, 'socket': True, 'elsewhere': 'connect-src'}
        assert not server.server.refused
        page.goto(elsewhere)
        answers = dict.fromkeys(('page', 'blind', 'socket'), 'refused')
        assert said(page, 4) == {**answers, 'frame': 'loaded'}
        _, frame = page.frames
        assert frame.url == 'chrome-error://chromewebdata/'
    assert set(server.server.refused) == {'a request of another origin'}
