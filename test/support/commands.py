# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
``linkage`` in processes that start at once.

Most of the time of a command goes into imports. One server process for each worker of the tests
imports what commands need, and forks a child for each command. The child has its own
arguments, folder, environment and output, and ends as any process does, but for the modules: to
take them apart takes longer than most commands. A test of imports, of signals or of limits needs a
Python of its own, by `subprocess`.
"""

from __future__ import annotations

import atexit
from contextlib import suppress
from functools import cache
import gc
from importlib import import_module
import json
import os
from pathlib import Path
from pkgutil import walk_packages
import signal
import socket
import struct
import subprocess
import sys
from tempfile import TemporaryFile
import time
from typing import NoReturn

import linkage_ros
from linkage_ros.cli.main import main
from linkage_ros.domains import private_domain

# What commands import only where they need it.
LIBRARIES = (
    'matplotlib.backends.backend_agg',
    'matplotlib.backends.backend_svg',
    'matplotlib.figure',
    'plotly.graph_objects',
    'rich.console',
    'rosbags.highlevel',
)

# Their import starts threads, which a child would lack: each imports them for itself.
THREADED = ('pyarrow', 'rclpy')

_NUMBER = struct.Struct('i')


def environment(folder: Path) -> dict[str, str]:
    """Return what a process of the tests sees; `linkage demo` chooses its own ROS domain."""
    return os.environ | {
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_DOMAIN_ID': str(private_domain()),
        'ROS_LOG_DIR': str(folder),
        'RCUTILS_COLORIZED_OUTPUT': '0',
    }


def linkage(
    folder: Path, *arguments: str, timeout: float = 60.0, **variables: str
) -> subprocess.CompletedProcess[str]:
    """Run ``linkage`` in a folder, with more variables of its environment."""
    # Here, since this file is the program of the server too.
    import pytest

    from .missing_packages import missing_package

    request = {
        'arguments': arguments,
        'folder': str(folder),
        'environment': environment(folder) | variables,
    }
    server = _server()
    pid = 0
    with (
        TemporaryFile('w+') as asked,
        Path(os.devnull).open() as given,
        TemporaryFile('w+') as out,
        TemporaryFile('w+') as err,
    ):
        json.dump(request, asked)
        asked.seek(0)
        try:
            files = [file.fileno() for file in (given, out, err, asked)]
            socket.send_fds(server, [b'.'], files)
            (pid,) = _NUMBER.unpack(server.recv(_NUMBER.size))
            server.settimeout(timeout)
            (code,) = _NUMBER.unpack(server.recv(_NUMBER.size))
        except BaseException as error:
            # The answer to this request must not be taken for that to the next one.
            _server.cache_clear()
            if pid:
                os.kill(pid, signal.SIGKILL)
            if isinstance(error, TimeoutError):
                raise subprocess.TimeoutExpired(arguments, timeout) from None
            raise
        server.settimeout(None)
        out.seek(0)
        err.seek(0)
        done = subprocess.CompletedProcess(arguments, code, out.read(), err.read())
    if code and (package := missing_package(done.stderr)):
        pytest.skip(f'needs the package {package}')
    return done


@cache
def _server() -> socket.socket:
    """Start the server; it ends when this end of its socket is closed."""
    ours, theirs = socket.socketpair()
    with theirs:
        number = theirs.fileno()
        subprocess.Popen(
            [sys.executable, __file__, str(number)],
            pass_fds=[number],
        )
    return ours


def _serve(control: socket.socket) -> None:
    """Fork a child for each request; return in a child, ready to run the command."""
    path = sys.path[1:]  # without the folder of this file
    sys.path[:] = path
    for name in THREADED:
        sys.modules[name] = None  # type: ignore[assignment]  # whoever needs it is not imported
    modules = walk_packages(linkage_ros.__path__, 'linkage_ros.')
    for name in (*LIBRARIES, *(module.name for module in modules)):
        with suppress(ImportError):
            import_module(name)
    for name in THREADED:
        del sys.modules[name]
    assert len([*Path('/proc/self/task').iterdir()]) == 1, 'a library has started a thread'
    gc.freeze()
    while files := socket.recv_fds(control, 1, 4)[1]:
        if pid := os.fork():
            for file in files:
                os.close(file)
            control.send(_NUMBER.pack(pid))
            _, status = os.waitpid(pid, 0)
            control.send(_NUMBER.pack(os.waitstatus_to_exitcode(status)))
            continue
        control.close()
        *streams, asked = files
        for index, file in enumerate(streams):
            os.dup2(file, index)
            os.close(file)
        with os.fdopen(asked) as stream:
            request = json.load(stream)
        os.chdir(request['folder'])
        os.environ.clear()
        os.environ.update(request['environment'])
        time.tzset()
        sys.argv[1:] = request['arguments']
        given = filter(None, os.environ.get('PYTHONPATH', '').split(os.pathsep))
        sys.path[:] = [request['folder'], *given, *path]
        return
    sys.exit()


def _run_command() -> NoReturn:
    try:
        code = main()
    except SystemExit as ended:
        if not isinstance(ended.code, int):
            raise
        code = ended.code
    _codes.append(code)
    sys.exit(code)


_codes: list[int] = []  # Exit code of the command, once it has ended by itself


def _leave() -> None:
    """Leave without taking modules apart."""
    if _codes:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(_codes[0])


if __name__ == '__main__':
    atexit.register(_leave)  # the first of all: it is called last
    _serve(socket.socket(fileno=int(sys.argv[1])))
    _run_command()
