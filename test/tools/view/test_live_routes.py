# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The page of a running node, beside a bridge that is none: what pages get, and what they ask."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from concurrent.futures import Future
import json
import socket as sockets
from typing import Any
from urllib.parse import urlsplit

from linkage_ros.tools.view import add_live, Server

from .served import in_loop, opened, served

PATIENCE = 20.0
LARGE = 'x' * 200_000


class Script:
    """A bridge that says what a test tells it to."""

    name = '/scripted'

    def __init__(self) -> None:
        self.said: dict[str, tuple[int, str]] = dict.fromkeys(('model', 'node', 'state'), (0, ''))
        self.heard: list[Callable[[], None]] = []
        self.taken = 0
        self.asked: list[Mapping[str, Any]] = []
        self.future: Future[str] | None = None

    def say(self, kind: str, content: Any) -> None:
        self.said[kind] = self.said[kind][0] + 1, json.dumps({kind: content})
        for heard in self.heard:
            heard()

    def add_listener(self, heard: Callable[[], None]) -> Callable[[], None]:
        self.heard.append(heard)
        return lambda: self.heard.remove(heard)

    def newest_message(self, kind: str) -> tuple[int, str]:
        self.taken += kind == 'state'
        return self.said[kind]

    def send_request(self, content: Mapping[str, Any]) -> Future[str]:
        self.asked.append(content)
        future: Future[str] = Future()
        if content['do'] != 'wait':
            future.set_result(f'did {content["do"]}')
        return future


def live(script: Script) -> Callable[[Any], None]:
    return lambda app: add_live(app, script)


@in_loop
async def test_live_page_receives_the_newest_of_each_kind() -> None:
    script = Script()
    for index in range(50):
        script.say('state', index)
    script.say('node', 'well')
    script.say('model', 'four_bar')
    with served([live(script)]) as server:
        async with opened(server.address, 'live') as page:
            heard = [await page.get() for _ in range(3)]
            script.say('state', 'new')
            heard.append(await page.get())
    assert heard == [{'model': 'four_bar'}, {'node': 'well'}, {'state': 49}, {'state': 'new'}]
    assert not script.heard


@in_loop
async def test_request_is_answered_while_another_waits() -> None:
    script = Script()
    bad = ['', '{', '[]', '{"do": 1}', '"do"', '[' * 5000, '{"d\ud800": 1}']
    with served([live(script)]) as server:
        async with opened(server.address, 'live') as page:
            await page.send('wait')
            for text in bad:
                await page.socket.send_bytes(text.encode('utf-8', 'surrogatepass'))
            for text in bad[:-1]:
                await page.socket.send_str(text)
            await page.send('reset')
            assert await page.get() == {'said': 'did reset', 'do': 'reset'}
        refused = server.server.refused
    assert refused == {'a message that is not a request': 2 * len(bad) - 1}
    assert [content['do'] for content in script.asked] == ['wait', 'reset']


def test_page_that_never_reads_gets_bounded_data() -> None:
    script = Script()

    async def reading(address: str) -> None:
        async with opened(address, 'live') as page:
            for index in range(60):
                script.say('state', [index, LARGE])
                assert (await page.get())['state'][0] == index

    with served([live(script)]) as server:
        deaf = _upgraded(server.address, server.server)
        asyncio.run(reading(server.address))
        before = script.taken
        for index in range(60):
            script.say('state', [index, LARGE])
            asyncio.run(asyncio.sleep(0.01))
        # The page that reads has gone; the other one is stuck within its buffers.
        assert script.taken - before <= 3
        assert len(script.heard) == 1
        deaf.close()


def _upgraded(address: str, server: Server) -> sockets.socket:
    """Open a WebSocket that is never read."""
    parts = urlsplit(address)
    wire = sockets.socket()
    wire.setsockopt(sockets.SOL_SOCKET, sockets.SO_RCVBUF, 4096)
    wire.settimeout(PATIENCE)
    wire.connect((parts.hostname, parts.port))
    lines = (
        f'GET {parts.path}live HTTP/1.1',
        f'Host: {parts.netloc}',
        f'Origin: http://{parts.netloc}',
        'Upgrade: websocket',
        'Connection: Upgrade',
        'Sec-WebSocket-Version: 13',
        'Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==',
        '',
        '',
    )
    wire.sendall('\r\n'.join(lines).encode())
    assert wire.recv(12) == b'HTTP/1.1 101'
    assert not server.refused
    return wire
