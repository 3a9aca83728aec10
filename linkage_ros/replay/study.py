# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
A study: a scene run many times, with other seeds and other values of its keys.

A run depends on its scene alone, so that a study gives the same numbers on one processor, on many,
and on the workers of a Dask scheduler. Each run is reduced where it runs: to a few numbers for
each joint, and to its positions at some instants. So memory is bounded by the number of runs, not
by their length.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing
from functools import partial
from itertools import islice, product
from math import inf, isfinite, sqrt
from multiprocessing import parent_process
import os
import signal
from threading import Thread
from typing import NamedTuple

from linkage_ros.description import parse_scene
from linkage_ros.errors import escape_unprintable, LinkageError, quote
from linkage_ros.replay.simulate import check_simulated, tick_times
from linkage_ros.tick import Pipeline
import numpy as np
from numpy.typing import NDArray

MOST_RUNS = 100_000
_MOST_VALUES = 20_000_000
_MOST_INSTANTS, _FEWEST_INSTANTS = 200, 20
_BLOCK = 4096
_AHEAD = 3  # Runs for each process that are in progress or wait for it.
QUANTITIES = ('', ' rate', ' effort')
"""What a reading has of a joint: its position, its rate, its effort."""

Settings = tuple[tuple[str, float], ...]


class ParameterSweep(NamedTuple):
    """A key of a scene as for ``--set``, and the values that it takes."""

    key: str
    values: tuple[float, ...]


class Study(NamedTuple):
    """
    What all runs of a study share: the scene of `parse_scene`, and the duration of a run in [s].

    Positions are kept at a number of instants.
    """

    name: str
    files: Mapping[str, bytes]
    folder: str
    seconds: float
    instants: int


class Statistics(NamedTuple):
    """One quantity of a joint over a run."""

    # In [rad] or [m], or per second, or [N·m] or [N]; not a number without a message.
    least: float
    most: float
    mean: float
    rms: float


class Outcome(NamedTuple):
    """A run of a study."""

    failure: str  # Why it did not run; '' if it did
    # Number of ticks, and of those that published a joint state.
    ticks: int
    messages: int
    # Under the heading of a quantity, in the order of the joints.
    statistics: Mapping[str, Statistics]
    # Of each joint at the instants, in [rad] or [m]; not a number where nothing was published.
    positions: NDArray[np.float64]


def sweep_of(text: str) -> ParameterSweep:
    """Read KEY=LOW:HIGH:N or KEY=a,b,c; a LinkageError if it is neither."""
    key, equals, values = text.partition('=')
    low, *rest = values.split(':')
    try:
        if not key or not equals:
            raise ValueError
        if rest:
            high, count = float(rest[0]), int(rest[1])
            if len(rest) > 2 or count < 2:
                raise ValueError
            if count > MOST_RUNS:
                raise _too_many(count)
            first = float(low)
            step = (high - first) / (count - 1)
            steps = (*(first + step * index for index in range(count - 1)), high)
        else:
            steps = tuple(map(float, values.split(',')))
        if not all(map(isfinite, steps)):
            raise ValueError
    except (ValueError, IndexError):
        raise LinkageError(
            f'--sweep {quote(text)}',
            'is neither KEY=LOW:HIGH:N nor KEY=a,b,c',
            'write numbers, as rate=100,1000 or loads.drive_inertia=1e-4:1e-3:10',
        ) from None
    if len(set(steps)) < len(steps):
        raise LinkageError(f'--sweep {quote(text)}', 'names a value twice', 'name each once')
    return ParameterSweep(key, steps)


def _too_many(count: int) -> LinkageError:
    return LinkageError(
        'the study', f'has {count:,} runs, more than {MOST_RUNS:,}', 'take fewer values or seeds'
    )


def runs_of(sweeps: Sequence[ParameterSweep], seeds: int, seed: int) -> list[Settings]:
    """
    Return the settings of each run: every combination of the values, with every seed.

    Raise `LinkageError` if there are too many, or if a key is swept twice.
    """
    keys = [sweep.key for sweep in sweeps]
    for key in keys:
        if keys.count(key) > 1 or (key == 'seed' and seeds > 1):
            raise LinkageError(f'--sweep {key}', 'is set twice', 'sweep each key once')
    count = max(seeds, 1)
    for sweep in sweeps:
        count *= len(sweep.values)
    if count > MOST_RUNS:
        raise _too_many(count)
    drawn = [('seed', [seed + index for index in range(seeds)])] if seeds > 1 else []
    axes = [*((sweep.key, sweep.values) for sweep in sweeps), *drawn]
    return [
        tuple(zip([key for key, _ in axes], values, strict=True))
        for values in product(*(values for _, values in axes))
    ]


def instants_of(runs: int, joints: int, ticks: int) -> int:
    """Return at how many instants a study of this size keeps positions."""
    room = _MOST_VALUES // max(1, runs * joints)
    return min(ticks, max(_FEWEST_INSTANTS, min(_MOST_INSTANTS, room)))


def run_one(study: Study, settings: Settings) -> Outcome:
    """Run a study's scene with settings; a scene that cannot run is an outcome, not an error."""
    try:
        written = [f'{key}={value!r}' for key, value in settings]
        scene = parse_scene(
            study.name, study.name, study.files, study.folder,
            trust_effects=True, settings=written,
        )  # fmt: skip
        ticks = check_simulated(scene, study.seconds)
        return _reduce_run(Pipeline(scene), tick_times(scene, ticks), study.instants)
    except LinkageError as error:
        failure = str(error)
    except Exception as error:  # noqa: BLE001 (the other runs go on)
        failure = f'unexpected {error!r}'
    return Outcome(escape_unprintable(failure), 0, 0, {}, np.empty((0, 0)))


