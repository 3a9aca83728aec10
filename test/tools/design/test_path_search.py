# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Where path generation begins: coupler curves and starts from them."""

from cmath import rect
from math import inf, pi, tan
import pickle
from typing import Any

from hypothesis import assume, given, strategies as st
from linkage_ros.tools.design import (
    Aim,
    are_allowed,
    COLUMNS,
    curve_distances,
    improve,
    point_slopes,
    problem_of,
    resample,
    stay_closed,
    theta_at,
    transmission_cotangents,
)
import numpy as np
import pytest

from .by_hand import Lengths, on, pins, transmission

# Start of path generation: four-bars that close, fitted to the points by least squares.


POINTS = np.array([0.1 + 0.2j, 0.3 + 0.3j, 0.4 - 0.1j, 0.1 - 0.4j, -0.4 - 0.2j, -0.5 + 0.2j])
TIMING = np.arange(6) * pi / 3.0
COUNT = 400

AIMS = {
    'timed': (Aim(POINTS, TIMING, True, True, 0.05, 20.0), True),
    'timed backwards, open': (Aim(POINTS, -TIMING, True, False, 0.05, 20.0), False),
    'timed, zero given': (Aim(POINTS, TIMING, False, True, 0.05, 20.0), True),
    'open': (Aim(POINTS, None, True, False, 0.05, 20.0), False),
    'open, a full turn': (Aim(POINTS, None, True, True, 0.05, 20.0), False),
    'closed': (Aim(POINTS, None, True, True, 0.05, 20.0), True),
}


