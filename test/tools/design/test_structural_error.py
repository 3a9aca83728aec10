# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""The structural error of a design, with compass and ruler, and the fit that makes it least."""

from cmath import exp, phase
from collections.abc import Callable
from dataclasses import replace
from math import isnan, pi, radians, remainder, sqrt, tau

from hypothesis import assume, given, strategies as st
from linkage_ros.errors import SynthesisError
from linkage_ros.tools.design import (
    angle_pairs,
    Assembly,
    chebyshev_points,
    closure_of,
    Design,
    DesignRequest,
    exact_four_bar,
    fit_angles,
    fit_equation,
    FourBar,
    FunctionTask,
    nearest_four_bar,
    rocker_errors,
    root_mean_square,
    structural_error,
    wanted_rocker,
)
from mpmath import mp
import numpy as np
import pytest
from scipy.optimize import minimize

from . import by_hand
from .test_function import task_of, TASKS
from ...support.four_bar import meeting_point

# The structural error of a design equals that of the same four-bar by compass and ruler.


CRANK_ROCKER = (2.0, 7.0, 9.0, 6.0)
TOGGLES_AT_90 = (3.0, 2.0, 3.0, 4.0)


def rocker_angles(lengths: by_hand.Lengths, crank: np.ndarray, side: str = 'left') -> np.ndarray:
    """Return the rocker's angles of a four-bar with compass and ruler, without jumps."""
    d = lengths[3]
    angles = [phase(by_hand.on(side, lengths, float(angle)) - d) for angle in crank]
    return np.unwrap(angles)


def four_bar(lengths: by_hand.Lengths, side: str = 'left') -> Design:
    return Design(FourBar.of_lengths(*lengths, side=side), ())


class Generated:
    """A function generator of three points, by elimination and circles that meet, in 40 digits."""

    def __init__(self, name: str) -> None:
        case, self.function = TASKS[name]
        task = task_of(case)
        self.xs = [mp.mpf(x) for x in task.x_range]
        self.cranks = [mp.mpf(angle) for angle in task.crank_range]
        self.rockers = [mp.mpf(angle) for angle in task.rocker_range]
        points = [
            mp.mpf(angle) for angle in angle_pairs(task, chebyshev_points(*task.x_range, 3))[0]
        ]
        wanted = [self.wanted(theta) for theta in points]
        rows = [[mp.cos(phi), mp.cos(theta), 1] for theta, phi in zip(points, wanted, strict=True)]
        right = [mp.cos(theta - phi) for theta, phi in zip(points, wanted, strict=True)]
        k1, k2, k3 = mp.lu_solve(mp.matrix(rows), mp.matrix(right))
        self.a, self.c = 1 / k1, -1 / k2
        self.b = mp.sqrt(self.a**2 + self.c**2 + 1 - 2 * self.a * self.c * k3)
        self.points = points
        self.sign = 1
        if abs(self.error(points[0])) > mp.mpf('1e-20'):
            self.sign = -1

    def wanted(self, theta: mp.mpf) -> mp.mpf:
        (x0, x1), (c0, c1), (r0, r1) = self.xs, self.cranks, self.rockers
        x = x0 + (theta - c0) / (c1 - c0) * (x1 - x0)
        y, y0, y1 = (self.function(value) for value in (x, x0, x1))
        return r0 + (y - y0) / (y1 - y0) * (r1 - r0)

    def error(self, theta: mp.mpf) -> mp.mpf:
        pin = meeting_point(self.a * mp.expj(theta), 1, self.b, self.c, self.sign) - 1
        if self.c < 0:
            pin = -pin
        error = mp.arg(pin) - self.wanted(theta)
        return error - 2 * mp.pi * mp.nint(error / (2 * mp.pi))


def designed(name: str) -> tuple[FunctionTask, Design, Callable[[np.ndarray], np.ndarray]]:
    task = task_of(TASKS[name][0])
    design, _ = exact_four_bar(*angle_pairs(task, chebyshev_points(*task.x_range, 3)), 1.0)
    return task, design, lambda crank: wanted_rocker(task, crank)


