# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""``python -m campaigns.kills.child``: the process whose recording is killed."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
import json
import os
from pathlib import Path
import sys
from time import monotonic_ns, sleep

from campaigns.kills.plan import ATTACHMENTS, Marks, message, PERIOD_NS, Phase, TOPICS
from linkage_ros.bag import BagSummary, BagWriter, Recorder, Storage

_SWITCH_INTERVAL = 1e-4  # as the node has it [s]


class _MarkedWriter(BagWriter):
    """
    Marks its progress; ``signal_pipe`` gets a byte at the beginning of each phase.

    A message counts as safe when a flush after it has returned.
    """

    def __init__(self, marks: Marks, signal_pipe: int, folder: Path, storage: Storage) -> None:
        self._marks, self._signal_pipe = marks, signal_pipe
        self._written = 0
        self._enter(Phase.MAKING)
        super().__init__(folder, TOPICS, ATTACHMENTS, storage)
        self._enter(Phase.RECORDING)

    def write(self, topic: int, log_time: int, publish_time: int, data: bytes) -> bool:
        accepted = super().write(topic, log_time, publish_time, data)
        self._written += 1
        return accepted

    def flush(self) -> None:
        self._signal(Phase.FLUSHING)
        with self._marks.pause(Phase.FLUSHING):
            super().flush()
            self._marks.safe = self._written

    def close(self, custom: Mapping[str, str] | None = None) -> BagSummary:
        self._signal(Phase.CLOSING)
        with self._marks.pause(Phase.CLOSING):
            summary = super().close(custom)
            self._marks.safe = self._written
        self._enter(Phase.CLOSED)
        return summary

    def _split(self) -> None:
        self._signal(Phase.SPLITTING)
        with self._marks.pause(Phase.SPLITTING):
            super()._begin_next_file()
            self._marks.safe = self._written

    def _enter(self, phase: Phase) -> None:
        self._signal(phase)
        self._marks.enter(phase)

    def _signal(self, phase: Phase) -> None:
        os.write(self._signal_pipe, bytes([phase]))


def main() -> int:
    """Record, close, and wait to be killed."""
    parser = argparse.ArgumentParser('python -m campaigns.kills.child', description=__doc__)
    parser.add_argument('folder', type=Path, help='folder of the bag')
    parser.add_argument('marks', type=Path, help='file of the marks')
    parser.add_argument('signal_pipe', type=int, help='file descriptor')
    parser.add_argument('ticks', type=int)
    parser.add_argument('storage', type=json.loads)
    arguments = parser.parse_args()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    marks, storage = Marks(arguments.marks), Storage(**arguments.storage)
    writer = _MarkedWriter(marks, arguments.signal_pipe, arguments.folder, storage)
    recorder = Recorder(writer, flush_period=storage.flush_period)
    begin = monotonic_ns()
    for tick in range(arguments.ticks):
        wait = begin + tick * PERIOD_NS - monotonic_ns()
        if wait > 0:
            sleep(wait * 1e-9)
        now = marks.begin_tick()
        for index in range(2 * tick, 2 * tick + 2):
            offered = message(index, now)
            marks.offered = index + 1
            recorder.offer(*offered)
    summary = recorder.stop(timeout=60.0)
    if summary.failure or any(counts.dropped for counts in summary.topics):
        print(summary.failure, file=sys.stderr)
        return 1
    # Wait for the kill, or end if it does not come.
    sleep(60.0)
    return 1


if __name__ == '__main__':
    sys.exit(main())
