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


"""What the threads have in common that take from a tick: how they nap, and how offers count."""

from __future__ import annotations

from itertools import count
import threading

POLL = 0.02
"""How often a thread looks for what was offered, in [s]."""

BATCH, NAP = 50, 50e-6
"""
Messages between two naps of a thread, about 0.3 ms of work, and the nap [s].

It is not 0: with a nap of 0 the thread often takes the interpreter back before a waiting tick
wakes up.
"""


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
