# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Run a recording in a process of its own, and answer its system calls like a failing disk.

By Linux' ``seccomp_unotify(2)`` system calls wait until another process answers them. So a call
fails in the kernel, as with a failing disk, whether the interpreter, its buffered files or the C
library makes it. No compiler, tracer or privilege is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
import ctypes
import errno
import fcntl
import os
from pathlib import Path
import pickle
import platform
import select
import socket
import struct
from time import monotonic
from typing import NamedTuple

from campaigns.reliability.processes import forked
from campaigns.reliability.recording import Phase, Recorded, Watch

_WRITES = frozenset({'write', 'pwrite'})
_TAKE_ROOM = _WRITES | {'create', 'fsync', 'rename', 'fallocate', 'mkdir', 'close'}
_CHANGE = _WRITES | {'create', 'fsync', 'rename', 'fallocate', 'mkdir', 'ftruncate', 'unlink'}
_ALL = _CHANGE | {'open', 'close', 'rmdir', 'statfs'}


class Fault(NamedTuple):
    """A fault of a system call."""

    calls: frozenset[str]  # The calls that can have this fault
    error: int = 0  # Its error number; 0 for none
    short: bool = False  # Whether only a part of the data is written
    loses: bool = False  # Whether the data written since the last successful fsync is lost
    harmless: bool = False  # Whether a recording has to continue and to be complete


FAULTS: Mapping[str, Fault] = {
    'EIO': Fault(_ALL, errno.EIO),
    'ENOSPC': Fault(_TAKE_ROOM, errno.ENOSPC),
    'EDQUOT': Fault(_TAKE_ROOM, errno.EDQUOT),
    'EROFS': Fault(_CHANGE | {'rmdir'}, errno.EROFS),
    'EOPNOTSUPP': Fault(frozenset({'fallocate'}), errno.EOPNOTSUPP, harmless=True),
    'half is written': Fault(_WRITES, short=True, harmless=True),
    'nothing is written': Fault(_WRITES),
    'EIO, pages lost': Fault(frozenset({'fsync'}), errno.EIO, loses=True),
}

_NEW_LISTENER, _SET_FILTER, _NO_NEW_PRIVILEGES = 8, 1, 38
_NOTIFY, _ALLOW = 0x7FC00000, 0x7FFF0000
_LOAD, _JUMP_IF_EQUAL, _RETURN = 0x20, 0x15, 0x06
_RECEIVE, _SEND = 0xC0502100, 0xC0182101
_CONTINUE = 1
_REQUEST = struct.Struct('<QIIiIQ6Q')
_ANSWER = struct.Struct('<QqiI')
_PIDFD_GETFD = 438
_PAGE = 4096


class Signature(NamedTuple):
    """A system call."""

    name: str  # Its name, the same for all its variants
    # Number of the argument that is a path; None if the first argument is a descriptor.
    path: int | None = None


_X86: Mapping[int, Signature] = {
    **dict.fromkeys((1, 20), Signature('write')),
    2: Signature('open', 0),
    3: Signature('close'),
    18: Signature('pwrite'),
    **dict.fromkeys((74, 75), Signature('fsync')),
    77: Signature('ftruncate'),
    82: Signature('rename', 0),
    83: Signature('mkdir', 0),
    84: Signature('rmdir', 0),
    87: Signature('unlink', 0),
    137: Signature('statfs', 0),
    138: Signature('statfs'),
    257: Signature('open', 1),
    258: Signature('mkdir', 1),
    263: Signature('unlink', 1),
    **dict.fromkeys((264, 316), Signature('rename', 1)),
    285: Signature('fallocate'),
}
_ARM: Mapping[int, Signature] = {
    34: Signature('mkdir', 1),
    35: Signature('unlink', 1),
    **dict.fromkeys((38, 276), Signature('rename', 1)),
    43: Signature('statfs', 0),
    44: Signature('statfs'),
    46: Signature('ftruncate'),
    47: Signature('fallocate'),
    56: Signature('open', 1),
    57: Signature('close'),
    64: Signature('write'),
    68: Signature('pwrite'),
    **dict.fromkeys((82, 83), Signature('fsync')),
}
# System calls of each machine, and the number of seccomp itself.
_MACHINES = {'x86_64': (_X86, 317), 'aarch64': (_ARM, 277)}

_libc = ctypes.CDLL(None, use_errno=True)


class Call(NamedTuple):
    """
    A waiting system call: the name of its `Signature`, the path of its file or '', the registers.

    The ``identifier`` is the kernel's, the ``thread`` that of the caller.
    """

    identifier: int
    thread: int
    name: str
    path: str
    arguments: tuple[int, ...]


