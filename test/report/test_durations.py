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


"""Lateness out of times alone; the clock of a run; silences; how durations are spread."""

from __future__ import annotations

from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st
from linkage_ros.report.blocks import RunClock, times_of
from linkage_ros.report.curves import Lateness
from linkage_ros.report.decimation import Histogram
from linkage_ros.report.run import Lane, Silences
import numpy as np
import pytest

MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000


def pieces_of(rows, size):
    return [rows[slice(at, at + size)] for at in range(0, len(rows), size)]


def lateness(rate, times, piece=700):
    found = Lateness(rate)
    parts = [found.add(part) for part in pieces_of(times, piece)]
    parts.append(found.end())
    stamps = np.concatenate([part[0] for part in parts])
    assert np.array_equal(stamps, times)
    return np.concatenate([part[1] for part in parts])


def made_late(rate, late, numbers):
    """Return when ticks with these numbers come, some too late."""
    period = Fraction(10**9) / Fraction(rate)
    return BEGIN + np.array([round(n * period) for n in numbers.tolist()]) + late


def late_ticks(count):
    late = np.random.default_rng(5).exponential(60_000, count).astype(np.int64)
    late[::10] = 0
    return late


@pytest.mark.parametrize('rate', [1000.0, 333.3, 10_000.0, 20.0])
@pytest.mark.parametrize('piece', [1, 700, 10**6])
def test_what_ticks_are_late_by_is_found_to_a_nanosecond(rate, piece):
    late = late_ticks(3000)
    times = made_late(rate, late, np.arange(3000))
    assert np.abs(lateness(rate, times, piece) - late).max() <= 1


def test_ticks_that_are_made_up_for_are_late_until_they_have_caught_up():
    late = late_ticks(3000)
    late[1000:1015] = np.arange(15, 0, -1) * MS
    times = made_late(1000.0, late, np.arange(3000))
    assert np.abs(lateness(1000.0, times) - late).max() <= 1


def test_ticks_that_were_given_up_make_those_behind_them_no_later():
    late, numbers = late_ticks(3000), np.arange(3000)
    numbers[1500:] += 57
    times = made_late(1000.0, late, numbers)
    assert np.abs(lateness(1000.0, times) - late).max() <= 1


def test_a_clock_that_drifts_makes_no_tick_late():
    times = BEGIN + np.round(np.arange(60_000) * MS * (1 + 50e-6)).astype(np.int64)
    assert lateness(1000.0, times).max() <= 250 * MS * 50e-6 + 1


def test_a_long_run_keeps_its_nanoseconds():
    late = late_ticks(2000)
    numbers = np.arange(2000)
    numbers[1000:] += 10**10  # four months at 1 kHz
    times = made_late(1000.0, late, numbers)
    assert np.abs(lateness(1000.0, times) - late).max() <= 1


def test_no_ticks_are_not_late():
    assert not len(lateness(1000.0, np.empty(0, np.int64)))


# Log times, by how much a message may stand too late, the times of the run, and jumps.
CLOCKS = {
    'forward': ([5, 7, 7, 20], 0, [0, 2, 2, 15], []),
    'back': ([5, 7, 3, 4], 0, [0, 2, 2, 3], [(2, 4)]),
    'twice': ([5, 1, 0, 2], 0, [0, 0, 0, 2], [(0, 4), (0, 1)]),
    'disorder': ([50, 70, 65, 80], 10, [0, 20, 20, 30], []),
    'back by more than disorder': ([50, 70, 55, 57], 10, [0, 20, 20, 22], [(20, 15)]),
}


@pytest.mark.parametrize('name', CLOCKS)
@pytest.mark.parametrize('piece', [1, 2, 9])
def test_the_time_of_a_run_never_goes_back(name, piece):
    logged, disorder, expected, jumps = CLOCKS[name]
    clock = RunClock(disorder)
    pieces = pieces_of(logged, piece)
    assert [t for p in pieces for t in clock.passed(times_of(p)).tolist()] == expected
    assert [*clock.jumps()] == jumps
    assert not [*clock.jumps()]


def test_what_is_recorded_by_another_hand_goes_by_the_same_clock():
    clock = RunClock()
    clock.passed(times_of([100, 200, 150, 250]))
    # What stands behind so many of them, its log time, and the time of the run.
    table = [
        (0, 50, 0), (0, 130, 0), (1, 130, 30), (1, 230, 100), (2, 190, 100), (3, 240, 190),
        (4, 240, 200), (4, 900, 850),
    ]  # fmt: skip
    behind, logged, expected = zip(*table, strict=True)
    assert clock.beside(times_of(logged), np.array(behind)).tolist() == [*expected]
    assert clock.end == 850
    # What follows is not put off by it.
    assert clock.passed(times_of([260])).tolist() == [210]
    assert clock.end == 850


def test_a_run_may_begin_with_what_another_hand_has_recorded():
    clock = RunClock()
    clock.start(100)
    clock.passed(times_of([]))
    assert clock.beside(times_of([100, 140]), np.array([0, 0])).tolist() == [0, 40]
    assert clock.passed(times_of([190, 200])).tolist() == [90, 100]
    assert not [*clock.jumps()]


@given(st.lists(st.integers(0, 2**64 - 1), max_size=30))
def test_no_log_time_breaks_the_clock(logged):
    passed = RunClock().passed(times_of(logged))
    assert (np.diff(passed) >= 0).all()
    assert not len(passed) or passed[0] == 0


def test_a_silence_is_longer_than_messages_are_otherwise_apart():
    lane = Lane()
    silences = Silences(lane, MS)
    times = np.array([*range(100), *range(104, 200), *range(206, 300)]) * MS
    for part in pieces_of(times, 64):
        silences.add(part)
    silences.end(340 * MS)
    # Of 5 ms nobody would speak.
    assert [(s.begin // MS, s.end // MS) for s in lane.spans] == [(199, 206), (299, 340)]


def test_where_nothing_ever_comes_all_is_silence():
    lane = Lane()
    Silences(lane, MS).end(500)
    assert [(s.begin, s.end) for s in lane.spans] == [(0, 500)]


@given(st.lists(st.integers(0, 10**13), min_size=1, max_size=200))
def test_percentiles_are_those_of_the_durations_to_a_bin(durations):
    found = Histogram()
    for part in pieces_of(durations, 30):
        found.add(np.array(part))
    assert (found.count, found.least, found.greatest) == (
        len(durations), min(durations), max(durations)
    )  # fmt: skip
    for percent in (50, 90, 99, 100):
        true = np.percentile(durations, percent, method='inverted_cdf')
        told = found.percentile(percent)
        assert told == found.greatest or true <= told <= max(100.0, true * 10**0.1 * (1 + 1e-12))
