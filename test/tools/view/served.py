# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A server of a page in this process, and pages without a browser that ask it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager
from functools import wraps
from itertools import count
import json
from queue import SimpleQueue
import socket
from threading import Event, Thread
from typing import Any, NamedTuple
from urllib.parse import urlsplit

import aiohttp
from linkage_ros.tools.view import Route, Server

_PATIENCE = 60.0
"""A guard against a test that hangs, in [s]."""


def in_loop(test: Callable[..., Any]) -> Callable[..., None]:
    """Make a test of a coroutine, which is run to its end."""

    @wraps(test)
    def run(**fixtures: Any) -> None:
        asyncio.run(test(**fixtures))

    return run


class Served(NamedTuple):
    """A server, its address, and the lines that it has reported."""

    server: Server
    address: str
    lines: list[str]

    @property
    def port(self) -> int:
        """Return its port."""
        return int(urlsplit(self.address).port or 0)

    @property
    def token(self) -> str:
        """Return its token."""
        return urlsplit(self.address).path.strip('/')


@contextmanager
def served(
    routes: Sequence[Route], page: Callable[[], str] = lambda: '<!doctype html>'
) -> Iterator[Served]:
    """Serve a page in a thread."""
    lines: list[str] = []
    server = Server(page, routes, lines.append)
    answers: SimpleQueue[str] = SimpleQueue()
    stop = Event()

    async def run() -> None:
        await server.start()
        answers.put(server.address)
        while not stop.is_set():
            await asyncio.sleep(0.02)
        await server.end()

    thread = Thread(target=lambda: asyncio.run(run()))
    thread.start()
    try:
        yield Served(server, answers.get(timeout=_PATIENCE), lines)
    finally:
        stop.set()
        thread.join(_PATIENCE)
        assert not thread.is_alive()


class Page:
    """An open page: what its script would send, and what it would get."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse) -> None:
        self.socket = socket
        self._numbers = count(1)

    async def send(self, do: str, **content: Any) -> int:
        """Send a request, and return its number."""
        number = next(self._numbers)
        await self.socket.send_str(json.dumps({'id': number, 'do': do, **content}))
        return number

    async def get(self) -> dict[str, Any]:
        """Return the next answer."""
        answer: dict[str, Any] = await self.socket.receive_json(timeout=_PATIENCE)
        return answer

    async def ask(self, do: str, **content: Any) -> dict[str, Any]:
        """Return the answer to a request."""
        number = await self.send(do, **content)
        answer = await self.get()
        assert answer['id'] == number
        return answer


@asynccontextmanager
async def opened(address: str, path: str = 'ws') -> AsyncIterator[Page]:
    """Open a page's WebSocket."""
    parts = urlsplit(address)
    async with (
        aiohttp.ClientSession() as session,
        session.ws_connect(
            address + path, origin=f'{parts.scheme}://{parts.netloc}', max_msg_size=0
        ) as found,
    ):
        yield Page(found)


def asked(served: Served, request: str, *headers: str) -> tuple[int, str]:
    """Send a request as it is written, and return the status and the whole answer."""
    with socket.create_connection(('127.0.0.1', served.port), timeout=_PATIENCE) as wire:
        lines = (f'{request} HTTP/1.1', *headers, 'Connection: close', '', '')
        wire.sendall('\r\n'.join(lines).encode())
        answer = b''
        while part := wire.recv(2**16):
            answer += part
    text = answer.decode()
    return int(text.split(' ')[1]), text
