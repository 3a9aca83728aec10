# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""
Four and five pairs with free zeros, against linkages known before and against other eliminations.

No published example with numbers was at hand; the five pairs of the weaving machine are, and their
solutions here come from resultants at fifty digits.
"""

from math import acos, atan, cos, pi, radians
from typing import Any, NamedTuple

from flint import arb, arb_mat, ctx
from hypothesis import assume, given, strategies as st
from linkage_ros.errors import SynthesisError
from linkage_ros.tools.design import five_pairs, four_pairs, FreeZeros, prove
from mpmath import mp, mpc, mpf
import numpy as np
import pytest

U = 2.0**-53
MULTIPLE = 2.0
"""Of what rounding the angles alone does, the most that an error may be."""

TOLD = 1e-9
"""A link that rounding changes by more than this part may be found worse, or be refused."""

Free = tuple[str, ...]
ROCKER, CRANK, BOTH = ('beta',), ('alpha',), ('alpha', 'beta')
MOVED = {ROCKER: 'rocker', CRANK: 'crank', BOTH: 'both'}

# https://github.com/WashingtonKK/MATLAB-playground, Projects/lab2/Lab2.m: the striking mechanism
# of a weaving machine, in degrees, on a ground of 180 mm. It asks for the nearest linkage.
WEAVING = ([40.0, 45.0, 50.0, 55.0, 60.0], [70.0, 76.0, 83.0, 91.0, 100.0])


class Case(NamedTuple):
    """Pairs of a linkage on a ground of 1, rounded to doubles, and what rounding can do to it."""

    a: float
    b: float
    c: float
    alpha: float
    beta: float
    crank: list[float]
    rocker: list[float]
    sensitivity: list[float]
    moved: str = 'both'

    @property
    def told(self) -> bool:
        lengths = zip(self.sensitivity[:3], (self.a, self.b, self.c), strict=True)
        return all(U * lost < TOLD * abs(length) for lost, length in lengths)


def case_of(values: list[float], crank: list[float], sides: list[int], free: Free) -> Case | None:
    """Return the pairs at crank angles on their sides of A→O4, by 200 bits, or None."""
    ctx.prec = 200
    a, b, c, alpha, beta = map(arb, values)
    rocker, rows, moved = [], [], []
    for theta, side in zip(crank, sides, strict=True):
        sine, cosine = (theta + alpha).sin_cos()
        x, y = 1 - a * cosine, -a * sine
        square = x * x + y * y
        along = (c * c - b * b + square) / 2
        height = c * c * square - along * along
        if not height > 0:
            return None
        across = side * height.sqrt()
        p, q = (-along * x - across * y) / (square * c), (across * x - along * y) / (square * c)
        rocker.append(arb.atan2(q, p) - beta)
        if not rocker[-1].rad() < 1e-30:
            return None
        # Half the gradient of abs(coupler)² − b², by a, b, c, θ + α and φ + β.
        u, v = x + c * p, y + c * q
        by_theta, by_phi = -a * (v * cosine - u * sine), c * (v * p - u * q)
        by_zero = {'alpha': by_theta, 'beta': by_phi}
        rows.append([-(u * cosine + v * sine), -b, u * p + v * q, *map(by_zero.get, free)])
        moved.append((by_theta * theta, by_phi * rocker[-1]))
    try:
        inverse = arb_mat(rows).inv()
    except ZeroDivisionError:
        return None
    names = ('a', 'b', 'c', *free)
    lost = {
        name: sum(float(abs(inverse[j, i] * part)) for i in range(len(rows)) for part in moved[i])
        for j, name in enumerate(names)
    }
    named = zip(('a', 'b', 'c', 'alpha', 'beta'), values, strict=True)
    sensitivity = [lost.get(name, 0.0) + abs(value) for name, value in named]
    return Case(*values, crank, [float(phi) for phi in rocker], sensitivity, MOVED[free])


def drawn(rng: np.random.Generator, free: Free, mixed: bool = False, spread: float = pi) -> Case:
    """Draw a linkage with links of 0.1 to 10 grounds, either way, and as many pairs as needed."""
    count = 3 + len(free)
    while True:
        a, b, c = (10.0 ** rng.uniform(-1.0, 1.0, 3) * rng.choice((-1, 1), 3)).tolist()
        zeros = [float(rng.uniform(-pi / 2, pi / 2)) * (z in free) for z in ('alpha', 'beta')]
        side = int(rng.choice((-1, 1)))
        crank = [
            theta
            for theta in (rng.uniform(-pi, pi) + rng.uniform(-spread, spread, 40)).tolist()
            if abs(abs(b) - abs(c))
            < abs(1 - a * np.exp(1j * (theta + zeros[0])))
            < abs(b) + abs(c)
        ][:count]
        sides = rng.choice((-1, 1), count).tolist() if mixed else [side] * count
        if len(crank) == count:
            case = case_of([a, abs(b), c, *zeros], crank, sides, free)
            if case is not None:
                return case


def solve(case: Case) -> tuple[FreeZeros, ...]:
    return (four_pairs if len(case.crank) == 4 else five_pairs)(case.crank, case.rocker, 1.0)


def error(case: Case, found: FreeZeros) -> float:
    """Return the largest error of pins and coupler, in what rounding the angles does to them."""
    crank, rocker = case.a * np.exp(1j * case.alpha), case.c * np.exp(1j * case.beta)
    a, b, c, alpha, beta = case.sensitivity
    four_bar = found.design.four_bar
    return max(
        abs(four_bar.crank - crank) / (U * (a + abs(case.a) * alpha)),
        abs(four_bar.rocker - rocker) / (U * (c + abs(case.c) * beta)),
        abs(found.lengths[1] - case.b) / (U * b),
    )


def gap(found: FreeZeros) -> float:
    """Return by how much the loop misses to close at its pairs at worst, by thirty digits."""
    four_bar = found.design.four_bar
    with mp.workdps(30):
        couplers = [
            four_bar.pivots[1]
            + mpc(four_bar.rocker) * mp.expj(wanted.rocker)
            - mpc(four_bar.crank) * mp.expj(wanted.crank)
            for wanted in found.design.wanted
        ]
        return max(float(abs(abs(one) - four_bar.lengths[1])) for one in couplers)


def check(case: Case) -> None:
    """Hold that the linkage is among the solutions, its worth told, and that all of them close."""
    found = solve(case)
    nearest = min(found, key=lambda one: error(case, one))
    assert error(case, nearest) <= MULTIPLE
    if nearest.moved == case.moved:
        assert nearest.sensitivity == pytest.approx(case.sensitivity, rel=1e-3)
    for one in found:
        size = 1.0 + abs(one.lengths[0]) + abs(one.lengths[2])
        assert gap(one) <= 1e-12 * one.condition * size**2 / one.lengths[1]


@pytest.mark.sample(1)
@pytest.mark.slow
@pytest.mark.parametrize('mixed', [False, True], ids=['one assembly', 'both'])
@pytest.mark.parametrize('free', [ROCKER, CRANK, BOTH])
def test_known_linkage_is_among_the_solutions_of_its_pairs(free, mixed):
    count = 120
    rng = np.random.default_rng([len(free), 'alpha' in free, mixed])
    told = 0
    for _ in range(count):
        case = drawn(rng, free, mixed)
        if case.told:
            check(case)
            told += 1
    assert told > 0.9 * count


@pytest.mark.sample(1)
@pytest.mark.parametrize(('free', 'spread'), [(ROCKER, 0.01), (CRANK, 0.01), (BOTH, 0.1)])
def test_close_pairs_keep_the_reported_accuracy(free, spread):
    rng = np.random.default_rng(3)
    worst = 0.0
    for _ in range(100):
        case = drawn(rng, free, spread=spread)
        lengths = zip(case.sensitivity[:3], (case.a, case.b, case.c), strict=True)
        lost = U * max(own / abs(length) for own, length in lengths)
        if lost < 1e-5:
            assert min(error(case, one) for one in solve(case)) <= MULTIPLE
            worst = max(worst, lost)
    assert worst > 1e-7


@given(
    free=st.sampled_from([ROCKER, CRANK, BOTH]),
    a=st.floats(0.2, 5.0),
    over=st.floats(0.01, 5.0),
    part=st.floats(-0.99, 0.99),
    zeros=st.tuples(st.floats(0.05, 1.5), st.floats(-1.5, -0.05)),
    first=st.floats(-3.0, 3.0),
    steps=st.lists(st.floats(0.05, 1.2), min_size=4, max_size=4),
    side=st.sampled_from([-1, 1]),
)
def test_fully_turning_linkage_is_among_its_solutions(
    free, a, over, part, zeros, first, steps, side
):
    # b + c is more than 1 + a, b - c less than 1 - a: it closes at all crank angles.
    b, c = (0.5 * (1.0 + a + over + sign * part * abs(1.0 - a)) for sign in (1, -1))
    alpha, beta = (zero * (name in free) for zero, name in zip(zeros, BOTH, strict=True))
    crank = [first + sum(steps[:count]) for count in range(3 + len(free))]
    case = case_of([a, b, c, alpha, beta], crank, [side] * len(crank), free)
    assume(case is not None and case.told)
    assert case is not None
    check(case)


def matrix(case: Case, x: Any, y: Any) -> list[list[Any]]:
    """Return the columns cos(φ + β), cos(θ + α), 1, cos(θ + α − φ − β) for (1, tan) of zeros."""
    rows = []
    for theta, phi in zip(map(mpf, case.crank), map(mpf, case.rocker), strict=True):
        by = theta - phi
        rows.append(
            [
                mp.cos(phi) - y * mp.sin(phi),
                mp.cos(theta) - x * mp.sin(theta),
                mpf(1),
                mp.cos(by) * (1 + x * y) - mp.sin(by) * (x - y),
            ]
        )
    return rows


def minor(case: Case, without: int, x: Any, y: Any) -> Any:
    rows = matrix(case, x, y)
    rows.pop(without)
    return mp.det(mp.matrix(rows))


def resultants(case: Case) -> list[tuple[Any, Any]]:
    """
    Return tan α and tan β of all solutions of five pairs, complex ones too.

    Two of the five determinants of four pairs are quadratics in tan β, whose coefficients are
    quadratics in tan α; eight values of it make their resultant zero. At three the other
    determinants are zero with them, and at ±i, which is no angle.
    """
    points = [mpf(-1), mpf(0), mpf(1)]

    def quadratic(values: list[Any]) -> list[Any]:
        low, middle, high = values
        return [(low + high) / 2 - middle, (high - low) / 2, middle]

    def times(one: list[Any], other: list[Any]) -> list[Any]:
        product = [mpf(0)] * (len(one) + len(other) - 1)
        for i, u in enumerate(one):
            for j, v in enumerate(other):
                product[i + j] += u * v
        return product

    def cross(i: int, j: int) -> list[Any]:
        one, other = times(first[i], second[j]), times(first[j], second[i])
        return [u - v for u, v in zip(one, other, strict=True)]

    parts = []
    for without in (4, 3):
        by_x = [quadratic([minor(case, without, x, y) for y in points]) for x in points]
        parts.append([quadratic([of[i] for of in by_x]) for i in range(3)])
    first, second = parts
    squared, product = times(cross(0, 2), cross(0, 2)), times(cross(0, 1), cross(1, 2))
    roots = mp.polyroots(
        [u - v for u, v in zip(squared, product, strict=True)][::-1],
        maxsteps=400,
        extraprec=400,
        asc=True,
    )
    solutions = [
        (
            x,
            -mp.polyval(cross(0, 2)[::-1], x, asc=True)
            / mp.polyval(cross(0, 1)[::-1], x, asc=True),
        )
        for x in roots
    ]
    return [
        (x, y)
        for x, y in solutions
        if all(abs(minor(case, i, x, y)) < 1e-20 for i in range(3)) and abs(x * x + 1) > 1e-20
    ]


@pytest.mark.sample(0)
def test_five_pair_solutions_equal_the_resultants():
    rng = np.random.default_rng(5)
    seen = set()
    with mp.workdps(50):
        for _ in range(25):
            case = drawn(rng, BOTH, mixed=True)
            reference = resultants(case)
            real = [(x.real, y.real) for x, y in reference if abs(mp.im(x)) < 1e-25]
            found = five_pairs(case.crank, case.rocker, 1.0)
            assert len(reference) == 3
            assert found[0].solution_counts == (len(real), 3 - len(real), 0, 0)
            zeros = sorted((atan(x), atan(y)) for x, y in real)
            for one, zero in zip(
                sorted((one.alpha, one.beta) for one in found), zeros, strict=True
            ):
                assert one == pytest.approx(zero, abs=1e-9)
            seen.add(len(real))
    assert seen == {1, 3}


@pytest.mark.sample(1)
@pytest.mark.parametrize('moved', ['rocker', 'crank'])
def test_four_pair_solutions_equal_the_determinant_sign_changes(moved):
    rng = np.random.default_rng(4)
    zero = np.linspace(-pi / 2, pi / 2, 20_001)[:, None]
    seen = set()
    for _ in range(60):
        theta, phi = rng.uniform(-pi, pi, (2, 4))
        t, p = (
            (theta + zero, phi + 0 * zero) if moved == 'crank' else (theta + 0 * zero, phi + zero)
        )
        columns = (np.cos(p), np.cos(t), np.ones_like(p), np.cos(t - p))
        sign = np.sign(np.linalg.det(np.stack(columns, -1)))
        changes = np.flatnonzero(sign[1:] != sign[:-1])
        try:
            found = four_pairs(theta.tolist(), phi.tolist(), 1.0)
        except SynthesisError:
            found = ()
        zeros = sorted(one.alpha + one.beta for one in found if one.moved == moved)
        assert len(zeros) == len(changes)
        for one, place in zip(zeros, changes, strict=True):
            assert zero[place, 0] <= one <= zero[place + 1, 0]
        seen.add(len(zeros))
    assert seen == {0, 2}


def reason(crank: list[float], rocker: list[float]) -> str:
    """Return why there are no solutions; '' where there are."""
    try:
        (four_pairs if len(crank) == 4 else five_pairs)(crank, rocker, 1.0)
    except SynthesisError as none:
        return str(none)
    return ''


def discriminant(theta: list[float], phi: list[Any]) -> Any:
    """Return that of the determinant of four pairs, a quadratic in tan β."""
    case = Case(1.0, 1.0, 1.0, 0.0, 0.0, theta, phi, [])
    low, middle, high = (mp.det(mp.matrix(matrix(case, 0, y))) for y in (-1, 0, 1))
    return ((high - low) / 2) ** 2 - 4 * ((high + low) / 2 - middle) * middle


def test_double_solutions_vanish_at_the_discriminant_zero():
    rng = np.random.default_rng(6)
    folds = 0
    while folds < 10:
        theta, phi = rng.uniform(-pi, pi, (2, 4)).tolist()
        none, two = rng.uniform(-pi, pi, 2).tolist()
        if not discriminant(theta, [*phi[:3], none]) < 0 < discriminant(theta, [*phi[:3], two]):
            continue
        while abs(two - none) > 1e-11:
            middle = 0.5 * (none + two)
            if discriminant(theta, [*phi[:3], middle]) < 0:
                none = middle
            else:
                two = middle
        for last, count in ((none, 0), (two, 2)):
            pairs = theta, [*phi[:3], last]
            found = () if reason(*pairs) else four_pairs(*pairs, 1.0)
            assert sum(one.moved == 'rocker' for one in found) == count
        folds += 1


def test_weaving_machine_pairs_have_one_linkage():
    crank, rocker = ([radians(angle) for angle in angles] for angles in WEAVING)
    (found,) = five_pairs(crank, rocker, 0.18)
    with mp.workdps(50):
        case = Case(1.0, 1.0, 1.0, 0.0, 0.0, crank, rocker, [])
        ((x, y),) = [(x.real, y.real) for x, y in resultants(case) if abs(mp.im(x)) < 1e-25]
        assert found.alpha == pytest.approx(float(mp.atan(x)), abs=1e-11)
        assert found.beta == pytest.approx(float(mp.atan(y)), abs=1e-11)
    assert str(found.solution_counts) == '3 solutions, 2 imaginary'
    for met in prove(found.design):
        assert met.is_closed
        assert met.side == found.design.four_bar.side
        assert met.angle == pytest.approx(0.0, abs=1e-13)


def test_half_turn_crank_offset_gives_the_same_linkage():
    case = drawn(np.random.default_rng(1), BOTH, mixed=False)
    turned = case._replace(crank=[theta - pi for theta in case.crank])
    for one, other in zip(solve(case), solve(turned), strict=True):
        assert other.alpha == pytest.approx(one.alpha, rel=1e-9)
        assert other.lengths == pytest.approx(
            (-one.lengths[0], one.lengths[1], one.lengths[2]), rel=1e-9
        )
        assert -pi / 2 <= one.alpha <= pi / 2


def test_solution_lengths_scale_with_the_ground():
    case = drawn(np.random.default_rng(2), BOTH, mixed=False)
    for one, other in zip(solve(case), five_pairs(case.crank, case.rocker, 0.125), strict=True):
        assert other.lengths == tuple(0.125 * length for length in one.lengths)
        assert other.design.four_bar.lengths[3] == 0.125
        assert (other.alpha, other.beta) == (one.alpha, one.beta)
        scale = (0.125, 0.125, 0.125, 1.0, 1.0)
        scaled = tuple(k * value for k, value in zip(scale, one.sensitivity, strict=True))
        assert other.sensitivity == scaled


def test_linkage_with_zero_offsets_is_listed_once():
    case = case_of([0.4, 1.1, 0.9, 0.0, 0.0], [0.3, 1.1, 2.0, 2.9], [1] * 4, ROCKER)
    assert case is not None
    found = solve(case)
    assert sum(error(case, one) <= MULTIPLE for one in found) == 1


THETA = [0.1, 0.5, 1.0, 1.7, 2.4]

# The rocker turns with the crank (parallelograms), against it, or in a constant ratio to it, so
# that columns of the equations are equal.
SINGULAR = {
    'parallelogram': THETA,
    'turned parallelogram': [theta + 0.3 for theta in THETA],
}
SINGULAR_OF_FIVE = {
    'antiparallel': [0.3 - theta for theta in THETA],
    'twice as fast': [2.0 * theta for theta in THETA],
    'half as fast': [0.5 * theta for theta in THETA],
}


@pytest.mark.parametrize('swapped', [False, True], ids=['', 'swapped'])
@pytest.mark.parametrize(
    ('count', 'name'),
    [(4, name) for name in SINGULAR] + [(5, name) for name in SINGULAR | SINGULAR_OF_FIVE],
)
def test_dependent_pairs_are_refused(count, name, swapped):
    theta, phi = THETA[:count], (SINGULAR | SINGULAR_OF_FIVE)[name][:count]
    with pytest.raises(SynthesisError) as refused:
        (four_pairs if count == 4 else five_pairs)(*(phi, theta) if swapped else (theta, phi), 1.0)
    assert f'pairs: the {count} equations depend on each other' in str(refused.value)


@pytest.mark.parametrize('solve_for', [four_pairs, five_pairs])
def test_pairs_with_a_standing_rocker_are_refused(solve_for):
    count = 4 if solve_for is four_pairs else 5
    with pytest.raises(SynthesisError, match='equations depend on each other'):
        solve_for(THETA[:count], [0.4] * count, 1.0)


def test_nearly_coincident_pairs_are_refused():
    theta = [1.0 + 1e-9 * step for step in range(5)]
    phi = [0.5 + 1.2e-9 * step + 1e-10 * step**2 for step in range(5)]
    with pytest.raises(SynthesisError, match='too close to decide'):
        five_pairs(theta, phi, 1.0)


@pytest.mark.sample(0)
def test_ill_conditioned_solutions_are_counted_but_not_returned():
    rng = np.random.default_rng(9)
    counted = 0
    for _ in range(100):
        case = drawn(rng, ROCKER, spread=1e-3)
        if reason(case.crank, case.rocker):
            continue
        for one in solve(case):
            for lost, length in zip(one.sensitivity[:3], one.lengths, strict=True):
                assert 4.0 * U * lost < 0.1 * abs(length)
            counted += one.solution_counts.vague
    assert counted


def test_repeated_pair_error_names_both_numbers():
    with pytest.raises(SynthesisError, match='pairs 2 and 4: are the same'):
        four_pairs([0.1, 0.5, 1.0, 0.5], [0.2, 0.7, 0.9, 0.7], 1.0)
    with pytest.raises(SynthesisError, match='pairs 1 and 5: are the same'):
        five_pairs([0.1, 0.5, 1.0, 1.5, 0.1], [0.2, 0.7, 0.9, 0.1, 0.2 + 2.0 * pi], 1.0)


def test_four_pairs_without_a_real_solution_are_refused():
    rng = np.random.default_rng(7)
    reasons = {reason(*rng.uniform(-pi, pi, (2, 4)).tolist()) for _ in range(40)}
    (refused,) = reasons - {''}
    assert refused.startswith(
        'pairs: no four-bar has all 4 with a zero of rocker or crank free: '
        '4 solutions, 4 imaginary; move one of the angles'
    )


def test_five_slider_pairs_report_an_infinite_link():
    # k1 = 0, the crank infinitely long: cos(θ + α − φ − β) = k2·cos(θ + α) + k3
    rng = np.random.default_rng(8)
    reasons = set()
    for _ in range(40):
        k2, k3, alpha, beta = rng.uniform(-0.5, 0.5, 4).tolist()
        theta = rng.uniform(-pi, pi, 5).tolist()
        phi = [t + alpha - beta - acos(k2 * cos(t + alpha) + k3) for t in theta]
        reasons.add(reason(theta, phi))
        if not reason(theta, phi):
            assert five_pairs(theta, phi, 1.0)[0].solution_counts == (2, 0, 1, 0)
    (refused,) = reasons - {''}
    assert 'with both zeros free: 3 solutions, 2 imaginary, 1 with infinite links' in refused
