# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
The last seconds in memory, and the bags that are made of them.

What is kept is told as timelines and held against a plain list of all that was offered.
"""

from contextlib import suppress
from functools import partial
from itertools import accumulate
import json
import threading

from hypothesis import given, strategies
from linkage_ros.bag import (
    BagWriter,
    LastSeconds,
    read_bag,
    SnapshotMemory,
    SnapshotWriting,
)
from linkage_ros.errors import RecordingError
import pytest
import yaml

NS = 1_000_000_000
PLENTY = 10**9
A_BLOCK = 64 * 1024 + 1000
"""What is packed together, at most, with messages of these tests."""


def kept_of(offers, seconds, most=PLENTY):
    """Return what is kept of (topic, log time in s), as such pairs, and how many have gone."""
    last = LastSeconds(3, round(seconds * NS), most)
    for index, (topic, time) in enumerate(offers):
        last.add(topic, round(time * NS), index, b'%d' % index)
    while last.discard_old(7):
        pass
    kept = last.kept_content()
    messages = list(kept.messages())
    assert len(messages) == sum(kept.counts)
    assert all(data == b'%d' % number for _, _, number, data in messages)
    assert kept.is_complete == (not any(last.discarded))
    assert sum(kept.counts) + sum(last.discarded) == len(offers)
    return [(topic, log_time / NS) for topic, log_time, _, _ in messages]


TIMELINES = {
    # what is offered: (topic, log time [s]), and how many of the first are too old after 10 s
    'nothing': ([], 0),
    'younger than that': ([(0, 100), (0, 105), (0, 110)], 0),
    'just as old': ([(0, 100), (0, 110)], 0),
    'older by a nanosecond': ([(0, 100), (0, 100 + 1e-9), (0, 110 + 1e-9)], 1),
    'in the order of the offers': ([(0, 100), (1, 99), (0, 105), (1, 104), (0, 112)], 2),
    'a long silence': ([(0, 100), (0, 101), (0, 200)], 2),
    # A simulation begins anew: 4 s have passed before, 3 s since.
    'the clock jumps back': ([(0, 100), (0, 104), (0, 0), (0, 3)], 0),
    # 4 s, then 7 s: what was 10 s ago is 11 s old now, what was at 101 is 10 s old.
    'time goes on from a jump back': ([(0, 100), (0, 101), (0, 104), (0, 0), (0, 7)], 1),
    'twice back': ([(0, 100), (0, 106), (0, 0), (0, 3), (0, -2), (0, 0)], 1),
    # Of pairs 0.3 s out of order 0.4 s apart, to 12.5 s; the first five are older than 2.5 s.
    'times out of order': ([(0, 100 + 0.2 * n + 0.5 * (n % 2 == 0)) for n in range(62)], 10),
    'the clock jumps ahead': ([(0, 100), (0, 104), (0, 5000), (0, 5001)], 2),
    # The clock of topic 1 lies an hour behind: what passes there is what counts.
    'clocks that differ': ([(0, 5000), (1, 1400), (0, 5001), (1, 1401), (0, 5002)], 0),
    # Topic 1 follows the jump back 1 s later than topic 0 does.
    'a clock that lags': ([(0, 100), (1, 100), (0, 0), (1, 101), (0, 1), (1, 1), (0, 2)], 0),
    # A minute passes by topic 0, whose clock has jumped back since topic 1 spoke last.
    'a rare topic': (
        [(1, 100), (0, 100), (0, 40), *((0, 40 + n) for n in range(60)), (1, 99)],
        52,
    ),
}


@pytest.mark.parametrize('case', TIMELINES)
def test_memory_discards_messages_older_than_its_span(case):
    offers, gone = TIMELINES[case]
    assert kept_of(offers, 10.0) == offers[gone:]


@given(
    strategies.lists(
        strategies.tuples(strategies.integers(0, 2), strategies.integers(0, 400)), max_size=300
    ),
    strategies.integers(0, 1000),
)
def test_memory_keeps_exactly_the_last_seconds(steps, hundredths):
    span = hundredths * 10_000_000
    times = accumulate(step * 10_000_000 for _, step in steps)
    offers = [(topic, 0) for topic in range(3)]
    offers += [(topic, time) for (topic, _), time in zip(steps, times, strict=True)]
    last = LastSeconds(3, span, PLENTY)
    for topic, time in offers:
        last.add(topic, time, 0, b'')
        while last.discard_old(1):
            pass
    found = [(topic, time) for topic, time, _, _ in last.kept_content().messages()]
    newest = max(time for _, time in offers)
    assert found == [(topic, time) for topic, time in offers if newest - time <= span]


def test_memory_at_its_size_limit_discards_oldest_ticks():
    last = LastSeconds(2, 1000 * NS, 1_000_000)
    for tick in range(20_000):
        for topic in (0, 1):
            last.add(topic, tick * NS // 1000, tick, bytes(100))
        while last.discard_old(100):
            pass
    seconds, size, crowded = last.measure_extent()
    assert crowded
    assert 1_000_000 - A_BLOCK < size <= 1_000_000
    kept = last.kept_content()
    # Of each message 100 bytes are its own; what else it takes is told in the documents.
    assert 100 < size / sum(kept.counts) < 135
    assert seconds == pytest.approx(kept.counts[0] / 1000, abs=0.0015)
    messages = list(kept.messages())
    assert [topic for topic, *_ in messages] == [0, 1] * kept.counts[0]
    assert messages[-1][1] == 19_999 * NS // 1000


def test_taken_content_stays_unchanged_while_the_memory_records():
    last = LastSeconds(1, NS, PLENTY)
    for index in range(1000):
        last.add(0, index * 1_000_000, index, b'before')
    kept = last.kept_content()
    for index in range(1000, 9000):
        last.add(0, index * 1_000_000, index, b'since')
        last.discard_old(10)
    assert [number for _, _, number, _ in kept.messages()] == list(range(1000))
    assert min(number for _, _, number, _ in last.kept_content().messages()) == 7999


# The buffer: messages from any thread.


@pytest.fixture
def memory(topics):
    """Return a function that makes a memory, which is ended when the test is."""
    memories = []

    def make(seconds=1000.0, most=PLENTY, **options):
        memories.append(SnapshotMemory(topics, seconds, most, **options))
        return memories[-1]

    yield make
    for one in memories:
        one.stop()


def closes(counts):
    return all(
        c.received == c.recorded + c.discarded + c.dropped and c.recorded >= 0 for c in counts
    )


def test_snapshot_holds_every_message_offered_before(memory, messages):
    memory = memory()
    for message in messages[:5000]:
        memory.offer(*message)
    kept = memory.take_content()
    assert list(kept.messages()) == [tuple(message) for message in messages[:5000]]
    assert kept.is_complete
    assert [(c.received, c.recorded) for c in memory.stop()] == [(2500, 2500), (2500, 2500)]


def test_snapshot_after_discarding_is_marked_incomplete(memory, messages):
    memory = memory(1.0)
    for message in messages:
        memory.offer(*message)
    kept = memory.take_content()
    assert not kept.is_complete
    counts = memory.read_counts()
    assert closes(counts)
    assert tuple(c.recorded for c in counts) == kept.counts
    assert all(c.discarded > 4000 for c in counts)
    there = list(kept.messages())
    begin = len(messages) - len(there)
    assert there == [tuple(message) for message in messages[begin:]]
    assert kept.seconds <= 1.0


def test_concurrent_offers_to_the_memory_lose_no_count(memory, messages):
    memory = memory(0.5)
    start = threading.Barrier(4)

    def offer_all():
        start.wait()
        for message in messages[:5000]:
            memory.offer(*message)

    threads = [threading.Thread(target=offer_all) for _ in range(4)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        assert closes(memory.read_counts())
        kept = memory.take_content()
        assert len(list(kept.messages())) == sum(kept.counts)
    kept = memory.take_content()
    counts = memory.stop()
    assert closes(counts)
    assert [c.received for c in counts] == [10_000, 10_000]
    assert [c.dropped for c in counts] == [0, 0]
    assert tuple(c.recorded for c in counts) == kept.counts


def test_memory_drops_messages_of_impossible_times_alone(memory, messages):
    memory = memory()
    impossible = [messages[2]._replace(log_time=-1), messages[3]._replace(publish_time=2**63)]
    for message in [*messages[:2], *impossible, *messages[4:6]]:
        memory.offer(*message)
    assert list(memory.take_content().messages()) == [
        tuple(m) for m in (*messages[:2], *messages[4:6])
    ]
    assert [(c.received, c.recorded, c.dropped) for c in memory.stop()] == [(3, 2, 1), (3, 2, 1)]


def test_overloaded_memory_drops_and_counts_messages(memory, messages):
    memory = memory(capacity=100)
    with memory._lock:  # as if the machine had no time for it
        for message in messages[:1000]:
            memory.offer(*message)
        assert closes(memory.read_counts())
    # A message of the thread's own batch may have been on its way.
    counts = memory.stop()
    assert closes(counts)
    assert 100 <= sum(c.recorded for c in counts) <= 150


def test_unexpected_exception_ends_the_memory_with_a_failure(memory, messages, monkeypatch):
    def broken(*message):
        raise ZeroDivisionError('a slip')

    memory = memory()
    memory.offer(*messages[0])
    memory.take_content()
    monkeypatch.setattr(memory._last, 'add', broken)
    memory.offer(*messages[1])
    memory._thread.join(20)
    memory.offer(*messages[2])
    assert 'ended early: ZeroDivisionError: a slip; please report this' in str(memory.failure)
    with pytest.raises(RecordingError, match='a slip'):
        memory.take_content()
    assert [(c.received, c.recorded, c.discarded, c.dropped) for c in memory.stop()] == [
        (2, 0, 1, 1),
        (1, 0, 1, 0),
    ]


def test_stopped_memory_keeps_no_further_message(memory, messages):
    memory = memory()
    memory.offer(*messages[0])
    assert [c.recorded for c in memory.stop()] == [1, 0]
    memory.offer(*messages[0])
    assert [c.dropped for c in memory.read_counts()] == [1, 0]
    with pytest.raises(RecordingError, match='has ended; ask while the node is active'):
        memory.take_content()


# The bags.


def written(kept, make):
    return SnapshotWriting(kept, make, lambda: None).wait()


def counts_of(summary):
    return [(c.received, c.recorded, c.dropped) for c in summary.topics]


def said_in(folder):
    """Return the account in a bag's metadata: received and dropped, by topic."""
    text = yaml.safe_load((folder / 'metadata.yaml').read_text())
    custom = text['rosbag2_bagfile_information']['custom_data']
    return [json.loads(custom[f'linkage_ros.{word}']) for word in ('received', 'dropped')]


