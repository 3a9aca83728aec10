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
Signals that end a program: SIGINT, SIGTERM and SIGHUP.

A node looks at the wish to stop in good time: a signal sets it, and nothing else. Python's own
handler would raise KeyboardInterrupt wherever the program happens to be, and rclpy's would take
the context away from under a bag that is being closed. A command that reads or computes does not
look at it all the time: there a signal raises `StoppedError`, wherever it happens to be.
"""

from __future__ import annotations

import atexit
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from math import inf
import os
from queue import Empty, SimpleQueue
import signal
import sys
from threading import Event
from time import monotonic
from typing import Any, NoReturn


class StoppedError(BaseException):
    """
    A signal has asked for an end where nothing was done yet that is worth telling.

    It comes out of the middle of anything, so that no ``except Exception`` may take it for a
    defect of what was done there.
    """


_SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP

_LONGEST_END = 10
"""How long the end of a process may take, in [s]; it takes a fraction of one."""

_LONGEST_UNWINDING = 2.0
"""How long what is raised may take until it is met, in [s]; then it is raised again."""

_LONGEST_GOODBYE = 1.0
"""How long a command that was stopped may take to end, in [s]."""


class Stop(Event):
    """
    The wish to stop.

    A signal is handled between any two steps of the main thread. It may be about to wait for this
    event then, and hold the lock of an `Event`: to set that takes the lock, for which the thread
    would wait for ever. So this one has none.
    """

    def __init__(self) -> None:
        super().__init__()
        self._wished = False
        self._wakes: SimpleQueue[None] = SimpleQueue()

    def is_set(self) -> bool:
        """Return whether there is the wish."""
        return self._wished

    def set(self) -> None:  # noqa: A003 (an event has it)
        """Wish it; from a handler of signals too."""
        self._wished = True
        self._wakes.put(None)

    def wait(self, timeout: float | None = None) -> bool:
        """Wait for the wish, for at most a time in [s]; return whether there is one."""
        if not self._wished:
            with suppress(Empty):
                self._wakes.get(timeout=timeout)
                self._wakes.put(None)  # for the next who waits
        return self._wished


class _Raising:
    """Whether a signal raises; of a process, as its signals are."""

    now = False
    last = -inf
    """When it last did, in [s]."""


def stop_on_signals() -> Stop:
    """Install the handlers, and return the event that they set."""
    stop = Stop()

    def handle(number: int, _frame: object) -> None:
        stop.set()
        # An impatient user's second signal does not interrupt how things are left in order.
        again = number == signal.SIGALRM or monotonic() - _Raising.last > _LONGEST_UNWINDING
        if not (_Raising.now and again):
            return
        _Raising.last = monotonic()
        # What is raised where Python can only say so, as in __del__, is lost: once more then.
        sys.unraisablehook = _unraisable
        signal.signal(signal.SIGALRM, handle)
        signal.setitimer(signal.ITIMER_REAL, _LONGEST_UNWINDING)
        raise StoppedError

    for number in _SIGNALS:
        signal.signal(number, handle)
    # Python gives up its handlers some time before the process ends: a signal would kill it then.
    atexit.register(_ignore)
    return stop


@contextmanager
def raising() -> Iterator[None]:
    """Have a signal raise `StoppedError` within, in the main thread."""
    _Raising.now, _Raising.last = True, -inf
    try:
        yield
    finally:
        _Raising.now = False


@contextmanager
def heeded() -> Iterator[None]:
    """Have a signal set the wish alone: who is within looks at it in good time."""
    before, _Raising.now = _Raising.now, False
    try:
        yield
    finally:
        _Raising.now = before


def end_soon(code: int) -> None:
    """Have the process end with this code, whatever holds it up: who reads it, or threads."""

    def end(_number: int, _frame: object) -> NoReturn:
        os._exit(code)

    signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, _LONGEST_GOODBYE)


@contextmanager
def bounded_end() -> Iterator[None]:
    """
    Have SIGALRM end the process where what is done within, its end, does not come to its own.

    Of some thousand nodes one was seen that did not end by its signal; where it stayed is not
    known. Where threads of the middleware wait for each other, they may do so with the
    interpreter's lock: then no thread of Python ends that.
    """
    signal.signal(signal.SIGALRM, signal.SIG_DFL)  # a signal while it configured may have taken it
    signal.alarm(_LONGEST_END)
    try:
        yield
    finally:
        signal.alarm(0)


def _unraisable(unraisable: Any) -> None:
    if unraisable.exc_type is not StoppedError:
        sys.__unraisablehook__(unraisable)


def _ignore() -> None:
    # For what the interpreter and libraries do when Python is gone, and its handlers with it.
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(_LONGEST_END)
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)
