# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Encoder: whole counts, however many turns; what it knows before its index mark; its rates."""

from fractions import Fraction
from itertools import pairwise
from math import exp, floor, isclose, tau, ulp

from hypothesis import assume, given, strategies as st
from linkage_ros.stages.effects import EncoderEffect, JointEncoder
import pytest

from .sensors import ANGLES, BEGIN, context, MS, published, reading, SLIDE

EXACT_TAU = Fraction('6.28318530717958647692528676655900576839433879875021')


def angle_encoder(rates='differenced', cutoff=0.0, **parameters):
    """Return the encoder of rocker_joint, the second of two angles; turns are counted."""
    parameters.setdefault('multi_turn', not parameters.get('incremental', False))
    joints = {'rocker_joint': JointEncoder(**parameters)}
    return EncoderEffect(joints, rates, cutoff).sensor(context(ANGLES))


def slide_encoder(**parameters):
    joints = {'rod_slide': JointEncoder(**parameters)}
    return EncoderEffect(joints).sensor(context(SLIDE))


def read(sensor, values, period=MS):
    """Return what is read of values, one for each tick."""
    times = [BEGIN + i * period for i in range(len(values))]
    return [
        sensor(now, reading(now, 0.125, value)).joints[1]
        for now, value in zip(times, values, strict=True)
    ]


@pytest.mark.parametrize(
    ('slide', 'expected'), [(0.0, 0.0), (0.0124, 0.012), (-0.0001, -0.001), (0.9999, 0.999)]
)
def test_slide_encoder_reads_a_thousand_counts_per_metre(slide, expected):
    assert read(slide_encoder(counts=1000), [slide]) == pytest.approx([expected], abs=1e-15)


counts = st.one_of(st.integers(1, 2**32), st.sampled_from([1, 1000, 4096, 2**23, 2**32]))


@given(counts, st.floats(-10.0, 10.0), st.floats(-1e4, 1e4))
def test_encoder_reads_the_whole_count_below_the_angle(n, offset, angle):
    (found,) = read(angle_encoder(counts=n, offset=offset), [angle])
    resolution = EXACT_TAU / n
    rounding = 4 * Fraction(ulp(abs(angle) + abs(offset) + tau / n))
    below = Fraction(angle) - Fraction(found)
    assert -rounding <= below < resolution + rounding
    count = (Fraction(found) - Fraction(offset)) / resolution
    assert abs(count - round(count)) * resolution <= rounding


@given(st.integers(-(10**6), 10**6), st.floats(0.0, tau), counts)
def test_encoder_stays_exact_over_a_million_turns(turns, rest, n):
    angle = turns * tau + rest
    exact = Fraction(angle) / EXACT_TAU * n
    # Where the angle's own last digit makes the count, either is right.
    assume(abs(exact - round(exact)) * EXACT_TAU / n > 4 * Fraction(ulp(angle)))
    (found,) = read(angle_encoder(counts=n), [angle])
    assert abs(Fraction(found) - floor(exact) * EXACT_TAU / n) <= 3 * Fraction(ulp(angle))


def test_encoder_reads_the_same_after_a_million_turns():
    sensor = angle_encoder(counts=5000, incremental=True)
    out_and_back = [0.3, 0.9, *(0.9 + 3.0 * i for i in range(100_000)), 1e6 * tau, 0.9, 0.3]
    found = read(sensor, out_and_back)
    absolute = read(angle_encoder(counts=5000), out_and_back)
    # The index mark was passed on the way.
    assert found[-2:] == absolute[-2:] == absolute[1::-1]


# A turn has 8 counts, of an eighth of a turn each; angles in eighths of a turn.
INCREMENTAL = [
    pytest.param({}, [2.5, 3.5, 7.5, 8.5, 9.5, 2.5], [0, 1, 5, 8, 9, 2], id='upwards'),
    pytest.param({}, [2.5, 0.5, -0.5, -1.5, 2.5], [0, -2, -1, -2, 2], id='downwards'),
    pytest.param({}, [2.5, 1.5, 7.5, 0.5, 6.5], [0, -1, 5, -2, 4], id='never at the mark'),
    pytest.param({}, [8.0, 9.5, 8.5, 7.5, 8.5], [0, 1, 0, 7, 8], id='begins at the mark'),
    pytest.param({}, [2.5, 6.5, 10.5], [0, 4, 10], id='passed between two ticks'),
    pytest.param({}, [-3.5, -0.5, 0.5], [0, 3, 0], id='from below zero'),
    pytest.param({}, [50.5, 52.5, 60.5], [0, 2, 60], id='some turns away'),
    pytest.param(
        {'index': False}, [2.5, 7.5, 8.5, 17.5, -3.5], [0, 5, 6, 15, -6], id='without a mark'
    ),
]


