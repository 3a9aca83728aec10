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

"""A function that has no value somewhere in its range is refused, with where that is."""

from __future__ import annotations

from linkage_ros.errors import SynthesisError
from linkage_ros.synthesis.function.expression import Expression
from linkage_ros.synthesis.function.task import check_defined
import pytest


@pytest.mark.parametrize(
    ('text', 'low', 'high', 'message'),
    [
        ('ln(x)', 0, 2, 'is infinite at x = 0; choose a range without it'),
        ('ln(x)', 2, 0, 'is infinite at x = 0; choose a range without it'),
        ('1/x', -1, 1, 'is infinite at x = 0; choose a range without it'),
        ('x/x', -1, 1, 'is not defined at x = 0; choose a range without it'),
        ('ln(x)', -1, 2, 'is not defined from x = -1 to 0; choose a range within 0 to 2'),
        ('sqrt(x - 1)', 0, 3, 'is not defined from x = 0 to 1; choose a range within 1 to 3'),
        ('asin(x)', 0, 2, 'is not defined from x = 1 to 2; choose a range within 0 to 1'),
        (
            'sqrt(x^2 - 2)',
            -2,
            5,
            'from x = -1.414213562 to 1.414213562; choose a range within 1.4',
        ),
        (
            'exp(1000*x)',
            0,
            2,
            'is infinite from x = 0.7097827129 to 2; choose a range within 0 to',
        ),
        ('(x - 2)^0.5', 0, 1, 'is not defined anywhere in the range; choose another range'),
        # Poles and jumps between samples.
        ('1/x', -1, 1.0007, 'jumps, or goes to infinity, at x = 0; choose a range on one side'),
        ('1/x^2', -1, 1.0007, 'jumps, or goes to infinity, at x = 0'),
        ('tan(x)', 0, 3, 'jumps, or goes to infinity, at x = 1.570796327'),
        ('ln(abs(x - 0.50031))', 0, 1, 'jumps, or goes to infinity, at x = 0.50031'),
        ('atan(1/(x - 0.3))', 0, 1.01, 'jumps, or goes to infinity, at x = 0.3'),
    ],
)
def test_where_a_function_has_no_value_is_told(
    text: str, low: float, high: float, message: str
) -> None:
    with pytest.raises(SynthesisError) as caught:
        check_defined(Expression(text), low, high)
    assert f"function '{text}': " in str(caught.value)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ('text', 'low', 'high'),
    [
        ('cbrt(x - 0.4)', 0, 1),
        ('sqrt(x)', 0, 1),
        ('abs(x - 0.4)', 0, 1),
        ('tanh(1e6*(x - 0.4003))', 0, 1),
        ('1/(x^2 + 1e-6)', -1, 1.01),
        ('sin(1000*x)', 0, 1),
        ('x*1e300', 0, 1),
        ('x*1e-300', 0, 1),
        ('1/x', 1e-3, 1),
        ('tan(x)', -1.57, 1.57),
        ('3', 0, 1),
        ('sin(x)^2 + cos(x)^2', 0, 1),
    ],
)
def test_a_steep_function_is_taken(text: str, low: float, high: float) -> None:
    check_defined(Expression(text), low, high)