def why_not() -> str:
    """Return the reason why calls cannot be answered on this machine; '' if they can."""
    if platform.system() != 'Linux' or platform.machine() not in _MACHINES:
        return f'no table of system calls for {platform.system()} on {platform.machine()}'
    if tuple(map(int, platform.release().split('.')[:2])) < (5, 6):
        return f'Linux {platform.release()} is older than 5.6'
    return ''


def listen() -> int:
    """
    Make the calls of this thread, and of threads that it starts, wait from now on.

    Another process receives them on the returned descriptor. An OSError says that the kernel does
    not allow it.
    """
    calls, seccomp = _MACHINES[platform.machine()]
    filters = [(_LOAD, 0, 0, 0)]
    filters += [(_JUMP_IF_EQUAL, len(calls) - at, 0, nr) for at, nr in enumerate(calls)]
    filters += [(_RETURN, 0, 0, _ALLOW), (_RETURN, 0, 0, _NOTIFY)]
    code = ctypes.create_string_buffer(b''.join(struct.pack('<HBBI', *f) for f in filters))
    program = struct.pack('@HP', len(filters), ctypes.addressof(code))
    if _libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0):
        raise _error()
    listener: int = _libc.syscall(seccomp, _SET_FILTER, _NEW_LISTENER, program)
    if listener < 0:
        raise _error()
    return listener


class Listener:
    """Receives the calls of another process on the descriptor of `listen`, and answers them."""

    def __init__(self, descriptor: int, process: int) -> None:
        self.descriptor = descriptor
        self._process = os.pidfd_open(process)
        self._calls = _MACHINES[platform.machine()][0]

    def receive(self) -> Call:
        """Return the next call; raise OSError if its thread has ended."""
        buffer = bytearray(_REQUEST.size)
        fcntl.ioctl(self.descriptor, _RECEIVE, buffer)
        identifier, thread, _, number, _, _, *arguments = _REQUEST.unpack(buffer)
        signature = self._calls[number]
        path = (
            _descriptor_path(thread, arguments[0])
            if signature.path is None
            else os.fsdecode(_text(thread, arguments[signature.path]))
        )
        return Call(identifier, thread, signature.name, path, tuple(arguments))

    def allow(self, call: Call) -> None:
        """Let the kernel execute a call."""
        self.answer(call, flags=_CONTINUE)

    def answer(self, call: Call, value: int = 0, error: int = 0, flags: int = 0) -> None:
        """Answer a call with a return value or an error number, without executing it."""
        answer = bytearray(_ANSWER.pack(call.identifier, value, -error, flags))
        fcntl.ioctl(self.descriptor, _SEND, answer)

    def data(self, call: Call) -> bytes:
        """Return the data to write."""
        with open(f'/proc/{call.thread}/mem', 'rb', buffering=0) as memory:  # noqa: PTH123
            memory.seek(call.arguments[1])
            return memory.read(call.arguments[2])

    def file_of(self, call: Call) -> int:
        """Return a descriptor of the file of a call, which shares its position."""
        file: int = _libc.syscall(_PIDFD_GETFD, self._process, call.arguments[0] & 0xFFFFFFFF, 0)
        if file < 0:
            raise _error()
        return file

    def close(self) -> None:
        """Close the listener; waiting calls fail."""
        os.close(self.descriptor)
        os.close(self._process)


def _descriptor_path(thread: int, descriptor: int) -> str:
    try:
        return str(Path(f'/proc/{thread}/fd/{descriptor & 0xFFFFFFFF}').readlink())
    except OSError:
        return ''


def _text(thread: int, address: int) -> bytes:
    """Return the text at an address of another process."""
    with open(f'/proc/{thread}/mem', 'rb', buffering=0) as memory:  # noqa: PTH123
        memory.seek(address)
        text = b''
        while b'\0' not in text:
            # Read to the end of the page: the next one may not exist.
            text += memory.read(_PAGE - (address + len(text)) % _PAGE)
    return text.split(b'\0', 1)[0]


def _error() -> OSError:
    number = ctypes.get_errno()
    return OSError(number, os.strerror(number))


_PATIENCE = 8.0
"""Time limit of a recording [s]."""


class SeenCall(NamedTuple):
    """A system call on a part of a bag: file, metadata, folder, reserve or parent folder."""

    name: str
    target: str
    phase: Phase


class Injection(NamedTuple):
    """The calls that fail, and their fault."""

    number: int  # Number of the first failing call, from 0
    fault: str  # Name of one of `FAULTS`
    lasting: bool  # Whether all later calls that can have this fault fail too


