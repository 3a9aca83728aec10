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

"""Lost ticks: what stalled, and whether the rate can be held; by a clock that a test sets."""

from threading import Event
from types import SimpleNamespace

from linkage_ros.messages.layout import NANOSECONDS
from linkage_ros.node import pacing
from linkage_ros.node.diagnostics import Warnings
from linkage_ros.pipeline.tick_loop import Counts, Stall
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
        pacing.steady(500.0)(SimpleNamespace(counts=counts, tick_at=tick_at), stopping)
        return counts

    return run


def told(counts):
    lines = Said()
    Warnings(lines).check(counts, [], '/crank', 1.0)
    return lines


def test_one_slow_tick_is_named_and_the_rate_holds_otherwise(run):
    counts = run([0] * 50 + [54] + [0] * 50)
    assert counts.stall == Stall(52 * MS, in_tick=True)
    assert told(counts) == ['26 ticks lost at once: a tick took 0.052 s; the rate holds otherwise']


def test_one_late_wake_up_is_that_of_the_operating_system(run):
    counts = run([0] * 100, oversleep=[0] * 50 + [40])
    assert counts.stall == Stall(40 * MS, in_tick=False)
    assert told(counts) == [
        (
            '20 ticks lost at once: the operating system woke the node 0.040 s late; '
            'the rate holds otherwise'
        )
    ]


def test_two_stalls_of_a_long_run_are_no_reason_for_another_rate(run):
    (line,) = told(run([0] * 500 + [32] + [0] * 500 + [42] + [0] * 500))
    assert line == (
        '35 ticks lost in 2 stalls, the last: a tick took 0.040 s; the rate holds otherwise'
    )


def test_a_rate_that_cannot_be_held_is_to_be_lowered(run):
    (line,) = told(run([3] * 300))
    assert line.endswith(' s; lower the rate')


def test_a_run_without_a_stall_is_silent(run):
    assert told(run([1] * 300)) == []
