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


"""What it costs to lose less: how often the disk is waited for, and how messages are packed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from linkage_ros.accuracy.recording.cost import Cost, measure_costs, settings
from linkage_ros.accuracy.recording.recorded_run import FASTEST
from linkage_ros.accuracy.results import Axis, Curve, Diagram, Part, Point, Table
from linkage_ros.accuracy.spread import Spread
from linkage_ros.bag.storage import COMPRESSIONS, NONE
from linkage_ros.scene.scene import Scene

FLUSH_PERIODS = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
"""How often the disk is waited for, in [s]; from what a scene may ask for."""

PACKED_AT = 1.0
"""The flush period at which the compressions are compared, in [s]."""

QUICK_PERIODS = (0.05, 0.2)
QUICK_PACKED_AT = 0.2

_WANTED = (0.1, 1.0, 5.0)
_NEAR = 0.9
"""What of the processor time of a flush period the least has to be for it to be near that."""

_NOT_PACKED = 'not packed'


def measure_recording(
    scene: Scene, folder: Path, quick: bool, told: Callable[[str, float], None]
) -> Part:
    """
    Measure what recording a scene costs.

    Parameters
    ----------
    scene
        The scene.
    folder
        Where the bags of the measurement are made and removed again: on the disk that is asked
        about.
    quick
        Whether a few seconds are to do.
    told
        Takes what is done and how much of it, 0 to 1, now and then.

    Raises
    ------
    RecordingError
        A bag cannot be made there, or ended early.

    """
    periods, packed_at = (QUICK_PERIODS, QUICK_PACKED_AT) if quick else (FLUSH_PERIODS, PACKED_AT)
    costs = measure_costs(
        scene, folder, settings(periods, packed_at, folder), 0.4 if quick else 1.3,
        1 if quick else 3, told,
    )  # fmt: skip
    return part_of(scene, costs, quick=quick)


def part_of(scene: Scene, costs: Sequence[Cost], *, quick: bool = False) -> Part:
    """Return what was found as a part of the page."""
    bags = [cost for cost in costs if cost.setting]
    return Part(
        'recording',
        'Recording: what a crash can lose, and what it costs to lose less',
        list(_text(scene, costs, quick=quick)),
        [
            Diagram(
                'recording_cpu',
                "What a message costs the recorder's thread, against what a power cut may take",
                Axis('a power cut may take', 'ms'),
                Axis('processor time for a message', 'µs', logarithmic=False),
                _curves(bags, lambda cost: cost.cpu),
            ),
            Diagram(
                'recording_waits',
                'How long the recorder waits for the disk, against what a power cut may take',
                Axis('a power cut may take', 'ms'),
                Axis('waiting for the disk in a second', 'ms'),
                _curves(bags, lambda cost: cost.waited),
            ),
        ],
        [_table(costs)],
        list(_advice(bags)),
    )


def _curves(bags: Sequence[Cost], value: Callable[[Cost], Spread]) -> list[Curve]:
    curves = []
    for packed in COMPRESSIONS:
        points = [
            Point(cost.stake.middle, value(cost).middle, cost.stake, value(cost), cost.name)
            for cost in bags
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
                # A message a microsecond would be a core.
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


def _text(scene: Scene, costs: Sequence[Cost], *, quick: bool) -> Iterator[str]:
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
            f'{shortest.name} is the shortest period here whose processor time is near the least, '
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
