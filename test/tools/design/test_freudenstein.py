# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Three pairs and more: what Freudenstein's equation gives, to which digit, and what it refuses.

No book's example with printed results to full digits was found beside the text that the package
starts from; the pairs of the others below are published, their results are worked out here, by
a general solver at 60 digits.
"""

from math import nan, pi, radians

from campaigns.campaign import tallies_of
from campaigns.synthesis import (
    ABOVE,
    BELOW,
    FAMILIES,
    judge_part,
    linkage_of,
    LOST,
    parts,
    TRUE,
    WORST,
)
from hypothesis import assume, given, strategies as st
from linkage_ros.errors import SynthesisError
from linkage_ros.tools.design import (
    exact_four_bar,
    fit_equation,
    prove,
    sine_cosine,
    solve_links,
    three_pairs,
)
from linkage_ros.tools.design.pairs.freudenstein import TRUSTED
from mpmath import cos, lu_solve, matrix, mp, mpf, sin, sqrt
import numpy as np
import pytest

from ...support.sampling import sample_count

mp.dps = 60
Angles = tuple[float, ...]
SEED = 20261121
"""Not the campaign's own."""

MANY, FEW = sample_count(6_000, 1_500), sample_count(600, 150)
"""Linkages of a usual family, and of a hard one."""


def rad(*degrees: float) -> Angles:
    return tuple(map(radians, degrees))


# Crank angles, rocker angles, ground; the source of the pairs.
PUBLISHED: dict[str, tuple[Angles, Angles, float]] = {
    # The worked text this package starts from.
    'coordinated': (rad(25, 35, 50), rad(30, 40, 60), 1.0),
    # Ohio State University, ME 3751, lecture 12, as in the repository
    # github.com/haijunsu-osu/rocker_synthesis_4bar, test_synthesis.js; inches.
    'lecture': (rad(35.02, 67.5, 100.0), rad(91.21, 101.79, 117.19), 4.5),
    # mechsimulator.com/blog/articles/four-bar-linkage-synthesis-function-generation, the opening.
    'follower': (rad(45, 90, 135), rad(60, 80, 100), 100.0),
    # Striking mechanism of a weaving machine: github.com/WashingtonKK/MATLAB-playground,
    # Projects/lab2/Lab2.m; millimetres.
    'weaving': (rad(40, 45, 50, 55, 60), rad(70, 76, 83, 91, 100), 180.0),
}
THREES = [name for name, (crank, _, _) in PUBLISHED.items() if len(crank) == 3]


def least_squares(crank: Angles, rocker: Angles) -> tuple[list[mpf], list[mpf]]:
    """Return k1, k2, k3 and signed crank, coupler, rocker at 60 digits."""
    rows = [[cos(mpf(p)), cos(mpf(t)), 1] for t, p in zip(crank, rocker, strict=True)]
    right = [cos(mpf(t) - mpf(p)) for t, p in zip(crank, rocker, strict=True)]
    A, B = matrix(rows), matrix(right)
    k1, k2, k3 = lu_solve(A, B)
    a, c = 1 / k1, -1 / k2
    return [k1, k2, k3], [a, sqrt(a * a + c * c + 1 - 2 * a * c * k3), c]


def test_freudenstein_solution_equals_the_source_to_full_digits():
    design, found = exact_four_bar(*PUBLISHED['coordinated'])
    assert found.lengths == pytest.approx(
        (5.5965383934988620854, 0.16985782027961906789, 4.8786334643580194266), rel=4e-15
    )
    assert found.k == pytest.approx(
        (0.17868187970650492505, -0.20497543160512679448, 1.0272224808848817759), rel=1e-14
    )
    assert found.condition == pytest.approx(266.4, abs=0.1)
    assert design.four_bar.lengths == pytest.approx((*found.lengths, 1.0))
    assert all(met.is_closed and abs(met.angle) < 1e-12 for met in prove(design))


