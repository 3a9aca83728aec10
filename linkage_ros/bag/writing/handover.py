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


"""What the threads have in common that take from a tick: naps, queues and how offers count."""

from __future__ import annotations

from itertools import count
import threading

POLL = 0.02
"""How often a thread looks for what was offered, in [s]."""

ROOM_POLL = 1.0
"""How often a recorder looks whether a disk that was full has room again, in [s]."""

BATCH, NAP = 50, 50e-6
"""
Messages between two naps of a thread, about 0.3 ms of work, and the nap [s].

It is not 0: with a nap of 0 the thread often takes the interpreter back before a waiting tick
wakes up.
"""


PLACE = 16 * 1024
"""
How large a message may be that takes one place in a queue [bytes]; a larger one takes more.

So a bound on the places is one on the bytes too, at most one message more for each thread that
offers. To count bytes, these threads would need a lock, and a tick would wait for it.
"""

Offered = tuple[int, int, int, bytes]
"""A message on its way: topic, log time, publish time [ns] and its CDR bytes."""


def in_places(message: Offered) -> tuple[Offered | None, ...]:
    """Return a message and, for each further `PLACE` that it fills, None; data is not copied."""
    return message, *(None,) * (len(message[3]) // PLACE)


class Tally:
    """
    A counter that several threads count up without a lock.

    Stepping an `itertools.count` is one C call, which threads cannot tear apart as they can
    ``n += 1``. It can only be read by stepping it, so the steps made for reading are taken off.
    """

    __slots__ = ('_reading', '_readings', 'add')

    def __init__(self) -> None:
        self.add = count().__next__
        self._readings = 0
        self._reading = threading.Lock()

    def value(self) -> int:
        with self._reading:
            steps = self.add() - self._readings
            self._readings += 1
            return steps
