# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""`Recorder` never makes the tick wait, counts every message, and flushes when it should."""

import errno
import json
import os
from pathlib import Path
import threading
import time
from types import SimpleNamespace

from linkage_ros.bag import BagWriter, PLACE, read_bag, Recorder, Topic, UNFINISHED
import pytest
import yaml


class StalledWriter(BagWriter):
    """A writer whose disk stops answering at a message, until the test lets it go on."""

    def __init__(self, *arguments, answered=0):
        super().__init__(*arguments)
        self.reached, self.answer = threading.Event(), threading.Event()
        self.answered = answered

    def write(self, *message):
        if self.answered == 0:
            self.reached.set()
            self.answer.wait(30)
        else:
            self.answered -= 1
        return super().write(*message)


def _counts(summary):
    return [(counts.received, counts.recorded, counts.dropped) for counts in summary.topics]


def test_recorder_writes_every_offered_message(tmp_path, topics, messages, readers):
    recorder = Recorder(BagWriter(tmp_path / 'run', topics))
    for message in messages:
        recorder.offer(*message)
    summary = recorder.stop({'seed': '7'})
    assert _counts(summary) == [(6000, 6000, 0), (6000, 6000, 0)]
    assert summary.failure is None
    assert summary.folder == tmp_path / 'run'
    assert summary.size == (tmp_path / 'run' / 'run_0.mcap').stat().st_size
    readers.agree(tmp_path / 'run', topics, messages)


def test_bag_metadata_hold_received_and_dropped_counts(tmp_path, topics, messages):
    writer = StalledWriter(tmp_path / 'run', topics)
    recorder = Recorder(writer, capacity=0)
    for message in messages[:5]:
        recorder.offer(*message)
    writer.answer.set()
    recorder.stop({'seed': '7'})
    text = yaml.safe_load((tmp_path / 'run' / 'metadata.yaml').read_text())
    custom = text['rosbag2_bagfile_information']['custom_data']
    assert custom['seed'] == '7'
    assert json.loads(custom['linkage_ros.received']) == {'/crank': 3, '/arm/joint_states': 2}
    assert json.loads(custom['linkage_ros.dropped']) == {'/crank': 3, '/arm/joint_states': 2}


def test_stalled_disk_blocks_no_offer_and_overflow_is_counted(tmp_path, topics, messages, readers):
    writer = StalledWriter(tmp_path / 'run', topics)
    recorder = Recorder(writer, capacity=100)
    recorder.offer(*messages[0])
    assert writer.reached.wait(10)
    for message in messages[1:501]:
        recorder.offer(*message)
    # All 500 offers are back, and the writer still holds the first message in its hands.
    assert not writer.answer.is_set()
    counts = recorder.read_counts()
    assert sum(c.received for c in counts) == 501
    assert sum(c.recorded for c in counts) == 0
    assert all(c.received == c.recorded + c.dropped + c.waiting for c in counts)
    writer.answer.set()
    summary = recorder.stop()
    assert _counts(summary) == [(251, 51, 200), (250, 50, 200)]
    readers.agree(tmp_path / 'run', topics, messages[:101])


def test_message_held_by_the_writer_counts_as_waiting(tmp_path, topics, messages):
    writer = StalledWriter(tmp_path / 'run', topics)
    recorder = Recorder(writer)
    for message in messages[:4]:
        recorder.offer(*message)
    assert writer.reached.wait(10)
    looks = [(c.received, c.recorded, c.dropped, c.waiting) for c in recorder.read_counts()]
    assert looks == [(2, 0, 0, 2), (2, 0, 0, 2)]
    writer.answer.set()
    assert _counts(recorder.stop()) == [(2, 2, 0), (2, 2, 0)]


def test_recorder_counts_add_up_at_any_time(tmp_path, topics, messages):
    recorder = Recorder(BagWriter(tmp_path / 'run', topics))
    looks = []
    for message in messages:
        recorder.offer(*message)
        looks += recorder.read_counts()
    while any(counts.waiting for counts in recorder.read_counts()):
        looks += recorder.read_counts()
    recorder.stop()
    assert not [counts for counts in looks if counts.dropped]
    assert all(c.received == c.recorded + c.waiting for c in looks)
    assert any(counts.waiting for counts in looks)
    assert any(counts.recorded for counts in looks)


@pytest.mark.parametrize(
    ('size', 'wait'),
    [(400, 100), (PLACE - 1, 100), (PLACE, 50), (10 * PLACE, 10), (99 * PLACE, 1), (10**7, 1)],
)
def test_recorder_queue_is_bounded_in_bytes(tmp_path, topics, messages, size, wait):
    writer = StalledWriter(tmp_path / 'run', topics)
    recorder = Recorder(writer, capacity=100)
    recorder.offer(*messages[0])
    assert writer.reached.wait(10)
    data = bytes(size)  # the same for all: what counts is what they would take
    for message in messages[2:402:2]:
        recorder.offer(*message._replace(data=data))
    counts = recorder.read_counts()[0]
    in_hand = 1
    assert (counts.dropped, counts.waiting) == (200 - wait, wait + in_hand)
    assert wait * size <= 100 * PLACE + size
    writer.answer.set()
    assert _counts(recorder.stop())[0] == (201, wait + 1, 200 - wait)


