# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The server of a page: what it refuses, what it survives, and how it ends."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, ExitStack
from itertools import pairwise
import json
import os
from pathlib import Path
import random
import resource
import shutil
import signal
import socket
import subprocess
import sys
from threading import Event
import time
from typing import Any
from urllib.error import HTTPError
from urllib.parse import urlsplit
from urllib.request import urlopen

import aiohttp
from linkage_ros.errors import LinkageError
from linkage_ros.tools.view import (
    bag_page,
    Conversation,
    LARGEST,
    MOST_PAGES,
    Server,
    UserFile,
    Worker,
)
from linkage_ros.tools.view.report import Window
import pytest

from .served import asked, in_loop, opened, Served, served
from ...cli.recorded import Recorded, scene_file
from ...support.commands import environment, linkage
from ...support.sampling import sample_count

FOUR_BAR = """\
# A crank-rocker.
links:
  ground: {O2: [0, 0], O4: [0.100, 0]}
  crank: {O2: [0, 0], A: [0.040, 0]}   # the motor turns it
  coupler: {A: [0, 0], B: [0.120, 0]}
  rocker: {O4: [0, 0], B: [0.080, 0]}
input: {joint: crank_joint, parent: ground, child: crank}
assembly: {B: left}
joints:
  rocker_joint: {parent: ground, child: rocker}
"""
EXAMPLES = Path(__file__).parents[3] / 'examples'
BAD_MESSAGES = {
    '': 'is not JSON',
    '{': 'is not JSON',
    '[' * 100_000: 'is not JSON',
    '{"id": NaN, "do": "names"}': 'is not JSON',
    '{"id": 1, "do": "names", "x": ' + '9' * 10_000 + '}': 'is not JSON',
    '[]': 'is not an object',
    '"names"': 'is not an object',
    '{"do": "names"}': 'has no id',
    '{"id": "1", "do": "names"}': 'has no id',
    '{"id": true, "do": "names"}': 'has no id',
    '{"id": 1e300, "do": "names"}': 'has no id',
    '{"id": 1}': 'asks for None',
    '{"id": 1, "do": "eval"}': "asks for 'eval'",
    '{"id": 1, "do": ["names"]}': "asks for ['names']",
    '{"id": 1, "do": "names", "x": "' + 'x' * LARGEST + '"}': 'is larger than 1000000 bytes',
    '{"id": 1, "x": "' + 'é' * (LARGEST // 2) + '"}': 'is larger than',
}
"""Messages that are no requests, and what is said of them."""

LONGER = {'length': {'link': 'crank', 'from': 'O2', 'to': 'A', 'value': 0.041}}


@pytest.fixture(scope='module')
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the user's file of the module's server."""
    return tmp_path_factory.mktemp('view') / 'mine.yaml'


@pytest.fixture(scope='module')
def one_server(file: Path) -> Iterator[Served]:
    """Give one server to all tests: what one of them does must not harm the next."""
    file.write_text(FOUR_BAR)
    with served([Conversation('mine', None, UserFile(file)).add_routes]) as found:
        yield found


@pytest.fixture
def server(one_server: Served, file: Path) -> Served:
    """Return the server, with the user's file as it was, and nothing counted."""
    file.write_text(FOUR_BAR)
    one_server.server.refused.clear()
    return one_server


# What does not come from the page itself.


HOST = 'Host: 127.0.0.1:{p}'
UPGRADE = (
    'Upgrade: websocket',
    'Connection: Upgrade',
    'Sec-WebSocket-Version: 13',
    'Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==',
)


def test_page_is_served_by_ip_address_and_localhost(
    server: Served,
) -> None:
    for name in ('127.0.0.1', 'localhost'):
        status, answer = asked(server, f'GET /{server.token}/', f'Host: {name}:{server.port}')
        assert status == 200
        assert answer.endswith('<!doctype html>')
    assert not server.server.refused


def test_page_headers_allow_only_its_own_server(server: Served) -> None:
    _, answer = asked(server, f'GET /{server.token}/', HOST.format(p=server.port))
    head = answer.split('\r\n\r\n')[0]
    assert f'connect-src ws://127.0.0.1:{server.port} ws://localhost:{server.port};' in head
    assert "default-src 'none'" in head
    for line in (
        'X-Content-Type-Options: nosniff',
        'X-Frame-Options: DENY',
        'Cross-Origin-Resource-Policy: same-origin',
        'Referrer-Policy: no-referrer',
        'Cache-Control: no-store',
    ):
        assert line in head.splitlines()
    assert 'Access-Control' not in answer


def refused() -> Iterator[tuple[str, Sequence[str], int, str | None]]:
    """Yield requests, their headers, the status of the answer, and what is counted."""
    for path in ('/', '/ws', '/favicon.ico', '/wrong/', '/{cut}x/', '/%00/', '/../{t}/', '//'):
        yield f'GET {path}', [HOST], 404, 'a request without the token'
    yield 'GET /{t}', [HOST], 404, 'a request for something that is not here'
    for path in (
        '../../../../../etc/passwd', '%2e%2e/%2e%2e/%2e%2e/etc/passwd', '/etc/passwd', 'static/',
        '..%2f..%2f..%2fetc%2fpasswd', '..\\..\\etc\\passwd', 'ws/x', 'x' * 5000,
    ):  # fmt: skip
        yield f'GET /{{t}}/{path}', [HOST], 404, None
    for path in ('', 'ws'):
        for host in (
            'example.org', 'example.org:{p}', '127.0.0.1', '127.0.0.1:1', '[::1]:{p}',
            '127.0.0.1:{p}.example.org', '',
        ):  # fmt: skip
            what = 'a request that names another host'
            yield f'GET /{{t}}/{path}', [f'Host: {host}'], 403, what
        yield f'GET /{{t}}/{path}', [], 400, None  # no HTTP/1.1
        for origin in (
            'http://example.org', 'null', 'https://127.0.0.1:{p}', 'http://127.0.0.1:1', '',
        ):  # fmt: skip
            headers = [HOST, f'Origin: {origin}', *(UPGRADE if path else ())]
            yield f'GET /{{t}}/{path}', headers, 403, 'a request of another origin'
    yield 'GET /{t}/ws', [HOST, *UPGRADE], 403, 'a request of another origin'
    for method in ('POST', 'PUT', 'DELETE', 'OPTIONS', 'PATCH'):
        yield f'{method} /{{t}}/', [HOST, 'Content-Length: 0'], 405, 'a request that is not a GET'


@pytest.mark.parametrize(('request_line', 'headers', 'status', 'what'), [*refused()])
def test_foreign_request_is_refused_and_counted(
    server: Served, request_line: str, headers: Sequence[str], status: int, what: str | None
) -> None:
    line, *lines = (
        each.format(t=server.token, cut=server.token[:-1], p=server.port)
        for each in (request_line, *headers)
    )
    found, answer = asked(server, line, *lines)
    assert found == status
    assert '<!doctype' not in answer
    assert 'root:' not in answer
    assert sum(server.server.refused.values()) == (status != 400)
    assert what is None or server.server.refused == {what: 1}


def test_repeated_refusals_are_counted_and_logged_once() -> None:
    with served([]) as server:
        for _ in range(5):
            asked(server, 'GET /', HOST.format(p=server.port))
        assert server.server.refused == {'a request without the token': 5}
        assert server.lines == ['refused a request without the token']


def test_server_listens_on_this_machine_only(server: Served) -> None:
    """Read what the kernel says: addresses in hexadecimal, and 0A for a listening socket."""
    listening = []
    for table in ('tcp', 'tcp6'):
        for line in Path(f'/proc/net/{table}').read_text().splitlines()[1:]:
            _, local, _, state, *_ = line.split()
            address, port = local.rsplit(':', 1)
            if state == '0A' and int(port, 16) == server.port:
                listening.append(address)
    assert listening == ['0100007F']


# Requests.


def ok(answer: dict[str, Any]) -> Any:
    assert 'ok' in answer, answer
    return answer['ok']


def talk(address: str, *requests: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the answers that one page gets, each before its next request."""

    async def run() -> list[dict[str, Any]]:
        async with opened(address) as page:
            return [await page.ask(**request) for request in requests]

    return asyncio.run(run())


def save(text: str, **more: Any) -> dict[str, Any]:
    return {'do': 'save', 'text': text, **more}


EDIT = {'do': 'edit', 'text': FOUR_BAR, 'edit': LONGER}


def test_server_returns_models_of_edited_texts(server: Served) -> None:
    first, second = talk(server.address, {'do': 'model', 'text': FOUR_BAR}, EDIT)
    assert ok(first)['text'] == FOUR_BAR
    assert ok(second)['text'] == FOUR_BAR.replace('0.040', '0.041')


def bad_messages(count: int) -> Iterator[str | bytes]:
    """Yield messages of which none is a request."""
    rng = random.Random(22)
    good = json.dumps({'id': 1, 'do': 'model', 'text': FOUR_BAR, 'whole': False})
    yield from BAD_MESSAGES
    for _ in range(count - len(BAD_MESSAGES)):
        letters = ''.join(chr(rng.randrange(32, 0xD800)) for _ in range(100))
        yield rng.choice((rng.randbytes(100), letters, good[: rng.randrange(len(good))]))


@in_loop
async def test_bad_messages_are_counted_and_the_server_continues(server: Served) -> None:
    count = sample_count(10_000, 1000)
    async with opened(server.address) as page:
        for message in bad_messages(count):
            if isinstance(message, bytes):
                await page.socket.send_bytes(message)
            else:
                await page.socket.send_str(message)
            error = (await page.get())['error']
            assert '\n' not in error['text']
            assert len(error['text']) < 1000
        assert ok(await page.ask('model', text=FOUR_BAR))['text'] == FOUR_BAR
    assert server.server.refused == {'a message that is not a request': count}


@pytest.mark.parametrize(
    'frame',
    [b'\x81\x81\x00\x00\x00\x00\xff', b'\xff' * 20, b'\xc1\x00', b'\x81\x7f' + b'\xff' * 8],
)
@in_loop
async def test_malformed_websocket_frame_closes_only_its_page(
    server: Served, frame: bytes
) -> None:
    async with opened(server.address) as broken, opened(server.address) as page:
        transport = broken.socket._conn.transport  # type: ignore[union-attr]
        transport.write(frame)
        message = await broken.socket.receive(60.0)
        assert message.type in (aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSED)
        ok(await page.ask('names'))


@in_loop
async def test_page_that_never_reads_blocks_no_other(server: Served) -> None:
    # An answer of a megabyte, of which more are asked for than all buffers hold.
    large = {'text': f'{FOUR_BAR}# {"x" * 700_000}\n', 'kind': 'yaml'}
    async with opened(server.address) as deaf, opened(server.address) as page:
        transport = deaf.socket._conn.transport  # type: ignore[union-attr]
        transport.pause_reading()
        sending = asyncio.gather(*(deaf.send('export', **large) for _ in range(17)))
        for _ in range(20):
            ok(await page.ask('export', **large))
        assert await asyncio.wait_for(sending, 60.0)
        transport.abort()
        ok(await page.ask('names'))


@in_loop
async def test_newest_of_waiting_edits_is_answered(server: Served) -> None:
    count = 40
    async with opened(server.address) as page:
        numbers = [await page.send('edit', text=FOUR_BAR, edit=LONGER) for _ in range(count)]
        answers = [await page.get() for _ in numbers]
    assert sorted(answer['id'] for answer in answers) == numbers
    done = [answer['id'] for answer in answers if 'ok' in answer]
    dropped = [answer['id'] for answer in answers if answer.get('dropped')]
    assert sorted(done + dropped) == numbers
    assert numbers[-1] in done
    assert dropped


@in_loop
async def test_fifth_page_is_refused_until_another_closes(
    server: Served,
) -> None:
    pages = [opened(server.address) for _ in range(MOST_PAGES)]
    for page in pages:
        await page.__aenter__()
    async with opened(server.address) as fifth:
        message = await fifth.socket.receive(60.0)
        assert (message.data, message.extra) == (1013, '4 pages are open; close one')
    for page in pages:
        await page.__aexit__(None, None, None)
    async with opened(server.address) as page:
        ok(await page.ask('names'))
    assert server.server.refused == {'a page too many': 1}


@in_loop
async def test_page_closed_during_an_edit_leaves_the_server_running(
    server: Served,
) -> None:
    for _ in range(5):
        async with opened(server.address) as page:
            await page.send('edit', text=FOUR_BAR, edit=LONGER, whole=True)
    async with opened(server.address) as page:
        ok(await page.ask('edit', text=FOUR_BAR, edit=LONGER))
    assert not server.server.refused


@pytest.mark.parametrize(
    ('longest', 'line'),
    [
        (0.001, r'^names: took longer than 0\.001 s; '),
        (60.0, r'^names: ended the process that computes it; '),
    ],
)
@in_loop
async def test_dead_or_slow_worker_process_is_replaced(longest: float, line: str) -> None:
    names = 1, 'names', '{"id": 1, "do": "names"}'
    worker = Worker('mine', None, longest)
    if longest > 1.0:
        await worker.start()
        os.kill(worker.pid, signal.SIGKILL)
    with pytest.raises(LinkageError, match=line):
        await worker.send_request(*names)
    worker.longest = 60.0
    assert 'ok' in json.loads(await worker.send_request(*names))
    await worker.end()


# Saving.


def test_saved_edit_keeps_the_bytes_of_the_text(server: Served, file: Path) -> None:
    longer = FOUR_BAR.replace('0.040', '0.041')
    found = talk(server.address, save(longer))
    assert ok(found[0]) == {'file': 'mine.yaml'}
    assert file.read_text() == longer
    # Windows' line ends and a byte order mark are saved as they are.
    for text in (FOUR_BAR, '\ufeff' + FOUR_BAR.replace('\n', '\r\n')):
        ok(talk(server.address, save(text))[0])
        assert file.read_bytes() == text.encode()
    assert [path.name for path in file.parent.iterdir()] == ['mine.yaml']


@in_loop
async def test_file_changed_by_another_program_is_not_overwritten(
    server: Served, file: Path
) -> None:
    async with opened(server.address) as page:
        ok(await page.ask('names'))
        file.write_text(f'{FOUR_BAR}# by hand\n')
        error = (await page.ask('save', text=FOUR_BAR))['error']['text']
    assert error == (
        'mine.yaml: has changed since this page read it; download this version, or load the '
        'page again to go on from the file'
    )
    assert file.read_text() == f'{FOUR_BAR}# by hand\n'


@in_loop
async def test_second_page_does_not_overwrite_a_saved_file(server: Served, file: Path) -> None:
    async with opened(server.address) as one, opened(server.address) as other:
        ok(await other.ask('names'))
        ok(await one.ask('save', text=f'{FOUR_BAR}# one\n'))
        assert 'error' in await other.ask('save', text=f'{FOUR_BAR}# other\n')
        ok(await one.ask('save', text=f'{FOUR_BAR}# one again\n'))
    assert file.read_text() == f'{FOUR_BAR}# one again\n'


def test_text_that_is_no_linkage_is_not_saved(server: Served, file: Path) -> None:
    texts = ('', 'links: 1', FOUR_BAR.replace('0.100', '1.100'), '\ud800')
    bad = [*map(save, texts), save(FOUR_BAR, name='jansen_leg')]
    assert all('error' in answer for answer in talk(server.address, *bad))
    assert file.read_text() == FOUR_BAR


def test_save_without_an_own_file_suggests_the_download() -> None:
    with served([Conversation('four_bar', None, None).add_routes]) as found:
        (answer,) = talk(found.address, save(FOUR_BAR))
    assert answer['error']['text'] == 'save: no file of yours is open; download the linkage'


# The command.


@contextmanager
def started(
    folder: Path, *arguments: str, files: int = 1024, end: int = signal.SIGINT
) -> Iterator[tuple[subprocess.Popen[str], str, list[str]]]:
    """Run ``linkage view``; give process, address, and at its end what it said; none is left."""
    limits = f'resource.setrlimit(resource.RLIMIT_NOFILE, ({files}, {files}))'
    program = f'import resource, sys; {limits}; from linkage_ros.cli.main import main; '
    process = subprocess.Popen(
        [sys.executable, '-c', f'{program}sys.exit(main())', 'view', *arguments, '--no-browser'],
        cwd=folder,
        env=environment(folder),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    said: list[str] = []
    address = process.stdout.readline().rpartition(' ')[2].strip()
    # Any thread of a process may have started another one.
    tasks = Path(f'/proc/{process.pid}/task').iterdir()
    workers = ' '.join((task / 'children').read_text() for task in tasks).split()
    try:
        yield process, address, said
    finally:
        process.send_signal(end)
        said += process.communicate(timeout=30.0)
    until = time.monotonic() + 30.0
    while any(Path(f'/proc/{worker}').exists() for worker in workers):
        assert time.monotonic() < until
        time.sleep(0.05)


@in_loop
async def test_ctrl_c_notifies_open_pages_and_ends_the_server(tmp_path: Path) -> None:
    (tmp_path / 'mine.yaml').write_text(FOUR_BAR)
    with started(tmp_path, 'mine.yaml', end=0) as (process, address, said):
        async with opened(address) as page, opened(address) as other:
            assert ok(await page.ask('model', text=FOUR_BAR))['name'] == 'mine'
            await other.send('export', kind='gif', text=FOUR_BAR)
            process.send_signal(signal.SIGINT)
            message = await page.socket.receive(60.0)
            assert (message.data, message.extra) == (1001, 'linkage view has ended')
    assert (process.returncode, said) == (0, ['linkage view: ended\n', ''])


@in_loop
async def test_scene_page_receives_sensor_readings(tmp_path: Path) -> None:
    """The scene has an effect of the user's own, from the folder of the command."""
    (tmp_path / 'mine.yaml').write_text(FOUR_BAR)
    (tmp_path / 'scene.yaml').write_text(
        'linkage: mine.yaml\nrate: 60\neffects: {mine.dead_zone: {width: 0.05}}\n'
    )
    shutil.copytree(EXAMPLES / 'mine', tmp_path / 'mine')
    with started(tmp_path, 'scene.yaml', end=signal.SIGKILL) as (_, address, said):
        async with opened(address) as page:
            reads = [
                ok(await page.ask('read', t=n / 60, inputs=[0.02 * n], rates=[1.2]))['read']
                for n in range(60)
            ]
            changes = [b != a for a, b in pairwise(read['rocker_joint'] for read in reads)]
            assert 0 < sum(changes) < len(changes)
            assert ok(await page.ask('save', text=FOUR_BAR)) == {'file': 'mine.yaml'}
    assert said[1] == ''


def test_reloaded_page_shows_the_current_file(tmp_path: Path) -> None:
    file = tmp_path / 'mine.yaml'
    file.write_text(FOUR_BAR)
    with started(tmp_path, 'mine.yaml', end=signal.SIGTERM) as (_, address, said):
        for text, is_longer in (
            (FOUR_BAR, False), (FOUR_BAR.replace('rocker.', 'rocker, longer.'), True),
            ('links: 1', True),
        ):  # fmt: skip
            file.write_text(text)
            with urlopen(address, timeout=60.0) as page:
                assert ('rocker, longer.' in page.read().decode()) == is_longer
    (line,) = said[1].splitlines()
    assert line.startswith('linkage view: mine.yaml:1: links: ')
    assert line.endswith('; the page shows it as it was')


def test_too_many_connections_are_reported_in_one_line(tmp_path: Path) -> None:
    with started(tmp_path, 'four_bar', files=64) as (process, address, said):
        place = urlsplit(address).hostname, urlsplit(address).port
        with ExitStack() as connections:
            for _ in range(100):
                connections.enter_context(socket.create_connection(place, timeout=60.0))
            assert process.stderr is not None
            line = process.stderr.readline()
        with urlopen(address, timeout=60.0) as page:
            assert page.status == 200
    assert line == 'linkage view: refused a connection (Too many open files)\n'
    assert said[1] == ''


@in_loop
async def test_server_ends_silently_after_a_refused_connection() -> None:
    """The event loop listens again 1 s after a refusal, also on a port that is closed by then."""
    lines: list[str] = []
    server = Server(lambda: '', (), lines.append)
    asyncio.get_running_loop().set_exception_handler(server.report_failure)
    await server.start()
    address = urlsplit(server.address)
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with socket.socket() as client:
        try:
            # No file can be opened beside those that are open now.
            resource.setrlimit(resource.RLIMIT_NOFILE, (3, hard))
            client.connect((address.hostname, address.port))
            await asyncio.sleep(0.1)
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    await server.end()
    await asyncio.sleep(1.2)
    assert lines == ['refused a connection (Too many open files)']


def test_view_writes_a_page_to_a_file(tmp_path: Path) -> None:
    (tmp_path / 'mine.yaml').write_text(FOUR_BAR)
    answer = linkage(tmp_path, 'view', 'mine.yaml', '-o', 'page.html')
    assert (answer.returncode, answer.stderr) == (0, '')
    assert answer.stdout.startswith('page.html: ')
    page = (tmp_path / 'page.html').read_text('utf-8')
    assert '"mode":"still"' in page
    assert 'http-equiv="Content-Security-Policy"' in page


def test_view_of_a_bag_is_its_report(tmp_path: Path) -> None:
    scene = scene_file(tmp_path, 'rate: 100\n')
    Recorded(tmp_path / 'bag', scene, lambda tick: {'crank_joint': (0.01 * tick, 1.0)}).run(50)
    expected = bag_page(tmp_path / 'bag', Window(), Event()).encode()
    answer = linkage(tmp_path, 'view', 'bag', '-o', 'view.html')
    assert (answer.returncode, answer.stderr) == (0, '')
    assert (tmp_path / 'view.html').read_bytes() == expected
    with started(tmp_path, 'bag') as (_, address, _):
        with urlopen(address, timeout=60.0) as page:
            assert page.read() == expected
        with pytest.raises(HTTPError, match='404'):
            urlopen(f'{address}ws', timeout=60.0)


@pytest.mark.parametrize(
    ('arguments', 'line'),
    [
        (['none.yaml'], 'none.yaml: cannot be read (No such file or directory); '),
        (['jansen_legs'], 'jansen_legs: is neither a file nor the name of a shipped '),
        (['bad.yaml'], 'bad.yaml:1: links: 1 is not a mapping; '),
        ([], 'FILE: is missing; name a linkage, a scene or a bag, or --node'),
        (['four_bar', '--port', '70000'], '--port 70000: is not a port; name one below 65536'),
        (['four_bar', '--port', '{taken}'], '--port {taken}: is taken; name another one, or '),
        (['four_bar', '--node', 'x'], '--node: shows a node, not a file; leave four_bar out'),
        (['--node', '-o', 'x.html'], '-o: cannot hold a node that runs; leave it out'),
        (['four_bar', '-o', 'no/x.html'], 'no/x.html: there is no folder no; '),
    ],
)
def test_view_refuses_wrong_files_and_arguments_in_one_line(
    server: Served, tmp_path: Path, arguments: list[str], line: str
) -> None:
    (tmp_path / 'bad.yaml').write_text('links: 1\n')
    taken = str(server.port)
    typed = [argument.replace('{taken}', taken) for argument in arguments]
    answer = linkage(tmp_path, 'view', '--no-browser', *typed)
    assert (answer.returncode, answer.stdout) == (2, '')
    (told,) = answer.stderr.splitlines()
    assert told.startswith(f'linkage view: {line.replace("{taken}", taken)}')
