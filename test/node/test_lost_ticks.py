# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Lost ticks: what stalled, and whether the rate can be held; by a clock that a test sets."""

from math import inf
from threading import Event
from types import SimpleNamespace

from linkage_ros.messages import NANOSECONDS
from linkage_ros.node import conditions, pacing, Warnings
from linkage_ros.tick import Counts
import pytest

from .observed import fake_loop, observe, Said, told

MS = 10**6


@pytest.fixture
def run(monkeypatch):
    """Return a function that ticks at 500 Hz, and for each tick is given its duration, in [ms]."""

    def run(durations, oversleep=()):
        now, stopping, counts = [0], Event(), Counts()
        durations, oversleep = iter(durations), iter(oversleep)

        def sleep(seconds):
            now[0] += round(seconds * NANOSECONDS) + next(oversleep, 0) * MS

        def tick_at(_now, _clock):
            counts.ticks += 1
            duration = next(durations, None)
            if duration is None:
                stopping.set()
            else:
                now[0] += duration * MS

        monkeypatch.setattr(pacing, 'monotonic_ns', lambda: now[0])
        monkeypatch.setattr(pacing, 'sleep', sleep)
        pacing.on_steady_clock(500.0)(SimpleNamespace(counts=counts, tick_at=tick_at), stopping)
        return counts

    return run


# By name: how long ticks take and how late wake-ups are, in [ms], and the line of the log.
STALLS = {
    'one slow tick': (
        [0] * 50 + [54] + [0] * 50, [],
        '26 ticks lost at once: a tick took 0.052 s; the rate is kept otherwise',
    ),
    'one late wake-up': (
        [0] * 100, [0] * 50 + [40],
        ('20 ticks lost at once: the operating system woke the node 0.040 s late; the rate is '
         'kept otherwise'),
    ),
    'two stalls of a long run are no reason for another rate': (
        [0] * 500 + [32] + [0] * 500 + [42] + [0] * 500, [],
        '35 ticks lost in 2 stalls, the last: a tick took 0.040 s; the rate is kept otherwise',
    ),
    # Each tick is 1 ms late on the one before; at 21 ms ten ticks of 2 ms are given up.
    'a rate that cannot be held': (
        [3] * 300, [],
        '140 ticks lost in 14 stalls, the last: a tick took 0.021 s; lower the rate',
    ),
    'no stall': ([1] * 300, [], None),
}  # fmt: skip


@pytest.mark.parametrize('name', STALLS)
def test_lost_ticks_name_the_stall_and_the_remedy(run, name):
    durations, oversleep, line = STALLS[name]
    state = observe(fake_loop(), run(durations, oversleep), rate=0.0)
    assert told(state) == ([line] if line else [])


# Messages are taken by ticks: while a tick goes on, nobody knows whether one has come. By name:
# the time from tick to tick [s]; then in turn a time [s], the ticks, and the messages received and
# used by then; and what is said in all, the first words of each line.
NOTHING_CAME = 'no message on /crank in'
NO_TICK = 'no tick has ended in'
SILENCES = {
    'no message comes': (0.01, [(t, t * 100, 0, 0) for t in range(6)], [NOTHING_CAME]),
    'a tick goes on for 5 s': (0.01, [(t, 1, 1, 1) for t in range(6)], [NO_TICK]),
    'a tick goes on after a while of messages': (
        0.01, [(t, *[min(t, 4) * n for n in (100, 80, 80)]) for t in range(9)], [NO_TICK],
    ),
    'a tick goes on just after the last message was taken': (
        0.01, [(0, 1, 1, 1), (1, 100, 50, 50), *((t, 110, 50, 50) for t in (1.2, 3, 4))],
        [NO_TICK],
    ),
    'ticks as slow as they are wanted': (5.0, [(t, *[t // 5] * 3) for t in range(12)], []),
    'a tick for each message, and none comes': (
        0.0, [(t, 0, 0, 0) for t in range(6)], [NOTHING_CAME],
    ),
    'a tick for each message, and one goes on': (
        0.0, [(0, 1, 1, 1), *((t, 1, 2, 1) for t in range(1, 6))], [NO_TICK],
    ),
    'a simulation stands still': (inf, [(t, 5, 5, 5) for t in range(9)], []),
}  # fmt: skip


def silence_of(monkeypatch, interval, max_age):
    """Return what is called with a time, in [s], and the counts then, and returns the log."""
    now = [0.0]
    monkeypatch.setattr(conditions, 'monotonic', lambda: now[0])
    lines = Said()
    warnings, loop = Warnings(lines), fake_loop()
    loop.pipeline.max_age = max_age
    rate = interval and (1.0 / interval or 100.0)

    def watch(seconds, **counts):
        now[0] = float(seconds)
        state = observe(loop, Counts(**counts), rate=rate, is_simulated=interval == inf)
        warnings.warn_of_silence(state, lambda: ['/other'], 100.0)
        return lines

    return watch


@pytest.mark.parametrize('name', SILENCES)
def test_unfinished_tick_is_not_reported_as_missing_messages(monkeypatch, name):
    interval, timeline, expected = SILENCES[name]
    watch = silence_of(monkeypatch, interval, NANOSECONDS)
    for seconds, ticks, received, used in timeline:
        lines = watch(seconds, ticks=ticks, received=received, used=used, published=used)
    assert [line[: len(start)] for line, start in zip(lines, expected, strict=True)] == expected


# The drive's max_age [s], the messages received before all fall silent, and after how many whole
# seconds of silence the first warning comes: never, if a drive goes on without new samples.
PATIENCE = {
    'no message ever came': (0.0, 0, 3),
    'samples that hold for ever': (0.0, 5, None),
    'samples that hold for less than the patience': (0.5, 5, 3),
    'samples that hold for long': (6.0, 5, 7),
    'none came, of those that hold for long': (6.0, 0, 7),
}


@pytest.mark.parametrize('name', PATIENCE)
def test_silence_is_warned_of_after_max_age(monkeypatch, name):
    max_age, received, first = PATIENCE[name]
    watch = silence_of(monkeypatch, 0.01, round(max_age * NANOSECONDS))
    warned = []
    for second in range(10):
        lines = watch(second, ticks=100 * second, received=received, used=received)
        warned += [second] * (len(lines) - len(warned))
    # The first look, at 0 s, sees what has been received.
    assert warned == ([] if first is None else [first])