def test_hanging_disk_does_not_delay_stop_beyond_its_timeout(tmp_path, topics, messages):
    writer = StalledWriter(tmp_path / 'run', topics, answered=4)
    recorder = Recorder(writer, flush_period=1000.0)
    for message in messages[:10]:
        recorder.offer(*message)
    assert writer.reached.wait(10)
    summary = recorder.stop(timeout=0.05)
    # Four are with the writer, but no flush has brought them to the disk.
    assert _counts(summary) == [(5, 0, 5), (5, 0, 5)]
    assert 'run: the disk has not answered for 0.05 s' in summary.failure
    writer.answer.set()
    assert recorder.stop() is summary


@pytest.mark.parametrize(
    ('number', 'said', 'for_good'),
    [
        (errno.ENOSPC, 'was interrupted: No space left on device', False),
        (errno.EIO, 'ended early: Input/output error', True),
    ],
)
def test_failing_disk_leaves_every_offered_message_counted(
    tmp_path, topics, messages, readers, monkeypatch, number, said, for_good
):
    recorder = Recorder(BagWriter(tmp_path / 'run', topics), flush_period=0.01)
    assert not recorder.has_ended
    pwrite = os.pwrite

    def failing(descriptor, data, offset):
        if offset > 300_000:
            raise OSError(number, os.strerror(number))
        return pwrite(descriptor, data, offset)

    def full(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr('os.pwrite', failing)
    monkeypatch.setattr('os.posix_fallocate', full)
    for message in messages[:6000]:
        recorder.offer(*message)
    for _ in range(2000):
        if recorder.failure:
            break
        threading.Event().wait(0.01)
    assert f'run: the recording {said}' in str(recorder.failure)
    assert not recorder.is_recording
    # A full disk may have room again.
    assert recorder.has_ended is for_good
    for message in messages[6000:]:
        recorder.offer(*message)
    looks = recorder.read_counts()
    assert all(c.received == c.recorded + c.dropped + c.waiting for c in looks)
    summary = recorder.stop()
    assert summary.failure == str(recorder.failure)
    assert [counts.received for counts in summary.topics] == [6000, 6000]
    assert all(c.received == c.recorded + c.dropped for c in summary.topics)
    assert [(c.dropped, c.waiting) for c in recorder.read_counts()] == [
        (c.dropped, 0) for c in summary.topics
    ]
    kept = sum(counts.recorded for counts in summary.topics)
    assert 500 < kept < 6000
    if number == errno.ENOSPC:
        readers.agree(tmp_path / 'run', topics, messages[:kept])
    text = yaml.safe_load((tmp_path / 'run' / 'metadata.yaml').read_text())
    custom = text['rosbag2_bagfile_information']['custom_data']
    assert custom['linkage_ros.failure'] == summary.failure
    # What came after the failure counts too: the bag says what the summary says.
    received, dropped = (json.loads(custom[f'linkage_ros.{w}']) for w in ('received', 'dropped'))
    assert [(received[c.name], dropped[c.name]) for c in summary.topics] == [
        (c.received, c.dropped) for c in summary.topics
    ]


def test_unexpected_exception_ends_the_recording_with_a_failure(
    tmp_path, topics, messages, monkeypatch
):
    recorder = Recorder(BagWriter(tmp_path / 'run', topics))

    def broken(*message):
        raise ZeroDivisionError('a slip')

    monkeypatch.setattr(recorder._writer, 'write', broken)
    recorder.offer(*messages[0])
    recorder.offer(*messages[1])
    summary = recorder.stop()
    assert 'ended early: ZeroDivisionError: a slip; please report this' in summary.failure
    assert _counts(summary) == [(1, 0, 1), (1, 0, 1)]
    assert list(read_bag(tmp_path / 'run').messages()) == []


def test_message_with_an_impossible_time_is_dropped_alone(tmp_path, topics, messages, readers):
    recorder = Recorder(BagWriter(tmp_path / 'run', topics))
    for message in [messages[0], messages[1]._replace(log_time=-1), *messages[2:10]]:
        recorder.offer(*message)
    assert _counts(recorder.stop()) == [(5, 5, 0), (5, 4, 1)]
    readers.agree(tmp_path / 'run', topics, [messages[0], *messages[2:10]])


def test_message_offered_after_stop_is_counted_as_dropped(tmp_path, topics, messages):
    recorder = Recorder(BagWriter(tmp_path / 'run', topics))
    recorder.offer(*messages[0])
    summary = recorder.stop()
    recorder.offer(*messages[0])
    assert recorder.stop() is summary
    assert [c.dropped for c in recorder.read_counts()] == [1, 0]


@pytest.mark.parametrize('capacity', [50, 10**6])
def test_concurrent_offers_lose_no_count(tmp_path, topics, messages, readers, capacity):
    recorder = Recorder(BagWriter(tmp_path / 'run', topics), capacity=capacity)
    start = threading.Barrier(4)

    def offer_all():
        start.wait()
        for message in messages[:5000]:
            recorder.offer(*message)

    threads = [threading.Thread(target=offer_all) for _ in range(4)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        for counts in recorder.read_counts():
            assert counts.waiting >= 0
            assert counts.recorded >= 0
    summary = recorder.stop(timeout=60)
    assert [counts.received for counts in summary.topics] == [10_000, 10_000]
    assert all(c.received == c.recorded + c.dropped for c in summary.topics)
    found = readers.mcap(tmp_path / 'run' / 'run_0.mcap')
    assert len(found) == sum(counts.recorded for counts in summary.topics)
    if capacity > 50:
        assert len(found) == 20_000


def test_metadata_of_a_running_recording_count_flushed_messages(
    tmp_path, topics, messages, monkeypatch
):
    monkeypatch.setattr('linkage_ros.bag.writer._RENEWAL', 0.0)

    def information():
        text = (tmp_path / 'run' / 'metadata.yaml').read_text()
        return yaml.safe_load(text)['rosbag2_bagfile_information']

    writer = BagWriter(tmp_path / 'run', topics)
    monkeypatch.setattr(writer, '_due', 0.0)
    recorder = Recorder(writer, flush_period=0.02)
    before = information()
    assert list(before['custom_data']) == [UNFINISHED]
    assert (before['message_count'], before['relative_file_paths']) == (0, ['run_0.mcap'])
    for message in messages[:10]:
        recorder.offer(*message)
    for _ in range(500):
        if information()['message_count'] == 10:
            break
        threading.Event().wait(0.02)
    now = information()
    assert now['message_count'] == 10
    assert list(now['custom_data']) == [UNFINISHED]
    assert now['starting_time']['nanoseconds_since_epoch'] == min(
        m.log_time for m in messages[:10]
    )
    recorder.stop()
    assert UNFINISHED not in information()['custom_data']


def test_metadata_skipped_by_one_flush_are_renewed_later(tmp_path, topics, messages, monkeypatch):
    def count():
        text = (tmp_path / 'run' / 'metadata.yaml').read_text()
        return yaml.safe_load(text)['rosbag2_bagfile_information']['message_count']

    now = 0.0
    monkeypatch.setattr('linkage_ros.bag.writer.time.monotonic', lambda: now)
    writer = BagWriter(tmp_path / 'run', topics)
    counts = []
    for instant, written in ((0.0, 1), (0.1, 2), (0.9, 0), (1.0, 1), (1.1, 0), (1.8, 0)):
        now = instant
        for message in messages[:written]:
            writer.write(*message)
        writer.flush()
        counts.append(count())
    writer.close()
    assert counts == [0, 0, 3, 3, 3, 4]


def test_waiting_message_is_flushed_within_a_period(tmp_path, topics, messages):
    recorder = Recorder(BagWriter(tmp_path / 'run', topics), flush_period=0.02)
    recorder.offer(*messages[0])
    for _ in range(500):
        if recorder._flushed_counts == (1, 0):
            break
        threading.Event().wait(0.02)
    found = list(read_bag(tmp_path / 'run', allow_truncated=True).messages())
    recorder.stop()
    assert [message.data for message in found] == [messages[0].data]


# When the recorder flushes, on a clock that only the recorder's own doings move.


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
def clock(monkeypatch):
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
def test_flushes_begin_a_period_apart_or_at_once(tmp_path, clock, flush, between):
    writer = Writer(tmp_path / 'run', clock, flush)
    recorder = Recorder(writer, flush_period=PERIOD)
    while len(writer.flushes) < 20 and recorder.failure is None:
        time.sleep(0.001)
    recorder.stop()
    begun = [begin for begin, _ in writer.flushes[:20]]
    assert begun == pytest.approx([BETWEEN + index * between for index in range(20)])


def test_recorder_writes_its_backlog_before_the_next_flush(tmp_path, clock):
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
    for index in range(5000):
        recorder.offer(0, index, index, b'\0\1\0\0')
    go_on.set()
    while len(writer.flushes) < 2 and recorder.failure is None:
        time.sleep(0.001)
    recorder.stop()
    assert [written for _, written in writer.flushes[:2]] == [0, 5000]


def test_unending_messages_are_flushed_every_two_periods(tmp_path, clock):
    writer = Writer(tmp_path / 'run', clock, flush=0.0, write=1e-4)
    recorder = Recorder(writer, capacity=10**6, flush_period=PERIOD)
    write = writer.write

    def write_and_offer(*message: object) -> bool:
        if writer.written < 20_000:
            recorder.offer(0, 1, 1, b'\0\1\0\0')
        return write(*message)  # type: ignore[arg-type]

    writer.write = write_and_offer  # type: ignore[method-assign]
    for index in range(100):
        recorder.offer(0, index, index, b'\0\1\0\0')
    while writer.written < 20_000 and recorder.failure is None:
        time.sleep(0.001)
    recorder.stop()
    # 20,000 messages take 2 s by the clock; at the latest every two periods there is a flush.
    between = [b - a for (a, _), (b, _) in zip(writer.flushes, writer.flushes[1:], strict=False)]
    assert len(writer.flushes) > 9
    assert max(between) < 2.1 * PERIOD
