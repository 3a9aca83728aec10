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
Cost of recording: processor time, disk writes, and the messages that a crash may lose.

Every setting records the scene's own messages in real time. The settings alternate, forward and
backward, so that other load on the machine disturbs them alike.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from statistics import median
import tempfile
from typing import NamedTuple

from linkage_ros.accuracy.recorded_run import FASTEST, record_run, Recorded
from linkage_ros.accuracy.results import Axis, Curve, Diagram, Part, Point, Table
from linkage_ros.bag.bag_file import compression_type
from linkage_ros.bag.storage import COMPRESSIONS, FLUSH_AFTER, NONE, Storage
from linkage_ros.errors import RecordingError
from linkage_ros.measuring import alternating, Progress, Spread, spread_of
from linkage_ros.pipeline.pipeline import Pipeline
from linkage_ros.scene.scene import Scene

_LONGER = 1.1
"""A run is longer than its flush period by this factor, so that it has at least one flush."""

NO_BAG = 'no bag'


class Cost(NamedTuple):
    """The cost of a setting: the quartiles of several runs."""

    setting: Storage | None  # The setting; None for no bag
    cpu: Spread  # Processor time of the recorder thread per message, in [µs]
    waited: Spread  # Time it waits for the disk, in [ms] per second
    # Time it waits per flush, median and maximum of all flushes, in [ms].
    waits: tuple[float, float]
    stake: Spread  # The longest time that a power cut can destroy, in [ms]
    stake_messages: float  # The same as a number of messages, at their rate
    # Data given to the disks, in [kB/s]; None if the system does not count them.
    written: Spread | None
    size: Spread  # Size of a message in the bag including its share of the index, in [bytes]
    # Lateness of ticks, median and 99th percentile, in [µs].
    late: Spread
    late_p99: Spread
    dropped: int  # Messages dropped because the recorder's queue was full, in all runs

    @property
    def flush_period(self) -> float:
        """Return the flush period, in [s]; 0 without a bag."""
        return self.setting.flush_period if self.setting else 0.0

    @property
    def compression(self) -> str:
        """Return the name of the compression."""
        return self.setting.compression if self.setting else NONE

    @property
    def name(self) -> str:
        """Return the setting as a scene file writes it."""
        if self.setting is None:
            return NO_BAG
        text = f'flush_period: {self.flush_period:g}'
        return text if self.compression == NONE else f'{text}, compression: {self.compression}'


def settings(
    scene: Scene, periods: Sequence[float], packed_at: float, folder: Path
) -> list[Storage | None]:
    """Return no bag, the flush periods, the installed compressions, and what the scene has."""
    compared: list[Storage | None] = [None, *(Storage(flush_period=each) for each in periods)]
    here = [name for name in COMPRESSIONS if name != NONE and _is_here(name, folder)]
    compared += [Storage(flush_period=packed_at, compression=name) for name in here]
    own = own_setting(scene)
    return compared if own in compared else [*compared, own]


def own_setting(scene: Scene) -> Storage:
    """Return the setting of a scene; the default if it records no bag."""
    given = scene.record.storage if scene.record else Storage()
    return Storage(flush_period=given.flush_period, compression=given.compression)


def measure_costs(
    scene: Scene,
    folder: Path,
    compared: Sequence[Storage | None],
    seconds: float,
    rounds: int,
    progress: Progress = lambda _: None,
) -> list[Cost]:
    """
    Record a scene with each setting in turn; a setting of None writes no bag.

    ``seconds`` is the minimum duration of a run, ``rounds`` the number of runs of each setting.
    """
    closures = Pipeline(scene).closures
    runs: list[list[Recorded]] = [[] for _ in compared]
    lengths = [max(seconds, _LONGER * each.flush_period if each else 0.0) for each in compared]
    done, whole = 0.0, rounds * sum(lengths)
    with tempfile.TemporaryDirectory(prefix='recording_', dir=folder) as temporary:
        for place in alternating(range(len(compared)), rounds):
            progress(done / whole)
            setting, length = compared[place], lengths[place]
            bag = Path(temporary, f'{len(runs[place])}_{place}') if setting else None
            runs[place].append(record_run(scene, closures, bag, setting or Storage(), length))
            done += length
    progress(1.0)
    return [cost_of(setting, each) for setting, each in zip(compared, runs, strict=True)]


