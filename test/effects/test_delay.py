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


"""Delay: exact to the nanosecond, nothing before it is there, and no more kept than that takes."""

from __future__ import annotations

from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st
from linkage_ros.effects import delay
from linkage_ros.effects.delay import DelayParameters
import pytest

from .sensors import ANGLES, BEGIN, context, MS, published, reading


def delayed(seconds, **parameters):
    return delay.sensor(DelayParameters(seconds, **parameters), context())


def shown(found):
    """Return what a message tells: value, and stamp in [ms]; nothing where there is none."""
    return None if found is None else (found.joints[0], (found.stamp - BEGIN) / MS)


# Read at t [ms]:                  0      1      2      3      4 …, and the value is 10·t.
TIMELINES = [
    (0.0, 'interpolated', 'arrival', [(0, 0), (10, 1), (20, 2), (30, 3), (40, 4)]),
    (0.0, 'sampled', 'measured', [(0, 0), (10, 1), (20, 2), (30, 3), (40, 4)]),
    (0.002, 'interpolated', 'arrival', [None, None, (0, 2), (10, 3), (20, 4)]),
    (0.002, 'interpolated', 'measured', [None, None, (0, 0), (10, 1), (20, 2)]),
    (0.002, 'sampled', 'arrival', [None, None, (0, 2), (10, 3), (20, 4)]),
    (0.002, 'sampled', 'measured', [None, None, (0, 0), (10, 1), (20, 2)]),
    (0.0025, 'interpolated', 'arrival', [None, None, None, (5, 3), (15, 4)]),
    (0.0025, 'interpolated', 'measured', [None, None, None, (5, 0.5), (15, 1.5)]),
    (0.0025, 'sampled', 'arrival', [None, None, None, (0, 3), (10, 4)]),
    (0.0025, 'sampled', 'measured', [None, None, None, (0, 0), (10, 1)]),
]


@pytest.mark.parametrize(('seconds', 'between', 'stamp', 'expected'), TIMELINES)
def test_readings_come_as_late_as_the_timeline_says(seconds, between, stamp, expected):
    sensor = delayed(seconds, between=between, stamp=stamp)
    found = []
    for ms in range(5):
        now = BEGIN + ms * MS
        found.append(shown(sensor(now, reading(now, 10.0 * ms))))
    assert found == expected


@given(
    st.floats(-1e3, 1e3),
    st.floats(-1e3, 1e3),
    st.integers(0, 20 * MS),
    st.lists(st.integers(1, 3 * MS), min_size=5, max_size=40),
    st.booleans(),
)
def test_a_motion_at_a_constant_rate_is_late_by_exactly_the_delay(a, b, ns, gaps, with_rates):
    def value(time):
        return Fraction(a) + Fraction(b) * Fraction(time - BEGIN, 10**9)

    sensor = delayed(ns * 1e-9, stamp='measured')
    rates = (b,) if with_rates else ()
    now = BEGIN
    for gap in gaps:
        found = sensor(now, reading(now, float(value(now)), rates=rates))
        assert (found is None) == (now - ns < BEGIN)
        if found is not None:
            assert found.stamp == now - ns
            assert found.rates == rates
            error = abs(Fraction(found.joints[0]) - value(now - ns))
            assert error <= 1e-15 * (abs(a) + abs(b)) + 1e-300
        now += gap


@given(st.integers(2, 10**10))
def test_it_is_exact_to_the_nanosecond(ns):
    sensor = delayed(ns * 1e-9, between='sampled')
    assert sensor(BEGIN, reading(BEGIN, 1.0)) is None
    assert sensor(BEGIN + ns - 1, reading(BEGIN + ns - 1, 2.0)) is None
    assert sensor(BEGIN + ns, reading(BEGIN + ns, 3.0)).joints == (1.0,)
    assert sensor(BEGIN + 2 * ns - 2, reading(BEGIN + 2 * ns - 2, 4.0)).joints == (1.0,)
    assert sensor(BEGIN + 2 * ns - 1, reading(BEGIN + 2 * ns - 1, 5.0)).joints == (2.0,)


@pytest.mark.parametrize('ns', [15, 63, 1000, 1_000_015])
def test_seconds_as_written_are_the_nearest_nanosecond(ns):
    # 15e-9·1e9 is 14.999999999999998 in doubles.
    sensor = delayed(float(f'{ns}e-9'), stamp='measured')
    sensor(BEGIN, reading(BEGIN, 1.0))
    assert sensor(BEGIN + ns + 5, reading(BEGIN + ns + 5, 2.0)).stamp == BEGIN + 5


