# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Delay: exact to the nanosecond; and the history that delay and jitter read."""

from fractions import Fraction
from functools import partial
from math import cos, sin
from random import Random

from hypothesis import assume, given, settings, strategies as st
from linkage_ros.stages.effects import DelayEffect, History
import pytest
from scipy.stats import expon, kstest, uniform

from .sensors import ANGLES, BEGIN, context, likely, MS, published, reading

# Delay: exact to the nanosecond, no value before the first, and no more history than needed.


def delayed(seconds, **parameters):
    return DelayEffect(seconds, **parameters).sensor(context())


def shown(found):
    """Return what a message tells: value, and stamp in [ms]; nothing where there is none."""
    return None if found is None else (found.joints[0], (found.stamp - BEGIN) / MS)


@given(
    st.floats(-1e3, 1e3),
    st.floats(-1e3, 1e3),
    st.integers(0, 20 * MS),
    st.lists(st.integers(1, 3 * MS), min_size=5, max_size=40),
    st.booleans(),
    st.sampled_from(('interpolated', 'sampled')),
    st.sampled_from(('measured', 'arrival')),
)
def test_delay_is_exact_for_a_constant_rate(a, b, ns, gaps, with_rates, between, stamp):
    def value(time):
        return Fraction(a) + Fraction(b) * Fraction(time - BEGIN, 10**9)

    sensor = delayed(ns * 1e-9, between=between, stamp=stamp)
    rates = {'rates': (b,), 'accelerations': (0.0,)} if with_rates else {}
    now, times = BEGIN, []
    for gap in gaps:
        times.append(now)
        read = reading(now, float(value(now)), efforts=(float(value(now)),), **rates)
        found = sensor(now, read)
        assert (found is None) == (now - ns < BEGIN)
        if found is not None:
            measured = now - ns
            if between == 'sampled':
                measured = max(time for time in times if time <= measured)
            assert found.stamp == (measured if stamp == 'measured' else now)
            assert (found.rates, found.accelerations) == (read.rates, read.accelerations)
            for one in (*found.joints, *found.efforts):
                assert abs(Fraction(one) - value(measured)) <= 1e-15 * (abs(a) + abs(b)) + 1e-300
        now += gap


@pytest.mark.parametrize('ns', [15, 63, 1000, 1_000_015])
def test_delay_rounds_seconds_to_the_nearest_nanosecond(ns):
    # 15e-9·1e9 is 14.999999999999998 in doubles.
    sensor = delayed(float(f'{ns}e-9'), stamp='measured')
    sensor(BEGIN, reading(BEGIN, 1.0))
    assert sensor(BEGIN + ns + 5, reading(BEGIN + ns + 5, 2.0)).stamp == BEGIN + 5


def test_missing_rates_at_a_toggle_arrive_delayed():
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
def test_silence_is_delayed_like_a_reading(between, seconds, expected):
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
def test_delayed_readings_of_a_silent_sensor_arrive_once(between, gaps, lost, ns):
    # A silence first, so that it is a line of messages from the beginning.
    sensor, now, sent, heard = delayed(ns * 1e-9, between=between), BEGIN, [], []
    assert sensor(now, None) is None
    for index, gap in enumerate(gaps):
        now += gap
        read = None if lost[index] else reading(now, float(index))
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
def test_delay_uses_the_newest_reading_of_an_instant(between):
    sensor = delayed(0.001, between=between)
    times = [0, 0, 0, 1, 1, 2, 2]
    found = [
        shown(sensor(BEGIN + ms * MS, reading(BEGIN + ms * MS, 1.0 * index)))
        for index, ms in enumerate(times)
    ]
    assert found == [None, None, None, (2, 1), (2, 1), (4, 2), (4, 2)]


@pytest.mark.parametrize('between', ['interpolated', 'sampled'])
def test_delay_history_is_bounded_by_the_delay(between):
    sensor = delayed(0.0205, between=between)
    for index in range(20_000):
        now = BEGIN + index * MS
        sensor(now, reading(now, 0.0))
        assert len(sensor._history) <= 23