def test_two_snapshots_are_two_overlapping_bags(tmp_path, topics, messages, memory, readers):
    memory = memory(3.0)
    for index, (begin, end) in enumerate(((0, 8000), (8000, 12_000))):
        for message in messages[begin:end]:
            memory.offer(*message)
        folder = tmp_path / f'run_{index}'
        kept = memory.take_content()
        done = threading.Event()
        make = partial(BagWriter, folder, topics)
        outcome = SnapshotWriting(kept, make, done.set).wait()
        assert done.wait(10)
        assert outcome.failure is None
        assert counts_of(outcome) == [(n, n, 0) for n in kept.counts]
        # 3 s of 2 messages each ms; the crank of the first tick may have gone before its joints.
        assert 5990 <= sum(kept.counts) <= 6002
        oldest = end - sum(kept.counts)
        readers.agree(folder, topics, messages[oldest:end])
        received, dropped = said_in(folder)
        assert list(received.values()) == list(kept.counts)
        assert list(dropped.values()) == [0, 0]


def test_full_disk_truncates_the_snapshot_and_keeps_the_memory(
    small_disk, topics, messages, memory, readers
):
    memory = memory()
    for message in messages:
        memory.offer(*message)
    kept = memory.take_content()
    outcome = written(kept, lambda: BagWriter(small_disk / 'run', topics))
    assert outcome.failure.startswith(
        f'{small_disk}/run: the recording was interrupted: No space left on device; '
    )
    there = sum(c.recorded for c in outcome.topics)
    assert 2000 < there < len(messages)
    assert [c.received for c in outcome.topics] == [6000, 6000]
    assert all(c.received == c.recorded + c.dropped for c in outcome.topics)
    readers.agree(small_disk / 'run', topics, messages[:there])
    received, dropped = said_in(small_disk / 'run')
    assert list(received.values()) == [6000, 6000]
    assert sum(dropped.values()) == len(messages) - there
    # With little room left no bag is begun; the memory still has all.
    with (small_disk / 'other').open('wb', buffering=0) as other, suppress(OSError):
        while True:
            other.write(bytes(4096))
    outcome = written(memory.take_content(), lambda: BagWriter(small_disk / 'more', topics))
    assert isinstance(outcome, RecordingError)
    assert 'cannot be recorded to: No space left on device' in str(outcome)
    assert not (small_disk / 'more').exists()
    assert list(memory.take_content().messages()) == list(kept.messages())