@pytest.mark.parametrize(('parameters', 'eighths', 'expected'), INCREMENTAL)
def test_incremental_encoder_is_relative_until_its_index_mark(parameters, eighths, expected):
    sensor = angle_encoder(counts=8, incremental=True, **parameters)
    found = read(sensor, [eighth * tau / 8 for eighth in eighths])
    assert found == pytest.approx([eighth * tau / 8 for eighth in expected], abs=1e-12)


def test_encoder_index_mark_lies_at_the_offset():
    sensor = angle_encoder(counts=8, incremental=True, offset=0.5)
    found = read(sensor, [0.5 + eighth * tau / 8 for eighth in (2.5, 7.5, 8.5)])
    assert found == pytest.approx([0.0, 5 * tau / 8, 0.5 + tau], abs=1e-12)


@pytest.mark.parametrize(
    ('slides', 'expected'),
    [
        pytest.param([0.145, 0.155, 0.205, 0.215], [0.0, 0.01, 0.2, 0.21], id='outwards'),
        pytest.param([0.245, 0.255, 0.195, 0.255], [0.0, 0.01, 0.19, 0.25], id='inwards'),
        pytest.param([0.245, 1.245, 5.245], [0.0, 1.0, 5.0], id='metres are no turns'),
    ],
)
def test_slide_encoder_has_one_index_mark(slides, expected):
    sensor = slide_encoder(counts=100, incremental=True, offset=0.2)
    assert read(sensor, slides) == pytest.approx(expected, abs=1e-12)


def speeds(sensor, angles, times):
    return [
        sensor(now, reading(now, 0.125, angle, rates=(7.0, 9.0))).rates
        for now, angle in zip(times, angles, strict=True)
    ]


def test_encoder_rates_are_count_differences_over_time():
    # Of 1000 counts a turn; angles in counts, times in ms.
    q = tau / 1000
    ticks = [(0, 10.5), (1, 10.9), (2, 11.1), (4, 15.5), (4, 16.5), (5, 17.5), (6, 14.5)]
    sensor = angle_encoder(counts=1000)
    found = speeds(sensor, [c * q for _, c in ticks], [BEGIN + ms * MS for ms, _ in ticks])
    assert [first for first, _ in found] == [7.0] * 7
    # In no time nothing can be said of the rate: it stays.
    expected = [0.0, 0.0, 1000.0, 2000.0, 2000.0, 1000.0, -3000.0]
    assert [rate for _, rate in found] == pytest.approx([counts * q for counts in expected])


@given(st.floats(-200.0, 200.0), st.floats(0.0, 6.0), st.integers(2, 10_000))
def test_mean_encoder_rate_equals_the_true_rate(rate, begin, n):
    sensor = angle_encoder(counts=n)
    times = [BEGIN + i * MS for i in range(200)]
    found = speeds(sensor, [begin + rate * 1e-3 * i for i in range(200)], times)
    resolution = tau / n
    for _, each in found:
        assert isclose(each / (resolution * 1000), round(each / (resolution * 1000)), abs_tol=1e-6)
        assert abs(each - rate) < resolution * 1000 * (1 + 1e-9) or each == 0.0
    mean = sum(each for _, each in found[1:]) / 199
    assert abs(mean - rate) <= resolution / 0.199 * (1 + 1e-9)


def test_index_mark_step_adds_no_encoder_rate():
    sensor = angle_encoder(counts=8, incremental=True)
    angles = [eighth * tau / 8 for eighth in (5.5, 6.5, 7.5, 8.5, 9.5)]
    found = speeds(sensor, angles, [BEGIN + i * MS for i in range(5)])
    assert [rate for _, rate in found] == pytest.approx([0.0, *[1000 * tau / 8] * 4])


