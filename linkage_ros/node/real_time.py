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
What a run asks of the operating system for its ticks: priority, processors, memory that stays.

All of it is asked for by the thread that ticks, but the memory, which is the process's. What the
system refuses is told, and the ticks go on without it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
import os
from pathlib import Path
import resource
from threading import Event

from linkage_ros.node.tick_loop import Pace, TickLoop

_CURRENT, _FUTURE = 1, 2
"""MCL_CURRENT and MCL_FUTURE of mlockall(2)."""

_IPC_LOCK = 14
"""CAP_IPC_LOCK of capabilities(7)."""

_ALLOW = 'allow it in /etc/security/limits.d (USER - {limit}) and log in anew'


@dataclass(slots=True)
class RealTime:
    """
    What is asked for, and what has come of it.

    Attributes
    ----------
    priority
        Priority under SCHED_FIFO, 1 to 99; 0 for none.
    processors
        Numbers of those that may run the tick; none for all.
    lock
        Whether the memory of the process shall stay in the machine's.
    in_force
        For each that was asked for what the system says of it now; written by who asks.
    refused
        A line for each that the system has refused, with what helps.

    """

    priority: int
    processors: Sequence[int]
    lock: bool
    in_force: dict[str, str] = field(default_factory=dict)
    refused: list[str] = field(default_factory=list)

    def lock_memory(self) -> None:
        """Keep the memory of the process in that of the machine, where that is asked for."""
        if not self.lock:
            return
        # With a limit, what is allocated later would fail: Python would end in the middle.
        most = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
        if most != resource.RLIM_INFINITY and not _may_lock():
            remedy = _ALLOW.format(limit='memlock unlimited')
            self.refused.append(f'lock_memory: {most >> 10} KiB may be locked; {remedy}')
        else:
            from ctypes import CDLL, get_errno  # local import: only where it is asked for

            if CDLL(None, use_errno=True).mlockall(_CURRENT | _FUTURE):
                self.refused.append(f'lock_memory: {os.strerror(get_errno())}; add memory')
        self.in_force['Locked memory'] = _status('VmLck')

    def paced(self, pace: Pace) -> Pace:
        """Return a pace that first asks for what the thread needs which runs it."""

        def asking(loop: TickLoop, stopping: Event) -> None:
            self.refused += [*self._ask()]
            pace(loop, stopping)

        return asking if self.priority or self.processors else pace

    def _ask(self) -> Iterator[str]:
        """Ask for the calling thread; yield a line for each that is refused."""
        if self.processors:
            with suppress(OSError, ValueError, OverflowError):  # no such processor
                os.sched_setaffinity(0, self.processors)
            has = sorted(os.sched_getaffinity(0))
            if has != sorted(set(self.processors)):
                yield (
                    f'cpu_affinity {[*self.processors]}: ticks run on {has}; '
                    'name processors that this process has'
                )
            self.in_force['Processors'] = ', '.join(map(str, has))
        if self.priority:
            try:
                os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(self.priority))
            except OSError as error:
                remedy = _ALLOW.format(limit='rtprio 99')
                yield f'thread_priority {self.priority}: {error.strerror}; {remedy}'
            fifo = os.sched_getscheduler(0) == os.SCHED_FIFO
            now = os.sched_getparam(0).sched_priority
            self.in_force['Scheduling'] = f'SCHED_FIFO, priority {now}' if fifo else 'as others'


def _may_lock() -> bool:
    return bool(int(_status('CapEff'), 16) >> _IPC_LOCK & 1)


def _status(key: str) -> str:
    """Return what the kernel says of this process."""
    lines = Path('/proc/self/status').read_text().splitlines()
    return next(line.split(':')[1].strip() for line in lines if line.startswith(f'{key}:'))
