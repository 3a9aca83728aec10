# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A node that records to a disk that stalls: the effect on its ticks and its bag.

``python -m campaigns.reliability.stalling FILE ARGUMENTS…`` is the node on such a disk, where no
file system can be frozen. As long as FILE exists, no write and no flush of this process returns.
They stall in the interpreter, not in the kernel.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
import fcntl
from itertools import pairwise
from math import inf, isfinite
import os
from pathlib import Path
import signal
import sys
from tempfile import TemporaryDirectory
from time import monotonic, sleep, time_ns
from typing import Any, NamedTuple

from bench.processes import MeasurementError
from bench.report import say, Table
from campaigns.campaign import percentile_texts
from campaigns.reliability.filling import Disk, mounted
from campaigns.reliability.judge import Counts, counts_of, shortcomings
from campaigns.reliability.processes import recording_node
from linkage_ros.bag import read_bag
from linkage_ros.errors import BagError

_FREEZE, _THAW = 0xC0045877, 0xC0045878
_DISK = Disk('ext4, 256 MiB', 'ext4', 256)
_MOST_TO_END = 25.0
"""Time limit for a node to end while its disk does not respond [s]."""
_SECOND = 1_000_000_000
_GAP = 20_000_000
"""Lateness from which on ticks are lost [ns]."""
_SCENE = 'drive={constant_rate: {rate: 6.0}}', 'effects={velocity: {}}'


class Plan(NamedTuple):
    """
    One run of a node: durations are in [s], the rate in [Hz]; a stall of 0 is none.

    It stalls in the middle of the run. If the disk ``recovers``, it does before the node is ended.
    """

    name: str
    seconds: float
    stall: float
    queue: int = 20_000
    recovers: bool = True
    rate: int = 1000


PLANS = (
    Plan('none', 12.0, 0.0),
    Plan('2 s', 12.0, 2.0),
    Plan('4 s, a queue of 1 s', 12.0, 4.0, queue=1000),
    Plan('permanently', 8.0, 2.0, recovers=False),
)


@dataclass(slots=True)
class Stalled:
    """The outcome of a run."""

    plan: Plan  # The plan of the run
    counts: Counts = field(default_factory=dict)  # The bag's counts of messages
    # Number of ticks in the bag, and of those during the stall.
    ticks: int = 0
    during: int = 0
    after: int = 0  # Number of ticks in the bag after the stall
    gaps: int = 0  # Number of missing ticks between the first and the last tick in the bag
    # Lateness of each tick in the bag outside and during the stall [ns].
    lateness: list[int] = field(default_factory=list)
    lateness_during: list[int] = field(default_factory=list)
    ended: float = 0.0  # Time from the signal to the end of the node [s]
    last_line: str = ''  # The node's last log line about the recording
    faults: list[str] = field(default_factory=list)  # The violations

    def total(self, kind: str) -> int:
        """Return the number of messages of a kind, such as 'dropped'."""
        return sum(self.counts.get(kind, {}).values())


def run(plan: Plan, *, frozen: bool) -> Stalled:
    """
    Run a node, and let its disk stall.

    A ``frozen`` file system stalls calls in the kernel; a NotPermittedError says that it cannot be
    mounted here. Otherwise the node stalls its own calls, see `main`.
    """
    with TemporaryDirectory(prefix='linkage_ros_stall_') as name:
        if not frozen:
            return _run(plan, Path(name), Path(name), Path(name) / 'stalls')
        with mounted(_DISK, Path(name)) as folder:
            return _run(plan, Path(name), folder, None)


def _run(plan: Plan, work: Path, folder: Path, file: Path | None) -> Stalled:
    done = Stalled(plan)
    slowed_by = ('campaigns.reliability.stalling', str(file)) if file else ()
    log = work / f'{"stalling" if file else "linkage_node"}.log'
    try:
        with recording_node(
            work,
            folder / 'bag',
            plan.seconds + 60,
            'four_bar',
            [f'rate={plan.rate}', *_SCENE],
            f'flush_period: 0.5, queue: {plan.queue}',
            slowed_by,
        ) as (_, node):
            sleep(0.5 * (plan.seconds - plan.stall))
            begin = time_ns()
            with _stalled(folder, file, plan):
                sleep(plan.stall)
                end = time_ns()
                if not plan.recovers:
                    done.ended, done.last_line = _ended(node.pid, log)
            sleep(0.5 * (plan.seconds - plan.stall) if plan.recovers else 0.0)
            node.end_process()
            done.last_line = done.last_line or _last_line(log)
        if plan.recovers:
            # A run that lost messages has exit code 1.
            node.check_end(*((1,) if _drops(plan) else ()))
    except MeasurementError as error:
        done.faults.append(str(error))
        return done
    _judge(done, folder / 'bag', begin, end)
    return done


def _drops(plan: Plan) -> bool:
    """Return whether a stall has more messages than the queue holds."""
    return plan.stall * plan.rate > plan.queue


@contextmanager
def _stalled(folder: Path, file: Path | None, plan: Plan) -> Iterator[None]:
    """Let the disk of a folder stall, or the process that checks for a file."""
    if not plan.stall:
        yield
    elif file:
        file.touch()
        try:
            yield
        finally:
            file.unlink()
    else:
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            fcntl.ioctl(descriptor, _FREEZE, 0)
            try:
                yield
            finally:
                fcntl.ioctl(descriptor, _THAW, 0)
        finally:
            os.close(descriptor)


