# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The plan of a recording and of its kill, and the marks by which the recording shows its progress.

Marks are in a file that both processes have mapped into memory. A value stored there is visible at
once and survives the kill; a pipe would lose data not yet written to it. Each number is eight
aligned bytes, stored by one instruction.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from enum import IntEnum
import mmap
from pathlib import Path
from random import Random
from time import monotonic_ns
from typing import NamedTuple

from linkage_ros.bag import BagMessage, COMPRESSIONS, QosProfile, Storage, Topic
from linkage_ros.messages import JointStateWriter

PERIOD_NS = 1_000_000
"""Period of the ticks: 1 kHz."""

FLUSH_PERIODS = (0.05, 0.1, 0.25, 0.5, 1.0)  # [s]

_TYPE = 'sensor_msgs/msg/JointState'
_HASH = 'RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e'
_LINE = 80 * '=' + '\n'
_DEFINITION = f"""\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{_LINE}MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_LINE}MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
TOPICS = (
    Topic('/crank_states', _TYPE, _DEFINITION, _HASH, QosProfile(depth=5)),
    Topic('/joint_states', _TYPE, _DEFINITION, _HASH),
)
ATTACHMENTS = {
    'scene.yaml': ('application/yaml', b'linkage: four_bar.yaml\nrate: 1000\n' * 10),
    'linkage.yaml': ('application/yaml', b'four_bar: {a: 0.04, b: 0.12, c: 0.08, d: 0.1}\n' * 10),
}


class Phase(IntEnum):
    """Phases of the recording, in order."""

    STARTING = 0
    MAKING = 1
    RECORDING = 2
    FLUSHING = 3
    SPLITTING = 4
    CLOSING = 5
    CLOSED = 6


class Plan(NamedTuple):
    """
    One kill of a recording with some storage options, which would end after a number of ticks.

    It comes after a delay in [s] from the beginning of a phase, at its occurrence ``time``, from
    1; MAKING, the first phase, aims at any instant.
    """

    number: int
    storage: Storage
    ticks: int
    aim: Phase
    time: int
    delay: float


AIMS: Mapping[Phase, float] = {
    # The longest delay from the beginning of a phase [s], twice its duration on a fast disk.
    Phase.MAKING: 0.008,
    Phase.FLUSHING: 0.002,
    Phase.SPLITTING: 0.010,
    Phase.CLOSING: 0.006,
}


def plans(seed: int, kills: int, aimed: int, seconds: tuple[float, float]) -> list[Plan]:
    """Return kills at random instants, then kills aimed at short phases; runs last ``seconds``."""
    return [
        _plan(Random(f'{seed} {index}'), index, aimed=index >= kills, seconds=seconds)
        for index in range(kills + aimed)
    ]


def _plan(random: Random, number: int, *, aimed: bool, seconds: tuple[float, float]) -> Plan:
    run = random.uniform(*seconds)
    phases = [*AIMS]
    aim = phases[number % len(phases)] if aimed else Phase.MAKING
    kinds = ['', 'bytes', 'seconds']
    if aim is Phase.SPLITTING:
        kinds, run = kinds[1:], seconds[1]
    split = random.choice(kinds)
    storage = Storage(
        flush_period=random.choice(FLUSH_PERIODS),
        split_bytes=random.randrange(20_000, 120_000) if split == 'bytes' else 0,
        split_seconds=random.uniform(0.05, 0.4) if split == 'seconds' else 0.0,
        keep_files=random.choice([0, 2, 3]) if split else 0,
        compression=random.choice(COMPRESSIONS),
    )
    delay = random.uniform(0.0, AIMS[aim] if aimed else run + 0.1)
    time = random.randrange(1, 5) if aim in (Phase.FLUSHING, Phase.SPLITTING) else 1
    return Plan(number, storage, round(run * 1e9 / PERIOD_NS), aim, time, delay)


_WRITE = (
    JointStateWriter(['crank_joint']).write,
    JointStateWriter(['coupler_joint', 'rocker_joint']).write,
)


def message(number: int, time: int) -> tuple[int, int, int, bytes]:
    """
    Return a numbered message for the recorder; messages of the crank and joint states alternate.

    Parameters
    ----------
    number
        From 0; two for each tick.
    time
        Time at which it is offered, in [ns]; its bytes contain number and time.

    """
    topic = number % len(TOPICS)
    joints = (float(number), 0.1 * number)[: topic + 1]
    return topic, time, time - 137_000, _WRITE[topic](time, joints, (1.0, -1.0)[: topic + 1], ())


def expected(number: int, time: int) -> BagMessage:
    """Return a numbered message as it has to be in the bag."""
    topic, log_time, publish_time, data = message(number, time)
    return BagMessage(TOPICS[topic].name, log_time, publish_time, data)


_STATE, _OFFERED, _SAFE, _PAUSES, _TICKS = range(5)
_FIRST_PAUSE = 8
_MOST_PAUSES = 256
_FIRST_TICK = _FIRST_PAUSE + 2 * _MOST_PAUSES
_PHASES = 8


class Marks:
    """
    The marks of one recording.

    Parameters
    ----------
    file
        The file; made by `make`.

    """

    def __init__(self, file: Path) -> None:
        with file.open('r+b') as stream:
            self._map = mmap.mmap(stream.fileno(), 0)
        self._numbers = memoryview(self._map).cast('q')
        # Begin of each tick, in [ns] of the steady clock; 0 before.
        self.times = self._numbers[_FIRST_TICK:]

    @classmethod
    def make(cls, file: Path, ticks: int) -> Marks:
        """Make the file for a number of ticks, and return its marks."""
        file.write_bytes(bytes(8 * (_FIRST_TICK + ticks)))
        return cls(file)

    def close(self) -> None:
        self.times.release()
        self._numbers.release()
        self._map.close()

    @property
    def phase(self) -> Phase:
        """Return the current phase, or the one in which the process was killed."""
        return Phase(self._numbers[_STATE] % _PHASES)

    @property
    def offered(self) -> int:
        """Return the number of messages offered to the recorder, with the current one."""
        return self._numbers[_OFFERED]

    @offered.setter
    def offered(self, count: int) -> None:
        self._numbers[_OFFERED] = count

    @property
    def safe(self) -> int:
        """Return the number of messages that a flush, split or close has brought to the disk."""
        return self._numbers[_SAFE]

    @safe.setter
    def safe(self, count: int) -> None:
        self._numbers[_SAFE] = count

    @property
    def ticks(self) -> int:
        """Return the number of ticks begun."""
        return self._numbers[_TICKS]

    def begin_tick(self) -> int:
        """Mark the begin of a tick; return its time in [ns]."""
        number, now = self._numbers[_TICKS], monotonic_ns()
        self.times[number] = now
        self._numbers[_TICKS] = number + 1
        return now

    def enter(self, phase: Phase) -> int:
        """Mark the begin of a phase; return its time in [ns]."""
        now = monotonic_ns()
        # One number, so that a kill cannot come between phase and time.
        self._numbers[_STATE] = now * _PHASES + phase
        return now

    @contextmanager
    def pause(self, phase: Phase) -> Iterator[None]:
        """Mark a phase in which the recorder waits for the disk and takes no messages."""
        begin = self.enter(phase)
        try:
            yield
        finally:
            end = self.enter(Phase.RECORDING)
            number = self._numbers[_PAUSES]
            at = _FIRST_PAUSE + 2 * (number % _MOST_PAUSES)
            self._numbers[at], self._numbers[at + 1] = begin, end
            self._numbers[_PAUSES] = number + 1

    def paused(self, begin: int, end: int) -> int:
        """Return the time, in [ns], that the recorder waited for the disk within an interval."""
        count = min(self._numbers[_PAUSES], _MOST_PAUSES)
        pauses = [
            (self._numbers[at], self._numbers[at + 1])
            for at in range(_FIRST_PAUSE, _FIRST_PAUSE + 2 * count, 2)
        ]
        since, phase = divmod(self._numbers[_STATE], _PHASES)
        if phase in (Phase.FLUSHING, Phase.SPLITTING, Phase.CLOSING):
            pauses.append((since, end))
        return sum(max(0, min(end, until) - max(begin, since)) for since, until in pauses)