@pytest.mark.parametrize('name', THREES)
def test_three_published_pairs_give_the_exact_four_bar(name):
    crank, rocker, ground = PUBLISHED[name]
    k, lengths = least_squares(crank, rocker)
    design, found = exact_four_bar(crank, rocker, ground)
    assert found.k == pytest.approx([float(v) for v in k], rel=1e-13)
    for length, true, kappa in zip(found.lengths, lengths, found.sensitivity, strict=True):
        assert abs(mpf(float(length)) - true) <= 2.0**-53 * kappa
    assert design.four_bar.lengths == pytest.approx(
        [*(abs(float(v)) * ground for v in lengths), ground], rel=1e-13
    )
    assert [(one.crank, one.rocker) for one in design.wanted] == [*zip(crank, rocker, strict=True)]
    assert all(met.is_closed and abs(met.angle) < 1e-11 for met in prove(design))


def test_five_pairs_are_fitted_by_least_squares():
    crank, rocker, ground = PUBLISHED['weaving']
    _, (a, b, c) = least_squares(crank, rocker)
    four_bar = fit_equation(crank, rocker, ground).four_bar
    assert four_bar.crank == pytest.approx(float(a) * ground, rel=1e-12)
    assert four_bar.rocker == pytest.approx(float(c) * ground, rel=1e-12)
    assert four_bar.lengths[1] == pytest.approx(float(b) * ground, rel=1e-12)


@pytest.mark.parametrize('name', THREES)
def test_least_squares_of_three_pairs_is_exact(name):
    assert fit_equation(*PUBLISHED[name]).four_bar.lengths == pytest.approx(
        exact_four_bar(*PUBLISHED[name])[0].four_bar.lengths, rel=1e-11
    )


def test_reversed_links_keep_the_requested_crank_angles():
    """Crank and rocker that come out negative point backwards in their own frames."""
    crank, rocker = rad(20, 40, 60), rad(65, 75, 85)
    design, found = exact_four_bar(crank, rocker, 2.0)
    assert found.lengths[0] < 0
    assert found.lengths[2] < 0
    assert design.four_bar.crank == pytest.approx(2.0 * found.lengths[0])
    assert design.four_bar.crank.imag == 0.0
    assert all(met.is_closed and abs(met.angle) < 1e-11 for met in prove(design))


MIXED = 'both assemblies'


@pytest.fixture(scope='module')
def tallies():
    """Return a sample of the campaign; ``python -m campaigns synthesis`` takes 1,700,000."""
    many = ['ordinary', 'reversed links', MIXED]
    few = [family for family in FAMILIES if family not in many]
    work = [*parts(MANY, SEED, many), *parts(FEW, SEED, few)]
    return tallies_of(judge_part, work, jobs=2)['']


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize('family', FAMILIES)
def test_random_four_bars_are_recovered_from_their_pairs(tallies, family):
    """
    Every length within 4·2⁻⁵³·κ, or flagged.

    Linkages whose pairs, rounded from more than fifty digits, are designed back; κ by the result
    and by the true linkage, which the reference works out from the loop.
    """
    tally = tallies[family]
    where = f"python -m campaigns synthesis --seed {SEED} --show '{family}'"
    limits = {WORST: TRUSTED, LOST: 1.0}
    if family in {'ordinary', 'reversed links', MIXED}:
        assert tally.counts['cases'] == MANY
        assert tally.counts['flagged'] <= 2
        limits |= {TRUE: TRUSTED, ABOVE: 1.001, BELOW: 1.001}
    for name, limit in limits.items():
        errors = tally.quantities[name]
        assert errors.greatest() <= limit, f'{name}: {where} {linkage_of(errors)}'


def test_indistinguishable_pairs_are_flagged(tallies):
    """Crank angles within 1e-9 to 1e-4 rad of each other: half of them say nothing."""
    counts = tallies['one spot'].counts
    assert 0.3 < counts['flagged'] / counts['cases'] < 0.8
    counts = tallies['ordinary'].counts
    assert counts['millidigits'] / counts['cases'] > 13_000


