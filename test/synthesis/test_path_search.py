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


"""Where path generation begins: four-bars that close, laid upon the points by least squares."""

from __future__ import annotations

from cmath import rect
from math import inf, pi
import pickle
from typing import Any

from linkage_ros.synthesis.path.curves import Aim
from linkage_ros.synthesis.path.generate import allowed, improve
from linkage_ros.synthesis.path.search import problem_of
import numpy as np
import pytest

from .by_hand import on

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
def test_a_start_is_what_its_score_says_and_closes(aim: Aim, closed: bool) -> None:
    problem, candidates, scores = drawn(aim, closed)
    starts = problem.starts(candidates)
    assert allowed(starts, aim).all()
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
def test_it_is_laid_on_as_well_as_can_be(aim: Aim, closed: bool) -> None:
    """Neither pivot, ground direction, size nor traced point can be better, one at a time."""
    problem, candidates, scores = drawn(aim, closed)
    starts = problem.starts(candidates)
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


def test_what_would_need_links_outside_of_the_box_has_no_score() -> None:
    aim = Aim(POINTS, TIMING, True, True, 0.2, 1.5)
    problem = problem_of(aim, True)
    candidates = problem.sample(np.random.default_rng(7), COUNT)
    lengths = np.exp(problem.starts(candidates).rows[:, 3:7])
    outside = (lengths.min(1) < 0.2) | (lengths.max(1) > 1.5)
    assert outside.any()
    assert (problem.score(candidates)[outside] == inf).all()


@pytest.mark.parametrize(('aim', 'closed'), AIMS.values(), ids=AIMS)
def test_a_problem_goes_to_another_process_and_scores_the_same(aim: Aim, closed: bool) -> None:
    problem, candidates, scores = drawn(aim, closed)
    again = pickle.loads(pickle.dumps(problem))
    assert (again.score(candidates) == scores).all()
    # Nor does it matter which ones are scored together.
    assert (problem.score(candidates[5:9]) == scores[5:9]).all()


@pytest.mark.parametrize('guard', [0.0, 1e-3])
@pytest.mark.parametrize(('aim', 'closed'), AIMS.values(), ids=AIMS)
def test_steps_keep_what_was_asked_for(aim: Aim, closed: bool, guard: float) -> None:
    problem, candidates, scores = drawn(aim, closed)
    fitted, squares = improve(problem.starts(candidates), aim, 20, guard)
    assert allowed(fitted, aim).all()
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