def test_encoder_low_pass_smooths_rates_exponentially():
    # The joint begins to turn by 5 counts a ms; readings come at irregular times.
    sensor = angle_encoder(cutoff=30.0, counts=1000)
    times = [0, 1, 2, 3, 5, 6, 10, 30]
    angles = [(5 * max(0, ms - 2) + 0.5) * tau / 1000 for ms in times]
    found = speeds(sensor, angles, [BEGIN + ms * MS for ms in times])
    expected = [5000 * tau / 1000 * (1.0 - exp(-tau * 30e-3 * max(0, ms - 2))) for ms in times]
    assert [rate for _, rate in found] == pytest.approx(expected)


def test_encoder_passes_exact_rates_unchanged():
    sensor = angle_encoder(rates='exact', counts=8)
    found = speeds(sensor, [0.0, 1.0, 2.0], [BEGIN, BEGIN + MS, BEGIN + 2 * MS])
    assert found == [(7.0, 9.0)] * 3


def test_encoder_makes_no_rates_where_none_exist():
    sensor = angle_encoder(counts=1000)
    found = [
        sensor(BEGIN + i * MS, reading(BEGIN, 0.0, (i**2 + 0.5) * tau / 1000, rates=rates)).rates
        for i, rates in enumerate([(7.0, 9.0), (), (), (7.0, 9.0)])
    ]
    assert found[:3] == [(7.0, 0.0), (), ()]
    assert found[3] == pytest.approx((7.0, 5000 * tau / 1000))


def test_multi_turn_encoder_counts_continuous_angles():
    # The coupler falls behind by a turn in each of the three turns of the crank.
    text = 'encoder: {joints: {coupler_joint: {counts: 64, multi_turn: true}}}'
    ideal, found = published('', 200, rate=100.0), published(text, 200, rate=100.0)
    assert found[-1].joints[0] < -2 * tau
    for i, f in zip(ideal, found, strict=True):
        assert 0.0 <= i.joints[0] - f.joints[0] < tau / 64
        assert f.joints[1] == i.joints[1]
        assert f.rates[1] == i.rates[1]


@pytest.mark.parametrize(
    ('offset', 'counts', 'expected'),
    [
        # Eight counts lie from −180° to 135° about the offset, five from −144° to 144°.
        (0.0, 8, range(-4, 4)),
        (0.7, 8, range(-4, 4)),
        (0.0, 5, range(-2, 3)),
        (0.0, 1, [0]),
    ],
)
def test_absolute_encoder_reads_within_half_a_turn(offset, counts, expected):
    sensor = angle_encoder(counts=counts, offset=offset, multi_turn=False)
    angles = [offset + (k + 0.5) * tau / counts for k in range(-5 * counts, 5 * counts)]
    found = read(sensor, angles)
    assert {round((y - offset) * counts / tau) for y in found} == set(expected)
    for y, angle in zip(found, angles, strict=True):
        count = (angle - y) * counts / tau - 0.5
        assert count == pytest.approx(round(count / counts) * counts, abs=1e-9)


def test_absolute_encoder_rates_ignore_the_wrap():
    sensor = angle_encoder(counts=100, multi_turn=False)
    rates = []
    for ms in range(300):
        now = BEGIN + ms * MS
        found = sensor(now, reading(now, 0.0, (ms + 0.5) * tau / 100, rates=(0.0, 9.0)))
        rates.append(found.rates[1])
    assert rates == pytest.approx([0.0, *[tau / 100 / 1e-3] * 299])


def test_rate_limited_encoder_rates_span_the_sample_period():
    # 1024 counts a turn at 1 kHz make steps of 6.1 rad/s; read each 20 ms of 0.31 rad/s.
    effects = (
        'encoder: {joints: {rocker_joint: {counts: 1024}}}, rate_limit: {rate: 50, hold: silent}'
    )
    found = [one for one in published(effects, 200, rate=3.0) if one is not None]
    assert len(found) == 10
    for before, after in pairwise(found):
        moved = after.joints[1] - before.joints[1]
        assert after.rates[1] == pytest.approx(moved / 0.02, abs=1e-12)
    # Repeated readings keep the rate of their sample.
    held = published(effects.replace('silent', 'repeat'), 200, rate=3.0)
    assert [one.rates[1] for one in held[::20]] == [one.rates[1] for one in found]
    assert all(one.rates == held[i // 20 * 20].rates for i, one in enumerate(held))
