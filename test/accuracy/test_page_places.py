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

"""Numbers on the page are written, and points placed, where a reader expects them."""

from itertools import combinations
from math import inf, nan

from hypothesis import given, strategies
from linkage_ros.accuracy.page.diagrams import places, Range, styles_of
from linkage_ros.accuracy.page.numbers import cell_text, number_text, spread_text
from linkage_ros.accuracy.page.svg import ticks
from linkage_ros.accuracy.results import Axis, Curve, Diagram, Part, Point, Results
from linkage_ros.measuring import Spread
import numpy as np
import pytest

from .shown import DIAGRAMS, EMPTY, FAILED, POSITION, RESULTS

# Points lie at their values; a value outside the axis lies on the edge, as a hollow mark.


LOGARITHMIC, LINEAR = Axis('x', 'm'), Axis('x', 'm', logarithmic=False)


def drawn(*points, x=LOGARITHMIC, y=LOGARITHMIC):
    return places(Diagram('key', '', x, y, [Curve('curve', points)]))


@pytest.mark.parametrize(
    ('point', 'edge'),
    [
        (Point(1.0, 1.0), None),
        (Point(1.0, 0.0), 'bottom'),
        (Point(1.0, -1.0), 'bottom'),
        (Point(1.0, -inf), 'bottom'),
        (Point(1.0, 1e-310), 'bottom'),
        (Point(1.0, inf), 'top'),
        (Point(0.0, 1.0), 'left'),
        (Point(inf, 1.0), 'right'),
    ],
)
def test_a_point_without_a_place_stands_on_the_nearer_edge(point, edge):
    found = drawn(Point(0.5, 0.5), point, Point(2.0, 2.0))
    placed = found.curves[0].points[1]
    edges = {
        'bottom': placed.y == found.y.low,
        'top': placed.y == found.y.high,
        'left': placed.x == found.x.low,
        'right': placed.x == found.x.high,
    }
    assert [name for name, at in edges.items() if at] == ([edge] if edge else [])
    assert placed.on_edge == (edge is not None)


def test_what_is_less_than_an_axis_is_to_show_stands_on_its_edge():
    short = Axis('error', 'rad', least=1e-19)
    found = drawn(Point(1.0, 1e-3), Point(1.0, 1e-16), Point(1.0, 1e-50), y=short)
    placed = found.curves[0].points
    assert [point.on_edge for point in placed] == [False, False, True]
    assert 1e-19 < placed[2].y == found.y.low < 1e-16
    assert placed[2].text[-1] == 'error: 1e-50 rad', 'it is told as it is'
    assert found.on_edge == 'less than 1e-19'


def test_a_linear_axis_has_a_place_for_zero_and_less():
    found = drawn(Point(0.0, -1.0), Point(-1.0, 0.0), x=LINEAR, y=LINEAR)
    assert not found.on_edge
    assert [(point.x, point.y) for point in found.curves[0].points] == [(0.0, -1.0), (-1.0, 0.0)]


@pytest.mark.parametrize(
    ('values', 'said'),
    [
        ((1.0, 2.0), ''),
        ((1.0, 0.0), '0'),
        ((1.0, -1.0), 'less than 0'),
        ((0.0, inf), '0 or ∞'),
        ((nan, 1.0), ''),
    ],
)
def test_it_is_said_what_stands_on_an_edge(values, said):
    assert drawn(*(Point(1.0, value) for value in values)).on_edge == said


def test_what_is_not_a_number_breaks_the_line():
    found = drawn(Point(1.0, 1.0), Point(nan, 1.0), Point(1.0, 0.0), Point(2.0, 2.0))
    assert [point is None for point in found.curves[0].points] == [False, True, False, False]
    assert [point is None for point in found.curves[0].within] == [False, True, True, False]


