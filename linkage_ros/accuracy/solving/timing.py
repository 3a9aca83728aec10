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
How long methods take, measured in turn, in one process.

Each is run in blocks that are long for the clock; the blocks of all methods follow each other
there and back again, so that a drift of the machine favours none. A time is the median of the
blocks, with their quartiles: of the thread's processor time, so that what else runs on the machine
is not in it, save for what it does to the caches.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import gc
from time import perf_counter, thread_time
from typing import NamedTuple

from linkage_ros.accuracy.spread import Spread, spread_of

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
    told: Callable[[float], None] = lambda _: None,
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
    told
        Takes how much is done, 0 to 1.
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
        for number in range(rounds):
            for (run, states), count, found in forward if number % 2 == 0 else forward[::-1]:
                gc.disable()
                begun = clock()
                for _ in range(count):
                    run()
                taken = clock() - begun
                if collecting:
                    gc.enable()
                found.append(taken / (count * states))
            told((number + 1) / rounds)
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
