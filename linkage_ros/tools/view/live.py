# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The page of a running node: what the node says goes to the pages, what a page asks to the node.

This module knows a node only as a `Bridge`; `linkage_ros.tools.view.live_bridge` is the one over
ROS. A page gets only the newest state: one that reads slowly loses states, and holds nobody up.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from html import escape
import json
from typing import Any, Protocol

from aiohttp import web, WSMsgType
from linkage_ros.tools.view.pages import html_document
from linkage_ros.tools.view.server import SERVER_KEY

KINDS = ('model', 'node', 'state')
"""Kinds of what a node says, in the order in which a page needs them."""

_PERIOD = 1.0 / 60.0
"""Least time between two states for a page, in [s]."""

_MOST_WAITING = 8
"""Most requests of a page that wait for the node."""

_PATIENCE = 90.0
"""Time limit of a request, in [s]: the file of a snapshot may be large."""

_BODY = """
<p id="banner" role="alert" hidden></p>
<main id="live">
<section class="player">
<figure><canvas role="img" aria-label="the linkage as the node publishes it"></canvas></figure>
<p id="age"></p>
<p id="more" class="note"></p>
<div id="hands"></div>
<div class="controls">
<button type="button" id="record" aria-pressed="false">Record</button>
<button type="button" id="snapshot" hidden>Snapshot</button>
<button type="button" id="reset">Reset</button>
</div>
<p id="said" role="status"></p>
</section>
<section class="told">
<h2>Joints</h2>
<div class="scroll"><table>
<thead><tr><th>joint</th><th class="number">position</th><th class="number">rate</th></tr></thead>
<tbody id="joints"></tbody>
</table></div>
<h2 id="faults-title" hidden>Faults</h2>
<div id="faults"></div>
<h2>Node</h2>
<dl id="facts" class="facts"></dl>
<h2>Diagnostics</h2>
<ul id="diagnostics"></ul>
</section>
</main>
"""

_HERE = 'linkage_ros.tools.view'


class Bridge(Protocol):
    """A running node, as pages see it."""

    name: str

    def add_listener(self, heard: Callable[[], None]) -> Callable[[], None]:
        """Call a function, on any thread, whenever there is news; return one that ends this."""

    def newest_message(self, kind: str) -> tuple[int, str]:
        """Return the number and the JSON of the newest message of a kind; 0 and '' for none."""

    def send_request(self, content: Mapping[str, Any]) -> Future[str]:
        """Ask for something; return what the answer says, one line."""


def add_live(app: web.Application, bridge: Bridge) -> None:
    """Add the WebSocket ``live`` to the application of a server."""
    server = app[SERVER_KEY]

    async def handle(request: web.Request) -> web.WebSocketResponse:
        async with server.socket(request) as socket:
            if socket.closed:
                return socket
            sending = asyncio.create_task(_send_news(socket, bridge))
            waiting: set[asyncio.Task[None]] = set()
            try:
                async for message in socket:
                    content = _parse_request(
                        message.data if message.type is WSMsgType.TEXT else None
                    )
                    if content is None or len(waiting) >= _MOST_WAITING:
                        refused = content is None
                        server.count_refusal(
                            'a message that is not a request'
                            if refused
                            else 'a request while too many wait'
                        )
                        continue
                    task = asyncio.create_task(_answer(socket, bridge, content))
                    waiting.add(task)
                    task.add_done_callback(waiting.discard)
            finally:
                for task in (sending, *waiting):
                    task.cancel()
                await asyncio.gather(sending, *waiting, return_exceptions=True)
        return socket

    app.router.add_get('/live', handle)


def _parse_request(text: str | None) -> dict[str, Any] | None:
    """Return a request; None if the message is none."""
    try:
        content = json.loads(text or '')
    except (ValueError, RecursionError):
        return None
    is_request = isinstance(content, dict) and isinstance(content.get('do'), str)
    return content if is_request else None


async def _answer(
    socket: web.WebSocketResponse, bridge: Bridge, content: Mapping[str, Any]
) -> None:
    try:
        said = await asyncio.wait_for(asyncio.wrap_future(bridge.send_request(content)), _PATIENCE)
    except asyncio.TimeoutError:
        said = f'{bridge.name} does not answer'
    await socket.send_str(json.dumps({'said': said, 'do': content['do']}))


async def _send_news(socket: web.WebSocketResponse, bridge: Bridge) -> None:
    """Send what is new, at most 60 times a second; of each kind only the newest message."""
    sent = dict.fromkeys(KINDS, 0)
    with _news_event(bridge) as news:
        while not socket.closed:
            for kind in KINDS:
                number, text = bridge.newest_message(kind)
                if number != sent[kind]:
                    sent[kind] = number
                    await socket.send_str(text)
            await asyncio.sleep(_PERIOD)
            await news.wait()
            news.clear()


@contextmanager
def _news_event(bridge: Bridge) -> Iterator[asyncio.Event]:
    """Return an event that is set whenever there is news."""
    news = asyncio.Event()
    news.set()
    loop = asyncio.get_running_loop()

    def wake() -> None:
        with suppress(RuntimeError):  # the loop has ended
            loop.call_soon_threadsafe(news.set)

    end = bridge.add_listener(wake)
    try:
        yield news
    finally:
        end()


def live_page(bridge: Bridge) -> str:
    """Return the page of a running node; a LinkageError if plotly is not installed."""
    body = [f'<h1 id="title">{escape(bridge.name)}</h1>', _BODY]
    data = {'mode': 'live', 'server': True, 'node': bridge.name}
    title = f'{bridge.name}: linkage view'
    return html_document(title, body, data, _HERE, ('live.css', 'live.js'), is_served=True)