@pytest.mark.parametrize('diagram', [EMPTY, FAILED], ids=lambda diagram: diagram.key)
def test_a_diagram_may_have_nothing_to_draw(diagram):
    found = places(diagram)
    assert found.empty
    assert found.x.low < found.x.high


def test_quartiles_reach_to_the_edge_where_the_axis_has_no_place_for_them():
    found = drawn(Point(1.0, 2.0, None, Spread(0.0, 2.0, inf)), Point(1.0, 1.0))
    below, above = found.curves[0].points[0].y_arms
    assert 2.0 - below == pytest.approx(found.y.low)
    assert 2.0 + above == pytest.approx(found.y.high)


def test_a_point_says_its_values_with_their_units_and_its_setting():
    newton = places(POSITION).curves[1].points[0]
    assert newton.text[1:] == (
        'tolerance 1e-2',
        'time per state: 1.9 (1.8–2.1) µs',
        'greatest error: 0.0010 (0.0005–0.0020) rad',
    )


def drawn_front(*values):
    diagram = Diagram('key', '', LOGARITHMIC, LOGARITHMIC, [Curve('curve', values)], front=True)
    return places(diagram)


def test_what_is_worse_on_both_axes_is_pale_and_the_front_is_the_rest():
    found = drawn_front(
        Point(1.0, 1e-3), Point(2.0, 1e-6), Point(3.0, 1e-5), Point(2.0, 1e-4), Point(9.0, 1e-9)
    )
    assert [point.pale for point in found.curves[0].points] == [False, False, True, True, False]
    assert [(point.x, point.y) for point in found.front] == [(1.0, 1e-3), (2.0, 1e-6), (9.0, 1e-9)]


def test_a_method_that_fails_somewhere_is_on_no_front():
    found = drawn_front(Point(1.0, 1e-9, fails=True), Point(2.0, 1e-3), Point(1.0, inf))
    assert [point.pale for point in found.curves[0].points] == [True, False, True]


def test_where_more_may_be_better_nothing_is_pale():
    found = drawn(Point(1.0, 1.0), Point(2.0, 2.0))
    assert not any(point.pale for point in found.curves[0].points)
    assert not found.front


def test_a_name_stands_beside_the_best_point_of_its_curve():
    best = drawn_front(Point(1.0, 1e-3), Point(1.0, 1e-6), Point(2.0, 1e-9), Point(3.0, 1e-9))
    assert best.curves[0].named == best.curves[0].points[1]
    assert drawn(Point(1.0, 1.0), Point(2.0, 2.0)).curves[0].named.x == 2.0
    assert drawn(Point(nan, 1.0)).curves[0].named is None


NUMBERS = strategies.floats()


@given(strategies.lists(strategies.tuples(NUMBERS, NUMBERS)), strategies.booleans())
def test_every_point_is_drawn_within_the_axes(values, logarithmic):
    axis = Axis('x', 'm', logarithmic)
    found = drawn(*(Point(x, y) for x, y in values), x=axis, y=axis)
    for point in filter(None, found.curves[0].points):
        assert found.x.low <= point.x <= found.x.high
        assert found.y.low <= point.y <= found.y.high


def test_a_method_looks_the_same_in_all_diagrams_and_like_no_other_beside_it():
    styles = styles_of([RESULTS])
    for diagram in DIAGRAMS:
        names = [curve.name for curve in diagram.curves]
        pairs = [(styles[name].colour, styles[name].mark) for name in names]
        assert all(one != other for one, other in combinations(pairs, 2))


def test_methods_that_never_meet_share_the_first_look():
    def part(name):
        diagram = Diagram(name, '', LINEAR, LINEAR, [Curve(name, [])])
        return Part(name, '', '', diagrams=[diagram])

    styles = styles_of([Results('', [], [part('one'), part('two')])])
    assert styles['one'] == styles['two']


# Numbers are written with their significant digits, and ticks stand where a reader expects them.


# The largest doubles, rounded to three digits, overflow.
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
