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


"""When the recorder flushes, on a clock that only the recorder's own doings move."""

from __future__ import annotations

from pathlib import Path
import threading
import time
from types import SimpleNamespace

from linkage_ros.bag.recorder import Recorder
from linkage_ros.bag.topic import Topic
from linkage_ros.bag.writer import BagWriter
import pytest

PERIOD = 0.1
BETWEEN = 0.09  # so that all is on the disk within the period


class Clock:
    """Stands in for time and threading: who waits moves it on, and does not wait."""

    def __init__(self) -> None:
        self.now = 0.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        time.sleep(0)
        self.now += seconds

    def event(self) -> SimpleNamespace:
        event = threading.Event()

        def wait(seconds: float) -> bool:
            self.sleep(seconds)
            return event.is_set()

        return SimpleNamespace(set=event.set, wait=wait)


class Writer(BagWriter):
    """Takes its time, by the clock, and notes when a flush begins and what was written by then."""

    def __init__(self, folder: Path, clock: Clock, flush: float, write: float = 0.0) -> None:
        self._clock, self._flush, self._write = clock, flush, write
        self.written = 0
        self.flushes: list[tuple[float, int]] = []
        super().__init__(folder, [Topic('/a', 'std_msgs/msg/Empty', '', '')])

    def write(self, topic: int, log_time: int, publish_time: int, data: bytes) -> bool:
        self._clock.now += self._write
        self.written += 1
        return super().write(topic, log_time, publish_time, data)

    def flush(self) -> None:
        self.flushes.append((self._clock.now, self.written))
        self._clock.now += self._flush


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    for name, stand_in in {
        'time': clock,
        'threading': SimpleNamespace(
            Event=clock.event, Thread=threading.Thread, Lock=threading.Lock
        ),
    }.items():
        monkeypatch.setattr(f'linkage_ros.bag.recorder.{name}', stand_in)
    return clock


@pytest.mark.parametrize(
    ('flush', 'between'),
    [
        # how long a flush takes, and from the beginning of one to that of the next
        (0.0, BETWEEN),
        (0.04, BETWEEN),
        (0.0899, BETWEEN),
        (0.25, 0.25),
    ],
)
def test_a_flush_begins_nearly_a_period_after_the_last_or_where_that_takes_longer_at_once(
    tmp_path: Path, clock: Clock, flush: float, between: float
) -> None:
    writer = Writer(tmp_path / 'run', clock, flush)
    recorder = Recorder(writer, flush_period=PERIOD)
    while len(writer.flushes) < 20 and recorder.failure is None:
        time.sleep(0.001)
    recorder.stop()
    begun = [begin for begin, _ in writer.flushes[:20]]
    assert begun == pytest.approx([BETWEEN + number * between for number in range(20)])


def test_a_backlog_is_written_before_a_slow_disk_is_waited_for_again(
    tmp_path: Path, clock: Clock
) -> None:
    # A flush takes ten periods, a batch of messages half a millisecond.
    writer = Writer(tmp_path / 'run', clock, flush=10 * PERIOD, write=1e-5)
    flush, begun, go_on = writer.flush, threading.Event(), threading.Event()

    def stalled() -> None:
        flush()
        begun.set()
        go_on.wait(10)

    writer.flush = stalled  # type: ignore[method-assign]
    recorder = Recorder(writer, flush_period=PERIOD)
    assert begun.wait(10)
    for number in range(5000):
        recorder.offer(0, number, number, b'\0\1\0\0')
    go_on.set()
    while len(writer.flushes) < 2 and recorder.failure is None:
        time.sleep(0.001)
    recorder.stop()
    assert [written for _, written in writer.flushes[:2]] == [0, 5000]


def test_what_comes_without_end_is_flushed_all_the_same(tmp_path: Path, clock: Clock) -> None:
    writer = Writer(tmp_path / 'run', clock, flush=0.0, write=1e-4)
    recorder = Recorder(writer, capacity=10**6, flush_period=PERIOD)
    write = writer.write

    def write_and_offer(*message: object) -> bool:
        if writer.written < 20_000:
            recorder.offer(0, 1, 1, b'\0\1\0\0')
        return write(*message)  # type: ignore[arg-type]

    writer.write = write_and_offer  # type: ignore[method-assign]
    for number in range(100):
        recorder.offer(0, number, number, b'\0\1\0\0')
    while writer.written < 20_000 and recorder.failure is None:
        time.sleep(0.001)
    recorder.stop()
    # 20,000 messages take 2 s by the clock; at the latest every two periods there is a flush.
    between = [b - a for (a, _), (b, _) in zip(writer.flushes, writer.flushes[1:], strict=False)]
    assert len(writer.flushes) > 9
    assert max(between) < 2.1 * PERIOD
