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


"""``python -m campaigns.kills.child``: the recording that is killed."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
import json
import os
from pathlib import Path
import sys
from time import monotonic_ns, sleep

from campaigns.kills.plan import ATTACHMENTS, Marks, message, PERIOD_NS, Phase, TOPICS
from linkage_ros.bag.metadata import BagSummary
from linkage_ros.bag.recorder import Recorder
from linkage_ros.bag.storage import Storage
from linkage_ros.bag.writer import BagWriter

_SWITCH_INTERVAL = 1e-4  # as the node has it [s]


class _MarkedWriter(BagWriter):
    """
    Notes what it does; ``bell`` is a pipe that gets a byte at the beginning of each phase.

    A message is counted as safe when the flush has returned before which it was written.
    """

    def __init__(self, marks: Marks, bell: int, folder: Path, storage: Storage) -> None:
        self._marks, self._bell = marks, bell
        self._written = 0
        self._enter(Phase.MAKING)
        super().__init__(folder, TOPICS, ATTACHMENTS, storage)
        self._enter(Phase.RECORDING)

    def write(self, topic: int, log_time: int, publish_time: int, data: bytes) -> bool:
        taken = super().write(topic, log_time, publish_time, data)
        self._written += 1
        return taken

    def flush(self) -> None:
        self._ring(Phase.FLUSHING)
        with self._marks.pause(Phase.FLUSHING):
            super().flush()
            self._marks.safe = self._written

    def close(self, custom: Mapping[str, str] | None = None) -> BagSummary:
        self._ring(Phase.CLOSING)
        with self._marks.pause(Phase.CLOSING):
            summary = super().close(custom)
            self._marks.safe = self._written
        self._enter(Phase.CLOSED)
        return summary

    def _split(self) -> None:
        self._ring(Phase.SPLITTING)
        with self._marks.pause(Phase.SPLITTING):
            super()._split()
            self._marks.safe = self._written

    def _enter(self, phase: Phase) -> None:
        self._ring(phase)
        self._marks.enter(phase)

    def _ring(self, phase: Phase) -> None:
        os.write(self._bell, bytes([phase]))


def main() -> int:
    """Record, close, and wait to be killed."""
    parser = argparse.ArgumentParser('python -m campaigns.kills.child', description=__doc__)
    parser.add_argument('folder', type=Path, help='of the bag')
    parser.add_argument('marks', type=Path, help='the file for the marks')
    parser.add_argument('bell', type=int, help='descriptor of the pipe')
    parser.add_argument('ticks', type=int)
    parser.add_argument('storage', type=json.loads)
    given = parser.parse_args()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    marks, storage = Marks(given.marks), Storage(**given.storage)
    writer = _MarkedWriter(marks, given.bell, given.folder, storage)
    recorder = Recorder(writer, flush_period=storage.flush_period)
    begin = monotonic_ns()
    for tick in range(given.ticks):
        wait = begin + tick * PERIOD_NS - monotonic_ns()
        if wait > 0:
            sleep(wait * 1e-9)
        now = marks.begin_tick()
        for number in range(2 * tick, 2 * tick + 2):
            offered = message(number, now)
            marks.offered = number + 1
            recorder.offer(*offered)
    summary = recorder.stop(timeout=60.0)
    if summary.failure or any(counts.dropped for counts in summary.topics):
        print(summary.failure, file=sys.stderr)
        return 1
    # Killed here too, or when nobody is left to do it.
    sleep(60.0)
    return 1


if __name__ == '__main__':
    sys.exit(main())