def _ended(pid: int, log: Path) -> tuple[float, str]:
    """End a node whose disk does not respond; return the time it took, and its last line."""
    begin = monotonic()
    os.kill(pid, signal.SIGINT)
    while monotonic() < begin + _MOST_TO_END:
        # A thread in the kernel cannot end before the disk responds. Until then the process is a
        # zombie, but all its Python threads have ended.
        if _state(pid) in 'Z ':
            return monotonic() - begin, _last_line(log)
        sleep(0.02)
    return inf, _last_line(log)


def _state(pid: int) -> str:
    """Return the state of the first thread of a process; ' ' if it has ended."""
    try:
        return Path(f'/proc/{pid}/stat').read_text().rpartition(') ')[2][0]
    except OSError:
        return ' '


def _last_line(log: Path) -> str:
    """Return the last line of a log about the recording, from its folder on."""
    lines = [line for line in log.read_text(errors='replace').splitlines() if '/bag: ' in line]
    return lines[-1].partition('/bag: ')[2] if lines else ''


def _judge(done: Stalled, folder: Path, begin: int, end: int) -> None:
    """Judge the bag by its counts and the times of its ticks; the stall is given in [ns]."""
    plan = done.plan
    try:
        bag = read_bag(folder, allow_truncated=not plan.recovers)
        times = [m.log_time for m in bag.messages() if m.topic == '/joint_states']
        done.counts = counts_of(folder) if plan.recovers else {}
    except BagError as error:
        done.faults.append(str(error))
        return
    period = round(1e9 / plan.rate)
    late = _lateness(times, period)
    inside = [begin <= time < end for time in times]
    done.ticks, done.during = len(times), sum(inside)
    done.after = sum(time >= end for time in times)
    done.lateness = [late for late, stalls in zip(late, inside, strict=True) if not stalls]
    done.lateness_during = [late for late, stalls in zip(late, inside, strict=True) if stalls]
    done.gaps = sum(round((b - a) / period) - 1 for a, b in pairwise(times) if b - a > _GAP)
    if not plan.recovers:
        if 'has not answered' not in done.last_line or done.ended == inf:
            done.faults.append(
                f'does not report that the disk has not answered: {done.last_line!r}'
            )
        return
    done.faults += shortcomings(folder, may_drop=_drops(plan))
    if _drops(plan) and not done.total('dropped'):
        done.faults.append('more messages than the queue holds, but none dropped')
    if not done.after:
        done.faults.append('nothing recorded after the stall')


def _lateness(times: Sequence[int], period: int) -> list[int]:
    """
    Return the lateness of each tick [ns].

    Ticks are due a period apart. Their due times are derived from the most punctual tick of each
    second, or of each stretch between two gaps.
    """
    found: list[int] = []
    stretch: list[int] = []
    for index, time in enumerate(times):
        if stretch and (time - times[index - 1] > _GAP or time - stretch[0] > _SECOND):
            found += _behind(stretch, period)
            stretch = []
        stretch.append(time)
    return found + _behind(stretch, period)


def _behind(times: Sequence[int], period: int) -> list[int]:
    offsets = [time - index * period for index, time in enumerate(times)]
    return [offset - min(offsets) for offset in offsets]


def stall_all() -> tuple[list[Table], list[str]]:
    """Carry out all plans; return the outcomes for ticks and for messages, and the faults."""
    ticks = Table(
        'Disks that stall: ticks',
        ('stall', 'ticks in the bag', 'missing', 'of these dropped', 'lateness, µs: p50',
         'p99', 'most', 'during the stall: ticks', 'p50', 'p99', 'most'),
    )  # fmt: skip
    messages = Table(
        'Disks that stall: messages',
        ('stall', 'received', 'recorded', 'dropped', 'node ended after, s', 'last line', 'faults'),
    )
    faults: list[str] = []
    for plan in PLANS:
        say(f'a disk that stalls: {plan.name}')
        done = run(plan, frozen=True)
        faults += [f'{fault}: {plan.name}' for fault in done.faults]
        dropped = done.counts.get('dropped', {}).get('/joint_states', 0)
        kinds = ('received', 'recorded', 'dropped')
        ticks.rows.append(
            (
                plan.name,
                f'{done.ticks:,}',
                f'{done.gaps:,}',
                f'{dropped:,}' if done.counts else '',
                *percentile_texts([t / 1e3 for t in done.lateness], 0),
                f'{done.during:,}',
                *percentile_texts([t / 1e3 for t in done.lateness_during], 0),
            )
        )
        messages.rows.append(
            (
                plan.name,
                *(f'{done.total(kind):,}' if done.counts else '' for kind in kinds),
                f'{done.ended:.1f}' if done.ended and isfinite(done.ended) else '',
                done.last_line.partition(', /linkage_node')[0],
                '; '.join(done.faults) or 'none',
            )
        )
    return [ticks, messages], faults


def _stalling(call: Callable[..., Any], file: Path) -> Callable[..., Any]:
    def stalled(*arguments: Any) -> Any:
        while file.exists():
            sleep(0.005)
        return call(*arguments)

    return stalled


def main() -> int:
    """Make the calls wait while the file exists, and run the node."""
    from linkage_ros.node import linkage_node  # local import: the campaign runs without ROS

    file = Path(sys.argv.pop(1))
    for name in ('fsync', 'pwrite', 'replace', 'posix_fallocate'):
        setattr(os, name, _stalling(getattr(os, name), file))
    return linkage_node.main()


if __name__ == '__main__':
    sys.exit(main())