def test_scene_publishes_readings_late_by_the_delay():
    ideal = published('')
    for between in ('interpolated', 'sampled'):
        late = published(f'delay: {{seconds: 0.007, between: {between}, stamp: measured}}')
        assert late[:7] == [None] * 7
        assert late[7:] == ideal[:-7]


def test_delay_between_ticks_interpolates_the_crank_motion():
    # Of this motion the third derivatives are below 2.3e3 rad/s³, the fourth below 3.1e4 rad/s⁴.
    for number, found in enumerate(published('delay: {seconds: 0.0005}')[1:], 1):
        position = ANGLES.position(0.5 + 0.01 * (number - 0.5))
        assert found.joints == pytest.approx(position.joints, abs=3.1e4 * 0.001**4 / 384)
        rates = ANGLES.velocity(position, 10.0).joints
        assert found.rates == pytest.approx(rates, abs=2.3e3 * 0.001**2 / 8)


# The history: exact for cubic motions, with the order that it declares, and of bounded length.


def remembered(signal, times, span=10**12):
    history = History(span)
    for time in times:
        history.add(time, signal(time))
    return history


def cubic(coefficients):
    """Return what reads the cubic of the seconds since BEGIN, with its derivatives."""
    a, b, c, d = coefficients

    def signal(time):
        t = (time - BEGIN) * 1e-9
        return reading(
            time,
            a + t * (b + t * (c + t * d)),
            rates=(b + t * (2 * c + t * 3 * d),),
            accelerations=(2 * c + 6 * d * t,),
            efforts=(a - t,),
        )

    return signal


# At rest; one that turns back at 33 ms; a cubic.
@pytest.mark.parametrize('coefficients', [(1, 0, 0, 0), (1, 2, -30, 0), (1, -2, 10, 50)])
def test_interpolation_with_rates_reproduces_a_cubic(coefficients):
    signal = cubic(coefficients)
    # At 10 ms the way is more than the cubic part, as it is of a motion that ticks resolve.
    history = remembered(signal, range(BEGIN, BEGIN + 100 * MS, 10 * MS))
    for ns in (1, 999_999, 12_345_678, 33_333_333, 45_000_000, 89_999_999):
        found, true = history.interpolate(BEGIN + ns), signal(BEGIN + ns)
        assert found.stamp == BEGIN + ns
        assert found.joints == pytest.approx(true.joints, abs=1e-15)
        assert found.accelerations == pytest.approx(true.accelerations, abs=1e-12)
        assert found.efforts == pytest.approx(true.efforts, abs=1e-15)


