# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Lost ticks: what stalled, and whether the rate can be held; by a clock that a test sets."""

from threading import Event
from types import SimpleNamespace

from linkage_ros.messages import NANOSECONDS
from linkage_ros.node import diagnostics, pacing, Warnings
from linkage_ros.tick import Counts, Stall
import pytest

MS = 10**6


class Said(list):
    """Takes the place of a logger."""

    def warning(self, line):
        self.append(line)


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


def told(counts):
    lines = Said()
    Warnings(lines).check_events(counts, [], '/crank', 1.0)
    return lines


def test_one_slow_tick_is_named_and_the_rate_holds_otherwise(run):
    counts = run([0] * 50 + [54] + [0] * 50)
    assert counts.last_stall == Stall(52 * MS, in_tick=True)
    assert told(counts) == [
        '26 ticks lost at once: a tick took 0.052 s; the rate is kept otherwise'
    ]


def test_one_late_wake_up_is_that_of_the_operating_system(run):
    counts = run([0] * 100, oversleep=[0] * 50 + [40])
    assert counts.last_stall == Stall(40 * MS, in_tick=False)
    assert told(counts) == [
        (
            '20 ticks lost at once: the operating system woke the node 0.040 s late; '
            'the rate is kept otherwise'
        )
    ]


def test_two_stalls_of_a_long_run_are_no_reason_for_another_rate(run):
    (line,) = told(run([0] * 500 + [32] + [0] * 500 + [42] + [0] * 500))
    assert line == (
        '35 ticks lost in 2 stalls, the last: a tick took 0.040 s; the rate is kept otherwise'
    )


def test_a_rate_that_cannot_be_held_is_to_be_lowered(run):
    (line,) = told(run([3] * 300))
    assert line.endswith(' s; lower the rate')


def test_a_run_without_a_stall_is_silent(run):
    assert told(run([1] * 300)) == []


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
    'a simulation stands still': (float('inf'), [(t, 5, 5, 5) for t in range(9)], []),
}  # fmt: skip


@pytest.mark.parametrize('name', SILENCES)
def test_a_tick_that_goes_on_does_not_say_that_no_message_came(monkeypatch, name):
    interval, timeline, expected = SILENCES[name]
    now = [0.0]
    monkeypatch.setattr(diagnostics, 'monotonic', lambda: now[0])
    counts, lines = Counts(), Said()
    warnings = Warnings(lines)
    for seconds, ticks, received, used in timeline:
        now[0] = float(seconds)
        counts.ticks, counts.received, counts.used, counts.published = ticks, received, used, used
        warnings.check_silence(
            counts, '/crank', ['crank_joint'], 100.0, interval, NANOSECONDS, lambda: ['/other']
        )
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
def test_silence_is_warned_of_when_no_sample_holds_any_more(monkeypatch, name):
    max_age, received, first = PATIENCE[name]
    now = [0.0]
    monkeypatch.setattr(diagnostics, 'monotonic', lambda: now[0])
    counts, lines = Counts(), Said()
    counts.received = counts.used = received
    warnings = Warnings(lines)
    warned = []
    for second in range(10):
        now[0], counts.ticks = float(second), 100 * second
        warnings.check_silence(
            counts, '/crank', ['crank_joint'], 100.0, 0.01, round(max_age * NANOSECONDS), list
        )
        warned += [second] * (len(lines) - len(warned))
    # The first look, at 0 s, sees what has been received.
    assert warned == ([] if first is None else [first])
