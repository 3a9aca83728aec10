# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The processes of the campaigns: a command, a forked recording, a node that records."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
import io
import json
import os
from pathlib import Path
import resource
import signal
import socket
import subprocess
import sys
import tempfile
import time
import traceback
from typing import Any, NamedTuple
from unittest import mock

from bench.processes import Graph, Process
from linkage_ros.bag import METADATA_FILE
from linkage_ros.cli import main as command_line
from linkage_ros.domains import private_domain
from linkage_ros.signals import Stop

MEMORY = 2**32
"""Limit of the address space of a process, in bytes; numpy and matplotlib take 1.5 GiB."""

LINKAGE = (sys.executable, '-m', 'linkage_ros.cli.main')
"""The command line of ``linkage`` in a process of its own."""

_START = 30.0
"""Time limit for the beginning of a recording [s]."""


class _TooLongError(BaseException):
    """No subclass of `Exception`, so that no command catches it."""


class Ended(NamedTuple):
    """The end of a command."""

    code: Any  # Its exit code, 'no end' or 'traceback'
    # Its standard error; without an exit code, the time limit or the exception, and its place.
    stderr: str
    stdout: str = ''  # Its standard output


def in_process(arguments: Sequence[str], seconds: float) -> Ended:
    """Run ``linkage`` in this process, with a time limit in [s]; starting Python takes longer."""
    stdout, stderr = io.StringIO(), io.StringIO()
    try:
        with redirect_stdout(stdout), redirect_stderr(stderr), _bounded(seconds):
            return Ended(command_line.main([*arguments]), stderr.getvalue(), stdout.getvalue())
    except _TooLongError:
        late = f'more than {seconds} s ({_place(traceback.format_exc())})'
        return Ended('no end', late, stdout.getvalue())
    except SystemExit as stopped:
        return Ended(stopped.code, stderr.getvalue(), stdout.getvalue())
    except Exception:  # noqa: BLE001 - a user would see any exception
        return Ended('traceback', _place(traceback.format_exc()), stdout.getvalue())


@contextmanager
def confined() -> Iterator[Path]:
    """Work in a new folder, which is removed afterwards, and within `MEMORY`."""
    before = Path.cwd()
    most, hard = resource.getrlimit(resource.RLIMIT_AS)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, hard))
        try:
            yield Path(folder)
        finally:
            resource.setrlimit(resource.RLIMIT_AS, (most, hard))
            os.chdir(before)


def _place(text: str) -> str:
    """Return the last line of a traceback, with the last place in linkage_ros."""
    lines = text.strip().splitlines()
    ours = [line.strip() for line in lines if 'linkage_ros/' in line and 'File' in line]
    place = ours[-1].rpartition('linkage_ros/')[2] if ours else ''
    return f'{lines[-1]} ({place.replace(chr(34), "")})'


@contextmanager
def _bounded(seconds: float) -> Iterator[None]:
    def stop(_number: int, _frame: Any) -> None:
        raise _TooLongError

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        # The command must not install its signal handlers: a pool ends its processes by signals.
        with mock.patch.object(command_line, 'stop_on_signals', Stop):
            yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def in_own_process(arguments: Sequence[str], seconds: float, **environment: str) -> Ended:
    """Run ``linkage`` in a process of its own, with a time limit in [s]."""
    try:
        ended = subprocess.run(
            [*LINKAGE, *arguments],
            env=os.environ | environment,
            capture_output=True,
            text=True,
            timeout=seconds,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return Ended('no end', f'more than {seconds} s')
    return Ended(ended.returncode, ended.stderr, ended.stdout)


@contextmanager
def forked(do: Callable[[socket.socket], object]) -> Iterator[tuple[int, socket.socket]]:
    """
    Run a function in a forked process, which is killed at the end of the with statement.

    The function gets a socket to this process, which gets the process id and the other end. The
    process ends without running inherited handlers.
    """
    ours, theirs = socket.socketpair()
    process = os.fork()
    if not process:
        try:
            ours.close()
            do(theirs)
        except BaseException:  # noqa: BLE001 - the only way to tell of it
            traceback.print_exc()
        finally:
            os._exit(0)
    theirs.close()
    try:
        yield process, ours
    finally:
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)
        ours.close()


@contextmanager
def recording_node(
    work: Path,
    bag: Path,
    longest: float,
    scene: str,
    settings: Sequence[str],
    record: str,
    slowed_by: Sequence[str] = (),
) -> Iterator[tuple[Graph, Process]]:
    """
    Run a node with a scene and settings, on a graph of its own, from its recording on.

    The folder ``work`` gets its log, ``longest`` is in [s], ``record`` are more keys of the
    recording. ``slowed_by`` is another module that runs the node, and its arguments.
    """
    recording = f'record={{directory: {bag.parent}, name: {bag.name}, {record}}}'
    given = '-p', f'scene:={scene}', '-p', f'set:={json.dumps([*settings, recording])}'
    # Below 102, so that the ports stay below the kernel's ephemeral ones.
    graph = Graph(private_domain(), work, longest=round(longest))
    module, *arguments = slowed_by or ('linkage_ros.node.linkage_node',)
    with graph.run_module(module, [*arguments, '--ros-args', *given]) as node:
        until = time.monotonic() + _START
        while not (bag / METADATA_FILE).exists() and time.monotonic() < until:
            node.check_running()
            time.sleep(0.05)
        yield graph, node