def cost_of(setting: Storage | None, runs: Sequence[Recorded]) -> Cost:
    """Return the cost of a setting from its runs."""
    flushes = [flush for run in runs for flush in run.flushes]
    waits = [(flush.end - flush.begin - flush.cpu) * 1e-6 for flush in flushes]
    stakes = [max((flush.stake for flush in run.flushes), default=0) * 1e-6 for run in runs]
    rates = [run.received / run.seconds for run in runs]
    written = [run.written[0] * 1e-3 / run.written[1] for run in runs if run.written]
    late = [sorted(run.ticks) for run in runs]
    return Cost(
        setting,
        cpu=spread_of([_cpu(run, setting) for run in runs]),
        waited=spread_of([_waited(run, setting) for run in runs]),
        waits=(median(waits), max(waits)) if waits else (0.0, 0.0),
        stake=spread_of(stakes),
        stake_messages=max(stakes) * 1e-3 * median(rates),
        written=spread_of(written) if written else None,
        size=spread_of([run.size / max(1, run.recorded) for run in runs]),
        late=spread_of([each[len(each) // 2] * 1e-3 for each in late]),
        late_p99=spread_of([each[99 * (len(each) - 1) // 100] * 1e-3 for each in late]),
        dropped=sum(run.dropped for run in runs),
    )


def _cpu(run: Recorded, setting: Storage | None) -> float:
    """
    Return the recorder thread's processor time per message, in [µs].

    A run has only one flush or a few, so their number would show in the result. Flushes therefore
    count with the cost of one, at the rate of the flush period.
    """
    if setting is None or not run.received:
        return 0.0
    flushing = sum(flush.cpu for flush in run.flushes)
    between = FLUSH_AFTER * setting.flush_period * run.received / run.seconds
    writing = (run.cpu - flushing) / run.received
    return (writing + flushing / len(run.flushes) / between) * 1e-3


def _waited(run: Recorded, setting: Storage | None) -> float:
    """Return how long the recorder thread waits for the disk, in [ms] per second."""
    if setting is None:
        return 0.0
    waits = sum(flush.end - flush.begin - flush.cpu for flush in run.flushes)
    return waits / len(run.flushes) / (FLUSH_AFTER * setting.flush_period) * 1e-6


def _is_here(name: str, folder: Path) -> bool:
    try:
        compression_type(name, folder)
    except RecordingError:
        return False
    return True


FLUSH_PERIODS = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
"""Flush periods, in [s], of those that a scene may set."""

PACKED_AT = 1.0
"""The flush period at which the compressions are compared, in [s]."""

QUICK_PERIODS = (0.05, 0.2)
QUICK_PACKED_AT = 0.2

_WANTED = (0.1, 1.0, 5.0)
_NEAR = 0.9
"""A flush period is near the cheapest if the minimum time is at least this fraction of its own."""

_SHORTEST = 'is the shortest period here'
_NOT_PACKED = 'not packed'


def measure_recording(scene: Scene, folder: Path, quick: bool, progress: Progress) -> Part:
    """
    Measure the cost of recording a scene.

    Parameters
    ----------
    scene, quick, progress
        See `linkage_ros.accuracy`.
    folder
        Folder on the disk to be measured; the bags are created there and removed again.

    Raises
    ------
    RecordingError
        If a bag cannot be created there, or ended early.

    """
    periods, packed_at = (QUICK_PERIODS, QUICK_PACKED_AT) if quick else (FLUSH_PERIODS, PACKED_AT)
    costs = measure_costs(
        scene, folder, settings(scene, periods, packed_at, folder),
        0.4 if quick else 1.3, 1 if quick else 3, progress,
    )  # fmt: skip
    return part_of(scene, costs, quick=quick)


def part_of(scene: Scene, costs: Sequence[Cost], *, quick: bool = False) -> Part:
    """Return the results as a part of the page."""
    bags = [cost for cost in costs if cost.setting]
    own = own_setting(scene)
    as_is = min(
        bags,
        key=lambda cost: (
            cost.compression != own.compression,
            abs(cost.flush_period - own.flush_period),
        ),
    )
    found = (
        f'recording costs {as_is.cpu.middle:.2g} µs a message and may lose '
        f'{as_is.stake.high * 1e-3:.2g} s in a crash'
    )
    advice = list(_advice(bags))
    near = next(each for each in advice if _SHORTEST in each)
    packed = [each for each in advice if each.startswith('compression')]
    return Part(
        'recording',
        'Recording: what a crash can lose, and what it costs to lose less',
        f'{found[0].upper()}{found[1:]}.',
        [near, *packed[-1:], *_lateness(costs)],
        list(_method(scene, quick=quick)),
        [
            Diagram(
                'recording_cpu',
                "What a message costs the recorder's thread, against what a power cut may take",
                Axis('a power cut may take', 'ms'),
                Axis('processor time for a message', 'µs', logarithmic=False),
                _curves(bags, lambda cost: cost.cpu),
                front=True,
            ),
            Diagram(
                'recording_waits',
                'How long the recorder waits for the disk, against what a power cut may take',
                Axis('a power cut may take', 'ms'),
                Axis('waiting for the disk in a second', 'ms'),
                _curves(bags, lambda cost: cost.waited),
                front=True,
            ),
        ],
        [_table(costs)],
        advice,
        found,
    )


def _curves(bags: Sequence[Cost], value: Callable[[Cost], Spread]) -> list[Curve]:
    curves = []
    for packed in COMPRESSIONS:
        points = [
            Point(cost.stake.middle, value(cost).middle, cost.stake, value(cost), cost.name)
            for cost in sorted(bags, key=lambda cost: cost.flush_period)
            if cost.compression == packed
        ]
        if points:
            curves.append(Curve(_NOT_PACKED if packed == NONE else packed, points))
    return curves


def _table(costs: Sequence[Cost]) -> Table:
    rows: list[tuple[float | str | Spread | None, ...]] = []
    for cost in costs:
        late = (cost.late, cost.late_p99)
        if cost.setting is None:
            rows.append((cost.name, *(None,) * 9, *late, None))
            continue
        rows.append(
            (
                cost.name,
                cost.stake,
                cost.stake_messages,
                cost.cpu,
                # One message per microsecond would use a full core.
                cost.cpu.middle * cost.stake_messages / cost.stake.high * 0.1,
                cost.waited,
                *cost.waits,
                cost.written,
                cost.size,
                *late,
                cost.dropped,
            )
        )
    columns = (
        'setting',
        'a power cut may take [ms]',
        'at worst [messages]',
        'processor time [µs/message]',
        'of a core [%]',
        'waiting for the disk [ms/s]',
        'a wait, median [ms]',
        'a wait, greatest [ms]',
        'given to the disk [kB/s]',
        'in the bag [bytes/message]',
        'ticks late, median [µs]',
        'ticks late, p99 [µs]',
        'dropped [messages]',
    )
    return Table('recording', 'What each way to record costs', columns, rows)


def _method(scene: Scene, *, quick: bool) -> Iterator[str]:
    rate = min(scene.rate or FASTEST, FASTEST)
    yield (
        f'The scene ticked at {rate:g} Hz in real time, in process and without a graph, and every '
        "message went to a recorder as the node has it. The settings took turns; each run's bag "
        'was made on the disk that the page is written to, and removed.'
    )
    yield (
        'A power cut may take what was recorded since the flush before the last began, until the '
        'last is done: the flush period, and the wait for the disk. A kill takes no more.'
    )
    yield (
        "Processor time is that of the recorder's thread alone, all of it until the bag is "
        'closed. Waiting is what a flush takes beyond its processor time: fsync of the file, once '
        'a second that of metadata.yaml, and where the machine is busy the turn of others. What '
        'was given to the disk is as Linux counts it: a page of which a part is new counts whole, '
        'and in a file system in memory nothing does.'
        + (' In so short a run metadata.yaml is not renewed.' if quick else '')
    )


def _lateness(costs: Sequence[Cost]) -> Iterator[str]:
    without = next((cost.late_p99.middle for cost in costs if not cost.setting), None)
    with_bag = [cost.late_p99.middle for cost in costs if cost.setting]
    if without is not None and with_bag:
        yield (
            f'Without a bag one tick in a hundred was late by {without:.0f} µs or more; beside '
            f'the recorder it was {min(with_bag):.0f} to {max(with_bag):.0f} µs.'
        )


def _advice(bags: Sequence[Cost]) -> Iterator[str]:
    plain = [cost for cost in bags if cost.compression == NONE]
    before = ''
    for wanted in _WANTED:
        good = [cost for cost in plain if cost.stake.high <= wanted * 1e3]
        if not good:
            yield f'No flush period here keeps what a power cut may take below {wanted:g} s.'
            continue
        best = min(good, key=lambda cost: cost.cpu.middle)
        if best.name != before:
            before = best.name
            yield (
                f'To lose at most {wanted:g} s to a power cut: {best.name}; at worst '
                f'{best.stake.high:,.0f} ms or {best.stake_messages:,.0f} messages were at stake, '
                f'for {best.cpu.middle:.1f} µs of processor time a message and '
                f'{best.waited.middle:.2g} ms of waiting for the disk in a second.'
            )
    if plain:
        least = min(cost.cpu.middle for cost in plain)
        near = [cost for cost in plain if cost.cpu.middle * _NEAR <= least]
        shortest = min(near, key=lambda cost: cost.stake.middle)
        yield (
            f'{shortest.name} {_SHORTEST} whose processor time is near the least, '
            f'{shortest.cpu.middle:.1f} µs a message and {least:.1f} µs.'
        )
    for loose in plain:
        for packed in bags:
            if packed.flush_period == loose.flush_period and packed.compression != NONE:
                yield (
                    f'compression: {packed.compression} makes the bag '
                    f'{loose.size.middle / packed.size.middle:.1f} times smaller; a message takes '
                    f'{packed.cpu.middle:.1f} µs of processor time, not packed '
                    f'{loose.cpu.middle:.1f} µs.'
                )
