# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""When messages are sent: on a clock of the test's, to the nanosecond."""

from threading import Event

from linkage_ros.bag import BagMessage, LogTimeOrder
from linkage_ros.errors import BagError, LinkageError
from linkage_ros.node import (
    ClockTicks,
    LATE,
    Playback,
    playback_queue,
    PlaybackPart,
    QueuedMessage,
    read_ahead,
)
import pytest

from .graph import wait_for

MS = 1_000_000
FIRST = 1_700_000_000_000_000_000
BEGUN = 55_000 * MS


class Clock:
    """A steady clock that stands still unless something waits for it or takes time."""

    def __init__(self, stop_at=None):
        self.time = BEGUN
        self.stop_at = stop_at

    def now(self):
        return self.time

    def wait_until(self, due):
        self.time = max(self.time, due)
        return self.stop_at is not None and self.time >= BEGUN + self.stop_at * MS


def played(events, rate=1.0, clock_period=None, takes=None, stop_at=None):
    """Play (ms, topic) at a rate; return (ms, topic or the clock's ms) as they were sent."""
    clock = Clock(stop_at)
    sent = []

    def publisher(topic):
        def publish(_):
            sent.append(((clock.time - BEGUN) / MS, topic))
            clock.time += (takes or {}).get(topic, 0) * MS

        return publish

    def tick(time):
        sent.append(((clock.time - BEGUN) / MS, (time - FIRST) / MS))

    publish = {topic: publisher(topic) for topic in ('a', 'b', 'slow')}
    ticks = None if clock_period is None else ClockTicks(clock_period * MS, tick)
    playback = Playback(FIRST, rate, publish, clock, ticks)
    playback.send_messages(
        QueuedMessage(base[0] * MS if base else 0, FIRST + time * MS, topic, b'')
        for time, topic, *base in events
    )
    return sent, playback


TIMELINE = [(0, 'a'), (10, 'b'), (10, 'a'), (35, 'a'), (100, 'b')]


@pytest.mark.parametrize('rate', [0.01, 0.5, 1.0, 2.0, 4.0, 1000.0])
def test_each_is_sent_at_its_time_over_the_rate(rate):
    sent, playback = played(TIMELINE, rate)
    assert sent == [(pytest.approx(time / rate), topic) for time, topic in TIMELINE]
    assert playback.counts == {'a': 3, 'b': 2, 'slow': 0}
    assert (playback.late, playback.latest) == (0, 0)
    assert (playback.played, playback.took) == (100 * MS, round(100 * MS / rate))


def test_no_time_is_lost_on_the_way():
    # At 3 the period is no whole number of nanoseconds.
    clock = Clock()
    times = []
    playback = Playback(FIRST, 3.0, {'a': lambda _: times.append(clock.time)}, clock)
    playback.send_messages(
        QueuedMessage(0, FIRST + index * MS, 'a', b'') for index in range(1_000_000)
    )
    assert all(abs(t - BEGUN - n * MS / 3) <= 0.5 + 1e-6 for n, t in enumerate(times))


def test_late_ones_are_sent_at_once_and_the_next_is_in_time_again():
    events = [(0, 'slow'), (1, 'a'), (20, 'b'), (31, 'a'), (60, 'b'), (70, 'a')]
    sent, playback = played(events, takes={'slow': 50})
    times = [time for time, _ in sent]
    assert times == [0, 50, 50, 50, 60, 70]
    # The slow one itself is late too: it was out after 50 ms. One is late by 19 ms.
    assert playback.late == 4
    assert playback.latest == 50 * MS
    assert LATE == 10 * MS


def test_the_clock_ticks_in_real_time_and_tells_the_bags():
    sent, _ = played([(0, 'a'), (50, 'b'), (100, 'a')], rate=2.0, clock_period=10)
    assert sent == [
        (0, 0), (0, 'a'), (10, 20), (20, 40), (25, 'b'), (30, 60), (40, 80), (50, 100), (50, 'a'),
        (50, 100),
    ]  # fmt: skip


def test_the_clock_is_never_ahead_of_what_has_not_been_sent():
    events = [(0, 'slow'), (5, 'a'), (15, 'slow'), (25, 'b'), (90, 'a'), (200, 'b')]
    sent, _ = played(events, clock_period=10, takes={'slow': 40})
    due = iter(events)
    upcoming = next(due, None)
    for _, what in sent:
        if isinstance(what, str):
            upcoming = next(due, None)
        elif upcoming is not None:
            assert what <= upcoming[0]
    told = [what for _, what in sent if not isinstance(what, str)]
    assert told == sorted(told)
    assert told[-1] == 200


