# Copyright 2026 The linkage_ros authors
# Licensed under the Apache License, Version 2.0 (the "License"); you may not use this file except
# in compliance with the License. You may obtain a copy of the License at
# http://www.apache.org/licenses/LICENSE-2.0 Unless required by applicable law or agreed to in
# writing, software distributed under the License is distributed on an "AS IS" BASIS, WITHOUT
# WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied. See the License for the specific
# language governing permissions and limitations under the License.

"""Each method has the order that it says, and finds the instant of an event within a step."""

from itertools import pairwise
from math import cos, exp, log2, pi, sin, sqrt

from linkage_ros.dynamics import (
    gauss_legendre,
    GAUSS_MATRIX,
    GAUSS_NODES,
    GAUSS_WEIGHTS,
    last_before,
    Loads,
    Mechanics,
    METHODS,
    rk4,
    SingleDofMechanism,
)
from linkage_ros.kinematics import Closure
import mpmath
import numpy as np
import pytest

from .loaded import shipped

STEP = {name: method.step for name, method in METHODS.items()}
ORDER = {'semi_implicit_euler': 1, 'rk4': 4, 'gauss_legendre': 6}


def slopes(errors):
    """Return by which power of the step errors fall, each at half the step of the one before."""
    return [log2(before / after) for before, after in pairwise(errors)]


def test_integration_methods_declare_their_order():
    assert {name: method.order for name, method in METHODS.items()} == ORDER


# A pendulum, θ̈ = −ω²·sin θ, let go at an angle: sin(θ/2) = k·cd(ω·t, k), with k = sin(θ₀/2).
OMEGA = 3.0
LET_GO = 2.0


def weight(angle, _rate, _time=0.0):
    return -OMEGA * OMEGA * sin(angle)


def swung(method, seconds, steps):
    """Return the states of the pendulum at the end of each step."""
    state, length = (LET_GO, 0.0), seconds / steps
    states = [state]
    for _ in range(steps):
        state = STEP[method](weight, *state, weight(*state), length)
        states.append(state)
    return states


def swung_exactly(seconds):
    with mpmath.workdps(40):
        k = mpmath.sin(mpmath.mpf(LET_GO) / 2)
        u, m = OMEGA * mpmath.mpf(seconds), k * k
        angle = 2 * mpmath.asin(k * mpmath.ellipfun('cd', u, m=m))
        # d cd/du = −(1 − m)·sn/dn²
        slope = -(1 - m) * mpmath.ellipfun('sn', u, m=m) / mpmath.ellipfun('dn', u, m=m) ** 2
        return float(angle), float(2 * k * OMEGA * slope / mpmath.cos(angle / 2))


STEPS = {
    'semi_implicit_euler': (4000, 8000, 16000),
    'rk4': (200, 400, 800),
    'gauss_legendre': (40, 80, 160),
}


@pytest.mark.parametrize('method', METHODS)
def test_pendulum_error_falls_with_the_method_order(method):
    angle, rate = swung_exactly(2.5)
    errors = []
    for steps in STEPS[method]:
        found_angle, found_rate = swung(method, 2.5, steps)[-1]
        errors.append(max(abs(found_angle - angle), abs(found_rate - rate)))
    assert slopes(errors) == pytest.approx([ORDER[method]] * 2, abs=0.15)
    assert errors[-1] < {1: 1e-2, 4: 1e-6, 6: 1e-9}[ORDER[method]]


@pytest.fixture(scope='module')
def four_bar():
    """Return the shipped four-bar under gravity."""
    return Mechanics(Closure(shipped('four_bar')), Loads(gravity=(0.0, -9.81)))


BEGIN = 0.5
SPEED = 40.0


def turned(loaded, method, seconds, steps):
    """Return the states of a crank that turns freely, at the end of each step."""
    crank = SingleDofMechanism(loaded.motion_equation, STEP[method])
    motion = crank.state_at(BEGIN, SPEED)
    motions = [motion]
    for _ in range(steps):
        motion = crank.advance(motion, seconds / steps, 0.0)
        motions.append(motion)
    return motions


def time_to(loaded, end):
    """Return t = ∫ √(I/(2·(E − V))) dq up to an angle, by Gauss's rule on short pieces."""
    position = loaded.closure.position
    whole = loaded.total_energy(position(BEGIN), SPEED)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    edges = np.linspace(BEGIN, end, 60)
    seconds = 0.0
    for low, high in pairwise(edges):
        half = 0.5 * (high - low)
        for node, share in zip(nodes, weights, strict=True):
            at = position(float(0.5 * (low + high) + half * node))
            energy = whole - loaded.potential_energy(at)
            # At a rate of 1, twice the kinetic energy is the inertia.
            inertia = 2.0 * (loaded.total_energy(at, 1.0) - loaded.potential_energy(at))
            seconds += half * share * sqrt(inertia / (2.0 * energy))
    return seconds