@pytest.fixture(autouse=True)
def _many_digits():
    with mp.workdps(40):
        yield


@pytest.mark.parametrize('name', ['log', 'power', 'sine', 'reciprocal', 'down'])
def test_structural_error_equals_a_40_digit_reference(name):
    task, design, wanted = designed(name)
    reference = Generated(name)
    assert design.four_bar.lengths[:3] == pytest.approx(
        [float(abs(length)) for length in (reference.a, reference.b, reference.c)], rel=1e-12
    )
    found = structural_error(design, wanted, *task.crank_range)
    assert found.opens_at is None
    assert (found.crank[0], found.crank[-1]) == task.crank_range
    for angle, error in list(zip(found.crank, found.error, strict=True))[::9]:
        assert error == pytest.approx(float(reference.error(mp.mpf(float(angle)))), abs=2e-14)
    assert found.greatest == pytest.approx(
        float(reference.error(mp.mpf(found.greatest_at))), abs=2e-14
    )
    # Nowhere on a grid of its own is it greater.
    c0, c1 = reference.cranks
    grid = [abs(reference.error(c0 + (c1 - c0) * i / 300)) for i in range(301)]
    assert abs(found.greatest) > float(max(grid)) - 1e-14
    squares = [(1 if 0 < i < 300 else mp.mpf('0.5')) * e * e for i, e in enumerate(grid)]
    assert found.rms == pytest.approx(float(mp.sqrt(sum(squares) / 300)), rel=1e-3)


@pytest.mark.parametrize('name', ['log', 'power', 'sine', 'reciprocal', 'down'])
def test_structural_error_changes_sign_at_precision_points(name):
    task, design, wanted = designed(name)
    found = structural_error(design, wanted, *task.crank_range)
    for one in design.wanted:
        (at,) = np.flatnonzero(found.crank == one.crank)
        assert found.error[at] == pytest.approx(0.0, abs=1e-12)
        # The next sample may be the same angle but for its rounding.
        before, after = found.error[at - 2], found.error[at + 2]
        assert before * after < 0.0
        assert min(abs(before), abs(after)) > 1e-8


@pytest.mark.parametrize('amplitude', [1e-3, 1e-9])
@pytest.mark.parametrize('side', ['left', 'right'])
@pytest.mark.parametrize('direction', [1, -1])
def test_known_structural_error_peak_and_rms_are_found(amplitude, side, direction):
    def wanted(crank: np.ndarray) -> np.ndarray:
        wave = np.sin(3.0 * (crank - 0.2))
        return rocker_angles(CRANK_ROCKER, crank, side) - amplitude * wave

    ends = (0.2, 0.2 + tau)[::direction]
    found = structural_error(four_bar(CRANK_ROCKER, side), wanted, *ends)
    assert abs(found.greatest) == pytest.approx(amplitude, abs=1e-14)
    wave = 3.0 * (found.greatest_at - 0.2)
    assert abs(np.sin(wave)) == pytest.approx(1.0, abs=1e-14 / amplitude + 1e-14)
    assert np.sign(found.greatest) == np.sign(np.sin(wave))
    assert found.rms == pytest.approx(amplitude / sqrt(2.0), rel=1e-4)


def test_highest_of_nearly_equal_peaks_is_reported():
    """The samples, half a degree apart, see other heights: the order of some is another there."""
    period = tau / 5.0

    def wave(crank: np.ndarray) -> np.ndarray:
        return np.sin(tau * crank / period * 1.0137) * (1.0 + 1e-7 * crank)

    found = structural_error(
        four_bar(CRANK_ROCKER),
        lambda crank: rocker_angles(CRANK_ROCKER, crank) - wave(crank),
        0,
        6,
    )
    dense = np.linspace(0.0, 6.0, 1_000_001)
    heights = np.abs(wave(dense))
    assert found.greatest_at == pytest.approx(dense[np.argmax(heights)], abs=1e-4)
    assert abs(found.greatest) == pytest.approx(np.max(heights), abs=1e-10)


