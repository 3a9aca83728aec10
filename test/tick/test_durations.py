# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The histogram of how late ticks were: its percentiles against those of the durations."""

from hypothesis import given, strategies as st
from linkage_ros.tick import DurationHistogram
import numpy as np
import pytest

BIN = 1.0 / 32.0
"""Greatest width of a bin, as a fraction of the duration."""


@given(st.lists(st.integers(0, 10**13), min_size=1, max_size=200))
def test_tick_percentiles_equal_numpy_within_a_bin(durations):
    histogram = DurationHistogram()
    for duration in durations:
        histogram.add_duration(duration)
    assert (histogram.count, histogram.longest) == (len(durations), max(durations))
    for percent in (1, 50, 90, 99, 100):
        exact = int(np.percentile(durations, percent, method='inverted_cdf'))
        assert exact <= histogram.percentile(percent) <= exact * (1.0 + BIN)


@pytest.mark.parametrize('percent', [50, 99])
def test_one_late_tick_in_1000_changes_no_percentile(percent):
    histogram = DurationHistogram()
    for _ in range(999):
        histogram.add_duration(1_000)
    histogram.add_duration(1_000_000)
    assert 1_000 <= histogram.percentile(percent) <= 1_000 * (1.0 + BIN)
    assert histogram.percentile(100) == histogram.longest == 1_000_000


def test_negative_lateness_counts_as_on_time():
    histogram = DurationHistogram()
    histogram.add_duration(-5)
    assert (histogram.count, histogram.longest, histogram.percentile(100)) == (1, 0, 0)


def test_empty_histogram_has_percentile_0():
    assert DurationHistogram().percentile(99) == 0
