# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Signals that end a program: SIGINT, SIGTERM and SIGHUP.

In a node a signal only sets the stop event, which the node checks often. Python's own handler
would raise KeyboardInterrupt anywhere in the program, and rclpy's handler would shut down the
context while a bag is being closed. A command that reads or computes does not check the event all
the time: there a signal raises `StoppedError`, wherever the program happens to be.
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
from threading import Event, Timer
from time import monotonic
from typing import Any, NoReturn

_SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP

_LONGEST_END = 10
"""Time limit for the end of a process, in [s]; usually it takes a fraction of a second."""

_LONGEST_UNWINDING = 2.0
"""Time until a raised `StoppedError` must be caught, in [s]; then it is raised again."""

_LONGEST_GOODBYE = 1.0
"""Time limit for a stopped command to end, in [s]."""


class StoppedError(BaseException):
    """
    A signal asked a command to end before it had a result to show.

    It can be raised anywhere. It derives from BaseException, so that no ``except Exception`` takes
    it for a defect of the code that it interrupts.
    """


class Stop(Event):
    """
    The stop request.

    A signal handler runs between two steps of the main thread. At that moment the thread may be
    about to wait for this event and hold the lock of an `Event`. Setting an `Event` takes the same
    lock, so the thread would wait for ever. This class therefore has no lock.
    """

    def __init__(self) -> None:
        super().__init__()
        self._wished = False
        self._wakes: SimpleQueue[None] = SimpleQueue()

    def is_set(self) -> bool:
        """Return whether a stop was requested."""
        return self._wished

    def set(self) -> None:  # noqa: A003 (an event has it)
        """Request a stop; safe in a signal handler."""
        self._wished = True
        self._wakes.put(None)

    def wait(self, timeout: float | None = None) -> bool:
        """Wait for the request, for at most a time in [s]; return whether there is one."""
        if not self._wished:
            with suppress(Empty):
                self._wakes.get(timeout=timeout)
                self._wakes.put(None)  # for the next thread that waits
        return self._wished


def end_at_signals(line: bytes) -> None:
    """Let a signal end the process at once, with a line, until `stop_on_signals` is called."""

    def exit_process(_number: int, _frame: object) -> NoReturn:
        os.write(2, line)
        os._exit(1)

    for number in _SIGNALS:
        signal.signal(number, exit_process)


class _Raising:
    """Whether a signal raises `StoppedError`; one state for the whole process."""

    now = False
    last = -inf
    """Time of the last raise, in [s]."""


def stop_on_signals() -> Stop:
    """Install the handlers, and return the event that they set."""
    stop = Stop()

    def handle_signal(number: int, _frame: object) -> None:
        stop.set()
        # A second signal of an impatient user does not interrupt the clean-up.
        again = number == signal.SIGALRM or monotonic() - _Raising.last > _LONGEST_UNWINDING
        if not (_Raising.now and again):
            return
        _Raising.last = monotonic()
        # Python only prints what is raised in __del__ and the like: raise once more then.
        sys.unraisablehook = _ignore_unraisable
        signal.signal(signal.SIGALRM, handle_signal)
        signal.setitimer(signal.ITIMER_REAL, _LONGEST_UNWINDING)
        raise StoppedError

    for number in _SIGNALS:
        signal.signal(number, handle_signal)
    # Python removes its handlers before the process ends: a signal would kill the process then.
    atexit.register(_ignore_signals)
    return stop


@contextmanager
def raise_on_signals() -> Iterator[None]:
    """Let a signal raise `StoppedError` in the main thread while the context lasts."""
    _Raising.now, _Raising.last = True, -inf
    try:
        yield
    finally:
        _Raising.now = False


def has_raised() -> bool:
    """Return whether a signal has raised `StoppedError` in the last `raise_on_signals` context."""
    return _Raising.last > -inf


@contextmanager
def heed_signals() -> Iterator[None]:
    """Let a signal only set the stop event; the code within the context checks it often."""
    before, _Raising.now = _Raising.now, False
    try:
        yield
    finally:
        _Raising.now = before


def end_soon(code: int) -> None:
    """Make the process end with this code, even if threads or the reader of its output block."""

    def exit_process(_number: int, _frame: object) -> NoReturn:
        os._exit(code)

    signal.signal(signal.SIGALRM, exit_process)
    signal.setitimer(signal.ITIMER_REAL, _LONGEST_GOODBYE)


@contextmanager
def bounded_end(code: int) -> Iterator[None]:
    """
    End the process with an exit code if the code within the context, its shutdown, hangs.

    Of some thousand nodes one did not end after its signal; where it hung is unknown. If threads
    of the middleware deadlock while they hold the interpreter's lock, no Python thread can end
    the process: then SIGALRM does, without the exit code.
    """
    signal.signal(signal.SIGALRM, signal.SIG_DFL)  # configuring may have been given another
    signal.setitimer(signal.ITIMER_REAL, _LONGEST_END + _LONGEST_GOODBYE)
    end = Timer(_LONGEST_END, _exit_at_once, [code])
    end.daemon = True
    end.start()
    try:
        yield
    finally:
        end.cancel()
        signal.alarm(0)


def _exit_at_once(code: int) -> NoReturn:
    with suppress(Exception):
        sys.stdout.flush()
    os._exit(code)


def _ignore_unraisable(unraisable: Any) -> None:
    if unraisable.exc_type is not StoppedError:
        sys.__unraisablehook__(unraisable)


def _ignore_signals() -> None:
    # For clean-up by the interpreter and libraries after Python has removed its handlers.
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(_LONGEST_END)
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)
