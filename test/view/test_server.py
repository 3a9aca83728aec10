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
from collections.abc import Iterator
from contextlib import ExitStack
from itertools import pairwise
import json
import os
from pathlib import Path
import random
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
from linkage_ros.tools.view import bag_page, Conversation, LARGEST, MOST_PAGES, UserFile, Worker
from linkage_ros.tools.view.report import Window
import pytest

from .served import asked, opened, Page, Served, served
from ..cli.recorded import Recorded, scene_file
from ..support.commands import environment, linkage

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
EXAMPLES = Path(__file__).parents[2] / 'examples'
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


def own(server: Served) -> str:
    return f'Host: 127.0.0.1:{server.port}'


UPGRADE = (
    'Upgrade: websocket',
    'Connection: Upgrade',
    'Sec-WebSocket-Version: 13',
    'Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==',
)


def test_the_page_is_answered_at_its_address_by_either_name_of_this_machine(
    server: Served,
) -> None:
    for name in ('127.0.0.1', 'localhost'):
        status, answer = asked(server, f'GET /{server.token}/', f'Host: {name}:{server.port}')
        assert status == 200
        assert answer.endswith('<!doctype html>')
    assert not server.server.refused


def test_a_page_may_load_and_reach_nothing_but_its_own_server(server: Served) -> None:
    _, answer = asked(server, f'GET /{server.token}/', own(server))
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


@pytest.mark.parametrize(
    'path',
    ['/', '/ws', '/favicon.ico', '/wrong/', '/{t}x/', '/{t}', '/%00/', '/../{t}/', '//'],
)
def test_without_the_token_nothing_is_there(server: Served, path: str) -> None:
    path = path.replace('{t}', server.token if path != '/{t}x/' else server.token[:-1])
    status, answer = asked(server, f'GET {path}', own(server))
    assert status == 404
    assert '<!doctype' not in answer
    known = 'a request for something that is not here'
    unknown = 'a request without the token'
    assert server.server.refused == {known if path == f'/{server.token}' else unknown: 1}


@pytest.mark.parametrize(
    'path',
    [
        '../../../../../etc/passwd',
        '%2e%2e/%2e%2e/%2e%2e/etc/passwd',
        '..%2f..%2f..%2fetc%2fpasswd',
        '..\\..\\etc\\passwd',
        '/etc/passwd',
        'static/',
        'ws/x',
        'x' * 5000,
    ],
)
def test_no_path_leads_to_a_file(server: Served, path: str) -> None:
    status, answer = asked(server, f'GET /{server.token}/{path}', own(server))
    assert status == 404
    assert 'root:' not in answer
    assert sum(server.server.refused.values()) == 1


@pytest.mark.parametrize(
    'headers',
    [
        ['Host: example.org'],
        ['Host: example.org:{p}'],
        ['Host: 127.0.0.1'],
        ['Host: 127.0.0.1:1'],
        ['Host: [::1]:{p}'],
        ['Host: 127.0.0.1:{p}.example.org'],
        ['Host:'],
        [],
    ],
)
def test_another_host_is_refused(server: Served, headers: list[str]) -> None:
    named = [header.replace('{p}', str(server.port)) for header in headers]
    for path in ('', 'ws'):
        status, _ = asked(server, f'GET /{server.token}/{path}', *named)
        # Without any, it is no HTTP/1.1.
        assert status == (403 if headers else 400)
    assert not headers or server.server.refused == {'a request that names another host': 2}


@pytest.mark.parametrize(
    'origin', ['http://example.org', 'null', 'https://127.0.0.1:{p}', 'http://127.0.0.1:1', '']
)
def test_another_origin_is_refused(server: Served, origin: str) -> None:
    header = f'Origin: {origin.replace("{p}", str(server.port))}'
    page = asked(server, f'GET /{server.token}/', own(server), header)
    asking = asked(server, f'GET /{server.token}/ws', own(server), header, *UPGRADE)
    assert (page[0], asking[0]) == (403, 403)
    assert server.server.refused == {'a request of another origin': 2}


def test_a_socket_without_an_origin_is_refused(server: Served) -> None:
    status, _ = asked(server, f'GET /{server.token}/ws', own(server), *UPGRADE)
    assert status == 403