angles = st.tuples(*[st.integers(-3141, 3141).map(lambda n: n / 1000)] * 3)


@given(angles, angles)
def test_length_sensitivity_equals_numerical_derivatives(crank, rocker):
    """The gradient against differences of solutions at 60 digits."""
    found = three_pairs(crank, rocker)
    assume((found.reliable_digits > 4.0).all())
    x = [*map(mpf, (*crank, *rocker))]
    _, lengths = least_squares(x[:3], x[3:])
    kappa = [abs(length) for length in lengths]
    for i in range(6):
        step = mpf(10) ** -20
        y = [*x]
        y[i] += step
        _, changed = least_squares(y[:3], y[3:])
        for j in range(3):
            slope = (changed[j] - lengths[j]) / step
            assert float(slope) == pytest.approx(
                found.gradient[j, i], abs=1e-6 * np.abs(found.gradient[j]).max() + 1e-30
            )
            kappa[j] += abs(slope * x[i])
    assert found.sensitivity == pytest.approx([float(v) for v in kappa], rel=1e-5)


@given(angles, angles)
def test_condition_number_equals_that_of_the_matrix(crank, rocker):
    found = three_pairs(crank, rocker)
    rows = np.stack((np.cos(rocker), np.cos(crank), np.ones(3)), 1)
    true = np.linalg.cond(rows)
    if true < 1e9:
        assert found.condition == pytest.approx(true, rel=1e-6)
    else:
        assert not found.condition < 1e8


def test_batch_of_pairs_equals_single_solutions():
    """Bit by bit, across the blocks that many are worked on in."""
    rng = np.random.default_rng(SEED)
    crank, rocker = rng.uniform(-pi, pi, (2, 5, 900, 3))
    many, quick = three_pairs(crank, rocker), solve_links(crank, rocker)
    assert many.lengths.shape == (5, 900, 3)
    assert (many.condition.shape, many.gradient.shape) == ((5, 900), (5, 900, 3, 6))
    assert many.reliable_digits.shape == (5, 900, 3)
    assert np.array_equal(many.lengths, quick.lengths, equal_nan=True)
    assert np.array_equal(many.k, quick.k, equal_nan=True)
    for place in ((0, 0), (2, 247), (4, 899)):
        one = three_pairs(crank[place], rocker[place])
        for name in one._fields:
            assert np.array_equal(getattr(one, name), getattr(many, name)[place])


def test_impossible_pairs_give_nan_without_a_warning():
    with np.errstate(all='raise'):
        found = three_pairs([[0.1, 0.1, 0.3], [nan, 0.2, 0.3]], [[0.2, 0.2, 0.5], [0.1, 0.2, 0.4]])
    assert not np.isfinite(found.lengths).any()
    assert not found.reliable_digits.any()


SINES = {
    'anywhere': st.floats(-100.0, 100.0),
    'near zero': st.floats(-1e-3, 1e-3).filter(lambda x: abs(x) > 1e-100),
    'near a quarter': st.integers(-8, 8).map(lambda n: n * pi / 2),
}


@pytest.mark.parametrize('kind', SINES)
@given(data=st.data())
def test_double_double_sine_and_cosine_are_exact(kind, data):
    """Relative error below 2⁻⁶⁸, or what an error of 2⁻¹⁰⁴ of the angle makes of it."""
    high = data.draw(SINES[kind])
    low = high * 2.0**-54 * data.draw(st.floats(-0.9, 0.9))
    pairs = sine_cosine((np.array(high), np.array(low)))
    angle = mpf(high) + mpf(low)
    for (one, rest), true in zip(pairs, (sin(angle), cos(angle)), strict=True):
        error = abs(mpf(float(one)) + mpf(float(rest)) - true)
        assert error <= 2.0**-68 * abs(true) + 2.0**-104 * abs(angle)


