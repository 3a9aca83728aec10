# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Path generation: linkages are found again from their curves, and published problems solved."""

from cmath import phase, rect
from dataclasses import replace
from math import inf, nan, pi, radians, sqrt, tau
from pathlib import Path
from typing import Any

from linkage_ros.errors import SynthesisError
from linkage_ros.tools.design import Design, generate_path, PathResult, PathTask
import numpy as np
import pytest
from scipy.optimize import least_squares
import yaml

from .by_hand import on, transmission

LINKAGES = Path(__file__).parents[3] / 'config' / 'linkages'
FEW = 20_000
"""Four-bars to draw: enough for these, and quick; two chunks of the study."""


def place(design: Design, crank: float) -> complex:
    """Return where the traced point is, with compass and ruler, from the design's own pins."""
    four_bar = design.four_bar
    (o2, o4), (a, b) = four_bar.pivots, four_bar.coupler
    assert four_bar.traced is not None
    ground = o4 - o2
    direction = crank + phase(four_bar.crank) - phase(ground)
    far = on(four_bar.side, four_bar.lengths, direction) * ground / abs(ground)
    near = rect(abs(four_bar.crank), direction) * ground / abs(ground)
    return o2 + near + (four_bar.traced - a) * (far - near) / (b - a)


def distances(result: PathResult) -> list[float]:
    return [
        abs(place(result.design, wanted.crank) - wanted.place)
        for wanted in result.design.wanted
        if wanted.place is not None
    ]


def gallery(name: str) -> dict[str, Any]:
    links: dict[str, Any] = yaml.safe_load((LINKAGES / f'{name}.yaml').read_text())['links']
    return links


def curve(name: str, degrees: np.ndarray[Any, Any]) -> tuple[complex, ...]:
    """Return the path of P of a linkage of the gallery, turned and moved."""
    links = gallery(name)
    lengths = lengths_of(name)
    point = complex(*links['coupler']['P']) / lengths[1]
    found = []
    for angle in np.radians(degrees):
        near, far = rect(lengths[0], angle), on('left', lengths, angle)
        found.append((near + point * (far - near)) * rect(1.0, 0.4) + (0.3 - 0.2j))
    return tuple(found)


def lengths_of(name: str) -> tuple[float, float, float, float]:
    links = gallery(name)
    a, b, c, d = (
        complex(*links[link][pin]).real
        for link, pin in (('crank', 'A'), ('coupler', 'B'), ('rocker', 'B'), ('ground', 'O4'))
    )
    return a, b, c, d


ROUND = np.arange(24) * 15.0
HALF = np.linspace(80.0, 280.0, 21)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ('name', 'degrees', 'closed', 'timed'),
    [
        ('four_bar', ROUND, True, False),
        ('four_bar', -ROUND, True, False),  # the other way round
        ('four_bar', ROUND, True, True),
        ('four_bar', HALF, False, False),
        ('four_bar', HALF, False, True),
        ('hoeken', ROUND, True, False),
        ('hoeken', ROUND, True, True),
        ('hoeken', HALF, False, False),  # its straight line, which other linkages nearly draw too
    ],
)
def test_four_bar_is_recovered_from_its_coupler_curve(name, degrees, closed, timed):
    timing = tuple(float(angle) for angle in np.radians(degrees)) if timed else None
    task = PathTask(curve(name, degrees), closed, timing)
    found = generate_path(task, seed=1, count=FEW).found
    assert found[0].rms < 1e-9 * task.size
    exact = [result for result in found if result.rms < 1e-9 * task.size]
    shapes = [np.array(result.design.four_bar.lengths) for result in exact]
    for shape in shapes:
        assert min(np.abs(shape - lengths).max() for lengths in shapes_of(name)) < 1e-6
    for result in exact:
        assert max(distances(result)) < 1e-9 * task.size


def shapes_of(name: str) -> list[np.ndarray[Any, Any]]:
    """
    Return the lengths of all linkages that draw the same curve.

    S. Roberts (1875): the triangle of the coupler's pins and P, with sides b, AP and BP, scales
    two more linkages. In that by AP/b crank and coupler have changed places, in that by BP/b
    coupler and rocker. Each can be driven from either end.
    """
    a, b, c, d = lengths_of(name)
    point = complex(*gallery(name)['coupler']['P'])
    forms = [
        np.array((a, b, c, d)),
        np.array((b, a, c, d)) * abs(point) / b,
        np.array((a, c, b, d)) * abs(point - b) / b,
    ]
    return [*forms, *(lengths[[2, 1, 0, 3]] for lengths in forms)]