@pytest.mark.parametrize('method', ['POST', 'PUT', 'DELETE', 'OPTIONS', 'PATCH'])
def test_nothing_can_be_sent_to_a_path(server: Served, method: str) -> None:
    status, _ = asked(server, f'{method} /{server.token}/', own(server), 'Content-Length: 0')
    assert status == 405


def test_what_is_refused_is_counted_each_time_and_said_once() -> None:
    with served([]) as server:
        for _ in range(5):
            asked(server, 'GET /', own(server))
        assert server.server.refused == {'a request without the token': 5}
        assert server.lines == ['refused a request without the token']


def test_it_listens_on_this_machine_only(server: Served) -> None:
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


def test_a_page_gets_models_of_texts_that_it_edits(server: Served) -> None:
    async def run() -> None:
        async with opened(server.address) as page:
            first = ok(await page.ask('model', text=FOUR_BAR))
            assert first['text'] == FOUR_BAR
            second = ok(await page.ask('edit', text=FOUR_BAR, edit=LONGER))
            assert second['text'] == FOUR_BAR.replace('0.040', '0.041')

    asyncio.run(run())


def bad_messages(count: int) -> Iterator[str | bytes]:
    """Yield messages of which none is a request."""
    rng = random.Random(22)
    good = {'id': 1, 'do': 'model', 'text': FOUR_BAR, 'whole': False}
    written = json.dumps(good)
    for index in range(count):
        match index % 10:
            case 0:
                yield rng.randbytes(rng.randrange(200))
            case 1:
                yield written[: rng.randrange(len(written))]
            case 2:
                yield written.replace(
                    '1', rng.choice(('NaN', '-Infinity', '1e999', '9' * 5000)), 1
                )
            case 3:
                yield rng.choice('[{') * rng.randrange(1, 50_000)
            case 4:
                yield '{"id": 1, "do": ' * 5000 + '1' + '}' * 5000
            case 5:
                yield json.dumps(good | {'do': rng.choice(('', 'eval', '__init__', None, [], {}))})
            case 6:
                yield json.dumps(good | {'id': rng.choice(('1', None, [], True, 2**70))})
            case 7:
                yield json.dumps(rng.choice(([], 'model', 1, None, True, [good])))
            case 8:
                yield ''.join(chr(rng.randrange(32, 0xD800)) for _ in range(100))
            case _:
                yield json.dumps(
                    {key: good[key] for key in rng.sample(sorted(good), 2)} | {'id': {}}
                )


def test_ten_thousand_bad_messages_are_counted_and_the_next_good_one_is_answered(
    server: Served,
) -> None:
    count = 10_000

    async def run() -> None:
        async with opened(server.address) as page:

            async def send() -> None:
                for message in bad_messages(count):
                    if isinstance(message, bytes):
                        await page.socket.send_bytes(message)
                    else:
                        await page.socket.send_str(message)
                await page.socket.send_str(' ' * (LARGEST + 1))

            sending = asyncio.create_task(send())
            for _ in range(count + 1):
                error = (await page.get())['error']
                assert '\n' not in error['text']
                assert len(error['text']) < 1000
            await sending
            assert ok(await page.ask('model', text=FOUR_BAR))['text'] == FOUR_BAR

    asyncio.run(run())
    assert server.server.refused == {'a message that is not a request': count + 1}


@pytest.mark.parametrize(
    'frame',
    [b'\x81\x81\x00\x00\x00\x00\xff', b'\xff' * 20, b'\xc1\x00', b'\x81\x7f' + b'\xff' * 8],
)
def test_bytes_that_are_no_messages_end_their_page_alone(server: Served, frame: bytes) -> None:
    async def run() -> None:
        async with opened(server.address) as broken, opened(server.address) as page:
            transport = broken.socket._conn.transport  # type: ignore[union-attr]
            transport.write(frame)
            message = await broken.socket.receive(60.0)
            assert message.type in (aiohttp.WSMsgType.CLOSE, aiohttp.WSMsgType.CLOSED)
            ok(await page.ask('names'))

    asyncio.run(run())


def test_a_page_that_never_reads_holds_up_no_other(server: Served) -> None:
    # An answer of a megabyte, of which more are asked for than all buffers hold.
    large = {'text': f'{FOUR_BAR}# {"x" * 700_000}\n', 'kind': 'yaml'}

    async def run() -> None:
        async with opened(server.address) as deaf, opened(server.address) as page:
            transport = deaf.socket._conn.transport  # type: ignore[union-attr]
            transport.pause_reading()
            sending = asyncio.gather(*(deaf.send('export', **large) for _ in range(17)))
            for _ in range(20):
                ok(await page.ask('export', **large))
            assert await asyncio.wait_for(sending, 60.0)
            transport.abort()
            ok(await page.ask('names'))

    asyncio.run(run())


