# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Work in parts on the workers of a Dask scheduler.

Dask itself repeats the work of a worker that died. Any other failure ends in one error.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import CancelledError, FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from importlib import import_module
from itertools import islice
from logging import CRITICAL, getLogger
from pkgutil import resolve_name
from typing import Any, TypeVar

import linkage_ros
from linkage_ros.errors import check_installed, LinkageError

Part = TypeVar('Part')
Result = TypeVar('Result')

_AHEAD = 3
"""Tasks in progress for each thread of the workers: no thread waits, and no queue grows."""

_PATIENCE = 10.0
"""Seconds to wait for the answer of a scheduler, and between two checks of workers that return
nothing."""


def import_distributed() -> Any:
    """Return dask.distributed, for studies on several machines."""
    check_installed('distributed', "pip install 'linkage_ros[dask]'")
    return import_module('distributed')


def results_of(
    work: Callable[[Part], Result], parts: Callable[[int], Iterator[Part]], address: str
) -> Generator[tuple[Part, Result], None, None]:
    """
    Yield parts and their results, in the order in which they arrive.

    ``work`` is sent to the workers by pickle; ``parts`` takes the number of their threads and
    yields parts on demand. A LinkageError says that the scheduler or its workers failed; errors of
    the work are raised unchanged.
    """
    with _connect_client(address) as client:
        _check_workers(address, client)
        waiting = parts(_thread_count(address, client))
        loop = client.loop.asyncio_loop
        running: dict[Future[Result], Part] = {}
        while True:
            room = _AHEAD * _thread_count(address, client) - len(running)
            for part in islice(waiting, max(room, 0)):
                task = client.submit(work, part, pure=False)
                # A future of the standard library: a wait for it can be cancelled. Those of
                # Client.get_executor() end in a TypeError if a worker was lost.
                result = client.gather(task, asynchronous=True)
                running[asyncio.run_coroutine_threadsafe(result, loop)] = part
            if not running:
                return
            for future in wait(running, _PATIENCE, FIRST_COMPLETED).done:
                yield running.pop(future), _future_result(address, future)


@contextmanager
def _connect_client(address: str) -> Iterator[Any]:
    dask = import_distributed()
    # Its log of a lost connection, with traceback, becomes an error here.
    log = getLogger('distributed.client')
    level = log.level
    log.setLevel(CRITICAL)
    try:
        _check_scheduler(address)
        with dask.Client(address, timeout=_PATIENCE, set_as_default=False) as client:
            yield client
    finally:
        log.setLevel(level)


def _check_scheduler(address: str) -> None:
    """Refuse an address without a scheduler; a client would wait for a silent one."""
    dask = import_distributed()

    async def identity() -> Any:
        secrets = dask.Security().get_connection_args('client')
        async with dask.rpc(address, timeout=_PATIENCE, connection_args=secrets) as server:
            # Longer than the connection timeout, to tell a closed port from a silent server.
            return await asyncio.wait_for(server.identity(), 1.5 * _PATIENCE)

    try:
        # In a separate thread: the caller may have a running event loop.
        with ThreadPoolExecutor(1) as thread:
            identified = thread.submit(asyncio.run, identity()).result()
    # An address without host or port, or of an unknown kind, raises one of these errors.
    except (OSError, asyncio.TimeoutError, ValueError, TypeError, AssertionError) as error:
        raise LinkageError(
            address,
            f'no Dask scheduler answers here ({str(error) or "it is silent"})',
            'start one by `dask scheduler`, and give the address that it prints',
        ) from error
    if identified['type'] != 'Scheduler':
        raise LinkageError(
            address, f'is a Dask {identified["type"]}', 'give the address of the scheduler'
        )


def _check_workers(address: str, client: Any) -> None:
    """Refuse workers without this package or with another version."""
    try:
        client.wait_for_workers(1, timeout=_PATIENCE)
    except asyncio.TimeoutError:
        raise _no_workers(address) from None
    name = linkage_ros.__name__
    versions = client.run(resolve_name, f'{name}:__version__', on_error='return')
    for worker, version in versions.items():
        if isinstance(version, ImportError):
            raise _not_importable(worker, version)
        if isinstance(version, str) and version != linkage_ros.__version__:
            raise LinkageError(
                worker,
                f'this worker has {name} {version}, and here is {linkage_ros.__version__}',
                'install the same on all, so that they find the same',
            )


def _thread_count(address: str, client: Any) -> int:
    try:
        threads = sum(client.nthreads().values())
    except OSError as error:
        raise _lost_error(address) from error
    if not threads:
        raise _no_workers(address)
    return int(threads)


def _future_result(address: str, future: Future[Result]) -> Result:
    try:
        return future.result()
    except ImportError as error:
        raise _not_importable('Dask workers', error) from error
    except import_distributed().KilledWorker as error:
        raise LinkageError(
            address,
            f'{error.allowed_failures + 1} workers died one after another at the same task',
            'read their logs: memory is the usual reason',
        ) from error
    except (CancelledError, import_distributed().comm.CommClosedError) as error:
        raise _lost_error(address) from error


def _not_importable(where: str, error: ImportError) -> LinkageError:
    return LinkageError(
        where, f'cannot import {error.name}', 'install the same on all workers as here'
    )


def _no_workers(address: str) -> LinkageError:
    return LinkageError(address, 'the scheduler has no workers', f'start `dask worker {address}`')


def _lost_error(address: str) -> LinkageError:
    return LinkageError(address, 'the scheduler was lost', 'start it again, and then the study')
