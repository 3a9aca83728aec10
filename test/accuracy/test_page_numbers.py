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


"""Numbers are written with the digits that tell something, ticks where a reader expects them."""

from __future__ import annotations

from math import inf, nan

from hypothesis import given, strategies
from linkage_ros.accuracy.page.diagrams import Range
from linkage_ros.accuracy.page.numbers import cell_text, number_text, spread_text
from linkage_ros.accuracy.page.svg import ticks
from linkage_ros.accuracy.results import Axis
from linkage_ros.measuring import Spread
import numpy as np
import pytest

# The very greatest, rounded to three digits, are beyond a double.
FINITE = strategies.floats(-1e308, 1e308)


@pytest.mark.parametrize(
    ('cell', 'text'),
    [
        (None, ''),
        ('failed', 'failed'),
        (0, '0'),
        (-0.0, '0'),
        (1048576, '1048576'),
        (np.int64(7), '7'),
        (np.float64(0.25), '0.25'),
        (0.7, '0.7'),
        (12.345, '12.3'),
        (999.96, '1000'),
        (123456.7, '123457'),
        (1234567.0, '1.23e6'),
        (1e-6, '1e-6'),
        (3.14159e-9, '3.14e-9'),
        (-1.5, '-1.5'),
        (5e-324, '4.94e-324'),
        (inf, '∞'),
        (-inf, '-∞'),
        (nan, 'nan'),
    ],
)
def test_a_cell_is_written_with_the_digits_that_tell_something(cell, text):
    assert cell_text(cell) == text


@pytest.mark.parametrize(
    ('spread', 'text'),
    [
        ((0.68, 0.7, 0.75), '0.70 (0.68–0.75)'),
        ((1.1e-9, 1.2e-9, 1.31e-9), '1.2 (1.1–1.3)e-9'),
        # A dash after a minus could be one.
        ((-0.6, -0.5, -0.4), '-0.50 (-0.60 to -0.40)'),
        # A single measurement has no spread.
        ((5.0, 5.0, 5.0), '5'),
        ((0.0, 0.0, 0.0), '0'),
        ((0.7, 0.7001, 0.7002), '0.7001 (0.7000–0.7002)'),
        # What the quartiles do not tell apart is not said of the median.
        ((-0.001, 0.0004, 0.02), '0.000 (-0.001 to 0.020)'),
        ((-0.02, -0.0004, 0.001), '0.000 (-0.020 to 0.001)'),
        ((345.0, 351.0, 360.0), '351 (345–360)'),
        ((1.0, inf, inf), '∞ (1–∞)'),
        ((0.0, 5e-324, 1e-323), '4.9 (0.0–9.9)e-324'),
    ],
)
def test_a_spread_as_text(spread, text):
    assert spread_text(Spread(*spread)) == text


@given(FINITE)
def test_a_number_keeps_three_digits(value):
    assert float(number_text(value)) == pytest.approx(value, rel=0.006, abs=0.0)


@given(strategies.lists(FINITE, min_size=3, max_size=3).map(sorted))
def test_a_spread_has_a_text_whatever_it_is(values):
    assert spread_text(Spread(*values)).count('(') == (len(set(values)) > 1)


@pytest.mark.parametrize(
    ('low', 'high', 'logarithmic', 'texts'),
    [
        (3e-16, 20.0, True, '10⁻¹⁴ 10⁻¹² 10⁻¹⁰ 10⁻⁸ 10⁻⁶ 10⁻⁴ 0.01 1'),
        (0.1, 10.0, True, '0.1 0.2 0.5 1 2 5 10'),
        (0.6, 0.95, True, '0.60 0.65 0.70 0.75 0.80 0.85 0.90 0.95'),
        (2e-6, 9e-6, True, '2·10⁻⁶ 3·10⁻⁶ 5·10⁻⁶ 7·10⁻⁶'),
        (1e-9, 1e9, True, '10⁻⁹ 10⁻⁶ 10⁻³ 1 1000 10⁶ 10⁹'),
        (-0.05, 0.3, False, '-0.05 0.00 0.05 0.10 0.15 0.20 0.25 0.30'),
        (0.0, 3000.0, False, '0 500 1000 1500 2000 2500 3000'),
    ],
)
def test_ticks_of_an_axis(low, high, logarithmic, texts):
    found = ticks(Range(Axis('', '', logarithmic), low, high))
    assert {text for _, text in found} == set(texts.split())
    assert all(low - 1e-12 <= value <= high + 1e-12 for value, _ in found)


@given(
    strategies.floats(1e-290, 1e290), strategies.floats(1e-6, 1e9), strategies.booleans()
)  # fmt: skip
def test_every_axis_has_some_ticks_and_not_many(low, factor, logarithmic):
    high = min(low * (1.0 + factor), 1e299)
    assert 1 <= len(ticks(Range(Axis('', '', logarithmic), low, high))) <= 12