def test_of_edits_that_wait_the_newest_is_answered(server: Served) -> None:
    count = 40

    async def run() -> None:
        async with opened(server.address) as page:
            numbers = [await page.send('edit', text=FOUR_BAR, edit=LONGER) for _ in range(count)]
            answers = [await page.get() for _ in numbers]
        assert sorted(answer['id'] for answer in answers) == numbers
        done = [answer['id'] for answer in answers if 'ok' in answer]
        dropped = [answer['id'] for answer in answers if answer.get('dropped')]
        assert sorted(done + dropped) == numbers
        assert numbers[-1] in done
        assert dropped

    asyncio.run(run())


def test_a_page_beyond_the_last_is_refused_with_a_word_until_another_closes(
    server: Served,
) -> None:
    async def run() -> None:
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

    asyncio.run(run())
    assert server.server.refused == {'a page too many': 1}


def test_a_page_that_closes_in_the_middle_of_an_edit_leaves_the_server_at_work(
    server: Served,
) -> None:
    async def run() -> None:
        for _ in range(5):
            async with opened(server.address) as page:
                await page.send('edit', text=FOUR_BAR, edit=LONGER, whole=True)
        async with opened(server.address) as page:
            ok(await page.ask('edit', text=FOUR_BAR, edit=LONGER))

    asyncio.run(run())
    assert not server.server.refused


def test_a_request_that_takes_too_long_ends_with_one_line_and_the_next_is_answered() -> None:
    async def run() -> None:
        worker = Worker('mine', None, 0.001)
        with pytest.raises(LinkageError, match=r'^names: took longer than 0\.001 s; '):
            await worker.send_request(1, 'names', '{"id": 1, "do": "names"}')
        worker.longest = 60.0
        assert 'ok' in json.loads(
            await worker.send_request(1, 'names', '{"id": 1, "do": "names"}')
        )
        await worker.end()

    asyncio.run(run())


def test_a_process_that_dies_is_said_and_replaced() -> None:
    async def run() -> None:
        worker = Worker('mine', None, 60.0)
        await worker.start()
        os.kill(worker.pid, signal.SIGKILL)
        with pytest.raises(LinkageError, match=r'^names: ended the process that computes it; '):
            await worker.send_request(1, 'names', '{"id": 1, "do": "names"}')
        assert 'ok' in json.loads(
            await worker.send_request(1, 'names', '{"id": 1, "do": "names"}')
        )
        await worker.end()

    asyncio.run(run())


# Saving.


async def edited(page: Page, text: str, edit: dict[str, Any]) -> str:
    return str(ok(await page.ask('edit', text=text, edit=edit))['text'])


def test_an_edit_is_saved_and_undone_to_the_same_bytes(server: Served, file: Path) -> None:
    async def run() -> None:
        async with opened(server.address) as page:
            longer = await edited(page, FOUR_BAR, LONGER)
            assert ok(await page.ask('save', text=longer)) == {'file': 'mine.yaml'}
            assert file.read_text() == FOUR_BAR.replace('0.040', '0.041')
            ok(await page.ask('save', text=FOUR_BAR))
            assert file.read_bytes() == FOUR_BAR.encode()
        assert [path.name for path in file.parent.iterdir()] == ['mine.yaml']

    asyncio.run(run())


def test_windows_line_ends_and_a_byte_order_mark_are_saved_as_they_were(
    server: Served, file: Path
) -> None:
    written = '\ufeff' + FOUR_BAR.replace('\n', '\r\n')
    file.write_bytes(written.encode())

    async def run() -> None:
        async with opened(server.address) as page:
            ok(await page.ask('save', text=written))

    asyncio.run(run())
    assert file.read_bytes() == written.encode()


def test_a_file_that_was_changed_by_another_program_is_not_overwritten(
    server: Served, file: Path
) -> None:
    async def run() -> None:
        async with opened(server.address) as page:
            ok(await page.ask('names'))
            file.write_text(f'{FOUR_BAR}# by hand\n')
            error = (await page.ask('save', text=FOUR_BAR))['error']['text']
        assert error == (
            'mine.yaml: has changed since this page read it; download this version, or load the '
            'page again to go on from the file'
        )

    asyncio.run(run())
    assert file.read_text() == f'{FOUR_BAR}# by hand\n'