def test_snapshot_into_an_impossible_folder_fails_alone(tmp_path, topics, messages, memory):
    memory = memory()
    memory.offer(*messages[0])
    (tmp_path / 'file').write_text('')
    outcome = written(memory.take_content(), lambda: BagWriter(tmp_path / 'file' / 'run', topics))
    assert isinstance(outcome, RecordingError)
    assert 'Not a directory' in str(outcome)
    outcome = written(memory.take_content(), lambda: BagWriter(tmp_path / 'run', topics))
    assert counts_of(outcome) == [(1, 1, 0), (0, 0, 0)]


class StalledWriter(BagWriter):
    """A writer whose disk does not answer until the test lets it."""

    answer: threading.Event

    def write(self, *message):
        self.answer.wait(30)
        return super().write(*message)


def stalled(folder, topics):
    writer = StalledWriter(folder, topics)
    writer.answer = threading.Event()
    return writer


def test_stalled_disk_does_not_block_the_memory(tmp_path, topics, messages, memory, readers):
    memory = memory()
    for message in messages[:6000]:
        memory.offer(*message)
    writer = stalled(tmp_path / 'run', topics)
    writing = SnapshotWriting(memory.take_content(), lambda: writer, lambda: None)
    for message in messages[6000:]:
        memory.offer(*message)
    # All offers are back, and in memory, and nothing has reached the disk.
    assert sum(memory.take_content().counts) == len(messages)
    assert writing.outcome is None
    writer.answer.set()
    assert counts_of(writing.wait()) == [(3000, 3000, 0), (3000, 3000, 0)]
    readers.agree(tmp_path / 'run', topics, messages[:6000])