def test_a_loop_goes_on_without_a_gap_and_its_clock_jumps_back():
    events = [(0, 'a'), (30, 'b'), (0, 'a', 30), (30, 'b', 30), (0, 'a', 60), (30, 'b', 60)]
    sent, playback = played(events, clock_period=20)
    assert [each for each in sent if isinstance(each[1], str)] == [
        (0, 'a'), (30, 'b'), (30, 'a'), (60, 'b'), (60, 'a'), (90, 'b'),
    ]  # fmt: skip
    told = [each for each in sent if not isinstance(each[1], str)]
    assert told == [(0, 0), (20, 20), (40, 10), (60, 30), (80, 20), (90, 30)]
    assert playback.played == 90 * MS


def test_a_silence_before_a_loop_belongs_to_the_pass_that_follows():
    events = [(5, 'a'), (30, 'b'), (5, 'a', 30), (30, 'b', 30)]
    sent, _ = played(events, clock_period=2)
    told = {time: what for time, what in sent if not isinstance(what, str)}
    assert (told[28], told[32], told[34]) == (28, 2, 4)


@pytest.mark.parametrize('clock_period', [None, 7])
def test_a_stop_ends_it_between_two_messages(clock_period):
    sent, playback = played(TIMELINE, clock_period=clock_period, stop_at=34)
    assert [what for _, what in sent if isinstance(what, str)] == ['a', 'b', 'a']
    assert playback.played == 10 * MS


class Order(LogTimeOrder):
    """The order of a bag that is a list."""

    def __init__(self, messages, error=None):
        self._messages = messages
        self._error = error

    def messages(self, since=0):
        for time, topic in self._messages:
            if time >= since:
                yield BagMessage(topic, time, time, topic.encode())
        if self._error:
            raise self._error


HELD = [(10, 'a'), (20, 'b'), (30, 'a'), (40, 'b'), (50, 'c')]


@pytest.mark.parametrize(
    ('first', 'last', 'topics', 'expected'),
    [
        (10, float('inf'), 'abc', HELD),
        (10, float('inf'), 'b', [(20, 'b'), (40, 'b')]),
        (20, 40, 'abc', [(20, 'b'), (30, 'a'), (40, 'b')]),
        (21, 39, 'a', [(30, 'a')]),
        (21, 39, 'c', []),
    ],
)
def test_a_part_is_played(first, last, topics, expected):
    found = list(playback_queue(Order(HELD), PlaybackPart(first, last, topics, loop=False)))
    assert [(cue.log_time, cue.topic) for cue in found] == expected
    assert {cue.base for cue in found} <= {0}


def test_a_loop_repeats_its_part():
    endless = playback_queue(Order(HELD), PlaybackPart(20, 40, 'ab', loop=True))
    found = [next(endless) for _ in range(7)]
    assert [cue.base for cue in found] == [0, 0, 0, 20, 20, 20, 40]
    assert [cue.log_time for cue in found] == [20, 30, 40, 20, 30, 40, 20]


def test_a_loop_over_one_instant_is_refused_after_it():
    instant = playback_queue(Order([(10, 'a'), (10, 'b')]), PlaybackPart(10, 99, 'ab', loop=True))
    assert [next(instant).topic, next(instant).topic] == ['a', 'b']
    with pytest.raises(LinkageError, match='all messages have the same time'):
        next(instant)


def endless(taken):
    while True:
        taken.append(1)
        yield QueuedMessage(0, len(taken), 'a', bytes(100))


def test_so_much_is_read_ahead_and_no_more():
    taken = []
    messages = read_ahead(endless(taken), Event())
    assert next(messages).log_time == 1
    count = 0

    def stands_still():
        nonlocal count
        before, count = count, len(taken)
        return count > 256 and count == before

    wait_for(stands_still, 'the end of reading ahead')
    assert count <= 10 * 256
    found = [next(messages).log_time for _ in range(20_000)]
    assert found == list(range(2, 20_002))
    messages.close()
    wait_for(stands_still, 'the end of the thread')


def test_large_messages_are_read_ahead_by_their_size():
    taken = []

    def images():
        while True:
            taken.append(1)
            yield QueuedMessage(0, len(taken), 'a', bytes(2**21))

    messages = read_ahead(images(), Event())
    next(messages)
    wait_for(lambda: len(taken) >= 9, 'images')
    assert len(taken) <= 11
    messages.close()


def test_what_was_read_before_an_error_is_played_before_it():
    error = BagError('bag', 'is damaged', 'so it is')
    order = Order([(index, 'a') for index in range(1000)], error)
    found = []
    with pytest.raises(BagError, match='is damaged'):
        found.extend(
            read_ahead(playback_queue(order, PlaybackPart(0, 1e9, 'a', loop=False)), Event())
        )
    assert [cue.log_time for cue in found] == list(range(1000))


def test_a_stop_ends_reading_where_nothing_comes():
    stop, waiting = Event(), Event()

    def nothing():
        waiting.wait()
        yield from ()

    stop.set()
    assert list(read_ahead(nothing(), stop)) == []
    waiting.set()