# Nine points are as many as a coupler curve can be made to pass. C. W. Wampler, A. P. Morgan and
# A. J. Sommese, Complete solution of the nine-point path synthesis problem for four-bar linkages,
# Journal of Mechanical Design 114 (1992) 153-159; the points as in examples.jl of
# https://github.com/JuliaHomotopyContinuation/FourBarLinkages.jl, which finds all exact answers.
ON_TWO_CIRCLES = (
    *(0.25 + 0j, 0.52 + 0.10j, 0.80 + 0.70j, 1.20 + 1.00j, 1.40 + 1.30j),
    *(1.10 + 1.48j, 0.70 + 1.40j, 0.20 + 1.00j, 0.02 + 0.40j),
)
NEAR_A_CIRCLE = (
    *(0.8961867 - 0.09802917j, 1.2156535 - 1.18749100j, 1.5151435 - 0.85449808j),
    *(1.6754775 - 0.48768058j, 1.7138690 - 0.30099232j, 1.7215236 + 0.03269953j),
    *(1.6642029 + 0.33241088j, 1.4984171 + 0.74435576j, 1.3011834 + 0.92153806j),
)
# Five points of a straight line, Problem 7 of A. P. Morgan and C. W. Wampler, Solving a planar
# four-bar design using continuation, Journal of Mechanical Design 112 (1990) 544-550, as in
# https://github.com/janverschelde/PHCpack, src/Python/PHCpy2/doc/source/fourbar.rst. There the
# pivots are given too.
ON_A_LINE = (0.50 + 1.06j, -0.83 - 0.27j, -0.34 + 0.22j, -0.13 + 0.43j, 0.22 + 0.78j)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ('points', 'closed', 'error'),
    [
        (ON_TWO_CIRCLES, False, 1e-13),
        (ON_TWO_CIRCLES, True, 1e-13),
        (NEAR_A_CIRCLE, False, 1e-6),
        (ON_A_LINE, False, 1e-13),
    ],
)
def test_published_path_points_are_met(points, closed, error):
    task = PathTask(points, closed)
    best = generate_path(task, seed=1, count=FEW).found[0]
    assert max(distances(best)) < error * task.size
    assert_in_order(best.design, 1 if closed else 0)


def assert_in_order(design: Design, turns: int) -> None:
    """Check that the crank goes one way, a turn at most, and B is never on the other side."""
    cranks = np.array([wanted.crank for wanted in design.wanted])
    steps = np.diff(cranks)
    assert (steps > 0.0).all() or (steps < 0.0).all()
    assert abs(cranks[-1] - cranks[0]) < tau
    zero = phase(design.four_bar.crank) - phase(
        design.four_bar.pivots[1] - design.four_bar.pivots[0]
    )
    end = cranks[0] + tau if turns else cranks[-1]
    for crank in np.linspace(cranks[0], end, 200):
        assert transmission(design.four_bar.lengths, crank + zero) > 0.0


# A closed path with a point every 20 degrees of the crank.
EGG = (
    *(0.5 + 1.1j, 0.4 + 1.1j, 0.3 + 1.1j, 0.2 + 1.0j, 0.1 + 0.9j, 0.05 + 0.75j, 0.02 + 0.6j),
    *(0.0 + 0.5j, 0.0 + 0.4j, 0.03 + 0.3j, 0.1 + 0.25j, 0.15 + 0.2j, 0.2 + 0.3j, 0.3 + 0.4j),
    *(0.4 + 0.5j, 0.5 + 0.7j, 0.6 + 0.9j, 0.6 + 1.0j),
)
TWENTIES = tuple(radians(20.0 * i) for i in range(18))
ARC = (3.0 + 3.0j, 2.759 + 3.363j, 2.372 + 3.663j, 1.890 + 3.862j, 1.355 + 3.943j)
THIRTIES = tuple(radians(30.0 * i) for i in range(1, 6))


