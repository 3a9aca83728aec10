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
What every measurement shares: quartiles, taking turns, and the description of the machine.

Contenders take turns in one process: they run in blocks, forward in one round and backward in the
next, so that a drift of the machine favours none. A time is the median of its blocks, with the
quartiles. It is the processor time of the thread, so other load on the machine adds nothing to it
but what that load does to the caches.
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
"""Takes the share of a measurement that is done, 0 to 1; what it raises ends the measurement."""


class Spread(NamedTuple):
    """The quartiles of what was measured several times."""

    low: float
    middle: float
    high: float


def percentile(values: Sequence[float], percent: float) -> float:
    """Return a percentile, interpolated between neighbours; NaN of an empty sequence."""
    if not values:
        return nan
    ordered = sorted(values)
    rank = (len(ordered) - 1) * percent / 100.0
    below = int(rank)
    above = min(below + 1, len(ordered) - 1)
    return ordered[below] + (rank - below) * (ordered[above] - ordered[below])


def alternating(items: Sequence[Item], rounds: int) -> Iterator[Item]:
    """Yield items forward in one round and backward in the next: no drift favours one of them."""
    for number in range(rounds):
        yield from items if number % 2 == 0 else reversed(items)


def spread_of(values: Sequence[float]) -> Spread:
    """Return the quartiles of some values; of a single one, that."""
    return Spread(*(percentile(values, percent) for percent in (25.0, 50.0, 75.0)))


BLOCK = 1e-3
"""How long a block is to be at least, in [s]: hundreds of times what reading the clock takes."""

_FINE = 20e-6
"""How often a clock has to go on, in [s]."""

FEWEST, MOST = 5, 200
"""Rounds."""


class Contender(NamedTuple):
    """What is timed: a call, and how many states it solves."""

    run: Callable[[], object]
    states: int


def in_turn(
    contenders: Sequence[Contender],
    seconds: float,
    progress: Progress = lambda _: None,
    clock: Callable[[], float] | None = None,
) -> list[Spread]:
    """
    Return how long each takes for a state, in [s].

    Parameters
    ----------
    contenders
        What is timed; each is run once before.
    seconds
        About how long all may take; the fewest rounds are made even if that takes longer.
    progress
        Called after each block with the share that is done, 0 to 1.
    clock
        Tells the time, in [s]; that of the thread, if not said.

    """
    clock = clock or _thread_clock()
    repeats, block_time = [], 0.0
    for run, _ in contenders:
        run()
        begun = clock()
        run()
        once = max(clock() - begun, 1e-7)
        repeats.append(max(1, round(BLOCK / once)))
        block_time += repeats[-1] * once
    rounds = min(MOST, max(FEWEST, int(seconds / block_time))) if contenders else 0
    times: list[list[float]] = [[] for _ in contenders]
    forward = [*zip(contenders, repeats, times, strict=True)]
    collecting = gc.isenabled()
    try:
        turns = enumerate(alternating(forward, rounds), 1)
        for done, ((run, states), count, found) in turns:
            gc.disable()
            begun = clock()
            for _ in range(count):
                run()
            taken = clock() - begun
            if collecting:
                gc.enable()
            found.append(taken / (count * states))
            progress(done / (rounds * len(forward)))
    finally:
        if collecting:
            gc.enable()
    return [spread_of(found) for found in times]


def _thread_clock() -> Callable[[], float]:
    """Return the clock of this thread's processor time; where that is too coarse, the wall's."""
    begun, first = perf_counter(), thread_time()
    while thread_time() == first:
        if perf_counter() - begun > _FINE:
            return perf_counter
    return thread_time


_CPU = Path('/proc/cpuinfo')
_GOVERNOR = Path('/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor')


def describe_machine() -> list[tuple[str, str]]:
    """Return names and values: the processor, the system, and the versions that count."""
    model = None
    with suppress(OSError):
        model = re.search(r'^model name\s*: (.+)$', _CPU.read_text(), re.MULTILINE)
    return [
        ('processor', model.group(1) if model else platform.machine()),
        ('cores', str(os.cpu_count())),
        ('governor', _GOVERNOR.read_text().strip() if _GOVERNOR.exists() else 'unknown'),
        ('kernel', platform.release()),
        ('python', platform.python_version()),
        ('numpy', _version('numpy')),
        ('rclpy', _version('rclpy', 'ros-jazzy-rclpy')),
        ('middleware', os.environ.get('RMW_IMPLEMENTATION', 'as rclpy chooses')),
        ('linkage_ros', __version__),
    ]


def _version(*names: str) -> str:
    for name in names:
        with suppress(metadata.PackageNotFoundError):
            return metadata.version(name)
    return 'unknown'