@pytest.mark.parametrize(
    ('rates', 'law'),
    [
        pytest.param(True, lambda h: h**4 / 384, id='with rates'),
        pytest.param(False, lambda h: h**2 / 8, id='without'),
    ],
)
def test_interpolation_error_equals_the_documented_bound(rates, law):
    # All derivatives of sin are at most 1, and at its top the even ones are.
    def signal(time):
        t = (time - BEGIN) * 1e-9
        return reading(time, sin(t), rates=(cos(t),) if rates else ())

    for h in (100 * MS, 50 * MS, 25 * MS):
        history = remembered(signal, range(BEGIN, BEGIN + 7000 * MS, h))
        worst = max(
            abs(history.interpolate(time).joints[0] - signal(time).joints[0])
            for time in range(BEGIN, BEGIN + 6900 * MS, h // 8)
        )
        assert 0.95 * law(h * 1e-9) < worst < 1.001 * law(h * 1e-9)


@given(
    st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-1e300, 1e300), st.floats(-10.0, 10.0)
)
def test_interpolation_ignores_rates_inconsistent_with_the_values(first, last, absurd, rate):
    # As next to a toggle, where one tick's rate may be any number. What it makes of a tick is more
    # than 5 ways and 3 times what the other rate makes: then 2·|c| is more than it may be.
    assume(abs(absurd) > 5.01 * abs(last - first) + 3.01 * 0.001 * abs(rate))
    history = History(10**9)
    history.add(BEGIN, reading(BEGIN, first, rates=(absurd * 1000.0,)))
    history.add(BEGIN + MS, reading(BEGIN + MS, last, rates=(rate,)))
    for ns in (1, MS // 3, MS - 1):
        (value,) = history.interpolate(BEGIN + ns).joints
        assert min(first, last) - 1e-12 <= value <= max(first, last) + 1e-12


@pytest.mark.parametrize(
    ('way', 'expected'),
    [
        # From 0 to 1, where the other rate is that of the way: then |c| is |way − 1|.
        pytest.param(1.99, 0.5 + 0.99 / 8, id='more than fits by less than the way'),
        pytest.param(0.01, 0.5 - 0.99 / 8, id='less than fits by less than the way'),
        pytest.param(2.01, 0.5, id='more than fits by more'),
        pytest.param(-0.01, 0.5, id='less than fits by more'),
    ],
)
def test_interpolation_drops_rates_beyond_the_threshold(way, expected):
    history = History(10**10)
    history.add(BEGIN, reading(BEGIN, 0.0, rates=(way,)))
    history.add(BEGIN + 1000 * MS, reading(BEGIN, 1.0, rates=(1.0,)))
    assert history.interpolate(BEGIN + 500 * MS).joints == pytest.approx((expected,))


def test_interpolation_omits_fields_missing_in_one_reading():
    history = History(10**9)
    history.add(BEGIN, reading(BEGIN, 1.0, rates=(9.0,), efforts=(2.0,)))
    history.add(BEGIN + 4 * MS, reading(BEGIN + 4 * MS, 3.0, efforts=(4.0,)))
    middle = history.interpolate(BEGIN + MS)
    assert middle == reading(BEGIN + MS, 1.5, efforts=(2.5,))
    assert history.interpolate(BEGIN) == reading(BEGIN, 1.0, rates=(9.0,), efforts=(2.0,))


def test_history_extrapolates_nothing_outside_its_readings():
    history = remembered(cubic((1.0, 2.0, 3.0, 4.0)), (BEGIN, BEGIN + MS))
    first, last = (cubic((1.0, 2.0, 3.0, 4.0))(time) for time in (BEGIN, BEGIN + MS))
    for look in (history.interpolate, partial(history.newest_reading, since=-1)):
        assert look(BEGIN - 1) is None
        assert look(BEGIN) == first
        assert look(BEGIN + MS) == look(BEGIN + 100 * MS) == last
    assert history.newest_reading(BEGIN + MS - 1, -1) == first


def test_history_lists_readings_after_a_time():
    history = History(10**9)
    read = [(BEGIN + ms * MS, reading(BEGIN + ms * MS, float(ms))) for ms in range(4)]
    for now, one in read:
        history.add(now, one)
    assert history.readings_after(BEGIN + MS) == read[2:]
    assert history.readings_after(-1) == read


@given(st.lists(st.integers(0, 20), min_size=1, max_size=50), st.integers(0, 40))
def test_history_keeps_only_its_span(gaps, span):
    history, all_of_them, now = History(span), {}, 0
    for index, gap in enumerate(gaps):
        now += gap
        history.add(now, reading(now, float(index)))
        all_of_them[now] = reading(now, float(index))
        for time in range(now - span, now + 1):
            before = [known for known in all_of_them if known <= time]
            assert history.newest_reading(time, -1) == (
                all_of_them[max(before)] if before else None
            )
        # Of what is older than the last time it was asked, one is left.
        times = sorted(all_of_them)
        within = [known for known in times if known > (times[-2:][0] - span)]
        assert len(history) <= len(within) + 1


def test_history_keeps_one_reading_per_instant():
    history = History(10**9)
    history.add(BEGIN, reading(BEGIN, 0.0))
    for index in range(1000):
        history.add(BEGIN + MS, reading(BEGIN + MS, float(index)))
    assert len(history) == 2
    assert history.newest_reading(BEGIN + MS, -1).joints == (999.0,)
    assert history.interpolate(BEGIN + MS // 2).joints == (499.5,)


# Random latencies. Of the messages that arrive between two ticks the last one is published.

TICK = 10_000  # ns


def arrivals(count, *, every=1000, seed='seed', **parameters):
    """Return what was sent and what arrived when: (message, time in ns), a tick each 10 µs."""
    sensor = DelayEffect(**parameters).sensor(context(seed=seed))
    sent, arrived, number = {}, [], 0
    while len(sent) < count or sensor._way:
        now = BEGIN + number * TICK
        if number % every == 0 and len(sent) < count:
            sent[float(len(sent))] = now
            found = sensor(now, reading(now, float(len(sent) - 1)))
        else:
            found = sensor.silence(now, False)
        if found is not None:
            arrived.append((found.joints[0], now))
        number += 1
    return sent, arrived


@pytest.mark.parametrize(
    ('distribution', 'expected'), [('uniform', uniform), ('exponential', expon)]
)
def test_latencies_follow_the_declared_distribution(distribution, expected):
    sent, arrived = arrivals(
        500, every=50, seconds=0.002, spread=0.004, distribution=distribution, reorder=True
    )
    latencies = [(now - sent[message]) * 1e-9 for message, now in arrived]
    assert len(arrived) > 480
    assert kstest([(each - 0.002) / 0.004 for each in latencies], expected.cdf).pvalue > 1e-3
    assert min(latencies) >= 0.002


@given(st.booleans(), st.floats(0.0001, 0.003), st.integers(1, 30), st.integers(0, 99))
@settings(max_examples=25)
def test_tick_publishes_the_last_arrived_message(reorder, spread, every, seed):
    # By hand, with the same draws: when each arrives, and of each tick the last.
    sent, arrived = arrivals(
        40, every=every, seed=f'{seed}', seconds=0.0005, spread=spread, reorder=reorder
    )
    draw, latest, due = Random(f'{seed}/delay').random, 0, []
    for message, time in sent.items():
        arrives = time + 500_000 + round(spread * 1e9 * draw())
        latest = arrives if reorder else max(arrives, latest)
        due.append((latest, message))
    shown = {}
    for arrives, message in sorted(due):
        shown[BEGIN + -(-(arrives - BEGIN) // TICK) * TICK] = message
    assert arrived == [(message, tick) for tick, message in shown.items()]
    if not reorder:
        assert [message for message, _ in arrived] == sorted(message for message, _ in arrived)


def test_reordered_messages_keep_their_measured_stamps():
    _, arrived = arrivals(200, every=10, seconds=0.0, spread=0.002, reorder=True)
    messages = [message for message, _ in arrived]
    assert messages != sorted(messages)
    sensor = DelayEffect(0.0, stamp='measured', spread=0.001).sensor(context())
    assert sensor(BEGIN, reading(BEGIN, 1.0)) is None
    assert sensor.silence(BEGIN + MS, False).stamp == BEGIN


def test_duplicates_arrive_with_the_declared_probability():
    # Latencies of up to 20 ticks, a message every 50: both of a pair arrive, if not in one tick.
    sent, arrived = arrivals(
        2000, every=50, seconds=0.0, spread=20 * TICK * 1e-9, duplicates=0.3, reorder=True
    )
    extra = len(arrived) - len(sent)
    expected = 0.3 * (1.0 - 1.0 / 20.0)  # of two uniform draws one in 20 falls into one tick
    assert likely((extra - 2000 * expected) ** 2 / (2000 * expected * (1.0 - expected)), 1)
    assert {message for message, _ in arrived} == {*sent}
