# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The server of a page: on this machine only, at an address that nobody can guess.

Any page in a browser can make it send requests to any address. So a request must know the token
in the path, name this server as its host, and come from its own page. No file is read by its path:
the page is one text, and everything else goes through WebSockets.
"""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from errno import EACCES, EADDRINUSE
from hmac import compare_digest
import logging
from secrets import token_urlsafe
from threading import Event
from typing import Any

from aiohttp import web
from linkage_ros.errors import LinkageError
from linkage_ros.tools.view.pages import SERVED_POLICY
from linkage_ros.tools.view.requests import defect_error, LARGEST

HOST = '127.0.0.1'

MOST_PAGES = 4
"""Most pages that are open at once."""

GOING_AWAY, TRY_LATER = 1001, 1013
"""Codes with which a WebSocket is closed."""

_GOODBYE = 1.0
"""Time that a page has to close its socket, in [s]."""

_HEARTBEAT = 20.0
"""Time between two pings, in [s]; a page that does not answer one has gone."""

Route = Callable[[web.Application], None]
"""Adds routes to the application below the token, which has its server as ``app[SERVER_KEY]``."""


def serve(
    page: Callable[[], str],
    routes: Sequence[Route],
    stop: Event,
    ready: Callable[[str], Any],
    report: Callable[[str], Any],
    *,
    port: int = 0,
) -> None:
    """
    Serve a page as `Server` until the stop event is set; 0 is a free port.

    ``ready`` is called with the address as soon as the server answers. A LinkageError says that
    the port is taken.
    """
    asyncio.run(_serve(Server(page, routes, report), stop, ready, port))


async def _serve(server: Server, stop: Event, ready: Callable[[str], Any], port: int) -> None:
    asyncio.get_running_loop().set_exception_handler(server.report_failure)
    await server.start(port)
    try:
        ready(server.address)
        while not stop.is_set():
            await asyncio.sleep(0.1)
    finally:
        await server.end()


class Server:
    """
    The server of a page.

    ``page`` returns the page; it is called in a thread whenever a browser asks. ``routes`` are
    served with it. ``report`` is called with one line for the first refusal of a kind, and for
    each defect.
    """

    def __init__(
        self, page: Callable[[], str], routes: Sequence[Route], report: Callable[[str], Any]
    ) -> None:
        self._page = page
        self._routes = routes
        self._report = report
        self._token = token_urlsafe(24)
        self.address = ''  # Its address, with the token; '' before `start`
        # Number of refused requests and messages, by reason.
        self.refused: Counter[str] = Counter()
        self._hosts: tuple[str, ...] = ()
        self._sockets: dict[web.WebSocketResponse, str] = {}
        self._runner: web.AppRunner | None = None

    async def start(self, port: int = 0) -> None:
        """Listen on a port, 0 for a free one; a LinkageError if it is taken."""
        within = web.Application()
        within[SERVER_KEY] = self
        within.router.add_get('/', self._answer_page)
        for add in self._routes:
            add(within)
        app = web.Application(middlewares=[self._guard])
        app.on_response_prepare.append(self._add_headers)
        app.add_subapp(f'/{self._token}', within)
        # What is not HTTP is answered with an error; a log would only repeat it.
        silent = logging.getLogger(__name__)
        silent.setLevel(logging.CRITICAL + 1)
        self._runner = web.AppRunner(
            app, access_log=None, logger=silent, shutdown_timeout=_GOODBYE
        )
        await self._runner.setup()
        try:
            await web.TCPSite(self._runner, HOST, port).start()
        except OSError as error:
            await self._runner.cleanup()
            known = {EADDRINUSE: 'is taken', EACCES: 'is for the administrator only'}
            reason = known.get(error.errno or 0, f'cannot be listened to ({error.strerror})')
            remedy = 'name another one, or leave --port out'
            raise LinkageError(f'--port {port}', reason, remedy) from None
        port = self._runner.addresses[0][1]
        # At port 80 a browser leaves the port out.
        self._hosts = tuple(f'{host}:{port}'.removesuffix(':80') for host in (HOST, 'localhost'))
        self.address = f'http://{HOST}:{port}/{self._token}/'

    async def end(self) -> None:
        """Tell the open pages, and close everything."""
        goodbyes = [
            socket.close(code=GOING_AWAY, message=b'linkage view has ended')
            for socket in tuple(self._sockets)
        ]
        # A page that reads nothing does not read this either.
        with suppress(asyncio.TimeoutError):
            together = asyncio.gather(*goodbyes, return_exceptions=True)
            await asyncio.wait_for(together, 2.0 * _GOODBYE)
        if self._runner is not None:
            runner, self._runner = self._runner, None
            await runner.cleanup()

    def count_refusal(self, what: str) -> None:
        """Count something that is refused; say so the first time."""
        self.refused[what] += 1
        if self.refused[what] == 1:
            self._report(f'refused {what}')

    def report_failure(self, _loop: asyncio.AbstractEventLoop, context: Mapping[str, Any]) -> None:
        """Report in one line what fails outside a request; asyncio would print a traceback."""
        error = context.get('exception')
        if isinstance(error, OSError):
            self.count_refusal(f'a connection ({error.strerror})')
        elif isinstance(error, ValueError) and self._runner is None:
            pass  # asyncio listens again 1 s after a refusal, here at a port that is closed
        elif error is not None:
            self._report(str(defect_error('linkage view', error)))

    @asynccontextmanager
    async def socket(self, request: web.Request) -> AsyncIterator[web.WebSocketResponse]:
        """Open the WebSocket of a page; it is closed at once if too many pages have one."""
        socket = web.WebSocketResponse(
            timeout=_GOODBYE, heartbeat=_HEARTBEAT, max_msg_size=4 * LARGEST, compress=False
        )
        await socket.prepare(request)
        if await self._has_place(request.path):
            self._sockets[socket] = request.path
        else:
            self.count_refusal('a page too many')
            message = f'{MOST_PAGES} pages are open; close one'.encode()
            await socket.close(code=TRY_LATER, message=message)
        try:
            yield socket
        except ConnectionError:  # the page has gone
            pass
        finally:
            self._sockets.pop(socket, None)
            if socket.exception() is not None:
                self.count_refusal('what is not a WebSocket message')

    async def _has_place(self, path: str) -> bool:
        """Return whether one more page may be open, if need be after one that is being closed."""
        for _ in range(20):
            if list(self._sockets.values()).count(path) < MOST_PAGES:
                return True
            await asyncio.sleep(_GOODBYE / 20)
        return False

    @web.middleware
    async def _guard(self, request: web.Request, handler: Any) -> web.StreamResponse:
        """Answer only what comes from the page itself."""
        own = [[f'http://{host}'] for host in self._hosts]
        # Browsers name the origin of every WebSocket, but not of every page.
        unnamed: list[list[str]] = [] if 'Upgrade' in request.headers else [[]]
        if request.headers.getall('Host', []) not in [[host] for host in self._hosts]:
            return self._refuse(403, 'a request that names another host')
        if request.headers.getall('Origin', []) not in own + unnamed:
            return self._refuse(403, 'a request of another origin')
        token = request.rel_url.raw_path.lstrip('/').partition('/')[0]
        if not compare_digest(token.encode('utf-8', 'replace'), self._token.encode()):
            return self._refuse(404, 'a request without the token')
        if request.method not in ('GET', 'HEAD'):
            return self._refuse(405, 'a request that is not a GET')
        try:
            response: web.StreamResponse = await handler(request)
        except web.HTTPException:
            return self._refuse(404, 'a request for something that is not here')
        except LinkageError as error:
            return web.Response(status=500, text=f'{error}\n')
        except ConnectionError:  # the page has gone
            raise
        except Exception as error:  # noqa: BLE001 (a page must not end its server)
            defect = defect_error('linkage view', error)
            self._report(str(defect))
            return web.Response(status=500, text=f'{defect}\n')
        return response

    def _refuse(self, status: int, what: str) -> web.Response:
        self.count_refusal(what)
        remedy = 'open the address that linkage view has printed'
        return web.Response(status=status, text=f'linkage view refuses {what}; {remedy}\n')

    async def _add_headers(self, _request: web.Request, response: web.StreamResponse) -> None:
        sockets = ' '.join(f'ws://{host}' for host in self._hosts)
        policy = SERVED_POLICY.replace('ws://127.0.0.1:* ws://localhost:*', sockets)
        policy += "; frame-ancestors 'none'"
        response.headers['Content-Security-Policy'] = policy
        response.headers['X-Content-Type-Options'] = 'nosniff'
        response.headers['X-Frame-Options'] = 'DENY'
        response.headers['Cross-Origin-Resource-Policy'] = 'same-origin'
        response.headers['Referrer-Policy'] = 'no-referrer'
        response.headers['Cache-Control'] = 'no-store'

    async def _answer_page(self, _request: web.Request) -> web.Response:
        page = await asyncio.to_thread(self._page)
        body = page.encode('utf-8', 'backslashreplace')
        return web.Response(body=body, content_type='text/html', charset='utf-8')


SERVER_KEY = web.AppKey('server', Server)