def _reduce_run(pipeline: Pipeline, at: Sequence[int], instants: int) -> Outcome:
    """Tick a pipeline, and keep what a study needs."""
    lines, injection = pipeline.linkages, pipeline.injection
    joints = [line.scene_linkage.joint_names for line in lines]
    firsts = [sum(map(len, joints[:index])) for index in range(len(joints))]
    reduced = {
        (index, quantity): _Reduction(len(joints[index]))
        for index in range(len(lines))
        for quantity in QUANTITIES
    }
    kept = np.full((sum(map(len, joints)), instants), np.nan)
    last = max(1, instants - 1)
    wanted = {round(index * (len(at) - 1) / last): index for index in range(instants)}
    messages = 0
    for index, time in enumerate(at):
        now = time
        if injection is not None:
            injection.advance(time)
            now = injection.tick_time(time)
        tick = pipeline.tick(now)
        messages += bool(tick.message)
        place = wanted.get(index)
        for which, seen in enumerate(tick.states):
            reading = seen.reading
            if reading is None:
                continue
            values = (reading.joints, reading.rates, reading.efforts)
            for quantity, of_all in zip(QUANTITIES, values, strict=True):
                if of_all:
                    reduced[which, quantity].add_row(of_all)
            if place is not None:
                rows = slice(firsts[which], firsts[which] + len(reading.joints))
                kept[rows, place] = reading.joints
    statistics = {
        f'{joint}{quantity}': statistic
        for (which, quantity), reduction in reduced.items()
        for joint, statistic in zip(joints[which], reduction.column_statistics(), strict=False)
    }
    return Outcome('', len(at), messages, statistics, kept)


class _Reduction:
    """Least, greatest and mean values of many rows of one width, in little memory."""

    def __init__(self, width: int) -> None:
        self._rows: list[Sequence[float]] = []
        self._count = 0
        self._least, self._most = np.full(width, inf), np.full(width, -inf)
        self._sum, self._squares = np.zeros(width), np.zeros(width)

    def add_row(self, row: Sequence[float]) -> None:
        """Take a row."""
        self._rows.append(row)
        if len(self._rows) == _BLOCK:
            self._reduce_rows()

    def column_statistics(self) -> list[Statistics]:
        """Return the statistics of each column; none without rows."""
        self._reduce_rows()
        if not self._count:
            return []
        columns = zip(self._least, self._most, self._sum, self._squares, strict=True)
        return [
            Statistics(
                float(least), float(most), float(total) / self._count,
                sqrt(float(squares) / self._count),
            )
            for least, most, total, squares in columns
        ]  # fmt: skip

    def _reduce_rows(self) -> None:
        if not self._rows:
            return
        block = np.array(self._rows)
        self._count += len(block)
        self._least = np.minimum(self._least, block.min(axis=0))
        self._most = np.maximum(self._most, block.max(axis=0))
        self._sum += block.sum(axis=0)
        self._squares += (block * block).sum(axis=0)
        self._rows.clear()


def run_outcomes(
    study: Study, runs: Sequence[tuple[int, Settings]], workers: int, dask: str = ''
) -> Iterator[tuple[int, Outcome]]:
    """
    Yield the number of each run and its outcome, in the order in which they end.

    They run in a number of processes here, or on the workers of a Dask scheduler, if its address
    is not ''. A LinkageError says that the workers failed.
    """
    work = partial(_run_numbered, study)
    if dask:
        from linkage_ros.dask_workers import results_of  # local import: only with Dask

        with closing(results_of(work, lambda _threads: iter(runs), dask)) as results:
            yield from (result for _, result in results)
    elif workers == 1:
        yield from map(work, runs)
    else:
        yield from _in_processes(work, iter(runs), workers)


def _in_processes(
    work: Callable[[tuple[int, Settings]], tuple[int, Outcome]],
    waiting: Iterator[tuple[int, Settings]],
    workers: int,
) -> Iterator[tuple[int, Outcome]]:
    pool = ProcessPoolExecutor(workers, initializer=_begin_worker)
    running: set[Future[tuple[int, Outcome]]] = set()
    ended = False
    try:
        while not ended:
            ahead = islice(waiting, _AHEAD * workers - len(running))
            running |= {pool.submit(work, part) for part in ahead}
            done, running = wait(running, return_when=FIRST_COMPLETED)
            # Finished runs first: where a process was killed, all others fail with it.
            for future in sorted(done, key=lambda future: future.exception() is not None):
                yield future.result()
            ended = not done
    except BrokenProcessPool:
        ended = True
        raise LinkageError(
            'the study',
            'one of its processes was killed',
            'run the same command again: finished runs are kept; for less memory take fewer '
            '--workers',
        ) from None
    finally:
        # At its own end the processes end first: torn down with the interpreter, they write
        # a traceback now and then. A stop does not wait for runs.
        pool.shutdown(wait=ended, cancel_futures=True)


def _begin_worker() -> None:
    """Leave Ctrl-C to the parent, which ends this process; end with it if it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _run_numbered(study: Study, part: tuple[int, Settings]) -> tuple[int, Outcome]:
    number, settings = part
    return number, run_one(study, settings)
