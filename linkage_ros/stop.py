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
Signals that end a run: SIGINT, SIGTERM and SIGHUP set an event, and nothing else.

Python's own handler would raise KeyboardInterrupt wherever the program happens to be, and rclpy's
would take the context away from under a bag that is being closed.
"""

from __future__ import annotations

import atexit
from collections.abc import Iterator
from contextlib import contextmanager
import signal
from threading import Event


class StoppedError(Exception):
    """A signal has asked for an end where nothing was done yet that is worth telling."""


_SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP

_LONGEST_END = 10
"""How long the end of a process may take, in [s]; it takes a fraction of one."""


def stop_on_signals() -> Event:
    """Install the handlers, and return the event that they set."""
    stop = Event()

    def handle(_number: int, _frame: object) -> None:
        stop.set()

    for number in _SIGNALS:
        signal.signal(number, handle)
    # Python gives up its handlers some time before the process ends: a signal would kill it then.
    atexit.register(_ignore)
    return stop


@contextmanager
def bounded_end() -> Iterator[None]:
    """
    Have SIGALRM end the process where what is done within, its end, does not come to its own.

    Of some thousand nodes one was seen that did not end by its signal; where it stayed is not
    known. Where threads of the middleware wait for each other, they may do so with the
    interpreter's lock: then no thread of Python ends that.
    """
    signal.alarm(_LONGEST_END)
    try:
        yield
    finally:
        signal.alarm(0)


def _ignore() -> None:
    signal.alarm(_LONGEST_END)  # for what the interpreter and libraries do when Python is gone
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)