def test_constant_error_equals_its_rms():
    found = structural_error(
        four_bar(CRANK_ROCKER), lambda crank: rocker_angles(CRANK_ROCKER, crank) + 0.25, 0.1, 1.3
    )
    assert found.error == pytest.approx(np.full_like(found.error, -0.25), abs=1e-14)
    assert (found.greatest, found.rms) == pytest.approx((-0.25, 0.25))


@pytest.mark.parametrize('turns', [-2, 1, 7])
def test_whole_turns_cause_no_structural_error(turns):
    def wanted(crank: np.ndarray) -> np.ndarray:
        return rocker_angles(CRANK_ROCKER, crank) + turns * tau

    found = structural_error(four_bar(CRANK_ROCKER), wanted, -1.0, 1.0)
    assert abs(found.greatest) < 1e-14


def test_half_turn_error_is_reported_positive():
    """A parallelogram's rocker stands as its crank does, to the last digit."""
    design = four_bar((1.0, 2.0, 1.0, 2.0))
    for by in (pi, -pi):
        found = structural_error(design, lambda crank, by=by: crank + by, 0.5, 2.5)
        assert np.abs(found.error) == pytest.approx(np.full_like(found.error, pi), abs=1e-14)
        assert (found.error > -pi).all()


@pytest.mark.parametrize(('low', 'high', 'opens_at'), [
    (-80.0, 80.0, None), (80.0, -80.0, None), (30.0, 120.0, 90.0), (30.0, -120.0, -90.0),
    (100.0, 30.0, 100.0), (330.0, 500.0, 450.0), (100.0, 200.0, 100.0), (-90.0, 90.0, None),
])  # fmt: skip
def test_structural_error_reports_the_opening_angle(low, high, opens_at):
    """3, 4 and 5: at ±90° coupler and rocker are stretched, 5 long."""
    found = structural_error(four_bar(TOGGLES_AT_90), np.zeros_like, radians(low), radians(high))
    if opens_at is None:
        assert found.opens_at is None
        return
    assert found.opens_at == pytest.approx(radians(opens_at), abs=1e-12)
    closes = np.cos(found.crank) > 0.0
    assert np.array_equal(np.isfinite(found.error), closes)
    assert isnan(found.greatest) == isnan(found.rms) == (not closes.any())


def test_structural_error_is_nan_between_two_ranges():
    """Crank 4, ground 4: A must stay 3 from O4 at least, and 5 at most."""
    lengths = (4.0, 4.0, 1.0, 4.0)
    near = 2.0 * np.arcsin(3.0 / 8.0)
    found = structural_error(four_bar(lengths), np.zeros_like, near + 0.1, -near - 0.1)
    assert found.opens_at == pytest.approx(near, abs=1e-12)
    assert np.array_equal(np.isfinite(found.error), np.abs(found.crank) > near)


def test_greatest_error_is_searched_only_where_closed():
    """The rocker goes one way up to the toggle, and fastest there; then there is none."""
    (start,) = rocker_angles(TOGGLES_AT_90, np.array([radians(60.0)]))
    found = structural_error(
        four_bar(TOGGLES_AT_90),
        lambda crank: np.full_like(crank, start),
        radians(60.0),
        radians(120.0),
    )
    stretched = phase(3j - 4.0)
    assert found.greatest_at == pytest.approx(radians(90.0), abs=1e-8)
    assert found.greatest == pytest.approx(stretched - start, abs=1e-4)
    assert abs(found.greatest) > 0.3


def test_structural_error_uses_reversed_links_and_zeros():
    positions = [(20.0, 'left'), (60.0, 'left'), (100.0, 'left')]
    design = by_hand.design(CRANK_ROCKER, positions, zeros=(pi - 0.3, -2.0), ground=0.7)
    cranks = [one.crank for one in design.wanted]
    rockers = [one.rocker for one in design.wanted]

    def wanted(crank: np.ndarray) -> np.ndarray:
        return np.interp(crank, cranks, np.unwrap(rockers))

    found = structural_error(design, wanted, cranks[0], cranks[-1])
    for crank in cranks:
        assert found.error[found.crank == crank] == pytest.approx([0.0], abs=1e-13)
    assert abs(found.greatest) > 1e-3


