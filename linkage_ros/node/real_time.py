# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
What the ticks need of operating system and middleware: priority, memory, no shared memory.

The tick's own thread requests them, except locked memory, which belongs to the process. A refused
request is reported, and the ticks go on without it.

Fast DDS uses UDP only, unless the user configures its transports. For every new subscriber, a
publisher opens and checks its shared-memory port, on the publishing thread. The check may wait a
third of the ``healthy_check_timeout_ms`` of the port's creator, 0.33 s by default (Fast-DDS issue
6535, `SharedMemGlobal.hpp` of 2.14.5). Ticks stand still meanwhile. UDP within a machine costs the
same, and clients with default settings receive it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
import os
from pathlib import Path
import re
import resource
from threading import Event
from typing import TYPE_CHECKING

from linkage_ros.resources import shipped_path
from rclpy.utilities import get_rmw_implementation_identifier

if TYPE_CHECKING:
    from linkage_ros.tick import Pace, TickLoop

_CURRENT, _FUTURE = 1, 2
"""MCL_CURRENT and MCL_FUTURE of mlockall(2)."""

_IPC_LOCK = 14
"""CAP_IPC_LOCK of capabilities(7)."""

_ALLOW = 'allow it in /etc/security/limits.d (USER - {limit}) and log in anew'

_TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
_RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
_PROFILE = 'FASTRTPS_DEFAULT_PROFILES_FILE'
_CONFIGURED = (
    _TRANSPORTS,
    _PROFILE,
    'FASTDDS_DEFAULT_PROFILES_FILE',
    'RMW_FASTRTPS_PUBLICATION_MODE',
)
"""Environment variables with which the user configures the transports."""

_PROFILES = 'DEFAULT_FASTRTPS_PROFILES.xml', 'DEFAULT_FASTDDS_PROFILES.xml'
"""Files in the working folder with the same purpose."""

_SHARED = re.compile(r'/(?:fastrtps|fastdds)_port\d+$', re.MULTILINE)

STANDSTILL = (
    'when another program subscribes, ticks may pause once for 0.33 s; the page "Keep ticks on '
    'time" of the documentation says how to avoid it'
)
"""The same for a reader who does not know DDS."""


@dataclass(slots=True)
class RealTime:
    """Requested real-time settings, and their outcome."""

    priority: int  # Priority under SCHED_FIFO, 1 to 99; 0 for none
    processors: Sequence[int]  # Numbers of the processors that may run the tick; () for all
    lock: bool  # Whether to lock the memory of the process into RAM
    # Setting that the system reports, for each request; written by the requesting thread.
    in_force: dict[str, str] = field(default_factory=dict)
    # One line for each refused request, with a remedy.
    refused: list[str] = field(default_factory=list)

    def lock_memory(self) -> None:
        """Lock the memory of the process into RAM, if requested."""
        if not self.lock:
            return
        # Under a limit later allocations would fail, and Python would abort.
        most = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
        if most != resource.RLIM_INFINITY and not _may_lock():
            remedy = _ALLOW.format(limit='memlock unlimited')
            self.refused.append(f'lock_memory: {most >> 10} KiB may be locked; {remedy}')
        else:
            from ctypes import CDLL, get_errno  # local import: only where it is asked for

            if CDLL(None, use_errno=True).mlockall(_CURRENT | _FUTURE):
                self.refused.append(f'lock_memory: {os.strerror(get_errno())}; add memory')
        self.in_force['Locked memory'] = _process_status('VmLck')

    def wrap_pace(self, pace: Pace) -> Pace:
        """Wrap a pace so that its thread first requests the settings."""

        def request_and_pace(loop: TickLoop, stopping: Event) -> None:
            self.refused += [*self._request_settings()]
            pace(loop, stopping)

        return request_and_pace if self.priority or self.processors else pace

    def _request_settings(self) -> Iterator[str]:
        """Make the requests for the calling thread; yield a line for each refused one."""
        if self.processors:
            with suppress(OSError, ValueError, OverflowError):  # such a processor may not exist
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
    return bool(int(_process_status('CapEff'), 16) >> _IPC_LOCK & 1)


def _process_status(key: str) -> str:
    """Return a value of this process from the kernel's status file."""
    lines = Path('/proc/self/status').read_text().splitlines()
    return next(line.split(':')[1].strip() for line in lines if line.startswith(f'{key}:'))


def leave_out_shared_memory() -> None:
    """
    Make Fast DDS use UDP only, unless the user has configured the transports.

    Call it before `rclpy.init`; it holds for this process and its children.
    """
    if not _is_configured():
        os.environ[_TRANSPORTS] = 'UDPv4'


def stay_on_this_machine() -> None:
    """
    Keep discovery within the machine, without shared memory unless the user configures it.

    Call it before `rclpy.init`; it holds for this process and its children. Clients with the
    discovery range LOCALHOST are found all the same.
    """
    fast_dds = get_rmw_implementation_identifier().startswith('rmw_fastrtps')
    if _is_configured() or not fast_dds:
        os.environ[_RANGE] = 'LOCALHOST'
    else:
        os.environ |= {_RANGE: 'SYSTEM_DEFAULT', _PROFILE: str(shipped_path('fastdds/local.xml'))}


def _is_configured() -> bool:
    """Return whether the user has configured the transports."""
    return any(map(os.environ.get, _CONFIGURED)) or any(Path(name).is_file() for name in _PROFILES)


def standstill_reason() -> str:
    """
    Return why ticks may stand still when a subscriber comes, and the remedy; '' if they do not.

    The process's memory maps decide: with the discovery range LOCALHOST rmw_fastrtps uses shared
    memory whatever the environment says, and a context made by other code has chosen its
    transports already.
    """
    if not get_rmw_implementation_identifier().startswith('rmw_fastrtps'):
        return ''
    try:
        shared = _SHARED.search(Path('/proc/self/maps').read_text())
    except OSError:  # not Linux
        return ''
    if shared is None:
        return ''
    return (
        'Fast DDS uses shared memory: ticks may stand still for 0.33 s when a subscriber comes; '
        'start the process with FASTDDS_BUILTIN_TRANSPORTS=UDPv4, or, in the place of '
        'ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST, with the profile config/fastdds/local.xml'
    )
