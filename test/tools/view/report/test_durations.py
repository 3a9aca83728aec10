# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Numbers of a report: lateness, clocks and silences, and curves thinned with their extremes."""

from fractions import Fraction
from itertools import pairwise
import json

from hypothesis import given, strategies as st
from linkage_ros.tools.view.report import (
    DecimatedCurves,
    Decimation,
    EventTrack,
    Histogram,
    interval_capacity,
    Lateness,
    most_columns,
    RunClock,
    Silences,
    size_in_json,
    times_of,
)
import numpy as np
import pytest

from ....support.sampling import sample_count

# Lateness from times alone; the clock of a run; silences; distribution of durations.


MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000


def pieces_of(rows, size):
    return [rows[slice(at, at + size)] for at in range(0, len(rows), size)]


def lateness(rate, times, piece=700):
    found = Lateness(rate)
    parts = [found.add(part) for part in pieces_of(times, piece)]
    parts.append(found.finish_lateness())
    stamps = np.concatenate([part[0] for part in parts])
    assert np.array_equal(stamps, times)
    return np.concatenate([part[1] for part in parts])


def made_late(rate, late, numbers):
    """Return when ticks with these numbers come, some too late."""
    period = Fraction(10**9) / Fraction(rate)
    return BEGIN + np.array([round(n * period) for n in numbers.tolist()], int) + late


def late_ticks(count):
    late = np.random.default_rng(5).exponential(60_000, count).astype(np.int64)
    late[::10] = 0
    return late


def skipping(after, ticks):
    numbers = np.arange(3000)
    numbers[after:] += ticks
    return numbers


def caught_up():
    late = late_ticks(3000)
    late[1000:1015] = np.arange(15, 0, -1) * MS
    return late


# Rate, by how much ticks are late, and their numbers.
LATE = {
    **{f'at {rate} Hz': (rate, late_ticks(3000), skipping(0, 0)) for rate in (333.3, 1e4, 20.0)},
    'ticks that are made up for': (1000.0, caught_up(), skipping(0, 0)),
    'ticks that were given up': (1000.0, late_ticks(3000), skipping(1500, 57)),
    'four months': (1000.0, late_ticks(3000), skipping(1000, 10**10)),
    'none': (1000.0, np.empty(0, np.int64), np.empty(0, int)),
}


@pytest.mark.sample(7)
@pytest.mark.parametrize('name', LATE)
@pytest.mark.parametrize('piece', [1, 700, 10**6])
def test_lateness_of_ticks_is_exact_to_a_nanosecond(name, piece):
    rate, late, numbers = LATE[name]
    times = made_late(rate, late, numbers)
    assert lateness(rate, times, piece) == pytest.approx(late, abs=1, rel=0)


def test_drifting_clock_makes_no_tick_late():
    times = BEGIN + np.round(np.arange(60_000) * MS * (1 + 50e-6)).astype(np.int64)
    assert lateness(1000.0, times).max() <= 250 * MS * 50e-6 + 1


# Log times, by how much a message may come too late, run times, and jumps.
CLOCKS = {
    'forward': ([5, 7, 7, 20], 0, [0, 2, 2, 15], []),
    'back': ([5, 7, 3, 4], 0, [0, 2, 2, 3], [(2, 4)]),
    'twice': ([5, 1, 0, 2], 0, [0, 0, 0, 2], [(0, 4), (0, 1)]),
    'disorder': ([50, 70, 65, 80], 10, [0, 20, 20, 30], []),
    'back by more than disorder': ([50, 70, 55, 57], 10, [0, 20, 20, 22], [(20, 15)]),
}


@pytest.mark.parametrize('name', CLOCKS)
@pytest.mark.parametrize('piece', [1, 2, 9])
def test_run_time_never_decreases(name, piece):
    logged, disorder, expected, jumps = CLOCKS[name]
    clock = RunClock(disorder)
    pieces = pieces_of(logged, piece)
    assert [t for p in pieces for t in clock.run_times(times_of(p)).tolist()] == expected
    assert [*clock.pop_jumps()] == jumps
    assert not [*clock.pop_jumps()]


# Log times before; then what stands behind so many of them, its log time, the time of the run; the
# log times and times of the run that follow, which are not put off by it.
OTHER_HANDS = {
    'within': (
        [100, 200, 150, 250],
        [(0, 50, 0), (0, 130, 0), (1, 130, 30), (1, 230, 100), (2, 190, 100), (3, 240, 190),
         (4, 240, 200), (4, 900, 850)],
        ([260], [210]),
    ),
    'at the begin': ([], [(0, 100, 0), (0, 140, 40)], ([190, 200], [90, 100])),
}  # fmt: skip