def at_positions(design: Design) -> list[float]:
    """Return the error at each position of a design."""
    cranks, rockers = zip(*((one.crank, one.rocker) for one in design.wanted), strict=True)
    found = structural_error(design, lambda x: np.interp(x, cranks, rockers), *cranks)
    return [float(found.error[found.crank == crank][0]) for crank in cranks]


def test_structural_errors_use_the_design_assembly() -> None:
    design = by_hand.design(CRANK_ROCKER, [(40.0, 'left'), (90.0, 'right')])
    errors = at_positions(design)
    assert errors[0] == pytest.approx(0.0, abs=1e-13)
    left, right = (
        phase(by_hand.on(side, CRANK_ROCKER, radians(90.0)) - CRANK_ROCKER[3])
        for side in ('left', 'right')
    )
    assert errors[1] == pytest.approx((left - right + pi) % tau - pi)
    other = at_positions(design._replace(four_bar=replace(design.four_bar, side='right')))
    assert other[1] == pytest.approx(0.0, abs=1e-13)


# The rocker's error: linkages found again, improved starts, and minima by other methods.


SEED = 20261121

# Striking mechanism of a weaving machine: github.com/WashingtonKK/MATLAB-playground,
# Projects/lab2/Lab2.m; the ground is 0.18 m.
WEAVING = (
    tuple(map(radians, (40, 45, 50, 55, 60))),
    tuple(map(radians, (70, 76, 83, 91, 100))),
    0.18,
)


def rocker_angle(four_bar: FourBar, theta: float) -> float | None:
    """Return where the rocker stands, by the package's closed form; None where nothing closes."""
    position = closure_of(Design(four_bar, ()), four_bar.side).position(theta)
    return position.joints[1] if position.joints else None


def sampled(four_bar: FourBar, crank: list[float]) -> Design | None:
    """Return a design for what a linkage does anyway."""
    rocker = [rocker_angle(four_bar, theta) for theta in crank]
    if None in rocker:
        return None
    return Design(four_bar, tuple(DesignRequest(t, p) for t, p in zip(crank, rocker, strict=True)))


def with_noise(design: Design, noise: np.ndarray) -> Design:
    wanted = [
        one._replace(rocker=one.rocker + n) for one, n in zip(design.wanted, noise, strict=True)
    ]
    return design._replace(wanted=tuple(wanted))


def start_of(design: Design) -> Design:
    crank, rocker = zip(*[(one.crank, one.rocker) for one in design.wanted], strict=True)
    return fit_equation(crank, rocker, design.four_bar.lengths[3])


def random_design(rng: np.random.Generator, count: int) -> Design:
    """Return a linkage with positions over a quarter turn of its crank, on one assembly."""
    while True:
        a, b, c = (10 ** rng.uniform(-0.5, 0.5, 3)).tolist()
        side: Assembly = 'left' if rng.random() < 0.5 else 'right'
        first = rng.uniform(-pi, pi)
        crank = np.linspace(first, first + 1.5, count).tolist()
        design = sampled(FourBar.of_lengths(a, b, c, 1.0, side=side), crank)
        if design:
            return design


@pytest.mark.parametrize('number', range(8))
def test_four_bar_is_recovered_from_seven_positions(number):
    """From the equation's fit, and from a start that is ten per cent off."""
    true = random_design(np.random.default_rng([SEED, number]), 7)
    a, b, c, d = true.four_bar.lengths
    off = FourBar.of_lengths(1.1 * a, 0.95 * b, 1.05 * c, d, side=true.four_bar.side)
    assert start_of(true).four_bar.lengths == pytest.approx((a, b, c, d), rel=1e-8)
    found = fit_angles(true._replace(four_bar=off))
    assert found.four_bar.lengths == pytest.approx((a, b, c, d), rel=1e-6)
    assert found.four_bar.side == true.four_bar.side
    assert root_mean_square(found) < 1e-9
    assert found.wanted == true.wanted


