# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Rate limit: samples on a grid of their own that never drifts, and held in between."""

from fractions import Fraction
from math import floor

from hypothesis import given, strategies as st
from linkage_ros.stages.effects import RateLimitEffect
import pytest

from .sensors import BEGIN, context, MS, published, reading


def sampled_at(rate, times, **clock):
    """Return for each time, in [ns] since the first, that of the sample that is published."""
    sensor = RateLimitEffect(rate, **clock).sensor(context())
    found = [sensor(BEGIN + t, reading(BEGIN + t, t)) for t in times]
    return [read and read.joints[0] for read in found]


@pytest.mark.parametrize(
    ('rate', 'ticks', 'samples'),
    [
        pytest.param(500.0, [0, 1, 2, 3, 4, 5], [0, 0, 2, 2, 4, 4], id='every other tick'),
        # Due at 0, 3.33, 6.67 and 10 ms.
        pytest.param(300.0, [*range(11)], [0, 0, 0, 0, 4, 4, 4, 7, 7, 7, 10], id='between ticks'),
        pytest.param(1000.0, [0, 1, 2, 3], [0, 1, 2, 3], id='every tick'),
        pytest.param(20_000.0, [0, 1, 2, 3], [0, 1, 2, 3], id='faster than the ticks'),
        # What is late does not move what comes after: the next is due at 20, not at 27 ms.
        pytest.param(100.0, [0, 9, 17, 19, 20, 29, 30], [0, 0, 17, 17, 20, 20, 30], id='late'),
        pytest.param(100.0, [0, 5, 45, 49, 50], [0, 0, 45, 45, 50], id='ticks that were lost'),
        pytest.param(500.0, [0, 0, 2, 2, 3], [0, 0, 2, 2, 2], id='time stands'),
        pytest.param(0.001, [0, 1, 999_999, 1_000_000], [0, 0, 0, 1_000_000], id='slow'),
    ],
)
def test_rate_limit_samples_on_its_grid(rate, ticks, samples):
    assert sampled_at(rate, [ms * MS for ms in ticks]) == [ms * MS for ms in samples]


def test_rate_limit_rounds_half_nanoseconds_up():
    # 10⁹/1024 is 976562.5.
    ticks = [0, 976_562, 976_563, 1_953_124, 1_953_125]
    assert sampled_at(1024.0, ticks) == [0, 0, 976_563, 976_563, 1_953_125]
    # The second sample is taken late, and the third is due a nanosecond after that.
    assert sampled_at(1024.0, [0, 2_929_687, 2_929_688]) == [0, 2_929_687, 2_929_688]


@given(
    st.floats(0.001, 20_000.0),
    st.integers(1, 10**12),
    st.floats(-1000.0, 1000.0),
    st.integers(1, 10**9),
)
def test_rate_limit_grid_is_exact_to_the_nanosecond(rate, k, ppm, first):
    # By a clock that runs fast, whose first sample is later than the first tick.
    real = Fraction(rate) * (1 + Fraction(ppm) / 10**6)
    due, before = (first + floor(n * Fraction(10**9) / real + Fraction(1, 2)) for n in (k, k - 1))
    clock = {'ppm': ppm, 'phase': first * 1e-9}
    # Once after long silence, and once where the sample before it was taken.
    assert sampled_at(rate, [0, first - 1, first, due], **clock) == [None, None, first, due]
    times = [0, first, before, due - 1, due]
    assert sampled_at(rate, times, **clock) == [None, first, before, before, due]


def test_rate_limit_does_not_drift_over_a_day():
    seconds = 86_400
    times = [t * 10**9 + third for t in range(0, seconds, 600) for third in (0, 333_333_333)]
    assert sampled_at(3.0, times) == times
    early = [t + 333_333_332 for t in range(0, seconds * 10**9, 600 * 10**9)]
    assert sampled_at(3.0, sorted({0, *early})) == [0, 0, *early[1:]]


def test_held_reading_carries_the_stamp_of_the_tick():
    sensor = RateLimitEffect(100.0).sensor(context())
    rest = {'rates': (1.0, 2.0), 'accelerations': (3.0, 4.0), 'efforts': (5.0, 6.0)}
    first = reading(BEGIN, 0.5, 0.25, **rest)
    assert sensor(BEGIN, first) == first
    for ms in range(1, 10):
        now = BEGIN + ms * MS
        assert sensor(now, reading(now, 9.0, 9.0)) == first._replace(stamp=now)


def test_rate_limited_scene_holds_or_omits_readings():
    ideal = published('')
    for n, held in enumerate(published('rate_limit: {rate: 100}')):
        assert held == ideal[n // 10 * 10]._replace(stamp=BEGIN + n * MS)
    silent = published('rate_limit: {rate: 100, hold: silent}')
    assert silent == [read if n % 10 == 0 else None for n, read in enumerate(ideal)]