def test_snapshot_gives_up_a_hanging_disk(tmp_path, topics, messages, memory, monkeypatch):
    monkeypatch.setattr('linkage_ros.bag.snapshot._PATIENCE', 0.1)
    memory = memory()
    for message in messages:  # more than a recorder is handed at once
        memory.offer(*message)
    writer = stalled(tmp_path / 'run', topics)
    outcome = written(memory.take_content(), lambda: writer)
    assert 'the disk has not answered for 0.1 s' in outcome.failure
    assert counts_of(outcome) == [(6000, 0, 6000), (6000, 0, 6000)]
    assert sum(memory.take_content().counts) == len(messages)
    writer.answer.set()


def test_snapshot_gives_up_a_hanging_folder_creation(topics, messages, memory, monkeypatch):
    monkeypatch.setattr('linkage_ros.bag.snapshot._PATIENCE', 0.05)
    memory = memory()
    memory.offer(*messages[0])
    answer = threading.Event()

    def make():
        answer.wait(30)
        raise RecordingError('run', 'too late', 'nobody reads this')

    outcome = written(memory.take_content(), make)
    assert 'does not answer' in str(outcome)
    answer.set()


def test_unexpected_exception_is_reported_by_the_snapshot(messages, memory):
    memory = memory()
    memory.offer(*messages[0])
    outcome = written(memory.take_content(), lambda: 1 // 0)
    assert str(outcome).startswith('snapshot: ZeroDivisionError: ')
    assert str(outcome).endswith('please report this')


def test_snapshot_across_clock_jumps_is_read_in_order(tmp_path, topics, messages, memory):
    memory = memory(3.1)
    # The clock jumps back by 6 s, after 2 s and 1 s before the end.
    order = [*messages[8000:], *messages[:2000]]
    for message in order:
        memory.offer(*message)
    folder = tmp_path / 'run'
    outcome = written(memory.take_content(), lambda: BagWriter(folder, topics))
    there = [message.data for message in read_bag(folder).messages()]
    begin = len(order) - len(there)
    assert there == [message.data for message in order[begin:]]
    assert counts_of(outcome) == [(3000, 3000, 0), (3000, 3000, 0)]