def test_of_two_pages_the_second_does_not_overwrite_what_the_first_saved(
    server: Served, file: Path
) -> None:
    async def run() -> None:
        async with opened(server.address) as one, opened(server.address) as other:
            ok(await other.ask('names'))
            ok(await one.ask('save', text=f'{FOUR_BAR}# one\n'))
            assert 'error' in await other.ask('save', text=f'{FOUR_BAR}# other\n')
            ok(await one.ask('save', text=f'{FOUR_BAR}# one again\n'))

    asyncio.run(run())
    assert file.read_text() == f'{FOUR_BAR}# one again\n'


def test_a_text_that_is_no_linkage_is_not_saved(server: Served, file: Path) -> None:
    async def run() -> None:
        async with opened(server.address) as page:
            for text in ('', 'links: 1', FOUR_BAR.replace('0.100', '1.100'), '\ud800'):
                assert 'error' in await page.ask('save', text=text)
            assert 'error' in await page.ask('save', text=FOUR_BAR, name='jansen_leg')

    asyncio.run(run())
    assert file.read_text() == FOUR_BAR


def test_a_shipped_linkage_is_not_saved_and_the_error_says_what_to_do() -> None:
    async def run(address: str) -> None:
        async with opened(address) as page:
            error = (await page.ask('save', text=FOUR_BAR))['error']['text']
            assert error == 'save: no file of yours is open; download the linkage'

    with served([Conversation('four_bar', None, None).add_routes]) as found:
        asyncio.run(run(found.address))


# The command.


def start(folder: Path, *arguments: str, files: int = 1024) -> tuple[subprocess.Popen[str], str]:
    """Start ``linkage view``, and return its process and its address."""
    limited = (
        f'import resource, sys; resource.setrlimit(resource.RLIMIT_NOFILE, ({files}, {files}))'
    )
    process = subprocess.Popen(
        [
            *(
                sys.executable,
                '-c',
                f'{limited}; from linkage_ros.cli.main import main; sys.exit(main())',
            ),
            *('view', *arguments, '--no-browser'),
        ],
        cwd=folder,
        env=environment(folder),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    return process, process.stdout.readline().rpartition(' ')[2].strip()


def children(pid: int) -> set[int]:
    """Return the processes that any thread of a process has started."""
    tasks = Path(f'/proc/{pid}/task').iterdir()
    return {int(child) for task in tasks for child in (task / 'children').read_text().split()}


def test_ctrl_c_tells_the_open_pages_and_ends_the_command_well(tmp_path: Path) -> None:
    (tmp_path / 'mine.yaml').write_text(FOUR_BAR)
    process, address = start(tmp_path, 'mine.yaml')

    async def run() -> None:
        async with opened(address) as page, opened(address) as other:
            assert ok(await page.ask('model', text=FOUR_BAR))['name'] == 'mine'
            await other.send('export', kind='gif', text=FOUR_BAR)
            process.send_signal(signal.SIGINT)
            message = await page.socket.receive(60.0)
            assert (message.data, message.extra) == (1001, 'linkage view has ended')

    workers = children(process.pid)
    asyncio.run(run())
    out, err = process.communicate(timeout=30.0)
    assert (process.returncode, out, err) == (0, 'linkage view: ended\n', '')
    assert workers
    assert not any(Path(f'/proc/{worker}').exists() for worker in workers)


def test_of_a_scene_a_page_gets_what_its_sensors_read(tmp_path: Path) -> None:
    """The scene has an effect of the user's own, from the folder of the command."""
    (tmp_path / 'mine.yaml').write_text(FOUR_BAR)
    (tmp_path / 'scene.yaml').write_text(
        'linkage: mine.yaml\nrate: 60\neffects: {mine.dead_zone: {width: 0.05}}\n'
    )
    shutil.copytree(EXAMPLES / 'mine', tmp_path / 'mine')
    process, address = start(tmp_path, 'scene.yaml')

    async def run() -> None:
        async with opened(address) as page:
            reads = [
                ok(await page.ask('read', t=n / 60, inputs=[0.02 * n], rates=[1.2]))['read']
                for n in range(60)
            ]
            changes = [b != a for a, b in pairwise(read['rocker_joint'] for read in reads)]
            assert 0 < sum(changes) < len(changes)
            assert ok(await page.ask('save', text=FOUR_BAR)) == {'file': 'mine.yaml'}

    try:
        asyncio.run(run())
    finally:
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=30.0)[1] == ''


