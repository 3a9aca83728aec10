# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Function generation: pairs of angles, and functions that have no value somewhere."""

from math import inf, nan, pi, radians

from hypothesis import given, strategies
from linkage_ros.errors import SynthesisError
from linkage_ros.tools.design import (
    angle_pairs,
    chebyshev_points,
    check_defined,
    Expression,
    FunctionTask,
    on_scale,
    wanted_rocker,
)
from mpmath import mp
import numpy as np
from numpy.polynomial.chebyshev import chebval
import pytest

# A function becomes pairs of angles: scales, Chebyshev points, and functions that are refused.


Case = tuple[str, tuple[float, float], tuple[float, float], tuple[float, float]]

# Formulas of textbooks, in 50 digits, with ranges of x, crank and rocker in degrees. No printed
# solution was legible; the expected values are computed here.
TASKS: dict[str, tuple[Case, object]] = {
    'log': (('log10(x)', (1, 2), (45, 105), (135, 225)), mp.log10),
    'power': (('x^1.5', (1, 4), (30, 120), (60, 150)), lambda x: x * mp.sqrt(x)),
    'sine': (('sin(x)', (0, pi / 2), (-15, 45), (30, 90)), mp.sin),
    'reciprocal': (('1/x', (1, 2), (30, 120), (120, 30)), lambda x: 1 / x),
    'down': (('exp(x)', (1, 0), (135, 55), (60, 130)), mp.exp),
    'beyond its ends': (('x^2', (-1, 2), (0, 90), (30, 90)), lambda x: x * x),
}


def task_of(case: Case) -> FunctionTask:
    text, xs, crank, rocker = case
    return FunctionTask(
        Expression(text), xs, tuple(map(radians, crank)), tuple(map(radians, rocker))
    )


LOG = task_of(TASKS['log'][0])


@pytest.mark.parametrize('count', range(1, 12))
@pytest.mark.parametrize(('low', 'high'), [(1.0, 2.0), (-3.0, 5.0), (2.0, 1.0), (1e6, 1e6 + 1)])
def test_precision_points_equal_the_chebyshev_zeros(low, high, count):
    found = chebyshev_points(low, high, count)
    with mp.workdps(30):
        middle, half = (mp.mpf(low) + high) / 2, (mp.mpf(high) - low) / 2
        expected = [
            float(middle - half * mp.cos((2 * j - 1) * mp.pi / (2 * count)))
            for j in range(1, count + 1)
        ]
    assert found.tolist() == pytest.approx(expected, rel=4e-16)
    # They are the zeros of Chebyshev's polynomial of that degree.
    inner = (2.0 * found - low - high) / (high - low)
    assert np.max(np.abs(chebval(inner, [0.0] * count + [1.0]))) < 1e-13 * max(abs(low), 1.0) * 10


def test_precision_points_near_the_start_stay_exact():
    with mp.workdps(30):
        expected = float(mp.sin(mp.pi / 4000) ** 2)
    assert chebyshev_points(0.0, 1.0, 1000)[0] == pytest.approx(expected, rel=1e-15)


def test_precision_point_count_is_bounded():
    assert chebyshev_points(1.0, 2.0, 0).tolist() == chebyshev_points(1.0, 2.0, -3).tolist() == []
    with pytest.raises(SynthesisError, match=r'^points: 1001 of them; 1000 do$'):
        chebyshev_points(1.0, 2.0, 1001)


@pytest.mark.parametrize('name', TASKS)
def test_angle_pairs_equal_50_digit_references(name):
    case, function = TASKS[name]
    _, (x0, x1), cranks, rockers = case
    xs = chebyshev_points(x0, x1, 5)
    crank, rocker = angle_pairs(task_of(case), xs)
    with mp.workdps(50):
        y0, y1 = function(mp.mpf(x0)), function(mp.mpf(x1))
        for x, theta, phi in zip(xs, crank, rocker, strict=True):
            x_exact = mp.mpf(float(x))
            part = (x_exact - x0) / (mp.mpf(x1) - x0)
            risen = (function(x_exact) - y0) / (y1 - y0)
            c0, c1, r0, r1 = (mp.mpf(radians(angle)) for angle in (*cranks, *rockers))
            assert theta == pytest.approx(float(c0 + (c1 - c0) * part), abs=2e-15)
            assert phi == pytest.approx(float(r0 + (r1 - r0) * risen), abs=4e-15)
    assert type(crank[0]) is type(rocker[0]) is float