def test_fit_recovers_free_zeros():
    """Both frames turned: seven positions tell the five unknowns."""
    true = FourBar.of_lengths(0.3, 0.9, 0.7, 1.0, alpha=0.4, beta=-0.3)
    design = sampled(true, np.linspace(-1.0, 3.0, 9).tolist())
    assert design is not None
    start = FourBar.of_lengths(0.33, 0.85, 0.75, 1.0, alpha=0.3, beta=-0.2)
    found = fit_angles(design._replace(four_bar=start), free_zeros=True).four_bar
    assert found.crank == pytest.approx(true.crank, abs=1e-7)
    assert found.rocker == pytest.approx(true.rocker, abs=1e-7)
    assert found.lengths[1] == pytest.approx(0.9, abs=1e-7)
    assert found.pivots == true.pivots


@pytest.mark.sample(3)
@pytest.mark.parametrize('number', range(12))
@pytest.mark.parametrize('noise', [1e-3, 0.03])
def test_angle_fit_improves_the_equation_fit(number, noise):
    rng = np.random.default_rng([SEED, 1, number])
    design = with_noise(random_design(rng, 7), noise * rng.normal(size=7))
    start = start_of(design)
    found = fit_angles(start)
    assert root_mean_square(found) <= root_mean_square(start)
    assert root_mean_square(fit_angles(found)) == pytest.approx(root_mean_square(found), rel=1e-6)


def fit_by_hand(
    logarithms: np.ndarray, crank: tuple[float, ...], rocker: tuple[float, ...]
) -> float:
    """Sum the squares of the smaller of both assemblies' errors."""
    a, b, c = np.exp(logarithms).tolist()
    sums = []
    for sign in (-1, 1):
        total = 0.0
        for theta, phi in zip(crank, rocker, strict=True):
            pin = meeting_point(a * exp(1j * theta), 1.0, b, c, sign)
            if pin is None:
                return 1e3
            total += remainder(phase(pin - 1.0) - phi, tau) ** 2
        sums.append(total)
    return min(sums)


def test_angle_fit_equals_a_nelder_mead_minimum():
    """The published pairs, by the simplex of Nelder and Mead on an error written out again."""
    crank, rocker, ground = WEAVING
    start = fit_equation(crank, rocker, ground)
    found = fit_angles(start)
    simplex = minimize(
        fit_by_hand,
        np.log(np.array(start.four_bar.lengths[:3]) / ground),
        (crank, rocker),
        method='Nelder-Mead',
        options={'xatol': 1e-13, 'fatol': 1e-20, 'maxiter': 4000, 'maxfev': 4000},
    )
    assert root_mean_square(found) == pytest.approx((simplex.fun / 5) ** 0.5, rel=1e-7)
    assert root_mean_square(found) < 0.95 * root_mean_square(start)
    assert found.four_bar.lengths[:3] == pytest.approx(np.exp(simplex.x) * ground, rel=1e-4)


def test_free_zeros_reduce_the_fit_error():
    crank, rocker, ground = WEAVING
    start = fit_equation(crank, rocker, ground)
    free = fit_angles(start, free_zeros=True)
    assert root_mean_square(free) < 0.2 * root_mean_square(fit_angles(start))


@pytest.mark.sample(2)
@pytest.mark.parametrize('number', range(12))
def test_nearest_four_bar_has_the_least_error(number):
    """Noise on eight pairs: the linkage that they were taken of is one that must be beaten."""
    generator = np.random.default_rng([11, number])
    true = None
    while true is None:
        a, b, c = np.exp(generator.uniform(-1.2, 1.2, 3)).tolist()
        angles = np.sort(generator.uniform(-1.0, 1.0) + generator.uniform(0.0, 2.0, 8)).tolist()
        true = sampled(FourBar.of_lengths(a, b, c, 1.0), angles)
    off = generator.normal(0.0, 0.03, 8).tolist()
    noisy = true._replace(
        wanted=tuple(
            one._replace(rocker=one.rocker + by) for one, by in zip(true.wanted, off, strict=True)
        )
    )
    crank, rocker = ([getattr(one, link) for one in noisy.wanted] for link in ('crank', 'rocker'))
    found = nearest_four_bar(crank, rocker, 1.0)
    assert root_mean_square(found) <= root_mean_square(noisy)
    from_equation = fit_angles(fit_equation(crank, rocker, 1.0))
    assert root_mean_square(found) <= root_mean_square(from_equation) * (1.0 + 1e-9)