def drawn(aim: Aim, closed: bool) -> tuple[Any, np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    problem = problem_of(aim, closed)
    candidates = problem.sample(np.random.default_rng(7), COUNT)
    scores = problem.score(candidates)
    some = np.isfinite(scores)
    assert some.sum() > COUNT // 20
    return problem, candidates[some], scores[some]


@pytest.mark.parametrize(('aim', 'closed'), AIMS.values(), ids=AIMS)
def test_path_search_start_matches_its_score(aim, closed):
    problem, candidates, scores = drawn(aim, closed)
    starts = problem.place_candidates(candidates)
    assert are_allowed(starts, aim).all()
    for row, angles, side, score in zip(*starts, scores, strict=True):
        a, b, c, d = (float(value) for value in np.exp(row[3:7]))
        squares = 0.0
        for angle, point in zip(angles, POINTS, strict=True):
            far = on('left' if side > 0.0 else 'right', (a, b, c, d), angle)
            near = rect(a, angle)
            arm = complex(row[7], row[8]) * (far - near) / b
            place = complex(row[0], row[1]) + (near + arm) * rect(1.0, row[2])
            squares += abs(place - point) ** 2
        assert score == pytest.approx(squares, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(('aim', 'closed'), AIMS.values(), ids=AIMS)
def test_path_search_start_is_placed_optimally(aim, closed):
    """Neither pivot, ground direction, size nor traced point can be better, one at a time."""
    problem, candidates, scores = drawn(aim, closed)
    starts = problem.place_candidates(candidates)
    frames = np.exp(1j * starts.rows[:, 2])
    cranks = np.exp(1j * starts.angles) * (np.exp(starts.rows[:, 3]) * frames)[:, None]
    free = aim.timing is None or aim.zero_free
    for start in range(len(candidates)):
        a, b, c, d = np.exp(starts.rows[start, 3:7])
        side = 'left' if starts.side[start] > 0.0 else 'right'
        turned = [
            (on(side, (a, b, c, d), t) - rect(a, t)) / b * frames[start]
            for t in starts.angles[start]
        ]
        both = np.array([np.ones(6), turned]).T
        if free:
            basis = np.column_stack((both, cranks[start]))
            columns = np.block([[basis.real, -basis.imag], [basis.imag, basis.real]])
        else:
            columns = np.block([[both.real, -both.imag], [both.imag, both.real]])
            along = np.concatenate((cranks[start].real, cranks[start].imag))
            columns = np.column_stack((columns, along))
        target = np.concatenate((POINTS.real, POINTS.imag))
        solved = np.linalg.lstsq(columns, target, rcond=None)[0]
        left = float(((columns @ solved - target) ** 2).sum())
        assert scores[start] == pytest.approx(left, rel=1e-6, abs=1e-9)


def test_candidates_with_links_out_of_bounds_score_infinity():
    aim = Aim(POINTS, TIMING, True, True, 0.2, 1.5)
    problem = problem_of(aim, True)
    candidates = problem.sample(np.random.default_rng(7), COUNT)
    lengths = np.exp(problem.place_candidates(candidates).rows[:, 3:7])
    outside = (lengths.min(1) < 0.2) | (lengths.max(1) > 1.5)
    assert outside.any()
    assert (problem.score(candidates)[outside] == inf).all()


@pytest.mark.parametrize(('aim', 'closed'), AIMS.values(), ids=AIMS)
def test_pickled_path_problem_scores_the_same(aim, closed):
    problem, candidates, scores = drawn(aim, closed)
    again = pickle.loads(pickle.dumps(problem))
    assert (again.score(candidates) == scores).all()
    # Nor does it matter which ones are scored together.
    assert (problem.score(candidates[5:9]) == scores[5:9]).all()


@pytest.mark.sample(5)
@pytest.mark.parametrize('guard', [0.0, 1e-3])
@pytest.mark.parametrize(('aim', 'closed'), AIMS.values(), ids=AIMS)
def test_path_improvement_keeps_timing_and_bounds(aim, closed, guard):
    problem, candidates, scores = drawn(aim, closed)
    fitted, squares = improve(problem.place_candidates(candidates), aim, 20, guard)
    assert are_allowed(fitted, aim).all()
    assert np.exp(fitted.rows[:, 3:7]).min() > aim.shortest * (1.0 - 1e-9)
    assert np.exp(fitted.rows[:, 3:7]).max() < aim.longest * (1.0 + 1e-9)
    if not guard:
        assert (squares <= scores * (1.0 + 1e-9) + 1e-12).all()
        assert np.median(squares) < 0.9 * np.median(scores)
    if aim.timing is not None:
        assert np.diff(fitted.angles - aim.timing, axis=1) == pytest.approx(0.0, abs=1e-9)
    if aim.timing is not None and not aim.zero_free:
        world = fitted.angles + fitted.rows[:, 2:3] - aim.timing
        assert np.exp(1j * world) == pytest.approx(1.0)


# Coupler curves of many four-bars: positions by compass and ruler, derivatives by differences.


length = st.floats(0.2, 4.0)

# If the crank's pin can meet the rocker's pivot, no circle determines the other pin.
lengths_of_any = st.tuples(length, length, length, length).filter(
    lambda lengths: abs(lengths[0] - lengths[3]) > 1e-3
)

angle = st.floats(-7.0, 7.0)


def row(lengths: Lengths, at: complex, ground: float, point: complex) -> np.ndarray[Any, Any]:
    return np.array([[at.real, at.imag, ground, *np.log(lengths), point.real, point.imag]])


@given(lengths_of_any, angle, st.sampled_from(('left', 'right')), angle)
def test_traced_point_equals_the_circle_construction(lengths, direction, side, ground):
    assume(pins(lengths, direction) is not None)
    assume(transmission(lengths, direction) > 0.01)
    near, far = rect(lengths[0], direction), on(side, lengths, direction)
    point = 0.7 - 0.4j
    place = (near + point * (far - near) / lengths[1]) * rect(1.0, ground) + (2.0 + 3.0j)
    rows = row(lengths, 2.0 + 3.0j, ground, point)
    sign = np.array([1.0 if side == 'left' else -1.0])
    assert abs(point_slopes(rows, np.array([[direction]]), sign).places[0, 0] - place) < 1e-9


GENERATOR = np.random.default_rng(5)

ROWS = np.column_stack(
    (
        GENERATOR.normal(size=(4, 3)),
        np.log((1.0, 2.3, 2.1, 2.0)) + GENERATOR.normal(0.0, 0.02, (4, 4)),
        GENERATOR.normal(size=(4, 2)),
    )
)

ANGLES = GENERATOR.uniform(0.0, 6.0, (4, 5))
SIDE = np.array((1.0, -1.0, 1.0, -1.0))
STEP = 1e-6


@pytest.mark.parametrize('column', range(len(COLUMNS)), ids=COLUMNS)
def test_dimension_derivatives_equal_numerical_ones(column):
    aside = np.zeros(len(COLUMNS))
    aside[column] = STEP
    places = [point_slopes(ROWS + sign * aside, ANGLES, SIDE).places for sign in (1.0, -1.0)]
    folded = [transmission_cotangents(ROWS + sign * aside, ANGLES)[0] for sign in (1.0, -1.0)]
    by_place = point_slopes(ROWS, ANGLES, SIDE).by_dimension[..., column]
    by_fold = transmission_cotangents(ROWS, ANGLES)[1][..., column]
    assert np.abs((places[0] - places[1]) / (2.0 * STEP) - by_place).max() < 1e-8
    assert np.abs((folded[0] - folded[1]) / (2.0 * STEP) - by_fold).max() < 1e-8


def test_crank_derivatives_equal_numerical_ones():
    places = [point_slopes(ROWS, ANGLES + by, SIDE).places for by in (STEP, -STEP)]
    folded = [transmission_cotangents(ROWS, ANGLES + by)[0] for by in (STEP, -STEP)]
    by_place = point_slopes(ROWS, ANGLES, SIDE).by_angle
    assert np.abs((places[0] - places[1]) / (2.0 * STEP) - by_place).max() < 1e-8
    by_fold = transmission_cotangents(ROWS, ANGLES)[2]
    assert np.abs((folded[0] - folded[1]) / (2.0 * STEP) - by_fold).max() < 1e-8


@given(lengths_of_any, angle)
def test_fold_measure_equals_the_transmission_angle_cotangent(lengths, direction):
    assume(pins(lengths, direction) is not None)
    acute = transmission(lengths, direction)
    assume(acute > 0.01)
    folded = transmission_cotangents(row(lengths, 0j, 0.0, 0j), np.array([[direction]]))[0]
    assert abs(folded[0, 0]) == pytest.approx(1.0 / tan(acute), rel=1e-6, abs=1e-9)


@given(lengths_of_any, angle, st.floats(0.0, 6.2))
def test_closing_check_covers_every_crank_angle(lengths, low, travel):
    closed = bool(
        stay_closed(row(lengths, 0j, 0.0, 0j), np.array([low]), np.array([low + travel]))[0]
    )
    # The ground line's directions are where the diagonal is shortest and longest.
    turns = [i * pi for i in range(-10, 10) if low <= i * pi <= low + travel]
    found = [pins(lengths, at) for at in (*np.linspace(low, low + travel, 9), *turns)]
    if closed:
        assert all(found)
    else:
        folded = [transmission(lengths, at) for at in (low, low + travel, *turns) if all(found)]
        assert not all(found) or min(folded) < 1e-3


def test_curve_is_resampled_by_chord_length():
    curves = np.array([[0j, 3.0, 3.0 + 1.0j], [0j, 1.0j, 4.0j]])
    way = curve_distances(curves)
    assert way == pytest.approx(np.array([[0.0, 0.75, 1.0], [0.0, 0.25, 1.0]]))
    wanted = np.array([0.0, 0.25, 0.5, 1.0])
    places = np.array([[0j, 1.0, 2.0, 3.0 + 1.0j], [0j, 1.0j, 2.0j, 4.0j]])
    assert resample(curves, way, wanted) == pytest.approx(places)
    steps = np.array([[0.0, 1 / 6, 1 / 3, 1.0], [0.0, 0.5, 2 / 3, 1.0]])
    assert theta_at(way, wanted) == pytest.approx(steps)
