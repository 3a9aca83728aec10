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
What a process has done, where its killer can read it: memory of a file that both have mapped.

What is stored there is there at once, and stays when the process is killed; a pipe would hold back
what was not yet written to it. Each number is eight aligned bytes, stored by one instruction.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import mmap
from pathlib import Path
from time import monotonic_ns

from campaigns.kills.plan import Phase

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

    Attributes
    ----------
    times
        When each tick began, in [ns] of the steady clock; 0 for one that has not.

    """

    def __init__(self, file: Path) -> None:
        with file.open('r+b') as stream:
            self._map = mmap.mmap(stream.fileno(), 0)
        self._numbers = memoryview(self._map).cast('q')
        self.times = self._numbers[_FIRST_TICK:]

    @classmethod
    def make(cls, file: Path, ticks: int) -> Marks:
        """Make the file for so many ticks, and return its marks."""
        file.write_bytes(bytes(8 * (_FIRST_TICK + ticks)))
        return cls(file)

    def close(self) -> None:
        self.times.release()
        self._numbers.release()
        self._map.close()

    @property
    def phase(self) -> Phase:
        """Return what is being done, or was when the process was killed."""
        return Phase(self._numbers[_STATE] % _PHASES)

    @property
    def offered(self) -> int:
        """Return how many messages the recorder was given, or was being given."""
        return self._numbers[_OFFERED]

    @offered.setter
    def offered(self, count: int) -> None:
        self._numbers[_OFFERED] = count

    @property
    def safe(self) -> int:
        """Return how many messages a flush, split or close had brought to the disk."""
        return self._numbers[_SAFE]

    @safe.setter
    def safe(self, count: int) -> None:
        self._numbers[_SAFE] = count

    @property
    def ticks(self) -> int:
        """Return how many ticks have begun."""
        return self._numbers[_TICKS]

    def begin_tick(self) -> int:
        """Note that a tick begins; return when, in [ns]."""
        number, now = self._numbers[_TICKS], monotonic_ns()
        self.times[number] = now
        self._numbers[_TICKS] = number + 1
        return now

    def enter(self, phase: Phase) -> int:
        """Note what is being done from now on; return when that is, in [ns]."""
        now = monotonic_ns()
        # One number, so that a kill cannot come between phase and time.
        self._numbers[_STATE] = now * _PHASES + phase
        return now

    @contextmanager
    def pause(self, phase: Phase) -> Iterator[None]:
        """Note for how long the disk is worked for, and nothing is taken."""
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
        """Return for how long of a time, all in [ns], the disk was worked for."""
        count = min(self._numbers[_PAUSES], _MOST_PAUSES)
        pauses = [
            (self._numbers[at], self._numbers[at + 1])
            for at in range(_FIRST_PAUSE, _FIRST_PAUSE + 2 * count, 2)
        ]
        since, phase = divmod(self._numbers[_STATE], _PHASES)
        if phase in (Phase.FLUSHING, Phase.SPLITTING, Phase.CLOSING):
            pauses.append((since, end))
        return sum(max(0, min(end, till) - max(begin, since)) for since, till in pauses)