def test_angle_fit_is_deterministic():
    start = fit_equation(*WEAVING)
    assert fit_angles(start) == fit_angles(start)


def test_angle_fit_recovers_from_an_open_start():
    """A coupler too short for most positions: gaps are errors too, and slopes at an open loop."""
    true = sampled(FourBar.of_lengths(0.4, 1.2, 0.8, 1.0), np.linspace(0.0, 6.0, 7).tolist())
    assert true is not None
    short = true._replace(four_bar=replace(true.four_bar, coupler=(0j, 0.3 + 0j)))
    assert np.count_nonzero(rocker_errors(short)[7:]) >= 3
    found = fit_angles(short)
    assert not rocker_errors(found)[7:].any()
    assert found.four_bar.lengths == pytest.approx(true.four_bar.lengths, rel=1e-6)


lengths = st.floats(-1.0, 1.0).map(lambda x: 10.0**x)


@given(
    st.tuples(lengths, lengths, lengths),
    st.tuples(st.booleans(), st.booleans()),
    st.sampled_from(['left', 'right']),
    st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
    st.floats(-pi, pi),
)
def test_fit_errors_equal_the_closure_errors(size, reversed_links, side, zeros, theta):
    """The errors of a fit against the closure, also of reversed links and turned zeros."""
    a, b, c = size
    # Next to a parallelogram, kite or rhombus the closure changes sides as that one does.
    pairs = [(1.0, a, b, c), (1.0, b, a, c), (1.0, c, a, b)]
    assume(all(abs(p - q) > 0.01 * q or abs(r - t) > 0.01 * t for p, q, r, t in pairs))
    a, c = (-x if back else x for x, back in zip((a, c), reversed_links, strict=True))
    four_bar = FourBar.of_lengths(a, b, c, 1.0, *zeros, side=side)
    s = abs(four_bar.crank * exp(1j * theta) - 1.0)
    ends = s - (b + abs(c)), abs(b - abs(c)) - s
    # A last digit of the lengths is all that decides at a toggle; linkages that fold flat have a
    # side that holds for half a turn only.
    assume(min(map(abs, (*ends, s))) > 1e-6)
    assume(all(abs(1 + x * a + y * b + x * y * c) > 1e-6 for x in (-1, 1) for y in (-1, 1)))
    assume(all(abs(1 + x * a + y * b - x * y * c) > 1e-6 for x in (-1, 1) for y in (-1, 1)))
    rocker = rocker_angle(four_bar, theta)
    angle, gap = rocker_errors(Design(four_bar, (DesignRequest(theta, 0.0),)))
    assert (rocker is None) == (max(ends) > 0.0)
    assert gap == pytest.approx(max(*ends, 0.0) / abs(c))
    if rocker is not None:
        assert remainder(angle - rocker, tau) == pytest.approx(0.0, abs=1e-7)


def test_fit_with_too_few_pairs_is_refused():
    design = fit_equation(*WEAVING)
    with pytest.raises(SynthesisError, match=r'5 unknowns and 4 pairs'):
        fit_angles(design._replace(wanted=design.wanted[:4]), free_zeros=True)
    with pytest.raises(SynthesisError, match=r'3 unknowns and 2 pairs'):
        fit_angles(design._replace(wanted=design.wanted[:2]))


def test_missing_rocker_angle_error_names_the_position():
    design = fit_equation(*WEAVING)
    wanted = (*design.wanted[:4], DesignRequest(1.0, place=1j))
    with pytest.raises(SynthesisError, match=r'^position 5: asks for no rocker angle'):
        fit_angles(design._replace(wanted=wanted))
