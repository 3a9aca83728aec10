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


"""A history: exact where the motion is a cubic, of the order that it says, and never long."""

from __future__ import annotations

from functools import partial
from math import cos, sin

from hypothesis import assume, given
from hypothesis import strategies as st
from linkage_ros.effects.history import History
import pytest

from .sensors import BEGIN, MS, reading


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


@pytest.mark.parametrize(
    'coefficients',
    [
        pytest.param((1.0, 0.0, 0.0, 0.0), id='at rest'),
        pytest.param((1.0, -3.0, 0.0, 0.0), id='at a constant rate'),
        pytest.param((1.0, 2.0, -30.0, 0.0), id='turns back at 33 ms'),
        pytest.param((1.0, -2.0, 10.0, 50.0), id='a cubic'),
    ],
)
def test_between_readings_with_rates_is_the_cubic_itself(coefficients):
    signal = cubic(coefficients)
    # At 10 ms the way is more than the cubic part, as it is of a motion that ticks resolve.
    history = remembered(signal, range(BEGIN, BEGIN + 100 * MS, 10 * MS))
    for ns in (1, 999_999, 12_345_678, 33_333_333, 45_000_000, 89_999_999):
        found, true = history.between(BEGIN + ns), signal(BEGIN + ns)
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
def test_the_error_is_what_it_says_and_no_less(rates, law):
    # All derivatives of sin are at most 1, and at its top the even ones are.
    def signal(time):
        t = (time - BEGIN) * 1e-9
        return reading(time, sin(t), rates=(cos(t),) if rates else ())

    for h in (100 * MS, 50 * MS, 25 * MS):
        history = remembered(signal, range(BEGIN, BEGIN + 7000 * MS, h))
        worst = max(
            abs(history.between(time).joints[0] - signal(time).joints[0])
            for time in range(BEGIN, BEGIN + 6900 * MS, h // 8)
        )
        assert 0.95 * law(h * 1e-9) < worst < 1.001 * law(h * 1e-9)


@given(
    st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-1e300, 1e300), st.floats(-10.0, 10.0)
)
def test_a_rate_that_does_not_fit_the_values_is_not_believed(first, last, absurd, rate):
    # As next to a toggle, where one tick's rate may be any number. What it makes of a tick is more
    # than 5 ways and 3 times what the other rate makes: then 2·|c| is more than it may be.
    assume(abs(absurd) > 5.01 * abs(last - first) + 3.01 * 0.001 * abs(rate))
    history = History(10**9)
    history.add(BEGIN, reading(BEGIN, first, rates=(absurd * 1000.0,)))
    history.add(BEGIN + MS, reading(BEGIN + MS, last, rates=(rate,)))
    for ns in (1, MS // 3, MS - 1):
        (value,) = history.between(BEGIN + ns).joints
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
def test_where_belief_ends(way, expected):
    history = History(10**10)
    history.add(BEGIN, reading(BEGIN, 0.0, rates=(way,)))
    history.add(BEGIN + 1000 * MS, reading(BEGIN, 1.0, rates=(1.0,)))
    assert history.between(BEGIN + 500 * MS).joints == pytest.approx((expected,))


def test_what_one_of_the_two_does_not_have_is_left_out():
    history = History(10**9)
    history.add(BEGIN, reading(BEGIN, 1.0, rates=(9.0,), efforts=(2.0,)))
    history.add(BEGIN + 4 * MS, reading(BEGIN + 4 * MS, 3.0, efforts=(4.0,)))
    middle = history.between(BEGIN + MS)
    assert middle == reading(BEGIN + MS, 1.5, efforts=(2.5,))
    assert history.between(BEGIN) == reading(BEGIN, 1.0, rates=(9.0,), efforts=(2.0,))


def test_outside_of_what_was_read_nothing_is_invented():
    history = remembered(cubic((1.0, 2.0, 3.0, 4.0)), (BEGIN, BEGIN + MS))
    first, last = (cubic((1.0, 2.0, 3.0, 4.0))(time) for time in (BEGIN, BEGIN + MS))
    for look in (history.between, partial(history.newest, since=-1)):
        assert look(BEGIN - 1) is None
        assert look(BEGIN) == first
        assert look(BEGIN + MS) == look(BEGIN + 100 * MS) == last
    assert history.newest(BEGIN + MS - 1, -1) == first


def test_what_came_after_a_time_is_known_with_its_own():
    history = History(10**9)
    read = [(BEGIN + ms * MS, reading(BEGIN + ms * MS, float(ms))) for ms in range(4)]
    for now, one in read:
        history.add(now, one)
    assert history.after(BEGIN + MS) == read[2:]
    assert history.after(-1) == read


@given(st.lists(st.integers(0, 20), min_size=1, max_size=50), st.integers(0, 40))
def test_it_reaches_back_over_its_span_and_forgets_the_rest(gaps, span):
    history, all_of_them, now = History(span), {}, 0
    for number, gap in enumerate(gaps):
        now += gap
        history.add(now, reading(now, float(number)))
        all_of_them[now] = reading(now, float(number))
        for time in range(now - span, now + 1):
            before = [known for known in all_of_them if known <= time]
            assert history.newest(time, -1) == (all_of_them[max(before)] if before else None)
        # Of what is older than the last time it was asked, one is left.
        times = sorted(all_of_them)
        within = [known for known in times if known > (times[-2:][0] - span)]
        assert len(history) <= len(within) + 1


def test_while_time_stands_the_last_reading_counts_and_none_pile_up():
    history = History(10**9)
    history.add(BEGIN, reading(BEGIN, 0.0))
    for number in range(1000):
        history.add(BEGIN + MS, reading(BEGIN + MS, float(number)))
    assert len(history) == 2
    assert history.newest(BEGIN + MS, -1).joints == (999.0,)
    assert history.between(BEGIN + MS // 2).joints == (499.5,)