@pytest.mark.parametrize('name', OTHER_HANDS)
def test_messages_of_another_thread_follow_the_run_clock(name):
    first, table, (last, passed) = OTHER_HANDS[name]
    clock = RunClock()
    if not first:
        clock.start(100)
    clock.run_times(times_of(first))
    behind, logged, expected = map(np.array, zip(*table, strict=True))
    assert clock.other_thread_times(times_of(logged), behind).tolist() == [*expected]
    assert clock.end == expected.max()
    assert clock.run_times(times_of(last)).tolist() == passed
    assert clock.end == max(*passed, expected.max())


@given(st.lists(st.integers(0, 2**64 - 1), max_size=30))
def test_run_clock_accepts_any_log_time(logged):
    passed = RunClock().run_times(times_of(logged))
    assert (np.diff(passed) >= 0).all()
    assert not len(passed) or passed[0] == 0


def test_silence_is_longer_than_usual_message_intervals():
    lane = EventTrack()
    silences = Silences(lane, MS)
    times = np.array([*range(100), *range(104, 200), *range(206, 300)]) * MS
    for part in pieces_of(times, 64):
        silences.add(part)
    silences.end_run(340 * MS)
    # Of 5 ms nobody would speak.
    assert [(s.begin // MS, s.end // MS) for s in lane.spans] == [(199, 206), (299, 340)]


def test_run_without_messages_is_one_silence():
    lane = EventTrack()
    Silences(lane, MS).end_run(500)
    assert [(s.begin, s.end) for s in lane.spans] == [(0, 500)]


@given(st.lists(st.integers(0, 10**13), min_size=1, max_size=200))
def test_histogram_percentiles_equal_numpy_within_a_bin(durations):
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


# Decimated curves keep minima and maxima, in a bounded number of intervals.


NUMBERS = st.floats(-1e300, 1e300) | st.sampled_from([np.nan, np.inf, -np.inf, 0.0, -0.0])
ROWS = st.lists(st.tuples(NUMBERS, NUMBERS), max_size=300)
CUTS = st.lists(st.integers(0, 300), max_size=8)


def kept(rows, cuts, most):
    """Give rows in pieces; return the intervals."""
    values = np.array(rows, float).reshape(-1, 2)
    times = 7 * np.arange(len(values))
    curves = DecimatedCurves(2, most)
    edges = [0, *sorted(min(cut, len(values)) for cut in cuts), len(values)]
    for start, end in pairwise(edges):
        curves.add(times[start:end], values[start:end])
    return values, curves.build_intervals()


@given(ROWS, CUTS, st.sampled_from([2, 4, 16, 64]))
def test_intervals_hold_least_and_greatest_value_in_order(rows, cuts, most):
    values, found = kept(rows, cuts, most)
    begins, ends = found.begins // 7, found.ends // 7
    # Every row is in one interval, and no other.
    assert [*begins] == [*(np.r_[0, ends[:-1] + 1] if len(ends) else [])]
    assert not len(ends) or ends[-1] == len(values) - 1
    assert all(ends[:-1] - begins[:-1] + 1 == found.rows)
    for i, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        for column in range(2):
            rows = values[slice(begin, end + 1), column]
            own = [(v, k) for k, v in enumerate(rows) if v == v]
            told = found.first[i, column], found.second[i, column]
            if not own:
                assert np.isnan(told).all()
                continue
            least, greatest = min(own), max(own, key=lambda each: each[0])
            assert {*told} == {least[0], greatest[0]}
            if least[0] != greatest[0]:
                assert told[0] == min(least, greatest, key=lambda each: each[1])[0]


@given(ROWS, CUTS, st.sampled_from([2, 4, 16, 64]))
def test_decimation_keeps_every_row_up_to_its_capacity(rows, cuts, most):
    values, found = kept(rows, cuts, most)
    assert len(found.begins) <= (2 * most if found.rows == 1 else most)
    assert (found.rows == 1) == (len(values) <= 2 * most)
    if found.rows == 1:
        assert np.array_equal(found.first, values, equal_nan=True)
    else:
        assert len(found.begins) > most // 2


@pytest.mark.parametrize('columns', [1, 2, 6, 40, 200, most_columns(4_000_000)])
def test_interval_capacity_fills_the_allowed_bytes(columns):
    most = interval_capacity(columns, 4_000_000)
    assert most & (most - 1) == 0
    # Of each interval begin and end, and two values of each curve, of 8 bytes each.
    assert most * (16 * columns + 16) <= 4_000_000 < 2 * most * (16 * columns + 16)


def test_column_limit_leaves_256_intervals_per_curve():
    most = most_columns(4_000_000)
    assert interval_capacity(most, 4_000_000) == 256
    assert interval_capacity(most + 1, 4_000_000) < 256


@given(st.integers(0, 400), CUTS, st.sampled_from([2, 6, 40]))
def test_decimated_rows_have_equal_steps(count, cuts, most):
    rows = Decimation(1, most)
    edges = [0, *sorted(min(cut, count) for cut in cuts), count]
    for start, end in pairwise(edges):
        times = np.arange(start, end)
        rows.add(times, times[:, None].astype(float))
    assert [*rows.times] == [*range(0, count, rows.step)]
    assert [*rows.values[:, 0]] == [*rows.times]
    assert len(rows.times) <= most
    assert rows.step == 1 or len(rows.times) > most // 2


@given(st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 50)), max_size=50))
def test_event_track_counts_every_event_in_separate_spans(events):
    lane = EventTrack(near=100)
    time = 0
    for wait, lasting in events:
        lane.add(time + wait, time + wait + lasting)
        time += wait + lasting
    assert lane.count == sum(span.count for span in lane.spans) == len(events)
    for before, after in pairwise(lane.spans):
        assert after.begin - before.end > 100