@pytest.mark.sample(1)
@pytest.mark.parametrize('zero_free', [True, False])
@pytest.mark.parametrize(
    ('points', 'closed', 'timing'), [(EGG, True, TWENTIES), (ARC, False, THIRTIES)]
)
def test_path_design_keeps_the_crank_timing(points, closed, timing, zero_free):
    task = PathTask(points, closed, timing, zero_free)
    for result in generate_path(task, seed=1, count=FEW).found:
        assert tuple(wanted.crank for wanted in result.design.wanted) == timing
        assert zero_free or result.design.four_bar.crank.imag == 0.0
        far = distances(result)
        assert result.greatest == pytest.approx(max(far), rel=1e-6, abs=1e-12)
        assert result.rms == pytest.approx(
            sqrt(sum(one * one for one in far) / len(far)), rel=1e-6, abs=1e-12
        )


def test_five_timed_points_are_met_exactly():
    # As many equations as unknowns: pivots, three more lengths than the crank's, P, and the zero.
    best = generate_path(PathTask(ARC, False, THIRTIES), seed=1, count=FEW).found[0]
    assert max(distances(best)) < 1e-13


def test_best_path_design_is_a_local_minimum():
    task = PathTask(EGG, True, TWENTIES)
    best = generate_path(task, seed=1, count=FEW).found[0]
    four_bar = best.design.four_bar
    assert four_bar.traced is not None
    (o2, o4), (_, b) = four_bar.pivots, four_bar.coupler
    start = [
        *(o2.real, o2.imag, o4.real, o4.imag, four_bar.crank.real, four_bar.crank.imag),
        *(b.real, four_bar.rocker.real, four_bar.traced.real, four_bar.traced.imag),
    ]

    def misses(x: Any) -> list[float]:
        moved = replace(
            four_bar,
            pivots=(complex(x[0], x[1]), complex(x[2], x[3])),
            crank=complex(x[4], x[5]),
            coupler=(0j, complex(x[6], 0.0)),
            rocker=complex(x[7], 0.0),
            traced=complex(x[8], x[9]),
        )
        design = Design(moved, best.design.wanted)
        far = [place(design, t) - z for t, z in zip(TWENTIES, EGG, strict=True)]
        return [part for one in far for part in (one.real, one.imag)]

    again = least_squares(misses, start, xtol=1e-12, ftol=1e-12, gtol=1e-12)
    assert sqrt(2.0 * again.cost / len(EGG)) == pytest.approx(best.rms, rel=1e-6)


def test_path_results_are_sorted_distinct_and_bounded():
    task = PathTask(EGG, True, links=(0.3, 2.0))
    found = generate_path(task, seed=1, count=FEW, keep=5).found
    assert len(found) == 5
    assert [result.rms for result in found] == sorted(result.rms for result in found)
    for i, result in enumerate(found):
        lengths = np.array(result.design.four_bar.lengths)
        assert lengths.min() > 0.3 * task.size * (1.0 - 1e-9)
        assert lengths.max() < 2.0 * task.size * (1.0 + 1e-9)
        assert_in_order(result.design, 1)
        for other in found[:i]:
            assert not alike(result.design, other.design)


def alike(one: Design, other: Design) -> bool:
    """Return whether two four-bars differ by less than a hundredth of their links."""
    first, second = one.four_bar, other.four_bar
    assert first.traced is not None
    assert second.traced is not None
    apart = [abs(x - y) for x, y in zip(first.pivots, second.pivots, strict=True)]
    apart += [abs(x - y) for x, y in zip(first.lengths, second.lengths, strict=True)]
    apart.append(abs(first.traced - second.traced))
    return first.side == second.side and max(apart) < 0.01 * max(first.lengths)


def test_path_fit_uses_all_200_points():
    task = PathTask(curve('four_bar', np.linspace(20.0, 200.0, 200)))
    best = generate_path(task, seed=1, count=FEW).found[0]
    assert len(best.design.wanted) == 200
    assert max(distances(best)) < 1e-6 * task.size


def test_open_path_may_require_a_fully_turning_crank():
    task = PathTask(ARC, full_turn=True)
    for result in generate_path(task, seed=1, count=FEW).found:
        assert_in_order(result.design, 1)


