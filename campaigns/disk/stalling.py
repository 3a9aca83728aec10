# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""A node that records to a disk that stalls: the effect on its ticks and its bag."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
import fcntl
from itertools import pairwise
from math import inf
import os
from pathlib import Path
import signal
from tempfile import TemporaryDirectory
from time import monotonic, sleep, time_ns
from typing import NamedTuple

from campaigns.disk.filling import Disk, mounted
from campaigns.endurance.memory import Counts, counts_of
from linkage_ros.bag import METADATA_FILE, read_bag
from linkage_ros.errors import BagError
from linkage_ros.processes import Graph, MeasurementError, private_domain

_FREEZE, _THAW = 0xC0045877, 0xC0045878
_DISK = Disk('ext4, 256 MiB', 'ext4', 256)
_START = 20.0  # [s]
_MOST_TO_END = 25.0
"""Time limit for a node to end while its disk does not respond [s]."""
_SECOND = 1_000_000_000
_GAP = 20_000_000
"""Lateness from which on ticks are lost [ns]."""
_SCENE = """\
linkage: {linkage}
rate: {rate}
drive: {{constant_rate: {{rate: 6.0}}}}
effects: {{velocity: {{}}}}
record: {{directory: {folder}, name: bag, flush_period: 0.5, queue: {queue}}}
"""
_LINKAGE = Path(__file__).parents[2] / 'config' / 'linkages' / 'four_bar.yaml'


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

    Parameters
    ----------
    plan
        The plan of the run.
    frozen
        Whether to freeze a file system, which stalls calls in the kernel; otherwise `slow_node`
        stalls its own calls.

    Raises
    ------
    NotPermittedError
        A file system cannot be mounted here.

    """
    with TemporaryDirectory(prefix='linkage_ros_stall_') as name:
        if not frozen:
            return _run(plan, Path(name), Path(name), Path(name) / 'stalls')
        with mounted(_DISK, Path(name)) as folder:
            return _run(plan, Path(name), folder, None)


def _run(plan: Plan, work: Path, folder: Path, file: Path | None) -> Stalled:
    done = Stalled(plan)
    scene = work / 'scene.yaml'
    scene.write_text(
        _SCENE.format(linkage=_LINKAGE, rate=plan.rate, folder=folder, queue=plan.queue)
    )
    # Below 102, so that the ports stay below the kernel's ephemeral ones.
    graph = Graph(private_domain(), work, longest=round(plan.seconds) + 60)
    arguments = ['--ros-args', '-p', f'scene:={scene}']
    module = 'linkage_ros.node.linkage_node'
    if file:
        module, arguments = 'campaigns.disk.slow_node', [str(file), *arguments]
    log = work / f'{module.rsplit(".", 1)[-1]}.log'
    try:
        with graph.run_module(module, arguments) as node:
            until = monotonic() + _START
            while not (folder / 'bag' / METADATA_FILE).exists() and monotonic() < until:
                node.check_running()
                sleep(0.05)
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
    if not done.counts:
        done.faults.append('the bag has no counts')
    for topic, received in done.counts.get('received', {}).items():
        recorded, dropped = (done.counts[kind][topic] for kind in ('recorded', 'dropped'))
        if received != recorded + dropped:
            done.faults.append(f'{topic}: the counts do not add up')
        if dropped and not _drops(plan):
            done.faults.append(f'{topic}: {dropped} dropped')
    if done.counts and done.counts['recorded']['/joint_states'] != done.ticks:
        done.faults.append(f'{done.ticks} ticks in the bag, another number in its counts')
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