@pytest.mark.parametrize('name', TASKS)
def test_range_ends_map_exactly_to_angle_ends(name):
    task = task_of(TASKS[name][0])
    crank, rocker = angle_pairs(task, task.x_range)
    assert tuple(crank) == task.crank_range
    assert tuple(rocker) == task.rocker_range
    assert tuple(wanted_rocker(task, task.crank_range)) == task.rocker_range


@pytest.mark.parametrize('name', TASKS)
def test_wanted_curve_passes_through_the_pairs(name):
    task = task_of(TASKS[name][0])
    crank, rocker = angle_pairs(task, chebyshev_points(*task.x_range, 9))
    assert wanted_rocker(task, crank) == pytest.approx(rocker, abs=2e-15)


def test_wanted_curve_keeps_the_array_shape():
    angles = np.linspace(*LOG.crank_range, 6)
    assert np.array_equal(
        wanted_rocker(LOG, angles.reshape(2, 3)).ravel(), wanted_rocker(LOG, angles)
    )


finite = strategies.floats(-3.0, 3.0)


@given(finite, finite, finite, finite, strategies.floats(0.0, 1.0))
def test_linear_function_turns_the_rocker_proportionally(c0, c1, r0, r1, part):
    if min(abs(c1 - c0), abs(r1 - r0)) < 0.1:
        return
    task = FunctionTask(Expression('7 - 3*x'), (-1.0, 4.0), (c0, c1), (r0, r1))
    crank = c0 + (c1 - c0) * part
    assert wanted_rocker(task, crank) == pytest.approx(r0 + (r1 - r0) * part, abs=1e-13)


def test_function_beyond_its_ends_moves_the_rocker_beyond():
    task = task_of(TASKS['beyond its ends'][0])
    # x = 0 is a third of the way, and y there a third of its range below its beginning.
    assert wanted_rocker(task, radians(30.0)) == pytest.approx(radians(10.0), abs=1e-15)


def test_square_root_is_not_evaluated_below_its_range():
    task = task_of(('sqrt(x - 0.1)', (0.1, 0.7), (10, 100), (20, 80)))
    crank = np.linspace(*task.crank_range, 997)
    assert np.isfinite(wanted_rocker(task, crank)).all()
    assert np.isfinite(wanted_rocker(task, np.nextafter(crank, -inf))).all()


def test_structural_error_is_converted_to_the_function_scale():
    found = on_scale(LOG, radians(75.0), radians(-0.9))
    assert found.x == pytest.approx(1.5)
    assert found.y == pytest.approx(0.17609125905568124)
    assert found.percent == pytest.approx(-1.0)
    assert found.error == pytest.approx(-0.0030102999566398120)


def test_error_of_a_falling_function_keeps_its_sign():
    """1/x falls from 1 to 1/2, and the rocker from 120° to 30°: they go the same way."""
    found = on_scale(task_of(TASKS['reciprocal'][0]), radians(30.0), radians(9.0))
    assert found.error == pytest.approx(0.05)
    assert found.percent == pytest.approx(-10.0)


@pytest.mark.parametrize(
    ('xs', 'message'),
    [
        ([1.1, 2.1], 'point 2: x = 2.1 lies outside of the range 1 to 2; choose it within'),
        ([0.9], 'point 1: x = 0.9 lies outside of the range 1 to 2; choose it within'),
        ([1.1, 1.5, 1.1], 'point 3: x = 1.1 comes a second time; give each point once'),
        ([nan], 'point 1: x = nan lies outside of the range 1 to 2; choose it within'),
    ],
)
def test_invalid_precision_points_are_refused(xs, message):
    with pytest.raises(SynthesisError) as caught:
        angle_pairs(LOG, xs)
    assert str(caught.value) == message


GOOD = ((0, 1), (45, 105), (135, 225))