def test_rejected_path_designs_are_returned_separately():
    task = PathTask(EGG, True, TWENTIES)

    def left(design: Design) -> bool:
        return design.four_bar.side == 'left'

    every = generate_path(task, seed=1, count=FEW, keep=40)
    paths = generate_path(task, seed=1, count=FEW, keep=2, accept=left)
    assert every.refused == ()
    assert paths.found == tuple(r for r in every.found if left(r.design))[:2]
    assert paths.refused
    assert set(paths.refused) <= {r for r in every.found if not left(r.design)}
    none = generate_path(task, seed=1, count=FEW, keep=2, accept=lambda _: False)
    assert none.found == ()
    assert none.refused == every.found[:2]


def test_path_search_seed_determines_the_result():
    told: list[tuple[int, int]] = []
    task = PathTask(ON_A_LINE)
    first = generate_path(task, seed=3, count=FEW, progress=lambda *done: told.append(done))
    assert repr(generate_path(task, seed=3, count=FEW)) == repr(first)
    assert repr(generate_path(task, seed=4, count=FEW)) != repr(first)
    assert told[-1] == (FEW, FEW)
    assert [done for done, _ in told] == sorted(done for done, _ in told)


@pytest.mark.sample(1)
@pytest.mark.parametrize(('size', 'at'), [(1e-3, 5.0 - 7.0j), (1e6, 1e6 + 0j), (1e-12, 0j)])
def test_path_search_is_independent_of_size_and_place(size, at):
    points = tuple(size * point + at for point in ON_TWO_CIRCLES)
    best = generate_path(PathTask(points), seed=1, count=FEW).found[0]
    assert max(distances(best)) < 1e-12 * size + 1e-15 * abs(at)


UP = (0.0, 0.1, 0.2)
HOOK = (0j, 1.0 + 0j, 1.0 + 1.0j)
WHOLE = (
    'timing: the crank travels 360°; the points must be within one turn, '
    'the last before the first again'
)
NEITHER = (
    'timing: the crank angles neither increase nor decrease throughout; '
    'write on beyond 360° or below 0° where they wrap'
)


@pytest.mark.parametrize(('arguments', 'line'), [
    ({'points': (0j, 1j)}, 'path: 2 points; give three at least'),
    ({'points': (0j, 1j, 1j)}, 'points 2 and 3: both at (0, 1); leave one out'),
    ({'points': (0j, 1j, complex(inf, 0.0))}, 'point 3: (inf, 0) is not a place; correct it'),
    ({'points': (0j, 1j, complex(0.0, nan))}, 'point 3: (0, nan) is not a place; correct it'),
    ({'points': (*HOOK, 0j), 'closed': True},
     'point 4: is the first one again; leave it out: a closed path returns by itself'),
    ({'points': HOOK, 'timing': (0.0, 0.1)},
     'timing: 2 crank angles for 3 points; give one for each'),
    ({'points': HOOK, 'timing': (0.0, 0.2, 0.1)}, NEITHER),
    ({'points': HOOK, 'timing': (0.0, nan, 0.1)}, NEITHER),
    ({'points': HOOK, 'timing': (0.0, 1.0, 2.5 * pi)},
     'timing: the crank travels 450°; the points must be within one turn'),
    ({'points': HOOK, 'timing': (0.0, -1.0, -inf)},
     'timing: the crank travels inf°; the points must be within one turn'),
    ({'points': HOOK, 'timing': (0.0, 1.0, tau), 'closed': True}, WHOLE),
    ({'points': HOOK, 'timing': UP, 'links': (2.0, 1.0)},
     'links: from 2 to 1 of the path; write e.g. 0.2 to 4'),
    ({'points': (-1e308 - 1e308j, 0j, 1e308 + 1e308j)},
     'path: its size is inf m; make it 1e-12 to 1e+09 m'),
    ({'points': (0j, 1e-200 + 0j, 1e-200j)},
     'path: its size is 1.41421e-200 m; make it 1e-12 to 1e+09 m'),
])  # fmt: skip
def test_invalid_path_task_is_refused_in_one_line(arguments, line):
    with pytest.raises(SynthesisError) as caught:
        PathTask(**arguments)
    assert str(caught.value) == line


def test_unreachable_path_points_are_refused():
    task = PathTask(EGG, True, TWENTIES, links=(0.01, 0.02))
    with pytest.raises(SynthesisError, match=r'links of 0\.01 to 0\.02 times its size reaches'):
        generate_path(task, seed=1, count=FEW)
