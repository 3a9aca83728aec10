# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Quartiles, alternating blocks and the description of the machine, shared by all measurements.

Contenders alternate in one process: they run in blocks, forward in one round and backward in the
next, so that a drift of the machine favours none. A time is the median of its blocks, with the
quartiles. It is the processor time of the thread: other load on the machine affects it only
through the caches.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
import gc
from importlib import metadata
from math import nan
import os
from pathlib import Path
import platform
import re
from time import perf_counter, thread_time
from typing import NamedTuple, TypeVar

from linkage_ros import __version__

Item = TypeVar('Item')

Progress = Callable[[float], None]
"""Takes the fraction of a measurement that is done, 0 to 1; an exception ends the measurement."""

BLOCK = 1e-3
"""Minimum duration of a block, in [s]: hundreds of times the duration of reading the clock."""

_FINE = 20e-6
"""Coarsest acceptable resolution of a clock, in [s]."""

FEWEST, MOST = 5, 200
"""Minimum number of rounds."""

_CPU = Path('/proc/cpuinfo')
_GOVERNOR = Path('/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor')


class Spread(NamedTuple):
    """The quartiles of repeated measurements."""

    low: float
    middle: float
    high: float

    def scale(self, factor: float) -> Spread:
        """Return the quartiles in a unit that is smaller by a factor."""
        return Spread(*(factor * value for value in self))


def percentile(values: Sequence[float], percent: float) -> float:
    """Return a percentile, interpolated between neighbours; NaN of an empty sequence."""
    if not values:
        return nan
    ordered = sorted(values)
    rank = (len(ordered) - 1) * percent / 100.0
    below = int(rank)
    above = min(below + 1, len(ordered) - 1)
    return ordered[below] + (rank - below) * (ordered[above] - ordered[below])


def alternate_order(items: Sequence[Item], rounds: int) -> Iterator[Item]:
    """Yield items forward in one round and backward in the next, so that drift favours none."""
    for index in range(rounds):
        yield from items if index % 2 == 0 else reversed(items)


def spread_of(values: Sequence[float]) -> Spread:
    """Return the quartiles of some values; of a single value, that value."""
    return Spread(*(percentile(values, percent) for percent in (25.0, 50.0, 75.0)))


class Candidate(NamedTuple):
    """A call to be timed, and the number of states that it solves."""

    run: Callable[[], object]
    states: int


def time_in_turn(candidates: Sequence[Candidate], seconds: float) -> list[Spread]:
    """
    Return the time that each candidate takes per state, in [s]; each is run once before.

    The whole takes about ``seconds``, or longer if the minimum number of rounds does.
    """
    clock, repeats, block_time = thread_clock(), [], 0.0
    for run, _ in candidates:
        run()
        begun = clock()
        run()
        once = max(clock() - begun, 1e-7)
        repeats.append(max(1, round(BLOCK / once)))
        block_time += repeats[-1] * once
    rounds = min(MOST, max(FEWEST, int(seconds / block_time))) if candidates else 0
    times: list[list[float]] = [[] for _ in candidates]
    forward = [*zip(candidates, repeats, times, strict=True)]
    collecting = gc.isenabled()
    try:
        for (run, states), count, durations in alternate_order(forward, rounds):
            gc.disable()
            begun = clock()
            for _ in range(count):
                run()
            taken = clock() - begun
            if collecting:
                gc.enable()
            durations.append(taken / (count * states))
    finally:
        if collecting:
            gc.enable()
    return [spread_of(durations) for durations in times]


def thread_clock() -> Callable[[], float]:
    """Return the clock of this thread's processor time; if it is too coarse, the wall clock."""
    begun, first = perf_counter(), thread_time()
    while thread_time() == first:
        if perf_counter() - begun > _FINE:
            return perf_counter
    return thread_time


def describe_machine() -> list[tuple[str, str]]:
    """Return names and values: the processor, the system, and the versions that matter."""
    model = None
    with suppress(OSError):
        model = re.search(r'^model name\s*: (.+)$', _CPU.read_text(), re.MULTILINE)
    return [
        ('processor', model.group(1) if model else platform.machine()),
        ('cores', str(os.cpu_count())),
        ('governor', _GOVERNOR.read_text().strip() if _GOVERNOR.exists() else 'unknown'),
        ('kernel', platform.release()),
        ('python', platform.python_version()),
        ('numpy', _installed_version('numpy')),
        ('rclpy', _installed_version('rclpy', 'ros-jazzy-rclpy')),
        ('middleware', os.environ.get('RMW_IMPLEMENTATION', 'as rclpy chooses')),
        ('linkage_ros', __version__),
    ]


def _installed_version(*names: str) -> str:
    for name in names:
        with suppress(metadata.PackageNotFoundError):
            return metadata.version(name)
    return 'unknown'