def test_event_track_bounds_spans_and_texts():
    lane = EventTrack()
    count = sample_count(1_000_000, 50_000)
    for index in range(count):
        lane.add(index * 1000 + index * index % 997, index * 1000 + 997, f'kind {index % 3}')
    assert lane.count == sum(span.count for span in lane.spans) == count
    assert len(lane.spans) <= 1000
    assert (lane.spans[0].begin, lane.spans[-1].end) == (0, (count - 1) * 1000 + 997)


# How a lane is made; events, and the spans in their order with their counts.
LANES = {
    'what says something else is something else': (
        {'near': 10},
        [(0, 0, 'a'), (5, 5, 'a'), (8, 8, 'b'), (30, 30, 'b')],
        [(0, 5, 2, 'a'), (8, 8, 1, 'b'), (30, 30, 1, 'b')],
    ),
    'a window cuts spans': (
        {'window': (100, 200)},
        [(0, 99), (50, 120), (150, 150), (190, 300), (201, 202)],
        [(100, 120, 1, ''), (150, 150, 1, ''), (190, 200, 1, '')],
    ),
    'what lasts is told at its end and stands where it began': (
        {'near': 10},
        [(30, 50, 'short'), (10, 70, 'long'), (72, 80, 'long')],
        [(10, 80, 2, 'long'), (30, 50, 1, 'short')],
    ),
}


@pytest.mark.parametrize('name', LANES)
def test_near_events_of_a_track_merge_into_spans(name):
    options, events, expected = LANES[name]
    lane = EventTrack(**options)
    for event in events:
        lane.add(*event)
    assert [(s.begin, s.end, s.count, s.text) for s in lane.in_order] == expected
    assert lane.count == sum(span[2] for span in expected)


def test_new_event_texts_take_bounded_space():
    lane = EventTrack()
    for time in range(5000):
        lane.add(1000 * time, 1000 * time, f'{time}<\0\udc80' * 50)
        assert len(lane.spans[-1].text) <= 132
        if time % 100 == 0:
            assert sum(size_in_json(span.text) for span in lane.spans) <= 60_000
    assert sum(span.count for span in lane.spans) == 5000


def test_track_of_longest_spans_counts_all_events():
    lane = EventTrack(longest=True, most=10)
    for time in range(100):
        lane.add(1000 * time, 1000 * time + (900 if time in (3, 50, 51) else time % 7))
    assert lane.count == 100
    assert len(lane.spans) <= 10
    begins = [span.begin for span in lane.spans]
    assert begins == sorted(begins)
    assert {3000, 50_000, 51_000} <= {*begins}
    assert all(span.end - span.begin in (900, *range(7)) for span in lane.spans)


@given(st.text() | st.floats(allow_nan=False, allow_infinity=False) | st.integers())
def test_json_size_bounds_the_written_size(value):
    written = json.dumps(value, ensure_ascii=False).replace('<', r'\u003c')
    assert len(written.encode('utf-8', 'backslashreplace')) <= size_in_json(value)