def run_with(
    injection: Injection | None, folder: Path, do: Callable[[Watch], Recorded]
) -> tuple[Recorded | None, list[SeenCall]]:
    """
    Run a recording, watched by its argument, and let calls on the folder of its bag fail.

    Return its outcome, None if it did not end, and all its calls on the bag.
    """

    def recording(theirs: socket.socket) -> None:
        listener = listen()
        socket.send_fds(theirs, [b'L'], [listener])
        done = do(_Announcer(theirs))
        theirs.sendall(b'D' + pickle.dumps(done))
        theirs.shutdown(socket.SHUT_WR)

    with ExitStack() as after, forked(recording) as (process, ours):
        _, (descriptor, *_), *_ = socket.recv_fds(ours, 1, 1)
        listener = Listener(descriptor, process)
        # Closed after the kill: a waiting call fails when the listener is closed.
        after.callback(listener.close)
        return _Supervisor(listener, ours, folder, injection).supervise()


class _Announcer:
    """Sends each phase, and waits for the receipt: none of its calls may be seen before."""

    def __init__(self, theirs: socket.socket) -> None:
        self._theirs = theirs

    def enter(self, phase: Phase, _written: int) -> None:
        self._theirs.sendall(b'P' + bytes([phase]))
        self._theirs.recv(1)


class _Supervisor:
    """Answers the calls of one recording."""

    def __init__(
        self, listener: Listener, ours: socket.socket, folder: Path, injection: Injection | None
    ) -> None:
        self._listener = listener
        self._ours = ours
        self._folder = str(folder)
        self._injection = injection
        self._phase = Phase.STARTING
        self._seen: list[SeenCall] = []
        # Size of each file at its last successful fsync.
        self._safe: dict[str, int] = {}

    def supervise(self) -> tuple[Recorded | None, list[SeenCall]]:
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
                    self._phase = Phase(part[1])
                    self._ours.sendall(b'!')
                else:
                    answer += part
        done = pickle.loads(answer[1:]) if answer else None
        return done, self._seen

    def _answer(self, call: Call) -> None:
        target = self._target(call)
        if not target:
            self._listener.allow(call)
            return
        number = len(self._seen)
        self._seen.append(SeenCall(_kind(call), target, self._phase))
        fault = self._fault(number, _kind(call), target)
        if fault is None:
            if call.name == 'fsync' and target == 'file':
                self._safe[call.path] = Path(call.path).stat().st_size
            self._listener.allow(call)
        elif fault.error:
            if fault.loses:
                self._lose(call)
            self._listener.answer(call, error=fault.error)
        else:
            self._listener.answer(call, self._write_half(call) if fault.short else 0)

    def _fault(self, number: int, name: str, target: str) -> Fault | None:
        plan = self._injection
        if plan is None or number < plan.number or (number > plan.number and not plan.lasting):
            return None
        fault = FAULTS[plan.fault]
        return fault if can_befall(plan.fault, name, target) else None

    def _lose(self, call: Call) -> None:
        """Lose the data written since the last fsync, as the kernel may after a failure."""
        file = self._listener.file_of(call)
        try:
            safe, end = self._safe.get(call.path, 0), os.fstat(file).st_size
            os.pwrite(file, bytes(end - safe), safe)
        finally:
            os.close(file)

    def _write_half(self, call: Call) -> int:
        """Write the first half of the data to the disk, and return its size."""
        data = self._listener.data(call)
        file = self._listener.file_of(call)
        try:
            half = data[: max(1, len(data) // 2)]
            if call.name == 'pwrite':
                return os.pwrite(file, half, call.arguments[3])
            return os.write(file, half)
        finally:
            os.close(file)

    def _target(self, call: Call) -> str:
        """Return the part of the bag that a call works on; '' for none."""
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


def can_befall(fault: str, name: str, target: str) -> bool:
    """Return whether a call can have a fault."""
    return name in FAULTS[fault].calls and (target == 'file' or not FAULTS[fault].loses)


def _kind(call: Call) -> str:
    return 'create' if call.name == 'open' and _flags(call) & os.O_ACCMODE else call.name


def _flags(call: Call) -> int:
    # open(path, flags) or openat(folder, path, flags).
    return call.arguments[2] if call.arguments[0] & 0xFFFFFFFF == 0xFFFFFF9C else call.arguments[1]


def _makes_nameless(call: Call) -> bool:
    return call.name == 'open' and _flags(call) & os.O_TMPFILE == os.O_TMPFILE


def injections(calls: Sequence[SeenCall]) -> Iterator[Injection]:
    """Yield all possible injections for the calls of a recording without faults."""
    for index, call in enumerate(calls):
        for fault in FAULTS:
            if can_befall(fault, call.name, call.target):
                yield Injection(index, fault, lasting=False)
                yield Injection(index, fault, lasting=True)
