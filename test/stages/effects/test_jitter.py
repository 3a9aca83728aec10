# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Jitter: within its bounds, of its distribution, and read off a motion that is still exact."""

from itertools import pairwise
from math import erf, sqrt

from linkage_ros.stages.effects import JitterEffect
import pytest

from .sensors import BEGIN, chi_square, context, MS, published, reading, UNLIKELY


def earlier(seconds, distribution='uniform', seed='seed', n=20_000, period=MS):
    """Return how much earlier each tick has looked, in [ns], but the first ones."""
    sensor = JitterEffect(seconds, distribution).sensor(context(seed=seed))
    # The value is the time itself, in [ns] since the first tick: whole up to 2⁵³.
    found = [sensor(BEGIN + i * period, reading(BEGIN, float(i * period))) for i in range(n)]
    begin = round(seconds * 1e9) // period + 1
    return [i * period - found[i].joints[0] for i in range(begin, n)]


def uniform(seconds, most):
    return seconds / most


def half_normal(seconds, most):
    return erf(3.0 * seconds / most / sqrt(2.0)) if seconds < most else 1.0


@pytest.mark.parametrize('seconds', [0.0004, 0.0035], ids=['within a tick', 'over some ticks'])
@pytest.mark.parametrize('distribution', [uniform, half_normal])
def test_jitter_instants_follow_the_declared_distribution(seconds, distribution):
    instants = earlier(seconds, distribution.__name__)
    n, bins = len(instants), 20
    assert min(instants) >= 0.0
    assert max(instants) <= round(seconds * 1e9)
    counts = [0] * bins
    for instant in instants:
        counts[min(int(instant * 1e-9 / seconds * bins), bins - 1)] += 1
    edges = [distribution(k * seconds / bins, seconds) for k in range(bins + 1)]
    expected = [n * (after - before) for before, after in pairwise(edges)]
    total = sum((c - e) ** 2 / e for c, e in zip(counts, expected, strict=True))
    assert UNLIKELY < chi_square(total, bins - 1) < 1.0 - UNLIKELY


def test_jittered_reading_is_of_one_instant():
    sensor = JitterEffect(0.002).sensor(context())
    for i in range(200):
        now, t = BEGIN + i * MS, i * 1e-3
        found = sensor(
            now,
            reading(
                now, t, 5.0 * t, rates=(2.0 * t, 1.0), accelerations=(0.0, -t), efforts=(t, 0.0)
            ),
        )
        instant = found.efforts[0]
        assert t - 0.002 <= instant <= t
        assert found.rates == pytest.approx((2.0 * instant, 1.0), abs=1e-15)
        assert found.accelerations == pytest.approx((0.0, -instant), abs=1e-15)
        assert found.joints[1] == pytest.approx(5.0 * instant, abs=1e-15)


def test_jitter_interpolates_an_accelerated_motion_exactly():
    # With rates it is read off a cubic, which a motion at a constant acceleration is.
    sensor = JitterEffect(0.005).sensor(context())
    instants = []
    for i in range(1000):
        now, t = BEGIN + 2 * i * MS, 0.002 * i
        found = sensor(now, reading(now, 3.0 * t * t, rates=(6.0 * t,)))
        instants.append(found.rates[0] / 6.0)
        assert found.joints[0] == pytest.approx(3.0 * instants[-1] ** 2, rel=1e-12, abs=1e-15)
    # More than a tick early, so that some look before what the one before has seen.
    assert any(after < before for before, after in pairwise(instants))


def test_jitter_never_looks_before_the_first_tick():
    sensor = JitterEffect(1.0).sensor(context())
    found = [sensor(BEGIN + i * MS, reading(BEGIN, 1.0 + i)).joints[0] for i in range(100)]
    assert found[0] == 1.0
    assert min(found) == 1.0
    assert max(found) > 10.0


def test_zero_jitter_changes_nothing():
    for distribution in ('uniform', 'half_normal'):
        assert set(earlier(0.0, distribution, n=100)) == {0.0}


def test_jitter_uses_the_newest_reading_of_an_instant():
    sensor = JitterEffect(0.001).sensor(context())
    for value in range(10):
        assert sensor(BEGIN, reading(BEGIN, 1.0 * value)).joints == (1.0 * value,)


def test_jitter_error_is_bounded_by_the_joint_rates():
    ideal, shaken = published(''), published('jitter: {seconds: 0.001}')
    errors = [
        abs(a - b)
        for i, s in zip(ideal, shaken, strict=True)
        for a, b in zip(i.joints, s.joints, strict=True)
    ]
    fastest = max(abs(rate) for i in ideal for rate in i.rates)
    assert 0.5e-3 * fastest < max(errors) <= 1e-3 * fastest
