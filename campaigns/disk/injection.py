# Copyright 2026 The linkage_ros authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Run a recording in a process of its own, and answer its calls as a failing disk would."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
import os
from pathlib import Path
import pickle
import select
import signal
import socket
from time import monotonic
from typing import NamedTuple

from campaigns.disk.faults import Fault, FAULTS
from campaigns.disk.notifications import Call, listen, Listener
from campaigns.disk.subject import Recorded

_PATIENCE = 8.0
"""How long a recording may take [s]."""

Do = Callable[[Callable[[str], None]], Recorded]


class Seen(NamedTuple):
    """
    A call about the bag.

    Attributes
    ----------
    name
        What it does.
    what
        With what.
    phase
        While what was done.

    """

    name: str
    what: str
    phase: str


class Injection(NamedTuple):
    """
    Which calls fail, and how.

    Attributes
    ----------
    number
        The first of them, from 0 on.
    fault
        Name of one of `FAULTS`.
    lasting
        Whether all fail from then on which it can befall.

    """

    number: int
    fault: str
    lasting: bool


def run(do: Do, folder: Path, injection: Injection | None) -> tuple[Recorded | None, list[Seen]]:
    """
    Run a recording and let calls fail.

    Parameters
    ----------
    do
        Records; it is given what to tell the phase.
    folder
        The bag's; calls about others are let pass.
    injection
        What fails; None for nothing.

    Returns
    -------
    tuple
        How it went, None where it did not come to an end; and all its calls.

    """
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
    process = os.fork()
    if not process:
        ours.close()
        _child(do, theirs)
    theirs.close()
    try:
        _, (descriptor, *_), *_ = socket.recv_fds(ours, 1, 1)
        listener = Listener(descriptor, process)
        try:
            return _Supervisor(listener, ours, folder, injection).supervise()
        finally:
            # First, since a call that waits does not hear it; killed where it has not ended.
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
            listener.close()
    finally:
        ours.close()
        os.waitpid(process, 0)


def _child(do: Do, theirs: socket.socket) -> None:
    """Record, say how it went, and end without a word to what was inherited."""
    try:
        listener = listen()
        socket.send_fds(theirs, [b'L'], [listener])
        done = do(partial(_tell, theirs))
        theirs.sendall(b'D' + pickle.dumps(done))
        theirs.shutdown(socket.SHUT_WR)
    finally:
        os._exit(0)


def _tell(theirs: socket.socket, phase: str) -> None:
    """Tell the phase, and wait until it is known: no call of it may be seen before."""
    theirs.sendall(b'P' + phase.encode())
    theirs.recv(1)


class _Supervisor:
    """Answers the calls of one recording."""

    def __init__(
        self, listener: Listener, ours: socket.socket, folder: Path, injection: Injection | None
    ) -> None:
        self._listener = listener
        self._ours = ours
        self._folder = str(folder)
        self._injection = injection
        self._phase = 'beginning'
        self._seen: list[Seen] = []
        # Where the last fsync that succeeded has left each file.
        self._safe: dict[str, int] = {}

    def supervise(self) -> tuple[Recorded | None, list[Seen]]:
        poll = select.poll()
        poll.register(self._listener.descriptor, select.POLLIN)
        poll.register(self._ours, select.POLLIN)
        until = monotonic() + _PATIENCE
        answer = b''
        while (left := until - monotonic()) > 0:
            ready = dict(poll.poll(1e3 * left))
            if ready.get(self._listener.descriptor, 0) & select.POLLIN:
                # Its thread may have ended by now.
                with suppress(FileNotFoundError):
                    self._answer(self._listener.receive())
            if self._ours.fileno() in ready:
                part = self._ours.recv(1 << 16)
                if not part:
                    break
                if not answer and part[:1] == b'P':
                    self._phase = part[1:].decode()
                    self._ours.sendall(b'!')
                else:
                    answer += part
        done = pickle.loads(answer[1:]) if answer else None
        return done, self._seen

    def _answer(self, call: Call) -> None:
        what = self._what(call)
        if not what:
            self._listener.let(call)
            return
        number = len(self._seen)
        self._seen.append(Seen(_kind(call), what, self._phase))
        fault = self._fault(number, _kind(call), what)
        if fault is None:
            if call.name == 'fsync' and what == 'file':
                self._safe[call.path] = Path(call.path).stat().st_size
            self._listener.let(call)
        elif fault.error:
            if fault.loses:
                self._lose(call)
            self._listener.refuse(call, fault.error)
        else:
            self._listener.give(call, self._write_half(call) if fault.short else 0)

    def _fault(self, number: int, name: str, what: str) -> Fault | None:
        plan = self._injection
        if plan is None or number < plan.number or (number > plan.number and not plan.lasting):
            return None
        fault = FAULTS[plan.fault]
        return fault if can_befall(plan.fault, name, what) else None

    def _lose(self, call: Call) -> None:
        """Let go of what was written since the last fsync, as the kernel may after a failure."""
        file = self._listener.file_of(call)
        try:
            safe, end = self._safe.get(call.path, 0), os.fstat(file).st_size
            os.pwrite(file, bytes(end - safe), safe)
        finally:
            os.close(file)

    def _write_half(self, call: Call) -> int:
        """Write the first half of the data, for real, and return how much that is."""
        data = self._listener.data(call)
        file = self._listener.file_of(call)
        try:
            half = data[: max(1, len(data) // 2)]
            if call.name == 'pwrite':
                return os.pwrite(file, half, call.arguments[3])
            return os.write(file, half)
        finally:
            os.close(file)

    def _what(self, call: Call) -> str:
        """Return what of the bag a call is about; '' where it is about nothing of it."""
        path = call.path.removesuffix(' (deleted)')
        if path == str(Path(self._folder).parent):
            return 'parent folder'
        if path != self._folder and not path.startswith(f'{self._folder}/'):
            return ''
        if call.path.endswith(' (deleted)') or _makes_nameless(call):
            return 'reserve'
        if path == self._folder:
            return 'folder'
        name = Path(path).name
        if name.startswith('metadata.yaml'):
            return 'metadata'
        return 'file' if name.endswith('.mcap') else 'reserve'


def can_befall(fault: str, name: str, what: str) -> bool:
    """Return whether a fault can befall a call."""
    return name in FAULTS[fault].calls and (what == 'file' or not FAULTS[fault].loses)


def _kind(call: Call) -> str:
    return 'create' if call.name == 'open' and _flags(call) & os.O_ACCMODE else call.name


def _flags(call: Call) -> int:
    # open(path, flags) and openat(folder, path, flags): what lies before the path is a descriptor.
    return call.arguments[2] if call.arguments[0] & 0xFFFFFFFF == 0xFFFFFF9C else call.arguments[1]


def _makes_nameless(call: Call) -> bool:
    return call.name == 'open' and _flags(call) & os.O_TMPFILE == os.O_TMPFILE
