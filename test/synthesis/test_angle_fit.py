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


"""The rocker's own error: linkages found again, starts improved on, and minima by other means."""

from __future__ import annotations

from cmath import exp, phase
from dataclasses import replace
from math import acos, pi, radians, remainder, tau

from hypothesis import assume, given
from hypothesis import strategies as st
from linkage_ros.errors import SynthesisError
from linkage_ros.synthesis.design import Assembly, Design, FourBar, Wanted
from linkage_ros.synthesis.pairs.angle_fit import (
    fit_angles,
    nearest,
    rocker_errors,
    root_mean_square,
)
from linkage_ros.synthesis.pairs.freudenstein import fit_equation
from linkage_ros.synthesis.proof import closure_of
import numpy as np
import pytest
from scipy.optimize import minimize

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
    return Design(four_bar, tuple(Wanted(t, p) for t, p in zip(crank, rocker, strict=True)))


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
def test_a_linkage_is_found_again_from_seven_of_its_positions(number: int) -> None:
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


def test_zeros_are_found_again() -> None:
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


@pytest.mark.parametrize('number', range(12))
@pytest.mark.parametrize('noise', [1e-3, 0.03])
def test_pairs_that_none_has_are_met_better_than_by_the_equation(
    number: int, noise: float
) -> None:
    rng = np.random.default_rng([SEED, 1, number])
    design = with_noise(random_design(rng, 7), noise * rng.normal(size=7))
    start = start_of(design)
    found = fit_angles(start)
    assert root_mean_square(found) <= root_mean_square(start)
    assert root_mean_square(fit_angles(found)) == pytest.approx(root_mean_square(found), rel=1e-6)


def by_hand(logarithms: np.ndarray, crank: tuple[float, ...], rocker: tuple[float, ...]) -> float:
    """Sum the squares of the smaller of both assemblies' errors, by the law of cosines."""
    a, b, c = np.exp(logarithms).tolist()
    sums = []
    for sign in (-1, 1):
        total = 0.0
        for theta, phi in zip(crank, rocker, strict=True):
            diagonal = a * exp(1j * theta) - 1.0
            s = abs(diagonal)
            cosine = (s * s + c * c - b * b) / (2 * s * c)
            if not -1 <= cosine <= 1:
                return 1e3
            total += remainder(phase(diagonal) + sign * acos(cosine) - phi, tau) ** 2
        sums.append(total)
    return min(sums)


def test_the_minimum_is_that_of_a_search_without_slopes() -> None:
    """The published pairs, by the simplex of Nelder and Mead on an error written out again."""
    crank, rocker, ground = WEAVING
    start = fit_equation(crank, rocker, ground)
    found = fit_angles(start)
    simplex = minimize(
        by_hand,
        np.log(np.array(start.four_bar.lengths[:3]) / ground),
        (crank, rocker),
        method='Nelder-Mead',
        options={'xatol': 1e-13, 'fatol': 1e-20, 'maxiter': 4000, 'maxfev': 4000},
    )
    assert root_mean_square(found) == pytest.approx((simplex.fun / 5) ** 0.5, rel=1e-7)
    assert root_mean_square(found) < 0.95 * root_mean_square(start)
    assert found.four_bar.lengths[:3] == pytest.approx(np.exp(simplex.x) * ground, rel=1e-4)


def test_free_zeros_come_nearer() -> None:
    crank, rocker, ground = WEAVING
    start = fit_equation(crank, rocker, ground)
    free = fit_angles(start, free_zeros=True)
    assert root_mean_square(free) < 0.2 * root_mean_square(fit_angles(start))


@pytest.mark.parametrize('number', range(12))
def test_no_linkage_comes_nearer_than_the_nearest(number: int) -> None:
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
    found = nearest(crank, rocker, 1.0)
    assert root_mean_square(found) <= root_mean_square(noisy)
    from_equation = fit_angles(fit_equation(crank, rocker, 1.0))
    assert root_mean_square(found) <= root_mean_square(from_equation) * (1.0 + 1e-9)


def test_the_same_each_time() -> None:
    start = fit_equation(*WEAVING)
    assert fit_angles(start) == fit_angles(start)


def test_a_start_that_does_not_reach_is_led_to_where_it_does() -> None:
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
def test_errors_are_what_the_node_will_make(
    size: tuple[float, float, float],
    reversed_links: tuple[bool, bool],
    side: Assembly,
    zeros: tuple[float, float],
    theta: float,
) -> None:
    """The errors of a fit against the closure, also of reversed links and turned zeros."""
    a, b, c = size
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
    angle, gap = rocker_errors(Design(four_bar, (Wanted(theta, 0.0),)))
    assert (rocker is None) == (max(ends) > 0.0)
    assert gap == pytest.approx(max(*ends, 0.0) / abs(c))
    if rocker is not None:
        assert remainder(angle - rocker, tau) == pytest.approx(0.0, abs=1e-7)


def test_three_pairs_leave_nothing_to_fit() -> None:
    design = fit_equation(*WEAVING)
    with pytest.raises(SynthesisError, match=r'5 unknowns and 4 pairs'):
        fit_angles(design._replace(wanted=design.wanted[:4]), free_zeros=True)
    with pytest.raises(SynthesisError, match=r'3 unknowns and 2 pairs'):
        fit_angles(design._replace(wanted=design.wanted[:2]))


def test_a_position_without_a_rocker_angle_is_named() -> None:
    design = fit_equation(*WEAVING)
    wanted = (*design.wanted[:4], Wanted(1.0, place=1j))
    with pytest.raises(SynthesisError, match=r'^position 5: asks for no rocker angle'):
        fit_angles(design._replace(wanted=wanted))