def test_rates_accelerations_and_efforts_are_as_late_as_the_value():
    sensor = delayed(0.0005)
    for ms in range(3):
        found = sensor(
            BEGIN + ms * MS,
            reading(
                BEGIN + ms * MS,
                1.0 * ms,
                2.0 * ms,
                rates=(3.0 * ms, 4.0),
                accelerations=(5.0, 6.0 * ms),
                efforts=(0.0, 7.0 * ms),
            ),
        )
    assert found.rates == (4.5, 4.0)
    assert found.accelerations == (5.0, 9.0)
    assert found.efforts == (0.0, 10.5)


def test_at_a_toggle_there_are_no_rates_a_delay_later():
    sensor = delayed(0.001, between='sampled')
    found = []
    for ms in range(4):
        now = BEGIN + ms * MS
        found.append(sensor(now, reading(now, 1.0, rates=() if ms == 1 else (2.0,))))
    assert [None if read is None else read.rates for read in found] == [None, (2.0,), (), (2.0,)]


@pytest.mark.parametrize('between', ['interpolated', 'sampled'])
@pytest.mark.parametrize(
    ('seconds', 'expected'),
    [
        # Read at 0, 3 and 4 ms; at 1 and 2 ms the line is told that there is nothing.
        (0.002, [None, None, 0.0, None, None, 3.0, 4.0]),
        (0.0025, [None, None, None, 0.0, None, None, 3.0]),
    ],
)
def test_silence_takes_as_long_as_a_reading(between, seconds, expected):
    sensor = delayed(seconds, between=between)
    found = []
    for ms in range(7):
        now = BEGIN + ms * MS
        read = sensor(now, reading(now, 1.0 * ms) if ms in {0, 3, 4} else None)
        found.append(None if read is None else read.joints[0])
    assert found == expected


@pytest.mark.parametrize('between', ['interpolated', 'sampled'])
@given(
    gaps=st.lists(st.integers(1, 3 * MS), min_size=20, max_size=200),
    lost=st.lists(st.booleans(), min_size=200, max_size=200),
    ns=st.integers(0, 20 * MS),
)
def test_behind_a_silent_sensor_each_reading_arrives_once_however_the_ticks_fall(
    between, gaps, lost, ns
):
    # A silence first, so that it is a line of messages from the beginning.
    sensor, now, sent, heard = delayed(ns * 1e-9, between=between), BEGIN, [], []
    assert sensor(now, None) is None
    for number, gap in enumerate(gaps):
        now += gap
        read = None if lost[number] else reading(now, float(number))
        sent += [] if read is None else [(now, read.joints)]
        found = sensor(now, read)
        if found is not None:
            heard.append((now, found.joints))
    for _ in sent:  # whatever is still on its way arrives, one with each tick
        now += 20 * MS
        if (found := sensor(now, None)) is not None:
            heard.append((now, found.joints))
    assert [joints for _, joints in heard] == [joints for _, joints in sent]
    assert all(late - at >= ns for (at, _), (late, _) in zip(sent, heard, strict=True))


@pytest.mark.parametrize('between', ['interpolated', 'sampled'])
def test_while_time_stands_the_newest_reading_counts(between):
    sensor = delayed(0.001, between=between)
    times = [0, 0, 0, 1, 1, 2, 2]
    found = [
        shown(sensor(BEGIN + ms * MS, reading(BEGIN + ms * MS, 1.0 * number)))
        for number, ms in enumerate(times)
    ]
    assert found == [None, None, None, (2, 1), (2, 1), (4, 2), (4, 2)]


@pytest.mark.parametrize('between', ['interpolated', 'sampled'])
def test_no_more_is_kept_than_the_delay_takes(between):
    sensor = delayed(0.0205, between=between)
    for number in range(20_000):
        now = BEGIN + number * MS
        sensor(now, reading(now, 0.0))
        assert len(sensor._history) <= 23


def test_a_scene_is_late_by_the_delay():
    ideal = published('')
    for between in ('interpolated', 'sampled'):
        late = published(f'delay: {{seconds: 0.007, between: {between}, stamp: measured}}')
        assert late[:7] == [None] * 7
        assert late[7:] == ideal[:-7]


def test_between_ticks_a_scene_is_where_the_crank_then_was():
    # Of this motion the third derivatives are below 2.3e3 rad/s³, the fourth below 3.1e4 rad/s⁴.
    for number, found in enumerate(published('delay: {seconds: 0.0005}')[1:], 1):
        position = ANGLES.position(0.5 + 0.01 * (number - 0.5))
        assert found.joints == pytest.approx(position.joints, abs=3.1e4 * 0.001**4 / 384)
        rates = ANGLES.velocity(position, 10.0).joints
        assert found.rates == pytest.approx(rates, abs=2.3e3 * 0.001**2 / 8)
