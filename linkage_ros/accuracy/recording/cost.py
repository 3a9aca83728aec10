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
What it costs to record a scene one way or another: processor, disk, and what a crash may lose.

Every setting records the scene's own messages in real time. The settings take turns, there and
back again, so that what else the machine does disturbs them alike.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
import tempfile
from typing import NamedTuple

from linkage_ros.accuracy.recording.recorded_run import record_run, Recorded
from linkage_ros.accuracy.spread import Spread, spread_of
from linkage_ros.bag.bag_file import compression_type
from linkage_ros.bag.storage import COMPRESSIONS, FLUSH_AFTER, NONE, Storage
from linkage_ros.errors import RecordingError
from linkage_ros.pipeline import Pipeline
from linkage_ros.scene.scene import Scene

_LONGER = 1.1
"""By which factor a run is longer than its flush period: there is at least one flush in it."""


NO_BAG = 'no bag'


class Cost(NamedTuple):
    """
    What a setting costs; of several runs the quartiles.

    Attributes
    ----------
    setting
        The setting; nothing for no bag.
    cpu
        What the recorder's thread works for a message, in [µs].
    waited
        How long it waits for the disk in a second, in [ms].
    waits
        How long it waits at a flush, of all flushes the median and the greatest, in [ms].
    stake
        What a power cut may take at worst, in [ms].
    stake_messages
        The same in messages, at the rate at which they come.
    written
        What the system is given for its disks, in [kB] a second; nothing where it does not say.
    size
        What a message takes in the bag with its share of the index, in [bytes].
    late, late_p99
        How late ticks are, the median and the 99th percentile, in [µs].
    dropped
        Messages that the recorder had no room for, in all runs.

    """

    setting: Storage | None
    cpu: Spread
    waited: Spread
    waits: tuple[float, float]
    stake: Spread
    stake_messages: float
    written: Spread | None
    size: Spread
    late: Spread
    late_p99: Spread
    dropped: int

    @property
    def flush_period(self) -> float:
        """Return how often the disk is waited for, in [s]; 0 where there is no bag."""
        return self.setting.flush_period if self.setting else 0.0

    @property
    def compression(self) -> str:
        """Return how messages are packed."""
        return self.setting.compression if self.setting else NONE

    @property
    def name(self) -> str:
        """Return what the setting is, as a scene says it."""
        if self.setting is None:
            return NO_BAG
        text = f'flush_period: {self.flush_period:g}'
        return text if self.compression == NONE else f'{text}, compression: {self.compression}'


def settings(periods: Sequence[float], packed_at: float, folder: Path) -> list[Storage | None]:
    """Return what is compared: no bag, the flush periods, and the compressions that are here."""
    found: list[Storage | None] = [None, *(Storage(flush_period=each) for each in periods)]
    here = [name for name in COMPRESSIONS if name != NONE and _is_here(name, folder)]
    return found + [Storage(flush_period=packed_at, compression=name) for name in here]


def measure_costs(
    scene: Scene,
    folder: Path,
    compared: Sequence[Storage | None],
    seconds: float,
    rounds: int,
    told: Callable[[str, float], None] = lambda *_: None,
) -> list[Cost]:
    """
    Record a scene with each setting in turn.

    Parameters
    ----------
    scene, folder, told
        As `measure_recording`.
    compared
        The settings; nothing for no bag.
    seconds
        How long a run is at least, in [s].
    rounds
        How many runs there are of each setting.

    """
    closures = Pipeline(scene).closures
    runs: list[list[Recorded]] = [[] for _ in compared]
    lengths = [max(seconds, _LONGER * each.flush_period if each else 0.0) for each in compared]
    done, whole = 0.0, rounds * sum(lengths)
    places = range(len(compared))
    with tempfile.TemporaryDirectory(prefix='recording_', dir=folder) as temporary:
        for number in range(rounds):
            for place in places if number % 2 == 0 else reversed(places):
                told('recording', done / whole)
                setting = compared[place]
                bag = Path(temporary, f'{number}_{place}') if setting else None
                length = lengths[place]
                runs[place].append(record_run(scene, closures, bag, setting or Storage(), length))
                done += length
    told('recording', 1.0)
    return [cost_of(setting, each) for setting, each in zip(compared, runs, strict=True)]


def cost_of(setting: Storage | None, runs: Sequence[Recorded]) -> Cost:
    """Return what a setting costs by some runs of it."""
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
    Return what a message costs the recorder's thread, in [µs].

    A run has one flush or a few: how many fall into it would show. So the flushes count with
    what one costs, as often as they come.
    """
    if setting is None or not run.received:
        return 0.0
    flushing = sum(flush.cpu for flush in run.flushes)
    between = FLUSH_AFTER * setting.flush_period * run.received / run.seconds
    writing = (run.cpu - flushing) / run.received
    return (writing + flushing / len(run.flushes) / between) * 1e-3


def _waited(run: Recorded, setting: Storage | None) -> float:
    """Return how long the recorder's thread waits for the disk in a second, in [ms]."""
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