@pytest.mark.parametrize(
    ('method', 'steps'),
    [
        ('semi_implicit_euler', (1000, 2000, 4000)),
        ('rk4', (250, 500, 1000)),
        ('gauss_legendre', (160, 320, 640)),
    ],
)
def test_four_bar_error_falls_with_the_method_order(four_bar, method, steps):
    seconds = 0.4
    errors, drifts = [], []
    energy = four_bar.total_energy(four_bar.closure.position(BEGIN), SPEED)
    for n in steps:
        motions = turned(four_bar, method, seconds, n)
        errors.append(abs(time_to(four_bar, motions[-1].value) - seconds))
        drifts.append(
            max(
                abs(
                    four_bar.total_energy(four_bar.closure.position(m.value), m.rate) / energy
                    - 1.0
                )
                for m in motions
            )
        )
    assert motions[-1].value > 7.0, 'more than a whole turn'
    assert slopes(errors)[-1] == pytest.approx(ORDER[method], abs=0.5)
    assert slopes(drifts)[-1] == pytest.approx(ORDER[method], abs=0.5)


@pytest.mark.sample(1)
@pytest.mark.parametrize('steps', [2000, pytest.param(50_000, marks=pytest.mark.slow)])
def test_gauss_legendre_keeps_the_energy_of_a_four_bar(four_bar, steps):
    motions = turned(four_bar, 'gauss_legendre', steps * 5e-4, steps)
    position = four_bar.closure.position
    whole = four_bar.total_energy(position(BEGIN), SPEED)
    drift = max(
        abs(four_bar.total_energy(position(m.value), m.rate) / whole - 1.0) for m in motions[::7]
    )
    assert drift < 1e-9
    assert motions[-1].value > steps * 5e-4 * 20.0, 'it has gone round all the time'


def test_gauss_coefficients_integrate_polynomials_exactly():
    # Collocation: Σ a_ij·c_jᵏ⁻¹ = c_iᵏ/k for k ≤ 3, Σ b_j·c_jᵏ⁻¹ = 1/k for k ≤ 6.
    nodes, weights = GAUSS_NODES, GAUSS_WEIGHTS
    for k in (1, 2, 3):
        for c, row in zip(nodes, GAUSS_MATRIX, strict=True):
            total = sum(a * d ** (k - 1) for a, d in zip(row, nodes, strict=True))
            assert total == pytest.approx(c**k / k, abs=1e-16)
    for k in range(1, 7):
        total = sum(b * c ** (k - 1) for b, c in zip(weights, nodes, strict=True))
        assert total == pytest.approx(1 / k, abs=1e-16)


def test_gauss_step_is_reversible():
    there = gauss_legendre(weight, 1.0, 2.0, weight(1.0, 2.0), 0.05)
    back = gauss_legendre(weight, *there, weight(*there), -0.05)
    assert back == pytest.approx((1.0, 2.0), abs=1e-15)


def test_gauss_step_returns_none_without_convergence():
    stiff = lambda value, _rate, _time: -1e9 * value  # noqa: E731
    assert gauss_legendre(stiff, 1.0, 0.0, -1e9, 1e-2) is None
    assert gauss_legendre(stiff, 1.0, 0.0, -1e9, 1e-6) is not None


@pytest.mark.parametrize('method', [rk4, gauss_legendre])
def test_integrator_returns_none_beyond_the_end_of_motion(method):
    def ends(value, _rate, _time):
        return 0.0 if value < 1.0 else None

    assert method(ends, 0.0, 1.0, 0.0, 0.5) == pytest.approx((0.5, 1.0))
    assert method(ends, 0.0, 1.0, 0.0, 1.5) is None


# The instant at which something happens within a step, against functions whose zero is known.


def found(function, end, *, exists=lambda _t: True):
    """Return instant, last state, whether it is that, and how often it was looked."""
    looks = []

    def reach(t):
        looks.append(t)
        return (t, function(t)) if exists(t) else None

    at, (time, margin), known = last_before(
        reach, lambda state: state[1], (0.0, function(0.0)), end, (end, function(end))
    )
    assert margin >= 0.0
    assert time == max([0.0, *(t for t in looks if t <= at and exists(t) and function(t) >= 0.0)])
    return at, known, len(looks)


@pytest.mark.parametrize(
    ('function', 'end', 'zero'),
    [
        (lambda t: 1.0 - 3.0 * t, 1.0, 1 / 3),
        (lambda t: 2.0 - t * t, 2.0, 2.0**0.5),
        (cos, 3.0, pi / 2),
        (lambda t: exp(-20.0 * t) - 1e-3, 5.0, 0.34538776394910684),
        (lambda t: (0.7 - t) ** 3, 1.0, 0.7),
        # At the start it leaves what it comes back to: a flight between two bounces.
        (lambda t: t * (0.01 - t), 1.0, 0.01),
        (lambda t: t * (1e-9 - t), 1.0, 1e-9),
    ],
)
def test_event_search_finds_the_zero(function, end, zero):
    at, known, looks = found(function, end)
    assert known
    assert at == pytest.approx(zero, abs=1e-5 if function(0.0) == 0.7**3 else 1e-13)
    assert looks <= 80


def test_event_search_of_smooth_functions_converges_quickly():
    for function, end in ((cos, 3.0), (lambda t: 2.0 - t * t, 2.0)):
        assert found(function, end)[2] < 20


def test_event_search_ends_before_missing_states():
    at, known, _ = found(lambda t: 1.0 - t, 2.0, exists=lambda t: t < 0.25 or t == 2.0)
    assert not known
    assert at == pytest.approx(0.25, abs=1e-13)


def test_event_search_finds_a_zero_before_a_gap():
    at, known, _ = found(lambda t: 0.125 - t, 2.0, exists=lambda t: not 0.5 < t < 1.5)
    assert known
    assert at == pytest.approx(0.125, abs=1e-13)