# Pairs in degrees: crank, rocker, and the error.
REFUSED: dict[str, tuple[Angles, Angles, str]] = {
    'the same twice': ((25, 35, 25), (30, 40, 30),
                       'pairs 1 and 3: are the same, 25° → 30°; give each position once'),
    'the same, a turn on': ((25, 385, 50), (30, 30, 60),
                            'pairs 1 and 2: are the same, 25° → 30°; give each position once'),
    'one crank angle': (
        (25, 35, 35),
        (30, 40, 60),
        (
            'pairs 2 and 3: want the rocker at 40° and at 60° for the same crank angle, 35°, '
            'which needs both assemblies; change one of the crank angles'
        ),
    ),
    'no number': (
        (25, nan, 50),
        (30, 40, 60),
        'pair 2: nan° → 40° is not a pair of angles; write two numbers of at most 6e+10°',
    ),
    'mirrored': (
        (25, -25, 50),
        (30, -30, 60),
        (
            'pairs 1 and 2: 25° → 30° and -25° → -30° are mirror images in the ground line: a '
            'four-bar that has one has the other; replace one of the pairs'
        ),
    ),
    'parallel': (
        (25, 35, 50),
        (25, 35, 50),
        (
            'the pairs: turn crank and rocker by the same angles, as parallelograms of any crank '
            'length do; change one, or draw a parallelogram'
        ),
    ),
    'contradicting': (
        (20, 40, 60),
        (-20, -40, -60),
        (
            'the pairs: contradict each other: no four-bar of finite links has them all; move one '
            'of the angles, or let the zero angles be free'
        ),
    ),
    # github.com/haijunsu-osu/rocker_synthesis_4bar, test_4bar_synthesis.js: as gears would do it.
    'turned by as much': (
        (30, 60, 90),
        (45, 75, 105),
        (
            'the crank: would be infinitely long, and is a slider on a straight line then; move '
            'one of the angles'
        ),
    ),
}  # fmt: skip


@pytest.mark.parametrize('name', REFUSED)
def test_impossible_pairs_are_refused_in_one_line(name):
    crank, rocker, said = REFUSED[name]
    with pytest.raises(SynthesisError) as caught:
        exact_four_bar(rad(*crank), rad(*rocker), 1.0)
    assert str(caught.value) == said


@pytest.mark.parametrize('link', ['crank', 'rocker'])
def test_infinitely_long_link_is_refused(link):
    """With k1 = 0 the crank has no inverse, with k2 = 0 the rocker."""
    one = np.array([0.3, 1.1, 2.0])
    other = one - np.arccos(0.5 * np.cos(one) + 0.2)
    crank, rocker = (one, other) if link == 'crank' else (other, one)
    with pytest.raises(SynthesisError, match=f'^the {link}: would be infinitely long'):
        exact_four_bar(crank.tolist(), rocker.tolist(), 1.0)
    assert not three_pairs(crank, rocker).reliable_digits.any()


@pytest.mark.parametrize('ground', [0.0, -1.0, nan, float('inf')])
def test_ground_without_a_length_is_refused(ground):
    with pytest.raises(SynthesisError, match=r'^ground: '):
        exact_four_bar(rad(25, 35, 50), rad(30, 40, 60), ground)


@pytest.mark.parametrize('name', ['parallel', 'mirrored', 'contradicting', 'the same twice'])
def test_fit_refuses_pairs_that_determine_no_four_bar(name):
    crank, rocker, said = REFUSED[name]
    with pytest.raises(SynthesisError) as caught:
        fit_equation(rad(*crank), rad(*rocker), 1.0)
    assert str(caught.value) == said


def test_pairs_too_close_to_each_other_are_refused():
    """Three pairs of a known linkage within 2e-8 rad: doubles do not hold what they differ by."""
    crank = (1.0, 1.00000001, 1.00000002)
    rocker = tuple(1.5 + 0.4 * (theta - 1.0) + 0.2 * (theta - 1.0) ** 2 for theta in crank)
    with pytest.raises(SynthesisError, match='move'):
        exact_four_bar(crank, rocker, 1.0)
    assert not three_pairs(crank, rocker).reliable_digits.any()
