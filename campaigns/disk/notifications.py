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

"""
System calls that wait until another process answers them: Linux' ``seccomp_unotify(2)``.

So a call fails where a disk makes it fail, in the kernel, whoever makes it: the interpreter, its
buffered files, the C library. No compiler, no tracer and no privilege is needed.
"""

from __future__ import annotations

from collections.abc import Mapping
import ctypes
import fcntl
import os
from pathlib import Path
import platform
import struct
from typing import NamedTuple

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
    """
    A system call.

    Attributes
    ----------
    name
        What it does, the same for all its variants.
    path
        Which argument is a path; None where the first is a descriptor.

    """

    name: str
    path: int | None = None


_X86: Mapping[int, Signature] = {
    1: Signature('write'),
    2: Signature('open', 0),
    3: Signature('close'),
    18: Signature('pwrite'),
    20: Signature('write'),
    74: Signature('fsync'),
    75: Signature('fsync'),
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
    264: Signature('rename', 1),
    285: Signature('fallocate'),
    316: Signature('rename', 1),
}
_ARM: Mapping[int, Signature] = {
    34: Signature('mkdir', 1),
    35: Signature('unlink', 1),
    38: Signature('rename', 1),
    43: Signature('statfs', 0),
    44: Signature('statfs'),
    46: Signature('ftruncate'),
    47: Signature('fallocate'),
    56: Signature('open', 1),
    57: Signature('close'),
    64: Signature('write'),
    68: Signature('pwrite'),
    82: Signature('fsync'),
    83: Signature('fsync'),
    276: Signature('rename', 1),
}
# Of each machine the calls, and seccomp's own number.
_MACHINES = {'x86_64': (_X86, 317), 'aarch64': (_ARM, 277)}

_libc = ctypes.CDLL(None, use_errno=True)


class Call(NamedTuple):
    """
    A system call that waits.

    Attributes
    ----------
    identifier
        The kernel's name for it.
    thread
        Who makes it.
    name
        What it does.
    path
        The file that it is about; '' where that is none.
    arguments
        As they stand in the registers.

    """

    identifier: int
    thread: int
    name: str
    path: str
    arguments: tuple[int, ...]


def why_not() -> str:
    """Return why calls cannot be answered on this machine; '' where they can."""
    if platform.system() != 'Linux' or platform.machine() not in _MACHINES:
        return f'no table of system calls for {platform.system()} on {platform.machine()}'
    if tuple(map(int, platform.release().split('.')[:2])) < (5, 6):
        return f'Linux {platform.release()} is older than 5.6'
    return ''


def listen() -> int:
    """
    Let this thread's calls wait, and those of threads that it starts; for good.

    Returns
    -------
    int
        The descriptor on which another process receives them.

    Raises
    ------
    OSError
        The kernel does not allow it.

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
    """
    The other end: receives calls and answers them.

    Parameters
    ----------
    descriptor
        What `listen` returned, in this process.
    process
        Whose calls they are.

    """

    def __init__(self, descriptor: int, process: int) -> None:
        self.descriptor = descriptor
        self._process = os.pidfd_open(process)
        self._calls = _MACHINES[platform.machine()][0]

    def receive(self) -> Call:
        """Return the next call; OSError where its thread has ended meanwhile."""
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

    def let(self, call: Call) -> None:
        """Let the kernel do it."""
        self._answer(call, 0, 0, _CONTINUE)

    def refuse(self, call: Call, error: int) -> None:
        """Answer with an error number; nothing has been done."""
        self._answer(call, 0, -error, 0)

    def give(self, call: Call, value: int) -> None:
        """Answer with what it is to return."""
        self._answer(call, value, 0, 0)

    def data(self, call: Call) -> bytes:
        """Return what is to be written."""
        with open(f'/proc/{call.thread}/mem', 'rb', buffering=0) as memory:  # noqa: PTH123
            memory.seek(call.arguments[1])
            return memory.read(call.arguments[2])

    def file_of(self, call: Call) -> int:
        """Return a descriptor of the very file that a call is about, with its position."""
        file: int = _libc.syscall(_PIDFD_GETFD, self._process, call.arguments[0] & 0xFFFFFFFF, 0)
        if file < 0:
            raise _error()
        return file

    def close(self) -> None:
        """Let go; calls that wait fail."""
        os.close(self.descriptor)
        os.close(self._process)

    def _answer(self, call: Call, value: int, error: int, flags: int) -> None:
        answer = bytearray(_ANSWER.pack(call.identifier, value, error, flags))
        fcntl.ioctl(self.descriptor, _SEND, answer)


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
            # To the end of the page: the next one may not be there.
            text += memory.read(_PAGE - (address + len(text)) % _PAGE)
    return text.split(b'\0', 1)[0]


def _error() -> OSError:
    number = ctypes.get_errno()
    return OSError(number, os.strerror(number))
