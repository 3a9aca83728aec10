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
arguments, folder, environment and output, and ends as any process does. A test of imports, of
signals or of limits needs a Python of its own, by `subprocess`. Of a shell, the program
`linkage_client.py` is the client.
"""

from __future__ import annotations

from contextlib import suppress
from functools import cache
import gc
from importlib import import_module
import json
import os
from pathlib import Path
from pkgutil import walk_packages
from select import select
import signal
import socket
import struct
import subprocess
import sys
from tempfile import mkdtemp, TemporaryFile
import time

import linkage_ros
from linkage_ros.cli.main import main
from linkage_ros.description import import_jsonschema
from linkage_ros.processes import private_domain

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

# With threads of OpenBLAS, a forked child whose scipy is loaded later does not end.
NO_THREADS = {'OPENBLAS_NUM_THREADS': '1'}

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
    request = {
        'arguments': arguments,
        'folder': str(folder),
        'path': [str(folder)],
        'environment': environment(folder) | NO_THREADS | variables,
    }
    with (
        socket.socket(socket.AF_UNIX) as server,
        TemporaryFile('w+') as asked,
        Path(os.devnull).open() as given,
        TemporaryFile('w+') as out,
        TemporaryFile('w+') as err,
    ):
        json.dump(request, asked)
        asked.seek(0)
        server.connect(address())
        socket.send_fds(server, [b'.'], [file.fileno() for file in (given, out, err, asked)])
        (pid,) = _NUMBER.unpack(server.recv(_NUMBER.size))
        try:
            server.settimeout(timeout)
            (code,) = _NUMBER.unpack(server.recv(_NUMBER.size))
        except BaseException as error:
            os.kill(pid, signal.SIGKILL)
            if isinstance(error, TimeoutError):
                raise subprocess.TimeoutExpired(arguments, timeout) from None
            raise
        out.seek(0)
        err.seek(0)
        return subprocess.CompletedProcess(arguments, code, out.read(), err.read())


def on_path(folder: Path) -> dict[str, str]:
    """Write a ``linkage`` into a folder, and return the environment of a shell that finds it."""
    client = Path(__file__).with_name('linkage_client.py')
    program = folder / 'linkage'
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -IS {client} "$@"\n')
    program.chmod(0o755)
    return {'LINKAGE_SERVER': address(), **NO_THREADS}


@cache
def address() -> str:
    """Start the server, and return where it listens; it ends with this process."""
    ours, theirs = socket.socketpair()
    found = str(Path(mkdtemp(), 'server'))
    with theirs, socket.socket(socket.AF_UNIX) as listener:
        listener.bind(found)
        listener.listen()
        numbers = listener.fileno(), theirs.fileno()
        subprocess.Popen(
            [sys.executable, __file__, *map(str, numbers)],
            pass_fds=numbers,
            env=os.environ | NO_THREADS,
        )
    _held.append(ours)
    return found


_held: list[socket.socket] = []


def _serve(listener: socket.socket, alive: socket.socket) -> None:
    """Fork a child for each request; return in a child, ready to run the command."""
    path = sys.path[1:]  # without the folder of this file
    sys.path[:] = path
    for name in THREADED:
        sys.modules[name] = None  # type: ignore[assignment]  # whoever needs it is not imported
    modules = walk_packages(linkage_ros.__path__, 'linkage_ros.')
    for name in (*LIBRARIES, *(module.name for module in modules)):
        with suppress(ImportError):
            import_module(name)
    with suppress(ImportError):
        import_jsonschema()
    for name in THREADED:
        del sys.modules[name]
    assert len([*Path('/proc/self/task').iterdir()]) == 1, 'a library has started a thread'
    gc.freeze()
    running: dict[int, tuple[int, socket.socket]] = {}
    while alive not in (ready := select([listener, alive, *running], (), ())[0]):
        for ended in {*ready} & {*running}:
            pid, client = running.pop(ended)
            _, status = os.waitpid(pid, 0)
            os.close(ended)
            with client, suppress(OSError):
                client.send(_NUMBER.pack(os.waitstatus_to_exitcode(status)))
        if listener not in ready:
            continue
        client, _ = listener.accept()
        files = socket.recv_fds(client, 1, 4)[1]
        if pid := os.fork():
            for file in files:
                os.close(file)
            running[os.pidfd_open(pid)] = pid, client
            client.send(_NUMBER.pack(pid))
            continue
        for each in (listener, alive, client, *(other for _, other in running.values())):
            each.close()
        for other in running:
            os.close(other)
        *streams, asked = files
        for index, file in enumerate(streams):
            os.dup2(file, index)
            os.close(file)
        # Those of the server believe that they can seek as its files can.
        sys.stdin, sys.stdout = os.fdopen(0), os.fdopen(1, 'w')
        sys.stderr = os.fdopen(2, 'w', 1, errors='backslashreplace')
        with os.fdopen(asked) as stream:
            request = json.load(stream)
        os.chdir(request['folder'])
        os.environ.clear()
        os.environ.update(request['environment'])
        time.tzset()
        sys.argv[1:] = request['arguments']
        given = filter(None, os.environ.get('PYTHONPATH', '').split(os.pathsep))
        sys.path[:] = [*request['path'], *given, *path]
        return
    sys.exit()


if __name__ == '__main__':
    _serve(*(socket.socket(fileno=int(number)) for number in sys.argv[1:]))
    sys.exit(main())
