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


"""The name of a four-bar: Barker's fourteen, and what Grashof's inequality says of the motion."""

from __future__ import annotations

from math import inf, pi

from hypothesis import assume, given
from hypothesis import strategies as st
from linkage_ros.kinematics.closure import Closure
from linkage_ros.kinematics.four_bars import four_bars
from linkage_ros.kinematics.grashof import four_bar_type
import pytest

from .linkages import four_bar_linkage

# Barker's fourteen types as R. L. Norton, Design of Machinery, ch. 2, lists them: by which link
# is shortest (Grashof, change point) or longest (triple rocker). Input, coupler, output, frame.
BARKER = {
    'GCCC': (3.0, 4.0, 3.5, 2.0),
    'GCRR': (2.0, 4.0, 3.5, 3.0),
    'GRCR': (3.0, 2.0, 3.5, 4.0),
    'GRRC': (3.0, 4.0, 2.0, 3.5),
    'RRR1': (2.0, 3.0, 2.5, 4.0),
    'RRR2': (4.0, 3.0, 2.5, 2.0),
    'RRR3': (3.0, 4.0, 2.5, 2.0),
    'RRR4': (3.0, 2.5, 4.0, 2.0),
    'SCCC': (2.0, 4.0, 3.0, 1.0),
    'SCRR': (1.0, 4.0, 3.0, 2.0),
    'SRCR': (2.0, 1.0, 3.0, 4.0),
    'SRRC': (2.0, 4.0, 1.0, 3.0),
    'S2X': (2.0, 3.0, 2.0, 3.0),
    'S3X': (2.0, 2.0, 2.0, 2.0),
}


@pytest.mark.parametrize('code', BARKER)
def test_each_of_barkers_types_is_named(code: str) -> None:
    assert four_bar_type(*BARKER[code]).code == code


@pytest.mark.parametrize(
    ('lengths', 'word'),
    [
        ((0.04, 0.12, 0.08, 0.1), 'crank-rocker'),
        ((0.08, 0.07, 0.09, 0.04), 'drag link'),
        ((0.3, 1.6, 0.3, 1.6), 'parallelogram'),
        ((0.3, 0.3, 1.6, 1.6), 'kite'),
        ((1.6, 0.3, 0.3, 1.6), 'kite'),
        ((0.2, 0.08, 0.2, 0.16), 'double rocker'),  # Chebyshev's straight-line linkage
        ((0.2, 0.3, 0.25, 0.4), 'triple rocker'),
        ((0.1, 0.1, 0.1, 0.1), 'rhombus'),
    ],
)
def test_an_engineer_s_word_is_in_the_name(lengths: tuple[float, ...], word: str) -> None:
    assert word in four_bar_type(*lengths).name


def test_lengths_in_decimals_that_are_meant_to_cancel_do() -> None:
    assert 0.1 + 0.7 != 0.3 + 0.5  # in floats
    assert four_bar_type(0.1, 0.7, 0.5, 0.3) == ('SCRR', 'change-point crank-rocker', 0.0)


def test_the_margin_says_how_far_it_is_from_a_change_point() -> None:
    assert four_bar_type(2.0, 4.0, 3.5, 3.0).margin == 0.5
    assert four_bar_type(4.0, 3.0, 2.5, 2.0).margin == -0.5


def test_what_does_not_close_has_no_name() -> None:
    no_loop = four_bar_type(1.0, 2.0, 3.0, 7.0)
    assert no_loop.code == ''
    assert no_loop.name.startswith('no loop')
    assert no_loop.margin == -3.0
    assert four_bar_type(1.0, 2.0, 3.0, 6.0).code == 'RRR1'  # closes in one place, flat


sides = st.floats(0.1, 10.0)


@given(sides, sides, sides, sides)
def test_seen_from_the_other_end_input_and_output_change_places(
    a: float, b: float, c: float, d: float
) -> None:
    assume(2.0 * max(a, b, c, d) < 0.999 * (a + b + c + d))
    here, there = four_bar_type(a, b, c, d).code, four_bar_type(c, b, a, d).code
    swapped = {'GCRR': 'GRRC', 'SCRR': 'SRRC', 'RRR2': 'RRR4'}
    swapped |= {other: one for one, other in swapped.items()}
    assert there == swapped.get(here, here)


@given(sides, sides, sides, sides)
def test_the_input_turns_fully_where_its_letter_is_c(
    a: float, b: float, c: float, d: float
) -> None:
    """Against the closure, whose ranges know nothing of Grashof."""
    assume(2.0 * max(a, b, c, d) < 0.999 * (a + b + c + d))
    kind = four_bar_type(a, b, c, d)
    assume(kind.margin == 0.0 or abs(kind.margin) > 1e-9)
    ranges = Closure(four_bar_linkage((a, b, c, d), 'left')).input_ranges
    if kind.code.startswith('G'):
        assert ranges[0].whole == (kind.code[1] == 'C')
    elif kind.code.startswith('R'):
        assert not any(interval.whole for interval in ranges)
        assert max(high - low for low, high, *_ in ranges) < 2.0 * pi < inf


def test_a_four_bar_of_a_file_is_found_with_its_lengths() -> None:
    (bar,) = four_bars(Closure(four_bar_linkage((0.04, 0.12, 0.08, 0.1), 'left')).structure)
    assert bar.links == ('crank', 'coupler', 'rocker', 'ground')
    assert bar.lengths == (0.04, 0.12, 0.08, 0.1)
    assert bar.kind.code == 'GCRR'