@pytest.mark.parametrize(('case', 'message'), [
    (('x', (1, 1), *GOOD[1:]), 'range: begins and ends at 1; let it end where it does not begin'),
    (('x', (0, 1), (45, 45), GOOD[2]),
     'crank range: begins and ends at 45; let it end where it does not begin'),
    (('x', *GOOD[:2], (90, 90)),
     'rocker range: begins and ends at 90; let it end where it does not begin'),
    (('x', (0, 1), (0, 360), GOOD[2]),
     'crank range: 0° to 360° is a full turn or more; keep it below 360°'),
    (('x', *GOOD[:2], (200, -200)),
     'rocker range: 200° to -200° is a full turn or more; keep it below 360°'),
    (('x', (0, nan), *GOOD[1:]), 'range: 0 to nan is not a range; write two finite numbers'),
    (('x', (0, inf), *GOOD[1:]), 'range: 0 to inf is not a range; write two finite numbers'),
    (('x', (0, 1), (inf, 0), GOOD[2]),
     'crank range: inf to 0.0 is not a range; write two finite numbers'),
    (('sin(x)', (0, pi), *GOOD[1:]),
     ("function 'sin(x)': is 0 both at x = 0 and at 3.141592654, so that both ends of "
      'the rocker range would be one; let the range end where the function is another')),
    (('5', *GOOD),
     ("function '5': is 5 both at x = 0 and at 1, so that both ends of the rocker range "
      'would be one; let the range end where the function is another')),
    (('x^2', (-1, 1.01), *GOOD[1:]),
     ("function 'x^2': goes from 1 to 1.0201, but 1.0201 up and down between: "
      'the rocker would swing by 4567.61°; choose a range without its summits and '
      'valleys, or a smaller rocker range')),
])  # fmt: skip
def test_impossible_function_task_is_refused_in_one_line(case, message):
    with pytest.raises(SynthesisError) as caught:
        task_of(case)
    assert str(caught.value) == message


def test_function_range_may_be_narrow():
    task = FunctionTask(Expression('x^2'), (1.0, 1.0 + 1e-9), (0.0, 1.0), (0.0, 1.0))
    assert wanted_rocker(task, 0.5) == pytest.approx(0.5, abs=1e-6)


# A function without a value somewhere in its range is refused; the error says where.


@pytest.mark.parametrize(('text', 'low', 'high', 'message'), [
    ('ln(x)', 0, 2, 'is infinite at x = 0; choose a range without it'),
    ('ln(x)', 2, 0, 'is infinite at x = 0; choose a range without it'),
    ('1/x', -1, 1, 'is infinite at x = 0; choose a range without it'),
    ('x/x', -1, 1, 'is not defined at x = 0; choose a range without it'),
    ('ln(x)', -1, 2, 'is not defined from x = -1 to 0; choose a range within 0 to 2'),
    ('sqrt(x - 1)', 0, 3, 'is not defined from x = 0 to 1; choose a range within 1 to 3'),
    ('asin(x)', 0, 2, 'is not defined from x = 1 to 2; choose a range within 0 to 1'),
    ('sqrt(x^2 - 2)', -2, 5, 'from x = -1.414213562 to 1.414213562; choose a range within 1.4'),
    ('exp(1000*x)', 0, 2, 'is infinite from x = 0.7097827129 to 2; choose a range within 0 to'),
    ('(x - 2)^0.5', 0, 1, 'is not defined anywhere in the range; choose another range'),
    # Poles and jumps between samples.
    ('1/x', -1, 1.0007, 'jumps, or goes to infinity, at x = 0; choose a range on one side'),
    ('1/x^2', -1, 1.0007, 'jumps, or goes to infinity, at x = 0'),
    ('tan(x)', 0, 3, 'jumps, or goes to infinity, at x = 1.570796327'),
    ('ln(abs(x - 0.50031))', 0, 1, 'jumps, or goes to infinity, at x = 0.50031'),
    ('atan(1/(x - 0.3))', 0, 1.01, 'jumps, or goes to infinity, at x = 0.3'),
])  # fmt: skip
def test_undefined_function_error_names_the_place(text, low, high, message):
    with pytest.raises(SynthesisError) as caught:
        check_defined(Expression(text), low, high)
    assert f"function '{text}': " in str(caught.value)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ('text', 'low', 'high'),
    [
        ('cbrt(x - 0.4)', 0, 1), ('sqrt(x)', 0, 1), ('abs(x - 0.4)', 0, 1),
        ('tanh(1e6*(x - 0.4003))', 0, 1), ('1/(x^2 + 1e-6)', -1, 1.01), ('sin(1000*x)', 0, 1),
        ('x*1e300', 0, 1), ('x*1e-300', 0, 1), ('1/x', 1e-3, 1), ('tan(x)', -1.57, 1.57),
        ('3', 0, 1), ('sin(x)^2 + cos(x)^2', 0, 1),
    ],
)  # fmt: skip
def test_steep_functions_are_accepted(text, low, high):
    check_defined(Expression(text), low, high)
