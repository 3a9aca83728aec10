# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The requests of open pages: each is answered in its turn, and an old drag gives way to a new.

Pages may save the user's linkage file, unless someone else has changed it.
"""

from __future__ import annotations

import asyncio
from collections import deque
from hashlib import sha256
from itertools import count
import json
import os
from pathlib import Path

from aiohttp import web, WSMsgType
from linkage_ros.description import atomic_write, LARGEST_FILE, read_regular
from linkage_ros.errors import LinkageError
from linkage_ros.tools.view.requests import (
    encode_text,
    failure_answer,
    read_request,
    Request,
    RequestError,
)
from linkage_ros.tools.view.sensors import SceneFiles
from linkage_ros.tools.view.server import Server, SERVER_KEY
from linkage_ros.tools.view.worker import Worker

_REMEDY = 'download this version, or load the page again to go on from the file'

_MOST_WAITING = 16
"""Most requests of a page that wait for one process."""

_LONGEST, _LONGEST_EXPORT = 20.0, 60.0
"""Time limits of a request, in [s]."""

_REPLACED = {'model': 'edit', 'edit': 'edit', 'read': 'read'}
"""Requests that a newer one of the same kind and page replaces while they wait."""

_SLOW = ('export',)
"""Requests during which a drag goes on, in a process of their own."""


class Conversation:
    """Answers all pages of a server: of a linkage, a scene's sensors, a user's file."""

    def __init__(self, name: str, scene: SceneFiles | None, file: UserFile | None) -> None:
        self._file = file
        self._quick = Worker(name, scene, _LONGEST)
        self._slow = Worker(name, scene, _LONGEST_EXPORT)
        self._numbers = count(1)

    def add_routes(self, app: web.Application) -> None:
        """Add the WebSocket ``ws`` to the application of a server."""
        server = app[SERVER_KEY]

        async def handle(request: web.Request) -> web.WebSocketResponse:
            async with server.socket(request) as socket:
                page = _Page(next(self._numbers), socket, self, server)
                await page.listen()
            return socket

        async def start(_app: web.Application) -> None:
            await self._quick.start()

        async def end(_app: web.Application) -> None:
            await asyncio.gather(self._quick.end(), self._slow.end())

        app.router.add_get('/ws', handle)
        app.on_startup.append(start)
        app.on_cleanup.append(end)

    def file_state(self) -> str:
        """Return the state of the user's file, as a page that is opened now sees it."""
        return '' if self._file is None else self._file.content_state()

    async def answer(self, page: _Page, request: Request, message: str) -> str:
        """Return the answer to a request, as JSON."""
        worker = self._slow if request.do in _SLOW else self._quick
        try:
            if request.do == 'save':
                return await self._save(page, request, message)
            return await worker.send_request(page.number, request.do, message)
        except LinkageError as error:
            return failure_answer(request.number, error)

    async def _save(self, page: _Page, request: Request, message: str) -> str:
        if self._file is None:
            raise LinkageError('save', 'no file of yours is open', 'download the linkage')
        answer = await self._quick.send_request(page.number, request.do, message)
        if 'ok' not in json.loads(answer):
            return answer
        name = self._file.path.name
        data = encode_text(request.content['text'], name)
        page.state = await asyncio.to_thread(self._file.save, data, page.state)
        return json.dumps({'id': request.number, 'ok': {'file': name}})


class _Page:
    """An open page, and the state of the user's file that it has seen."""

    def __init__(
        self, number: int, socket: web.WebSocketResponse, of: Conversation, server: Server
    ) -> None:
        self.number = number
        self.state = of.file_state()
        self._socket = socket
        self._server = server
        self._quick = _Queue(self, of, socket)
        self._slow = _Queue(self, of, socket)

    async def listen(self) -> None:
        """Take messages until the page goes."""
        async for message in self._socket:
            try:
                if message.type is not WSMsgType.TEXT:
                    raise RequestError('is not text', 'send JSON')
                request = read_request(message.data)
                queue = self._slow if request.do in _SLOW else self._quick
                dropped = queue.add_request(request, message.data)
            except RequestError as error:
                self._server.count_refusal('a message that is not a request')
                await self._socket.send_str(failure_answer(error.number, error))
                continue
            for number in dropped:
                await self._socket.send_str(json.dumps({'id': number, 'dropped': True}))


class _Queue:
    """The requests of one page that wait for one process."""

    def __init__(self, page: _Page, of: Conversation, socket: web.WebSocketResponse) -> None:
        self._page = page
        self._of = of
        self._socket = socket
        self._waiting: deque[tuple[Request, str]] = deque()
        self._task: asyncio.Task[None] | None = None

    def add_request(self, request: Request, message: str) -> list[float]:
        """
        Put a request at the end; return the numbers of those that it replaces.

        A RequestError says that too many wait.
        """
        kind = _REPLACED.get(request.do, '')
        replaced = [old for old in self._waiting if kind and _REPLACED.get(old[0].do) == kind]
        for old in replaced:
            self._waiting.remove(old)
        if len(self._waiting) >= _MOST_WAITING:
            reason, remedy = f'comes while {_MOST_WAITING} others wait', 'wait for their answers'
            raise RequestError(reason, remedy, request.number)
        self._waiting.append((request, message))
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._answer())
        return [old.number for old, _ in replaced]

    async def _answer(self) -> None:
        while self._waiting and not self._socket.closed:
            answer = await self._of.answer(self._page, *self._waiting.popleft())
            try:
                await self._socket.send_str(answer)
            except ConnectionError:  # the page has gone
                return


class UserFile:
    """A linkage file that pages may save."""

    def __init__(self, path: Path) -> None:
        self.path = path.absolute()

    @property
    def is_writable(self) -> bool:
        """Return whether the user may write it."""
        return os.access(self.path, os.W_OK)

    def content_state(self) -> str:
        """Return what tells its content from another one; '' if it cannot be read."""
        try:
            return content_digest(read_regular(self.path, LARGEST_FILE))
        except (OSError, ValueError):
            return ''

    def save(self, data: bytes, known: str) -> str:
        """
        Replace the content that the page has seen as the state ``known``; return the new state.

        A LinkageError says that the content is another, or that it cannot be written.
        """
        if self.content_state() != known:
            raise LinkageError(self.path.name, 'has changed since this page read it', _REMEDY)
        atomic_write(self.path, data)
        return content_digest(data)


def content_digest(data: bytes) -> str:
    """Return a digest of the content of a file."""
    return sha256(data).hexdigest()