def test_a_server_that_is_killed_leaves_no_process(tmp_path: Path) -> None:
    process, _ = start(tmp_path, 'four_bar')
    workers = children(process.pid)
    assert workers
    process.kill()
    process.communicate(timeout=30.0)
    until = time.monotonic() + 30.0
    while any(Path(f'/proc/{worker}').exists() for worker in workers):
        assert time.monotonic() < until
        time.sleep(0.05)


def test_a_page_that_is_loaded_again_shows_the_file_as_it_is_now(tmp_path: Path) -> None:
    file = tmp_path / 'mine.yaml'
    file.write_text(FOUR_BAR)
    process, address = start(tmp_path, 'mine.yaml')

    async def run() -> None:
        async with aiohttp.ClientSession() as session:
            pages = []
            for text in (FOUR_BAR, FOUR_BAR.replace('rocker.', 'rocker, longer.'), 'links: 1'):
                file.write_text(text)
                async with session.get(address) as answer:
                    pages.append(await answer.text())
        assert ['rocker, longer.' in page for page in pages] == [False, True, True]

    try:
        asyncio.run(run())
    finally:
        process.send_signal(signal.SIGTERM)
        _, err = process.communicate(timeout=30.0)
    assert len(err.splitlines()) == 1, err
    (line,) = err.splitlines()
    assert line.startswith('linkage view: mine.yaml:1: links: ')
    assert line.endswith('; the page shows it as it was')


def test_more_connections_than_files_are_said_in_one_line_and_survived(tmp_path: Path) -> None:
    process, address = start(tmp_path, 'four_bar', files=64)
    parts = urlsplit(address)
    try:
        with ExitStack() as connections:
            for _ in range(100):
                place = parts.hostname, parts.port
                connections.enter_context(socket.create_connection(place, timeout=60.0))
            assert process.stderr is not None
            line = process.stderr.readline()
        with urlopen(address, timeout=60.0) as page:
            assert page.status == 200
    finally:
        process.send_signal(signal.SIGINT)
        _, rest = process.communicate(timeout=30.0)
    assert (line, rest) == ('linkage view: refused a connection (Too many open files)\n', '')


def test_a_page_is_written_to_a_file(tmp_path: Path) -> None:
    (tmp_path / 'mine.yaml').write_text(FOUR_BAR)
    answer = linkage(tmp_path, 'view', 'mine.yaml', '-o', 'page.html')
    assert (answer.returncode, answer.stderr) == (0, '')
    assert answer.stdout.startswith('page.html: ')
    page = (tmp_path / 'page.html').read_text('utf-8')
    assert '"mode":"still"' in page
    assert 'http-equiv="Content-Security-Policy"' in page


def test_of_a_bag_the_page_is_its_report(tmp_path: Path) -> None:
    scene = scene_file(tmp_path, 'rate: 100\n')
    Recorded(tmp_path / 'bag', scene, lambda tick: {'crank_joint': (0.01 * tick, 1.0)}).run(50)
    expected = bag_page(tmp_path / 'bag', Window(), Event()).encode()
    answer = linkage(tmp_path, 'view', 'bag', '-o', 'view.html')
    assert (answer.returncode, answer.stderr) == (0, '')
    assert (tmp_path / 'view.html').read_bytes() == expected
    process, address = start(tmp_path, 'bag')
    try:
        with urlopen(address, timeout=60.0) as page:
            assert page.read() == expected
        with pytest.raises(HTTPError, match='404'):
            urlopen(f'{address}ws', timeout=60.0)
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=30.0)


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
def test_what_cannot_be_shown_is_told_in_one_line(
    server: Served, tmp_path: Path, arguments: list[str], line: str
) -> None:
    (tmp_path / 'bad.yaml').write_text('links: 1\n')
    taken = str(server.port)
    typed = [argument.replace('{taken}', taken) for argument in arguments]
    answer = linkage(tmp_path, 'view', '--no-browser', *typed)
    assert (answer.returncode, answer.stdout) == (2, '')
    (told,) = answer.stderr.splitlines()
    assert told.startswith(f'linkage view: {line.replace("{taken}", taken)}')
